//! Newmark's family, including central difference as its explicit member.

use mechid_model::InitialState;

use crate::error::IntegrateError;
use crate::schemes::motion::{motion, motion_mut, start_consistently};
use crate::schemes::scheme::{Convention, Scheme, check_parameter};
use crate::stability::stable_steps::StableSteps;
use crate::stepping::effective_matrix::{EffectiveMatrix, Equations};
use crate::stepping::stepper::{Instant, Loads, Stepper, add, check_step};
use crate::system::System;

/// Newmark's scheme: equilibrium at t + Δt with
///
/// ```text
/// x(t+Δt) = x + Δt ẋ + Δt² [(½ − β) ẍ + β ẍ(t+Δt)]
/// ẋ(t+Δt) = ẋ + Δt [(1 − γ) ẍ + γ ẍ(t+Δt)]
/// ```
///
/// The scheme is of second order for γ = ½, and unconditionally stable for 2β ≥ γ ≥ ½. It uses the
/// load at t + Δt, and starts from the consistent acceleration M ẍ(0) = F(0) − C ẋ(0) − K x(0). The
/// acceleration is the unknown of a step, so that β = 0 needs no special case.
///
/// # Source
/// Dissertation eqs. (3.3.4.1)–(3.3.4.3) with α = β and δ = γ; Hughes (1987), section 9.1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Newmark {
    beta: f64,
    gamma: f64,
}

impl Newmark {
    /// β = ¼, γ = ½: the trapezoidal rule. Unconditionally stable, no numerical damping.
    pub const AVERAGE_ACCELERATION: Self = Self { beta: 0.25, gamma: 0.5 };
    /// β = ⅙, γ = ½. Stable up to ωΔt = 2√3.
    pub const LINEAR_ACCELERATION: Self = Self { beta: 1.0 / 6.0, gamma: 0.5 };
    /// β = 1/12, γ = ½: fourth-order period accuracy without damping. Stable up to ωΔt = √6.
    pub const FOX_GOODWIN: Self = Self { beta: 1.0 / 12.0, gamma: 0.5 };
    /// β = 0, γ = ½. Stable up to ωΔt = 2.
    pub const CENTRAL_DIFFERENCE: Self = Self { beta: 0.0, gamma: 0.5 };

    /// Creates any member of the family from β and γ, pure numbers between 0 and 1.
    ///
    /// # Errors
    /// [`IntegrateError::Parameter`].
    pub fn new(beta: f64, gamma: f64) -> Result<Self, IntegrateError> {
        for (parameter, value) in [("β", beta), ("γ", gamma)] {
            check_parameter("Newmark", parameter, value, 0.0, 1.0)?;
        }
        Ok(Self { beta, gamma })
    }

    /// Weight of the new acceleration in the displacement, a pure number.
    pub fn beta(&self) -> f64 {
        self.beta
    }

    /// Weight of the new acceleration in the velocity, a pure number.
    pub fn gamma(&self) -> f64 {
        self.gamma
    }
}

impl Scheme for Newmark {
    fn name(&self) -> String {
        let member = [
            (Self::AVERAGE_ACCELERATION, "average acceleration, "),
            (Self::LINEAR_ACCELERATION, "linear acceleration, "),
            (Self::FOX_GOODWIN, "Fox–Goodwin, "),
            (Self::CENTRAL_DIFFERENCE, "central difference, "),
        ]
        .iter()
        .find(|(known, _)| known == self)
        .map_or("", |(_, name)| name);
        let rounded = |value: f64| (value * 1e6).round() / 1e6;
        format!("Newmark ({member}β = {}, γ = {})", rounded(self.beta), rounded(self.gamma))
    }

    fn conventions(&self) -> Vec<Convention> {
        vec![
            Convention { what: "load", choice: "equilibrium at t+Δt" },
            Convention { what: "start", choice: "consistent acceleration at t = 0" },
        ]
    }

    fn stable_steps(&self) -> StableSteps {
        let Self { beta, gamma } = *self;
        if gamma < 0.5 {
            StableSteps::Unknown
        } else if 2.0 * beta >= gamma {
            StableSteps::All
        } else {
            StableSteps::Frequencies((0.5 * gamma - beta).sqrt().recip())
        }
    }

    fn prepare_unchecked(
        &self,
        system: &dyn System,
        dt: f64,
    ) -> Result<Box<dyn Stepper>, IntegrateError> {
        let dt = check_step(dt)?;
        Ok(Box::new(NewmarkStepper::new("Newmark", *self, &Equations::from_system(system), dt)?))
    }
}

