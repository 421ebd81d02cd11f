//! Printed numbers that are wrong, each with its reason.

use super::published::Method;

/// Number that is misprinted in a cell: the estimate or its error.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Field {
    /// The estimate.
    Estimate,
    /// The error in per cent.
    Error,
}

/// A printed number known to be wrong.
#[derive(Debug, Clone, Copy)]
pub struct Misprint {
    /// Table of the misprint.
    pub table: &'static str,
    /// Column.
    pub method: Method,
    /// NPI of the row; `None` if the whole column is misprinted.
    pub npi: Option<f64>,
    /// Number that is misprinted.
    pub field: Field,
    /// Printed value; a dash if a whole column is misprinted.
    pub printed: &'static str,
    /// Right value.
    pub right: &'static str,
    /// Reason.
    pub reason: &'static str,
}

const fn cell(
    table: &'static str,
    method: Method,
    npi: f64,
    field: Field,
    texts: [&'static str; 3],
) -> Misprint {
    let [printed, right, reason] = texts;
    Misprint { table, method, npi: Some(npi), field, printed, right, reason }
}

const fn column(
    table: &'static str,
    method: Method,
    field: Field,
    right: &'static str,
) -> Misprint {
    Misprint {
        table,
        method,
        npi: None,
        field,
        printed: "–",
        right,
        reason: "the sign of the whole column is lost or reversed",
    }
}

/// The cells of the identification tables that are printed wrongly.
pub const CELLS: &[Misprint] = &[
    cell(
        "5.2.4",
        Method::Newmark,
        4.0,
        Field::Estimate,
        ["4936", "4963", "digits transposed: table 5.2.2 prints 4963 with the same error"],
    ),
    cell(
        "5.6.10",
        Method::Houbolt,
        16.0,
        Field::Error,
        ["10.13", "13.10", "digits transposed: the printed estimate gives 13.1 %"],
    ),
    cell(
        "A5",
        Method::Newmark,
        2.0,
        Field::Error,
        ["10.23", "10.32", "digits transposed: the printed estimate gives 10.3 %"],
    ),
    cell(
        "5.2.3",
        Method::WilsonTheta,
        14.0,
        Field::Error,
        ["60.31", "60.30", "recomputed 60.302 %"],
    ),
    cell(
        "5.2.5",
        Method::Newmark,
        2.8,
        Field::Error,
        ["1.39", "1.40", "recomputed 1.403 %; repeats the neighbouring rows"],
    ),
    cell(
        "5.2.5",
        Method::Houbolt,
        3.0,
        Field::Error,
        ["34.92", "34.97", "recomputed 34.970 %; repeats the row above"],
    ),
    cell("5.7.5", Method::Houbolt, 20.0, Field::Error, ["19.77", "19.75", "recomputed 19.758 %"]),
    column("5.6.9", Method::WilsonTheta, Field::Estimate, "−0.87 … −9.65"),
    column("5.6.9", Method::WilsonTheta, Field::Error, "102.9 … 132.1"),
    column("5.6.17", Method::WilsonTheta, Field::Estimate, "+1.53 … −10.09"),
    column("5.3.2", Method::CentralDifference, Field::Estimate, "−72 … −289"),
    column("5.3.2", Method::CentralDifference, Field::Error, "140.0 … 260.9"),
    column("5.6.17", Method::WilsonTheta, Field::Error, "94.8 … 133.6"),
];

/// A mean-error entry that is not the mean of its column.
#[derive(Debug, Clone, Copy)]
pub struct MeanMisprint {
    /// Table of the misprint.
    pub table: &'static str,
    /// Column.
    pub method: Method,
    /// Right value.
    pub right: &'static str,
    /// Remark.
    pub reason: &'static str,
}

/// The entries of the mean-error rows that are printed wrongly.
pub const MEANS: &[MeanMisprint] = &[
    MeanMisprint {
        table: "5.7.6",
        method: Method::Newmark,
        right: "10.15",
        reason: "12.68 is printed; it resembles the Runge-Kutta mean beside it and changes the ranking",
    },
    MeanMisprint {
        table: "5.7.8",
        method: Method::Rk4,
        right: "41.77",
        reason: "the printed errors average 41.775",
    },
    MeanMisprint {
        table: "5.2.5",
        method: Method::Newmark,
        right: "1.33",
        reason: "the printed errors average 1.3336",
    },
    MeanMisprint {
        table: "5.2.5",
        method: Method::Houbolt,
        right: "35.04",
        reason: "the printed errors average 35.0427",
    },
    MeanMisprint {
        table: "5.3.2",
        method: Method::Houbolt,
        right: "35.13",
        reason: "the printed errors average 35.135",
    },
    MeanMisprint {
        table: "5.2.4",
        method: Method::CentralDifference,
        right: "2.15",
        reason: "the printed errors average 2.150 exactly",
    },
    MeanMisprint {
        table: "5.6.10",
        method: Method::Houbolt,
        right: "8.71",
        reason: "right sum of a column that holds the transposed 10.13",
    },
    MeanMisprint {
        table: "5.6.9",
        method: Method::WilsonTheta,
        right: "127.6",
        reason: "right sum of errors formed without the minus sign",
    },
    MeanMisprint {
        table: "5.6.17",
        method: Method::WilsonTheta,
        right: "116.0",
        reason: "right sum of errors formed with the reversed sign",
    },
];

/// Returns the misprint that a printed number belongs to, if there is one.
pub fn find(
    table: &str,
    method: Method,
    npi: Option<f64>,
    field: Field,
) -> Option<&'static Misprint> {
    CELLS.iter().find(|m| {
        m.table == table
            && m.method == method
            && m.field == field
            && (m.npi.is_none() || m.npi == npi)
    })
}
