//! Linearisation by normal equations.

use nalgebra::{DMatrix, DVector};

use super::Linearisation;
use crate::cholesky::Cholesky;

/// Normal equations of a linearisation, with columns scaled to unit length.
///
/// Normal equations square the condition number of the Jacobian, so the coordinates should be
/// nearly orthogonal.
#[derive(Debug, Clone)]
pub struct GramMatrix {
    gram: DMatrix<f64>,
    gradient: DVector<f64>,
    /// Lengths of the columns of the Jacobian.
    scale: DVector<f64>,
}

impl GramMatrix {
    /// Creates the linearisation from JᵀJ (parameters × parameters) and Jᵀr.
    pub fn new(gram: &DMatrix<f64>, gradient: &DVector<f64>) -> Self {
        let length = |square: f64| if square > 0.0 { square.sqrt() } else { 1.0 };
        let scale = gram.diagonal().map(length);
        let scaled = |i: usize, j: usize| gram[(i, j)] / (scale[i] * scale[j]);
        let gram = DMatrix::from_fn(gram.nrows(), gram.ncols(), scaled);
        Self { gram, gradient: gradient.component_div(&scale), scale }
    }
}

impl Linearisation for GramMatrix {
    type Factor = Cholesky;

    fn gradient(&self) -> &DVector<f64> {
        &self.gradient
    }

    fn factor(&self, damping: f64) -> Option<Cholesky> {
        Cholesky::new(&self.gram, damping)
    }

    fn solve(&self, factor: &Cholesky, right: &DVector<f64>) -> DVector<f64> {
        factor.solve(right)
    }

    fn decrease(&self, v: &DVector<f64>) -> f64 {
        -(2.0 * self.gradient.dot(v) + v.dot(&(&self.gram * v)))
    }

    fn coordinates(&self, parameters: &DVector<f64>) -> DVector<f64> {
        parameters.component_mul(&self.scale)
    }

    fn parameters(&self, coordinates: &DVector<f64>) -> DVector<f64> {
        coordinates.component_div(&self.scale)
    }
}
