//! Stability and accuracy of a scheme, derived from the stepping code itself.
//!
//! Everything here starts from [`Transition::of`], which feeds unit states to the stepper that
//! does the integrating. There is no second set of formulas that could be right while the code is
//! wrong.

mod fastest;
pub(crate) mod krylov;
pub(crate) mod passive;

use mechid_model::{Matrix, SecondOrderSystem};
use mechid_numerics::RealSchur;
use nalgebra::{Complex, DVector};

use crate::effective::Equations;
use crate::{IntegrateError, Loads, Matrices, Scheme, StableSteps, Stepper, System, Transition};
use fastest::{Fastest, fastest, reduced, reduced_to};
use krylov::{dominant, scattered};

/// Number of degrees of freedom up to which the whole amplification matrix is looked at.
const WHOLE: usize = 20;

/// Number of degrees of freedom up to which all eigenvalues of the amplification matrix are computed
/// where its spectral radius is asked for.
const ALL_EIGENVALUES: usize = 200;

/// Growth per step that a refusal tolerates. Rounding makes 1 ± √ε, times a condition, of the
/// double eigenvalue 1 of a free body, which is no instability; at this rate a motion needs a
/// million steps to grow by a factor e.
const TOLERATED: f64 = 1e-6;

/// Growth per step above which a step lies beyond the critical one, unless a free body rounds to
/// more: what rounding makes of the eigenvalues that are about to meet there is well below.
const SHARP: f64 = 1e-9;

/// Eigenvalue over the limit of a scheme, of a system that is not proven to lie below it: so that the motion grows
/// beyond what is tolerated.
const BEYOND: f64 = 1.0 + 1e-8;

/// Spectral radius of the amplification matrix of `scheme` on `system` at a step of `dt` seconds.
///
/// All eigenvalues are computed, which takes the time of a few hundred solves of 3n equations;
/// beyond 200 degrees of freedom it is the largest that a hundred steps bring to light.
///
/// # Errors
/// Those of [`Scheme::prepare_unchecked`].
///
/// # Source
/// Bathe & Wilson (1973); Hughes (1987), section 9.1.
pub fn spectral_radius(
    scheme: &dyn Scheme,
    system: &dyn System,
    dt: f64,
) -> Result<f64, IntegrateError> {
    let mut stepper = scheme.prepare_unchecked(system, dt)?;
    if system.dof() <= ALL_EIGENVALUES {
        return Ok(radius(&Transition::of(stepper.as_mut())));
    }
    let fastest = Fastest::of(system).rate()?;
    let mut amplification = Amplification::of(stepper.as_mut(), fastest);
    let mut start = amplification.start();
    let mut radius = f64::INFINITY;
    for _ in 0..3 {
        let Some(largest) = dominant(start, |z, next| amplification.apply(z, next)) else { break };
        radius = largest.value.norm();
        start = largest.vector.map(|v| v.re);
    }
    Ok(radius)
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
/// Beyond 20 degrees of freedom it is the limit for the single degree of freedom that moves along
/// the fastest mode, as a hundred products with the matrices bring that to light. Of a system that can only lose
/// energy its frequency is then enclosed by factorisations, to a part in 10⁴; of others it is known to
/// about one part in a thousand.
///
/// # Errors
/// Those of [`Scheme::prepare_unchecked`], and [`IntegrateError::Unstable`] if not even the
/// smallest step is stable.
///
/// # Source
/// Hughes (1987), section 9.1.
pub fn critical_step(
    scheme: &dyn Scheme,
    system: &dyn System,
) -> Result<Option<f64>, IntegrateError> {
    limit_of(scheme, &Fastest::of(system))
}

/// The steps of [`critical_step`], in s, of several schemes, one for each in their order; what they need to know of the
/// system is found once.
///
/// # Errors
/// Those of [`critical_step`].
///
/// # Source
/// The source of [`critical_step`].
pub fn critical_steps(
    schemes: &[&dyn Scheme],
    system: &dyn System,
) -> Result<Vec<Option<f64>>, IntegrateError> {
    let fastest = Fastest::of(system);
    schemes.iter().map(|scheme| limit_of(*scheme, &fastest)).collect()
}

fn limit_of(scheme: &dyn Scheme, fastest: &Fastest<'_>) -> Result<Option<f64>, IntegrateError> {
    let examined = Examined {
        name: &|| scheme.name(),
        prepare: &|system, dt| scheme.prepare_unchecked(system, dt),
        stable_steps: scheme.stable_steps(),
    };
    examined.limit(fastest)
}

/// A scheme whose stability is examined.
pub(crate) struct Examined<'a> {
    pub(crate) name: &'a dyn Fn() -> String,
    pub(crate) prepare: &'a Prepare<'a>,
    pub(crate) stable_steps: StableSteps,
}

