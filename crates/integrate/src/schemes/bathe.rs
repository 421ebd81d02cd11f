//! Bathe's composite scheme.

use mechid_model::InitialState;

use crate::error::IntegrateError;
use crate::schemes::motion::{motion, motion_mut, start_consistently};
use crate::schemes::scheme::{Convention, Scheme, check_parameter};
use crate::stability::stable_steps::StableSteps;
use crate::stepping::effective_matrix::{EffectiveMatrix, Equations};
use crate::stepping::stepper::{Instant, Loads, Stepper, check_step};
use crate::system::System;

/// Force at the end of the first sub-step of Bathe's scheme.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SubStepForce {
    /// Linear from F(t) to F(t+Δt).
    #[default]
    Linear,
    /// The force itself at the end of the first sub-step, from a function of time or from samples
    /// at this instant.
    Supplied,
}

/// Bathe's composite scheme: the trapezoidal rule from t to t + γΔt, then
///
/// ```text
/// ẋ(t+Δt) = ẋ + Δt [q₀ ẍ + q₁ ẍ(t+γΔt) + q₂ ẍ(t+Δt)]
/// x(t+Δt) = x + Δt [q₀ ẋ + q₁ ẋ(t+γΔt) + q₂ ẋ(t+Δt)]
/// q₁ = (ρ∞ + 1) / (2γ (ρ∞ − 1) + 4)        q₂ = ½ − γ q₁        q₀ = 1 − q₁ − q₂
/// ```
///
/// with equilibrium at t + γΔt and t + Δt. The scheme is of second order and unconditionally
/// stable; ρ∞ is the spectral radius at very large steps. For ρ∞ = 0 the second sub-step is the
/// backward difference of second order over the three instants. Each step takes two solves. The
/// scheme starts from the consistent acceleration.
///
/// # Source
/// Bathe & Baig, Comput. Struct. 83 (2005), 2513–2524 (γ = ½, ρ∞ = 0); Noh & Bathe, Comput. Struct.
/// 212 (2019), 299–310 (ρ∞-Bathe).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bathe {
    rho: f64,
    splitting: f64,
    force: SubStepForce,
}

impl Bathe {
    /// The scheme of 2005: two sub-steps of ½Δt, ρ∞ = 0. Two different matrices are factored.
    pub const HALVES: Self = Self { rho: 0.0, splitting: 0.5, force: SubStepForce::Linear };

    /// Creates the ρ∞-Bathe scheme: ρ∞, a pure number, is between 0 and 1, and γ = (2 − √(2 +
    /// 2ρ∞))/(1 − ρ∞), for which both sub-steps share one matrix.
    ///
    /// # Errors
    /// [`IntegrateError::Parameter`].
    pub fn new(rho_infinity: f64) -> Result<Self, IntegrateError> {
        let rho = check_parameter("Bathe", "ρ∞", rho_infinity, 0.0, 1.0)?;
        // This is γ in a form without the quotient 0/0 at ρ∞ = 1.
        let splitting = 2.0 / (2.0 + (2.0 + 2.0 * rho).sqrt());
        Ok(Self { rho, splitting, force: SubStepForce::Linear })
    }

    /// Returns the scheme with this choice of the force at the end of the first sub-step.
    #[must_use]
    pub fn with_force(self, force: SubStepForce) -> Self {
        Self { force, ..self }
    }

    /// Fraction γ of the step that the first sub-step takes, a pure number.
    pub fn splitting(&self) -> f64 {
        self.splitting
    }

    /// Returns the weights q₀, q₁, q₂.
    fn weights(&self) -> [f64; 3] {
        let (rho, gamma) = (self.rho, self.splitting);
        let q1 = (rho + 1.0) / (2.0 * gamma * (rho - 1.0) + 4.0);
        let q2 = 0.5 - gamma * q1;
        [1.0 - q1 - q2, q1, q2]
    }
}

impl Scheme for Bathe {
    fn name(&self) -> String {
        let gamma = (self.splitting * 1e6).round() / 1e6;
        format!("Bathe (ρ∞ = {}, γ = {gamma})", self.rho)
    }

    fn conventions(&self) -> Vec<Convention> {
        let force = match self.force {
            SubStepForce::Linear => "linear between t and t+Δt",
            SubStepForce::Supplied => "supplied (function of time or samples at this instant)",
        };
        vec![
            Convention { what: "force at t+γΔt", choice: force },
            Convention { what: "start", choice: "consistent acceleration at t = 0" },
        ]
    }

