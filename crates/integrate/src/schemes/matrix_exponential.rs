//! Exact steps by the matrix exponential.

use mechid_model::{InitialState, Matrix, SecondOrderSystem, StateTransition};
use mechid_numerics::NumericsError;
use mechid_numerics::linear_algebra::exponential;
use nalgebra::{DMatrix, DVectorView, DVectorViewMut};

use crate::error::IntegrateError;
use crate::schemes::motion::start_consistently;
use crate::schemes::scheme::{Convention, Scheme};
use crate::stability::stable_steps::StableSteps;
use crate::stepping::effective_matrix::{EffectiveMatrix, Equations};
use crate::stepping::stepper::{Instant, Loads, Stepper, check_step};
use crate::stepping::transition::Transition;
use crate::system::{Matrices, System};

/// Steps that are exact for a force that is held, or linear, from sample to sample.
///
/// ```text
/// z(t+Δt) = e^{SΔt} z(t) + Γ₀ F(t) + Γ₁ F(t+Δt),    z = (x, ẋ),  ż = S z + (0, M⁻¹F)
/// ```
///
/// Here x are the displacements, F the forces, and S the matrix of the first-order form. The only
/// error is that of the force between its samples. It is zero if the force is really held or linear
/// there; otherwise it is of first order (held) or of second order (linear). The scheme is stable
/// at any step if the system is. At a jump of a held force the acceleration is the limit from the
/// right. A step costs products of dense matrices with two rows per degree of freedom, so that at
/// most 250 degrees of freedom are allowed.
///
/// # Source
/// Van Loan, IEEE Trans. Autom. Control 23 (1978), 395–404.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MatrixExponential {
    linear: bool,
}

impl MatrixExponential {
    /// Force that is constant from each sample to the next, as the output of a digital-to-analogue
    /// converter is.
    pub const HELD: Self = Self { linear: false };
    /// Force linear between samples.
    pub const LINEAR: Self = Self { linear: true };

    /// Largest number of degrees of freedom.
    pub const MOST_DOF: usize = 250;
}

impl Scheme for MatrixExponential {
    fn name(&self) -> String {
        "matrix exponential".to_owned()
    }

    fn conventions(&self) -> Vec<Convention> {
        let choice =
            if self.linear { "linear between t and t+Δt" } else { "held from t until t+Δt" };
        vec![
            Convention { what: "force between samples", choice },
            Convention { what: "start", choice: "consistent acceleration at t = 0" },
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
        const NAME: &str = "matrix exponential";
        let (dt, dof) = (check_step(dt)?, system.dof());
        if dof > Self::MOST_DOF {
            let most = Self::MOST_DOF;
            return Err(IntegrateError::TooManyDof { scheme: NAME, dof, most });
        }
        if !system.nonlinear_forces().is_empty() {
            return Err(IntegrateError::LinearOnly { what: NAME });
        }
        let mass = Equations::from_system(system).mass_only(NAME, dt)?;
        let [change, now, next] = match system.matrices() {
            Matrices::Dense(dense) => exponentials(dense, dt, self.linear)?,
            Matrices::Sparse(sparse) => {
                let [mass, damping, stiffness] = [Matrix::Mass, Matrix::Damping, Matrix::Stiffness]
                    .map(|which| DMatrix::from(sparse.matrix(which)));
                let dense = SecondOrderSystem::new(mass, damping, stiffness)?;
                exponentials(&dense, dt, self.linear)?
            }
        };
        Ok(Box::new(ExponentialStepper {
            change,
            now,
            next,
            mass,
            dt,
            linear: self.linear,
            new: vec![0.0; 2 * dof],
        }))
    }
}

/// Returns e^{SΔt} − I (2n×2n), Γ₀ and Γ₁ (2n×n).
fn exponentials(
    system: &SecondOrderSystem,
    dt: f64,
    linear: bool,
) -> Result<[DMatrix<f64>; 3], IntegrateError> {
    let n = system.dof();
    // In step units, the state consists of x, Δt ẋ, the force, and the change of the force over the
    // step.
    let mut generator = DMatrix::zeros(4 * n, 4 * n);
    generator.view_mut((0, 0), (2 * n, 2 * n)).copy_from(&StateTransition::rate(system, dt));
    generator.view_mut((n, 2 * n), (n, n)).copy_from(&StateTransition::force_input(system, dt));
    generator.view_mut((2 * n, 3 * n), (n, n)).fill_with_identity();
    // Balanced units give a norm of about ωΔt instead of its square, so that fewer squarings are
    // needed.
    let norm = generator.norm();
    let scales =
        Transition::balance(&mut generator).ok_or(NumericsError::ExponentialOverflow { norm })?;
    let unit = |i: usize| if (n..2 * n).contains(&i) { dt } else { 1.0 };
    let mut change = exponential(&generator)? - DMatrix::identity(4 * n, 4 * n);
    for (i, j) in (0..2 * n).flat_map(|i| (0..4 * n).map(move |j| (i, j))) {
        change[(i, j)] *= scales[i] / scales[j] * unit(j) / unit(i);
    }
    let block = |column, width| change.view((0, column), (2 * n, width)).into_owned();
    let (state, held, ramp) = (block(0, 2 * n), block(2 * n, n), block(3 * n, n));
    Ok(if linear { [state, held - &ramp, ramp] } else { [state, held, ramp] })
}

/// A prepared step of the matrix exponential, with the state `[x, ẋ, ẍ]`.
#[derive(Debug)]
struct ExponentialStepper {
    /// Matrix e^{SΔt} − I, where S is the matrix of the first-order form.
    change: DMatrix<f64>,
    /// Matrices Γ₀ and Γ₁, which multiply the forces at t and t + Δt.
    now: DMatrix<f64>,
    next: DMatrix<f64>,
    mass: EffectiveMatrix,
    dt: f64,
    linear: bool,
    /// Displacement x and velocity ẋ at t + Δt.
    new: Vec<f64>,
}

impl Stepper for ExponentialStepper {
    fn dof(&self) -> usize {
        self.now.ncols()
    }

    fn state_len(&self) -> usize {
        3 * self.dof()
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
        let n = self.dof();
        let (moved, acceleration) = change.split_at_mut(2 * n);
        {
            let mut moved = DVectorViewMut::from_slice(moved, 2 * n);
            moved.gemv(1.0, &self.change, &DVectorView::from_slice(state, 2 * n), 0.0);
            moved.gemv(1.0, &self.now, &DVectorView::from_slice(loads.now, n), 1.0);
            if self.linear {
                moved.gemv(1.0, &self.next, &DVectorView::from_slice(loads.next, n), 1.0);
            }
        }
        self.new.iter_mut().zip(&state[..2 * n]).zip(moved).for_each(|((z, s), dz)| *z = s + *dz);
        let acceleration = &mut acceleration[..n];
        acceleration.copy_from_slice(&loads.next[..n]);
        let (x, v) = self.new.split_at(n);
        self.mass.solve(loads.time + self.dt, v, x, acceleration)?;
        acceleration.iter_mut().zip(&state[2 * n..]).for_each(|(new, old)| *new -= old);
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
