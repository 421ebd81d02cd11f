//! Residuals of spectra weighted by their covariance, without the part that other values of the
//! parameters explain.

use mechid_estimate::Relations;
use mechid_estimate::frequency_domain::Whitened;
use mechid_estimate::{Estimate, EstimateError};
use mechid_model::SecondOrderSystem;
use mechid_numerics::check_size;
use mechid_numerics::linear_algebra::svd;
use mechid_numerics::triangular::TriangularFactor;
use mechid_signal::Extent;
use mechid_spectra::noise::level::motion_level;
use mechid_spectra::{FrequencyData, NoiseModel, NoiseSpectrum};
use nalgebra::{Complex, DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

use super::bias::{Bias, Reference};
use super::concentration::{Part, concentration};
use super::finding::Finding;
use super::limits::ROUNDING;
use super::limits::{
    FIT_DECIDES, FIT_PRODUCTS, FIT_RANK, FIT_SETTLED, FIT_STEPS, FREE_RESIDUALS, MAX_SENSITIVITIES,
    TRANSIENT_TERMS,
};
use super::p_value::PValue;
use super::spectral_residual::SpectralResidual;

/// Result of the tests after a fit of spectra.
#[derive(Debug, Clone)]
pub struct AfterSpectralFit {
    /// Residual of each record.
    pub records: Vec<SpectralResidual>,
    /// Test for a bias of the estimate ([`Finding::Bias`]); `None` if a record states no noise or
    /// the standard errors of the estimate are unknown.
    pub bias: Option<Finding>,
}

/// Weights the residuals of a fit of spectra by their own covariance, and tests the estimate for a
/// bias.
///
/// The covariance follows from the noise of force and response that the data state. A few
/// Gauss–Newton steps of maximum likelihood remove the part of the weighted residual that other
/// values of the parameters explain: the tests of [`SpectralResidual::findings`] then concern the
/// model and not the estimator. The bias of the estimator has a separate test: the sum of these
/// steps relative to the standard errors of the estimate, for all parameters together and for the
/// one with the largest change. If a record states no noise, or only rounding, all residuals are
/// weighted as for white noise on the response, plus the stated noise of the forces.
///
/// Noise in an open record has different values at its two ends. This jump between final and
/// initial value correlates the low lines, and is projected out of the tests. The transients of the
/// response have been subtracted from the data. The transients of the response to an unmeasured
/// force in several periods are projected out, too, if the noise is such a response.
///
/// # Errors
/// [`NumericsError::Size`](mechid_numerics::NumericsError::Size) if the estimate has another number
/// of degrees of freedom than the data.
///
/// # Source
/// Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, the chapters on
/// maximum likelihood and on model validation; Hausman (1978), Econometrica 46, 1251–1271, for the
/// bias, here with the covariance of the estimate, an upper bound of the covariance of the
/// difference.
pub fn after_spectral_fit(
    records: &[FrequencyData],
    estimate: &Estimate,
    extent: Extent,
) -> Result<AfterSpectralFit, EstimateError> {
    for data in records {
        let what = "degrees of freedom of the data";
        check_size(what, data.dof(), estimate.dof())?;
    }
    let Some(fit) = WeightedFit::new(records, estimate, extent) else {
        return Ok(AfterSpectralFit { records: Vec::new(), bias: None });
    };
    let bias = if fit.noise_stated { fit.bias(estimate) } else { None };
    Ok(AfterSpectralFit { records: fit.records, bias })
}

/// Residuals of all records of a fit.
struct WeightedFit {
    records: Vec<SpectralResidual>,
    /// True if every record states its noise.
    noise_stated: bool,
    /// Change of the parameters from the estimate to the most likely values.
    step: Option<DVector<f64>>,
}

/// Weighted residuals of all records, and their sensitivities in an orthonormal basis.
struct Linearised {
    weighted: Vec<Whitened>,
    /// Combinations of parameters, one per column, whose effects on the residuals are orthonormal.
    basis: DMatrix<f64>,
    /// Columns that span the effect of the parameters, one matrix per record; they are orthonormal
    /// over all records together.
    explained: Vec<DMatrix<f64>>,
    /// Scalar products of the residuals with the columns of `explained`.
    coefficients: DVector<f64>,
}

impl Linearised {
    fn new(weighted: Vec<Whitened>) -> Option<Self> {
        let basis = orthonormal_basis(&weighted)?;
        let explained: Vec<DMatrix<f64>> =
            weighted.iter().map(|record| &record.sensitivity * &basis).collect();
        let products = explained.iter().zip(&weighted).map(|(q, w)| q.tr_mul(&w.residual));
        let coefficients =
            products.fold(DVector::zeros(basis.ncols()), |sum, product| sum + product);
        Some(Self { weighted, basis, explained, coefficients })
    }

    /// Creates the residuals of a fit whose sensitivities are not used: the parameters explain no
    /// part of these residuals.
    fn without_sensitivity(weighted: Vec<Whitened>, parameters: usize) -> Self {
        let no_columns = |record: &Whitened| DMatrix::zeros(record.residual.len(), 0);
        Self {
            explained: weighted.iter().map(no_columns).collect(),
            weighted,
            basis: DMatrix::zeros(parameters, 0),
            coefficients: DVector::zeros(0),
        }
    }

    fn power(&self) -> f64 {
        self.weighted.iter().map(|record| record.residual.norm_squared()).sum()
    }

    /// Returns the Gauss–Newton step of the parameters.
    fn step(&self) -> DVector<f64> {
        &self.basis * &self.coefficients
    }
}

/// Records of a fit with the weights of their residuals.
pub(super) struct Weighing<'a> {
    records: &'a [FrequencyData],
    estimate: &'a Estimate,
    relations: Option<Relations>,
    /// Noise that every record states; `None` if one of them does not.
    noise: Option<Vec<&'a NoiseSpectrum>>,
    /// Levels of white noise, used if no noise is stated.
    levels: Vec<f64>,
    /// `true` if the number of sensitivities is within the limits.
    small: bool,
    extent: Extent,
}