/// Function by which a scheme prepares a step of a given size for a system.
type Prepare<'a> = dyn Fn(&dyn System, f64) -> Result<Box<dyn Stepper>, IntegrateError> + 'a;

/// The system, if it is small enough for its whole amplification matrix.
fn whole(system: &dyn System) -> Option<&SecondOrderSystem> {
    match system.matrices() {
        Matrices::Dense(dense) if dense.dof() <= WHOLE => Some(dense),
        _ => None,
    }
}

impl Examined<'_> {
    /// An error if the prepared `stepper` makes a motion grow that does not grow by itself.
    pub(crate) fn refuse_unstable(
        &self,
        system: &dyn System,
        dt: f64,
        stepper: &mut dyn Stepper,
    ) -> Result<(), IntegrateError> {
        let known = self.stable_steps != StableSteps::Unknown;
        // Of one or two degrees of freedom the whole matrix is the least to look at.
        let passive = known && system.dof() > 2 && passive::is_passive(system);
        if passive && self.is_known_stable(system, dt) {
            return Ok(());
        }
        let radius = match whole(system) {
            Some(dense) => small_growth(stepper, dense, dt, TOLERATED)?,
            None if passive => self.growth_of_fastest(system, dt)?,
            None => {
                let equations = Equations::of(system);
                self.growth_found(&equations, fastest(&equations)?, stepper, dt)?
            }
        };
        let Some(spectral_radius) = radius else { return Ok(()) };
        let critical_step = match self.limit(&Fastest::of(system)) {
            Ok(limit) => limit.filter(|limit| *limit < dt),
            Err(IntegrateError::Unstable { .. }) => None,
            Err(other) => return Err(other),
        };
        Err(IntegrateError::Unstable { scheme: (self.name)(), dt, spectral_radius, critical_step })
    }

    /// Returns whether the scheme's limit proves a step of `dt` seconds stable on a passive system.
    fn is_known_stable(&self, system: &dyn System, dt: f64) -> bool {
        let below = |which, limit| passive::is_below(system, which, limit);
        match self.stable_steps {
            StableSteps::Unknown => false,
            StableSteps::All => true,
            StableSteps::Frequencies(limit) => below(Matrix::Stiffness, (limit / dt).powi(2)),
            // Without oscillation |λ| is at most c/m.
            StableSteps::Eigenvalues(limit) => {
                below(Matrix::Stiffness, (limit / dt).powi(2)) && below(Matrix::Damping, limit / dt)
            }
        }
    }

    /// The spectral radius for the stiffest or the most damped motion of a passive system, if it
    /// grows.
    fn growth_of_fastest(
        &self,
        system: &dyn System,
        dt: f64,
    ) -> Result<Option<f64>, IntegrateError> {
        let equations = Equations::of(system);
        let mut radius = None;
        for which in [Matrix::Stiffness, Matrix::Damping] {
            let top = passive::top(&equations, which)?;
            let least = self.exceeded(system, which, dt).unwrap_or(0.0).max(top.value);
            let reduced = reduced_to(&equations, &top, which, least)?;
            let mut stepper = (self.prepare)(&reduced, dt)?;
            let growth = small_growth(stepper.as_mut(), &reduced, dt, TOLERATED)?;
            radius = growth.into_iter().chain(radius).reduce(f64::max);
        }
        Ok(radius)
    }

    /// Returns a value that the largest eigenvalue of M⁻¹A exceeds, A being one of the matrices of a passive system: the
    /// limit of the scheme, where the eigenvalue is not proven to lie below that.
    fn exceeded(&self, system: &dyn System, which: Matrix, dt: f64) -> Option<f64> {
        let limit = match (self.stable_steps, which) {
            (
                StableSteps::Frequencies(limit) | StableSteps::Eigenvalues(limit),
                Matrix::Stiffness,
            ) => (limit / dt).powi(2),
            (StableSteps::Eigenvalues(limit), Matrix::Damping) => limit / dt,
            _ => return None,
        };
        (!passive::is_below(system, which, limit)).then_some(limit * BEYOND)
    }

    /// The modulus of an eigenvalue of the amplification matrix with which a motion grows more than
    /// the system does by itself, if a hundred steps bring one to light.
    fn growth_found(
        &self,
        equations: &Equations,
        fastest: f64,
        stepper: &mut dyn Stepper,
        dt: f64,
    ) -> Result<Option<f64>, IntegrateError> {
        let mut amplification = Amplification::of(stepper, fastest);
        let mut start = amplification.start();
        for _ in 0..2 {
            let largest = dominant(start, |z, next| amplification.apply(z, next));
            let Some(largest) = largest else { return Ok(Some(f64::INFINITY)) };
            if largest.value.norm().ln() <= TOLERATED {
                return Ok(None);
            }
            let reduced =
                reduced(equations, &largest.vector.rows(0, equations.dof()).into_owned())?;
            let mut stepper = (self.prepare)(&reduced, dt)?;
            let radius = small_growth(stepper.as_mut(), &reduced, dt, TOLERATED)?;
            if radius.is_some() {
                return Ok(radius);
            }
            start = largest.vector.map(|v| v.re);
        }
        Ok(None)
    }

    fn limit(&self, fastest: &Fastest<'_>) -> Result<Option<f64>, IntegrateError> {
        if let Some(dense) = whole(fastest.system) {
            return self.small_limit(dense);
        }
        let motions = match self.stable_steps {
            StableSteps::Unknown => None,
            _ => fastest.motions()?,
        };
        let Some(motions) = motions else {
            let (rate, equations) = (fastest.rate()?, Equations::of(fastest.system));
            let radius = |dt: f64| {
                let mut stepper = (self.prepare)(fastest.system, dt)?;
                self.growth_found(&equations, rate, stepper.as_mut(), dt)
            };
            return self.search(&radius, rate, 2.0, 1e-3);
        };
        let mut least: Option<f64> = None;
        if self.stable_steps != StableSteps::All {
            for motion in motions {
                least = self.small_limit(motion)?.into_iter().chain(least).reduce(f64::min);
            }
        }
        Ok(least)
    }

    /// The limit from the whole amplification matrix.
    fn small_limit(&self, system: &SecondOrderSystem) -> Result<Option<f64>, IntegrateError> {
        let eigenvalues = system.eigenvalues()?;
        let fastest = eigenvalues.iter().map(|l| l.norm()).fold(0.0, f64::max);
        // A free body has a double eigenvalue 0, found as about √ε of the others.
        let free = eigenvalues.iter().any(|l| l.norm() < 1e-6 * fastest);
        let tolerated = if free { TOLERATED } else { SHARP };
        let own_growth = own_growth(&eigenvalues);
        let radius = |dt: f64| {
            let mut stepper = (self.prepare)(system, dt)?;
            let allowed = tolerated + 2.0 * own_growth * dt;
            let transition = Transition::of(stepper.as_mut());
            let bound = growth(&transition, allowed);
            let rate = if bound <= allowed { bound } else { radius(&transition).ln() };
            Ok((rate > allowed).then(|| rate.exp()))
        };
        let factor = std::f64::consts::SQRT_2;
        self.search(&radius, fastest, factor, 4.0 * f64::EPSILON)
    }

    /// The step beyond which `radius` is one that is not tolerated, to `precision`.
    fn search(
        &self,
        radius: &dyn Fn(f64) -> Result<Option<f64>, IntegrateError>,
        fastest: f64,
        factor: f64,
        precision: f64,
    ) -> Result<Option<f64>, IntegrateError> {
        if fastest == 0.0 {
            return Ok(None);
        }
        let smallest = 1e-3 / fastest;
        if let Some(spectral_radius) = radius(smallest)? {
            let scheme = (self.name)();
            let (dt, critical_step) = (smallest, None);
            return Err(IntegrateError::Unstable { scheme, dt, spectral_radius, critical_step });
        }
        let (mut stable, mut unstable) = (smallest, smallest * factor);
        while radius(unstable)?.is_none() {
            (stable, unstable) = (unstable, unstable * factor);
            if unstable * fastest > 1e6 {
                return Ok(None);
            }
        }
        while unstable - stable > precision * stable {
            let middle = 0.5 * (stable + unstable);
            if radius(middle)?.is_none() { stable = middle } else { unstable = middle }
        }
        Ok(Some(stable))
    }
}