    fn inner_instant(&self) -> Option<f64> {
        (self.force == SubStepForce::Supplied).then_some(self.splitting)
    }

    fn stable_steps(&self) -> StableSteps {
        StableSteps::All
    }

    fn prepare_unchecked(
        &self,
        system: &dyn System,
        dt: f64,
    ) -> Result<Box<dyn Stepper>, IntegrateError> {
        const NAME: &str = "Bathe";
        let dt = check_step(dt)?;
        let n = system.dof();
        let equations = Equations::from_system(system);
        let [q0, q1, q2] = self.weights();
        let (half, last) = (0.5 * self.splitting * dt, q2 * dt);
        let second = if (half - last).abs() > 1e-12 * dt {
            Some(equations.effective(NAME, dt, last, last * last)?)
        } else {
            None
        };
        Ok(Box::new(BatheStepper {
            first: equations.effective(NAME, dt, half, half * half)?,
            second,
            mass: equations.mass_only(NAME, dt)?,
            dt,
            scheme: *self,
            half,
            weights: [q0 * dt, q1 * dt, last],
            inner: vec![0.0; 2 * n],
            x_hat: vec![0.0; n],
            v_hat: vec![0.0; n],
        }))
    }
}

/// A prepared step of Bathe's scheme, with the state `[x, ẋ, ẍ]`.
#[derive(Debug)]
struct BatheStepper {
    first: EffectiveMatrix,
    /// The matrix of the second sub-step if it differs from the first.
    second: Option<EffectiveMatrix>,
    mass: EffectiveMatrix,
    dt: f64,
    scheme: Bathe,
    /// Half of the first sub-step, ½γΔt.
    half: f64,
    /// Products q₀Δt, q₁Δt, q₂Δt.
    weights: [f64; 3],
    /// Velocity ẋ and acceleration ẍ at t + γΔt.
    inner: Vec<f64>,
    x_hat: Vec<f64>,
    v_hat: Vec<f64>,
}

impl Stepper for BatheStepper {
    fn dof(&self) -> usize {
        self.x_hat.len()
    }

    fn state_len(&self) -> usize {
        3 * self.dof()
    }

    fn instants(&self) -> &'static [Instant] {
        match self.scheme.force {
            SubStepForce::Linear => &[Instant::Now, Instant::Next],
            SubStepForce::Supplied => &[Instant::Middle, Instant::Next],
        }
    }

    fn change(
        &mut self,
        state: &[f64],
        loads: &Loads<'_>,
        change: &mut [f64],
    ) -> Result<(), IntegrateError> {
        let (n, dt, half, gamma) = (self.dof(), self.dt, self.half, self.scheme.splitting);
        let [q0, q1, q2] = self.weights;
        let (x, v, a) = motion(state, n);
        let (dx, dv, da) = motion_mut(change, n);
        let (inner_v, inner_a) = self.inner.split_at_mut(n);
        for i in 0..n {
            self.v_hat[i] = v[i] + half * a[i];
            self.x_hat[i] = x[i] + half * (v[i] + self.v_hat[i]);
            inner_a[i] = match self.scheme.force {
                SubStepForce::Linear => loads.now[i] + gamma * (loads.next[i] - loads.now[i]),
                SubStepForce::Supplied => loads.middle[i],
            };
        }
        let between = loads.time + gamma * dt;
        self.first.solve(between, &self.v_hat, &self.x_hat, inner_a)?;
        for i in 0..n {
            inner_v[i] = self.v_hat[i] + half * inner_a[i];
            dv[i] = q0 * a[i] + q1 * inner_a[i];
            self.v_hat[i] = v[i] + dv[i];
            dx[i] = q0 * v[i] + q1 * inner_v[i] + q2 * self.v_hat[i];
            self.x_hat[i] = x[i] + dx[i];
        }
        da.copy_from_slice(&loads.next[..n]);
        let second = self.second.as_mut().unwrap_or(&mut self.first);
        second.solve(loads.time + dt, &self.v_hat, &self.x_hat, da)?;
        for i in 0..n {
            dv[i] += q2 * da[i];
            dx[i] += q2 * q2 * da[i];
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