impl<'a> Weighing<'a> {
    pub(super) fn new(
        records: &'a [FrequencyData],
        estimate: &'a Estimate,
        extent: Extent,
    ) -> Option<Self> {
        let noise = records.iter().map(FrequencyData::noise_above_rounding).collect();
        let levels = levels(records, estimate)?;
        let relations = Relations::from_unknowns(estimate.unknowns());
        let mut weighing =
            Self { records, estimate, relations, noise, levels, small: false, extent };
        let unknowns = weighing.estimated_parameters().len();
        let sensitivities = weighing.rows() * unknowns;
        weighing.small =
            sensitivities <= MAX_SENSITIVITIES && sensitivities * unknowns <= FIT_PRODUCTS;
        Some(weighing)
    }

    fn rows(&self) -> usize {
        self.records.iter().map(|data| 2 * data.dof() * data.len()).sum()
    }

    /// Returns the estimated entries of M, C and K.
    fn entries(&self) -> Vec<f64> {
        self.estimate.parameters().map(|p| p.value).collect()
    }

    /// Returns the estimated parameters.
    fn estimated_parameters(&self) -> DVector<f64> {
        match &self.relations {
            None => DVector::from_vec(self.entries()),
            Some(relations) => relations.unknowns(&self.entries()),
        }
    }

    fn entries_of(&self, values: &DVector<f64>) -> DVector<f64> {
        match &self.relations {
            None => values.clone(),
            Some(relations) => relations.entries(values.as_slice()),
        }
    }

    fn covariance(&self, at: usize, row: usize) -> DMatrix<Complex<f64>> {
        match &self.noise {
            Some(noise) => noise[at].covariance(row).clone(),
            None => white_covariance(&self.records[at], row, &self.levels),
        }
    }

