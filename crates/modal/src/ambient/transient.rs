//! Transient of an open record: the part of the lines that comes from the motion at the two ends of
//! the record.
//!
//! A mode obeys z′ = λz + w. Its transform over the record is Z = W/(jω − λ) − L t, where t is the
//! change of z over the record: one number for all lines. A likelihood of independent lines would
//! count the transient L t once for each line, so that one large change would determine the
//! damping. Here t is a random effect: it is predicted from all lines together, and the lines
//! without the transient are nearly independent.
//!
//! For samples at intervals Δ, L = Δ/(1 − exp(−aΔ)) with a = jω − λ. The forces W also depend on t:
//! the covariance of W of mode s with t* of mode r is Q_sr/(T a_r*), with t it is Q_sr/(T ā_r),
//! where ā_r belongs to the conjugate pole. The mean of W for a known t follows from these
//! covariances and from the covariance of t; for one mode it is nearly tα/a* with α = −Re λ.

use nalgebra::{Complex, DMatrix, DVector};
use rayon::prelude::*;

use mechid_numerics::time_limit;

use super::likelihood::{TASK, log_determinant, noise, positive_factor, spend};
use super::limits::{DETERMINED_SHARE, POOLING, TRANSIENT_ROUNDS};
use super::lines::BandLines;
use super::misfit::{SpectrumMisfit, misfit};
use super::parameters::{Parameters, Span};
use super::search::{Effort, Fit, search_pooled};
use super::spectrum::Coefficients;
use crate::decomposition::hermitian_eigen;

/// Number of groups of lines; the weakest group limits the initial noise of a sensor from above.
const NOISE_GROUPS: usize = 50;

/// Levels of constant initial noise, as shares of the power of the weakest group of lines.
const NOISE_SHARES: [f64; 4] = [1.0, 1e-1, 1e-2, 1e-3];

/// Remaining uncertainty of the transient, after its prediction.
#[derive(Debug, Clone)]
pub(super) struct Transient {
    response: TransientResponse,
    /// Covariance of the real and then the imaginary parts of t, the changes of the modes over the
    /// record, 2 modes × 2 modes.
    covariance: DMatrix<f64>,
}

impl Transient {
    /// Returns the power of the remaining transient at a line, outputs × outputs.
    pub fn power(&self, omega: f64) -> DMatrix<Complex<f64>> {
        let gain = self.response.gains(omega);
        &gain * self.covariance.map(Complex::from) * gain.adjoint()
    }
}

/// Prediction of the transient.
struct Prediction {
    /// Real parts and then imaginary parts of the predicted t, the changes of the modes over the
    /// record: one of each per mode.
    mean: DVector<f64>,
    transient: Transient,
    /// −log L of the lines, with the transient integrated out.
    cost: f64,
}

/// Fit with the transient as a random effect.
pub(super) struct FitWithTransient {
    pub fit: Fit,
    /// Lines without the predicted transient, to which the spectrum was fitted.
    pub lines: BandLines,
    /// −log L of all lines, with the transient integrated out.
    pub cost: f64,
}

impl FitWithTransient {
    /// Compares the power of the lines with the fitted spectrum.
    pub fn misfit(&self) -> Option<SpectrumMisfit> {
        let parameters = &self.fit.parameters;
        let pooled = self.lines.pooled_evenly(parameters, POOLING);
        misfit(parameters, &pooled, self.lines.span)
    }
}

/// Alternates between a search that starts from the parameters of `fit` and a prediction of the
/// transient, until the likelihood no longer rises.
///
/// The information about the poles that the transient itself contains is not used: it is only as
/// much as the information of a single line, and a resonance has many lines.
///
/// # Source
/// After Dempster, Laird & Rubin (1977), Journal of the Royal Statistical Society B 39, 1–38.
pub(super) fn search_with_transient(fit: Fit, band: &BandLines) -> Option<FitWithTransient> {
    let mut parameters = with_likely_noise(fit.parameters, band);
    let mut predicted = predicted(&parameters, band)?;
    let mut best: Option<FitWithTransient> = None;
    for round in 1..=TRANSIENT_ROUNDS {
        let lines = band.without_transient(&predicted);
        let fit = search_pooled(parameters.clone(), &lines, Effort::FULL)?;
        predicted = self::predicted(&fit.parameters, band)?;
        let cost = predicted.cost;
        log::debug!("transient, round {round}: cost {cost:.4}");
        let gain = best.as_ref().map_or(f64::INFINITY, |best| best.cost - cost);
        if gain > 0.0 {
            parameters.clone_from(&fit.parameters);
            best = Some(FitWithTransient { fit, lines, cost });
        }
        if gain < Effort::FULL.slow || time_limit::is_over() {
            break;
        }
    }
    best
}

