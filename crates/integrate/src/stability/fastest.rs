//! The fastest motions of a system, which decide whether a step is stable.

use std::cell::OnceCell;

use mechid_model::{Matrix, SecondOrderSystem};
use mechid_numerics::krylov::arnoldi::dominant;
use mechid_numerics::krylov::start_vector::start_vector;
use nalgebra::{Complex, DMatrix, DVector};

use crate::error::IntegrateError;
use crate::limits;
use crate::stability::passive;
use crate::stepping::effective_matrix::Equations;
use crate::system::System;

/// The fastest motions of a system, computed when they are first needed.
pub(super) struct Fastest<'a> {
    pub(super) system: &'a dyn System,
    rate: OnceCell<f64>,
    /// The stiffest and the most damped motion of a passive system; `None` for other systems.
    passive: OnceCell<Option<[SecondOrderSystem; 2]>>,
}

impl<'a> Fastest<'a> {
    pub(super) fn new(system: &'a dyn System) -> Self {
        Self { system, rate: OnceCell::new(), passive: OnceCell::new() }
    }

    /// Returns the largest modulus among the eigenvalues, in 1/s, estimated by Arnoldi's iteration.
    pub(super) fn rate(&self) -> Result<f64, IntegrateError> {
        if let Some(rate) = self.rate.get() {
            return Ok(*rate);
        }
        let rate = fastest(&Equations::from_system(self.system))?;
        Ok(*self.rate.get_or_init(|| rate))
    }

    /// Returns two systems: the first moves only along the stiffest motion, the second only along
    /// the most damped motion. Each returned system is at least as fast as the motion along which
    /// it moves. `None` if the system is not passive.
    pub(super) fn motions(&self) -> Result<Option<&[SecondOrderSystem; 2]>, IntegrateError> {
        if let Some(motions) = self.passive.get() {
            return Ok(motions.as_ref());
        }
        let motions = if passive::is_passive(self.system) {
            let equations = Equations::from_system(self.system);
            let motion = |which| {
                let top = passive::top(&equations, which)?;
                reduced_to(&equations, &top, which, top.above(self.system, which))
            };
            Some([motion(Matrix::Stiffness)?, motion(Matrix::Damping)?])
        } else {
            None
        };
        Ok(self.passive.get_or_init(|| motions).as_ref())
    }
}

/// Returns the system that moves only along the vector x = `shape`, with mass x*Mx, damping x*Cx
/// and stiffness x*Kx; its two degrees of freedom are the real and imaginary parts of the complex
/// amplitude.
///
/// If `shape` belongs to an eigenvector of the amplification matrix, the eigenvalue of this
/// eigenvector is also an eigenvalue of the returned system.
pub(super) fn reduced(
    equations: &Equations,
    shape: &DVector<Complex<f64>>,
) -> Result<SecondOrderSystem, IntegrateError> {
    let (re, im) = (shape.map(|v| v.re), shape.map(|v| v.im));
    let form = |which| {
        let (a_re, a_im) = (equations.times(which, &re), equations.times(which, &im));
        let (real, imaginary) = (re.dot(&a_re) + im.dot(&a_im), re.dot(&a_im) - im.dot(&a_re));
        DMatrix::from_row_slice(2, 2, &[real, -imaginary, imaginary, real])
    };
    let [mass, damping, stiffness] = [Matrix::Mass, Matrix::Damping, Matrix::Stiffness].map(form);
    Ok(SecondOrderSystem::new(mass, damping, stiffness)?)
}

/// Returns the system that moves only along `top`, the stiffest or the most damped motion of a
/// passive system. The eigenvalue of M⁻¹A, where A is the matrix `which`, is increased to `value`.
pub(super) fn reduced_to(
    equations: &Equations,
    top: &passive::Top,
    which: Matrix,
    value: f64,
) -> Result<SecondOrderSystem, IntegrateError> {
    let along = reduced(equations, &top.vector.map(Complex::from))?;
    let raise = if top.value > 0.0 { (value / top.value).max(1.0) } else { 1.0 };
    let part = |matrix: Matrix| along.matrix(matrix) * if matrix == which { raise } else { 1.0 };
    let [mass, damping, stiffness] = [Matrix::Mass, Matrix::Damping, Matrix::Stiffness].map(part);
    Ok(SecondOrderSystem::new(mass, damping, stiffness)?)
}

/// Returns the largest modulus among the eigenvalues of a system, in 1/s, estimated by Arnoldi's
/// iteration.
pub(super) fn fastest(equations: &Equations) -> Result<f64, IntegrateError> {
    let n = equations.dof();
    let mut mass = equations.mass_only("Arnoldi", 0.0)?;
    // The iteration also finds the unit of time that makes displacements and velocities comparable.
    let mut unit = 1.0;
    for _ in 0..4 {
        let largest = dominant(start_vector(2 * n), limits::ARNOLDI_STEPS, |state, rate| {
            let (x, v) = state.split_at(n);
            let (dx, dv) = rate.split_at_mut(n);
            dx.copy_from_slice(v);
            let v: Vec<f64> = v.iter().map(|v| v / unit).collect();
            dv.fill(0.0);
            // A solve of a linear system does not fail.
            let _ = mass.solve(0.0, &v, x, dv);
            dv.iter_mut().for_each(|a| *a *= unit * unit);
        });
        let Some(largest) = largest else { break };
        let rate = largest.value.norm();
        if rate == 0.0 || (0.5..2.0).contains(&rate) {
            return Ok(rate / unit);
        }
        unit /= rate;
    }
    Ok(1.0 / unit)
}
