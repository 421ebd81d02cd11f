//! Residuals of spectra, weighted by their covariance, against noise.

use std::f64::consts::PI;

use mechid_model::linear_algebra::svd;
use mechid_signal::Extent;
use nalgebra::{Complex, DMatrix, DVector};
use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

use super::concentration::{Part, concentration};
use super::correlation::{Correlation, share_above_of};
use super::finding::{Concentration, Finding, NoiseSource, PValue, Reference, Residual};
use super::thresholds::{LAGS, ROUNDING};
use crate::frequency_domain::{FrequencyData, NoiseSpectrum, Whitened, motion_level};
use crate::relations::Relations;
use crate::triangular::TriangularFactor;
use crate::{Estimate, EstimateError};

/// Singular value of the sensitivity (columns of unit length) relative to the largest, below which a
/// combination of parameters has no effect.
const RANK: f64 = 1e-12;

/// Maximum distance of lines, counted in lines of the fit, at which residuals are correlated.
const DISTANCES: usize = 12;

/// Minimum number of lines per such distance, and per lag of the correlation with a force: more would
/// leave no direction in which noise and an error of the model differ.
const LINES_PER_CORRELATION: usize = 8;

/// Minimum number of residuals, real and imaginary parts, that the parameters leave free.
const FREE_RESIDUALS: f64 = 8.0;

/// Variance that the noise of the forces makes of a response over that of its own noise, above which it decides.
const DECIDES: f64 = 10.0;

/// Loads of the ends of a record that a channel is fitted with.
const LOADS: f64 = 6.0;

/// Maximum number of Gauss–Newton steps from the estimate to the most likely parameters.
const STEPS: usize = 8;

/// Residual power that another such step removes, over the variance of a residual, below which there is
/// none.
const SETTLED: f64 = 0.01;

/// Maximum number of sensitivities, residuals times parameters; of larger fits the residual is tested as
/// the estimate leaves it.
const SENSITIVITIES: usize = 1 << 24;

/// Likewise, maximum number of products, sensitivities times parameters: some seconds.
const PRODUCTS: usize = 1 << 32;

/// Result of the tests after a fit of spectra.
#[derive(Debug, Clone)]
pub struct AfterSpectralFit {
    /// Residual of each record.
    pub records: Vec<SpectralResidual>,
    /// Test for a bias of the estimate ([`Finding::Bias`]); `None` where a record states no noise or the
    /// standard errors of the estimate are not known.
    pub bias: Option<Finding>,
}

/// Weights the residuals of a fit of spectra by their own covariance, and tests the estimate for a bias.
///
/// The covariance follows from the noise of force and response that the data state. Of the weighted
/// residual, the part that other parameters explain is removed by a few Gauss–Newton steps of maximum
/// likelihood: the tests of [`SpectralResidual::findings`] judge the model, whatever the estimator, and
/// its bias has a test of its own: the sum of those steps against the standard errors of the estimate, all
/// parameters together and the one that changes most alone.
/// Where a record states no noise, or only rounding, all residuals are weighted as white noise on the
/// response, beside that of the forces if the data know it.
///
/// Of an open record, its own ends taken off, the noise begins and ends at values that differ: that jump, which ties
/// low lines together, is left out of the tests.
///
/// # Errors
/// [`EstimateError::Size`] if the estimate has another number of degrees of freedom than the data.
///
/// # Source
/// Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, the chapters on maximum
/// likelihood and on model validation; Hausman (1978), Econometrica 46, 1251–1271, for the bias, here
/// with the covariance of the estimate, which is an upper bound of that of the difference.
pub fn after_spectral_fit(
    records: &[FrequencyData],
    estimate: &Estimate,
    extent: Extent,
) -> Result<AfterSpectralFit, EstimateError> {
    for data in records {
        let what = "degrees of freedom of the data";
        crate::least_squares::size(what, data.dof(), estimate.dof())?;
    }
    let Some(fit) = WeightedFit::of(records, estimate, extent) else {
        return Ok(AfterSpectralFit { records: Vec::new(), bias: None });
    };
    let noise_stated = fit.records.iter().all(|record| record.noise_stated);
    let bias = if noise_stated { fit.bias(estimate) } else { None };
    Ok(AfterSpectralFit { records: fit.records, bias })
}

