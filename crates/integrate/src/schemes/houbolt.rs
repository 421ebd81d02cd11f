//! Houbolt.

use mechid_model::InitialState;

use crate::error::IntegrateError;
use crate::schemes::motion::{motion, motion_mut};
use crate::schemes::newmark::{Newmark, NewmarkStepper};
use crate::schemes::scheme::{Convention, Scheme};
use crate::stability::stable_steps::StableSteps;
use crate::stepping::effective_matrix::{EffectiveMatrix, Equations};
use crate::stepping::stepper::{Instant, Loads, Stepper, check_finite, check_step};
use crate::system::System;

/// Source of the motion at Δt and 2Δt for Houbolt's scheme.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum HouboltStart {
    /// Motion from two steps of Newmark's average acceleration.
    #[default]
    AverageAcceleration,
    /// Motion from two steps of central difference, started with x(−Δt) from Taylor's series.
    CentralDifference,
    /// Displacements given by the caller, in m. The velocities at these instants are differences of
    /// second order over x(0), x(Δt), x(2Δt); the accelerations follow from the equation of motion.
    Given {
        /// Displacement x(Δt), one entry per degree of freedom.
        at_dt: Vec<f64>,
        /// Displacement x(2Δt), one entry per degree of freedom.
        at_2dt: Vec<f64>,
    },
}

/// Houbolt's scheme: equilibrium at t + Δt with the cubic through four displacements,
///
/// ```text
/// ẍ(t+Δt) = [2 x(t+Δt) − 5 x(t) + 4 x(t−Δt) − x(t−2Δt)] / Δt²
/// ẋ(t+Δt) = [11 x(t+Δt) − 18 x(t) + 9 x(t−Δt) − 2 x(t−2Δt)] / 6Δt
/// ```
///
/// The scheme is of second order and unconditionally stable, with strong numerical damping. It uses
/// the load at t + Δt. The state has backward differences of the displacement, which avoid
/// cancellation at small steps.
///
/// # Source
/// Dissertation eqs. (3.3.2.1)–(3.3.2.4) and table 3.2; Bathe (1982), section 9.2.2.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Houbolt {
    /// The starting procedure.
    pub start: HouboltStart,
}

impl Scheme for Houbolt {
    fn name(&self) -> String {
        "Houbolt".to_owned()
    }

    fn conventions(&self) -> Vec<Convention> {
        let start = match self.start {
            HouboltStart::AverageAcceleration => "two steps of average-acceleration Newmark",
            HouboltStart::CentralDifference => "two steps of central difference",
            HouboltStart::Given { .. } => "displacements at Δt and 2Δt given",
        };
        vec![
            Convention { what: "load", choice: "equilibrium at t+Δt" },
            Convention { what: "start", choice: start },
        ]
    }

    fn stable_steps(&self) -> StableSteps {
        StableSteps::All
    }

    fn prepare_unchecked(
        &self,
        system: &dyn System,
        dt: f64,
    ) -> Result<Box<dyn Stepper>, IntegrateError> {
        const NAME: &str = "Houbolt";
        let dt = check_step(dt)?;
        let n = system.dof();
        if let HouboltStart::Given { at_dt, at_2dt } = &self.start {
            let both = [("the displacement at Δt", at_dt), ("the displacement at 2Δt", at_2dt)];
            for (step, (what, given)) in (1..).zip(both) {
                if given.len() != n {
                    return Err(IntegrateError::Components { what, got: given.len(), dof: n });
                }
                check_finite(what, given, f64::from(step) * dt)?;
            }
        }
        let family = match self.start {
            HouboltStart::CentralDifference => Newmark::CENTRAL_DIFFERENCE,
            _ => Newmark::AVERAGE_ACCELERATION,
        };
        let equations = Equations::from_system(system);
        Ok(Box::new(HouboltStepper {
            effective: equations.effective(NAME, dt, 11.0 / 12.0 * dt, 0.5 * dt * dt)?,
            starter: NewmarkStepper::new(NAME, family, &equations, dt)?,
            start: self.start.clone(),
            dt,
            x_hat: vec![0.0; n],
            v_hat: vec![0.0; n],
        }))
    }
}

/// A prepared step of Houbolt's scheme, with the state `[x, ẋ, ẍ, s]`, where s = ∇³x/Δt².
///
/// With u = ∇x/Δt and w = ∇²x/Δt², Houbolt's formulas are ẍ = w + s and ẋ = u + ½Δt w + ⅓Δt s, so
/// that x, ẋ, ẍ, s are equivalent to four displacements. In one step
///
/// ```text
/// w' = w + s'    u' = u + Δt w'    x' = x + Δt u'
/// ```
///
/// and ẍ' = w + 2s' is the unknown of equilibrium at t + Δt.
#[derive(Debug)]
struct HouboltStepper {
    effective: EffectiveMatrix,
    starter: NewmarkStepper,
    start: HouboltStart,
    dt: f64,
    x_hat: Vec<f64>,
    v_hat: Vec<f64>,
}

