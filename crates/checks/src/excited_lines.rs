//! Number of lines with force, compared with the number of unknowns.

use std::cmp::Ordering;
use std::fmt::{self, Formatter};

use mechid_estimate::Unknowns;
use mechid_signal::message;
use mechid_spectra::FrequencyData;

use super::finding::{Check, Finding, Names};
use super::limits::EXCITED_LINE;
use super::{Subject, Verdict};

/// Number of lines with force, compared with the unknowns of an equation of motion.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct ExcitedLines {
    /// Number of lines with force; each gives two real equations.
    pub lines: usize,
    /// Largest number of unknowns in an equation of motion.
    pub unknowns: usize,
}

/// Returns the largest number of unknowns in an equation of motion.
pub(super) fn unknowns_of_an_equation(unknowns: &Unknowns) -> usize {
    let free = unknowns.free();
    let count_of = |equation| free.iter().filter(|p| p.row() == equation).count();
    (0..unknowns.dof()).map(count_of).max().unwrap_or(0)
}

/// Compares the number of lines with force with the number of unknowns.
pub(super) fn excitation(data: &FrequencyData, unknowns: &Unknowns) -> Finding {
    let force = data.force();
    let floor: Vec<f64> =
        force.column_iter().map(|c| EXCITED_LINE * c.map(|f| f.norm()).max()).collect();
    let excited = |row: &usize| {
        force.row(*row).iter().zip(&floor).any(|(f, floor)| f.norm() > floor.max(0.0))
    };
    let lines = (0..data.len()).filter(excited).count();
    Finding::ExcitedLines(ExcitedLines { lines, unknowns: unknowns_of_an_equation(unknowns) })
}

impl Check for ExcitedLines {
    fn subject(&self) -> Subject {
        Subject::Excitation
    }

    fn verdict(&self) -> Verdict {
        match (2 * self.lines).cmp(&self.unknowns) {
            Ordering::Less => Verdict::Bad,
            Ordering::Equal => Verdict::Doubtful,
            Ordering::Greater => Verdict::Good,
        }
    }

    fn value(&self) -> f64 {
        self.lines as f64
    }

    fn sentence(&self, _: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} with force: each equation of motion gives {} for {}",
            message::count(self.lines, "line"),
            message::count(2 * self.lines, "real equation"),
            message::count(self.unknowns, "unknown")
        )?;
        f.write_str(match self.verdict() {
            Verdict::Good => "",
            Verdict::Doubtful => "; no equation remains to estimate the noise",
            Verdict::Bad => "; too few equations: excite more lines",
        })
    }
}