    fn linearised(&self, values: &DVector<f64>) -> Option<Linearised> {
        let (entries, unknowns) = (&self.entries_of(values), self.estimate.unknowns());
        let one = |(at, data): (usize, &FrequencyData)| {
            let covariance = |row: usize| self.covariance(at, row);
            if self.small {
                Whitened::new(data, unknowns, entries, covariance)
            } else {
                Whitened::residual_of(data, unknowns, entries, covariance)
            }
        };
        let weighted = self.records.iter().enumerate().map(one).collect::<Option<_>>()?;
        if self.small {
            Linearised::new(weighted)
        } else {
            Some(Linearised::without_sensitivity(weighted, values.len()))
        }
    }

    /// Returns the weighted residual of the estimate for modified data of a record. The weights
    /// include the modified noise of the forces.
    pub(super) fn residual_of(&self, at: usize, data: &FrequencyData) -> Option<DVector<f64>> {
        let (entries, unknowns) = (DVector::from_vec(self.entries()), self.estimate.unknowns());
        let covariance = |row: usize| {
            let mut covariance = self.covariance(at, row);
            let before = self.records[at].force_variance().row(row);
            for (channel, before) in before.iter().enumerate().filter(|(_, v)| **v > 0.0) {
                let changed = data.force_variance()[(row, channel)] / before;
                covariance[(data.dof() + channel, data.dof() + channel)] *= changed;
            }
            covariance
        };
        Some(Whitened::residual_of(data, unknowns, &entries, covariance)?.residual)
    }

    /// Returns the minimum residual power for modified data of the same records, with unchanged
    /// weights.
    pub(super) fn least_power(&self, records: &[FrequencyData]) -> Option<f64> {
        let modified = Weighing {
            records,
            estimate: self.estimate,
            relations: Relations::from_unknowns(self.estimate.unknowns()),
            noise: self.noise.clone(),
            levels: self.levels.clone(),
            small: self.small,
            extent: self.extent,
        };
        let (_, linear) = modified.settled()?;
        Some(linear.power() - linear.coefficients.norm_squared())
    }

    /// Returns the parameters after some Gauss–Newton steps, and the residuals with these
    /// parameters.
    fn settled(&self) -> Option<(DVector<f64>, Linearised)> {
        let mut values = self.estimated_parameters();
        let mut linear = self.linearised(&values)?;
        for _ in 0..FIT_STEPS {
            let unit = (linear.power() / self.rows() as f64).max(f64::MIN_POSITIVE);
            if linear.coefficients.norm_squared() <= FIT_SETTLED * unit {
                break;
            }
            // A shorter step is used if the full step increases the power.
            let next = [1.0, 0.5, 0.25, 0.125].iter().find_map(|length| {
                let values = &values + linear.step() * *length;
                let next = self.linearised(&values)?;
                (next.power() < linear.power()).then_some((values, next))
            });
            let Some(next) = next else { break };
            (values, linear) = next;
        }
        Some((values, linear))
    }

    /// Returns the columns that are projected out of the residual of a record. For an open record
    /// these are the effects of a jump between the final and initial values of each channel; for
    /// periods whose noise is the response to an unmeasured force, they are the transients of this
    /// response.
    fn end_effects(&self, at: usize, values: &DVector<f64>) -> Vec<DVector<f64>> {
        let entries = self.entries_of(values);
        let weighted = |data: FrequencyData| {
            let covariance = |row| self.covariance(at, row);
            Whitened::residual_of(&data, self.estimate.unknowns(), &entries, covariance)
        };
        let (record, channels) = (&self.records[at], 0..self.records[at].dof());
        let end_effects: Vec<FrequencyData> = match self.extent {
            Extent::Open => channels.map(|channel| record.step_data(channel)).collect(),
            Extent::WholePeriod if has_unmeasured_force(record) => {
                let loads = |dof| (0..TRANSIENT_TERMS as usize).map(move |power| (dof, power));
                channels.flat_map(loads).map(|(dof, power)| record.load_data(dof, power)).collect()
            }
            Extent::WholePeriod => Vec::new(),
        };
        end_effects.into_iter().filter_map(weighted).map(|effect| effect.residual).collect()
    }