/// Returns the candidate for which the lines are most likely. For each candidate, the transient is
/// the one that this candidate predicts. The candidates are `parameters`, and the same parameters
/// with constant noise at or below the power of the weakest lines.
///
/// The expected periodogram does not determine noise below the leakage of the resonances. With
/// noise that is too small, a few lines of pure noise would determine the transient.
fn with_likely_noise(parameters: Parameters, band: &BandLines) -> Parameters {
    let weakest = weakest_power(band);
    let constant = |share: &f64| {
        let power: Vec<f64> = weakest.iter().map(|power| power * share).collect();
        parameters.with_constant_noise(&power)
    };
    let mut candidates: Vec<Parameters> = NOISE_SHARES.iter().map(constant).collect();
    candidates.push(parameters.clone());
    let cost = |candidate: &Parameters| predicted(candidate, band).map(|found| found.cost);
    let costs = candidates.into_iter().map(|one| (cost(&one).unwrap_or(f64::INFINITY), one));
    costs.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(parameters, |(_, likely)| likely)
}

/// Returns the mean power of each output in the weakest group of neighbouring lines.
fn weakest_power(band: &BandLines) -> Vec<f64> {
    let count = (band.omega.len() / NOISE_GROUPS).max(1);
    let power = |output: usize| {
        let column = band.amplitudes.column(output);
        let groups = column.as_slice().chunks_exact(count);
        let mean = |group: &[Complex<f64>]| group.iter().map(|z| z.norm_sqr()).sum::<f64>();
        groups.map(mean).fold(f64::INFINITY, f64::min) / count as f64
    };
    (0..band.outputs()).map(|output| power(output).max(f64::MIN_POSITIVE)).collect()
}

/// Predicts the transient from all lines.
///
/// # Source
/// Harville (1977), Journal of the American Statistical Association 72, 320–338 (best linear
/// unbiased prediction and the likelihood without the random effects).
fn predicted(parameters: &Parameters, band: &BandLines) -> Option<Prediction> {
    spend(parameters, band.omega.len(), 2);
    let response = TransientResponse::new(Coefficients::new(parameters), band.span)?;
    let unknowns = 2 * parameters.layout.modes;
    let indices: Vec<usize> = (0..band.omega.len()).collect();
    let chunk = |indices: &[usize]| {
        let mut sums = TransientSums::zero(unknowns);
        indices.iter().try_for_each(|at| sums.add_line(parameters, &response, band, *at))?;
        Some(sums)
    };
    let parts: Option<Vec<_>> = indices.par_chunks(TASK).map(chunk).collect();
    let mut sums = TransientSums::zero(unknowns);
    for part in parts? {
        sums.add(&part);
    }
    let TransientSums { information, score, mut cost } = sums;
    let prior = &response.prior;
    let matrix = DMatrix::identity(unknowns, unknowns) + prior * information;
    if !matrix.iter().all(|entry| entry.is_finite()) {
        return None;
    }
    let factor = matrix.lu();
    let covariance = factor.solve(prior)?;
    let mean = &covariance * &score;
    let log_determinant: f64 = factor.u().diagonal().iter().map(|pivot| pivot.abs().ln()).sum();
    cost += 0.5 * (log_determinant - score.dot(&mean));
    let sound = cost.is_finite() && mean.iter().all(|value| value.is_finite());
    let transient = Transient { response, covariance };
    sound.then_some(Prediction { mean, transient, cost })
}

