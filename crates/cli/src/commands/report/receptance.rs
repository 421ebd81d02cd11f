//! The receptance that records show, whatever was fitted.

use mechid::estimate::frequency_domain::{FrequencyData, Lines};
use mechid::estimate::{FrfEstimator, Segments, Window};
use mechid::signal::{Extent, lines};

use super::Part;
use crate::commands::frf::responses::average;
use crate::commands::identify::Identified;
use crate::commands::identify::course::Course;
use crate::commands::identify::excited::choose_lines;
use crate::commands::identify::fit::periods;
use crate::commands::identify::measurement::{HELD, Measurement, Recorded};
use crate::error::CliError;

/// Part of an open record that a segment takes; half overlapped, this makes fifteen segments. Of a
/// record too long to be held there are more of them, not longer ones.
const SEGMENTS: usize = 8;

/// A line is shown if the force explains at least this part of the power of every motion.
const EXPLAINED: f64 = 0.5;

/// A measured receptance, and where it comes from.
pub struct Receptance {
    pub data: FrequencyData,
    pub origin: String,
}

impl Receptance {
    /// What was fitted in the frequency domain; otherwise that of whole periods, or averaged over
    /// segments of open records.
    ///
    /// # Errors
    /// If the records show none.
    pub fn of(found: &Identified, parts: &[Part<'_>]) -> Result<Self, CliError> {
        if let Some((_, data)) = &found.fitted.frequency {
            let origin = match found.fitted.course {
                Course::Steady => "measured on the lines used",
                Course::Sampled { .. } => "averaged over segments, on the lines used",
            };
            return Ok(Self { data: data.clone(), origin: origin.into() });
        }
        let first = parts[0].held();
        // The beginning of a period is none.
        let held = first.periods > 1 || first.held_to().is_none();
        let period = match found.fitted.course {
            Course::Steady | Course::Sampled { extent: Extent::WholePeriod, .. } => held,
            Course::Sampled { .. } => first.periods > 1,
        };
        let each = |part: &Part<'_>| match period {
            true => of_periods(part),
            false => of_segments(part.recorded),
        };
        let mut data = each(&parts[0])?;
        for part in &parts[1..] {
            data = data.and(&each(part)?)?;
        }
        let origin = match period {
            true => "measured on the lines of whole periods that carry force".into(),
            false => format!(
                "by H1 from segments of {} samples, half overlapped and weighted by a Hann window, \
                 where the force explains at least half of the motion (a resonance narrower than \
                 the lines looks blunter than it is)",
                segment(first)
            ),
        };
        // A held or linear force is weaker than its samples there, and the motion with it.
        let origin =
            origin + "; towards half the sampling rate the force between the samples shows, too";
        Ok(Self { data, origin })
    }
}

fn of_periods(part: &Part<'_>) -> Result<FrequencyData, CliError> {
    let held = part.held();
    // Several periods tell their noise; of one that is longer than what is held there is the mean.
    let force = match held.force.len() < held.period {
        true => &part.whole.period(held).force,
        false => &held.force,
    };
    let chosen = choose_lines(force, held.period, None, None)?;
    let lines = Lines::new(force.sampling().with_len(held.period)?, chosen)?;
    Ok(periods(part.recorded, &lines)?.mean()?)
}

fn segment(measured: &Measurement) -> usize {
    ((measured.period * measured.periods).min(HELD) / SEGMENTS).max(1)
}

fn of_segments(recorded: &Recorded) -> Result<FrequencyData, CliError> {
    let held = &recorded.held;
    let len = segment(held);
    let segments = Segments::Windowed { len, hop: len.div_ceil(2), window: Window::Hann };
    let sampling = held.force.sampling().with_len(len)?;
    let all = Lines::new(sampling, lines::full(sampling))?;
    let responses = average(recorded, &all, segments)?.frf(FrfEstimator::H1)?;
    let explained =
        |row: &usize| responses.coherence().row(*row).iter().all(|part| *part >= EXPLAINED);
    let clear: Vec<usize> = (0..all.as_slice().len()).filter(explained).collect();
    if clear.is_empty() {
        return Err(CliError::NothingToDraw);
    }
    Ok(responses.at(&clear).data(&held.driven)?)
}
