//! Conversion of columns to SI units, and time axes in a doubtful unit.

use mechid_io::{Quantity, Table, TimeAxis, Unit, escaped};
use mechid_signal::{Sampling, message, quantisation_step};

use super::Reading;
use crate::AnalysisError;
use crate::text::{compact, significant};

/// Use of a column: its name or number, the quantity that it must hold, and the setting that names it.
#[derive(Debug, Clone, Copy)]
pub struct Role<'a> {
    /// Column.
    pub column: &'a String,
    /// Quantity that was measured.
    pub quantity: Quantity,
    /// The setting.
    pub setting: &'static str,
}

/// Factors that convert columns to SI units.
#[derive(Debug, Clone, Default)]
pub struct ToSi {
    /// Factor of each column, in SI units per unit of the column.
    pub factors: Vec<f64>,
    /// Columns in other units, and a time axis that may be.
    pub remarks: Vec<String>,
}

impl ToSi {
    /// Returns the factors for columns with these labels and units; `None` stands for SI.
    ///
    /// # Errors
    /// [`AnalysisError::Unit`] if a unit is one of another quantity.
    pub fn new(
        file: &str,
        columns: impl Iterator<Item = (String, Option<Unit>)>,
        roles: &[Role<'_>],
    ) -> Result<Self, AnalysisError> {
        let (mut factors, mut converted) = (Vec::new(), Vec::new());
        for ((label, unit), role) in columns.zip(roles) {
            let Some(unit) = unit else {
                factors.push(1.0);
                continue;
            };
            if unit.quantity != role.quantity {
                return Err(AnalysisError::Unit {
                    file: file.into(),
                    column: label,
                    unit: unit.name,
                    measures: unit.quantity,
                    setting: role.setting,
                    wanted: role.quantity,
                });
            }
            if unit.in_si != 1.0 {
                converted.push(format!("{label} in {}", unit.name));
            }
            factors.push(unit.in_si);
        }
        let remark = (!converted.is_empty())
            .then(|| format!("{file}: converted to SI units: {}", converted.join(", ")));
        Ok(Self { factors, remarks: remark.into_iter().collect() })
    }

    /// Returns the factors by the units that the columns of `table` say.
    ///
    /// # Errors
    /// As [`ToSi::new`], and if there is no such column.
    pub fn of_table(table: &Table, roles: &[Role<'_>]) -> Result<Self, AnalysisError> {
        let places = roles.iter().map(|role| table.find(role.column));
        let places: Vec<usize> = places.collect::<Result<_, _>>()?;
        let columns = places.iter().map(|at| (table.label(*at), table.unit(*at)));
        let mut all = Self::new(table.file(), columns, roles)?;
        all.remarks.extend(places.iter().zip(roles).filter_map(|(at, role)| {
            let unit = table.unknown_unit(*at)?;
            Some(format!(
                "{}: the unit {} of {} is not known: its numbers are taken as {}",
                table.file(),
                escaped(unit),
                table.label(*at),
                role.quantity.si()
            ))
        }));
        Ok(all)
    }

    /// Returns the factor of a column; 1 where there is no such column.
    pub fn factor(&self, column: usize) -> f64 {
        self.factors.get(column).copied().unwrap_or(1.0)
    }
}

/// Relative difference of two sampling rates that are one: a time column is printed with some digits.
const SAME_RATE: f64 = 1e-4;

/// Returns a remark if the sampling rate that was asked for is not that of the file: of its time column, or of a number
/// that states it by its name (`Fs`).
pub(crate) fn contradicted_rate(table: &Table, reading: &Reading) -> Option<String> {
    let rate_hz = reading.sample_rate_hz?;
    let of_file = Reading { sample_rate_hz: None, ..reading.clone() };
    let time = of_file.time_axis(table)?;
    let own_hz = table.sampling(&time, &[] as &[&str]).ok()?.rate_hz();
    if (own_hz - rate_hz).abs() <= SAME_RATE * rate_hz {
        return None;
    }
    let source = match (&time, table.stated_rate()) {
        (TimeAxis::Column(name), _) => format!("column {}", table.label(table.find(name).ok()?)),
        (_, Some((name, value))) => format!("{} = {}", escaped(name), message::number(*value)),
        _ => return None,
    };
    let [rate, own] = [rate_hz, own_hz].map(|hz| compact(hz, 8));
    Some(format!("{}: `sample_rate` {rate} Hz is used; {source} says {own} Hz", table.file()))
}

/// Sampling rate, in Hz, below which a time column without a unit is doubtful whatever its length:
/// structures that need no more swing in minutes. Milliseconds taken as seconds look so at all rates
/// up to 2 kHz, numbers of samples at any.
const SLOW_HZ: f64 = 2.0;

/// Sampling rate, in Hz, below which records longer than [`LONG_S`] are doubtful: buildings are
/// sampled so, but seldom without a unit. Milliseconds look so at all rates up to 20 kHz in records
/// of a second or more.
const RATHER_SLOW_HZ: f64 = 20.0;

/// Duration, in s, from which [`RATHER_SLOW_HZ`] holds.
const LONG_S: f64 = 1000.0;

/// Returns a remark if a time column without a unit gives a record so slow and long that it may be in
/// milliseconds.
pub(crate) fn doubtful_time(
    table: &Table,
    time: &TimeAxis<'_>,
    sampling: Sampling,
) -> Option<String> {
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
        "{}: the time in column {} has no unit and is taken as seconds: {} Hz, {} s long; if it is in \
         ms, call it {name}_ms in the file or give `sample_rate` {}; if in s, {name}_s",
        table.file(),
        table.label(column),
        compact(rate_hz, 6),
        compact(long_s, 6),
        compact(1000.0 * rate_hz, 8),
    ))
}

