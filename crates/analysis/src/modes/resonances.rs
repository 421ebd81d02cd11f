//! Records with more resonances than a machine with one degree of freedom for each response.

use mechid_io::{FrequencyResponses, ResponseFunction};
use mechid_modal::{ModalSettings, identify_modes, initial_mode_count};
use mechid_signal::message;
use mechid_spectra::LineData;

use super::settings::Places;
use super::sources::Recorded;
use super::tables::Tables;
use crate::identify::IdentifyResponses;
use crate::identify::thinned::for_resonances;
use crate::measurement::Measurement;
use crate::text::compact;

/// Maximum number of natural frequencies in the remark.
const LISTED: usize = 8;

/// Returns a remark if records show more modes, each significant by the likelihood, than they have
/// responses: M, C and K with one degree of freedom for each response cannot describe them.
pub(crate) fn surplus(measurements: &[Measurement]) -> Option<String> {
    let recorded = Recorded::from_forced(measurements, None, &Places::default()).ok()?;
    let responses = recorded.outputs.len();
    surplus_of(&recorded.lines(recorded.driven_band().ok()?).ok()?, responses)
}

/// Returns the remark of [`surplus`] for tables of frequency responses.
pub(crate) fn surplus_of_tables(
    tables: &[FrequencyResponses],
    how: &IdentifyResponses,
) -> Option<String> {
    let fewer = for_resonances(tables, how);
    let mut tables = fewer.unwrap_or_else(|| tables.to_vec());
    if !how.points.is_empty() {
        let is_chosen = |f: &ResponseFunction| {
            [&f.response, &f.reference].iter().all(|p| how.points.contains(p))
        };
        tables.iter_mut().for_each(|table| table.functions.retain(is_chosen));
    }
    let tables = Tables::new(&tables, how.quantity).ok()?;
    let band = how.band.map_or(tables.range_hz(), |band| [band.low_hz, band.high_hz]);
    surplus_of(&tables.lines(band, None).ok()?, tables.responses.len())
}

/// Returns the remark if the lines show more modes than there are `responses`.
fn surplus_of(data: &LineData, responses: usize) -> Option<String> {
    // The initial estimates need a fraction of the time of a fit. For most records they already
    // show that there are not more modes than responses.
    if initial_mode_count(data).ok()? <= responses {
        return None;
    }
    let estimate = identify_modes(data, &ModalSettings::default()).ok()?;
    let modes = estimate.modes();
    if modes.len() <= responses {
        return None;
    }
    let frequencies = modes.iter().map(|mode| compact(mode.natural_frequency_hz.value, 4));
    Some(format!(
        "the data show {} ({} Hz) and {}: a machine with one degree of freedom for each response cannot \
         describe them. Use `mechid modes`, which finds frequencies, damping ratios and shapes with any \
         number of sensors, or choose a band with fewer resonances",
        message::count(modes.len(), "resonance"),
        message::list(frequencies, ", ", LISTED),
        message::count(responses, "response"),
    ))
}