    /// Returns the residual of a record from its weighted values and from the columns that span the
    /// effect of the parameters.
    fn residual(
        &self,
        at: usize,
        system: Option<&SecondOrderSystem>,
        end_effects: &[DVector<f64>],
        (values, explained): (DVector<f64>, DMatrix<f64>),
    ) -> SpectralResidual {
        let (data, is_stated) = (&self.records[at], self.noise.is_some());
        let is_noise = self.extent == Extent::WholePeriod && has_unmeasured_force(data);
        let for_power_test = is_noise.then(|| (values.clone(), explained.clone()));
        let (values, explained) = project_out(end_effects, values, explained);
        let force_noise = if is_stated { None } else { force_decides(data, self.estimate) };
        let likely =
            system.and_then(|system| likely_force(data, system, |row| self.covariance(at, row)));
        SpectralResidual::new(data.clone(), is_stated, values, explained)
            .for_power_test(for_power_test)
            .with_rounding(is_rounding(data, &self.levels))
            .with_force_decides(force_noise)
            .with_likely_force(likely)
    }
}

impl WeightedFit {
    fn new(records: &[FrequencyData], estimate: &Estimate, extent: Extent) -> Option<Self> {
        let weighing = Weighing::new(records, estimate, extent)?;
        let (values, linear) = weighing.settled()?;
        let end = &values + linear.step();
        let step = weighing.entries_of(&end) - DVector::from_vec(weighing.entries());
        let [m, c, k] = estimate.unknowns().assemble(weighing.entries_of(&values).as_slice());
        let system = SecondOrderSystem::new(m, c, k).ok();
        let Linearised { weighted, explained, coefficients, .. } = linear;
        let residuals = weighted.into_iter().zip(explained).enumerate();
        let residuals = residuals.map(|(at, (weighted, explained))| {
            let remainder = weighted.residual - &explained * &coefficients;
            let end_effects = weighing.end_effects(at, &values);
            weighing.residual(at, system.as_ref(), &end_effects, (remainder, explained))
        });
        let mut records: Vec<SpectralResidual> = residuals.collect();
        let parts: Vec<Part<'_>> = records.iter().filter_map(SpectralResidual::part).collect();
        if parts.len() == records.len() {
            let lines = concentration(&parts);
            records.iter_mut().for_each(|record| record.set_concentration(lines.clone()));
        }
        let noise_stated = weighing.noise.is_some();
        Some(Self { records, noise_stated, step: weighing.small.then_some(step) })
    }

    fn bias(&self, estimate: &Estimate) -> Option<Finding> {
        let errors: Vec<f64> = estimate.parameters().map(|p| p.standard_error).collect();
        if errors.is_empty() || errors.iter().any(|error| !(*error > 0.0 && error.is_finite())) {
            return None;
        }
        let (scale, change) = (DVector::from_vec(errors), self.step.as_ref()?);
        let step = change.component_div(&scale);
        let count = scale.len() as f64;
        let together = if estimate.unknowns().is_related() {
            // The covariance of related entries is singular. A joint test is not possible, and its
            // p-value is set to 1.
            1.0
        } else {
            let statistic = estimate.squared_length(change)?;
            ChiSquared::new(count).expect("at least one parameter").sf(statistic)
        };
        let largest = step.iamax();
        let alone = 2.0 * count * Normal::standard().sf(step[largest].abs());
        let parameter = estimate.parameters().nth(largest)?;
        Some(Finding::Bias(Bias {
            p_value: PValue::new((2.0 * together.min(alone)).min(1.0)),
            parameter: parameter.parameter,
            estimate: parameter.value,
            unbiased: parameter.value + change[largest],
            standard_error: parameter.standard_error,
            reference: Reference::MaximumLikelihood,
        }))
    }
}

