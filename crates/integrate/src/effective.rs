//! The one linear solve behind every implicit scheme: M̂ a = F − C v̂ − K x̂.

use mechid_model::SecondOrderSystem;
use nalgebra::{DMatrix, DVector, DVectorView, DVectorViewMut, Dyn, LU};

use crate::IntegrateError;

/// M̂ = M + γ̂ C + β̂ K, factored once, with C and K for the right-hand side.
///
/// Every implicit scheme writes displacement and velocity at its collocation instant as
/// x̂ + β̂ a and v̂ + γ̂ a, known part plus unknown acceleration, and asks for equilibrium there.
#[derive(Debug)]
pub(crate) struct Effective {
    factored: LU<f64, Dyn, Dyn>,
    damping: DMatrix<f64>,
    stiffness: DMatrix<f64>,
}

impl Effective {
    /// Factors M + `gamma_hat` C + `beta_hat` K.
    pub(crate) fn new(
        scheme: &'static str,
        system: &SecondOrderSystem,
        dt: f64,
        gamma_hat: f64,
        beta_hat: f64,
    ) -> Result<Self, IntegrateError> {
        let terms =
            [(1.0, system.mass()), (gamma_hat, system.damping()), (beta_hat, system.stiffness())];
        let n = system.dof();
        let matrix = DMatrix::from_fn(n, n, |i, j| terms.iter().map(|(s, t)| s * t[(i, j)]).sum());
        // Rows divided by the size of the terms they are sums of: a pivot of ε is rounding of a
        // zero, however far apart the masses and stiffnesses lie.
        let sizes = DVector::from_fn(n, |i, _| {
            terms.iter().map(|(s, t)| s * t.row(i).abs().sum()).sum::<f64>()
        });
        let scaled = DMatrix::from_fn(n, n, |i, j| matrix[(i, j)] / sizes[i]);
        let smallest = scaled.lu().u().diagonal().abs().min();
        // NaN (from overflow) fails the test too.
        if !(smallest > f64::EPSILON && sizes.iter().all(|s| s.is_finite())) {
            return Err(IntegrateError::SingularEffectiveMass { scheme, dt, smallest });
        }
        let factored = matrix.lu();
        Ok(Self {
            factored,
            damping: system.damping().clone(),
            stiffness: system.stiffness().clone(),
        })
    }

    /// M alone: the equation of motion solved for the acceleration.
    pub(crate) fn mass_only(
        scheme: &'static str,
        system: &SecondOrderSystem,
        dt: f64,
    ) -> Result<Self, IntegrateError> {
        Self::new(scheme, system, dt, 0.0, 0.0)
    }

    /// a = M̂⁻¹ (`load` − C v̂ − K x̂), in place of `load`.
    pub(crate) fn solve(&self, v_hat: &[f64], x_hat: &[f64], load: &mut [f64]) {
        let n = load.len();
        let mut rhs = DVectorViewMut::from_slice(load, n);
        rhs.gemv(-1.0, &self.damping, &DVectorView::from_slice(v_hat, n), 1.0);
        rhs.gemv(-1.0, &self.stiffness, &DVectorView::from_slice(x_hat, n), 1.0);
        // Cannot fail: the pivots were checked when M̂ was factored.
        self.factored.solve_mut(&mut rhs);
    }
}
