//! Checks of a modal test: channels and tables before the fit, what the fit leaves, and the modes.

mod driving_point;
mod idle_force;
mod reciprocity;
mod table;
mod tested;

use mechid_checks::Verdict;
use mechid_modal::IdentifiedMode;

pub(super) use self::table::of_tables;
use self::tested::Tested;
use super::sources::Output;
use super::summary::ModalCheck;
use crate::AnalysisError;
use crate::identify::checks;
use crate::limits::LEAST_EXPLAINED;
use crate::measurement::Measurement;

/// Returns the checks of all channels: clipped, constant, spiked, quantised.
pub(super) fn of_channels(measurements: &[Measurement]) -> Result<Vec<ModalCheck>, AnalysisError> {
    let mut rows = Vec::new();
    for measurement in measurements {
        let block = measurement.whole_block()?;
        let record =
            if measurements.len() > 1 { format!("{}: ", block.file) } else { String::new() };
        rows.extend(checks::of_sensors(&block).into_iter().map(|finding| ModalCheck {
            code: "channel",
            passed: finding.verdict() == Verdict::Good,
            value: finding.value(),
            text: format!("{record}{}", checks::sentence(&finding, &block.names)),
        }));
    }
    Ok(rows)
}

/// Returns the check of what the modes explain of each response.
pub(super) fn of_outputs(explained: &[f64], names: &[String]) -> Vec<ModalCheck> {
    let row = |(share, name): (&f64, &String)| ModalCheck {
        code: "explained",
        passed: *share >= LEAST_EXPLAINED,
        value: *share,
        text: format!(
            "the modes explain {:.1} % of the variance of {name} in the band: the rest is noise, a \
             nonlinearity, or forces that were not measured",
            100.0 * share
        ),
    };
    explained.iter().zip(names).map(row).collect()
}

/// Returns the checks of the modes: forces that drive none, modal masses at driving points, and
/// reciprocity between these.
pub(super) fn of_modes(
    modes: &[IdentifiedMode],
    inputs: &[String],
    outputs: &[Output],
    driving_points: &[(usize, usize)],
) -> Vec<ModalCheck> {
    let mut rows = idle_force::checks(modes, inputs);
    let mut tests: Vec<Tested> = driving_point::tests(modes, inputs, outputs, driving_points);
    tests.extend(reciprocity::tests(modes, inputs, outputs, driving_points));
    rows.extend(tested::adjusted(tests));
    rows
}
