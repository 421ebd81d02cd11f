//! Tests of residuals of frequency responses with the noise from their coherence.

use mechid_estimate::frequency_domain::in_units_of_noise;
use mechid_estimate::{Estimate, EstimateError};
use mechid_signal::Extent;
use mechid_signal::correlation::{Correlation, correlated, probability_above_of};
use mechid_spectra::FrequencyData;
use mechid_spectra::frf::Frf;
use nalgebra::{Complex, DMatrix};

use super::finding::Finding;
use super::limits::{
    LINES_PER_DISTANCE, MAX_DISTANCES, RESPONSE_PAIRS, RESPONSE_ROUNDING, WINDOW_REACH,
};
use super::misfit::{Misfit, NoiseSource};
use super::p_value::{CorrelationTest, PValue};
use super::spectral_residual::SpectralResidual;
use super::weighted_fit::{AfterSpectralFit, after_spectral_fit};
use super::whiteness::{Residual, Whiteness};

/// Tests whether the residual of an estimate on frequency responses has the power that follows from
/// their coherence ([`Finding::Misfit`]), and whether it is correlated from line to line beyond the
/// correlation by the window ([`Finding::Whiteness`]). The forces act at the degrees of freedom
/// `force_dof`, as for [`Frf::data`]. `fitted` is the number of parameters (a pure number) fitted
/// to these data; for several records fitted together, the share of this record.
///
/// Both tests allow for the correlation of lines by the window and for the overlap of the segments;
/// lines of responses from other sources count as independent. The power is tested if there are
/// more than two independent averages beyond the number of forces.
///
/// # Errors
/// As [`Frf::data`].
///
/// # Source
/// Welch (1967), IEEE Trans. Audio Electroacoustics 15, 70–73, for the correlation of the lines;
/// Box (1954), Annals of Mathematical Statistics 25, 290–302, for the distribution of a sum of
/// correlated squares.
pub fn after_response_fit(
    frf: &Frf,
    force_dof: &[usize],
    estimate: &Estimate,
    fitted: f64,
) -> Result<Vec<Finding>, EstimateError> {
    let data = frf.data(force_dof)?;
    let mut coherence: Vec<f64> = frf.coherence().iter().copied().collect();
    coherence.sort_by(f64::total_cmp);
    if 1.0 - coherence[coherence.len() / 2] < RESPONSE_ROUNDING {
        return Ok(Vec::new());
    }
    let Some(residual) = in_units_of_noise(&data, estimate) else { return Ok(Vec::new()) };
    let n = residual.ncols();
    let series = Series::new(&residual, frf);
    let mut findings = Vec::from_iter(series.misfit(frf.deviations(), fitted));
    for (at, lines) in series.each.iter().enumerate() {
        if let Some((correlation, distance)) = series.line_to_line(lines) {
            let (response, force) = (at % n, force_dof[at / n]);
            let residual = Residual::FrequencyResponse { response, force, distance };
            let test = CorrelationTest::new(&correlation, false);
            findings.push(Finding::Whiteness(Whiteness { residual, test, span: None }));
        }
    }
    Ok(findings)
}

/// Tests the residual of an estimate on tables of frequency responses against the noise of their
/// standard errors, if all `columns` state it ([`Finding::Misfit`]), and for correlation between
/// lines that are too far apart to be correlated by the window of an analyser
/// ([`Finding::Whiteness`]). A column has the responses to a force at one degree of freedom.
/// Returns the findings of each column.
///
///
/// # Errors
/// As [`after_spectral_fit`].
///
/// # Source
/// As [`SpectralResidual::findings`](super::SpectralResidual::findings).
pub fn after_table_fit(
    columns: &[(FrequencyData, usize)],
    estimate: &Estimate,
) -> Result<Vec<Vec<Finding>>, EstimateError> {
    let data: Vec<FrequencyData> = columns.iter().map(|(data, _)| data.clone()).collect();
    let AfterSpectralFit { records, .. } =
        after_spectral_fit(&data, estimate, Extent::WholePeriod)?;
    let column_findings = |(residual, (_, force)): (&SpectralResidual, &(FrequencyData, usize))| {
        let mut findings = Vec::from_iter(residual.misfit(NoiseSource::Stated));
        for response in 0..residual.dof() {
            let distance = WINDOW_REACH + 1;
            if let Some(correlation) = residual.line_to_line(response, distance) {
                let test = CorrelationTest::new(&correlation, residual.is_rounding());
                let residual = Residual::FrequencyResponse { response, force: *force, distance };
                findings.push(Finding::Whiteness(Whiteness { residual, test, span: None }));
            }
        }
        findings
    };
    Ok(records.iter().zip(columns).map(column_findings).collect())
}

/// Mean and variance of the weighted residual power if the residual is only noise.
struct Expected {
    mean: f64,
    variance: f64,
}

impl Expected {
    fn misfit(&self, power: f64, source: NoiseSource) -> Finding {
        let p_value = PValue::new(probability_above_of(power, self.mean, 0.5 * self.variance));
        Finding::Misfit(Misfit { ratio: power / self.mean, p_value, source, concentration: None })
    }
}

