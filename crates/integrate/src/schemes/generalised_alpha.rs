//! The generalised-α method, with HHT-α and WBZ-α among its members.

use mechid_model::InitialState;

use crate::error::IntegrateError;
use crate::schemes::motion::start_consistently;
use crate::schemes::scheme::{Convention, Scheme, check_parameter};
use crate::stability::stable_steps::StableSteps;
use crate::stepping::effective_matrix::{EffectiveMatrix, Equations};
use crate::stepping::stepper::{Instant, Loads, Stepper, check_step};
use crate::system::System;

/// Acceleration that the generalised-α method returns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum AlphaAcceleration {
    /// Acceleration of the equation of motion at the sample, M ẍ = F − C ẋ − K x: second order, at
    /// the cost of a second solve.
    #[default]
    EquationOfMotion,
    /// Acceleration carried from step to step. It belongs to t + (α_m − α_f)Δt; as an approximation
    /// of the acceleration at t it is of first order.
    Carried,
}

/// Rule that gives the parameters from ρ∞.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Member {
    Generalised,
    HilberHughesTaylor,
    WoodBossakZienkiewicz,
}

/// The generalised-α method: Newmark's formulas for an acceleration a that is carried from step to
/// step,
///
/// ```text
/// x(t+Δt) = x + Δt ẋ + Δt² [(½ − β) a + β a(t+Δt)]
/// ẋ(t+Δt) = ẋ + Δt [(1 − γ) a + γ a(t+Δt)]
/// ```
///
/// and equilibrium between the samples, M a_m + C ẋ_f + K x_f = F_f, where
///
/// ```text
/// a_m = (1 − α_m) a(t+Δt) + α_m a        x_f = (1 − α_f) x(t+Δt) + α_f x, likewise ẋ_f and F_f
/// γ = ½ − α_m + α_f                      β = ¼ (1 − α_m + α_f)²
/// ```
///
/// The method is of second order and unconditionally stable. ρ∞ is the spectral radius at very
/// large steps: in each step, the amplitude of a motion that is too fast for the step is multiplied
/// by ρ∞. With 1 no motion is damped, with 0 such a motion vanishes in one step. For a given ρ∞,
/// [`new`](Self::new) returns the member that damps slow motions least. The method uses the loads
/// at t and t + Δt, and starts from the consistent acceleration.
///
/// # Source
/// Chung & Hulbert, J. Appl. Mech. 60 (1993), 371–375, eqs. (1)–(6), (17) and (25); HHT-α: Hilber,
/// Hughes & Taylor (1977); WBZ-α: Wood, Bossak & Zienkiewicz (1980). On the carried acceleration:
/// Erlicher, Bonaventura & Bursi, Comput. Mech. 28 (2002), 83–104.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GeneralisedAlpha {
    member: Member,
    rho: f64,
    alpha_m: f64,
    alpha_f: f64,
    acceleration: AlphaAcceleration,
}

impl GeneralisedAlpha {
    /// Creates the generalised-α method that damps slow motions least for this ρ∞, a pure number
    /// between 0 and 1.
    ///
    /// # Errors
    /// [`IntegrateError::Parameter`].
    pub fn new(rho_infinity: f64) -> Result<Self, IntegrateError> {
        let rho = check_parameter("generalised-α", "ρ∞", rho_infinity, 0.0, 1.0)?;
        let (alpha_m, alpha_f) = ((2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0));
        Ok(Self::from_parameters(Member::Generalised, rho, alpha_m, alpha_f))
    }

    /// Returns HHT-α, which evaluates the inertia force at t + Δt; ρ∞ is a pure number between ½
    /// and 1, and the α of the method is (ρ∞ − 1)/(ρ∞ + 1), between −⅓ and 0.
    ///
    /// # Errors
    /// [`IntegrateError::Parameter`].
    pub fn hilber_hughes_taylor(rho_infinity: f64) -> Result<Self, IntegrateError> {
        let rho = check_parameter("HHT-α", "ρ∞", rho_infinity, 0.5, 1.0)?;
        Ok(Self::from_parameters(Member::HilberHughesTaylor, rho, 0.0, (1.0 - rho) / (1.0 + rho)))
    }

    /// Returns WBZ-α, which evaluates all forces except the inertia force at t + Δt; ρ∞ is a pure
    /// number between 0 and 1, and the α of the method is (ρ∞ − 1)/(ρ∞ + 1).
    ///
    /// # Errors
    /// [`IntegrateError::Parameter`].
    pub fn wood_bossak_zienkiewicz(rho_infinity: f64) -> Result<Self, IntegrateError> {
        let rho = check_parameter("WBZ-α", "ρ∞", rho_infinity, 0.0, 1.0)?;
        Ok(Self::from_parameters(
            Member::WoodBossakZienkiewicz,
            rho,
            (rho - 1.0) / (rho + 1.0),
            0.0,
        ))
    }

    fn from_parameters(member: Member, rho: f64, alpha_m: f64, alpha_f: f64) -> Self {
        Self { member, rho, alpha_m, alpha_f, acceleration: AlphaAcceleration::default() }
    }

    /// Returns the scheme with this choice of the acceleration in its responses.
    #[must_use]
    pub fn with_acceleration(self, acceleration: AlphaAcceleration) -> Self {
        Self { acceleration, ..self }
    }

    /// α_m, the weight of the acceleration at t in the equilibrium, a pure number.
    pub fn alpha_m(&self) -> f64 {
        self.alpha_m
    }

    /// α_f, the weight of displacement, velocity and force at t in the equilibrium, a pure number.
    pub fn alpha_f(&self) -> f64 {
        self.alpha_f
    }

