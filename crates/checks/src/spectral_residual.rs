//! Tests of the weighted residual of spectra against noise.

use std::f64::consts::PI;
use std::sync::OnceLock;

use mechid_numerics::products::transposed_product;
use mechid_signal::correlation::{Correlation, probability_above_of};
use mechid_spectra::FrequencyData;
use nalgebra::{Complex, DMatrix, DVector, DVectorView};
use rayon::prelude::*;

use super::concentration::Part;
use super::cross_correlation::CrossCorrelation;
use super::finding::Finding;
use super::holm_adjustment::adjust_p_values;
use super::limits::LAGS;
use super::limits::{FREE_RESIDUALS, LINES_PER_CORRELATION, SPECTRAL_LEAKED};
use super::line_correlation::correlation_of_lines;
use super::misfit::{Concentration, Misfit, NoiseSource};
use super::p_value::{CorrelationTest, PValue};
use super::whiteness::{Residual, Whiteness};
use super::{Subject, Verdict};

/// Residual of one record of a fit of spectra, in units of its noise.
#[derive(Debug, Clone)]
pub struct SpectralResidual {
    data: FrequencyData,
    /// `false` if the weights assume white noise of unknown level.
    noise_stated: bool,
    /// Weighted residual without the part that a step of the parameters explains.
    values: DVector<f64>,
    /// Matrix Q; the covariance of `values` is I − QQᵀ.
    explained: DMatrix<f64>,
    /// Weighted residual, and Q of its covariance I − QQᵀ, for the power test; `None` if the power
    /// test uses `values` and `explained`. If the noise is the response to an unmeasured force, its
    /// stated power includes the transients; therefore the transients are not projected out of the
    /// residual for the power test.
    for_power_test: Option<(DVector<f64>, DMatrix<f64>)>,
    /// Standard deviation of every residual before the fit of the parameters, estimated from the
    /// magnitude of this residual.
    deviations: DVector<f64>,
    /// QᵀΣQ, where Q is `explained` and Σ is the diagonal matrix of the squared `deviations`.
    explained_spread: DMatrix<f64>,
    /// Forces, rows × n, without the part of their noise that can be estimated from the residual:
    /// even the residual of a correct model is correlated with this part.
    force: DMatrix<Complex<f64>>,
    rounding: bool,
    /// Ratio of residual power to noise power on the lines where force noise dominates, and the
    /// probability of a ratio at most as large.
    force_decides: Option<(f64, f64)>,
    /// Few lines with most of the misfit of all records.
    concentration: Option<Concentration>,
    /// Tests of the correlation, computed when they are first needed.
    correlations: OnceLock<Vec<Finding>>,
}

/// Returns whether no test of the residuals warns, with p-values adjusted for their number.
///
/// # Source
/// Holm (1979), Scandinavian Journal of Statistics 6, 65–70.
pub fn is_noise(residuals: &[SpectralResidual]) -> bool {
    passes(residuals.iter().flat_map(SpectralResidual::findings).collect())
}

/// Returns whether no residual is correlated with a force, with p-values adjusted for the number of
/// tests.
pub(super) fn is_uncorrelated(residuals: &[SpectralResidual]) -> bool {
    let findings = residuals.iter().flat_map(SpectralResidual::findings);
    passes(findings.filter(|finding| finding.subject() == Subject::CrossCorrelation).collect())
}

fn passes(mut findings: Vec<Finding>) -> bool {
    adjust_p_values(&mut findings);
    findings.iter().all(|finding| finding.verdict() == Verdict::Good)
}

impl SpectralResidual {
    /// Creates the residual of data with or without stated noise, from weighted `values`. Their
    /// covariance is I − QQᵀ, where Q is `explained`.
    pub(super) fn new(
        data: FrequencyData,
        noise_stated: bool,
        values: DVector<f64>,
        explained: DMatrix<f64>,
    ) -> Self {
        let deviations = deviations(&values, &explained);
        let mut spread = explained.clone();
        for mut column in spread.column_iter_mut() {
            column.component_mul_assign(&deviations);
        }
        Self {
            force: data.force().clone(),
            data,
            noise_stated,
            explained_spread: spread.transpose() * &spread,
            deviations,
            values,
            explained,
            for_power_test: None,
            rounding: false,
            force_decides: None,
            concentration: None,
            correlations: OnceLock::new(),
        }
    }

