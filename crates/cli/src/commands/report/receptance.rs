//! The receptance that records show, whatever was fitted.

use mechid::estimate::frequency_domain::{FrequencyData, Lines, RepeatedPeriods};
use mechid::estimate::time_domain::Extent;
use mechid::estimate::{Frf, FrfEstimator, Segments, Window};
use mechid::signal::{Record, lines};

use crate::commands::identify::Identified;
use crate::commands::identify::course::Course;
use crate::commands::identify::excited::choose_lines;
use crate::commands::identify::measurement::Measurement;
use crate::error::CliError;

/// Part of an open record that a segment takes; half overlapped, this makes fifteen segments.
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
    pub fn of(found: &Identified) -> Result<Self, CliError> {
        if let Some((_, data)) = &found.fitted.frequency {
            let origin = match found.fitted.course {
                Course::Steady => "measured on the lines used",
                Course::Sampled { .. } => "averaged over segments, on the lines used",
            };
            return Ok(Self { data: data.clone(), origin: origin.into() });
        }
        let first = &found.records[0];
        let period = match found.fitted.course {
            Course::Steady | Course::Sampled { extent: Extent::WholePeriod, .. } => true,
            Course::Sampled { .. } => first.periods > 1,
        };
        let each = |measured| if period { of_periods(measured) } else { of_segments(measured) };
        let mut data = each(first)?;
        for measured in &found.records[1..] {
            data = data.and(&each(measured)?)?;
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

fn of_periods(measured: &Measurement) -> Result<FrequencyData, CliError> {
    let force = &measured.force;
    let chosen = choose_lines(force, measured.period, None, None)?;
    let lines = Lines::new(force.sampling().with_len(measured.period)?, chosen)?;
    let (motion, kind) = measured.motion();
    Ok(RepeatedPeriods::new(&lines, force, motion, kind)?.mean()?)
}

fn segment(measured: &Measurement) -> usize {
    (measured.force.len() / SEGMENTS).max(1)
}

fn of_segments(measured: &Measurement) -> Result<FrequencyData, CliError> {
    let force = &measured.force;
    let len = segment(measured);
    let segments = Segments::Windowed { len, hop: len.div_ceil(2), window: Window::Hann };
    let acts = |dof: &usize| force.channel(*dof).iter().any(|f| *f != 0.0);
    let driven: Vec<usize> = (0..force.channels()).filter(acts).collect();
    let acting: Vec<&[f64]> = driven.iter().map(|dof| force.channel(*dof)).collect();
    let acting = Record::from_channels(force.sampling(), &acting)?;
    let (motion, kind) = measured.motion();
    let estimate =
        |lines: Vec<usize>| Frf::estimate(&acting, motion, kind, segments, lines, FrfEstimator::H1);
    let all = lines::full(force.sampling().with_len(len)?);
    let coherence = estimate(all.clone())?.coherence().clone();
    let explained = |row: usize| coherence.row(row).iter().all(|part| *part >= EXPLAINED);
    let clear: Vec<usize> =
        all.into_iter().enumerate().filter(|(row, _)| explained(*row)).map(|(_, n)| n).collect();
    if clear.is_empty() {
        return Err(CliError::NothingToDraw);
    }
    Ok(estimate(clear)?.data(&driven)?)
}