/// Residuals of all records of a fit.
struct WeightedFit {
    records: Vec<SpectralResidual>,
    /// Change of the parameters from the estimate to the most likely ones.
    step: Option<DVector<f64>>,
}

/// Weighted residuals of all records, and their sensitivities in an orthonormal basis.
struct Linearised {
    weighted: Vec<Whitened>,
    /// Combinations of parameters, one per column, that change the residuals by orthonormal columns.
    basis: DMatrix<f64>,
    /// Orthonormal columns that the parameters explain.
    explained: Vec<DMatrix<f64>>,
    /// Scalar products of the residuals with those columns.
    coefficients: DVector<f64>,
}

impl Linearised {
    fn of(weighted: Vec<Whitened>) -> Option<Self> {
        let basis = orthonormal_basis(&weighted)?;
        let explained: Vec<DMatrix<f64>> =
            weighted.iter().map(|record| &record.sensitivity * &basis).collect();
        let products = explained.iter().zip(&weighted).map(|(q, w)| q.tr_mul(&w.residual));
        let coefficients =
            products.fold(DVector::zeros(basis.ncols()), |sum, product| sum + product);
        Some(Self { weighted, basis, explained, coefficients })
    }

    /// Residuals of which the parameters are taken to explain nothing.
    fn without_sensitivity(weighted: Vec<Whitened>, parameters: usize) -> Self {
        let nothing = |record: &Whitened| DMatrix::zeros(record.residual.len(), 0);
        Self {
            explained: weighted.iter().map(nothing).collect(),
            weighted,
            basis: DMatrix::zeros(parameters, 0),
            coefficients: DVector::zeros(0),
        }
    }

    fn power(&self) -> f64 {
        self.weighted.iter().map(|record| record.residual.norm_squared()).sum()
    }

    /// Gauss–Newton step of the parameters.
    fn step(&self) -> DVector<f64> {
        &self.basis * &self.coefficients
    }
}

/// Residual of one record of a fit of spectra, in units of its noise.
#[derive(Debug, Clone)]
pub struct SpectralResidual {
    data: FrequencyData,
    /// Otherwise the weights are those of white noise of unknown level.
    noise_stated: bool,
    /// Weighted residual less the part that the step explains.
    values: DVector<f64>,
    /// Q of the covariance I − QQᵀ of the values.
    explained: DMatrix<f64>,
    /// Standard deviation of every residual before the parameters were fitted, from its own size.
    deviations: DVector<f64>,
    /// QᵀΣQ with the squares Σ of those deviations.
    explained_spread: DMatrix<f64>,
    rounding: bool,
    /// Power of the residual over that of the noise, on the lines on which that of the forces decides, and the
    /// probability that it is as little.
    force_decides: Option<(f64, f64)>,
    /// Few lines that hold the misfit of all records.
    concentration: Option<Concentration>,
}

