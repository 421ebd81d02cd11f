//! The dissertation's tables as CSV and Markdown, printed values next to computed ones.

use std::fmt::Write as _;

use nalgebra::Complex;

use super::cells::{self, Mean, Row};
use super::modal_tables::{self, ModalRow};
use super::published::{Cell, Published};
use super::results::Results;
use super::sheet::{Sheet, exact, short};
use super::verdict::Verdict;
use super::{interpolated, slips::Slip};

/// One reproduced table.
#[derive(Debug, Clone)]
pub struct Table {
    /// Number of the table in the dissertation.
    pub number: String,
    /// Table as CSV with all digits, for the comparison with the golden file.
    pub csv: String,
    /// Table in Markdown, for readers.
    pub markdown: String,
}

/// Every table.
///
/// # Errors
/// The message of the estimation that fails.
pub fn all(published: &Published, results: &Results) -> Result<Vec<Table>, String> {
    published.tables().map(|number| table(number, published, results)).collect()
}

fn table(number: &str, published: &Published, results: &Results) -> Result<Table, String> {
    let cells: Vec<&Cell> = published.table(number).collect();
    match number {
        "5.2.1" | "5.6.1" => Ok(adopted(number, &cells)),
        "E1" | "E2" | "E-steffen-rade-2" => {
            Ok(modal(number, &modal_tables::rows(number, published)?))
        }
        "B1" | "B2" => Ok(identification(number, &interpolated::rows(number, published)?, &[])),
        _ => {
            let rows = cells::rows(number, published, results);
            let means = cells::means(number, published, &rows);
            Ok(identification(number, &rows, &means))
        }
    }
}

fn identification(number: &str, rows: &[Row], means: &[Mean]) -> Table {
    let mut csv = Sheet::new(&[
        "parameter",
        "domain",
        "nt",
        "npi",
        "method",
        "printed",
        "reproduced",
        "verdict",
        "reason",
        "printed_error_percent",
        "reproduced_error_percent",
        "error_verdict",
        "error_reason",
        "correct",
        "correct_error_percent",
        "best",
        "best_error_percent",
    ]);
    let mut sheet = Sheet::new(&[
        "",
        "NPI",
        "Method",
        "Printed",
        "Reproduced",
        "Verdict",
        "Printed error %",
        "Reproduced error %",
        "Verdict",
        "Without slips",
        "Error %",
        "Best estimator",
        "Error %",
    ]);
    for row in rows {
        csv.rows.push(exact_row(row));
        sheet.rows.push(short_row(row));
    }
    for mean in means {
        csv.rows.push(exact_mean(mean));
        sheet.rows.push(short_mean(mean));
    }
    let markdown = format!("{}\n{}", heading(number, rows), sheet.to_markdown());
    Table { number: number.to_owned(), csv: csv.to_csv(), markdown }
}

fn exact_row(row: &Row) -> Vec<String> {
    let cell = &row.cell;
    let text = |s: &str| s.to_owned();
    vec![
        cell.parameter.clone(),
        cell.domain.clone(),
        cell.nt.map_or_else(String::new, |n| n.to_string()),
        cell.npi.map_or_else(String::new, |n| n.to_string()),
        text(cell.method.key()),
        row.estimate.printed.clone(),
        exact(row.estimate.value),
        text(row.estimate.verdict.words()),
        text(row.estimate.reason.unwrap_or_default()),
        row.error.printed.clone(),
        exact(row.error.value),
        text(row.error.verdict.words()),
        text(row.error.reason.unwrap_or_default()),
        exact(row.correct),
        exact(row.correct_error),
        exact(row.best),
        exact(row.best_error),
    ]
}

fn short_row(row: &Row) -> Vec<String> {
    let cell = &row.cell;
    vec![
        cell.parameter.clone(),
        cell.npi.map_or_else(String::new, |n| n.to_string()),
        cell.method.name().to_owned(),
        row.estimate.printed.clone(),
        short(row.estimate.value),
        verdict(row.estimate.verdict, row.estimate.reason),
        row.error.printed.clone(),
        short(row.error.value),
        verdict(row.error.verdict, row.error.reason),
        short(row.correct),
        short(row.correct_error),
        short(row.best),
        short(row.best_error),
    ]
}

fn exact_mean(mean: &Mean) -> Vec<String> {
    let mut row = vec![String::new(); 17];
    row[0].clone_from(&mean.parameter);
    row[3] = "mean".to_owned();
    row[4] = mean.method.key().to_owned();
    row[9].clone_from(&mean.printed.printed);
    row[10] = exact(mean.printed.value);
    row[11] = mean.printed.verdict.words().to_owned();
    row[12] = mean.printed.reason.unwrap_or_default().to_owned();
    row[14] = exact(mean.correct);
    row[16] = exact(mean.best);
    row
}

