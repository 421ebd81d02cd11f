//! Fits frequency responses.

use mechid::estimate::Unknowns;
use mechid::estimate::checks::before_response_fit;
use mechid::estimate::frequency_domain::{FrequencyData, equation_error, output_error};
use mechid::estimate::time_domain::{Discretisation, Extent};
use mechid::signal::Record;

use super::course::Course;
use super::fit::{Fitted, Method, Misfit, one_motion_of, steady_residuals};
use super::measurement::Measurement;
use crate::commands::frf::responses::{Estimator, Responses, SegmentArgs};
use crate::error::CliError;

/// Fits the frequency responses of one or several records, weighted by their coherence unless least
/// squares is asked for.
///
/// # Errors
/// [`CliError::InstrumentalResponses`] for instrumental variables.
pub fn fit(
    records: &[Measurement],
    unknowns: &Unknowns,
    choose: impl Fn(&Record) -> Result<Vec<usize>, CliError>,
    (estimator, segments): (Estimator, &SegmentArgs),
    method: Option<Method>,
) -> Result<Fitted, CliError> {
    let estimate = |measured| Responses::of(measured, segments, estimator, &choose);
    let responses: Vec<Responses> = records.iter().map(estimate).collect::<Result<_, _>>()?;
    let mut data: Option<FrequencyData> = None;
    for r in &responses {
        let own = r.frf.data(&r.driven)?;
        data = Some(match data {
            None => own,
            Some(before) => before.and(&own)?,
        });
    }
    let Some(data) = data else { return Err(CliError::NoMotion) };
    let mut misfit = None;
    let (name, found) = match method {
        Some(Method::Instrumental) => return Err(CliError::InstrumentalResponses),
        Some(Method::LeastSquares) => (
            "least squares on frequency responses, all lines alike",
            equation_error(&data, unknowns)?,
        ),
        Some(Method::MaximumLikelihood) | None => {
            let fit = output_error(&data, unknowns)?;
            misfit = Some(Misfit { ratio: fit.misfit_ratio, noise: "the coherence" });
            ("maximum likelihood on frequency responses, weighted by their coherence", fit.estimate)
        }
    };
    let look = |r: &Responses| Ok(before_response_fit(&r.frf, &r.driven, unknowns)?);
    let before = responses.iter().map(look).collect::<Result<_, CliError>>()?;
    let periodic = segments.are_periods();
    Ok(Fitted {
        domain: "frequency",
        estimator: name,
        equations: 2 * data.len(),
        frequency: responses.into_iter().next().map(|r| (r.lines, data)),
        before,
        residuals: if periodic { steady_residuals(records, &found)? } else { Vec::new() },
        course: match periodic {
            true => Course::Steady,
            false => Course::Sampled {
                discretisation: Discretisation::FirstOrderHold,
                extent: Extent::Open,
            },
        },
        misfit,
        remarks: one_motion_of(&records[0]),
        estimate: found,
    })
}