impl WeightedFit {
    fn of(records: &[FrequencyData], estimate: &Estimate, extent: Extent) -> Option<Self> {
        let noise: Option<Vec<&NoiseSpectrum>> =
            records.iter().map(FrequencyData::noise_above_rounding).collect();
        let levels = levels(records, estimate)?;
        let relations = Relations::of(estimate.unknowns());
        let entries: Vec<f64> = estimate.parameters().map(|p| p.value).collect();
        let start = match &relations {
            None => DVector::from_column_slice(&entries),
            Some(relations) => relations.unknowns(&entries),
        };
        let rows: usize = records.iter().map(|data| 2 * data.dof() * data.len()).sum();
        let sensitivities = rows * start.len();
        let small = sensitivities <= SENSITIVITIES && sensitivities * start.len() <= PRODUCTS;
        let covariance = |at: usize, row: usize| match &noise {
            Some(noise) => noise[at].covariance(row).clone(),
            None => white_covariance(&records[at], row, &levels),
        };
        let linearised = |values: &DVector<f64>| -> Option<Linearised> {
            let entries = relations.as_ref().map(|relations| relations.entries(values.as_slice()));
            let (entries, unknowns) = (entries.as_ref().unwrap_or(values), estimate.unknowns());
            let one = |(at, data): (usize, &FrequencyData)| {
                let covariance = |row: usize| covariance(at, row);
                match small {
                    true => Whitened::of(data, unknowns, entries, covariance),
                    false => Whitened::residual_of(data, unknowns, entries, covariance),
                }
            };
            let weighted = records.iter().enumerate().map(one).collect::<Option<_>>()?;
            match small {
                true => Linearised::of(weighted),
                false => Some(Linearised::without_sensitivity(weighted, values.len())),
            }
        };
        let mut values = start.clone();
        let mut linear = linearised(&values)?;
        for _ in 0..STEPS {
            let unit = (linear.power() / (rows as f64)).max(f64::MIN_POSITIVE);
            if linear.coefficients.norm_squared() <= SETTLED * unit {
                break;
            }
            // Half a step where a whole one goes too far.
            let next = [1.0, 0.5, 0.25, 0.125].iter().find_map(|length| {
                let values = &values + linear.step() * *length;
                let next = linearised(&values)?;
                (next.power() < linear.power()).then_some((values, next))
            });
            let Some(next) = next else { break };
            (values, linear) = next;
        }
        let end = &values + linear.step();
        let entries_of = |values: &DVector<f64>| match &relations {
            None => values.clone(),
            Some(relations) => relations.entries(values.as_slice()),
        };
        let jumps = |at: usize| -> Vec<DVector<f64>> {
            let jump = |channel| {
                let (data, unknowns) = (records[at].of_jump(channel), estimate.unknowns());
                let covariance = |row| covariance(at, row);
                Whitened::residual_of(&data, unknowns, &entries_of(&values), covariance)
            };
            let channels = if extent == Extent::Open { records[at].dof() } else { 0 };
            (0..channels).filter_map(jump).map(|jump| jump.residual).collect()
        };
        let step = match &relations {
            None => end - start,
            Some(relations) => relations.entries(end.as_slice()) - DVector::from_vec(entries),
        };
        let Linearised { weighted, explained, coefficients, .. } = linear;
        let residuals = records.iter().enumerate().zip(weighted).zip(explained);
        let residuals = residuals.map(|(((at, data), weighted), explained)| {
            let values = weighted.residual - &explained * &coefficients;
            let (values, explained) = without(&jumps(at), values, explained);
            let deviations = deviations(&values, &explained);
            let mut spread = explained.clone();
            for mut column in spread.column_iter_mut() {
                column.component_mul_assign(&deviations);
            }
            SpectralResidual {
                data: data.clone(),
                noise_stated: noise.is_some(),
                explained_spread: spread.transpose() * &spread,
                deviations,
                values,
                explained,
                rounding: is_rounding(data, &levels),
                force_decides: if noise.is_none() { force_decides(data, estimate) } else { None },
                concentration: None,
            }
        });
        let mut records: Vec<SpectralResidual> = residuals.collect();
        let parts: Vec<Part<'_>> = records.iter().filter_map(SpectralResidual::part).collect();
        if parts.len() == records.len() {
            let lines = concentration(&parts);
            records.iter_mut().for_each(|record| record.concentration = lines.clone());
        }
        Some(Self { records, step: small.then_some(step) })
    }

