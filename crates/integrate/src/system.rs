//! Systems that a scheme can simulate, with dense or sparse matrices.

use std::borrow::Cow;
use std::sync::Arc;

use mechid_model::{Matrix, SecondOrderSystem, SparseSystem};
use nalgebra_sparse::csr::CsrMatrix;

use crate::limits;
use crate::nonlinear::force::NonlinearForce;

/// A system M ẍ + C ẋ + K x = F that schemes can be prepared for; with nonlinear forces
/// M ẍ + C ẋ + K x + Σ g(x, ẋ, t) = F.
pub trait System: Sync {
    /// The matrices M (kg), C (N·s/m) and K (N/m), each n×n, as they are stored.
    fn matrices(&self) -> Matrices<'_>;

    /// The nonlinear forces g, none by default.
    fn nonlinear_forces(&self) -> &[Arc<dyn NonlinearForce>] {
        &[]
    }

    /// Maximum memory for the factors of the matrices of the system, in bytes.
    fn factor_limit(&self) -> u64 {
        match self.matrices() {
            Matrices::Dense(_) => SparseSystem::FACTOR_LIMIT,
            Matrices::Sparse(system) => system.factor_limit(),
        }
    }

    /// Number of degrees of freedom n.
    fn dof(&self) -> usize {
        match self.matrices() {
            Matrices::Dense(system) => system.dof(),
            Matrices::Sparse(system) => system.dof(),
        }
    }
}

/// The matrices M (kg), C (N·s/m) and K (N/m), each n×n, dense or sparse.
#[derive(Debug, Clone, Copy)]
pub enum Matrices<'a> {
    /// All entries.
    Dense(&'a SecondOrderSystem),
    /// The non-zero entries.
    Sparse(&'a SparseSystem),
}

impl System for SecondOrderSystem {
    fn matrices(&self) -> Matrices<'_> {
        Matrices::Dense(self)
    }
}

impl System for SparseSystem {
    fn matrices(&self) -> Matrices<'_> {
        Matrices::Sparse(self)
    }
}

/// The linear part of any system.
impl System for Matrices<'_> {
    fn matrices(&self) -> Matrices<'_> {
        *self
    }
}

impl<'a> Matrices<'a> {
    /// Returns one of the three matrices in sparse form.
    pub(crate) fn sparse(self, which: Matrix) -> Cow<'a, CsrMatrix<f64>> {
        match self {
            Matrices::Dense(system) => Cow::Owned(CsrMatrix::from(system.matrix(which))),
            Matrices::Sparse(system) => Cow::Borrowed(system.matrix(which)),
        }
    }

    /// Returns the system if its steps are faster with dense matrices.
    pub(crate) fn dense(self) -> Option<&'a SecondOrderSystem> {
        let Matrices::Dense(system) = self else { return None };
        let n = system.dof();
        if n <= limits::DENSE_DOF {
            return Some(system);
        }
        let most = (limits::SPARSE_FRACTION * (n * n) as f64) as usize;
        let full = [Matrix::Mass, Matrix::Damping, Matrix::Stiffness]
            .iter()
            .any(|which| system.matrix(*which).iter().filter(|v| **v != 0.0).count() > most);
        full.then_some(system)
    }
}
