//! Conversion of columns to SI units, and time axes with a doubtful unit.

use mechid_checks::{Finding, TimeUnit};
use mechid_io::{Evidence, Quantity, StatedUnit, Table, TimeAxis, escaped};
use mechid_signal::{Sampling, message, quantisation_step};

use super::Reading;
use crate::AnalysisError;
use crate::text::{compact, significant};

/// Use of a column: its name or number, its required quantity, and its setting.
#[derive(Debug, Clone, Copy)]
pub struct Role<'a> {
    /// Column.
    pub column: &'a String,
    /// Measured quantity.
    pub quantity: Quantity,
    /// Setting that names the column.
    pub setting: &'static str,
}

/// Factors that convert columns to SI units.
#[derive(Debug, Clone, Default)]
pub struct ToSi {
    /// Factor of each column, in SI units per unit of the column.
    pub factors: Vec<f64>,
    /// Remarks about columns that were not in SI units, and about a time axis in a doubtful unit.
    pub remarks: Vec<String>,
    /// Findings on texts in headers that may be units.
    pub findings: Vec<Finding>,
}

impl ToSi {
    /// Returns the factors for columns with these labels and the units stated in their headers.
    ///
    /// # Errors
    /// [`AnalysisError::Unit`] if a unit belongs to another quantity.
    pub fn new(
        file: &str,
        columns: impl Iterator<Item = (String, Option<StatedUnit>)>,
        roles: &[Role<'_>],
    ) -> Result<Self, AnalysisError> {
        let (mut to_si, mut converted) = (Self::default(), Vec::new());
        for ((label, stated), role) in columns.zip(roles) {
            let used = stated.as_ref().and_then(StatedUnit::used);
            if let Some(unit) = used.filter(|unit| unit.quantity != role.quantity) {
                return Err(AnalysisError::Unit {
                    file: file.into(),
                    column: label,
                    unit: unit.name.clone(),
                    measures: unit.quantity,
                    setting: role.setting,
                    wanted: role.quantity,
                });
            }
            to_si.factors.push(used.map_or(1.0, |unit| unit.in_si));
            if let Some(unit) = used.filter(|unit| unit.in_si != 1.0) {
                converted.push(format!("{label} in {}", escaped(&unit.name)));
            }
            to_si.findings.extend(stated.and_then(|stated| doubt(&label, &stated, role.quantity)));
        }
        if !converted.is_empty() {
            to_si.remarks.push(format!("{file}: converted to SI units: {}", converted.join(", ")));
        }
        Ok(to_si)
    }

    /// Returns the factors from the units in the headers of `table`.
    ///
    /// # Errors
    /// As [`ToSi::new`]; also an error if the table has no column of a role.
    pub fn from_table(table: &Table, roles: &[Role<'_>]) -> Result<Self, AnalysisError> {
        let places = roles.iter().map(|role| Ok((table.find(role.column)?, role.quantity)));
        let places: Vec<_> = places.collect::<Result<_, AnalysisError>>()?;
        let columns = places
            .iter()
            .map(|(at, quantity)| (table.label(*at), table.stated_unit(*at, Some(*quantity))));
        Self::new(table.file(), columns, roles)
    }

    /// Returns the factor that converts a column to SI units; 1 if the column does not exist.
    pub fn factor(&self, column: usize) -> f64 {
        self.factors.get(column).copied().unwrap_or(1.0)
    }
}

/// Returns a finding if it is doubtful whether a text in a header is a unit.
pub(crate) fn doubt(column: &str, stated: &StatedUnit, wanted: Quantity) -> Option<Finding> {
    let unit = stated.unit.as_ref().filter(|unit| unit.quantity == wanted);
    (stated.evidence != Evidence::Stated).then(|| {
        Finding::Unit(mechid_checks::Unit {
            column: column.into(),
            text: escaped(&stated.text).to_string(),
            factor: unit.map(|unit| unit.in_si),
            used: stated.evidence == Evidence::Likely,
            si: wanted.si(),
        })
    })
}

/// Returns a remark if the header of a column contains a text that may be a unit, of any quantity.
pub(crate) fn doubtful_unit(table: &Table, column: usize) -> Option<String> {
    let stated = table.stated_unit(column, None)?;
    if stated.evidence == Evidence::Stated || table.values(column).is_err() {
        return None;
    }
    let what = match &stated.unit {
        Some(unit) => format!(
            "may be a unit; its factor {} for the conversion to {} {}",
            message::number(unit.in_si),
            unit.quantity.si(),
            match stated.evidence {
                Evidence::Likely => "is applied where the column is used",
                _ => "is not applied where the column is used",
            }
        ),
        None => "is not understood".into(),
    };
    Some(format!(
        "unit: \"{}\" in the header of column {} {what}: state the unit (`unit`) or the factor (`scale`)",
        escaped(&stated.text),
        table.label(column)
    ))
}

/// Maximum relative difference between two sampling rates that count as equal: a time column may
/// have few digits, so its rate is not exact.
const SAME_RATE: f64 = 1e-4;

/// Returns a remark if the given sampling rate differs from the rate of the file, which its time
/// column or a number with the name of a sampling rate (`Fs`) gives.
pub(crate) fn contradicted_rate(table: &Table, reading: &Reading) -> Option<String> {
    let [rate, source, of_file] = two_rates(table, reading)?;
    Some(format!("{}: `sample_rate` {rate} Hz is used; {source} says {of_file} Hz", table.file()))
}

/// Refuses a sampling rate that contradicts the time column, if both are given.
///
/// # Errors
/// [`AnalysisError::Setting`].
pub(crate) fn check_rate(table: &Table, reading: &Reading) -> Result<(), AnalysisError> {
    let rates = reading.time.as_ref().and_then(|_| two_rates(table, reading));
    let Some([rate, source, of_file]) = rates else { return Ok(()) };
    let file = table.file();
    let why = format!(
        "{file}: {source} says {of_file} Hz, and `sample_rate` is {rate} Hz: leave one of them out"
    );
    Err(AnalysisError::Setting { setting: "time", why })
}

/// Returns the given sampling rate in Hz, the source of another rate in the file, and this rate in
/// Hz; `None` if there is no other rate.
fn two_rates(table: &Table, reading: &Reading) -> Option<[String; 3]> {
    let rate_hz = reading.sample_rate_hz?;
    let of_file = Reading { sample_rate_hz: None, ..reading.clone() };
    let time = of_file.time_axis(table)?;
    let file_hz = table.sampling(&time, &[] as &[&str]).ok()?.rate_hz();
    if (file_hz - rate_hz).abs() <= SAME_RATE * rate_hz {
        return None;
    }
    let source = match (&time, table.stated_rate()) {
        (TimeAxis::Column(name), _) => format!("column {}", table.label(table.find(name).ok()?)),
        (_, Some((name, value))) => format!("{} = {}", escaped(name), message::number(*value)),
        _ => return None,
    };
    let [rate, of_file] = [rate_hz, file_hz].map(|hz| compact(hz, 8));
    Some([rate, source, of_file])
}

/// Maximum sampling rate, in Hz, that makes a time column without a unit doubtful, in a record of
/// any length: only very slow structures are measured at such a rate. Milliseconds that are read as
/// seconds give such a rate if the true rate is at most 2 kHz. Sample numbers that are read as
/// seconds give it for every true rate.
const SLOW_HZ: f64 = 2.0;

/// Maximum sampling rate, in Hz, that makes a time column without a unit doubtful in records of at
/// least [`LONG_S`]: records of buildings have such rates, but seldom without a unit. Milliseconds
/// that are read as seconds give such a rate for true rates up to 20 kHz, in records of at least a
/// second.
const RATHER_SLOW_HZ: f64 = 20.0;

/// Minimum duration, in s, for the limit [`RATHER_SLOW_HZ`].
const LONG_S: f64 = 1000.0;

/// Minimum sampling rate, in Hz, that is doubtful for a time column without a unit. No force or
/// response needs such a high rate, but day numbers that are read as seconds give such a rate.
const FAST_HZ: f64 = 1e7;

/// Minimum sampling rate, in Hz, that is doubtful if the instants are at least [`DAY_NUMBERS`]:
/// samples at 1 Hz have this rate if their day numbers are read as seconds.
const RATHER_FAST_HZ: f64 = 86_400.0;

/// Smallest instant that may be a day number: 20,000 is a day of 1954 in a spreadsheet.
const DAY_NUMBERS: f64 = 20_000.0;

/// Number of seconds in a day.
const DAY_S: f64 = 86_400.0;

/// Returns a finding if a time column has a doubtful unit. Without a unit, the column may be in
/// milliseconds or a smaller unit if the sampling rate is very low, or low in a long record. It may
/// be in days if the rate is very high, or high with instants that may be day numbers.
pub(crate) fn doubtful_time(
    table: &Table,
    time: &TimeAxis<'_>,
    sampling: Sampling,
) -> Option<Finding> {
    let TimeAxis::Column(name) = time else { return None };
    let column = table.find(name).ok()?;
    if let Some(stated) = table.doubtful_time_unit(column) {
        return doubt(&table.label(column), &stated, Quantity::Time);
    }
    let (rate_hz, duration_s) = (1.0 / sampling.dt(), sampling.len() as f64 * sampling.dt());
    let first = table.values(column).ok().and_then(|times| times.first().copied()).unwrap_or(0.0);
    let is_slow = rate_hz <= SLOW_HZ || (rate_hz <= RATHER_SLOW_HZ && duration_s >= LONG_S);
    let is_fast = rate_hz >= FAST_HZ || (rate_hz >= RATHER_FAST_HZ && first >= DAY_NUMBERS);
    if !(is_slow || is_fast) || table.says_unit_of_time(column) {
        return None;
    }
    // The result is the largest unit of time that gives a plausible sampling rate.
    let small = [("ms", 1e-3), ("µs", 1e-6), ("ns", 1e-9)];
    let small = small.into_iter().find(|(_, size)| rate_hz / size > SLOW_HZ);
    let (unit, factor) = if is_slow { small.unwrap_or(("ms", 1e-3)) } else { ("days", DAY_S) };
    let column = table.label(column);
    Some(Finding::TimeUnit(TimeUnit { column, rate_hz, duration_s, unit, factor }))
}

/// Minimum relative error of a sampling rate that causes a remark. The error comes from the rounded
/// times of the time column; a smaller error is negligible against the errors that noise causes in
/// identified frequencies.
const RATE_ERROR: f64 = 1e-5;

/// Maximum ratio of the quantisation step of instants to their time step if the instants are
/// rounded. Instants that are exact multiples of the time step have the ratio 1.
const EVEN: f64 = 0.99;

/// Returns a remark if the digits of a time column make the sampling rate so uncertain that the
/// frequencies are affected.
pub(crate) fn coarse_time(
    table: &Table,
    time: &TimeAxis<'_>,
    sampling: Sampling,
) -> Option<String> {
    let TimeAxis::Column(name) = time else { return None };
    let instants = table.column(name).ok()?;
    let (first, last) = (instants.first()?, instants.last()?);
    let per_sample = (last - first) / (instants.len() - 1) as f64;
    // Exact instants are multiples of the time step; the quantisation step is then the time step
    // itself.
    let rounding = quantisation_step(instants)? / per_sample;
    let error = rounding / sampling.len() as f64;
    (rounding < EVEN && error > RATE_ERROR).then(|| {
        format!(
            "{}: the times of {} are rounded to {} s, so the sampling rate of {} Hz and all frequencies \
             are uncertain by up to {} %: give `sample_rate`",
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

    /// A remark reports the uncertainty of the sampling rate if the instants have too few digits.
    /// The expected uncertainty is half a unit of the last digit at each end, divided by the
    /// duration of the record.
    #[test]
    fn coarse_instants_are_reported() {
        // The instants have three decimals, so the uncertainty is one millisecond in 7.8125 s.
        let coarse = told(512.0, 4000, 3).unwrap();
        assert!(coarse.contains("0.013 %"), "{coarse}");
        assert_eq!(told(512.0, 4096, 7), None);
        // Instants in steps of exactly one millisecond are not rounded.
        assert_eq!(told(1000.0, 4096, 3), None);
        assert_eq!(told(25_600.0, 40_000, 6), None);
    }
}
