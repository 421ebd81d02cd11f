//! Lines of a fit: measured response, fitted response and residual.

use std::f64::consts::TAU;

use mechid_estimate::Estimate;
use mechid_model::Matrix;
use mechid_spectra::FrequencyData;
use nalgebra::{Complex, DMatrix, DVector};
use serde::Serialize;

use crate::AnalysisError;

/// One line of one record; for frequency responses, one line for one of the forces.
///
/// Complex numbers are pairs of real and imaginary part. Responses are in the SI unit of the
/// measured quantity. The force is the measured force or, for frequency responses, 1 N.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FittedLine {
    /// Frequency, in Hz.
    pub frequency_hz: f64,
    /// Force on each degree of freedom, in N.
    pub force: Vec<[f64; 2]>,
    /// Measured response of each degree of freedom as it was fitted, in the SI unit of its
    /// quantity; for segments, the bias of the window is subtracted.
    pub measured: Vec<[f64; 2]>,
    /// Standard error of each measured response, √(E|ΔX|²/2), equal for real and imaginary part, in
    /// the unit of the response; `None` if the noise is unknown.
    pub measured_standard_error: Option<Vec<f64>>,
    /// Response of each degree of freedom of the identified system to the force, in the unit of the
    /// measured response.
    pub fitted: Vec<[f64; 2]>,
    /// Standard error of each fitted response, propagated from the parameters, in the unit of the
    /// response.
    pub fitted_standard_error: Vec<f64>,
    /// Measured minus fitted response of each degree of freedom, in the unit of the response.
    pub residual: Vec<[f64; 2]>,
}

impl FittedLine {
    /// Computes every line of a fit; standard errors are propagated from the parameters to first
    /// order.
    ///
    /// # Errors
    /// [`AnalysisError::Estimate`] if the data do not determine a parameter,
    /// [`AnalysisError::Model`] if the
    /// system has no response at a line.
    pub(super) fn all(
        data: &FrequencyData,
        estimate: &Estimate,
    ) -> Result<Vec<Self>, AnalysisError> {
        let system = estimate.system()?;
        let covariance = estimate.covariance();
        let parameters: Vec<_> = estimate.parameters().map(|p| p.parameter).collect();
        let pairs = |values: &DVector<Complex<f64>>| values.iter().map(|z| [z.re, z.im]).collect();
        let line = |(row, omega): (usize, &f64)| -> Result<Self, AnalysisError> {
            let quantity = data.measured().per_displacement(*omega);
            let receptance = system.receptance(*omega)?;
            let force = data.force().row(row).transpose();
            let displacement = &receptance * &force;
            let fitted = &displacement * quantity;
            let measured = data.displacement().row(row).transpose() * quantity;
            // First-order change: dX = −H dD X for a change dD of the dynamic stiffness.
            let slopes = DMatrix::from_fn(data.dof(), parameters.len(), |response, at| {
                let parameter = &parameters[at];
                let change = match parameter.matrix() {
                    Matrix::Mass => Complex::from(-omega * omega),
                    Matrix::Damping => Complex::new(0.0, *omega),
                    Matrix::Stiffness => Complex::from(1.0),
                };
                let by = receptance[(response, parameter.row())];
                -quantity * by * change * displacement[parameter.column()]
            });
            let error = |response: usize| {
                let slope = slopes.row(response);
                let parts = [slope.map(|z| z.re), slope.map(|z| z.im)];
                let variances = parts.map(|part| (&part * &covariance * part.transpose())[(0, 0)]);
                (0.5 * (variances[0] + variances[1])).max(0.0).sqrt()
            };
            let noise = data.noise().map(|noise| {
                let covariance = noise.covariance(row);
                let variance = |k: usize| covariance[(k, k)].re * quantity.norm_sqr();
                (0..data.dof()).map(|k| (0.5 * variance(k)).sqrt()).collect()
            });
            Ok(Self {
                frequency_hz: omega / TAU,
                force: pairs(&force),
                measured: pairs(&measured),
                measured_standard_error: noise,
                fitted: pairs(&fitted),
                fitted_standard_error: (0..data.dof()).map(error).collect(),
                residual: pairs(&(&measured - &fitted)),
            })
        };
        data.omega().iter().enumerate().map(line).collect()
    }
}
