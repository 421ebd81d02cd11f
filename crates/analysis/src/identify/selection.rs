//! Terms that a selection tried, as a summary.

use mechid_nonlinear::{Criterion, Selection, SelectionStep};
use mechid_signal::message;
use serde::Serialize;

use super::options::Nonlinear;
use crate::text::{significant, text_table};

/// Terms that were tried, one after the other.
#[derive(Debug, Clone, Serialize)]
pub struct SelectionSummary {
    /// Criterion by which a term was added.
    pub criterion: Criterion,
    /// Number of candidates.
    pub candidates: usize,
    /// The fits, the first without any candidate, then with each term that was added.
    pub steps: Vec<SelectionRow>,
    /// The candidate that came next and was not worth it; `None` if all were added.
    pub refused: Option<SelectionRow>,
    /// Names of the terms that were added and removed again, because their coefficients do not differ from
    /// zero by their standard errors.
    pub removed: Vec<String>,
}

/// One step of a selection of terms.
#[derive(Debug, Clone, Serialize)]
pub struct SelectionRow {
    /// Name of the term added; `None` for the first step.
    pub added: Option<String>,
    /// The criterion with it, a pure number, the smaller the better.
    pub score: f64,
    /// Part of the weighted force that is left with it, a ratio.
    pub unexplained: f64,
}

impl SelectionSummary {
    /// Returns the summary of a selection made with the settings `how`.
    pub(super) fn of(selection: Selection, how: &Nonlinear) -> Self {
        let row = |step: SelectionStep| SelectionRow {
            added: step.added,
            score: step.score,
            unexplained: step.unexplained,
        };
        Self {
            criterion: how.criterion,
            candidates: how.candidates.len(),
            steps: selection.steps.into_iter().map(row).collect(),
            refused: selection.refused.map(row),
            removed: selection.removed,
        }
    }

    /// Returns the steps as a table below a heading.
    pub(super) fn text(&self) -> String {
        let by = match self.criterion {
            Criterion::Information => "information criterion",
            Criterion::HeldOut => "records held out",
        };
        let mut rows = vec![["term", "force left", "criterion", ""].map(str::to_owned).to_vec()];
        let steps = self.steps.iter().map(|row| match &row.added {
            None => (row, ""),
            Some(name) if self.removed.contains(name) => (row, "removed: may be zero"),
            Some(_) => (row, "added"),
        });
        for (row, verdict) in steps.chain(self.refused.iter().map(|row| (row, "refused"))) {
            rows.push(vec![
                row.added.clone().unwrap_or_else(|| "none of them".into()),
                format!("{} %", significant(100.0 * row.unexplained, 3)),
                significant(row.score, 5),
                verdict.into(),
            ]);
        }
        let candidates = message::count(self.candidates, "candidate");
        format!("selection from {candidates} by the {by}\n{}", text_table(&rows))
    }
}
