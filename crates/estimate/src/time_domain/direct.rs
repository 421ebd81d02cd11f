//! Least squares on the equation of motion at the samples, with measured accelerations.

use mechid_model::Response;
use mechid_signal::Record;

use crate::{EquationOfMotion, Estimate, EstimateError, Unknowns};

/// Fits M ẍ + C ẋ + K x = F at every sample of a response (force: samples × degrees of freedom, N).
///
/// There is no discretisation error: the equation holds at each instant for any time step. For
/// several records, or records too long for memory, push their rows to an [`EquationOfMotion`].
///
/// This fit cannot verify an integrator that enforces the equation of motion at its steps: even if
/// the motion is wrong, the fit returns the exact parameters.
///
/// # Errors
/// [`EstimateError::Signal`] if the time axis of the force differs from that of the response, and
/// the errors of [`EquationOfMotion::solve`].
///
/// # Source
/// Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), chapter 5 (least squares); equation of
/// motion (3.2.1) of the dissertation.
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
