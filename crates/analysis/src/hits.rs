//! Division of the records of a hammer test into hits.

use std::fmt;
use std::ops::Range;

use mechid_signal::{Hit, HitFault, HitRule, Hits, Record, hits, message};
use nalgebra::DMatrix;
use serde::Serialize;

use crate::AnalysisError;
use crate::measurement::{Block, Windowed};
use crate::text::significant;

/// Minimum ratio of a force sample to the largest force, for a sample that counts as part of a
/// pulse.
const PULSE: f64 = 0.05;

/// Maximum share of the samples that belong to pulses, in a record that counts as a hammer test.
const RARE: f64 = 0.05;

/// Maximum ratio of pull to push of a hammer; ringing filters cause some pull.
const ONE_SIDED: f64 = 0.2;

/// Maximum excess of the power of a channel during the hits over its power between the hits, in
/// standard deviations of the power of noise; with a larger excess, a force acts.
const MOVES: f64 = 6.0;

/// One hit of a record, used or excluded.
#[derive(Debug, Clone, Serialize)]
pub struct HitRow {
    /// The record.
    pub record: String,
    /// Number of the hit in its record, counted from 1.
    pub number: usize,
    /// Degree of freedom that is struck, counted from 1.
    pub force: usize,
    /// First sample of the window of the hit, counted from 1.
    pub first_sample: usize,
    /// Last sample of the window of the hit, counted from 1.
    pub last_sample: usize,
    /// Instant at which the force pulse begins, in s after the first sample of the record.
    pub time_s: f64,
    /// Duration of the force pulse, in s.
    pub duration_s: f64,
    /// Largest force, in N.
    pub peak: f64,
    /// `true` if the hit was used.
    pub used: bool,
    /// Reasons for the exclusion of the hit, a sentence each.
    pub reasons: Vec<String>,
    /// Reasons for the exclusion of the hit in machine-readable form, with the measured values.
    pub faults: Vec<HitFault>,
}

impl HitRow {
    fn new(record: &Windowed, number: usize, dof: usize, hit: &Hit) -> Self {
        let dt = record.held.force.sampling().dt();
        let first = record.held.first_sample;
        Self {
            record: record.held.file.clone(),
            number,
            force: dof + 1,
            first_sample: first + hit.window.start,
            last_sample: first + hit.window.end - 1,
            time_s: (first - 1 + hit.pulse.start) as f64 * dt,
            duration_s: hit.pulse.len() as f64 * dt,
            peak: hit.peak,
            used: hit.faults.is_empty(),
            reasons: hit.faults.iter().map(HitFault::to_string).collect(),
            faults: hit.faults.clone(),
        }
    }
}

impl HitRow {
    /// Returns the number, the largest force and the time of the hit, as text.
    fn brief(&self) -> String {
        let (peak, time) = (significant(self.peak, 3), significant(self.time_s, 4));
        format!("hit {}, {peak} N at {time} s", self.number)
    }
}

impl fmt::Display for HitRow {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.brief())?;
        if self.used {
            return Ok(());
        }
        write!(f, ", left out: {}", self.reasons.join("; "))
    }
}

/// Returns a line for every record with its number of hits, and a line for every excluded hit; if
/// more than [`LISTED`] hits have the same kind of fault, one line names only the first of these
/// hits.
pub(crate) fn heading(rows: &[HitRow], sample_rate_hz: &str) -> String {
    let mut text = String::new();
    for of_record in rows.chunk_by(|a, b| a.record == b.record && a.number < b.number) {
        let used = of_record.iter().filter(|hit| hit.used).count();
        let (file, all) = (&of_record[0].record, of_record.len());
        let dof = of_record[0].force;
        text += &format!(
            "{file}: {used} of {all} hits on degree of freedom {dof} used, {sample_rate_hz} Hz\n"
        );
        for line in excluded(of_record) {
            text += &format!("  {line}\n");
        }
    }
    text
}

/// Maximum number of excluded hits with the same kind of fault that get one message each; for more
/// hits, one message names the kind, the number, and the first hits.
const LISTED: usize = 3;

/// Returns a text for every excluded hit, or one text for many hits with the same kind of fault, in
/// the order of the first hit of each text.
fn excluded(hits: &[HitRow]) -> Vec<String> {
    let kind = |hit: &HitRow| hit.faults.first().map_or("left out", HitFault::kind);
    let bad: Vec<&HitRow> = hits.iter().filter(|hit| !hit.used).collect();
    let mut texts = Vec::new();
    for (at, hit) in bad.iter().enumerate() {
        let is_alike = |other: &&&HitRow| kind(other) == kind(hit);
        let alike: Vec<&&HitRow> = bad.iter().filter(is_alike).collect();
        if alike.len() <= LISTED {
            texts.push(hit.to_string());
        } else if !bad[..at].iter().any(|other| kind(other) == kind(hit)) {
            let first = message::list(alike.iter().map(|hit| hit.brief()), "; ", LISTED);
            let reason = hit.reasons.first().map_or("", String::as_str);
            texts.push(format!(
                "{} left out, {}: {first}; reason for the first hit: {reason}",
                message::count(alike.len(), "hit"),
                kind(hit),
            ));
        }
    }
    texts
}