/// The amplification matrix by its products, in coordinates x, ẋ/ω, ẍ/ω² (and what else a scheme
/// remembers of accelerations): of the fastest motion, which decides, all are alike in size.
struct Amplification<'a> {
    stepper: &'a mut dyn Stepper,
    /// 1/ω, in s.
    time: f64,
    still: Vec<f64>,
    state: Vec<f64>,
}

impl<'a> Amplification<'a> {
    fn of(stepper: &'a mut dyn Stepper, fastest: f64) -> Self {
        let time = if fastest > 0.0 { fastest.recip() } else { 1.0 };
        let (still, state) = (vec![0.0; stepper.dof()], vec![0.0; stepper.state_len()]);
        Self { stepper, time, still, state }
    }

    /// Displacements and nothing else, of all shapes.
    fn start(&self) -> DVector<f64> {
        let (n, len) = (self.still.len(), self.state.len());
        let mut start = scattered(len);
        start.rows_mut(n, len - n).fill(0.0);
        start
    }

    fn apply(&mut self, scaled: &[f64], next: &mut [f64]) {
        let (n, time) = (self.still.len(), self.time);
        let unit = |i: usize| time.powi((i / n).min(2) as i32);
        let state = self.state.iter_mut().zip(scaled).enumerate();
        state.for_each(|(i, (z, s))| *z = s / unit(i));
        let still = &self.still[..];
        let loads = Loads { time: 0.0, now: still, middle: still, next: still, beyond: still };
        // Of a linear system no step fails.
        let _ = self.stepper.change(&self.state, &loads, next);
        let both = next.iter_mut().zip(scaled).enumerate();
        both.for_each(|(i, (dz, s))| *dz = *dz * unit(i) + s);
    }
}

/// The spectral radius of the whole amplification matrix, if it is that of a motion that grows and
/// does not so by itself.
fn small_growth(
    stepper: &mut dyn Stepper,
    system: &SecondOrderSystem,
    dt: f64,
    tolerated: f64,
) -> Result<Option<f64>, IntegrateError> {
    let transition = Transition::of(stepper);
    if growth(&transition, tolerated) <= tolerated {
        return Ok(None);
    }
    let allowed = tolerated + 2.0 * own_growth(&system.eigenvalues()?) * dt;
    let rate = growth(&transition, allowed);
    Ok((rate > allowed).then(|| rate.exp()))
}

/// The largest growth rate among the eigenvalues of a system, in 1/s.
fn own_growth(eigenvalues: &[Complex<f64>]) -> f64 {
    eigenvalues.iter().map(|l| l.re).fold(0.0, f64::max)
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
