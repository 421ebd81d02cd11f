//! The fastest motions of a system, which decide whether a step is stable.

use std::cell::OnceCell;

use mechid_model::{Matrix, SecondOrderSystem};
use nalgebra::{Complex, DMatrix, DVector};

use super::krylov::{dominant, scattered};
use super::passive;
use crate::effective::Equations;
use crate::{IntegrateError, System};

/// The fastest motions of a system, found when they are asked for.
pub(super) struct Fastest<'a> {
    pub(super) system: &'a dyn System,
    rate: OnceCell<f64>,
    /// The stiffest and the most damped motion of a passive system; `None` of others.
    passive: OnceCell<Option<[SecondOrderSystem; 2]>>,
}

impl<'a> Fastest<'a> {
    pub(super) fn of(system: &'a dyn System) -> Self {
        Self { system, rate: OnceCell::new(), passive: OnceCell::new() }
    }

    /// The largest modulus among the eigenvalues, in 1/s, as far as Arnoldi's iteration finds it.
    pub(super) fn rate(&self) -> Result<f64, IntegrateError> {
        if let Some(rate) = self.rate.get() {
            return Ok(*rate);
        }
        let rate = fastest(&Equations::of(self.system))?;
        Ok(*self.rate.get_or_init(|| rate))
    }

    /// A single degree of freedom for each of these motions, not slower than it.
    pub(super) fn motions(&self) -> Result<Option<&[SecondOrderSystem; 2]>, IntegrateError> {
        if let Some(found) = self.passive.get() {
            return Ok(found.as_ref());
        }
        let found = match passive::is_passive(self.system) {
            false => None,
            true => {
                let equations = Equations::of(self.system);
                let motion = |which| {
                    let top = passive::top(&equations, which)?;
                    reduced_to(&equations, &top, which, top.above(self.system, which))
                };
                Some([motion(Matrix::Stiffness)?, motion(Matrix::Damping)?])
            }
        };
        Ok(self.passive.get_or_init(|| found).as_ref())
    }
}

/// The system that moves along `shape` alone, of mass x*Mx, damping x*Cx and stiffness x*Kx; its
/// two degrees of freedom are the real and imaginary parts of one.
///
/// Where `shape` belongs to an eigenvector of the amplification, its eigenvalue is one for this
/// system, too.
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

/// The system along the fastest motion found of a passive system, its eigenvalue of M⁻¹A, A being one of the matrices,
/// raised to a `value`.
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

/// The largest modulus among the eigenvalues of a system, in 1/s, as far as Arnoldi's iteration finds
/// it.
pub(super) fn fastest(equations: &Equations) -> Result<f64, IntegrateError> {
    let n = equations.dof();
    let mut mass = equations.mass_only("Arnoldi", 0.0)?;
    // The unit of time that makes the two halves of the state comparable is found on the way.
    let mut unit = 1.0;
    for _ in 0..4 {
        let largest = dominant(scattered(2 * n), |state, rate| {
            let (x, v) = state.split_at(n);
            let (dx, dv) = rate.split_at_mut(n);
            dx.copy_from_slice(v);
            let v: Vec<f64> = v.iter().map(|v| v / unit).collect();
            dv.fill(0.0);
            // Of a linear system no solve fails.
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