/// Returns the most likely forces, rows × n, for noise of this covariance on displacements and
/// forces: F − Cov(F, e) Var(e)⁻¹ e with the residual e = X − G F. `None` if the forces have no
/// noise.
///
/// # Source
/// Fuller, *Measurement Error Models* (1987), section 1.2.3 (true values given the observations).
fn likely_force(
    data: &FrequencyData,
    system: &SecondOrderSystem,
    covariance: impl Fn(usize) -> DMatrix<Complex<f64>>,
) -> Option<DMatrix<Complex<f64>>> {
    let n = data.dof();
    let mut likely = data.force().clone();
    let mut is_exact = true;
    for (row, omega) in data.omega().iter().enumerate() {
        let covariance = covariance(row);
        let force_covariance = covariance.view((n, n), (n, n));
        if force_covariance.iter().all(|entry| *entry == Complex::ZERO) {
            continue;
        }
        is_exact = false;
        let receptance = system.receptance(*omega).ok()?;
        let force = data.force().row(row).transpose();
        let residual = data.displacement().row(row).transpose() - &receptance * &force;
        let both = covariance.view((n, 0), (n, n));
        let with_residual = both - force_covariance * receptance.adjoint();
        let variance = covariance.view((0, 0), (n, n))
            - both.adjoint() * receptance.adjoint()
            - &receptance * &with_residual;
        let noise = with_residual * variance.lu().solve(&residual)?;
        likely.row_mut(row).copy_from(&(force - noise).transpose());
    }
    (!is_exact).then_some(likely)
}

/// Returns the level of white noise of each channel in the measured quantity, over all records: the
/// RMS residual or, with stated noise of the forces, the most likely level.
fn levels(records: &[FrequencyData], estimate: &Estimate) -> Option<Vec<f64>> {
    let pairs_by_channel = residuals(records, estimate)?;
    Some(pairs_by_channel.into_iter().map(|pairs| motion_level(pairs.into_iter())).collect())
}

/// Returns the mean over the channels of the logarithm of their residual power per line, in the
/// squared unit of the measured quantity. If the forces have noise, it returns the equivalent:
/// minus the logarithm of the likelihood per line, with white noise of the most likely level on
/// each channel, minus one. `None` if a response does not exist.
///
/// # Source
/// Likelihood of circular Gaussian residuals.
pub fn log_residual_power(records: &[FrequencyData], estimate: &Estimate) -> Option<f64> {
    let channels = residuals(records, estimate)?;
    let of_channel = |pairs: &Vec<(f64, f64)>| {
        let level = motion_level(pairs.iter().copied()).powi(2);
        let of_line = |(power, by_force): &(f64, f64)| {
            let variance = (level + by_force).max(f64::MIN_POSITIVE);
            variance.ln() + power / variance - 1.0
        };
        pairs.iter().map(of_line).sum::<f64>() / pairs.len() as f64
    };
    Some(channels.iter().map(of_channel).sum::<f64>() / channels.len() as f64)
}

/// Returns, for each channel and for each line of all records, the residual power in the measured
/// quantity and the variance that force noise causes in the residual.
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

