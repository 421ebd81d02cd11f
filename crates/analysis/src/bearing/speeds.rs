//! Coefficients at several speeds and loads as one table.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use serde::Serialize;

use super::{BearingSummary, CoefficientRow, IdentifiedBearing};

/// Coefficients of a bearing, one row per speed and load.
#[derive(Debug, Serialize)]
pub struct BearingTable {
    /// Results by rising speed, then load.
    pub rows: Vec<BearingSummary>,
}

impl BearingTable {
    /// Sorts results by speed and load.
    pub fn new(found: impl IntoIterator<Item = IdentifiedBearing>) -> Self {
        let mut rows: Vec<BearingSummary> = found.into_iter().map(|one| one.summary).collect();
        let key = |row: &BearingSummary| [row.rotation_hz, row.load].map(|x| x.unwrap_or(0.0));
        rows.sort_by(|a, b| {
            let [a, b] = [key(a), key(b)];
            a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1]))
        });
        Self { rows }
    }

    /// Returns the table as text: `speed` in rad/s, `load` in N, the coefficients kxx … myy (zero where
    /// they were not identified) in SI units, and each with its standard error. The columns without
    /// the load and the errors are the arguments of a bearing element in rotor-dynamics programs.
    pub fn csv(&self) -> String {
        let names =
            ["kxx", "kxy", "kyx", "kyy", "cxx", "cxy", "cyx", "cyy", "mxx", "mxy", "myx", "myy"];
        let mut text = String::from("speed,load");
        for name in names {
            let _ = write!(text, ",{name}");
        }
        for name in names {
            let _ = write!(text, ",{name}_standard_error");
        }
        for row in &self.rows {
            let speed = row.rotation_hz.unwrap_or(0.0) * TAU;
            let load = row.load.map_or(String::new(), |load| format!("{load:?}"));
            let _ = write!(text, "\n{speed:?},{load}");
            let of =
                |name: &str| row.coefficients.iter().find(|c: &&CoefficientRow| c.name == name);
            for name in names {
                let _ = write!(text, ",{:?}", of(name).map_or(0.0, |c| c.estimate.value));
            }
            for name in names {
                let error = of(name).and_then(|c| c.estimate.standard_error);
                let _ = write!(text, ",{:?}", error.unwrap_or(0.0));
            }
        }
        text + "\n"
    }
}