    /// Sets the weighted residual for the power test, and Q of its covariance I − QQᵀ, both before
    /// the transients are projected out; `None` if the power test uses the same residual and Q as
    /// the other tests.
    pub(super) fn for_power_test(
        self,
        for_power_test: Option<(DVector<f64>, DMatrix<f64>)>,
    ) -> Self {
        Self { for_power_test, ..self }
    }

    /// Sets whether the residual is rounding.
    pub(super) fn with_rounding(self, rounding: bool) -> Self {
        Self { rounding, correlations: OnceLock::new(), ..self }
    }

    /// Replaces the measured forces by the most likely forces.
    pub(super) fn with_likely_force(self, force: Option<DMatrix<Complex<f64>>>) -> Self {
        let force = force.unwrap_or(self.force);
        Self { force, correlations: OnceLock::new(), ..self }
    }

    /// Sets the result of the power test on lines where force noise dominates.
    pub(super) fn with_force_decides(self, force_decides: Option<(f64, f64)>) -> Self {
        Self { force_decides, ..self }
    }

    /// Sets the lines with most of the misfit of all records.
    pub(super) fn set_concentration(&mut self, lines: Option<Concentration>) {
        self.concentration = lines;
    }

    /// Tests the power of the residual against the noise, if the noise is stated
    /// ([`Finding::Misfit`]), and its correlation from line to line ([`Finding::Whiteness`]) and
    /// with the forces ([`Finding::CrossCorrelation`]). A residual that is only rounding passes.
    /// The list is empty if there are too few residuals in excess of the parameters.
    ///
    /// # Source
    /// Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, the chapter on
    /// model validation (whiteness of the residuals, Hotelling's T² with a covariance sampled from
    /// complex numbers).
    pub fn findings(&self) -> Vec<Finding> {
        let mut findings = Vec::new();
        let free = self.values.len() as f64 - self.explained.norm_squared();
        if free < FREE_RESIDUALS {
            return findings;
        }
        findings.extend(self.misfit(NoiseSource::Periods));
        if let Some((ratio, p_value)) = self.force_decides {
            let (p_value, source) = (PValue::new(p_value), NoiseSource::Force);
            findings.push(Finding::Misfit(Misfit { ratio, p_value, source, concentration: None }));
        }
        findings.extend(self.correlations.get_or_init(|| self.correlation_tests()).iter().cloned());
        findings
    }

    /// Tests the correlation from line to line and with the forces.
    fn correlation_tests(&self) -> Vec<Finding> {
        let dof = self.data.dof();
        let mut findings = Vec::new();
        let of_forces: Vec<Vec<Option<Correlation>>> =
            (0..dof).into_par_iter().map(|force| self.with_force(force)).collect();
        let whiteness = |residual: usize| {
            self.line_to_line(residual, 1).map(|correlation| {
                Finding::Whiteness(Whiteness {
                    residual: Residual::Lines { residual },
                    test: CorrelationTest::new(&correlation, self.rounding),
                    span: None,
                })
            })
        };
        let whiteness: Vec<Option<Finding>> = (0..dof).into_par_iter().map(whiteness).collect();
        for (residual, whiteness) in whiteness.into_iter().enumerate() {
            findings.extend(whiteness);
            findings.extend(of_forces.iter().enumerate().filter_map(|(force, of_channels)| {
                let test = CorrelationTest::new(of_channels[residual].as_ref()?, self.rounding);
                Some(Finding::CrossCorrelation(CrossCorrelation { residual, force, test }))
            }));
        }
        findings
    }