fn short_mean(mean: &Mean) -> Vec<String> {
    let mut row = vec![String::new(); 13];
    row[0].clone_from(&mean.parameter);
    row[1] = "mean".to_owned();
    row[2] = mean.method.name().to_owned();
    row[6].clone_from(&mean.printed.printed);
    row[7] = short(mean.printed.value);
    row[8] = verdict(mean.printed.verdict, mean.printed.reason);
    row[10] = short(mean.correct);
    row[12] = short(mean.best);
    row
}

fn verdict(verdict: Verdict, reason: Option<&str>) -> String {
    reason.map_or_else(|| verdict.words().to_owned(), |r| format!("{}: {r}", verdict.words()))
}

fn heading(number: &str, rows: &[Row]) -> String {
    let mut text = format!("# Table {number}\n\n");
    let Some(cell) = rows.first().map(|r| &r.cell) else { return text };
    let mut parameters: Vec<&str> = Vec::new();
    for row in rows {
        if !parameters.contains(&row.cell.parameter.as_str()) {
            parameters.push(&row.cell.parameter);
        }
    }
    let machine =
        if cell.parameter.len() == 3 { "journal bearing" } else { "single degree of freedom" };
    let nt = cell.nt.map_or_else(String::new, |n| format!(", Nt = {n}"));
    let _ = writeln!(
        text,
        "{} of the {machine}, identified in the {} domain{nt}. Stiffness in N/m, damping in N·s/m.\n",
        parameters.join(", "),
        cell.domain
    );
    let count = |v| rows.iter().filter(|r| r.estimate.verdict == v).count();
    let counts: Vec<String> = Verdict::ALL
        .into_iter()
        .filter(|v| count(*v) > 0)
        .map(|v| format!("{} {}", count(v), v.words()))
        .collect();
    let _ = writeln!(text, "Of {} printed estimates: {}.\n", rows.len(), counts.join(", "));
    if number.starts_with('B') {
        text.push_str("Neither the integrator nor the procedure is named in the text; *Reproduced* is Newmark with displacement, velocity and force refined by straight lines.\n\n");
    } else {
        let replayed: Vec<&str> = Slip::for_table(number).into_iter().map(Slip::name).collect();
        let _ = writeln!(
            text,
            "*Reproduced* replays these slips: {}. *Without slips* is the same estimator on the same scheme, nothing misplaced (Runge-Kutta with a linear mid-step force). *Best estimator* is the exact first-order-hold fit on that response: what error it leaves is the integrator's.\n",
            replayed.join(", ")
        );
    }
    text
}

fn modal(number: &str, rows: &[ModalRow]) -> Table {
    let mut csv = Sheet::new(&[
        "parameter",
        "method",
        "printed",
        "reproduced_re",
        "reproduced_im",
        "verdict",
        "reason",
        "best_re",
        "best_im",
    ]);
    let mut sheet =
        Sheet::new(&["", "Method", "Printed", "Computed", "Verdict", "Without Euler's bias"]);
    for row in rows {
        let best = row.best.unwrap_or(Complex::new(f64::NAN, f64::NAN));
        csv.rows.push(vec![
            row.cell.parameter.clone(),
            row.cell.method.key().to_owned(),
            row.cell.estimate.clone(),
            exact(row.value.re),
            exact(row.value.im),
            row.verdict.words().to_owned(),
            row.reason.unwrap_or_default().to_owned(),
            exact(best.re),
            exact(best.im),
        ]);
        sheet.rows.push(vec![
            row.cell.parameter.replace('_', " "),
            row.cell.method.name().to_owned(),
            row.cell.estimate.clone(),
            complex(row.value),
            verdict(row.verdict, row.reason),
            row.best.map_or_else(|| "–".to_owned(), complex),
        ]);
    }
    let markdown = format!(
        "# Table {number}\n\nModal parameters of the two-mass system of Steffen & Rade (1991): damped frequency in Hz, damping factor, eigenvector ratio y2/y1 (the heads of the printed columns say y1/y2). The step size and the forced mass of the identified rows are not printed; ours: {}.\n\n{}",
        modal_tables::SETTING,
        sheet.to_markdown()
    );
    Table { number: number.to_owned(), csv: csv.to_csv(), markdown }
}

fn complex(value: Complex<f64>) -> String {
    if value.im == 0.0 { short(value.re) } else { format!("{:.4}{:+.4}i", value.re, value.im) }
}

fn adopted(number: &str, cells: &[&Cell]) -> Table {
    let mut sheet = Sheet::new(&["parameter", "adopted"]);
    sheet.rows = cells.iter().map(|c| vec![c.parameter.clone(), c.estimate.clone()]).collect();
    let markdown = format!(
        "# Table {number}\n\nValues adopted for the simulations (SI units), as printed; they are inputs, not results.\n\n{}",
        sheet.to_markdown()
    );
    Table { number: number.to_owned(), csv: sheet.to_csv(), markdown }
}
