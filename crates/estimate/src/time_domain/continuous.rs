//! Continuous-time system from the transition between samples, with its covariance.

use mechid_model::Discretisation;
use mechid_numerics::logarithm::Generator;
use nalgebra::DMatrix;

use crate::EstimateError;

/// Continuous-time \[A B\] from \[Φ − I, Γ\], and its derivative.
///
/// The logarithm is computed for the state (x, Δt ẋ): with this scale the entries of both block
/// rows of Φ have similar sizes.
pub(super) struct Continuous {
    dt: f64,
    dof: usize,
    /// Matrix logarithm and its derivative; `None` for Euler's rule, where AΔt = Φ − I.
    generator: Option<Generator>,
    /// \[A B\]: 2n × (2n + forces).
    pub(super) value: DMatrix<f64>,
}

impl Continuous {
    /// Computes \[A B\] from `change` = \[Φ − I, Γ\]: 2n × (2n + forces).
    pub(super) fn new(
        change: &DMatrix<f64>,
        dt: f64,
        discretisation: Discretisation,
    ) -> Result<Self, EstimateError> {
        let states = change.nrows();
        let mut this = Self { dt, dof: states / 2, generator: None, value: DMatrix::zeros(0, 0) };
        let scaled = this.scaled(change, 1.0);
        let logarithm = match discretisation {
            Discretisation::Euler => scaled,
            Discretisation::ZeroOrderHold | Discretisation::FirstOrderHold => {
                let logarithm = scaled.columns(0, states).into_owned();
                let input = scaled.columns(states, scaled.ncols() - states).into_owned();
                let generator = Generator::new(&logarithm, &input)?;
                let value = generator.value.clone();
                this.generator = Some(generator);
                value
            }
        };
        this.value = this.scaled(&logarithm, -1.0) / dt;
        Ok(this)
    }

    /// Returns the first-order change of \[A B\] for a change of \[Φ − I, Γ\].
    pub(super) fn derivative(&self, change: &DMatrix<f64>) -> Result<DMatrix<f64>, EstimateError> {
        let Some(generator) = &self.generator else { return Ok(change / self.dt) };
        let moved = generator.derivative(&self.scaled(change, 1.0))?;
        Ok(self.scaled(&moved, -1.0) / self.dt)
    }

    /// Transforms a matrix to the state (x, Δt ẋ), or with `power` −1 back to (x, ẋ).
    fn scaled(&self, matrix: &DMatrix<f64>, power: f64) -> DMatrix<f64> {
        let (n, factor) = (self.dof, self.dt.powf(power));
        let mut scaled = matrix.clone();
        scaled.rows_mut(n, n).scale_mut(factor);
        scaled.columns_mut(n, n).unscale_mut(factor);
        scaled
    }
}