    /// Returns the input of the search for disturbed lines; `None` if no noise is stated.
    pub(super) fn part(&self) -> Option<Part<'_>> {
        let noise = self.data.noise().filter(|_| self.noise_stated && !self.rounding)?;
        let (n, nu) = (self.data.dof() as f64, noise.degrees_of_freedom());
        Some(Part {
            omega: self.data.omega(),
            dof: self.data.dof(),
            values: self.power_test_residual().0,
            explained: self.power_test_residual().1,
            unit: if nu > n + 1.0 && nu.is_finite() { nu / (nu - n) } else { 1.0 },
        })
    }

    /// Returns the weighted residual and the explained columns for the power test.
    fn power_test_residual(&self) -> (&DVector<f64>, &DMatrix<f64>) {
        match &self.for_power_test {
            Some((values, explained)) => (values, explained),
            None => (&self.values, &self.explained),
        }
    }

    /// Returns whether the residual is only rounding.
    #[must_use]
    pub fn is_rounding(&self) -> bool {
        self.rounding
    }

    /// Returns the weighted residual without the part that the parameters explain.
    pub(super) fn values(&self) -> &DVector<f64> {
        &self.values
    }

    /// Returns columns that span the effect of the parameters and transients. The columns of the
    /// parameters are orthonormal over all records of the fit together.
    pub(super) fn explained(&self) -> &DMatrix<f64> {
        &self.explained
    }

    /// Returns the standard deviation of each residual, estimated from the magnitude of this
    /// residual.
    pub(super) fn deviations(&self) -> &DVector<f64> {
        &self.deviations
    }

    /// Returns the number of degrees of freedom, each with a channel of the residual and one of the
    /// force.
    pub fn dof(&self) -> usize {
        self.data.dof()
    }

    /// Returns the test of the residual power against its expectation for noise alone, where
    /// `source` is the origin of the noise power. The test allows for covariances that are
    /// estimated from few periods.
    pub(super) fn misfit(&self, source: NoiseSource) -> Option<Finding> {
        let noise = self.data.noise().filter(|_| self.noise_stated && !self.rounding)?;
        let (n, rows) = (self.data.dof() as f64, self.data.len() as f64);
        let nu = noise.degrees_of_freedom();
        // Rows with a common covariance form one statistic.
        let groups = noise.groups();
        let group_rows = rows / groups;
        let (mean, variance) = if nu.is_infinite() {
            (n * rows, n * rows)
        } else {
            if nu <= n + 1.0 {
                return None;
            }
            let mean = n * group_rows * nu / (nu - n);
            let square =
                n * group_rows * (n * group_rows + 1.0) * nu * nu / ((nu - n) * (nu - n - 1.0));
            (groups * mean, groups * (square - mean * mean))
        };
        let power_of = |values: &DVector<f64>, explained: &DMatrix<f64>| {
            let gram = explained.transpose() * explained;
            let count = values.len() as f64;
            let free = (count - gram.trace()) / count;
            let spread = (count - 2.0 * gram.trace() + gram.norm_squared()) / count;
            // Real and imaginary parts have unit variance each.
            let power = 0.5 * values.norm_squared();
            (power, mean * free, probability_above_of(power, mean * free, 0.5 * variance * spread))
        };
        let (values, explained) = self.power_test_residual();
        let (power, mean, above) = power_of(values, explained);
        // If the noise power is estimated from the scatter of the periods, a residual power far
        // below the noise power is also significant: the periods then differ by more than noise.
        let below = match &self.for_power_test {
            // A power somewhat below the noise is no fault here, because the noise estimate from
            // few periods also contains the transients of an unmeasured force.
            Some(_) if power > SPECTRAL_LEAKED * mean => 1.0,
            _ => 1.0 - above,
        };
        let above = match &self.for_power_test {
            Some(_) => power_of(&self.values, &self.explained).2,
            None => above,
        };
        let p_value = PValue::new(match source {
            NoiseSource::Periods => (2.0 * above.min(below)).min(1.0),
            _ => above,
        });
        let is_excess = p_value.is_significant() && power > mean;
        let concentration = self.concentration.clone().filter(|_| is_excess);
        Some(Finding::Misfit(Misfit { ratio: power / mean, p_value, source, concentration }))
    }

    /// Returns the indices of the lines by rising frequency.
    fn ascending(&self) -> Vec<usize> {
        let mut rows: Vec<usize> = (0..self.data.len()).collect();
        rows.sort_by(|a, b| self.data.omega()[*a].total_cmp(&self.data.omega()[*b]));
        rows
    }

    /// Returns the row of the real part of a line and channel; the imaginary part is in the next
    /// row.
    fn row(&self, line: usize, channel: usize) -> usize {
        2 * (self.data.dof() * line + channel)
    }

    /// Returns the correlation of the residual of a channel from line to line, at the distances
    /// `first` (at least 1), `first` + 1 … in lines. `None` if there are too few lines or the
    /// residual is zero.
    ///
    /// # Panics
    /// If there is no such channel.
    ///
    /// # Source
    /// Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, the chapter on
    /// model validation; White (1980), Econometrica 48, 817–838, for the variance.
    pub fn line_to_line(&self, channel: usize, first: usize) -> Option<Correlation> {
        let rows: Vec<usize> =
            self.ascending().into_iter().map(|line| self.row(line, channel)).collect();
        let complex = |values: &[f64]| -> Vec<Complex<f64>> {
            rows.iter().map(|row| Complex::new(values[*row], values[row + 1])).collect()
        };
        let residual = complex(self.values.as_slice());
        let explained: Vec<Vec<Complex<f64>>> =
            self.explained.column_iter().map(|q| complex(q.as_slice())).collect();
        correlation_of_lines(&residual, &explained, first)
    }

    /// Returns the correlation of the residual of each channel with a force, Re Σ F̄(l) r(l)
    /// e^{iωτ}, at lags τ that are multiples of [`SpectralResidual::lag`]: 0, and as many negative
    /// as positive ones. There are at most 51 lags, fewer if there are few lines. `None` for a
    /// channel without residual, and if the force is zero.
    ///
    /// # Panics
    /// If there is no such force.
    ///
    /// # Source
    /// White (1980), Econometrica 48, 817–838, for the covariance of the correlations; Box (1954),
    /// Annals of Mathematical Statistics 25, 290–302, for their sum of squares.
    pub fn with_force(&self, force: usize) -> Vec<Option<Correlation>> {
        let (lines, dof) = (self.data.len(), self.data.dof());
        let forces = self.force.column(force);
        if forces.iter().all(|force| *force == Complex::ZERO) {
            return vec![None; dof];
        }
        let (lags, lag) = (LAGS.min(lines / LINES_PER_CORRELATION), self.lag());
        let mut weights = DMatrix::zeros(2 * lines, 2 * lags + 1);
        for (line, (f, omega)) in forces.iter().zip(self.data.omega()).enumerate() {
            // The phase increases by the same angle from lag to lag.
            let turn = Complex::cis(omega * lag);
            let mut weight = f.conj() * Complex::cis(-omega * lag * lags as f64);
            for at in 0..weights.ncols() {
                // Re(w r) = Re w Re r − Im w Im r.
                weights[(2 * line, at)] = weight.re;
                weights[(2 * line + 1, at)] = -weight.im;
                weight *= turn;
            }
        }
        // The left columns are the residuals of each channel. The right columns are the variances
        // of these residuals times the weights of the first lag.
        let right = DMatrix::from_fn(2 * lines, 2 * dof, |at, column| {
            let row = self.row(at / 2, column % dof) + at % 2;
            if column < dof {
                self.values[row]
            } else {
                self.deviations[row].powi(2) * weights[(at, 0)]
            }
        });
        let products = transposed_product(weights.as_view(), right.as_view());
        let channel_correlation = |channel: usize| {
            let (sums, white) = (products.column(channel), products.column(dof + channel));
            let covariance = self.covariance(&weights, white, channel)?;
            let size = right.column(channel).norm() * forces.norm();
            let mean = covariance.trace();
            Some(Correlation {
                coefficients: sums.iter().map(|product| product / size).collect(),
                bound: 1.96 * (mean / weights.ncols() as f64).sqrt() / size,
                statistic: sums.norm_squared() / mean * weights.ncols() as f64,
                p_value: probability_above_of(sums.norm_squared(), mean, covariance.norm_squared()),
            })
        };
        (0..dof).map(channel_correlation).collect()
    }

    /// Returns the spacing of the lags of the correlation with a force, in s: half a period of the
    /// highest line.
    pub fn lag(&self) -> f64 {
        PI / self.data.omega().iter().copied().fold(0.0, f64::max)
    }

    /// Returns the covariance A P Σ P Aᵀ of weighted sums A over the rows of a channel, with P = I
    /// − QQᵀ and the variances Σ from the residuals. `weights` is Aᵀ, and `white` is the first
    /// column of A Σ Aᵀ.
    ///
    /// Real and imaginary part of a line have the same variance; therefore the entries of A Σ Aᵀ
    /// depend only on the distance of two lags.
    fn covariance(
        &self,
        weights: &DMatrix<f64>,
        white: DVectorView<'_, f64>,
        channel: usize,
    ) -> Option<DMatrix<f64>> {
        let count = weights.ncols();
        let mut covariance = DMatrix::from_fn(count, count, |a, b| white[a.abs_diff(b)]);
        if self.explained.ncols() > 0 {
            let row = |line| self.row(line, channel);
            let rows: Vec<usize> =
                (0..self.data.len()).map(row).flat_map(|row| [row, row + 1]).collect();
            let mut explained = self.explained.select_rows(&rows);
            let loads = transposed_product(weights.as_view(), explained.as_view());
            for (mut row, index) in explained.row_iter_mut().zip(&rows) {
                row *= self.deviations[*index].powi(2);
            }
            let spread = transposed_product(weights.as_view(), explained.as_view());
            let cross = spread * loads.transpose();
            let inner = &loads * &self.explained_spread * loads.transpose();
            covariance += inner - &cross - cross.transpose();
        }
        (covariance.trace() > 0.0).then_some(covariance)
    }
}

