//! Resonances beyond those that a machine with one degree of freedom for each response can have.

use mechid_modal::{ModalSettings, identify_modes, initial_mode_count};
use mechid_signal::message;

use super::settings::Places;
use super::sources::Recorded;
use crate::measurement::Measurement;
use crate::text::compact;

/// Number of natural frequencies that the sentence lists.
const LISTED: usize = 8;

/// Returns a sentence if records show more modes, each significant by the likelihood, than they have
/// responses: M, C and K of that size cannot describe them.
pub(crate) fn surplus(measurements: &[Measurement]) -> Option<String> {
    let recorded = Recorded::from_forced(measurements, None, &Places::default()).ok()?;
    let responses = recorded.outputs.len();
    let data = recorded.lines(recorded.driven_band()).ok()?;
    // Most records have none, which the start of the search shows in a fraction of its time.
    if initial_mode_count(&data).ok()? <= responses {
        return None;
    }
    let estimate = identify_modes(&data, &ModalSettings::default()).ok()?;
    let modes = estimate.modes();
    if modes.len() <= responses {
        return None;
    }
    let frequencies = modes.iter().map(|mode| compact(mode.natural_frequency_hz.value, 4));
    Some(format!(
        "the data show {} ({} Hz) and {}: a machine with one degree of freedom for each response cannot \
         describe them; `mechid modes` finds frequencies, damping ratios and shapes with any number of \
         sensors, or choose a band with fewer resonances",
        message::count(modes.len(), "resonance"),
        message::list(frequencies, ", ", LISTED),
        message::count(responses, "response"),
    ))
}