/// Returns a remark on a record that looks like a hammer test but is not divided into hits.
pub(crate) fn uncut(records: &[Windowed]) -> Option<String> {
    records.iter().find_map(|record| {
        let buffered = &record.held;
        let Struck { dof, found, .. } = Struck::from_block(buffered, &HitRule::default()).ok()?;
        let force = buffered.force.channel(dof);
        let (mut pull, mut push, mut pulses) = (0.0_f64, 0.0_f64, 0);
        let largest = found.all.iter().map(|hit| hit.peak.abs()).fold(0.0, f64::max);
        for f in force.iter().map(|f| f - found.offset) {
            (pull, push) = (pull.min(f), push.max(f));
            pulses += usize::from(f.abs() > PULSE * largest);
        }
        let smaller = push.min(-pull);
        let is_hammer = !found.all.is_empty()
            && smaller <= ONE_SIDED * largest
            && pulses as f64 <= RARE * force.len() as f64;
        is_hammer.then(|| {
            format!(
                "the force of {} is zero except for {}, as in a hammer test: `hits` cuts such a record into its hits, excludes \
                 bad hits, and fits each good hit as a separate record",
                buffered.file,
                message::count(found.all.len(), "short pulse")
            )
        })
    })
}

/// Good hits as records, and a row for every hit.
#[derive(Default)]
pub(crate) struct Cut {
    pub hits: Vec<Windowed>,
    /// Noise of the force, one entry for each record in `hits`.
    pub noise: Vec<HitNoise>,
    pub rows: Vec<HitRow>,
    /// Number of good hits of each record, in the order of the records: records in memory all have
    /// the same name, so a name does not identify a record.
    pub used: Vec<usize>,
    pub remarks: Vec<String>,
}

/// Degree of freedom that is struck in a record, with its hits.
struct Struck {
    dof: usize,
    found: Hits,
    /// Degrees of freedom whose channels contain only noise, also during the hits.
    idle: Vec<usize>,
}

impl Struck {
    /// Detects the hits of a buffered record.
    ///
    /// # Errors
    /// [`AnalysisError::Setting`] for an invalid rule, and if several forces act.
    fn from_block(held: &Block, rule: &HitRule) -> Result<Self, AnalysisError> {
        let wrong = |why| AnalysisError::Setting { setting: "hits", why };
        let find = |dof: &usize| {
            let record_hits = hits(held.force.channel(*dof), held.force.sampling().dt(), rule);
            record_hits.map(|found| (*dof, found)).map_err(|error| wrong(error.to_string()))
        };
        let hits_by_dof: Vec<(usize, Hits)> =
            held.driven.iter().map(find).collect::<Result<_, _>>()?;
        let (mut with, without): (Vec<_>, Vec<_>) = hits_by_dof
            .into_iter()
            .partition(|(_, found)| !found.all.is_empty() || held.driven.len() == 1);
        let idle: Vec<usize> = without.iter().map(|(dof, _)| *dof).collect();
        match (with.pop(), with.len()) {
            (Some((dof, found)), 0) if idle.iter().all(|dof| is_still(held, *dof, &found)) => {
                Ok(Self { dof, found, idle })
            }
            _ => Err(wrong(format!(
                "a hammer strikes one degree of freedom, but {} forces act in {}: name the force column of the \
                 struck degree of freedom, and 0 for the others",
                held.driven.len(),
                held.file
            ))),
        }
    }
}

/// Returns whether the force on a degree of freedom during the hits on another degree of freedom
/// does not exceed the force between the hits.
fn is_still(held: &Block, dof: usize, found: &Hits) -> bool {
    let force = held.force.channel(dof);
    let mut is_pulse = vec![false; force.len()];
    found.all.iter().for_each(|hit| is_pulse[hit.pulse.clone()].fill(true));
    let mean = force.iter().sum::<f64>() / force.len() as f64;
    let power = |during: bool| {
        let samples = force.iter().zip(&is_pulse).filter(|(_, is)| **is == during);
        let (sum, count) = samples
            .fold((0.0, 0.0), |(sum, count), (f, _)| (sum + (f - mean).powi(2), count + 1.0));
        (sum / f64::max(count, 1.0), count)
    };
    let ((during, samples), (between, _)) = (power(true), power(false));
    during <= between * (1.0 + MOVES * (2.0 / samples).sqrt())
}

/// Noise of the force in the window of a hit. The force is set to zero away from the pulse, so only
/// the pulse has noise.
#[derive(Debug, Clone)]
pub(crate) struct HitNoise {
    /// Standard deviation of the force between the hits, in N.
    pub deviation: f64,
    /// Samples of the window with a force, counted from 0, one range for each pulse.
    pub pulses: Vec<Range<usize>>,
}

/// Treatment of consecutive good hits whose windows have no gap.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Windows {
    /// Each window is a record.
    Separate,
    /// The windows are one record: the motion continues from one window to the next.
    Joined,
}