    fn bias(&self, estimate: &Estimate) -> Option<Finding> {
        let errors: Vec<f64> = estimate.parameters().map(|p| p.standard_error).collect();
        if errors.is_empty() || errors.iter().any(|error| !(*error > 0.0 && error.is_finite())) {
            return None;
        }
        let (scale, change) = (DVector::from_vec(errors), self.step.as_ref()?);
        let step = change.component_div(&scale);
        let mut correlation = estimate.covariance();
        for (mut column, size) in correlation.column_iter_mut().zip(&scale) {
            column.iter_mut().zip(&scale).for_each(|(entry, other)| *entry /= other * size);
        }
        let count = scale.len() as f64;
        let together = match estimate.unknowns().is_related() {
            false => {
                let statistic = step.dot(&correlation.cholesky()?.solve(&step));
                ChiSquared::new(count).expect("at least one parameter").sf(statistic)
            }
            // Entries that follow from others have no inverse of their covariance.
            true => 1.0,
        };
        let largest = step.iamax();
        let alone = 2.0 * count * Normal::standard().sf(step[largest].abs());
        let parameter = estimate.parameters().nth(largest)?;
        Some(Finding::Bias {
            p_value: PValue::of((2.0 * together.min(alone)).min(1.0)),
            parameter: parameter.parameter,
            estimate: parameter.value,
            unbiased: parameter.value + change[largest],
            standard_error: parameter.standard_error,
            reference: Reference::MaximumLikelihood,
        })
    }
}

/// Level of white noise on each channel in the quantity measured, over all records: the RMS residual or, beside
/// stated noise of the forces, the most likely one.
fn levels(records: &[FrequencyData], estimate: &Estimate) -> Option<Vec<f64>> {
    let each = residuals(records, estimate)?;
    Some(each.into_iter().map(|pairs| motion_level(pairs.into_iter())).collect())
}

/// Power of the residual of each channel in the quantity measured, with the variance that the noise of the forces
/// makes of it, over all records.
fn residuals(records: &[FrequencyData], estimate: &Estimate) -> Option<Vec<Vec<(f64, f64)>>> {
    let system = estimate.system().ok()?;
    let mut residuals = vec![Vec::new(); system.dof()];
    for data in records {
        for (row, omega) in data.omega().iter().enumerate() {
            let receptance = system.receptance(*omega).ok()?;
            let scale = data.measured().per_displacement(*omega).norm_sqr();
            let modelled = &receptance * data.force().row(row).transpose();
            let residual = data.displacement().row(row).transpose() - modelled;
            let variance = data.force_variance().row(row).transpose();
            let by_force = receptance.map(|g| g.norm_sqr()) * variance;
            for (channel, pairs) in residuals.iter_mut().enumerate() {
                pairs.push((scale * residual[channel].norm_sqr(), scale * by_force[channel]));
            }
        }
    }
    Some(residuals)
}

/// Power of the residual over that of the noise, on the lines on which that of the forces decides, with the
/// probability of so little times the number of channels; of the channel where it is least probable. `None` where
/// no noise of the forces is stated, or where it decides on too few lines.
fn force_decides(data: &FrequencyData, estimate: &Estimate) -> Option<(f64, f64)> {
    if data.force_variance().iter().all(|variance| *variance == 0.0) {
        return None;
    }
    let residuals = residuals(std::slice::from_ref(data), estimate)?;
    let channels = residuals.len() as f64;
    let fitted = estimate.parameters().len() as f64 / channels + LOADS;
    let of_channel = |pairs: Vec<(f64, f64)>| {
        let own = motion_level(pairs.iter().copied()).powi(2);
        let decided = pairs.iter().filter(|(_, known)| *known > DECIDES * own);
        let (count, over) = decided.fold((0.0, 0.0), |(count, over), (power, known)| {
            (count + 1.0, over + power / (own + known))
        });
        // A sum of squares of complex numbers has two degrees of freedom each.
        let free = 2.0 * count - fitted;
        if free < FREE_RESIDUALS {
            return None;
        }
        let below = ChiSquared::new(free).ok()?.cdf(2.0 * over);
        Some((2.0 * over / free, (channels * below).min(1.0)))
    };
    residuals.into_iter().filter_map(of_channel).min_by(|a, b| a.1.total_cmp(&b.1))
}

