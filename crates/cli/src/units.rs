//! Columns in units other than those of the SI.

use mechid::io::{Quantity, Table};
use nalgebra::DMatrix;

use crate::error::CliError;

/// What a column is used for: its name or number, what it is to hold, and the option that says so.
pub type Role<'a> = (&'a String, Quantity, &'static str);

/// How columns become SI units.
#[derive(Debug, Default)]
pub struct ToSi {
    /// One per column.
    factors: Vec<f64>,
    /// Which columns were in other units; nothing if none was.
    pub remark: Option<String>,
}

impl ToSi {
    /// By the units that the columns of `table` say.
    pub fn of(table: &Table, roles: &[Role<'_>]) -> Result<Self, CliError> {
        let (mut factors, mut other) = (Vec::new(), Vec::new());
        for (column, wanted, option) in roles {
            let at = table.find(column)?;
            let Some(unit) = table.unit(at) else {
                factors.push(1.0);
                continue;
            };
            if unit.quantity != *wanted {
                return Err(CliError::Unit {
                    file: table.file().into(),
                    column: table.label(at),
                    unit: unit.name,
                    measures: unit.quantity,
                    option,
                    wanted: *wanted,
                });
            }
            if unit.in_si != 1.0 {
                other.push(format!("{} in {}", table.label(at), unit.name));
            }
            factors.push(unit.in_si);
        }
        let remark = (!other.is_empty())
            .then(|| format!("{}: converted to SI units: {}", table.file(), other.join(", ")));
        Ok(Self { factors, remark })
    }

    /// What a column is multiplied by; 1 where there is no such column.
    pub fn factor(&self, column: usize) -> f64 {
        self.factors.get(column).copied().unwrap_or(1.0)
    }

    /// Converts samples × columns.
    pub fn convert(&self, data: &mut DMatrix<f64>) {
        for (mut column, factor) in data.column_iter_mut().zip(&self.factors) {
            column *= *factor;
        }
    }
}