/// Sums over the lines that determine the prediction of the transient.
struct TransientSums {
    /// 2 Re Σ Gᴴ S⁻¹ G: the columns of G are the lines for unit changes of the modes, and S is the
    /// spectral matrix without leakage.
    information: DMatrix<f64>,
    /// 2 Re Σ Gᴴ S⁻¹ Y: the columns of G are the lines for unit changes of the modes, S is the
    /// spectral matrix without leakage, and Y is a measured line of all outputs.
    score: DVector<f64>,
    /// −log L of the lines with no transient.
    cost: f64,
}

impl TransientSums {
    fn zero(unknowns: usize) -> Self {
        let (information, score) = (DMatrix::zeros(unknowns, unknowns), DVector::zeros(unknowns));
        Self { information, score, cost: 0.0 }
    }

    fn add(&mut self, other: &Self) {
        self.information += &other.information;
        self.score += &other.score;
        self.cost += other.cost;
    }

    /// Adds line `index`; `None` if its spectral matrix is not positive definite.
    fn add_line(
        &mut self,
        parameters: &Parameters,
        response: &TransientResponse,
        band: &BandLines,
        index: usize,
    ) -> Option<()> {
        let omega = band.omega[index];
        let endless = Span { duration: f64::INFINITY, ..band.span };
        let terms = band.noise_terms(omega, parameters.layout.noise_terms);
        let kernels = response.coefficients.kernels(omega, endless);
        let spectrum = response.coefficients.spectrum(&kernels, &noise(parameters, &terms));
        let factor = positive_factor(spectrum)?;
        let line = band.amplitudes.row(index).transpose();
        let gain = response.gains(omega);
        let (whole, of_gain) = (factor.solve(&line), factor.solve(&gain));
        self.cost += log_determinant(&factor) + line.dotc(&whole).re;
        self.information += gain.ad_mul(&of_gain).map(|z| 2.0 * z.re);
        self.score += gain.ad_mul(&whole).map(|z| 2.0 * z.re);
        Some(())
    }
}

impl BandLines {
    /// Returns the lines without the predicted transient, and therefore without leakage.
    fn without_transient(&self, predicted: &Prediction) -> Self {
        let mean = predicted.mean.map(Complex::from);
        let mut amplitudes = self.amplitudes.clone();
        for (mut line, omega) in amplitudes.row_iter_mut().zip(&self.omega) {
            let transient = predicted.transient.response.gains(*omega) * &mean;
            line -= transient.transpose();
        }
        Self {
            amplitudes,
            span: Span { duration: f64::INFINITY, ..self.span },
            transient: Some(predicted.transient.clone()),
            ..self.clone()
        }
    }
}

/// Response of the lines to the transient.
#[derive(Debug, Clone)]
pub(super) struct TransientResponse {
    coefficients: Coefficients,
    /// Covariance, before the prediction, of the real and then the imaginary parts of t, the
    /// changes of the modes over the record, 2 modes × 2 modes.
    pub prior: DMatrix<f64>,
    /// Inverse of `prior`.
    precision: DMatrix<Complex<f64>>,
    span: Span,
}

impl TransientResponse {
    /// Computes the covariance of the transient; `None` if it cannot be inverted.
    pub fn new(coefficients: Coefficients, span: Span) -> Option<Self> {
        let prior = coefficients.transient_covariance(span);
        let mut root = hermitian_eigen(prior.clone())?;
        let least = DETERMINED_SHARE * root.eigenvalues.max();
        for (mut column, power) in root.eigenvectors.column_iter_mut().zip(&root.eigenvalues) {
            // If the forces drive two modes equally, the covariance does not determine the
            // difference of the transients of these modes.
            column.scale_mut(if *power > least { 1.0 / power.sqrt() } else { 0.0 });
        }
        let precision = (&root.eigenvectors * root.eigenvectors.transpose()).map(Complex::from);
        Some(Self { coefficients, prior, precision, span })
    }