/// Returns whether the residual of every channel is rounding.
fn is_rounding(data: &FrequencyData, levels: &[f64]) -> bool {
    let rms = |channel: usize| {
        let lines = data.displacement().column(channel);
        let power = lines
            .iter()
            .zip(data.omega())
            .map(|(x, omega)| (x * data.measured().per_displacement(*omega)).norm_sqr());
        (power.sum::<f64>() / data.len() as f64).sqrt()
    };
    levels.iter().enumerate().all(|(channel, level)| *level <= ROUNDING * rms(channel))
}

/// Covariance of displacement and force for white noise of these levels on the quantity measured, and what noise of
/// the forces is stated.
fn white_covariance(data: &FrequencyData, row: usize, levels: &[f64]) -> DMatrix<Complex<f64>> {
    let (n, mut covariance) = (data.dof(), DMatrix::zeros(2 * data.dof(), 2 * data.dof()));
    let scale = data.measured().per_displacement(data.omega()[row]).norm();
    // A channel without any residual must not take all the weight.
    let least = levels.iter().copied().fold(0.0, f64::max) * 1e-6;
    for (channel, level) in levels.iter().enumerate().take(n) {
        let level = level.max(least).max(f64::MIN_POSITIVE) / scale;
        covariance[(channel, channel)] = Complex::from(level * level);
        let of_force = data.force_variance()[(row, channel)];
        covariance[(n + channel, n + channel)] = Complex::from(of_force);
    }
    covariance
}

/// B for which J B of the stacked sensitivities J has orthonormal columns that span those of J.
fn orthonormal_basis(records: &[Whitened]) -> Option<DMatrix<f64>> {
    let parameters = records.first()?.sensitivity.ncols();
    let mut factor = TriangularFactor::new(parameters);
    for record in records {
        factor.push(&[record.sensitivity.as_view()]).then_some(())?;
    }
    let mut r = factor.r().clone();
    let mut scale = DVector::from_element(parameters, 1.0);
    for (mut column, scale) in r.column_iter_mut().zip(scale.iter_mut()) {
        let length = column.norm();
        if length > 0.0 {
            *scale = length;
            column /= length;
        }
    }
    // Without dependent parameters the triangle alone tells, in a fraction of the time.
    if let Some(inverse) = r.solve_upper_triangular(&DMatrix::identity(parameters, parameters))
        && r.norm() * inverse.norm() * RANK < 1.0
    {
        let mut basis = inverse;
        basis.column_iter_mut().for_each(|mut column| column.component_div_assign(&scale));
        return Some(basis);
    }
    let svd = svd(r).ok()?;
    let (singular, v_t) = (&svd.singular_values, svd.v_t.as_ref()?);
    let kept: Vec<usize> =
        (0..parameters).filter(|at| singular[*at] > RANK * singular.max()).collect();
    Some(DMatrix::from_fn(parameters, kept.len(), |row, column| {
        v_t[(kept[column], row)] / (singular[kept[column]] * scale[row])
    }))
}

impl SpectralResidual {
    /// Tests the power of the residual against the noise, if it is stated ([`Finding::Misfit`]), and its
    /// correlation from line to line ([`Finding::Whiteness`]) and with the forces
    /// ([`Finding::CrossCorrelation`]). Residuals of rounding pass. Empty if the parameters leave too
    /// few residuals free.
    ///
    /// # Source
    /// Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, the chapter on model
    /// validation (whiteness of the residuals, Hotelling's T² with a covariance sampled from complex
    /// numbers).
    pub fn findings(&self) -> Vec<Finding> {
        let mut findings = Vec::new();
        let free = self.values.len() as f64 - self.explained.norm_squared();
        if free < FREE_RESIDUALS {
            return findings;
        }
        if self.noise_stated && !self.rounding {
            findings.extend(self.data.noise().and_then(|noise| self.misfit(noise)));
        }
        if let Some((ratio, p_value)) = self.force_decides {
            let (p_value, source) = (PValue::of(p_value), NoiseSource::Force);
            findings.push(Finding::Misfit { ratio, p_value, source, concentration: None });
        }
        let dof = self.data.dof();
        let of_channel = |residual: usize| {
            let whiteness = self.line_to_line(residual).map(|correlation| Finding::Whiteness {
                residual: Residual::Lines { residual },
                test: correlation.test(self.rounding),
                span: None,
            });
            let with_forces = (0..dof).filter_map(move |force| {
                let test = self.with_force(residual, force)?.test(self.rounding);
                Some(Finding::CrossCorrelation { residual, force, test })
            });
            whiteness.into_iter().chain(with_forces).collect::<Vec<_>>()
        };
        let correlations: Vec<Vec<Finding>> = (0..dof).into_par_iter().map(of_channel).collect();
        findings.extend(correlations.into_iter().flatten());
        findings
    }

