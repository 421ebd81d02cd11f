//! Interface between the likelihood and a model.

use nalgebra::{Complex, DMatrix, DVector};

/// Numbers of channels and unknowns of a [`ResponseModel`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Dimensions {
    /// Number of outputs, p.
    pub outputs: usize,
    /// Number of inputs, q.
    pub inputs: usize,
    /// Number of parameters.
    pub parameters: usize,
    /// Number of state loads, which describe the difference between the initial and the final state
    /// of an open record; 0 if the model does not have them.
    pub states: usize,
}

/// A parametric linear model of outputs y = G(ω) u at given lines.
///
/// The model depends on a record only through the frequencies of its lines, and the likelihood uses
/// only the responses of the model.
pub trait ResponseModel: Sync {
    /// Response at one line and one set of parameters.
    type Line<'a>: LineResponse + Send
    where
        Self: 'a;

    /// Returns the numbers of channels and unknowns.
    fn dimensions(&self) -> Dimensions;

    /// Returns the angular frequency (rad/s) of each line of the model.
    fn omega(&self) -> &[f64];

    /// Returns the response at a line; the parameters are in their units. `None` if the response
    /// does not exist.
    fn at(&self, parameters: &[f64], row: usize) -> Option<Self::Line<'_>>;

    /// Returns the covariance of the outputs due to the uncertainty of the model itself; `None` for
    /// an exact model. `line` is the response at the line, and `input` (q entries, in the units of
    /// the inputs) acts on the model. The covariance is p × p, each entry in the product of the
    /// units of its two outputs.
    fn covariance<'l>(
        &'l self,
        _row: usize,
        _line: &Self::Line<'l>,
        _input: &DVector<Complex<f64>>,
    ) -> Option<DMatrix<Complex<f64>>> {
        None
    }
}

/// Response of a model at one line, with its derivatives.
pub trait LineResponse {
    /// Returns G, p × q, in units of the outputs per unit of the inputs.
    fn receptance(&self) -> &DMatrix<Complex<f64>>;

    /// Returns the response (p entries, in the units of the outputs) to loads of the model itself,
    /// such as an unknown unbalance.
    fn own_response(&self) -> Option<&DVector<Complex<f64>>>;

    /// Returns the response to a unit of each state load, p × states.
    fn state_response(&self) -> Option<&DMatrix<Complex<f64>>>;

    /// Writes the derivative of the response with respect to each parameter: p × parameters, in
    /// units of the outputs per unit of the parameters. The response is that to `input` (q
    /// entries), to the loads of the model itself and to `states` (amplitudes of the state loads;
    /// may be empty).
    fn sensitivity(
        &self,
        parameters: &[f64],
        input: &DVector<Complex<f64>>,
        states: &DVector<Complex<f64>>,
        to: &mut DMatrix<Complex<f64>>,
    );
}