    /// Weight of the new acceleration in the displacement, a pure number.
    pub fn beta(&self) -> f64 {
        0.25 * (1.0 - self.alpha_m + self.alpha_f).powi(2)
    }

    /// Weight of the new acceleration in the velocity, a pure number.
    pub fn gamma(&self) -> f64 {
        0.5 - self.alpha_m + self.alpha_f
    }

    fn family(&self) -> &'static str {
        match self.member {
            Member::Generalised => "generalised-α",
            Member::HilberHughesTaylor => "HHT-α",
            Member::WoodBossakZienkiewicz => "WBZ-α",
        }
    }
}

impl Scheme for GeneralisedAlpha {
    fn name(&self) -> String {
        format!("{} (ρ∞ = {})", self.family(), self.rho)
    }

    fn conventions(&self) -> Vec<Convention> {
        let acceleration = match self.acceleration {
            AlphaAcceleration::EquationOfMotion => "from the equation of motion at each sample",
            AlphaAcceleration::Carried => "carried from step to step (first order)",
        };
        vec![
            Convention { what: "load", choice: "weighted between t and t+Δt" },
            Convention { what: "start", choice: "consistent acceleration at t = 0" },
            Convention { what: "acceleration", choice: acceleration },
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
        let (dt, name) = (check_step(dt)?, self.family());
        let n = system.dof();
        let equations = Equations::from_system(system);
        let share = (1.0 - self.alpha_f) / (1.0 - self.alpha_m);
        let (gamma_hat, beta_hat) = (share * self.gamma() * dt, share * self.beta() * dt * dt);
        Ok(Box::new(GeneralisedAlphaStepper {
            effective: equations.effective(name, dt, gamma_hat, beta_hat)?,
            mass: equations.mass_only(name, dt)?,
            dt,
            scheme: *self,
            x_hat: vec![0.0; n],
            v_hat: vec![0.0; n],
            a_m: vec![0.0; n],
        }))
    }
}

/// A prepared step of the generalised-α method. The state is `[x, ẋ, ẍ, a]`, or `[x, ẋ, a]` if the
/// method returns the carried acceleration a.
///
/// The unknown is a_m: with κ = 1/(1 − α_m) the new a is κ (a_m − α_m a).
#[derive(Debug)]
struct GeneralisedAlphaStepper {
    effective: EffectiveMatrix,
    mass: EffectiveMatrix,
    dt: f64,
    scheme: GeneralisedAlpha,
    x_hat: Vec<f64>,
    v_hat: Vec<f64>,
    a_m: Vec<f64>,
}

impl GeneralisedAlphaStepper {
    fn carries_two(&self) -> bool {
        self.scheme.acceleration == AlphaAcceleration::EquationOfMotion
    }
}

impl Stepper for GeneralisedAlphaStepper {
    fn dof(&self) -> usize {
        self.x_hat.len()
    }

    fn state_len(&self) -> usize {
        if self.carries_two() { 4 * self.dof() } else { 3 * self.dof() }
    }

    fn instants(&self) -> &'static [Instant] {
        &[Instant::Now, Instant::Next]
    }

    fn change(
        &mut self,
        state: &[f64],
        loads: &Loads<'_>,
        change: &mut [f64],
    ) -> Result<(), IntegrateError> {
        let (n, dt) = (self.dof(), self.dt);
        let GeneralisedAlpha { alpha_m, alpha_f, .. } = self.scheme;
        let (beta, gamma) = (self.scheme.beta(), self.scheme.gamma());
        let kappa = (1.0 - alpha_m).recip();
        let (x, v) = (&state[..n], &state[n..2 * n]);
        let carried = self.state_len() - n;
        let a = &state[carried..];
        for i in 0..n {
            // The unknown a_m is set to zero here; the new a is then −κ α_m a.
            let (a, of_zero) = (a[i], -kappa * alpha_m * a[i]);
            change[i] = dt * (v[i] + dt * ((0.5 - beta) * a + beta * of_zero));
            change[n + i] = dt * ((1.0 - gamma) * a + gamma * of_zero);
            self.x_hat[i] = x[i] + (1.0 - alpha_f) * change[i];
            self.v_hat[i] = v[i] + (1.0 - alpha_f) * change[n + i];
            self.a_m[i] = (1.0 - alpha_f) * loads.next[i] + alpha_f * loads.now[i];
        }
        let between = loads.time + (1.0 - alpha_f) * dt;
        self.effective.solve(between, &self.v_hat, &self.x_hat, &mut self.a_m)?;
        for i in 0..n {
            let new = kappa * self.a_m[i];
            change[i] += beta * dt * dt * new;
            change[n + i] += gamma * dt * new;
            change[carried + i] = new - (1.0 + kappa * alpha_m) * a[i];
        }
        if self.carries_two() {
            for i in 0..n {
                self.x_hat[i] = x[i] + change[i];
                self.v_hat[i] = v[i] + change[n + i];
            }
            let acceleration = &mut change[2 * n..3 * n];
            acceleration.copy_from_slice(&loads.next[..n]);
            self.mass.solve(loads.time + dt, &self.v_hat, &self.x_hat, acceleration)?;
            acceleration.iter_mut().zip(&state[2 * n..3 * n]).for_each(|(new, old)| *new -= old);
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
        let n = self.dof();
        start_consistently(&mut self.mass, initial, &early[0], state)?;
        motions[0].copy_from_slice(&state[..3 * n]);
        state.copy_within(2 * n..3 * n, state.len() - n);
        Ok(())
    }
}
