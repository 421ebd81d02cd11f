//! Printed tables of the dissertation, and of the paper that it compares with.

use super::{Judge, Row, Status};
use crate::thesis::cells::{self, Judged};
use crate::thesis::interpolated;
use crate::thesis::modal_tables;
use crate::thesis::published::Published;
use crate::thesis::results::Results;
use crate::thesis::verdict::Verdict;

const DIGITS: &str =
    "one unit of the last printed place: a number may have been truncated or rounded twice";

/// Tables with modes in place of parameters.
const MODAL: [&str; 3] = ["E1", "E2", "E-steffen-rade-2"];

/// Compares the printed estimates of all tables with the computed ones.
pub(super) fn estimates(published: &Published, results: &Results) -> Result<Judge, String> {
    let mut rows = Vec::new();
    for number in published.tables().filter(|number| !MODAL.contains(number)) {
        let cells = match number {
            "B1" | "B2" => interpolated::rows(number, published)?,
            _ => cells::rows(number, published, results),
        };
        rows.extend(cells.iter().map(|row| {
            let cell = &row.cell;
            let npi = cell.npi.map_or_else(String::new, |npi| format!(", NPI {npi}"));
            let name = format!("table {number}: {}{npi}, {}", cell.parameter, cell.method.name());
            judged(name, &row.estimate)
        }));
    }
    Ok(Judge {
        name: "Dissertation: estimates",
        source: "V. Mariano, dissertation, UFPB, 1998; tables by their numbers",
        tolerance: DIGITS,
        test: "xtask/tests/golden.rs",
        rows,
    })
}

/// Compares the printed mean errors with the means of the printed errors of their columns.
pub(super) fn means(published: &Published, results: &Results) -> Judge {
    let rows = published.tables().flat_map(|number| {
        let cells = cells::rows(number, published, results);
        cells::means(number, published, &cells).into_iter().map(move |mean| {
            let name = format!(
                "table {number}: mean error of {}, {}, %",
                mean.parameter,
                mean.method.name()
            );
            judged(name, &mean.printed)
        })
    });
    Judge {
        name: "Dissertation: mean errors",
        source: "V. Mariano, dissertation, UFPB, 1998; last rows of the tables",
        tolerance: DIGITS,
        test: "xtask/tests/golden.rs",
        rows: rows.collect(),
    }
}

/// Compares the printed modes of the two-mass system with the computed ones. The dissertation does
/// not print the settings of the identified modes, so only the theoretical modes can be judged to
/// the digit.
pub(super) fn modes(published: &Published) -> Result<Judge, String> {
    let mut rows = Vec::new();
    for number in published.tables().filter(|number| MODAL.contains(number)) {
        for row in modal_tables::rows(number, published)? {
            rows.push(Row {
                quantity: format!(
                    "table {number}: {}, {}",
                    row.cell.parameter,
                    row.cell.method.name()
                ),
                expected: row.cell.estimate.clone(),
                ours: complex(row.value),
                difference_over_tolerance: None,
                status: status(row.verdict, row.reason),
            });
        }
    }
    Ok(Judge {
        name: "Dissertation: modes of two masses",
        source: "V. Mariano, 1998, appendix E, with the values of V. Steffen and D. A. Rade, 1991",
        tolerance: DIGITS,
        test: "xtask/tests/golden.rs",
        rows,
    })
}

fn complex(value: nalgebra::Complex<f64>) -> String {
    if value.im == 0.0 {
        format!("{:.6}", value.re)
    } else {
        format!("{:.6}{:+.6}i", value.re, value.im)
    }
}

fn status(verdict: Verdict, reason: Option<&str>) -> Status {
    match verdict {
        Verdict::ToTheDigit | Verdict::Rounding => Status::Met,
        Verdict::Misprint => Status::Misprint(reason.unwrap_or_default().to_owned()),
        Verdict::Unexplained => Status::Open,
    }
}

fn judged(quantity: String, judged: &Judged) -> Row {
    let places = judged.printed.split_once('.').map_or(0, |(_, fraction)| fraction.len());
    let unit = 10f64.powi(-(places as i32));
    let printed: Option<f64> = judged.printed.parse().ok();
    Row {
        quantity,
        expected: judged.printed.clone(),
        ours: format!("{:.*}", places + 2, judged.value),
        difference_over_tolerance: printed.map(|printed| (judged.value - printed) / unit),
        status: status(judged.verdict, judged.reason),
    }
}
