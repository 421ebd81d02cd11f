//! Sums of squares for a search with restarts.

use mechid_numerics::cholesky::Cholesky;
use mechid_numerics::gauss_newton::{Linearisation, SumOfSquares};
use nalgebra::DVector;

use super::normal_equations::NormalEquations;

/// Sum of squares of a maximum-likelihood fit, for a search that also makes linear steps and can
/// give the lines random weights.
pub(super) trait Restartable: SumOfSquares<Linearisation = NormalEquations> {
    /// Returns the step to the least-squares solution of the equation of motion with the weights of
    /// the last accepted parameters.
    fn linear_step(&mut self) -> Option<DVector<f64>>;

    /// Gives every spectral line a random weight of mean 1 and standard deviation √5, or the weight
    /// 1 without a seed. Parameters that were accepted before this call must be tried again.
    fn resample(&mut self, seed: Option<u64>);
}

impl Linearisation for NormalEquations {
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
        self.coordinates.transform(parameters)
    }

    fn parameters(&self, coordinates: &DVector<f64>) -> DVector<f64> {
        self.coordinates.unknowns(coordinates)
    }
}