/// Returns the standard deviation of every residual before the fit of the parameters, estimated
/// from the magnitude of this residual.
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

#[cfg(test)]
mod tests {
    use mechid_model::ResponseQuantity;

    use super::*;

    /// The correlations with a force equal explicit sums of all products, with the explicit
    /// covariance A P Σ P Aᵀ.
    #[test]
    fn correlations_with_a_force_are_those_of_the_sums_written_out() {
        let (lines, dof) = (30, 2);
        let number = |i: usize, j: usize| ((7 * i + 5 * j + 1) as f64).sin();
        let complex = |i: usize, j: usize| Complex::new(number(i, j), number(j + 3, i + 11));
        let omega: Vec<f64> = (0..lines).map(|line| 3.0 + line as f64).collect();
        let force = DMatrix::from_fn(lines, dof, complex);
        let motion = DMatrix::from_fn(lines, dof, |i, j| complex(i + 40, j));
        let quantity = ResponseQuantity::Displacement;
        let data = FrequencyData::from_amplitudes(omega, force, motion, quantity).unwrap();
        let values = DVector::from_fn(2 * lines * dof, |at, _| number(at, 2));
        for columns in [0, 5] {
            let explained = match columns {
                0 => DMatrix::zeros(values.len(), 0),
                _ => DMatrix::from_fn(values.len(), columns, number).qr().q(),
            };
            let residual =
                SpectralResidual::new(data.clone(), true, values.clone(), explained.clone());
            let identity = DMatrix::<f64>::identity(values.len(), values.len());
            let free = identity - &explained * explained.transpose();
            let variances = residual.deviations.map(|deviation| deviation * deviation);
            let covariance = &free * DMatrix::from_diagonal(&variances) * &free;
            for (force, channel) in [(0, 0), (0, 1), (1, 0)] {
                let lags = (lines / LINES_PER_CORRELATION) as f64;
                let row = |lag: f64| {
                    let mut row = nalgebra::RowDVector::zeros(values.len());
                    for (line, omega) in data.omega().iter().enumerate() {
                        let turn = Complex::cis(omega * lag * residual.lag());
                        let weight = data.force()[(line, force)].conj() * turn;
                        let at = residual.row(line, channel);
                        (row[at], row[at + 1]) = (weight.re, -weight.im);
                    }
                    row
                };
                let rows: Vec<_> =
                    (0..=2 * lags as usize).map(|at| row(at as f64 - lags)).collect();
                let weights = DMatrix::from_rows(&rows);
                let sums = &weights * &values;
                let all = &weights * &covariance * weights.transpose();
                let expected = sums.norm_squared() / all.trace() * sums.len() as f64;
                let found = residual.with_force(force)[channel].clone().unwrap();
                assert!((found.statistic / expected - 1.0).abs() < 1e-12);
                let p = probability_above_of(sums.norm_squared(), all.trace(), all.norm_squared());
                assert!((found.p_value - p).abs() < 1e-12, "{} {p}", found.p_value);
            }
        }
    }
}
