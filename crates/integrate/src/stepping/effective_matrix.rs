//! The linear solve of every implicit scheme: M̂ a = F − C v̂ − K x̂.

use std::sync::Arc;

use mechid_model::{Matrix, SecondOrderSystem};
use nalgebra::{DMatrix, DVector, DVectorView, DVectorViewMut, Dyn, LU};
use nalgebra_sparse::csr::CsrMatrix;

use crate::error::IntegrateError;
use crate::nonlinear::local_newton::{LocalForces, LocalNewton};
use crate::sparse::{NotFactored, Product, SparseLu, combination};
use crate::system::System;

/// The equations of motion of a system, in the form that a step uses.
#[derive(Debug, Clone)]
pub(crate) struct Equations {
    linear: Linear,
    forces: Option<LocalForces>,
}

#[derive(Debug, Clone)]
enum Linear {
    Dense(Arc<SecondOrderSystem>),
    Sparse(Arc<SparseEquations>),
}

#[derive(Debug)]
struct SparseEquations {
    mass: CsrMatrix<f64>,
    damping: CsrMatrix<f64>,
    stiffness: CsrMatrix<f64>,
    /// C and K for products with vectors.
    products: [Product; 2],
    /// Memory that factors may take, in bytes.
    factor_limit: u64,
}

impl Equations {
    pub(crate) fn from_system(system: &dyn System) -> Self {
        let forces = LocalForces::from_forces(system.nonlinear_forces());
        let matrices = system.matrices();
        if let Some(dense) = matrices.dense() {
            return Self { linear: Linear::Dense(Arc::new(dense.clone())), forces };
        }
        let [mass, damping, stiffness] = [Matrix::Mass, Matrix::Damping, Matrix::Stiffness]
            .map(|which| matrices.sparse(which).into_owned());
        let products = [&damping, &stiffness].map(Product::from_matrix);
        let factor_limit = system.factor_limit();
        let equations = SparseEquations { mass, damping, stiffness, products, factor_limit };
        Self { linear: Linear::Sparse(Arc::new(equations)), forces }
    }

    pub(crate) fn dof(&self) -> usize {
        match &self.linear {
            Linear::Dense(system) => system.dof(),
            Linear::Sparse(system) => system.mass.nrows(),
        }
    }

    /// Factors M + `gamma_hat` C + `beta_hat` K for a step of `dt` seconds.
    pub(crate) fn effective(
        &self,
        scheme: &'static str,
        dt: f64,
        gamma_hat: f64,
        beta_hat: f64,
    ) -> Result<EffectiveMatrix, IntegrateError> {
        let factored = match &self.linear {
            Linear::Dense(system) => {
                factor_dense(system, gamma_hat, beta_hat).map_err(NotFactored::Singular)
            }
            Linear::Sparse(system) => {
                let terms = [
                    (1.0, &system.mass),
                    (gamma_hat, &system.damping),
                    (beta_hat, &system.stiffness),
                ];
                let (matrix, sizes) = combination(&terms);
                SparseLu::new(&matrix, &sizes, system.factor_limit).map(Factored::Sparse)
            }
        };
        let mut factored = factored.map_err(|error| {
            error.or_singular(self.dof(), |smallest| match (gamma_hat, beta_hat) {
                (0.0, 0.0) => IntegrateError::SingularMass { scheme, smallest },
                _ => IntegrateError::SingularEffectiveMass { scheme, dt, smallest },
            })
        })?;
        let newton = self.forces.as_ref().map(|forces| {
            let mut influence = DMatrix::zeros(self.dof(), forces.dofs().len());
            for (mut column, &at) in influence.column_iter_mut().zip(forces.dofs()) {
                column[at] = 1.0;
                factored.solve(column.as_mut_slice());
            }
            LocalNewton::new(forces.clone(), gamma_hat, beta_hat, influence)
        });
        Ok(EffectiveMatrix { linear: self.linear.clone(), factored, newton })
    }

    /// Factors M only, to solve the equation of motion for the acceleration.
    pub(crate) fn mass_only(
        &self,
        scheme: &'static str,
        dt: f64,
    ) -> Result<EffectiveMatrix, IntegrateError> {
        self.effective(scheme, dt, 0.0, 0.0)
    }