    /// Returns the values of all outputs at one line for a unit change of each mode over the
    /// record, outputs × 2 modes. The columns for real changes come first, then those for imaginary
    /// changes.
    pub fn gains(&self, omega: f64) -> DMatrix<Complex<f64>> {
        let [of_changes, of_forces] = self.parts(omega);
        of_changes + of_forces
    }

    /// Returns the two parts of the lines for unit changes: the leakage, and the response to the
    /// mean of the forces.
    pub fn parts(&self, omega: f64) -> [DMatrix<Complex<f64>>; 2] {
        let Coefficients { poles, shapes, direct, .. } = &self.coefficients;
        let (outputs, modes) = shapes.shape();
        let mut of_changes = DMatrix::zeros(outputs, 2 * modes);
        let mut transfer = direct.map(Complex::from);
        for (r, pole) in poles.iter().enumerate() {
            let [own, mirrored] = [*pole, pole.conj()].map(|pole| self.kernel(omega, pole));
            for (i, shape) in shapes.column(r).iter().enumerate() {
                let [leak, other_leak] = [shape * own.leakage, shape.conj() * mirrored.leakage];
                of_changes[(i, r)] = -(leak + other_leak);
                of_changes[(i, modes + r)] = -Complex::<f64>::i() * (leak - other_leak);
                transfer[(i, r)] += shape * own.inverse + shape.conj() * mirrored.inverse;
            }
        }
        [of_changes, transfer * self.mean_forces(omega)]
    }

    /// Returns the mean of the forces W on the modes for unit changes of the modes over the record,
    /// modes × 2 modes.
    fn mean_forces(&self, omega: f64) -> DMatrix<Complex<f64>> {
        let Coefficients { poles, correlation, .. } = &self.coefficients;
        let modes = poles.len();
        let mut covariance = DMatrix::zeros(modes, 2 * modes);
        for (r, pole) in poles.iter().enumerate() {
            let [with_conjugate, plain] =
                [*pole, pole.conj()].map(|pole| self.kernel(omega, pole).inverse.conj());
            let real = (plain + with_conjugate) * (0.5 / self.span.duration);
            let imaginary = (plain - with_conjugate) * Complex::new(0.0, -0.5 / self.span.duration);
            for s in 0..modes {
                covariance[(s, r)] = real * correlation[(s, r)];
                covariance[(s, modes + r)] = imaginary * correlation[(s, r)];
            }
        }
        covariance * &self.precision
    }

    fn kernel(&self, omega: f64, pole: Complex<f64>) -> TransientKernel {
        let (inverse, _) = self.coefficients.inverse(omega, pole, self.span);
        let turn = (Complex::new(0.0, omega) - pole) * -self.span.sample_interval;
        let leakage = (Complex::from(1.0) - turn.exp()).inv() * self.span.sample_interval;
        TransientKernel { inverse, leakage }
    }
}

/// Responses of a mode at one line.
struct TransientKernel {
    /// Response to a force.
    inverse: Complex<f64>,
    /// Factor L of the transient, which multiplies the change of the mode over the record.
    leakage: Complex<f64>,
}

impl Coefficients {
    /// Returns the covariance of the real and then the imaginary parts of the changes of the modes
    /// over the record, 2 modes × 2 modes.
    fn transient_covariance(&self, span: Span) -> DMatrix<f64> {
        let modes = self.poles.len();
        let lost = |pole: Complex<f64>| Complex::from(1.0) - (pole * span.duration).exp();
        let mut covariance = DMatrix::zeros(2 * modes, 2 * modes);
        for (r, one) in self.poles.iter().enumerate() {
            for (s, other) in self.poles.iter().enumerate() {
                let half = 0.5 * self.correlation[(r, s)] / span.duration;
                let product =
                    |other: Complex<f64>| -(lost(*one) + lost(other)) / (one + other) * half;
                let (with_conjugate, plain) = (product(other.conj()), product(*other));
                covariance[(r, s)] = (with_conjugate + plain).re;
                covariance[(modes + r, modes + s)] = (with_conjugate - plain).re;
                covariance[(modes + r, s)] = (with_conjugate + plain).im;
                covariance[(r, modes + s)] = (plain - with_conjugate).im;
            }
        }
        covariance
    }
}
