//! Summary of the terms that a selection tried.

use mechid_nonlinear::{Criterion, Selection, SelectionStep};
use mechid_signal::message;
use serde::Serialize;

use super::options::Nonlinear;
use crate::text::{significant, text_table};

/// Terms in the order in which they were tried.
#[derive(Debug, Clone, Serialize)]
pub struct SelectionSummary {
    /// Criterion for adding a term.
    pub criterion: Criterion,
    /// Number of candidates.
    pub candidates: usize,
    /// The fits: the first without candidates, then one for each added term.
    pub steps: Vec<SelectionRow>,
    /// The next candidate, which did not improve the criterion; `None` if all were added.
    pub refused: Option<SelectionRow>,
    /// Names of the terms that were added and later removed, because zero is within the uncertainty
    /// of their coefficients.
    pub removed: Vec<String>,
}

/// One step of a selection of terms.
#[derive(Debug, Clone, Serialize)]
pub struct SelectionRow {
    /// Name of the term added; `None` for the first step.
    pub added: Option<String>,
    /// Value of the criterion with this term, a pure number; smaller is better.
    pub score: f64,
    /// Part of the weighted force that the fit does not explain, a ratio.
    pub unexplained: f64,
}

impl SelectionSummary {
    /// Creates the summary of a selection with the settings `how`.
    pub(super) fn new(selection: Selection, how: &Nonlinear) -> Self {
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
        let mut rows =
            vec![["term", "residual force", "criterion", ""].map(str::to_owned).to_vec()];
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