/// Divides fully buffered records into their good hits.
///
/// # Errors
/// [`AnalysisError::Setting`] for an invalid rule, and if several forces act;
/// [`AnalysisError::NoHit`] if a record has no good hit.
pub(crate) fn cut(
    records: &[Windowed],
    rule: &HitRule,
    windows: Windows,
) -> Result<Cut, AnalysisError> {
    let mut cut = Cut::default();
    for record in records {
        let buffered = &record.held;
        let Struck { dof, mut found, idle } = Struck::from_block(buffered, rule)?;
        let force = buffered.force.channel(dof);
        cut.remarks.extend(idle.iter().map(|dof| {
            format!(
                "{}: force {} was assumed zero: its channel contains only noise, also during the hits",
                buffered.file,
                dof + 1
            )
        }));
        for (_, response) in buffered.responses() {
            found.check_response(response)?;
        }
        let rows = found.all.iter().enumerate();
        let rows: Vec<HitRow> =
            rows.map(|(at, hit)| HitRow::new(record, at + 1, dof, hit)).collect();
        cut.used.push(rows.iter().filter(|row| row.used).count());
        if rows.iter().all(|row| !row.used) {
            let reasons = if rows.is_empty() {
                "the force does not rise above its noise".into()
            } else {
                excluded(&rows).join("; ")
            };
            return Err(AnalysisError::NoHit { file: buffered.file.clone(), reasons });
        }
        for (at, hits) in pieces(&found.all, windows).into_iter().enumerate() {
            let window = found.all[hits.start].window.start..found.all[hits.end - 1].window.end;
            let alone = found.pulses_alone(force, &found.all[hits.clone()]);
            let pulses = pulses_of(&found.all[hits.clone()], &window);
            cut.noise.push(HitNoise { deviation: found.noise, pulses });
            let mut pulses = DMatrix::zeros(window.len(), buffered.force.channels());
            pulses.column_mut(dof).copy_from_slice(&alone);
            let sampling = buffered.force.sampling().with_len(window.len())?;
            let mut part = record.part(window, Record::new(sampling, pulses)?)?;
            part.held.file = match hits.len() {
                1 => format!("{}, hit {}", buffered.file, hits.end),
                _ => format!("{}, hits {} to {}", buffered.file, hits.start + 1, hits.end),
            };
            part.held.driven = vec![dof];
            // The notes on units appear once for each record.
            if at > 0 {
                part.held.unit_remarks.clear();
                part.held.unit_findings.clear();
            }
            cut.hits.push(part);
        }
        cut.rows.extend(rows);
    }
    Ok(cut)
}

/// Returns the samples of a window on which the force of hits acts, one range for each hit. Hits
/// whose contacts overlap have a common range.
fn pulses_of(hits: &[Hit], window: &Range<usize>) -> Vec<Range<usize>> {
    let mut pulses: Vec<Range<usize>> = Vec::new();
    for hit in hits {
        let contact = hit.contact_with_margin();
        let inside = contact.start.max(window.start)..contact.end.min(window.end);
        let pulse = inside.start - window.start..inside.end.saturating_sub(window.start);
        match pulses.last_mut() {
            Some(last) if pulse.start <= last.end => last.end = last.end.max(pulse.end),
            _ => pulses.push(pulse),
        }
    }
    pulses
}

/// Returns the ranges of good hits; the hits of a range become one record.
fn pieces(all: &[Hit], windows: Windows) -> Vec<Range<usize>> {
    let follows = |a: &Hit, b: &Hit| {
        let both_good = a.faults.is_empty() && b.faults.is_empty();
        windows == Windows::Joined && both_good && a.window.end == b.window.start
    };
    let mut next = 0;
    let chunks = all.chunk_by(follows).map(|hits| {
        let range = next..next + hits.len();
        next = range.end;
        range
    });
    chunks.filter(|range| all[range.start].faults.is_empty()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(number: usize, fault: Option<HitFault>) -> HitRow {
        HitRow {
            record: "beam.csv".into(),
            number,
            force: 1,
            first_sample: 100 * number,
            last_sample: 100 * number + 99,
            time_s: number as f64,
            duration_s: 0.01,
            peak: 400.0,
            used: fault.is_none(),
            reasons: fault.iter().map(HitFault::to_string).collect(),
            faults: fault.into_iter().collect(),
        }
    }

    /// Sixty hits with the same fault give one line of text. Few hits give one line each.
    #[test]
    fn many_bad_hits_of_one_kind_are_one_line() {
        let overload = Some(HitFault::Overload { level: 390.0 });
        let mut rows: Vec<HitRow> = (1..=60).map(|number| row(number, overload)).collect();
        rows.push(row(61, Some(HitFault::Cut)));
        rows.push(row(62, None));
        let text = heading(&rows, "512");
        assert_eq!(text.lines().count(), 3, "{text}");
        assert!(text.len() < 400, "{text}");
        let many = "60 hits left out, overload of the force: hit 1, 400 N at 1.000 s; hit 2, ";
        assert!(text.contains(many) && text.contains("… (57 more)"), "{text}");
        assert!(text.contains("clipped at 390") && text.contains("hit 61, 400 N at"), "{text}");
        assert_eq!(excluded(&rows[57..]).len(), 4);
    }
}
