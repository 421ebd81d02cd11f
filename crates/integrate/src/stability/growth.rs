//! Growth of a motion per step: the amplification matrix, its eigenvalues and bounds of these
//! eigenvalues.

use mechid_model::SecondOrderSystem;
use mechid_numerics::RealSchur;
use mechid_numerics::krylov::start_vector::start_vector;
use nalgebra::{Complex, DVector};

use crate::error::IntegrateError;
use crate::stepping::stepper::{Loads, Stepper};
use crate::stepping::transition::Transition;

/// Returns the spectral radius of I + D from the eigenvalues of D, which are accurate even if two
/// of them nearly coincide, or from [`growth`] if the QR iteration does not converge.
pub(crate) fn radius(transition: &Transition) -> f64 {
    match eigenvalues(transition) {
        Some(eigenvalues) => {
            eigenvalues.iter().map(|mu| (0.5 * log_square(*mu)).exp()).fold(0.0, f64::max)
        }
        None => growth(transition, f64::NEG_INFINITY).exp(),
    }
}

/// Returns ln |1 + μ|² without the cancellation of |1 + μ| ≈ 1.
pub(crate) fn log_square(mu: Complex<f64>) -> f64 {
    (2.0 * mu.re + mu.norm_sqr()).ln_1p()
}

/// Returns the eigenvalues μ of D; the eigenvalues of the amplification matrix are 1 + μ.
pub(crate) fn eigenvalues(transition: &Transition) -> Option<Vec<Complex<f64>>> {
    let mut change = transition.change.clone();
    Transition::balance(&mut change)?;
    Some(RealSchur::new(change).ok()?.eigenvalues())
}

/// The amplification matrix, given by its products, in coordinates x, ẋ/ω, ẍ/ω² (and the scheme's
/// memory of accelerations). For the fastest motion, which determines the stability, these
/// coordinates are of the same size.
pub(super) struct Amplification<'a> {
    stepper: &'a mut dyn Stepper,
    /// 1/ω, in s.
    time: f64,
    still: Vec<f64>,
    state: Vec<f64>,
}

impl<'a> Amplification<'a> {
    pub(super) fn new(stepper: &'a mut dyn Stepper, fastest: f64) -> Self {
        let time = if fastest > 0.0 { fastest.recip() } else { 1.0 };
        let (still, state) = (vec![0.0; stepper.dof()], vec![0.0; stepper.state_len()]);
        Self { stepper, time, still, state }
    }

    /// Returns a state with pseudo-random displacements, and zeros elsewhere.
    pub(super) fn start(&self) -> DVector<f64> {
        let (n, len) = (self.still.len(), self.state.len());
        let mut start = start_vector(len);
        start.rows_mut(n, len - n).fill(0.0);
        start
    }

    pub(super) fn apply(&mut self, scaled: &[f64], next: &mut [f64]) {
        let (n, time) = (self.still.len(), self.time);
        let unit = |i: usize| time.powi((i / n).min(2) as i32);
        let state = self.state.iter_mut().zip(scaled).enumerate();
        state.for_each(|(i, (z, s))| *z = s / unit(i));
        let zero = &self.still[..];
        let loads = Loads { time: 0.0, now: zero, middle: zero, next: zero, beyond: zero };
        // A step of a linear system does not fail.
        let _ = self.stepper.change(&self.state, &loads, next);
        let both = next.iter_mut().zip(scaled).enumerate();
        both.for_each(|(i, (dz, s))| *dz = *dz * unit(i) + s);
    }
}

/// Returns the spectral radius of the whole amplification matrix, if a motion grows by more than
/// `tolerated` plus twice the growth of the system itself.
pub(super) fn small_growth(
    stepper: &mut dyn Stepper,
    system: &SecondOrderSystem,
    dt: f64,
    tolerated: f64,
) -> Result<Option<f64>, IntegrateError> {
    let transition = Transition::from_stepper(stepper);
    if growth(&transition, tolerated) <= tolerated {
        return Ok(None);
    }
    let allowed = tolerated + 2.0 * own_growth(&system.eigenvalues()?) * dt;
    let rate = growth(&transition, allowed);
    Ok((rate > allowed).then(|| rate.exp()))
}

/// Returns the largest growth rate among the eigenvalues of a system, in 1/s.
pub(super) fn own_growth(eigenvalues: &[Complex<f64>]) -> f64 {
    eigenvalues.iter().map(|l| l.re).fold(0.0, f64::max)
}

/// Returns ln ρ(A), or an upper bound of it that is at most `enough`.
///
/// ‖A^m‖^(1/m) decreases to ρ for m = 1, 2, 4 … (Gelfand's formula); each power is the square of
/// the one before, scaled. A few products of matrices prove that a motion is damped. This takes
/// less time than the eigenvalues, and there is no iteration that could fail to converge.
pub(super) fn growth(transition: &Transition, enough: f64) -> f64 {
    let mut power = transition.amplification();
    if Transition::balance(&mut power).is_none() {
        return f64::INFINITY;
    }
    let mut log_norm = 0.0;
    let mut bound = f64::INFINITY;
    // The bound exceeds ln ρ by ln(condition)/m, which for m = 2⁴⁰ is far below rounding.
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
