//! Columns in units other than those of the SI, and times that may be.

use mechid::io::{Quantity, Table, TimeAxis};
use mechid::signal::Sampling;
use nalgebra::DMatrix;

use crate::error::CliError;
use crate::text_table::compact;

/// What a column is used for: its name or number, what it is to hold, and the option that says so.
pub type Role<'a> = (&'a String, Quantity, &'static str);

/// How columns become SI units.
#[derive(Debug, Default)]
pub struct ToSi {
    /// One per column.
    factors: Vec<f64>,
    /// Which columns were in other units, and whether the time may be.
    pub remarks: Vec<String>,
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
        Ok(Self { factors, remarks: remark.into_iter().collect() })
    }

    /// The same, with what is to be said of the time axis of the whole record.
    pub fn at_instants(mut self, table: &Table, time: &TimeAxis<'_>, sampling: Sampling) -> Self {
        self.remarks.extend(doubtful_time(table, time, sampling));
        self
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

/// Vibration is seldom sampled as slowly as this, in Hz: structures that need no more swing in
/// minutes. Milliseconds taken as seconds look so at all rates up to 2 kHz, numbers of samples at any.
const SLOW_HZ: f64 = 2.0;

/// Nor as slowly as this, in Hz, for as long as [`LONG_S`]: buildings are, but seldom without a unit.
/// Milliseconds look so at all rates up to 20 kHz in records of a second or more.
const RATHER_SLOW_HZ: f64 = 20.0;

/// In s.
const LONG_S: f64 = 1000.0;

/// That a column of instants without a unit gives a record as slow and long as few are, if it does:
/// it may be in milliseconds.
pub fn doubtful_time(table: &Table, time: &TimeAxis<'_>, sampling: Sampling) -> Option<String> {
    let TimeAxis::Column(name) = time else { return None };
    let column = table.find(name).ok()?;
    let (rate_hz, long_s) = (1.0 / sampling.dt(), sampling.len() as f64 * sampling.dt());
    let doubtful = rate_hz <= SLOW_HZ || (rate_hz <= RATHER_SLOW_HZ && long_s >= LONG_S);
    if !doubtful || table.says_unit_of_time(column) {
        return None;
    }
    let name = match table.names()[column].trim() {
        "" => "time",
        name => name,
    };
    Some(format!(
        "{}: the time in column {} says no unit and is taken as seconds: {} Hz, {} s long; if it is in \
         ms, call it {name}_ms in the file or give --sample-rate {}, if in s, {name}_s",
        table.file(),
        table.label(column),
        compact(rate_hz, 6),
        compact(long_s, 6),
        compact(1000.0 * rate_hz, 8),
    ))
}
