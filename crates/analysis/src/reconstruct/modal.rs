//! Force by the modes of a test, line by line.

use mechid_force::{Noise, frequency_domain};

use super::method::{How, Request};
use super::motion::Recorded;
use super::options::{Method, Reconstruct};
use super::tally::Tally;
use super::{Reconstructed, System, Take, Task, periods};
use crate::AnalysisError;
use crate::measurement::Measurement;
use crate::modes::ModalSystem;
use crate::text::significant;

/// Reconstructs forces at the places of a modal test from measured responses, by the frequency
/// responses of its modes, in the band of the test; the force is passed to `take`, too.
///
/// Forces and responses are those of the test: columns are matched by name, or in order, and
/// `forced` counts the forces of the test from 1. The window holds whole periods, or an open record
/// that begins and ends at rest (`at_rest`), such as a hit with its whole decay. The standard error
/// includes the uncertainty of the modes, not that of the residual terms.
///
/// # Errors
/// [`AnalysisError::ForceNeedsPeriods`] for another open record, [`AnalysisError::Setting`] for
/// another method or for columns that are not those of the modes, [`AnalysisError::Forced`],
/// [`AnalysisError::NoiseCount`], and the errors of
/// [`frequency_domain`](mechid_force::frequency_domain).
pub fn reconstruct_with_modes(
    run: &Measurement,
    system: &ModalSystem,
    how: &Reconstruct,
    take: &mut Take<'_>,
) -> Result<Reconstructed, AnalysisError> {
    check_settings(run, how)?;
    let recorded = Recorded::with_columns(run, &system.outputs_of(&run.source().names)?, true)?;
    let places = system.inputs.len();
    let request = Request::new(how, &recorded, places, true)?;
    let window = recorded.hold()?;
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
    if run.window_settings().period.is_none() && how.at_rest {
        remarks.push(
            "the record is assumed to begin and end at rest: motion at its ends is attributed to the forces, and the standard errors do not include this"
                .into(),
        );
    }
    let used = force.spectrum().lines().row_iter().filter(|row| row.camax() > 0.0).count();
    let how_found = How {
        method: "frequency responses of the modes, line by line",
        why: "the system is the result of a modal test".into(),
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

/// Checks that modes can give the force with these settings.
fn check_settings(run: &Measurement, how: &Reconstruct) -> Result<(), AnalysisError> {
    if !matches!(how.method, Method::Auto | Method::FrequencyDomain) {
        let why = "modes give the force line by line: choose frequency-domain".into();
        return Err(AnalysisError::Setting { setting: "method", why });
    }
    if run.window_settings().period.is_none() && how.lines.is_none() && !how.at_rest {
        let why = "modes give the force of whole periods (`period`), or of a record that begins \
                   and ends at rest"
            .into();
        return Err(AnalysisError::Setting { setting: "at_rest", why });
    }
    Ok(())
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
