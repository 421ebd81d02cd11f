//! Central difference.

use mechid_model::InitialState;

use crate::error::IntegrateError;
use crate::schemes::motion::motion_mut;
use crate::schemes::newmark::{Newmark, NewmarkStepper};
use crate::schemes::scheme::{Convention, Scheme};
use crate::stability::stable_steps::StableSteps;
use crate::stepping::effective_matrix::Equations;
use crate::stepping::stepper::{Instant, Loads, Stepper, check_step};
use crate::system::System;

/// Displacement before t = 0 with which central difference starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum CentralDifferenceStart {
    /// Step back by Taylor's series, x(−Δt) = x(0) − Δt ẋ(0) + ½Δt² ẍ(0), with the consistent
    /// acceleration: second order.
    #[default]
    Taylor,
    /// No motion before t = 0, x(−Δt) = x(0): the system is at rest until the force begins at t =
    /// 0. The error is of first order unless F(0) balances x(0). The velocity at t = 0 follows from
    /// the central difference.
    Rest,
}

/// Central difference: equilibrium at t with
///
/// ```text
/// ẋ = [x(t+Δt) − x(t−Δt)] / 2Δt        ẍ = [x(t+Δt) − 2x + x(t−Δt)] / Δt²
/// ```
///
/// The scheme is of second order, and stable up to ωΔt = 2, damped or not. Velocity and
/// acceleration belong to the same instant as the displacement, although they are known one step
/// later; no quantity is shifted.
///
/// The state has the velocities at half steps, which avoids the cancellation in differences of
/// displacements at small steps; apart from rounding, the results are those of the usual formula.
///
/// # Source
/// Dissertation eqs. (3.3.1.1)–(3.3.1.4) and table 3.1; Bathe (1982), section 9.2.1. The half-step
/// form and its identity with Newmark's β = 0, γ = ½: Hughes (1987), section 9.1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct CentralDifference {
    /// The starting procedure.
    pub start: CentralDifferenceStart,
}

impl Scheme for CentralDifference {
    fn name(&self) -> String {
        "central difference".to_owned()
    }

    fn conventions(&self) -> Vec<Convention> {
        let start = match self.start {
            CentralDifferenceStart::Taylor => "Taylor step to t = −Δt",
            CentralDifferenceStart::Rest => "at rest until t = 0",
        };
        vec![
            Convention { what: "load", choice: "equilibrium at t" },
            Convention { what: "start", choice: start },
        ]
    }

    fn stable_steps(&self) -> StableSteps {
        StableSteps::Frequencies(2.0)
    }

    fn prepare_unchecked(
        &self,
        system: &dyn System,
        dt: f64,
    ) -> Result<Box<dyn Stepper>, IntegrateError> {
        let (dt, equations) = (check_step(dt)?, Equations::from_system(system));
        let family = Newmark::CENTRAL_DIFFERENCE;
        let inner = NewmarkStepper::new("central difference", family, &equations, dt)?;
        Ok(Box::new(CentralDifferenceStepper { inner, start: self.start }))
    }
}

/// A prepared step of central difference, with the state `[x, ẋ, ẍ]`.
///
/// The velocity half a step later is h = ẋ + ½Δt ẍ, and x(t+Δt) = x + Δt h. Equilibrium at t + Δt
/// with ẋ(t+Δt) = h + ½Δt ẍ(t+Δt) gives the new acceleration: this is Newmark's step for β = 0.
#[derive(Debug)]
struct CentralDifferenceStepper {
    inner: NewmarkStepper,
    start: CentralDifferenceStart,
}

impl Stepper for CentralDifferenceStepper {
    fn dof(&self) -> usize {
        self.inner.dof()
    }

    fn state_len(&self) -> usize {
        self.inner.state_len()
    }

    fn instants(&self) -> &'static [Instant] {
        self.inner.instants()
    }

    fn change(
        &mut self,
        state: &[f64],
        loads: &Loads<'_>,
        change: &mut [f64],
    ) -> Result<(), IntegrateError> {
        self.inner.change(state, loads, change)
    }

    fn start(
        &mut self,
        initial: &InitialState,
        early: &[Vec<f64>],
        motions: &mut [Vec<f64>],
        state: &mut [f64],
    ) -> Result<(), IntegrateError> {
        if self.start == CentralDifferenceStart::Taylor {
            return self.inner.start(initial, early, motions, state);
        }
        if let Some(at) = initial.velocity().iter().position(|&v| v != 0.0) {
            let velocity = initial.velocity()[at];
            return Err(IntegrateError::NotAtRest { component: at + 1, velocity });
        }
        // x(−Δt) = x(0) means a velocity of zero half a step before t = 0.
        let (x, v, a) = motion_mut(state, self.inner.dof());
        x.copy_from_slice(initial.displacement().as_slice());
        v.fill(0.0);
        a.copy_from_slice(&early[0]);
        self.inner.effective.solve(0.0, v, x, a)?;
        for (v, a) in v.iter_mut().zip(a) {
            *v = 0.5 * self.inner.dt * *a;
        }
        motions[0].copy_from_slice(state);
        Ok(())
    }
}
