//! Checks of a modal test: channels and tables before the fit, residual and modes after it.

mod delay;
mod driving_point;
mod force_peak;
mod idle;
mod one_point;
mod reciprocity;
mod spectrum;
mod table;
mod tested;

use mechid_checks::Verdict;
use mechid_modal::{DrivingPoint, IdentifiedMode, OutputDelay};

pub(super) use self::force_peak::force_peak_check;
pub(super) use self::idle::response_checks;
pub(super) use self::one_point::one_point_check;
pub(super) use self::spectrum::spectrum_check;
pub(super) use self::table::table_checks;
pub(super) use self::tested::{Tested, adjusted};
use super::sources::Output;
use super::summary::{ModalCheck, ModalModeRow};
use crate::AnalysisError;
use crate::identify::checks;
use crate::limits::LEAST_EXPLAINED;
use crate::measurement::Measurement;

/// Returns the checks of all channels: clipped, constant, spiked, quantised.
pub(super) fn channel_checks(
    measurements: &[Measurement],
) -> Result<Vec<ModalCheck>, AnalysisError> {
    let mut rows = Vec::new();
    for measurement in measurements {
        let block = measurement.whole_block()?;
        let record =
            if measurements.len() > 1 { format!("{}: ", block.file) } else { String::new() };
        rows.extend(checks::sensor_findings(&block).into_iter().map(|finding| ModalCheck {
            code: "channel",
            passed: finding.verdict() == Verdict::Good,
            value: finding.value(),
            text: format!("{record}{}", checks::sentence(&finding, &block.names)),
        }));
    }
    Ok(rows)
}

/// Returns, for each response, the check of the share of its variance that the modes explain. If
/// this check fails and no mode moves the response significantly, the failed check of the motion
/// replaces it.
pub(super) fn output_checks(
    explained: &[f64],
    modes: &[ModalModeRow],
    names: &[String],
) -> Vec<ModalCheck> {
    let idle = response_checks(modes, names);
    let shares = explained_checks(explained, names).into_iter().enumerate();
    let row = |(at, share): (usize, ModalCheck)| match idle.get(at) {
        // If residual terms explain the response of a sensor that no mode moves, the check of the
        // explained share passes, and only this check is returned.
        Some(idle) if !share.passed && !idle.passed => idle.clone(),
        _ => share,
    };
    shares.map(row).collect()
}

fn explained_checks(explained: &[f64], names: &[String]) -> Vec<ModalCheck> {
    let words = [
        "the modes explain",
        "in the band",
        ": the rest is noise, a nonlinearity, or forces that were not measured",
    ];
    share_checks("explained", explained, names, words)
}

/// Returns, for each response, the check of the share of its variance that the modes predict, in
/// data that were not fitted.
pub(super) fn prediction_checks(predicted: &[f64], names: &[String]) -> Vec<ModalCheck> {
    let words = [
        "the modes predict",
        "in the part of the records that was not fitted",
        ": the fitted data contain more than the response of the structure to these forces",
    ];
    share_checks("predicted", predicted, names, words)
}

fn share_checks(
    code: &'static str,
    shares: &[f64],
    names: &[String],
    [verb, place, why]: [&str; 3],
) -> Vec<ModalCheck> {
    let row = |(&value, name): (&f64, &String)| {
        let passed = value >= LEAST_EXPLAINED;
        let share = format!("{verb} {:.1} % of the variance of {name} {place}", 100.0 * value);
        let text = if passed { share } else { share + why };
        ModalCheck { code, passed, value, text }
    };
    shares.iter().zip(names).map(row).collect()
}

/// Returns the checks of the modes: unexcited inputs, modal masses and delays at driving points,
/// and reciprocity between driving points unless it is imposed. Outputs whose delay is part of the
/// model are not tested for a delay.
pub(super) fn mode_checks(
    modes: &[IdentifiedMode],
    inputs: &[String],
    outputs: &[Output],
    driving_points: &[DrivingPoint],
    delays: &[OutputDelay],
    is_reciprocal: bool,
) -> Vec<ModalCheck> {
    let mut rows = idle::force_checks(modes, inputs);
    let mut tests: Vec<Tested> = driving_point::tests(modes, inputs, outputs, driving_points);
    let has_delay = |output: usize| delays.get(output).is_some_and(|delay| delay.seconds != 0.0);
    let others: Vec<_> =
        driving_points.iter().copied().filter(|point| !has_delay(point.output)).collect();
    tests.extend(delay::tests(modes, inputs, outputs, &others));
    if !is_reciprocal {
        tests.extend(reciprocity::tests(modes, inputs, outputs, driving_points));
    }
    rows.extend(adjusted(tests));
    rows
}
