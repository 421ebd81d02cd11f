//! Stability and accuracy of a scheme, derived from the stepping code itself.
//!
//! Everything here starts from [`Transition::of`], which feeds unit states to the stepper that
//! does the integrating. There is no second set of formulas that could be right while the code is
//! wrong.

use mechid_model::{RealSchur, SecondOrderSystem};
use nalgebra::Complex;

use crate::{IntegrateError, Scheme, Stepper, Transition};

/// Growth per step that a refusal tolerates. Rounding makes 1 ± √ε, times a condition, of the
/// double eigenvalue 1 of a free body, which is no instability; at this rate a motion needs a
/// million steps to grow by a factor e.
const TOLERATED: f64 = 1e-6;

/// Growth per step above which a step lies beyond the critical one, unless a free body rounds to
/// more: what rounding makes of the eigenvalues that are about to meet there is well below.
const SHARP: f64 = 1e-9;

/// Spectral radius of the amplification matrix of `scheme` on `system` at a step of `dt` seconds.
///
/// # Errors
/// Those of [`Scheme::prepare_unchecked`].
///
/// # Source
/// Bathe & Wilson (1973); Hughes (1987), section 9.1.
pub fn spectral_radius(
    scheme: &dyn Scheme,
    system: &SecondOrderSystem,
    dt: f64,
) -> Result<f64, IntegrateError> {
    let mut stepper = scheme.prepare_unchecked(system, dt)?;
    Ok(radius(&Transition::of(stepper.as_mut())))
}

/// Spectral radius of I + D: from the eigenvalues of D, which keep their digits where two of them
/// nearly coincide, or from [`growth`] should the QR iteration not converge.
pub(crate) fn radius(transition: &Transition) -> f64 {
    match eigenvalues(transition) {
        Some(eigenvalues) => {
            eigenvalues.iter().map(|mu| (0.5 * log_square(*mu)).exp()).fold(0.0, f64::max)
        }
        None => growth(transition, f64::NEG_INFINITY).exp(),
    }
}

/// ln |1 + μ|² without the cancellation that |1 + μ| ≈ 1 would bring.
pub(crate) fn log_square(mu: Complex<f64>) -> f64 {
    (2.0 * mu.re + mu.norm_sqr()).ln_1p()
}

/// The eigenvalues μ of D; those of the amplification matrix are 1 + μ.
pub(crate) fn eigenvalues(transition: &Transition) -> Option<Vec<Complex<f64>>> {
    let mut change = transition.change.clone();
    Transition::balance(&mut change)?;
    Some(RealSchur::new(change).ok()?.eigenvalues())
}

/// The largest step at which `scheme` does not make the motion of `system` grow, in seconds;
/// `None` if there is no limit.
///
/// The first step size beyond which the motion grows is looked for from a thousandth of the
/// shortest time scale 1/|λ| of the system up to a million times that, in factors of √2, then
/// bisected to rounding. A system that is unstable itself is allowed twice its own growth.
///
/// # Errors
/// Those of [`Scheme::prepare_unchecked`], and [`IntegrateError::Unstable`] if not even the
/// smallest step is stable.
///
/// # Source
/// Hughes (1987), section 9.1.
pub fn critical_step(
    scheme: &dyn Scheme,
    system: &SecondOrderSystem,
) -> Result<Option<f64>, IntegrateError> {
    limit(&|dt| scheme.prepare_unchecked(system, dt), &|| scheme.name(), system)
}

/// How a scheme prepares a step of a given size for a system.
pub(crate) type Prepare<'a> = dyn Fn(f64) -> Result<Box<dyn Stepper>, IntegrateError> + 'a;

