//! Sums of squares of problems that return residuals and their Jacobian.

use nalgebra::{DMatrix, DVector};

use super::{Minimum, SumOfSquares, Triangle, minimise};

/// Residuals with their derivatives with respect to the parameters.
pub trait Residuals {
    /// Returns the number of residuals.
    fn len(&self) -> usize;

    /// Returns whether there is no residual.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Writes the residuals at `parameters`; returns `false` if they do not exist there. Residuals
    /// are a list in any unit.
    fn residual(&mut self, parameters: &DVector<f64>, residual: &mut DVector<f64>) -> bool;

    /// Writes the Jacobian of the residuals, residuals × parameters, at the most recent parameters.
    /// Entries are in the unit of the residual divided by the unit of the parameter.
    fn jacobian(&self, jacobian: &mut DMatrix<f64>);
}

/// Searches for the local minimum of the sum of squared residuals from `parameters` in at most
/// `max_steps` steps, each with a linearisation by QR decomposition; `None` if the residuals do not
/// exist at the start. Parameters are in any units, one for each column of the Jacobian.
///
/// # Source
/// As [`minimise`].
pub fn minimise_residuals(
    residuals: &mut impl Residuals,
    parameters: DVector<f64>,
    max_steps: usize,
) -> Option<Minimum> {
    let rows = residuals.len();
    let mut buffered = Buffered {
        residuals,
        accepted: DVector::zeros(rows),
        tried: DVector::zeros(rows),
        jacobian: DMatrix::zeros(rows, parameters.len()),
    };
    minimise(&mut buffered, parameters, max_steps)
}

/// Residuals at the most recently accepted and at the most recently tried parameters.
struct Buffered<'a, R> {
    residuals: &'a mut R,
    accepted: DVector<f64>,
    tried: DVector<f64>,
    jacobian: DMatrix<f64>,
}

impl<R: Residuals> SumOfSquares for Buffered<'_, R> {
    type Linearisation = Triangle;

    fn try_at(&mut self, parameters: &DVector<f64>) -> Option<f64> {
        let exists = self.residuals.residual(parameters, &mut self.tried);
        Some(self.tried.norm_squared()).filter(|cost| exists && cost.is_finite())
    }

    fn accept(&mut self) {
        std::mem::swap(&mut self.accepted, &mut self.tried);
    }

    /// Linearises the residuals at the accepted parameters. A linearisation always follows an
    /// accepted trial, so the residuals were last evaluated at these parameters.
    fn linearise(&mut self) -> Option<Triangle> {
        self.residuals.jacobian(&mut self.jacobian);
        Some(Triangle::new(&self.jacobian, &self.accepted))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rosenbrock's valley, 10(y − x²) and 1 − x.
    struct Valley {
        x: f64,
    }

    impl Residuals for Valley {
        fn len(&self) -> usize {
            2
        }

        fn residual(&mut self, parameters: &DVector<f64>, residual: &mut DVector<f64>) -> bool {
            self.x = parameters[0];
            residual[0] = 10.0 * (parameters[1] - parameters[0] * parameters[0]);
            residual[1] = 1.0 - parameters[0];
            true
        }

        fn jacobian(&self, jacobian: &mut DMatrix<f64>) {
            jacobian.copy_from_slice(&[-20.0 * self.x, -1.0, 10.0, 0.0]);
        }
    }

    #[test]
    fn the_valley_is_followed_to_its_end() {
        let start = DVector::from_vec(vec![-1.2, 1.0]);
        let minimum = minimise_residuals(&mut Valley { x: 0.0 }, start, 40).unwrap();
        assert!(minimum.converged);
        assert!((minimum.parameters - DVector::from_vec(vec![1.0, 1.0])).norm() < 1e-10);
    }
}
