//! The equation of motion at the samples, when accelerations are measured.

use mechid_model::Response;
use mechid_signal::Record;

use crate::{EquationOfMotion, Estimate, EstimateError, Unknowns};

/// Fits M ẍ + C ẋ + K x = F at every sample of a response (force: samples × degrees of freedom, N).
///
/// There is no discretisation error: whatever the step, the equation holds at each instant. For
/// records too long for memory, or several of them, push their rows to an [`EquationOfMotion`].
///
/// On the output of an integrator that enforces this very equation at its steps this fit proves
/// nothing: it gives the parameters back however wrong the motion is.
///
/// # Errors
/// [`EstimateError::Signal`] if the force lies on another time axis, else as
/// [`EquationOfMotion::solve`].
///
/// # Source
/// Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), chapter 5 (least squares), of the
/// equation of motion (3.2.1) of the dissertation.
pub fn equation_of_motion(
    response: &Response,
    force: &Record,
    unknowns: &Unknowns,
) -> Result<Estimate, EstimateError> {
    response.displacement().check_same_sampling(force)?;
    let mut rows = EquationOfMotion::new(response.dof());
    rows.push_rows(
        response.acceleration().data().as_view(),
        response.velocity().data().as_view(),
        response.displacement().data().as_view(),
        force.data().as_view(),
    )?;
    rows.solve(unknowns)
}