/// A prepared step of Newmark's scheme, with the state `[x, ẋ, ẍ]`.
#[derive(Debug)]
pub(crate) struct NewmarkStepper {
    pub(crate) effective: EffectiveMatrix,
    pub(crate) mass: EffectiveMatrix,
    pub(crate) dt: f64,
    scheme: Newmark,
    x_hat: Vec<f64>,
    v_hat: Vec<f64>,
}

impl NewmarkStepper {
    pub(crate) fn new(
        name: &'static str,
        scheme: Newmark,
        equations: &Equations,
        dt: f64,
    ) -> Result<Self, IntegrateError> {
        let n = equations.dof();
        let (gamma_hat, beta_hat) = (scheme.gamma * dt, scheme.beta * dt * dt);
        Ok(Self {
            effective: equations.effective(name, dt, gamma_hat, beta_hat)?,
            mass: equations.mass_only(name, dt)?,
            dt,
            scheme,
            x_hat: vec![0.0; n],
            v_hat: vec![0.0; n],
        })
    }
}

impl Newmark {
    /// Returns the known parts of the changes of displacement and velocity, without the new
    /// acceleration.
    #[inline(always)]
    fn known(self, dt: f64, v: f64, a: f64) -> [f64; 2] {
        [dt * (v + dt * (0.5 - self.beta) * a), dt * (1.0 - self.gamma) * a]
    }
}

impl NewmarkStepper {
    /// Writes the acceleration at t + Δt into `next`.
    fn accelerate(
        &mut self,
        x: &[f64],
        v: &[f64],
        a: &[f64],
        loads: &Loads<'_>,
        next: &mut [f64],
    ) -> Result<(), IntegrateError> {
        let (n, dt, scheme) = (self.dof(), self.dt, self.scheme);
        let (x_hat, v_hat, load) = (&mut self.x_hat[..n], &mut self.v_hat[..n], &loads.next[..n]);
        for i in 0..n {
            let [dx, dv] = scheme.known(dt, v[i], a[i]);
            (x_hat[i], v_hat[i], next[i]) = (x[i] + dx, v[i] + dv, load[i]);
        }
        self.effective.solve(loads.time + dt, &self.v_hat, &self.x_hat, next)
    }
}

impl Stepper for NewmarkStepper {
    fn dof(&self) -> usize {
        self.x_hat.len()
    }

    fn state_len(&self) -> usize {
        3 * self.dof()
    }

    fn instants(&self) -> &'static [Instant] {
        &[Instant::Next]
    }

    fn change(
        &mut self,
        state: &[f64],
        loads: &Loads<'_>,
        change: &mut [f64],
    ) -> Result<(), IntegrateError> {
        let (n, dt, Newmark { beta, gamma }) = (self.dof(), self.dt, self.scheme);
        let (x, v, a) = motion(state, n);
        let (dx, dv, da) = motion_mut(change, n);
        self.accelerate(x, v, a, loads, da)?;
        for i in 0..n {
            let [known_dx, known_dv] = self.scheme.known(dt, v[i], a[i]);
            dx[i] = known_dx + beta * dt * dt * da[i];
            dv[i] = known_dv + gamma * dt * da[i];
            da[i] -= a[i];
        }
        Ok(())
    }

    /// Computes the changes and their sums with the state in one pass over the memory.
    fn step(
        &mut self,
        state: &mut [f64],
        owed: &mut [f64],
        loads: &Loads<'_>,
        change: &mut [f64],
    ) -> Result<(), IntegrateError> {
        let (n, dt, Newmark { beta, gamma }) = (self.dof(), self.dt, self.scheme);
        let (x, v, a) = motion_mut(state, n);
        let next = &mut change[..n];
        self.accelerate(x, v, a, loads, next)?;
        let (owed_x, owed_v, owed_a) = motion_mut(owed, n);
        for i in 0..n {
            let [dx, dv] = self.scheme.known(dt, v[i], a[i]);
            add(&mut x[i], &mut owed_x[i], dx + beta * dt * dt * next[i]);
            add(&mut v[i], &mut owed_v[i], dv + gamma * dt * next[i]);
            let da = next[i] - a[i];
            add(&mut a[i], &mut owed_a[i], da);
        }
        Ok(())
    }

    fn start(
        &mut self,
        initial: &InitialState,
        early: &[Vec<f64>],
        motions: &mut [Vec<f64>],
        state: &mut [f64],
    ) -> Result<(), IntegrateError> {
        start_consistently(&mut self.mass, initial, &early[0], state)?;
        motions[0].copy_from_slice(&state[..3 * self.dof()]);
        Ok(())
    }
}