/// Tests, for each channel, the ratio of residual power to noise power on the lines where force
/// noise dominates. Returns this ratio and the probability of a ratio at most as large, times the
/// number of channels, for the channel with the smallest probability. `None` if no force noise is
/// stated, or if force noise dominates on too few lines.
fn force_decides(data: &FrequencyData, estimate: &Estimate) -> Option<(f64, f64)> {
    if data.force_variance().iter().all(|variance| *variance == 0.0) {
        return None;
    }
    let residuals = residuals(std::slice::from_ref(data), estimate)?;
    let channels = residuals.len() as f64;
    let fitted = estimate.parameters().len() as f64 / channels + TRANSIENT_TERMS;
    let channel_test = |pairs: Vec<(f64, f64)>| {
        let level = motion_level(pairs.iter().copied()).powi(2);
        let decided = pairs.iter().filter(|(_, known)| *known > FIT_DECIDES * level);
        let (count, over) = decided.fold((0.0, 0.0), |(count, over), (power, known)| {
            (count + 1.0, over + power / (level + known))
        });
        // Each squared complex number has two degrees of freedom.
        let free = 2.0 * count - fitted;
        if free < FREE_RESIDUALS {
            return None;
        }
        let below = ChiSquared::new(free).ok()?.cdf(2.0 * over);
        Some((2.0 * over / free, (channels * below).min(1.0)))
    };
    residuals.into_iter().filter_map(channel_test).min_by(|a, b| a.1.total_cmp(&b.1))
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

/// Returns the covariance of displacement and force for white noise of these levels on the measured
/// quantity, and the stated noise of the forces.
fn white_covariance(data: &FrequencyData, row: usize, levels: &[f64]) -> DMatrix<Complex<f64>> {
    let (n, mut covariance) = (data.dof(), DMatrix::zeros(2 * data.dof(), 2 * data.dof()));
    let scale = data.measured().per_displacement(data.omega()[row]).norm();
    // The minimum level prevents an infinite weight of a channel without residual.
    let least = levels.iter().copied().fold(0.0, f64::max) * 1e-6;
    for (channel, level) in levels.iter().enumerate().take(n) {
        let level = level.max(least).max(f64::MIN_POSITIVE) / scale;
        covariance[(channel, channel)] = Complex::from(level * level);
        let force_variance = data.force_variance()[(row, channel)];
        covariance[(n + channel, n + channel)] = Complex::from(force_variance);
    }
    covariance
}

/// Returns B such that J B, for the stacked sensitivities J, has orthonormal columns with the span
/// of J.
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
    // If no parameters are dependent, the inverse of the triangular factor is sufficient, and
    // faster than the singular value decomposition.
    if let Some(inverse) = r.solve_upper_triangular(&DMatrix::identity(parameters, parameters))
        && r.norm() * inverse.norm() * FIT_RANK < 1.0
    {
        let mut basis = inverse;
        basis.column_iter_mut().for_each(|mut column| column.component_div_assign(&scale));
        return Some(basis);
    }
    let svd = svd(r).ok()?;
    let (singular, v_t) = (&svd.singular_values, svd.v_t.as_ref()?);
    let retained: Vec<usize> =
        (0..parameters).filter(|at| singular[*at] > FIT_RANK * singular.max()).collect();
    Some(DMatrix::from_fn(parameters, retained.len(), |row, column| {
        v_t[(retained[column], row)] / (singular[retained[column]] * scale[row])
    }))
}

/// Returns whether the noise of a record is the response to an unmeasured force.
fn has_unmeasured_force(data: &FrequencyData) -> bool {
    let by_force = |model: &NoiseModel| matches!(model, NoiseModel::UnmeasuredForce { .. });
    data.noise().is_some_and(|noise| noise.models().iter().any(by_force))
}

/// Projects the columns `parts` out of the `values`, and adds these columns, orthonormalised, to
/// the `explained` columns.
fn project_out(
    parts: &[DVector<f64>],
    mut values: DVector<f64>,
    mut explained: DMatrix<f64>,
) -> (DVector<f64>, DMatrix<f64>) {
    for part in parts {
        let mut column = part.unscale(part.norm());
        for _ in 0..2 {
            column -= &explained * explained.tr_mul(&column);
        }
        let length = column.norm();
        if length > FIT_RANK.sqrt() {
            column.unscale_mut(length);
            values.axpy(-column.dot(&values), &column, 1.0);
            let at = explained.ncols();
            explained = explained.insert_column(at, 0.0);
            explained.set_column(at, &column);
        }
    }
    (values, explained)
}