/// Error of a sampling rate by the digits of its time column, relative to the rate, from which frequencies may be known
/// less well for it than for the noise.
const RATE_ERROR: f64 = 1e-5;

/// Rounding over the time step, below which instants are rounded ones.
const EVEN: f64 = 0.99;

/// Returns a remark if the digits of a time column leave the sampling rate so uncertain that frequencies suffer.
pub(crate) fn coarse_time(
    table: &Table,
    time: &TimeAxis<'_>,
    sampling: Sampling,
) -> Option<String> {
    let TimeAxis::Column(name) = time else { return None };
    let instants = table.column(name).ok()?;
    let (first, last) = (instants.first()?, instants.last()?);
    let per_sample = (last - first) / (instants.len() - 1) as f64;
    // Even instants are multiples of their own step.
    let rounding = quantisation_step(instants)? / per_sample;
    let error = rounding / sampling.len() as f64;
    (rounding < EVEN && error > RATE_ERROR).then(|| {
        format!(
            "{}: the instants of {} are rounded to {} s, which leaves the sampling rate, {} Hz, uncertain by up to {} % \
             and all frequencies with it: give `sample_rate`",
            table.file(),
            table.label(table.find(name).unwrap_or_default()),
            significant(rounding * sampling.dt(), 2),
            compact(sampling.rate_hz(), 6),
            significant(100.0 * error, 2)
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(rate_hz: f64, samples: usize, decimals: usize) -> Option<String> {
        let row = |k: usize| format!("{:.decimals$},0\n", k as f64 / rate_hz);
        let text: String = (0..samples).map(row).collect();
        let table = Table::parse("a.csv", format!("time,x\n{text}").as_bytes()).unwrap();
        let time = TimeAxis::Column("time");
        let sampling = table.sampling(&time, &["x"]).unwrap();
        coarse_time(&table, &time, sampling)
    }

    /// Judge: half a unit of the last digit at either end, over the duration of the record.
    #[test]
    fn instants_that_leave_the_rate_open_are_told() {
        // A millisecond in 7.8125 s.
        let coarse = told(512.0, 4000, 3).unwrap();
        assert!(coarse.contains("0.013 %"), "{coarse}");
        assert_eq!(told(512.0, 4096, 7), None);
        // Steps of a millisecond are no rounding.
        assert_eq!(told(1000.0, 4096, 3), None);
        assert_eq!(told(25_600.0, 40_000, 6), None);
    }
}