    /// Returns the input of the search for disturbed lines; `None` if no noise is stated.
    fn part(&self) -> Option<Part<'_>> {
        let noise = self.data.noise().filter(|_| self.noise_stated && !self.rounding)?;
        let (n, nu) = (self.data.dof() as f64, noise.degrees_of_freedom());
        Some(Part {
            omega: self.data.omega(),
            dof: self.data.dof(),
            values: &self.values,
            explained: &self.explained,
            unit: if nu > n + 1.0 && nu.is_finite() { nu / (nu - n) } else { 1.0 },
        })
    }

    /// Number of degrees of freedom, each with a channel of the residual and one of the force.
    pub fn dof(&self) -> usize {
        self.data.dof()
    }

    /// Residual power against its expectation for noise of covariances sampled from few periods.
    fn misfit(&self, noise: &NoiseSpectrum) -> Option<Finding> {
        let (n, rows) = (self.data.dof() as f64, self.data.len() as f64);
        let nu = noise.degrees_of_freedom();
        // Rows with a common covariance make one statistic.
        let groups = noise.groups();
        let each = rows / groups;
        let (mean, variance) = if nu.is_infinite() {
            (n * rows, n * rows)
        } else {
            if nu <= n + 1.0 {
                return None;
            }
            let mean = n * each * nu / (nu - n);
            let square = n * each * (n * each + 1.0) * nu * nu / ((nu - n) * (nu - n - 1.0));
            (groups * mean, groups * (square - mean * mean))
        };
        let gram = self.explained.transpose() * &self.explained;
        let all = self.values.len() as f64;
        let free = (all - gram.trace()) / all;
        let spread = (all - 2.0 * gram.trace() + gram.norm_squared()) / all;
        // Real and imaginary parts have unit variance each.
        let power = 0.5 * self.values.norm_squared();
        let (mean, variance) = (mean * free, variance * spread);
        // Too little is no noise, either: then the periods differ by more than noise.
        let above = share_above_of(power, mean, 0.5 * variance);
        let p_value = PValue::of(2.0 * above.min(1.0 - above));
        let is_excess = p_value.is_significant() && power > mean;
        let concentration = self.concentration.clone().filter(|_| is_excess);
        let source = NoiseSource::Periods;
        Some(Finding::Misfit { ratio: power / mean, p_value, source, concentration })
    }

    /// Places of the lines by rising frequency.
    fn ascending(&self) -> Vec<usize> {
        let mut rows: Vec<usize> = (0..self.data.len()).collect();
        rows.sort_by(|a, b| self.data.omega()[*a].total_cmp(&self.data.omega()[*b]));
        rows
    }

    /// Row of the real part of a line and channel; that of the imaginary part is the next.
    fn row(&self, line: usize, channel: usize) -> usize {
        2 * (self.data.dof() * line + channel)
    }

    /// Correlation of the residual of a channel from line to line: real and imaginary part of
    /// Σ r̄(l) r(l + d), less their expectation, at the distances d = 1, 2 … in lines of the fit. `None` if
    /// there are too few lines or the residual is zero.
    ///
    /// For given |r| the phases of independent lines are random, whatever the colour of the noise: that
    /// gives the variances of the products and the covariances of their squares.
    ///
    /// # Panics
    /// If there is no such channel.
    ///
    /// # Source
    /// Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, the chapter on model
    /// validation; White (1980), Econometrica 48, 817–838, for the variance.
    pub fn line_to_line(&self, channel: usize) -> Option<Correlation> {
        let rows: Vec<usize> =
            self.ascending().into_iter().map(|line| self.row(line, channel)).collect();
        let last = DISTANCES.min(rows.len() / LINES_PER_CORRELATION);
        if last == 0 {
            return None;
        }
        let complex = |values: &[f64]| -> Vec<Complex<f64>> {
            rows.iter().map(|row| Complex::new(values[*row], values[row + 1])).collect()
        };
        let product = |r: &[Complex<f64>], distance: usize| -> Complex<f64> {
            r.iter().zip(&r[distance..]).map(|(a, b)| a.conj() * b).sum()
        };
        let residual = complex(self.values.as_slice());
        let explained: Vec<Vec<Complex<f64>>> =
            self.explained.column_iter().map(|q| complex(q.as_slice())).collect();
        let powers: Vec<f64> = residual.iter().map(|r| r.norm_sqr()).collect();
        let power: f64 = powers.iter().sum();
        if power == 0.0 {
            return None;
        }
        let explained_power: f64 = explained.iter().flatten().map(|q| q.norm_sqr()).sum();
        // Variance of a real or imaginary part that the parameters do not reduce.
        let unit = power / (2.0 * rows.len() as f64 - explained_power);
        let variance = |distance: usize| -> f64 {
            powers.iter().zip(&powers[distance..]).map(|(a, b)| a * b).sum()
        };
        let (mut coefficients, mut statistic) = (Vec::new(), 0.0);
        for distance in 1..=last {
            let expected: Complex<f64> = explained.iter().map(|q| product(q, distance)).sum();
            let deviation = product(&residual, distance) + expected * unit;
            coefficients.extend([deviation.re / power, deviation.im / power]);
            statistic += deviation.norm_sqr() / variance(distance);
        }
        let mut square = 0.0;
        for a in 1..=last {
            for b in 1..=last {
                square += covariance_of_squares(&powers, a, b) / (variance(a) * variance(b));
            }
        }
        Some(Correlation {
            coefficients,
            bound: 1.96 * (0.5 / rows.len() as f64).sqrt(),
            statistic,
            // A square of a complex number is half a sum of two.
            p_value: share_above_of(statistic, last as f64, 0.5 * square),
        })
    }

    /// Correlation of the residual of a channel with a force, Re Σ F̄(l) r(l) e^{iωτ}, at an odd number of
    /// lags τ, multiples of [`SpectralResidual::lag`] around 0: up to 51, fewer where there are few lines.
    /// `None` if the force is zero.
    ///
    /// # Panics
    /// If there is no such channel or force.
    ///
    /// # Source
    /// White (1980), Econometrica 48, 817–838, for the covariance of the correlations; Box (1954),
    /// Annals of Mathematical Statistics 25, 290–302, for their sum of squares.
    pub fn with_force(&self, channel: usize, force: usize) -> Option<Correlation> {
        let lines = self.data.len();
        let forces = self.data.force().column(force);
        let rows: Vec<usize> = (0..lines).map(|line| self.row(line, channel)).collect();
        let (lags, lag) = (LAGS.min(lines / LINES_PER_CORRELATION), self.lag());
        let mut weights = DMatrix::zeros(2 * lags + 1, 2 * lines);
        for (line, (f, omega)) in forces.iter().zip(self.data.omega()).enumerate() {
            // From lag to lag by the same angle.
            let turn = Complex::cis(omega * lag);
            let mut weight = f.conj() * Complex::cis(-omega * lag * lags as f64);
            for at in 0..weights.nrows() {
                // Re(w r) = Re w Re r − Im w Im r.
                weights[(at, 2 * line)] = weight.re;
                weights[(at, 2 * line + 1)] = -weight.im;
                weight *= turn;
            }
        }
        let places: Vec<usize> = rows.iter().flat_map(|row| [*row, row + 1]).collect();
        let residual =
            DVector::from_iterator(places.len(), places.iter().map(|row| self.values[*row]));
        let products = &weights * &residual;
        let covariance = self.covariance(&weights, &places)?;
        let size = residual.norm() * forces.norm();
        let mean = covariance.trace();
        Some(Correlation {
            coefficients: products.iter().map(|product| product / size).collect(),
            bound: 1.96 * (mean / weights.nrows() as f64).sqrt() / size,
            statistic: products.norm_squared() / mean * weights.nrows() as f64,
            p_value: share_above_of(products.norm_squared(), mean, covariance.norm_squared()),
        })
    }

    /// Lag at which the correlation with a force is computed, in s: half a period of the highest line.
    pub fn lag(&self) -> f64 {
        PI / self.data.omega().iter().copied().fold(0.0, f64::max)
    }

    /// Covariance A P Σ P Aᵀ of weighted sums A over the `own` rows, with P = I − QQᵀ and the variances
    /// Σ that the residuals show themselves.
    fn covariance(&self, weights: &DMatrix<f64>, places: &[usize]) -> Option<DMatrix<f64>> {
        let scaled = |mut matrix: DMatrix<f64>| {
            for (mut column, row) in matrix.column_iter_mut().zip(places) {
                column *= self.deviations[*row];
            }
            matrix
        };
        let explained = self.explained.select_rows(places);
        let loads = weights * &explained;
        let white = scaled(weights.clone());
        let cross = &white * scaled(explained.transpose()).transpose() * loads.transpose();
        let inner = &loads * &self.explained_spread * loads.transpose();
        let covariance = &white * white.transpose() - &cross - cross.transpose() + inner;
        (covariance.trace() > 0.0).then_some(covariance)
    }
}