    /// Returns one of M, C, K times `x`.
    pub(crate) fn times(&self, which: Matrix, x: &DVector<f64>) -> DVector<f64> {
        match (&self.linear, which) {
            (Linear::Dense(system), _) => system.matrix(which) * x,
            (Linear::Sparse(system), Matrix::Mass) => &system.mass * x,
            (Linear::Sparse(system), Matrix::Damping) => &system.damping * x,
            (Linear::Sparse(system), Matrix::Stiffness) => &system.stiffness * x,
        }
    }
}

impl Linear {
    /// Computes `load` ← `load` − C v̂ − K x̂.
    fn subtract_forces(&self, v_hat: &[f64], x_hat: &[f64], load: &mut [f64]) {
        match self {
            Self::Dense(system) => {
                let n = load.len();
                let mut rhs = DVectorViewMut::from_slice(load, n);
                rhs.gemv(-1.0, system.damping(), &DVectorView::from_slice(v_hat, n), 1.0);
                rhs.gemv(-1.0, system.stiffness(), &DVectorView::from_slice(x_hat, n), 1.0);
            }
            Self::Sparse(system) => {
                let [damping, stiffness] = &system.products;
                Product::subtract(&[(damping, v_hat), (stiffness, x_hat)], load);
            }
        }
    }
}

/// Matrix M̂ = M + γ̂ C + β̂ K, factored once, with C and K for the right-hand side.
///
/// Every implicit scheme writes displacement and velocity at its collocation instant as x̂ + β̂ a
/// and v̂ + γ̂ a: a known part plus the unknown acceleration. The scheme requires equilibrium at
/// this instant, including the nonlinear forces of the system.
#[derive(Debug)]
pub(crate) struct EffectiveMatrix {
    linear: Linear,
    factored: Factored,
    newton: Option<LocalNewton>,
}

#[derive(Debug)]
enum Factored {
    Dense(LU<f64, Dyn, Dyn>),
    Sparse(SparseLu),
}

impl Factored {
    fn solve(&mut self, b: &mut [f64]) {
        match self {
            // The solution exists, because the pivots were checked when M̂ was factored.
            Self::Dense(factored) => {
                let n = b.len();
                factored.solve_mut(&mut DVectorViewMut::from_slice(b, n));
            }
            Self::Sparse(factored) => factored.solve(b),
        }
    }
}

impl EffectiveMatrix {
    /// Solves a = M̂⁻¹ (`load` − C v̂ − K x̂), in place of `load`. With nonlinear forces it solves
    /// M̂ a + g(x̂ + β̂ a, v̂ + γ̂ a, `time`) = `load` − C v̂ − K x̂ by Newton's method, which can
    /// fail.
    pub(crate) fn solve(
        &mut self,
        time: f64,
        v_hat: &[f64],
        x_hat: &[f64],
        load: &mut [f64],
    ) -> Result<(), IntegrateError> {
        self.linear.subtract_forces(v_hat, x_hat, load);
        self.factored.solve(load);
        match &mut self.newton {
            None => Ok(()),
            Some(newton) => newton.correct(time, v_hat, x_hat, load),
        }
    }
}

/// Returns the factors of M + `gamma_hat` C + `beta_hat` K, or, as an error, the smallest pivot if
/// this pivot is zero to rounding.
fn factor_dense(
    system: &SecondOrderSystem,
    gamma_hat: f64,
    beta_hat: f64,
) -> Result<Factored, f64> {
    let terms =
        [(1.0, system.mass()), (gamma_hat, system.damping()), (beta_hat, system.stiffness())];
    let n = system.dof();
    let matrix = DMatrix::from_fn(n, n, |i, j| terms.iter().map(|(s, t)| s * t[(i, j)]).sum());
    // Rows are divided by the size of their terms. A pivot of about ε is then a zero with rounding
    // error, even if masses and stiffnesses differ by orders of magnitude.
    let sizes = DVector::from_fn(n, |i, _| {
        terms.iter().map(|(s, t)| s * t.row(i).abs().sum()).sum::<f64>()
    });
    let scaled = DMatrix::from_fn(n, n, |i, j| matrix[(i, j)] / sizes[i]);
    let smallest = scaled.lu().u().diagonal().abs().min();
    // NaN (from overflow) fails the test too.
    if !(smallest > f64::EPSILON && sizes.iter().all(|s| s.is_finite())) {
        return Err(smallest);
    }
    Ok(Factored::Dense(matrix.lu()))
}