fn limit(
    prepare: &Prepare<'_>,
    name: &dyn Fn() -> String,
    system: &SecondOrderSystem,
) -> Result<Option<f64>, IntegrateError> {
    let eigenvalues = system.eigenvalues()?;
    let fastest = eigenvalues.iter().map(|l| l.norm()).fold(0.0, f64::max);
    if fastest == 0.0 {
        return Ok(None);
    }
    let own_growth = eigenvalues.iter().map(|l| l.re).fold(0.0, f64::max);
    let excess = |dt: f64, tolerated: f64| -> Result<f64, IntegrateError> {
        let mut stepper = prepare(dt)?;
        let allowed = tolerated + 2.0 * own_growth * dt;
        let transition = Transition::of(stepper.as_mut());
        let bound = growth(&transition, allowed);
        Ok(if bound <= allowed { bound } else { radius(&transition).ln() } - allowed)
    };
    // A free body has a double eigenvalue 0, found as about √ε of the others.
    let free = eigenvalues.iter().any(|l| l.norm() < 1e-6 * fastest);
    let tolerated = if free { TOLERATED } else { SHARP };
    let smallest = 1e-3 / fastest;
    let first = excess(smallest, tolerated)?;
    if first > 0.0 {
        return Err(IntegrateError::Unstable {
            scheme: name(),
            dt: smallest,
            spectral_radius: (first + tolerated + 2.0 * own_growth * smallest).exp(),
            critical_step: None,
        });
    }
    let (mut stable, mut unstable) = (smallest, smallest * std::f64::consts::SQRT_2);
    while excess(unstable, tolerated)? <= 0.0 {
        (stable, unstable) = (unstable, unstable * std::f64::consts::SQRT_2);
        if unstable * fastest > 1e6 {
            return Ok(None);
        }
    }
    while unstable - stable > 4.0 * f64::EPSILON * stable {
        let middle = 0.5 * (stable + unstable);
        if excess(middle, tolerated)? <= 0.0 { stable = middle } else { unstable = middle }
    }
    Ok(Some(stable))
}

/// An error if the prepared `stepper` makes a motion grow that does not grow by itself.
pub(crate) fn refuse_unstable(
    prepare: &Prepare<'_>,
    name: &dyn Fn() -> String,
    system: &SecondOrderSystem,
    dt: f64,
    stepper: &mut dyn Stepper,
) -> Result<(), IntegrateError> {
    let transition = Transition::of(stepper);
    if growth(&transition, TOLERATED) <= TOLERATED {
        return Ok(());
    }
    let own_growth = system.eigenvalues()?.iter().map(|l| l.re).fold(0.0, f64::max);
    let allowed = TOLERATED + 2.0 * own_growth * dt;
    let rate = growth(&transition, allowed);
    if rate <= allowed {
        return Ok(());
    }
    let critical_step = match limit(prepare, name, system) {
        Ok(limit) => limit.filter(|limit| *limit < dt),
        Err(IntegrateError::Unstable { .. }) => None,
        Err(other) => return Err(other),
    };
    Err(IntegrateError::Unstable { scheme: name(), dt, spectral_radius: rate.exp(), critical_step })
}

/// ln ρ(A), or any bound of it from above that is not greater than `enough`.
///
/// ‖A^m‖^(1/m) falls to ρ for m = 1, 2, 4 … (Gelfand's formula), each power being the square of
/// the one before, scaled. A damped motion is found to be one after a few products of matrices,
/// long before eigenvalues are, and there is nothing that could fail to converge.
fn growth(transition: &Transition, enough: f64) -> f64 {
    let mut power = transition.amplification();
    if Transition::balance(&mut power).is_none() {
        return f64::INFINITY;
    }
    let mut log_norm = 0.0;
    let mut bound = f64::INFINITY;
    // The bound exceeds ln ρ by ln(condition)/m; m = 2⁴⁰ leaves that far below rounding.
    for doubling in 0..=40 {
        let norm = power.norm();
        if norm == 0.0 {
            return f64::NEG_INFINITY;
        }
        log_norm += norm.ln();
        bound = log_norm / f64::powi(2.0, doubling);
        if bound <= enough {
            break;
        }
        power /= norm;
        power = &power * &power;
        log_norm *= 2.0;
    }
    bound
}
