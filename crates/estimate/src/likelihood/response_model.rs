//! Requirements of the likelihood on a model.

use nalgebra::{Complex, DMatrix, DVector};

/// Numbers of channels and unknowns of a [`ResponseModel`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Dimensions {
    /// Outputs p.
    pub outputs: usize,
    /// Inputs q.
    pub inputs: usize,
    /// Parameters.
    pub parameters: usize,
    /// Loads by which a difference between the initial and the final state of an open record acts
    /// on the model; 0 if the model cannot tell.
    pub states: usize,
}

/// A parametric linear model of outputs y = G(ω) u at given lines.
///
/// A record reaches the model through its lines alone, and the model reaches a record through its
/// responses alone.
pub trait ResponseModel: Sync {
    /// Response at one line and one set of parameters.
    type Line<'a>: LineResponse
    where
        Self: 'a;

    /// Returns the numbers of channels and unknowns.
    fn dimensions(&self) -> Dimensions;

    /// Returns the angular frequency (rad/s) of each line that the model was prepared for.
    fn omega(&self) -> &[f64];

    /// Returns the response at a line with parameters in their own units, `None` where it does not
    /// exist.
    fn at(&self, parameters: &[f64], row: usize) -> Option<Self::Line<'_>>;

    /// Adds the uncertainty of the model itself to the covariance of the outputs (p × p, in the
    /// products of their units), at a line with the response `line` under `input` (q, in the units
    /// of the inputs); a model that is exact adds nothing.
    fn add_covariance(
        &self,
        _row: usize,
        _line: &Self::Line<'_>,
        _input: &DVector<Complex<f64>>,
        _covariance: &mut DMatrix<Complex<f64>>,
    ) {
    }
}

/// Response of a model at one line, and what its derivatives need.
pub trait LineResponse {
    /// Returns G, p × q, in units of the outputs per unit of the inputs.
    fn receptance(&self) -> &DMatrix<Complex<f64>>;

    /// Returns the response (p entries, in the units of the outputs) to loads of the model itself,
    /// such as an unknown unbalance.
    fn own_response(&self) -> Option<&DVector<Complex<f64>>>;

    /// Returns the response to a unit of each state load, p × states.
    fn state_response(&self) -> Option<&DMatrix<Complex<f64>>>;

    /// Writes the derivative of the response to `input` (q), to the model's own loads and to
    /// `states` (amplitudes of the state loads, which may be empty) with respect to each parameter,
    /// p × parameters, in units of the outputs per unit of the parameters.
    fn sensitivity(
        &self,
        parameters: &[f64],
        input: &DVector<Complex<f64>>,
        states: &DVector<Complex<f64>>,
        to: &mut DMatrix<Complex<f64>>,
    );
}
