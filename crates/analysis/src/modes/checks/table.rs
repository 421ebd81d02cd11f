//! Checks of tables of frequency responses: units, coherence, and resonances against the segments.

use mechid_checks::Verdict;
use mechid_checks::limits::{INCOHERENCE_DOUBTFUL, RESONANCE_LINES};
use mechid_io::FrequencyResponses;
use mechid_modal::IdentifiedMode;

use super::super::averaged::Averaged;
use super::super::summary::ModalCheck;
use super::super::tables::{Tables, rows};
use crate::identify::checks::sentence;
use crate::measurement::Channels;
use crate::measurement::units::doubt;
use crate::text::significant;

/// Returns the checks of tables; `settled` is true if the correction of the window bias converged.
pub(in super::super) fn table_checks(
    tables: &Tables,
    band_hz: [f64; 2],
    modes: &[IdentifiedMode],
    settled: bool,
) -> Vec<ModalCheck> {
    let mut checks = Vec::new();
    for (table, averaged) in tables.with_segments() {
        checks.extend(units(table));
        checks.extend(coherence(table, &rows(table, None, band_hz)));
        checks.extend(leakage(table, averaged, modes, settled));
    }
    checks
}

/// Checks the texts in the headers of a table that may be units.
fn units(table: &FrequencyResponses) -> Vec<ModalCheck> {
    let doubts = table.doubts.iter();
    let findings = doubts.filter_map(|(column, stated, wanted)| doubt(column, stated, *wanted));
    let check = |finding: mechid_checks::Finding| ModalCheck {
        code: "unit",
        passed: finding.verdict() == Verdict::Good,
        value: finding.value(),
        text: format!("{}: {}", table.file, sentence(&finding, &Channels::default())),
    };
    findings.map(check).collect()
}

/// Checks the median coherence over the rows and functions of a table.
fn coherence(table: &FrequencyResponses, rows: &[usize]) -> Option<ModalCheck> {
    let values = table.coherence.iter();
    let mut values: Vec<f64> = values.flat_map(|c| rows.iter().map(|row| c.values[*row])).collect();
    values.sort_by(f64::total_cmp);
    let median = *values.get(values.len() / 2)?;
    let impossible = values.iter().filter(|value| !(0.0..=1.0).contains(*value)).count();
    let passed = impossible == 0 && median >= 1.0 - INCOHERENCE_DOUBTFUL;
    let text = if passed {
        format!("{}: median coherence {median:.4} in the band", table.file)
    } else if impossible > 0 {
        format!(
            "{}: {impossible} of {} values of the coherence are not between 0 and 1, so this quantity is not a coherence",
            table.file,
            values.len()
        )
    } else {
        format!(
            "{}: median coherence {median:.4} in the band. Possible causes: noise, leakage, other forces",
            table.file
        )
    };
    Some(ModalCheck { code: "coherence", passed, value: median, text })
}

/// Checks the width of the narrowest resonance in lines; `None` for periods and hits, which have no
/// window bias, and for unevenly spaced frequencies without segments.
fn leakage(
    table: &FrequencyResponses,
    averaged: Option<&Averaged>,
    modes: &[IdentifiedMode],
    settled: bool,
) -> Option<ModalCheck> {
    let spacing_hz = match averaged {
        Some(averaged) => Some(averaged.spacing_hz).filter(|_| averaged.is_smoothed())?,
        None => even_spacing_hz(&table.frequency_hz)?,
    };
    let width = |mode: &IdentifiedMode| {
        2.0 * mode.damping_ratio.value.abs() * mode.natural_frequency_hz.value / spacing_hz
    };
    let narrowest = modes.iter().min_by(|a, b| width(a).total_cmp(&width(b)))?;
    let lines = width(narrowest);
    let passed = settled && lines >= RESONANCE_LINES;
    let why = match averaged {
        Some(_) if passed => "a segment",
        None if passed => "the table",
        Some(_) if settled => {
            "a segment. This is too narrow to separate the damping of this mode from the bias of the window, and \
             the intervals of this mode are not reliable: use longer segments, or fit the record itself"
        }
        Some(_) => {
            "a segment. The bias of the window could not be separated from the damping of this mode, and the \
             intervals of this mode are not reliable: use longer segments, or fit the record itself"
        }
        None => {
            "the table. The table does not state its segments: if the responses are averages under a window, the \
             damping may be that of the window; fit the record itself"
        }
    };
    Some(ModalCheck {
        code: "leakage",
        passed,
        value: lines,
        text: format!(
            "{}: the half-power width of the resonance at {:.4} Hz is {} line spacings of {why}",
            table.file,
            narrowest.natural_frequency_hz.value,
            significant(lines, 2)
        ),
    })
}

/// Maximum relative difference between line spacings that count as equal. It allows for the
/// rounding of the frequencies in a file.
const EVEN: f64 = 1e-2;

/// Returns the line spacing, in Hz, if it is even.
fn even_spacing_hz(frequency_hz: &[f64]) -> Option<f64> {
    let mut distances = frequency_hz.windows(2).map(|pair| pair[1] - pair[0]);
    let first = distances.next()?;
    distances.all(|distance| (distance - first).abs() <= EVEN * first).then_some(first)
}
