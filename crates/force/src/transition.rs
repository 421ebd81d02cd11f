//! From one sample to the next: the discretised equation of motion.
//!
//! Everything here is in step units: the state is [x; Δt ẋ] and the input q = Δt² M⁻¹ F, so that
//! with τ = t/Δt
//!
//! ```text
//! d ┌  x   ┐   ┌      0           I     ┐ ┌  x   ┐   ┌ 0 ┐
//! ──│      │ = │                        │ │      │ + │   │ q
//! dτ└ Δt ẋ ┘   └ −Δt² M⁻¹K   −Δt M⁻¹C   ┘ └ Δt ẋ ┘   └ I ┘
//! ```
//!
//! and no entry is large unless the step is long for the machine.

use mechid_model::SecondOrderSystem;
use nalgebra::DMatrix;

/// z(k+1) = Φ z(k) + Γ₀ q(k) + Γ₁ (q(k+1) − q(k)), in step units; Γ₁ only with a linear input.
pub(crate) struct Transition {
    /// Φ, 2n×2n.
    pub state: DMatrix<f64>,
    /// Γ₀, 2n×n: the effect of an input held at its value at the start of the step.
    pub held: DMatrix<f64>,
    /// Γ₁, 2n×n: the effect of the input's rise from 0 to 1 over the step.
    pub ramp: DMatrix<f64>,
}

impl Transition {
    /// Exact at any step: one matrix exponential of order 4n.
    ///
    /// # Source
    /// Van Loan (1978), Computing integrals involving the matrix exponential.
    pub fn exact(system: &SecondOrderSystem, dt: f64) -> Self {
        let n = system.dof();
        let mut generator = DMatrix::zeros(4 * n, 4 * n);
        generator.view_mut((0, 0), (2 * n, 2 * n)).copy_from(&Self::rate(system, dt));
        generator.view_mut((n, 2 * n), (n, n)).fill_with_identity();
        generator.view_mut((2 * n, 3 * n), (n, n)).fill_with_identity();
        let e = generator.exp();
        Self {
            state: e.view((0, 0), (2 * n, 2 * n)).into_owned(),
            held: e.view((0, 2 * n), (2 * n, n)).into_owned(),
            ramp: e.view((0, 3 * n), (2 * n, n)).into_owned(),
        }
    }

    /// The held input with the exponential cut after `order` terms; order 1 is Euler's rule.
    ///
    /// ```text
    /// Φ = Σ_{j=0}^{p} Aʲ/j!      Γ₀ = Σ_{j=0}^{p−1} Aʲ B/(j+1)!
    /// ```
    pub fn taylor(system: &SecondOrderSystem, dt: f64, order: usize) -> Self {
        let n = system.dof();
        let rate = Self::rate(system, dt);
        let mut term = DMatrix::identity(2 * n, 2 * n);
        let (mut state, mut held) = (term.clone(), DMatrix::zeros(2 * n, n));
        for j in 1..=order {
            term /= j as f64;
            held += term.columns(n, n);
            term = &term * &rate;
            state += &term;
        }
        Self { state, held, ramp: DMatrix::zeros(2 * n, n) }
    }

    /// The rate matrix in step units.
    pub fn rate(system: &SecondOrderSystem, dt: f64) -> DMatrix<f64> {
        let n = system.dof();
        let mass = system.mass().clone().lu();
        let mut rate = DMatrix::zeros(2 * n, 2 * n);
        rate.view_mut((0, n), (n, n)).fill_with_identity();
        for (column, matrix, unit) in [(0, system.stiffness(), dt * dt), (n, system.damping(), dt)]
        {
            let solved = mass.solve(matrix).expect("a system's mass matrix is invertible");
            rate.view_mut((n, column), (n, n)).copy_from(&(solved * -unit));
        }
        rate
    }
}
