//! Effect of a step on a free oscillation: period elongation and amplitude decay.

use std::f64::consts::TAU;

use mechid_model::Sdof;
use nalgebra::Complex;

use crate::error::IntegrateError;
use crate::schemes::scheme::Scheme;
use crate::stability::growth;
use crate::stepping::transition::Transition;

/// Effect of a scheme on the free oscillation of a single degree of freedom.
///
/// All values except the spectral radius are `None` if the numerical motion does not oscillate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Accuracy {
    /// Ratio Δt/T, a pure number, with the undamped period T = 2π/ω.
    pub step_over_period: f64,
    /// Largest modulus of the eigenvalues of the amplification matrix, a pure number.
    pub spectral_radius: f64,
    /// T̄/T_d − 1, a pure number, with the numerical period T̄ and the exact damped period T_d.
    pub period_elongation: Option<f64>,
    /// ζ̄ − ζ, the damping ratio the scheme adds, from λ = exp(−ζ̄ Ω̄ ± i Ω̄ √(1 − ζ̄²)).
    pub numerical_damping_ratio: Option<f64>,
    /// Fraction of the amplitude lost per numerical period, in addition to the physical decay.
    pub amplitude_decay: Option<f64>,
}

/// Analyses `scheme` at the step Δt/T = `step_over_period` on an oscillation of damping ratio ζ =
/// `damping_ratio`, from the amplification matrix of the stepping code.
///
/// ```
/// use mechid_integrate::{Houbolt, accuracy};
///
/// // Ten steps per period: Houbolt stretches the period by an eighth.
/// let found = accuracy(&Houbolt::default(), 0.0, 0.1)?;
/// assert!((found.period_elongation.unwrap() - 0.123206).abs() < 1e-6);
/// # Ok::<(), mechid_integrate::IntegrateError>(())
/// ```
///
/// # Errors
/// [`IntegrateError::DampingRatio`] if ζ is not in [0, 1), [`IntegrateError::TimeStep`], and the
/// errors of [`Scheme::prepare_unchecked`].
///
/// # Source
/// Bathe & Wilson (1973); Hughes (1987), section 9.1.
pub fn accuracy(
    scheme: &dyn Scheme,
    damping_ratio: f64,
    step_over_period: f64,
) -> Result<Accuracy, IntegrateError> {
    if !(0.0..1.0).contains(&damping_ratio) {
        return Err(IntegrateError::DampingRatio { damping_ratio });
    }
    let system = Sdof::from_modal(1.0, damping_ratio, 1.0)?.system();
    let angle = TAU * step_over_period;
    let mut stepper = scheme.prepare_unchecked(&system, angle)?;
    let transition = Transition::from_stepper(stepper.as_mut());
    let spectral_radius = growth::radius(&transition);
    let mut accuracy = Accuracy {
        step_over_period,
        spectral_radius,
        period_elongation: None,
        numerical_damping_ratio: None,
        amplitude_decay: None,
    };
    if let Some(logarithm) = principal_logarithm(&transition) {
        let (decrement, turn) = (-logarithm.re, logarithm.im);
        let damped = (1.0 - damping_ratio * damping_ratio).sqrt();
        accuracy.period_elongation = Some(angle * damped / turn - 1.0);
        accuracy.numerical_damping_ratio = Some(decrement / decrement.hypot(turn) - damping_ratio);
        let beyond = decrement / turn - damping_ratio / damped;
        accuracy.amplitude_decay = Some(-(-TAU * beyond).exp_m1());
    }
    Ok(accuracy)
}

/// Returns ln λ of the oscillating pair of eigenvalues λ = 1 + μ, Im λ > 0, where μ are eigenvalues
/// of D.
fn principal_logarithm(transition: &Transition) -> Option<Complex<f64>> {
    let eigenvalues = growth::eigenvalues(transition)?;
    let pair = eigenvalues
        .iter()
        .filter(|mu| mu.im > 0.0)
        .max_by(|l, r| growth::log_square(**l).total_cmp(&growth::log_square(**r)))?;
    Some(Complex::new(0.5 * growth::log_square(*pair), pair.im.atan2(1.0 + pair.re)))
}
