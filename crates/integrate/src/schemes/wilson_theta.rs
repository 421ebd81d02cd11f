//! Wilson θ.

use mechid_model::InitialState;

use crate::error::IntegrateError;
use crate::schemes::motion::{motion, motion_mut, start_consistently};
use crate::schemes::scheme::{Convention, Scheme, check_parameter};
use crate::stability::stable_steps::StableSteps;
use crate::stepping::effective_matrix::{EffectiveMatrix, Equations};
use crate::stepping::stepper::{Instant, Loads, Stepper, check_step};
use crate::system::System;

/// Force at t + θΔt for Wilson's scheme.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum WilsonLoad {
    /// F(t) + θ [F(t+Δt) − F(t)]: extrapolation of the line through the two ends of the step.
    #[default]
    Projected,
    /// F(t+Δt) + (θ − 1) [F(t+2Δt) − F(t+Δt)]: interpolation between the two samples around t + θΔt
    /// for θ ≤ 2, extrapolation for larger θ. In the last step of a record that does not repeat,
    /// the load is projected.
    Interpolated,
}

/// Wilson's scheme: acceleration linear from t to t + θΔt, equilibrium at t + θΔt.
///
/// The scheme is of second order, and unconditionally stable for θ ≥ 1.366. It starts from the
/// consistent acceleration. Equilibrium does not hold at the samples: M ẍ + C ẋ + K x ≠ F there.
///
/// # Source
/// Dissertation eqs. (3.3.3.1)–(3.3.3.9) (its table 3.3 B is misprinted); Bathe (1982),
/// section 9.2.3.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WilsonTheta {
    theta: f64,
    load: WilsonLoad,
}

impl WilsonTheta {
    /// Creates the scheme with θ ≥ 1, a pure number (1 is linear acceleration, 1.4 the usual
    /// value), and the projected load.
    ///
    /// # Errors
    /// [`IntegrateError::Parameter`] if θ < 1 or not finite.
    pub fn new(theta: f64) -> Result<Self, IntegrateError> {
        check_parameter("Wilson θ", "θ", theta, 1.0, f64::INFINITY)?;
        Ok(Self { theta, load: WilsonLoad::Projected })
    }

    /// Returns the same scheme with a different rule for the load at t + θΔt.
    #[must_use]
    pub fn with_load(self, load: WilsonLoad) -> Self {
        Self { load, ..self }
    }

    /// Returns θ, the instant of equilibrium as a multiple of the step, a pure number.
    pub fn theta(&self) -> f64 {
        self.theta
    }

    /// The load convention that the scheme uses.
    pub fn load(&self) -> WilsonLoad {
        self.load
    }
}

impl Scheme for WilsonTheta {
    fn name(&self) -> String {
        format!("Wilson θ (θ = {})", self.theta)
    }

    fn conventions(&self) -> Vec<Convention> {
        let load = match self.load {
            WilsonLoad::Projected => "at t+θΔt, projected from F(t) and F(t+Δt)",
            WilsonLoad::Interpolated => "at t+θΔt, interpolated between F(t+Δt) and F(t+2Δt)",
        };
        vec![
            Convention { what: "load", choice: load },
            Convention { what: "start", choice: "consistent acceleration at t = 0" },
        ]
    }

    fn stable_steps(&self) -> StableSteps {
        // A root of the characteristic polynomial passes −1 at θ = (1 + √3)/2 for ωΔt → ∞.
        if self.theta >= 1.366_025_403_8 { StableSteps::All } else { StableSteps::Unknown }
    }

    fn prepare_unchecked(
        &self,
        system: &dyn System,
        dt: f64,
    ) -> Result<Box<dyn Stepper>, IntegrateError> {
        const NAME: &str = "Wilson θ";
        let dt = check_step(dt)?;
        let n = system.dof();
        let long = self.theta * dt;
        let equations = Equations::from_system(system);
        Ok(Box::new(WilsonStepper {
            effective: equations.effective(NAME, dt, long / 2.0, long * long / 6.0)?,
            mass: equations.mass_only(NAME, dt)?,
            dt,
            scheme: *self,
            x_hat: vec![0.0; n],
            v_hat: vec![0.0; n],
        }))
    }
}

/// A prepared step of Wilson's scheme, with the state `[x, ẋ, ẍ]`.
#[derive(Debug)]
struct WilsonStepper {
    effective: EffectiveMatrix,
    mass: EffectiveMatrix,
    dt: f64,
    scheme: WilsonTheta,
    x_hat: Vec<f64>,
    v_hat: Vec<f64>,
}

impl Stepper for WilsonStepper {
    fn dof(&self) -> usize {
        self.x_hat.len()
    }

    fn state_len(&self) -> usize {
        3 * self.dof()
    }

    fn instants(&self) -> &'static [Instant] {
        match self.scheme.load {
            WilsonLoad::Projected => &[Instant::Now, Instant::Next],
            WilsonLoad::Interpolated => &[Instant::Next, Instant::Beyond],
        }
    }

    fn change(
        &mut self,
        state: &[f64],
        loads: &Loads<'_>,
        change: &mut [f64],
    ) -> Result<(), IntegrateError> {
        let (n, dt, WilsonTheta { theta, load }) = (self.dof(), self.dt, self.scheme);
        let long = theta * dt;
        let (x, v, a) = motion(state, n);
        let (dx, dv, da) = motion_mut(change, n);
        let (from, to, weight) = match load {
            WilsonLoad::Projected => (loads.now, loads.next, theta),
            WilsonLoad::Interpolated => (loads.next, loads.beyond, theta - 1.0),
        };
        for i in 0..n {
            self.x_hat[i] = x[i] + long * (v[i] + long / 3.0 * a[i]);
            self.v_hat[i] = v[i] + 0.5 * long * a[i];
            da[i] = from[i] + weight * (to[i] - from[i]);
        }
        self.effective.solve(loads.time + long, &self.v_hat, &self.x_hat, da)?;
        for i in 0..n {
            da[i] = (da[i] - a[i]) / theta;
            dv[i] = dt * (a[i] + 0.5 * da[i]);
            dx[i] = dt * (v[i] + dt * (0.5 * a[i] + da[i] / 6.0));
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
