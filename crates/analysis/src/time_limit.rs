//! Time limit of an analysis.

use std::fmt::Display;

use mechid_checks::{Finding, TimeLimit};
use mechid_numerics::time_limit;

use crate::AnalysisError;
use crate::identify::checks::{CheckRow, When};
use crate::measurement::Channels;
use crate::modes::ModalCheck;

/// Runs an analysis with a limit of its time, in s; `None`: without a limit.
///
/// After the end of the limit, every search stops at its best point so far, and the analysis ends
/// with the work that a result needs. The result has a bad check of the kind `time_limit`, or a
/// remark if this kind of result has no checks.
///
/// ```
/// use mechid_analysis::{AnalysisError, Channels, Identify, Measurement, ResponseQuantity};
/// use mechid_analysis::{identify, identify::Method, time_limit};
///
/// let rig = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/machine.csv");
/// let channels = Channels::new("force", ResponseQuantity::Displacement, "displacement");
/// let test = [Measurement::open(rig, &channels)?.period(256)?];
/// let how = Identify::spectra(Method::MaximumLikelihood);
/// let identified = time_limit::within(Some(0.0), || identify(&test, &how))?;
/// assert!(identified.checks().iter().any(|check| check.is_bad()));
/// # Ok::<(), AnalysisError>(())
/// ```
///
/// # Errors
/// The errors of `work`; [`AnalysisError::TimeLimit`] if the limit ended a search before `work`
/// failed; [`AnalysisError::Setting`] if the limit is negative or not finite.
pub fn within<T, E: From<AnalysisError> + Display>(
    seconds: Option<f64>,
    work: impl FnOnce() -> Result<T, E>,
) -> Result<T, E> {
    let limit = seconds.map(|seconds| {
        time_limit::TimeLimit::from_seconds(seconds).ok_or_else(|| AnalysisError::Setting {
            setting: "time_limit",
            why: format!("a finite number of at least 0 is needed, got {seconds}"),
        })
    });
    time_limit::within(limit.transpose()?, || work().map_err(with_limit))
}

/// Returns the failure of an analysis. If the time limit has ended a search, the failure names the
/// limit.
fn with_limit<E: From<AnalysisError> + Display>(failure: E) -> E {
    match time_limit::ended() {
        Some(seconds) => AnalysisError::TimeLimit { seconds, failure: failure.to_string() }.into(),
        None => failure,
    }
}

/// Returns the finding that the time limit has ended a search of this analysis.
fn finding() -> Option<Finding> {
    time_limit::ended().map(|seconds| Finding::TimeLimit(TimeLimit { seconds }))
}

/// Returns the check that fails if the time limit has ended a search of this analysis; `None` if
/// all searches have run to their ends.
pub(crate) fn check() -> Option<CheckRow> {
    finding().map(|finding| CheckRow::new(When::After, None, &finding, &Channels::default()))
}

/// Returns the failed check of a modal test if the time limit has ended a search; `None` if all
/// searches have run to their ends.
pub(crate) fn check_of_modes() -> Option<ModalCheck> {
    finding().map(|finding| ModalCheck {
        code: "time_limit",
        passed: false,
        value: finding.value(),
        text: finding.to_string(),
    })
}

/// Returns a remark if the time limit has ended a search; `None` if all searches have run to their
/// ends.
pub(crate) fn remark() -> Option<String> {
    finding().map(|finding| finding.to_string())
}
