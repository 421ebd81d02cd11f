//! Every misprinted number, sign or reference, with the reason.

mod equations;
mod modal;
mod text;
mod twice;

pub use equations::EQUATIONS;
pub use modal::modal;
pub use text::TEXT;

use super::super::cells::Row;
use super::super::misprints::{CELLS, Field, MEANS, Misprint};
use super::evidence::{Evidence, mean};
use super::markdown::{number, table};

/// A misprint or an ambiguity outside the identification tables.
#[derive(Debug, Clone)]
pub struct Remark {
    /// Place of the misprint.
    pub place: String,
    /// Printed value.
    pub printed: String,
    /// Right value.
    pub right: String,
    /// Reason.
    pub reason: String,
}

impl Remark {
    fn new([place, printed, right, reason]: [&str; 4]) -> Self {
        let [place, printed, right, reason] = [place, printed, right, reason].map(str::to_owned);
        Self { place, printed, right, reason }
    }

    fn row(self) -> Vec<String> {
        vec![self.place, self.printed, self.right, self.reason]
    }
}

const HEAD: [&str; 4] = ["Where", "Printed", "Should be", "How we know"];

/// Returns the section of the audit page on the misprints.
///
/// # Errors
/// The message of the first computation that fails.
pub fn section(evidence: &Evidence) -> Result<String, String> {
    let fixed = |remarks: &[[&str; 4]]| table(&HEAD, remarks.iter().map(|r| Remark::new(*r).row()));
    let parts = [
        "## Misprints\n\nThe recomputed number stands beside each; where a whole column has the \
         wrong sign it is the mean over the column.\n"
            .to_owned(),
        format!("### Cells of the identification tables\n\n{}", cells(evidence)),
        format!("### Mean-error rows\n\n{}", means(evidence)),
        format!(
            "### Values printed twice\n\n{}",
            table(&["Pair", "Numbers compared", "Differences"], twice::rows(evidence))
        ),
        format!("### Appendix E\n\n{}", table(&HEAD, modal()?.into_iter().map(Remark::row))),
        format!("### Running text, captions, numbering\n\n{}", fixed(TEXT)),
        format!("### Equations\n\n{}", fixed(EQUATIONS)),
    ];
    Ok(parts.join("\n"))
}

fn cells(evidence: &Evidence) -> String {
    let row = |m: &Misprint| {
        let field = if m.field == Field::Estimate { "estimate" } else { "error" };
        let at = m.npi.map_or("every NPI".to_owned(), |npi| format!("NPI {npi}"));
        let covered: Vec<&Row> = evidence
            .rows(m.table)
            .iter()
            .filter(|r| r.cell.method == m.method)
            .filter(|r| m.npi.is_none() || r.cell.npi == m.npi)
            .collect();
        let value =
            |r: &&Row| if m.field == Field::Estimate { r.estimate.value } else { r.error.value };
        let computed = mean(covered.iter().map(value));
        let shown = if m.npi.is_some() { format!("{computed:.4}") } else { number(computed) };
        let location = format!("{}, {}, {at}, {field}", m.table, m.method.name());
        [&location, m.printed, m.right, &shown, m.reason].map(str::to_owned).to_vec()
    };
    let head = ["Where", "Printed", "Should be", "Recomputed", "How we know"];
    table(&head, CELLS.iter().map(row))
}

fn means(evidence: &Evidence) -> String {
    let rows = MEANS.iter().flat_map(|listed| {
        let entries = evidence.means(listed.table).iter().filter(|m| m.method == listed.method);
        entries.map(|m| {
            let location = format!("{}, {}, {}", listed.table, m.method.name(), m.parameter);
            let ours = mean(
                evidence
                    .rows(listed.table)
                    .iter()
                    .filter(|r| r.cell.method == m.method && r.cell.parameter == m.parameter)
                    .map(|r| r.error.value),
            );
            vec![
                location,
                m.printed.printed.clone(),
                format!("{:.4}", m.printed.value),
                format!("{ours:.4}"),
                listed.right.to_owned(),
                listed.reason.to_owned(),
            ]
        })
    });
    let head =
        ["Where", "Printed", "Mean of the printed errors", "Recomputed", "Should be", "Remark"];
    table(&head, rows)
}