/// Standard deviation of every residual before the parameters were fitted, from its own size.
fn deviations(values: &DVector<f64>, explained: &DMatrix<f64>) -> DVector<f64> {
    let leverage = |row: usize| explained.row(row).norm_squared();
    let mut deviations = DVector::zeros(values.len());
    for row in (0..values.len()).step_by(2) {
        let power = values[row].powi(2) + values[row + 1].powi(2);
        let free = (2.0 - leverage(row) - leverage(row + 1)).max(0.5);
        deviations[row] = (power / free).sqrt();
        deviations[row + 1] = deviations[row];
    }
    deviations
}

/// Leaves some `parts` out of the values, and adds them to the orthonormal columns that are explained.
fn without(
    parts: &[DVector<f64>],
    mut values: DVector<f64>,
    mut explained: DMatrix<f64>,
) -> (DVector<f64>, DMatrix<f64>) {
    for part in parts {
        let mut column = part.unscale(part.norm());
        for _ in 0..2 {
            column -= &explained * explained.tr_mul(&column);
        }
        let left = column.norm();
        if left > RANK.sqrt() {
            column.unscale_mut(left);
            values.axpy(-column.dot(&values), &column, 1.0);
            let at = explained.ncols();
            explained = explained.insert_column(at, 0.0);
            explained.set_column(at, &column);
        }
    }
    (values, explained)
}

/// Covariance of |p(a)|² and |p(b)|², where p(d) = Σ r̄(l) r(l + d) and the r have random phases and the
/// given squares |r|².
fn covariance_of_squares(powers: &[f64], a: usize, b: usize) -> f64 {
    let parallelograms: f64 = (0..powers.len().saturating_sub(a + b))
        .map(|l| powers[l] * powers[l + a] * powers[l + b] * powers[l + a + b])
        .sum();
    let diagonal = || -> f64 {
        let pairs = || powers.iter().zip(&powers[a..]).map(|(x, y)| x * y);
        pairs().sum::<f64>().powi(2) - pairs().map(|pair| pair * pair).sum::<f64>()
    };
    2.0 * parallelograms + if a == b { diagonal() } else { 0.0 }
}
