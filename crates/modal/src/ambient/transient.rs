//! Transient of an open record: the part of the lines that comes from the motion at the two ends of
//! the record.
//!
//! A mode obeys z′ = λz + w. Its transform over the record is Z = W/(jω − λ) − L t, where t is the
//! change of z over the record: one number for all lines. A likelihood of independent lines would
//! count the transient L t once for each line, so that one large change would determine the
//! damping. Here t is a random effect: it is predicted from all lines together, and the lines
//! without the transient are nearly independent.
//!
//! For samples at intervals Δ, L = Δ/(1 − exp(−aΔ)) with a = jω − λ. The mean of W for a known t is
//! tα/a* with α = −Re λ, so the response to t is −L (1 − α/a*). This response is exact if the
//! forces on the modes are independent. Correlated forces of close modes change the response, but
//! hardly change the estimates.

use nalgebra::{Complex, DMatrix, DVector};
use rayon::prelude::*;

use super::likelihood::{TASK, log_determinant, noise, positive_factor};
use super::limits::{POOLING, TRANSIENT_ROUNDS};
use super::lines::BandLines;
use super::misfit::{SpectrumMisfit, misfit};
use super::parameters::{Parameters, Span};
use super::search::{Effort, Fit, search_pooled};
use super::spectrum::Coefficients;

/// Remaining uncertainty of the transient, after its prediction.
#[derive(Debug, Clone)]
pub(super) struct Transient {
    coefficients: Coefficients,
    /// Covariance of the real parts and then the imaginary parts of t, 2 modes × 2 modes.
    covariance: DMatrix<f64>,
    span: Span,
}

impl Transient {
    /// Returns the power of the remaining transient at a line, outputs × outputs.
    pub fn power(&self, omega: f64) -> DMatrix<Complex<f64>> {
        let gain = self.coefficients.transient_gains(omega, self.span);
        &gain * self.covariance.map(Complex::from) * gain.adjoint()
    }
}

/// Prediction of the transient.
struct Prediction {
    /// Real parts and then imaginary parts of t, one of each per mode.
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
        let pooled = self.lines.pooled(&self.fit.poles(), POOLING, parameters.layout.noise_terms);
        misfit(parameters, &pooled, self.lines.span)
    }
}

/// Alternates between a search that starts from the parameters of `fit` and a prediction of the
/// transient, until the likelihood no longer rises.
///
/// The information about the poles that the transient itself contains is not used: it is only as
/// much as that of one of the many lines of a resonance.
///
/// # Source
/// After Dempster, Laird & Rubin (1977), Journal of the Royal Statistical Society B 39, 1–38.
pub(super) fn search_with_transient(fit: Fit, band: &BandLines) -> Option<FitWithTransient> {
    let mut predicted = predicted(&fit.parameters, band)?;
    let mut parameters = fit.parameters;
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
        if gain < Effort::FULL.slow {
            break;
        }
    }
    best
}

/// Predicts the transient from all lines.
///
/// # Source
/// Harville (1977), Journal of the American Statistical Association 72, 320–338 (best linear
/// unbiased prediction and the likelihood without the random effects).
fn predicted(parameters: &Parameters, band: &BandLines) -> Option<Prediction> {
    let coefficients = Coefficients::new(parameters);
    let unknowns = 2 * parameters.layout.modes;
    let indices: Vec<usize> = (0..band.omega.len()).collect();
    let chunk = |indices: &[usize]| {
        let mut sums = TransientSums::zero(unknowns);
        indices.iter().try_for_each(|at| sums.add_line(parameters, &coefficients, band, *at))?;
        Some(sums)
    };
    let parts: Option<Vec<_>> = indices.par_chunks(TASK).map(chunk).collect();
    let mut sums = TransientSums::zero(unknowns);
    for part in parts? {
        sums.add(&part);
    }
    let TransientSums { information, score, mut cost } = sums;
    let prior = coefficients.transient_covariance(band.span);
    let matrix = DMatrix::identity(unknowns, unknowns) + &prior * information;
    if !matrix.iter().all(|entry| entry.is_finite()) {
        return None;
    }
    let factor = matrix.lu();
    let covariance = factor.solve(&prior)?;
    let mean = &covariance * &score;
    let log_determinant: f64 = factor.u().diagonal().iter().map(|pivot| pivot.abs().ln()).sum();
    cost += 0.5 * (log_determinant - score.dot(&mean));
    let sound = cost.is_finite() && mean.iter().all(|value| value.is_finite());
    let transient = Transient { coefficients, covariance, span: band.span };
    sound.then_some(Prediction { mean, transient, cost })
}

/// Sums over the lines for the prediction.
struct TransientSums {
    /// 2 Re Σ Gᴴ S⁻¹ G with the lines G of unit changes.
    information: DMatrix<f64>,
    /// 2 Re Σ Gᴴ S⁻¹ Y.
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
        coefficients: &Coefficients,
        band: &BandLines,
        index: usize,
    ) -> Option<()> {
        let omega = band.omega[index];
        let endless = Span { duration: f64::INFINITY, ..band.span };
        let terms = band.noise_terms(omega, parameters.layout.noise_terms);
        let kernels = coefficients.kernels(omega, endless);
        let spectrum = coefficients.spectrum(&kernels, &noise(parameters, &terms));
        let factor = positive_factor(spectrum)?;
        let line = band.amplitudes.row(index).transpose();
        let gain = coefficients.transient_gains(omega, band.span);
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
            let transient =
                predicted.transient.coefficients.transient_gains(*omega, self.span) * &mean;
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

impl Coefficients {
    /// Returns the lines due to unit changes of each mode over the record, outputs × 2 modes: the
    /// real changes first, the imaginary changes after them.
    pub fn transient_gains(&self, omega: f64, span: Span) -> DMatrix<Complex<f64>> {
        let (outputs, modes) = self.shapes.shape();
        let mut gains = DMatrix::zeros(outputs, 2 * modes);
        for (r, pole) in self.poles.iter().enumerate() {
            let gain = |pole: Complex<f64>| {
                let (inverse, _) = self.inverse(omega, pole, span);
                let turn = (Complex::new(0.0, omega) - pole) * -span.sample_interval;
                let leakage = (Complex::from(1.0) - turn.exp()).inv() * span.sample_interval;
                -leakage * (Complex::from(1.0) + inverse.conj() * pole.re)
            };
            let (gain, mirrored) = (gain(*pole), gain(pole.conj()));
            for (i, shape) in self.shapes.column(r).iter().enumerate() {
                let (own, other) = (shape * gain, shape.conj() * mirrored);
                gains[(i, r)] = own + other;
                gains[(i, modes + r)] = Complex::<f64>::i() * (own - other);
            }
        }
        gains
    }

    /// Returns the covariance of the real and then the imaginary parts of the changes of the modes
    /// over the record, 2 modes × 2 modes.
    pub fn transient_covariance(&self, span: Span) -> DMatrix<f64> {
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
