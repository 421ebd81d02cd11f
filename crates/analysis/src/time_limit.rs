//! Limits of the time and of the work of an analysis.

use std::fmt::Display;

use mechid_checks::{Finding, TimeLimit, WorkLimit};
use mechid_numerics::time_limit::{self, Ended};

use crate::AnalysisError;
use crate::identify::checks::{CheckRow, When};
use crate::limits::OPERATIONS_PER_BYTE;
use crate::measurement::Channels;
use crate::modes::ModalCheck;

/// Runs an analysis with a limit of its time, in s; `None`: without a limit.
///
/// When the limit is reached, every search stops at its best point so far. The analysis then does
/// only the work that is still necessary for a result. The result has a bad check of the kind
/// `time_limit`, or a remark if this kind of result has no checks. Without this limit, an analysis
/// has a limit of its work in proportion to the memory that its file may use
/// ([`mechid_io::Limits::memory`]).
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

/// Runs an analysis of files that may use `memory` bytes together, with a limit of its work in
/// proportion to this memory ([`OPERATIONS_PER_BYTE`]); if the caller has a limit, that limit
/// remains.
pub(crate) fn bounded<T>(
    memory: usize,
    work: impl FnOnce() -> Result<T, AnalysisError>,
) -> Result<T, AnalysisError> {
    let limit = time_limit::TimeLimit::from_operations(OPERATIONS_PER_BYTE * memory as f64);
    time_limit::within_default(limit, || {
        work().map_err(|failure| match time_limit::ended() {
            Some(Ended::AfterOperations(_)) => with_limit(failure),
            // The limit is that of a caller, which names it.
            _ => failure,
        })
    })
}

/// Returns the failure of an analysis. If a limit has ended a search, the failure names the limit.
fn with_limit<E: From<AnalysisError> + Display>(failure: E) -> E {
    let reason = || failure.to_string();
    match time_limit::ended() {
        Some(Ended::AfterSeconds(seconds)) => {
            AnalysisError::TimeLimit { seconds, failure: reason() }.into()
        }
        Some(Ended::AfterOperations(operations)) => {
            AnalysisError::WorkLimit { operations, failure: reason() }.into()
        }
        None => failure,
    }
}

/// Returns the finding that a limit has ended a search of this analysis.
fn finding() -> Option<Finding> {
    time_limit::ended().map(|ended| match ended {
        Ended::AfterSeconds(seconds) => Finding::TimeLimit(TimeLimit { seconds }),
        Ended::AfterOperations(operations) => Finding::WorkLimit(WorkLimit { operations }),
    })
}

/// Returns the check that fails if a limit has ended a search of this analysis; `None` if
/// all searches have run to their ends.
pub(crate) fn check() -> Option<CheckRow> {
    finding().map(|finding| CheckRow::new(When::After, None, &finding, &Channels::default()))
}

/// Returns the failed check of a modal test if a limit has ended a search; `None` if all searches
/// have run to their ends.
pub(crate) fn check_of_modes() -> Option<ModalCheck> {
    finding().map(|finding| ModalCheck {
        code: match finding {
            Finding::WorkLimit(_) => "work_limit",
            _ => "time_limit",
        },
        passed: false,
        value: finding.value(),
        text: finding.to_string(),
    })
}

/// Returns a remark if a limit has ended a search; `None` if all searches have run to their
/// ends.
pub(crate) fn remark() -> Option<String> {
    finding().map(|finding| finding.to_string())
}
