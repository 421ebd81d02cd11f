//! Agreement of the modes in the two halves of a test.

use mechid_modal::ambient::AmbientEstimate;
use mechid_modal::compare::{ComparedMode, Measured, ModePair};
use mechid_modal::{ModalEstimate, ModalSettings, PartsComparison};
use mechid_numerics::time_limit;
use mechid_signal::{Record, message};

use super::forced::LISTED;
use super::sources::Recorded;
use super::summary::ModalCheck;
use crate::text::significant;

/// Result of the comparison of the two halves of a test.
pub(super) struct Halves {
    /// Check of the agreement of the two halves; `None` if they have no common mode.
    pub check: Option<ModalCheck>,
    /// Note on modes that a half alone does not determine.
    pub note: Option<String>,
    /// Factor on the standard errors of each mode.
    pub error_scales: Vec<f64>,
}

impl Halves {
    /// Compares the modes of the first and the second half of one record or several.
    pub(super) fn new(
        recorded: &Recorded,
        band_hz: [f64; 2],
        estimate: &ModalEstimate,
        settings: &ModalSettings,
    ) -> Self {
        let what = match recorded.parts.len() {
            1 => "the record",
            _ if recorded.hits.is_empty() => "the records",
            _ => "the hits",
        };
        let hz = estimate.modes().iter().map(|mode| mode.natural_frequency_hz.value).collect();
        Self::from_comparison(compared(recorded, band_hz, estimate, settings), hz, what)
    }

    /// Compares the modes of the first and the second half of an ambient record.
    pub(super) fn of_ambient(record: &Record, estimate: &AmbientEstimate) -> Self {
        let len = record.len() / 2;
        let half = |first: usize| record.window(first, len).ok();
        let compare = |first: &Record, second: &Record| {
            PartsComparison::of_ambient(estimate, [first, second]).ok()
        };
        // Refits to the halves would change little of their initial estimates after the limit.
        let halves = half(0).zip(half(len)).filter(|_| !time_limit::is_over());
        let compared = halves.and_then(|(first, second)| compare(&first, &second));
        let hz = estimate.modes.iter().map(|mode| mode.natural_frequency_hz.value).collect();
        Self::from_comparison(compared, hz, "the record")
    }

    /// Takes the results of a comparison; `natural_hz` has the natural frequencies of the modes of
    /// the whole test, in Hz.
    fn from_comparison(
        compared: Option<PartsComparison>,
        natural_hz: Vec<f64>,
        what: &str,
    ) -> Self {
        let unknown = || vec![None; natural_hz.len()];
        let scales = compared.as_ref().map_or_else(unknown, |halves| halves.error_scales.clone());
        Self {
            check: compared.as_ref().and_then(|compared| check(compared, what)),
            note: undetermined(&natural_hz, &scales, what),
            error_scales: scales.into_iter().map(|scale| scale.unwrap_or(1.0)).collect(),
        }
    }
}

fn compared(
    recorded: &Recorded,
    band_hz: [f64; 2],
    estimate: &ModalEstimate,
    settings: &ModalSettings,
) -> Option<PartsComparison> {
    let [first, second] = recorded.halves().ok()?.map(|half| half.lines(band_hz).ok());
    let halves = [&first?, &second?];
    PartsComparison::new(estimate, halves, settings).ok()
}

/// Returns a note on the modes that are not common to both halves.
fn undetermined(natural_hz: &[f64], scales: &[Option<f64>], what: &str) -> Option<String> {
    let missing = natural_hz.iter().zip(scales).filter(|(_, scale)| scale.is_none());
    let missing = message::list(missing.map(|(hz, _)| significant(*hz, 4)), ", ", LISTED);
    (!missing.is_empty()).then(|| {
        format!(
            "one half of {what} alone does not determine the modes at {missing} Hz, so these modes could not be \
             compared between the halves"
        )
    })
}

/// Returns the check of the agreement of the halves.
fn check(compared: &PartsComparison, what: &str) -> Option<ModalCheck> {
    let (modes, pair) = compared.largest_difference()?;
    let (p_value, passed) = (compared.p_value(), !compared.differ());
    let text = if passed {
        format!(
            "the modes of the first and the second half of {what} agree (p = {})",
            significant(p_value, 2)
        )
    } else {
        difference(modes, pair, compared, what)
    };
    Some(ModalCheck { code: "halves", passed, value: p_value, text })
}

/// Returns a sentence about the mode that differs most between the two halves.
fn difference(
    [one, two]: [&ComparedMode; 2],
    pair: &ModePair,
    compared: &PartsComparison,
    what: &str,
) -> String {
    let uncertain = |measured: Measured, factor: f64| {
        let [value, error] = [measured.value, measured.standard_error].map(|x| factor * x);
        format!("{} ± {}", significant(value, 6), significant(error, 2))
    };
    let [damping, damping_of_other] = [one, two]
        .map(|mode| mode.damping_ratio.map_or(String::new(), |ratio| uncertain(ratio, 100.0)));
    let scales: Vec<f64> = compared.error_scales.iter().copied().flatten().collect();
    let scaled = match scales.iter().copied().fold(1.0, f64::max) {
        1.0 => String::new(),
        largest => format!(
            "; the standard errors of {} of {} modes are multiplied by up to {}",
            scales.iter().filter(|scale| **scale > 1.0).count(),
            scales.len(),
            significant(largest, 3)
        ),
    };
    format!(
        "the first and the second half of {what} differ most in one mode: {} and {} Hz, damping \
         {damping} and {damping_of_other} %, MAC {} (p = {}): the structure changed or is \
         nonlinear, or the model is incomplete{scaled}",
        uncertain(one.natural_frequency_hz, 1.0),
        uncertain(two.natural_frequency_hz, 1.0),
        significant(pair.mac.value, 4),
        significant(compared.p_value(), 2)
    )
}