impl HouboltStepper {
    /// Returns w = ∇²x/Δt² and u = ∇x/Δt in degree of freedom `i`.
    fn differences(&self, state: &[f64], i: usize) -> (f64, f64) {
        let n = self.x_hat.len();
        let (v, a, s) = (state[n + i], state[2 * n + i], state[3 * n + i]);
        let w = a - s;
        (w, v - self.dt * (0.5 * w + s / 3.0))
    }
}

impl Stepper for HouboltStepper {
    fn dof(&self) -> usize {
        self.x_hat.len()
    }

    fn state_len(&self) -> usize {
        4 * self.dof()
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
        let (n, dt) = (self.dof(), self.dt);
        for i in 0..n {
            let (w, u) = self.differences(state, i);
            // Values of x' and ẋ' for ẍ' = 0, that is s' = −w/2.
            self.x_hat[i] = state[i] + dt * (u + 0.5 * dt * w);
            self.v_hat[i] = u + 7.0 / 12.0 * dt * w;
            change[2 * n + i] = loads.next[i];
        }
        let acceleration = &mut change[2 * n..3 * n];
        self.effective.solve(loads.time + dt, &self.v_hat, &self.x_hat, acceleration)?;
        for i in 0..n {
            let (w, u) = self.differences(state, i);
            let s_new = 0.5 * (change[2 * n + i] - w);
            let w_new = w + s_new;
            let u_new = u + dt * w_new;
            let v_new = u_new + dt * (0.5 * w_new + s_new / 3.0);
            change[i] = dt * u_new;
            change[n + i] = v_new - state[n + i];
            change[2 * n + i] -= state[2 * n + i];
            change[3 * n + i] = s_new - state[3 * n + i];
        }
        Ok(())
    }

    fn first(&self) -> usize {
        2
    }

    fn start(
        &mut self,
        initial: &InitialState,
        early: &[Vec<f64>],
        motions: &mut [Vec<f64>],
        state: &mut [f64],
    ) -> Result<(), IntegrateError> {
        let n = self.dof();
        let mut changes = [vec![0.0; 3 * n], vec![0.0; 3 * n]];
        let (begin, rest) = motions.split_at_mut(1);
        self.starter.start(initial, early, begin, &mut state[..3 * n])?;
        let mut now = begin[0].clone();
        for (k, change) in changes.iter_mut().enumerate() {
            self.lead_step(k, &now, early, change)?;
            now.iter_mut().zip(&*change).for_each(|(z, dz)| *z += dz);
            rest[k].copy_from_slice(&now);
        }
        if let HouboltStart::Given { .. } = self.start {
            self.finish_given(&begin[0], early, rest)?;
        }
        // The values u = ∇x/Δt and w = ∇²x/Δt² are computed from the changes in the two steps,
        // because differences of displacements would lose digits.
        let (x, _, a) = motion(&rest[1], n);
        for i in 0..n {
            let u = changes[1][i] / self.dt;
            let w = (changes[1][i] - changes[0][i]) / (self.dt * self.dt);
            let s = a[i] - w;
            state[i] = x[i];
            state[n + i] = u + self.dt * (0.5 * w + s / 3.0);
            state[2 * n + i] = a[i];
            state[3 * n + i] = s;
        }
        Ok(())
    }
}

impl HouboltStepper {
    /// Writes the change of the motion from sample `k` to `k + 1` of the starting procedure into
    /// `change`.
    fn lead_step(
        &mut self,
        k: usize,
        now: &[f64],
        early: &[Vec<f64>],
        change: &mut [f64],
    ) -> Result<(), IntegrateError> {
        if let HouboltStart::Given { at_dt, at_2dt } = &self.start {
            let next = [at_dt, at_2dt][k];
            for i in 0..next.len() {
                change[i] = next[i] - now[i];
            }
            return Ok(());
        }
        let (now_load, next_load) = (&early[k], &early[k + 1]);
        let loads = Loads {
            time: k as f64 * self.dt,
            now: now_load,
            middle: now_load,
            next: next_load,
            beyond: next_load,
        };
        self.starter.change(now, &loads, change)
    }

    /// Computes velocities and accelerations at Δt and 2Δt from the given displacements.
    fn finish_given(
        &mut self,
        begin: &[f64],
        early: &[Vec<f64>],
        rest: &mut [Vec<f64>],
    ) -> Result<(), IntegrateError> {
        let n = self.dof();
        let (first, second) = rest.split_at_mut(1);
        let (first, second) = (&mut first[0], &mut second[0]);
        for i in 0..n {
            let (x0, x1, x2) = (begin[i], first[i], second[i]);
            first[n + i] = (x2 - x0) / (2.0 * self.dt);
            second[n + i] = (3.0 * x2 - 4.0 * x1 + x0) / (2.0 * self.dt);
        }
        for (step, sample, force) in [(1.0, first, &early[1]), (2.0, second, &early[2])] {
            let (x, v, a) = motion_mut(sample, n);
            a.copy_from_slice(force);
            self.starter.mass.solve(step * self.dt, v, x, a)?;
        }
        Ok(())
    }
}
