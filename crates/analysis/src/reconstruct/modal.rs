//! Reconstruction of a force with the modes of a test, line by line.

use mechid_force::{Noise, frequency_domain};

use super::method::{How, Request};
use super::motion::Recorded;
use super::options::{Method, Reconstruct};
use super::rest::begins_and_ends_at_rest;
use super::tally::Tally;
use super::{Reconstructed, System, Take, Task, periods};
use crate::AnalysisError;
use crate::measurement::Measurement;
use crate::modes::ModalSystem;
use crate::text::significant;

/// Note on a record that the settings declare to be at rest.
const ASSUMED_AT_REST: &str = "the record is assumed to begin and end at rest: motion at the beginning or end is \
                               attributed to the forces, and the standard errors do not include this effect";

const LINE_BY_LINE: &str =
    "with modes as the model, the force is computed line by line: choose frequency-domain";

/// Reconstructs the forces at the places of a modal test from measured responses. The method uses
/// the frequency responses of the modes in the band of the test. The force is also passed to
/// `take`.
///
/// Forces and responses are those of the test: columns are matched by name, or in order, and
/// `forced` counts the forces of the test from 1. The window holds whole periods, or an open record
/// that begins and ends at rest, such as a hit with its whole decay; rest is detected, or stated
/// (`at_rest`). The standard error includes the uncertainty of the modes, not that of the residual
/// terms.
///
/// # Errors
/// [`AnalysisError::Setting`] for an open record that moves at its ends, for another method, or for
/// columns that are not those of the modes, [`AnalysisError::Forced`],
/// [`AnalysisError::NoiseCount`], and the errors of
/// [`frequency_domain`](mechid_force::frequency_domain).
pub fn reconstruct_with_modes(
    run: &Measurement,
    system: &ModalSystem,
    how: &Reconstruct,
    take: &mut Take<'_>,
) -> Result<Reconstructed, AnalysisError> {
    if !matches!(how.method, Method::Auto | Method::FrequencyDomain) {
        return Err(AnalysisError::Setting { setting: "method", why: LINE_BY_LINE.into() });
    }
    let recorded = Recorded::with_columns(run, &system.outputs_of(&run.source().names)?, true)?;
    let places = system.inputs.len();
    let request = Request::new(how, &recorded, places, true)?;
    let window = recorded.hold()?;
    let is_open = run.window_settings().period.is_none();
    let is_judged = is_open && how.lines.is_none() && !how.at_rest;
    if is_judged {
        check_rest(system, &window.motion)?;
    }
    let band_hz = band(system, &request)?;
    let motion = window.motion.clone().in_band(band_hz)?;
    let lines = match &request.lines {
        Some(lines) => lines.clone(),
        None => mechid_force::inner_lines(&motion),
    };
    let noise = match request.noise.as_slice() {
        [] => Noise::Unknown,
        levels => Noise::PerChannel(levels.to_vec()),
    };
    let force = frequency_domain(system, &motion, &request.forced, &lines, &noise)?;
    let mut remarks: Vec<String> = periods::remark(&recorded, &window).into_iter().collect();
    if is_open && how.at_rest {
        remarks.push(ASSUMED_AT_REST.into());
    }
    let used = force.spectrum().lines().row_iter().filter(|row| row.camax() > 0.0).count();
    let how_found = How {
        method: "frequency responses of the modes, line by line",
        why: if is_judged {
            "the system is the result of a modal test, and the record begins and ends at rest"
                .into()
        } else {
            "the system is the result of a modal test".into()
        },
        counts_noise: noise != Noise::Unknown,
        chosen: vec![("lines used".into(), used as f64, "")],
        unexplained: force.unexplained().map(<[_]>::to_vec),
        seen_from_hz: None,
        band_hz: Some(band_hz),
        remarks,
    };
    let task = Task { recorded, request };
    let mut tally = Tally::new(task.recorded.sampling, places, true, take)?;
    tally.push_all(&force, how_found.counts_noise)?;
    let of_modes = System { name: &system.name, forces: system.inputs.clone(), uncertain: true };
    let summary = task.summary(&of_modes, how, &how_found, &tally);
    let Request { forced, lines, .. } = task.request;
    Ok(Reconstructed { summary, force, forced, lines })
}

/// Checks that an open record begins and ends at rest.
///
/// # Errors
/// [`AnalysisError::Setting`].
fn check_rest(
    system: &ModalSystem,
    motion: &mechid_force::Measurement,
) -> Result<(), AnalysisError> {
    if begins_and_ends_at_rest(system, motion) {
        return Ok(());
    }
    let why =
        "modes give the force of whole periods (`period`), or of a record that begins and ends \
               at rest; this record is too short, or moves at its beginning or end"
            .into();
    Err(AnalysisError::Setting { setting: "at_rest", why })
}

/// Returns the band of the modes, or the requested part of it.
fn band(system: &ModalSystem, request: &Request) -> Result<[f64; 2], AnalysisError> {
    let [low, high] = system.band_hz;
    let Some([from, to]) = request.band_hz else { return Ok(system.band_hz) };
    if from.max(low) < to.min(high) {
        return Ok([from.max(low), to.min(high)]);
    }
    let [low, high] = [low, high].map(|hz| significant(hz, 4));
    let why = format!("it does not overlap the band of the modes, {low} to {high} Hz");
    Err(AnalysisError::Setting { setting: "band_hz", why })
}