/// Residuals of responses over the lines, in units of their noise.
struct Series<'a> {
    /// Residuals over the lines, in the order of the forces and, for each force, of the responses.
    each: Vec<Vec<Complex<f64>>>,
    /// Number of each spectral line, and the index of its residual in every entry of `each`; sorted
    /// by the number.
    lines: Vec<(usize, usize)>,
    /// Correlation between the noise of two lines; the index is their distance, in lines, from 0.
    correlation: &'a [f64],
}

impl<'a> Series<'a> {
    fn new(residual: &DMatrix<Complex<f64>>, frf: &'a Frf) -> Self {
        let count = frf.omega().len();
        let inputs = residual.nrows() / count;
        let one = |(input, response): (usize, usize)| {
            residual.column(response).rows(input * count, count).iter().copied().collect()
        };
        let pairs = (0..inputs).flat_map(|input| (0..residual.ncols()).map(move |o| (input, o)));
        let mut lines: Vec<_> = frf.lines().iter().copied().zip(0..).collect();
        lines.sort_unstable();
        Self { each: pairs.map(one).collect(), lines, correlation: frf.line_correlation() }
    }

    /// Returns the indices of the pairs of lines with this distance.
    fn pairs(&self, distance: usize) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.lines.iter().filter_map(move |(number, at)| {
            let partner =
                self.lines.binary_search_by_key(&(number + distance), |line| line.0).ok()?;
            Some((*at, self.lines[partner].1))
        })
    }

    /// Returns the test of the power against variances that are estimated from `nu` independent
    /// complex numbers each, and correlated from line to line like the squares of the residuals.
    fn misfit(&self, nu: f64, fitted: f64) -> Option<Finding> {
        if nu <= 2.0 {
            return None;
        }
        let terms = (self.each.len() * self.lines.len()) as f64;
        let mut lines = 0.0;
        for (distance, c) in self.correlation.iter().enumerate() {
            let pairs = self.pairs(distance).count() * if distance == 0 { 1 } else { 2 };
            lines += pairs as f64 * (c * c + c * (1.0 + c * c) / (nu - 2.0));
        }
        let channels: f64 =
            self.each.iter().map(|a| self.each.iter().map(|b| coherence(a, b)).sum::<f64>()).sum();
        let (unit, spare) = (nu / (nu - 1.0), 1.0 - fitted / (2.0 * terms));
        let power = self.each.iter().flatten().map(|r| r.norm_sqr()).sum();
        let variance = spare * unit * unit * lines * channels;
        let expected = Expected { mean: spare * unit * terms, variance };
        Some(expected.misfit(power, NoiseSource::Coherence))
    }

    /// Returns the correlation Σ r̄(n) r(n + d) at distances d at which the window causes no
    /// correlation, and the smallest of these distances; `None` if there are too few lines.
    fn line_to_line(&self, residual: &[Complex<f64>]) -> Option<(Correlation, usize)> {
        let (count, first) = (residual.len() as f64, self.correlation.len());
        let distances: Vec<usize> = (first..self.lines.len() / LINES_PER_DISTANCE)
            .filter(|distance| self.pairs(*distance).count() >= RESPONSE_PAIRS)
            .take(MAX_DISTANCES)
            .collect();
        if distances.is_empty() {
            return None;
        }
        let weighted: Vec<f64> = (0..first)
            .map(|d| self.correlation[d] * self.pairs(d).count() as f64 / count)
            .collect();
        let span = distances[distances.len() - 1] - distances[0] + 1;
        let covariance = correlated(&weighted, self.correlation, span);
        let square: f64 = distances
            .iter()
            .map(|a| distances.iter().map(|b| covariance[a.abs_diff(*b)].powi(2)).sum::<f64>())
            .sum();
        let power: f64 = residual.iter().map(|r| r.norm_sqr()).sum();
        let (mut coefficients, mut sum) = (Vec::new(), 0.0);
        for d in &distances {
            let product: Complex<f64> =
                self.pairs(*d).map(|(l, m)| residual[l].conj() * residual[m]).sum();
            let coefficient = product / power;
            coefficients.extend([coefficient.re, coefficient.im]);
            sum += coefficient.norm_sqr() * count * count / self.pairs(*d).count() as f64;
        }
        let mean = distances.len() as f64 * covariance[0];
        // Real and imaginary part have half of the variance each.
        let p_value = probability_above_of(sum, mean, 0.5 * square);
        let bound = 1.96 * (0.5 * covariance[0] / count).sqrt();
        Some((Correlation { coefficients, bound, statistic: sum, p_value }, distances[0]))
    }
}

/// Returns the coherence of two series of noise, corrected for its expectation by chance.
fn coherence(a: &[Complex<f64>], b: &[Complex<f64>]) -> f64 {
    let power = |a: &[Complex<f64>]| a.iter().map(|r| r.norm_sqr()).sum::<f64>();
    let product: Complex<f64> = a.iter().zip(b).map(|(a, b)| a.conj() * b).sum();
    let share = product.norm_sqr() / (power(a) * power(b));
    let chance = 1.0 / a.len() as f64;
    ((share - chance) / (1.0 - chance)).max(0.0)
}
