//! Checks of a modal test: channels before the fit, and what the fit leaves.

use mechid_checks::Verdict;

use super::summary::ModalCheck;
use crate::AnalysisError;
use crate::identify::checks;
use crate::measurement::Measurement;

/// Share of the variance of a response that the modes must explain; below it most of the motion is
/// something else, and shapes there mean little.
const EXPLAINED: f64 = 0.5;

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
        passed: *share >= EXPLAINED,
        value: *share,
        text: format!(
            "the modes explain {:.1} % of the variance of {name} in the band: the rest is noise, a \
             nonlinearity, or forces that were not measured",
            100.0 * share
        ),
    };
    explained.iter().zip(names).map(row).collect()
}
