//! The largest step at which a scheme is stable.

use mechid_model::{Matrix, SecondOrderSystem};
use mechid_numerics::krylov::arnoldi::dominant;

use crate::error::IntegrateError;
use crate::limits;
use crate::stability::fastest::{Fastest, fastest, reduced, reduced_to};
use crate::stability::growth::{Amplification, growth, own_growth, radius, small_growth};
use crate::stability::passive;
use crate::stability::stable_steps::StableSteps;
use crate::stepping::effective_matrix::Equations;
use crate::stepping::stepper::Stepper;
use crate::stepping::transition::Transition;
use crate::system::{Matrices, System};

/// A scheme whose stability is examined.
pub(crate) struct Examined<'a> {
    pub(crate) name: &'a dyn Fn() -> String,
    pub(crate) prepare: &'a Prepare<'a>,
    pub(crate) stable_steps: StableSteps,
}

/// Function of a scheme that prepares a step of a given size for a system.
type Prepare<'a> = dyn Fn(&dyn System, f64) -> Result<Box<dyn Stepper>, IntegrateError> + 'a;

/// Returns the dense system, if it is small enough to compute its whole amplification matrix.
fn small_dense(system: &dyn System) -> Option<&SecondOrderSystem> {
    match system.matrices() {
        Matrices::Dense(dense) if dense.dof() <= limits::AMPLIFICATION_DOF => Some(dense),
        _ => None,
    }
}

impl Examined<'_> {
    /// Returns an error if the prepared `stepper` makes a motion grow faster than in the system.
    pub(crate) fn refuse_unstable(
        &self,
        system: &dyn System,
        dt: f64,
        stepper: &mut dyn Stepper,
    ) -> Result<(), IntegrateError> {
        let known = self.stable_steps != StableSteps::Unknown;
        // For one or two degrees of freedom, the growth from the whole amplification matrix takes
        // less time to compute than the proof that the system is passive.
        let passive = known && system.dof() > 2 && passive::is_passive(system);
        if passive && self.is_known_stable(system, dt) {
            return Ok(());
        }
        let radius = match small_dense(system) {
            Some(dense) => small_growth(stepper, dense, dt, limits::TOLERATED_GROWTH)?,
            None if passive => self.growth_of_fastest(system, dt)?,
            None => {
                let equations = Equations::from_system(system);
                self.growth_found(&equations, fastest(&equations)?, stepper, dt)?
            }
        };
        let Some(spectral_radius) = radius else { return Ok(()) };
        let critical_step = match self.limit(&Fastest::new(system)) {
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
            // An overdamped motion has |λ| of at most c/m.
            StableSteps::Eigenvalues(limit) => {
                below(Matrix::Stiffness, (limit / dt).powi(2)) && below(Matrix::Damping, limit / dt)
            }
        }
    }

    /// Returns the spectral radius for the stiffest or the most damped motion of a passive system,
    /// if this motion grows.
    fn growth_of_fastest(
        &self,
        system: &dyn System,
        dt: f64,
    ) -> Result<Option<f64>, IntegrateError> {
        let equations = Equations::from_system(system);
        let mut radius = None;
        for which in [Matrix::Stiffness, Matrix::Damping] {
            let top = passive::top(&equations, which)?;
            let least = self.exceeded(system, which, dt).unwrap_or(0.0).max(top.value);
            let reduced = reduced_to(&equations, &top, which, least)?;
            let mut stepper = (self.prepare)(&reduced, dt)?;
            let growth = small_growth(stepper.as_mut(), &reduced, dt, limits::TOLERATED_GROWTH)?;
            radius = growth.into_iter().chain(radius).reduce(f64::max);
        }
        Ok(radius)
    }

    /// Returns the limit of the scheme, slightly increased, if the largest eigenvalue of M⁻¹A is
    /// not proved to be below the limit. A is one of the matrices of a passive system.
    fn exceeded(&self, system: &dyn System, which: Matrix, dt: f64) -> Option<f64> {
        let limit = match (self.stable_steps, which) {
            (
                StableSteps::Frequencies(limit) | StableSteps::Eigenvalues(limit),
                Matrix::Stiffness,
            ) => (limit / dt).powi(2),
            (StableSteps::Eigenvalues(limit), Matrix::Damping) => limit / dt,
            _ => return None,
        };
        (!passive::is_below(system, which, limit)).then_some(limit * limits::EXCEEDED_LIMIT)
    }

    /// Returns the modulus of an eigenvalue of the amplification matrix, if Arnoldi's iteration
    /// finds an eigenvalue whose motion grows faster in the steps than in the system itself.
    fn growth_found(
        &self,
        equations: &Equations,
        fastest: f64,
        stepper: &mut dyn Stepper,
        dt: f64,
    ) -> Result<Option<f64>, IntegrateError> {
        let mut amplification = Amplification::new(stepper, fastest);
        let mut start = amplification.start();
        for _ in 0..2 {
            let largest =
                dominant(start, limits::ARNOLDI_STEPS, |z, next| amplification.apply(z, next));
            let Some(largest) = largest else { return Ok(Some(f64::INFINITY)) };
            if largest.value.norm().ln() <= limits::TOLERATED_GROWTH {
                return Ok(None);
            }
            let reduced =
                reduced(equations, &largest.vector.rows(0, equations.dof()).into_owned())?;
            let mut stepper = (self.prepare)(&reduced, dt)?;
            let radius = small_growth(stepper.as_mut(), &reduced, dt, limits::TOLERATED_GROWTH)?;
            if radius.is_some() {
                return Ok(radius);
            }
            start = largest.vector.map(|v| v.re);
        }
        Ok(None)
    }

    pub(super) fn limit(&self, fastest: &Fastest<'_>) -> Result<Option<f64>, IntegrateError> {
        if let Some(dense) = small_dense(fastest.system) {
            return self.small_limit(dense);
        }
        let motions = match self.stable_steps {
            StableSteps::Unknown => None,
            _ => fastest.motions()?,
        };
        let Some(motions) = motions else {
            let (rate, equations) = (fastest.rate()?, Equations::from_system(fastest.system));
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

    /// Returns the limit from the whole amplification matrix.
    fn small_limit(&self, system: &SecondOrderSystem) -> Result<Option<f64>, IntegrateError> {
        let eigenvalues = system.eigenvalues()?;
        let fastest = eigenvalues.iter().map(|l| l.norm()).fold(0.0, f64::max);
        // A free body has a double eigenvalue 0; rounding moves it to about √ε times the other
        // eigenvalues.
        let free = eigenvalues.iter().any(|l| l.norm() < 1e-6 * fastest);
        let tolerated = if free { limits::TOLERATED_GROWTH } else { limits::CRITICAL_GROWTH };
        let own_growth = own_growth(&eigenvalues);
        let radius = |dt: f64| {
            let mut stepper = (self.prepare)(system, dt)?;
            let allowed = tolerated + 2.0 * own_growth * dt;
            let transition = Transition::from_stepper(stepper.as_mut());
            let bound = growth(&transition, allowed);
            let rate = if bound <= allowed { bound } else { radius(&transition).ln() };
            Ok((rate > allowed).then(|| rate.exp()))
        };
        let factor = std::f64::consts::SQRT_2;
        self.search(&radius, fastest, factor, 4.0 * f64::EPSILON)
    }

    /// Returns the step at which the spectral radius first exceeds the tolerated value, to the
    /// relative `precision`; `None` if there is no such step.
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
