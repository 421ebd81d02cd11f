//! The classical Runge–Kutta scheme of fourth order.

use mechid_model::InitialState;

use crate::error::IntegrateError;
use crate::schemes::motion::{motion, motion_mut, start_consistently};
use crate::schemes::scheme::{Convention, Scheme};
use crate::stability::stable_steps::StableSteps;
use crate::stepping::effective_matrix::{EffectiveMatrix, Equations};
use crate::stepping::stepper::{Instant, Loads, Stepper, check_step};
use crate::system::System;

/// Force at t + Δt/2 for the two middle stages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MidStepForce {
    /// F(t), the force at the start of the step: the scheme is of first order where the force
    /// changes.
    Held,
    /// ½ [F(t) + F(t+Δt)], the mean of the forces at the two samples: the scheme is of second
    /// order.
    Linear,
    /// The force itself, from a function of time or from samples supplied at mid-step
    /// ([`mechid_signal::resample::within_steps`] interpolates them): fourth order.
    Supplied,
}

/// The classical four-stage Runge–Kutta scheme on ẍ = M⁻¹ (F − C ẋ − K x).
///
/// The scheme is of fourth order if the force is known in the middle of the steps. Without damping
/// it is stable up to ωΔt = 2√2. Samples do not contain the force at mid-step: the caller chooses
/// how to get it.
///
/// # Source
/// Dissertation eqs. (3.3.5.1)–(3.3.6.7) (the last stage of 3.3.6.7 is misprinted).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RungeKutta4 {
    /// The force of the two middle stages.
    pub mid_step: MidStepForce,
}

impl RungeKutta4 {
    /// Mid-step force held from the start of the step.
    pub const HELD: Self = Self { mid_step: MidStepForce::Held };
    /// Mid-step force interpolated linearly.
    pub const LINEAR: Self = Self { mid_step: MidStepForce::Linear };
    /// Mid-step force from a function or from supplied samples.
    pub const SUPPLIED: Self = Self { mid_step: MidStepForce::Supplied };
}

/// Radius r of the largest half disc |z| ≤ r, Re z ≤ 0, in the region of stability |1 + z + z²/2 +
/// z³/6 + z⁴/24| ≤ 1.
const HALF_DISC: f64 = 2.6;

impl Scheme for RungeKutta4 {
    fn name(&self) -> String {
        "Runge–Kutta 4".to_owned()
    }

    fn conventions(&self) -> Vec<Convention> {
        let choice = match self.mid_step {
            MidStepForce::Held => "held from t",
            MidStepForce::Linear => "linear between t and t+Δt",
            MidStepForce::Supplied => "supplied (function of time or mid-step samples)",
        };
        vec![Convention { what: "force at t+Δt/2", choice }]
    }

    fn stable_steps(&self) -> StableSteps {
        StableSteps::Eigenvalues(HALF_DISC)
    }

    fn inner_instant(&self) -> Option<f64> {
        (self.mid_step == MidStepForce::Supplied).then_some(0.5)
    }

    fn prepare_unchecked(
        &self,
        system: &dyn System,
        dt: f64,
    ) -> Result<Box<dyn Stepper>, IntegrateError> {
        let dt = check_step(dt)?;
        let n = system.dof();
        Ok(Box::new(RungeKuttaStepper {
            mass: Equations::from_system(system).mass_only("Runge–Kutta 4", dt)?,
            dt,
            mid_step: self.mid_step,
            middle: vec![0.0; n],
            x: vec![0.0; n],
            v: vec![0.0; n],
            a: vec![0.0; n],
        }))
    }
}

/// A prepared step of the Runge–Kutta scheme, with the state `[x, ẋ, ẍ]`; the acceleration is the
/// slope of the first stage.
#[derive(Debug)]
struct RungeKuttaStepper {
    mass: EffectiveMatrix,
    dt: f64,
    mid_step: MidStepForce,
    middle: Vec<f64>,
    x: Vec<f64>,
    v: Vec<f64>,
    a: Vec<f64>,
}

impl RungeKuttaStepper {
    /// Computes the slopes of the next stage at `time`, displacement x + h·v_stage and velocity v +
    /// h·a_stage; the slopes v_stage and a_stage of the present stage are in `self.v` and `self.a`.
    fn stage(
        &mut self,
        (x, v): (&[f64], &[f64]),
        h: f64,
        time: f64,
        force: impl Fn(&Self, usize) -> f64,
    ) -> Result<(), IntegrateError> {
        for i in 0..x.len() {
            self.x[i] = x[i] + h * self.v[i];
            self.v[i] = v[i] + h * self.a[i];
        }
        for i in 0..x.len() {
            self.a[i] = force(self, i);
        }
        self.mass.solve(time, &self.v, &self.x, &mut self.a)
    }

    /// Adds `weight` times the slopes of the present stage to `dx` and `dv`.
    fn add(&self, weight: f64, dx: &mut [f64], dv: &mut [f64]) {
        for i in 0..dx.len() {
            dx[i] += weight * self.v[i];
            dv[i] += weight * self.a[i];
        }
    }
}

impl Stepper for RungeKuttaStepper {
    fn dof(&self) -> usize {
        self.x.len()
    }

    fn state_len(&self) -> usize {
        3 * self.dof()
    }

    fn instants(&self) -> &'static [Instant] {
        match self.mid_step {
            MidStepForce::Held | MidStepForce::Linear => &[Instant::Now, Instant::Next],
            MidStepForce::Supplied => &[Instant::Middle, Instant::Next],
        }
    }

    fn change(
        &mut self,
        state: &[f64],
        loads: &Loads<'_>,
        change: &mut [f64],
    ) -> Result<(), IntegrateError> {
        let (n, dt, time) = (self.dof(), self.dt, loads.time);
        let (x, v, a) = motion(state, n);
        let (dx, dv, da) = motion_mut(change, n);
        for i in 0..n {
            self.middle[i] = match self.mid_step {
                MidStepForce::Held => loads.now[i],
                MidStepForce::Linear => 0.5 * (loads.now[i] + loads.next[i]),
                MidStepForce::Supplied => loads.middle[i],
            };
            dx[i] = dt / 6.0 * v[i];
            dv[i] = dt / 6.0 * a[i];
        }
        self.v.copy_from_slice(v);
        self.a.copy_from_slice(a);
        self.stage((x, v), dt / 2.0, time + dt / 2.0, |s, i| s.middle[i])?;
        self.add(dt / 3.0, dx, dv);
        self.stage((x, v), dt / 2.0, time + dt / 2.0, |s, i| s.middle[i])?;
        self.add(dt / 3.0, dx, dv);
        self.stage((x, v), dt, time + dt, |_, i| loads.next[i])?;
        self.add(dt / 6.0, dx, dv);
        for i in 0..n {
            self.x[i] = x[i] + dx[i];
            self.v[i] = v[i] + dv[i];
        }
        da.copy_from_slice(&loads.next[..n]);
        self.mass.solve(time + dt, &self.v, &self.x, da)?;
        for i in 0..n {
            da[i] -= a[i];
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
        motions[0].copy_from_slice(state);
        Ok(())
    }
}
