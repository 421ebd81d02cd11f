//! Trends of the results of many records: parameters over records, outliers, failures.

use std::collections::BTreeSet;
use std::fmt;
use std::path::Path;

use mechid_numerics::Uncertain;
use mechid_signal::message;
use serde::{Deserialize, Serialize};

use super::changes::{self, Change, ChangeKind};
use super::failures::FailureCount;
use super::results::{Results, read_results};
use crate::modes::rows::normal_interval;
use crate::text::{significant, text_table};
use crate::{AnalysisError, ResultRow};

/// Maximum distance of a value from the median, in robust standard deviations; a value farther away
/// is an outlier.
///
/// # Source
/// Iglewicz & Hoaglin, *How to Detect and Handle Outliers* (1993): the modified z score, limit 3.5.
pub const OUTLIER: f64 = 3.5;

/// Ratio of the standard deviation of a normal distribution to its median absolute deviation.
const NORMAL_OVER_MAD: f64 = 1.482_602_218_505_602;

/// Maximum number of outliers in the text.
const LISTED: usize = 10;

/// Order of the records in a trend.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TrendAxis {
    /// Position of the record in the order of names, counted from 1.
    #[default]
    Order,
    /// Last number in the name of a record, such as 1500 in `speed-1500.csv`.
    Number,
}

/// Parameters and modes of many records as functions of the record.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Trends {
    /// Order of the records.
    pub over: TrendAxis,
    /// Number of records.
    pub records: usize,
    /// Number of records without a result.
    pub failed: usize,
    /// Failures by their code, the most frequent first.
    pub failures: Vec<FailureCount>,
    /// Number of ignored older rows of records with a later row.
    pub superseded: usize,
    /// Number of ignored records without a number in their names.
    pub without_number: usize,
    /// Number of different analyses and versions among the rows; if it is above 1, the rows are not
    /// comparable.
    pub analyses: usize,
    /// Number of values without a standard error and an interval, such as a mode of an ambient
    /// record that is too short for them.
    pub without_interval: usize,
    /// One series for each parameter, natural frequency and damping ratio.
    pub series: Vec<TrendSeries>,
}

/// One quantity of many records.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrendSeries {
    /// Name, such as `k11`, or `frequency 1` and `damping ratio 1` of the first mode.
    pub name: String,
    /// SI unit; empty for a ratio.
    pub unit: String,
    /// Median of the values, in the unit of the series.
    pub median: f64,
    /// Robust standard deviation of the values (1.4826 × the median absolute deviation), in the
    /// unit of the series.
    pub spread: f64,
    /// Median of the standard errors, in the unit of the series; `None` if no value has a standard
    /// error.
    pub standard_error: Option<f64>,
    /// The values, in the order of the records.
    pub points: Vec<TrendPoint>,
    /// Steps and drifts, in the order of the records.
    pub changes: Vec<TrendChange>,
}

/// A step or a drift of a quantity.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrendChange {
    /// Step or drift.
    pub kind: ChangeKind,
    /// Name of the first record with a changed value.
    pub record: String,
    /// Position of the record `record` on the axis, a pure number.
    pub at: f64,
    /// Size of a step, or change from the beginning of a drift to the last record, in the unit of
    /// the series.
    pub size: f64,
    /// Probability of at least this change for a random order of the records, adjusted for the
    /// number of series.
    pub p_value: f64,
    /// `true` if the p-value is an upper bound: no random order of the records has a change at
    /// least as large as this one.
    pub is_bound: bool,
}

/// Value of one record.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrendPoint {
    /// Name of the record.
    pub record: String,
    /// Position of the record on the axis, a pure number: the number in its name, or its index from
    /// 1.
    pub at: f64,
    /// Value, in the unit of the series.
    pub value: f64,
    /// Standard error, in the unit of the series.
    pub standard_error: Option<f64>,
    /// Limits of the 95 % interval, in the unit of the series.
    pub interval: Option<[f64; 2]>,
    /// `true` if the distance of the value from its level is more than [`OUTLIER`] times the
    /// combined standard deviation of the series and of the value.
    pub is_outlier: bool,
}

impl Trends {
    /// Reads a folder of results.
    ///
    /// # Errors
    /// As [`read_results`].
    pub fn read(folder: impl AsRef<Path>, over: TrendAxis) -> Result<Self, AnalysisError> {
        let Results { rows, superseded } = read_results(folder)?;
        Ok(Self { superseded, ..Self::from_rows(&rows, over) })
    }

    /// Computes the trends of rows, in the order that `over` states.
    pub fn from_rows(rows: &[ResultRow], over: TrendAxis) -> Self {
        let failures = FailureCount::from_rows(rows);
        let mut placed: Vec<(f64, &ResultRow)> = Vec::new();
        let mut without_number = 0;
        for (position, row) in (1..).zip(rows) {
            match over {
                TrendAxis::Order => placed.push((f64::from(position), row)),
                TrendAxis::Number => match number_in(row) {
                    Some(number) => placed.push((number, row)),
                    None => without_number += 1,
                },
            }
        }
        placed.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut series: Vec<TrendSeries> = Vec::new();
        for (at, row) in placed {
            for Quantity { name, unit, value, interval } in quantities(row) {
                let known = series.iter().position(|one| one.name == name && one.unit == unit);
                let one = known.unwrap_or_else(|| {
                    let (median, spread, points) = (f64::NAN, f64::NAN, Vec::new());
                    series.push(TrendSeries {
                        name,
                        unit,
                        median,
                        spread,
                        standard_error: None,
                        points,
                        changes: Vec::new(),
                    });
                    series.len() - 1
                });
                series[one].points.push(TrendPoint {
                    record: name_of(row),
                    at,
                    value: value.value,
                    standard_error: Some(value.standard_error).filter(|error| error.is_finite()),
                    interval,
                    is_outlier: false,
                });
            }
        }
        let tests = series.len();
        series.iter_mut().for_each(|one| one.detect_changes_and_outliers(tests));
        let analyses: BTreeSet<_> =
            rows.iter().map(|row| (&row.analysis_hash, &row.version)).collect();
        Self {
            over,
            records: rows.len(),
            failed: failures.iter().map(|count| count.records).sum(),
            failures,
            superseded: 0,
            without_number,
            analyses: analyses.len(),
            without_interval: series.iter().map(TrendSeries::without_interval).sum(),
            series,
        }
    }
}

impl TrendSeries {
    /// Detects changes, computes median and spread, and marks the outliers: values that are far
    /// from the baseline, which follows the changes.
    fn detect_changes_and_outliers(&mut self, tests: usize) {
        let values: Vec<f64> = self.points.iter().map(|point| point.value).collect();
        self.median = median(values.clone());
        let changes = changes::find(&values, tests);
        let levels = changes::baseline(&values, &changes);
        let away = values.iter().zip(&levels).map(|(value, level)| (value - level).abs()).collect();
        self.spread = NORMAL_OVER_MAD * median(away);
        let errors: Vec<f64> =
            self.points.iter().filter_map(|point| point.standard_error).collect();
        self.standard_error = (!errors.is_empty()).then(|| median(errors));
        for (point, level) in self.points.iter_mut().zip(&levels) {
            let deviation = self.spread.hypot(point.standard_error.unwrap_or(0.0));
            point.is_outlier = (point.value - level).abs() > OUTLIER * deviation;
        }
        self.changes = changes.iter().map(|change| self.named(change)).collect();
    }

    fn named(&self, change: &Change) -> TrendChange {
        let first = match change.kind {
            ChangeKind::Step => change.begins,
            ChangeKind::Drift => change.begins + 1,
        };
        let point = &self.points[first.min(self.points.len() - 1)];
        TrendChange {
            kind: change.kind,
            record: point.record.clone(),
            at: point.at,
            size: change.size,
            p_value: change.p_value,
            is_bound: change.is_bound,
        }
    }

    /// Returns the category of the quantity: frequency, damping ratio, or the letter of a
    /// parameter.
    pub fn category(&self) -> &str {
        ["frequency", "damping ratio"]
            .into_iter()
            .find(|name| self.name.starts_with(name))
            .unwrap_or_else(|| {
                self.name.trim_end_matches(|c: char| c.is_ascii_digit() || c == '_' || c == ',')
            })
    }

    /// Returns the number of values without an interval; 0 if no value of the series has a standard
    /// error.
    fn without_interval(&self) -> usize {
        let with = self.points.iter().filter(|point| point.interval.is_some()).count();
        if self.standard_error.is_none() { 0 } else { self.points.len() - with }
    }

    /// Returns the outliers.
    pub fn outliers(&self) -> impl Iterator<Item = &TrendPoint> {
        self.points.iter().filter(|point| point.is_outlier)
    }
}

impl TrendChange {
    /// Returns the p-value as text: `= 0.0012` or, for an upper bound, `≤ 0.0001`.
    pub fn p(&self) -> String {
        let sign = if self.is_bound { '≤' } else { '=' };
        format!("{sign} {}", significant(self.p_value, 2))
    }
}

impl TrendSeries {
    /// Returns a change in words.
    pub fn sentence(&self, change: &TrendChange) -> String {
        let (kind, size) = (change.kind.name(), significant(change.size, 3));
        let from = match change.kind {
            ChangeKind::Step => "at",
            ChangeKind::Drift => "from",
        };
        let unit = format!("{size} {}", self.unit);
        format!(
            "{}: {kind} of {} {from} {}, p {}",
            self.name,
            unit.trim_end(),
            change.record,
            change.p()
        )
    }
}

impl Trends {
    /// Returns the changes of all series.
    pub fn changes(&self) -> impl Iterator<Item = (&TrendSeries, &TrendChange)> {
        self.series.iter().flat_map(|one| one.changes.iter().map(move |change| (one, change)))
    }

    /// Returns a table with one row per value: quantity, unit, record, position on the axis, value,
    /// standard error, the flag of an outlier, and the kind, size and p-value of a change that
    /// begins at this record.
    pub fn csv(&self) -> String {
        let header = "quantity,unit,record,at,value,standard_error,outlier,change,change_size,change_p_value";
        let mut text = format!("{header}\n");
        let quoted = |cell: &str| {
            if cell.contains([',', '"', '\n', '\r']) {
                format!("\"{}\"", cell.replace('"', "\"\""))
            } else {
                cell.to_owned()
            }
        };
        for series in &self.series {
            for point in &series.points {
                let [name, unit, record] =
                    [&series.name, &series.unit, &point.record].map(|cell| quoted(cell));
                let error =
                    point.standard_error.map(|error| format!("{error:?}")).unwrap_or_default();
                let begins =
                    |change: &&TrendChange| change.at == point.at && change.record == point.record;
                let change = match series.changes.iter().find(begins) {
                    Some(TrendChange { kind, size, p_value, .. }) => {
                        format!("{},{size:?},{p_value:?}", kind.name())
                    }
                    None => ",,".into(),
                };
                let (at, value, is_outlier) = (point.at, point.value, point.is_outlier);
                text += &format!(
                    "{name},{unit},{record},{at},{value:?},{error},{is_outlier},{change}\n"
                );
            }
        }
        text
    }
}

/// Parameter, natural frequency or damping ratio of a row.
struct Quantity {
    name: String,
    unit: String,
    value: Uncertain,
    /// Limits of the 95 % interval, both finite.
    interval: Option<[f64; 2]>,
}

/// Returns the parameters and modes of a row.
///
/// The intervals have the degrees of freedom of the covariance of the parameters. A modal test has
/// no parameters, and its intervals follow from the normal distribution. Parameters without a
/// covariance have no intervals, because their degrees of freedom are unknown.
fn quantities(row: &ResultRow) -> Vec<Quantity> {
    let degrees_of_freedom = row.covariance.as_ref().map(|c| c.degrees_of_freedom);
    let quantity = |name: String, unit: &str, value: f64, standard_error: Option<f64>| {
        let standard_error = standard_error.unwrap_or(f64::INFINITY);
        let freedom = degrees_of_freedom.unwrap_or(0);
        let value = Uncertain { value, standard_error, degrees_of_freedom: freedom };
        let interval = if row.parameters.is_empty() && degrees_of_freedom.is_none() {
            normal_interval(value.value, standard_error)
        } else {
            value.interval(0.95).unwrap_or([f64::NAN; 2])
        };
        let interval = Some(interval).filter(|ends| ends.iter().all(|end| end.is_finite()));
        Quantity { name, unit: unit.to_owned(), value, interval }
    };
    let of_parameters = row
        .parameters
        .iter()
        .map(|cell| quantity(cell.name.clone(), &cell.unit, cell.value, cell.standard_error));
    let of_modes = (1..).zip(&row.modes).flat_map(|(number, mode)| {
        let hz_error = mode.natural_frequency_standard_error_hz;
        let ratio_error = mode.damping_ratio_standard_error.map(|error| 100.0 * error);
        let hz = mode.natural_frequency_hz;
        [
            quantity(format!("frequency {number}"), "Hz", hz, hz_error),
            quantity(
                format!("damping ratio {number}"),
                "%",
                100.0 * mode.damping_ratio,
                ratio_error,
            ),
        ]
    });
    let quantities = of_parameters.chain(of_modes);
    quantities.filter(|quantity| quantity.value.value.is_finite()).collect()
}

/// Returns the name of a record for messages.
fn name_of(row: &ResultRow) -> String {
    match &row.record_id {
        Some(id) => id.clone(),
        None => row.record.clone(),
    }
}

/// Returns the last number in the name of a record, without its folder and extension.
fn number_in(row: &ResultRow) -> Option<f64> {
    let stem = match &row.record_id {
        Some(id) => id.clone(),
        None => Path::new(&row.record).file_stem()?.to_string_lossy().into_owned(),
    };
    let is_part = |c: char| c.is_ascii_digit() || c == '.';
    let numbers = stem.split(|c| !is_part(c)).map(|part| part.trim_matches('.'));
    numbers.filter(|part| !part.is_empty()).filter_map(|part| part.parse().ok()).next_back()
}

pub(super) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    match values.len() {
        0 => f64::NAN,
        len => f64::midpoint(values[(len - 1) / 2], values[len / 2]),
    }
}

impl Trends {
    /// Returns the table of all series as text.
    fn table(&self) -> String {
        let head = ["quantity", "median", "spread", "standard error", "outliers", "unit"];
        let mut rows = vec![head.map(str::to_owned).to_vec()];
        for series in &self.series {
            let error = series.standard_error.map_or_else(|| "–".into(), |e| significant(e, 2));
            rows.push(vec![
                series.name.clone(),
                significant(series.median, 6),
                significant(series.spread, 2),
                error,
                format!("{} of {}", series.outliers().count(), series.points.len()),
                series.unit.clone(),
            ]);
        }
        text_table(&rows)
    }
}

impl fmt::Display for Trends {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let identified = self.records - self.failed;
        writeln!(
            f,
            "{}: {identified} identified, {} failed",
            message::count(self.records, "record"),
            self.failed
        )?;
        for FailureCount { code, records, record, message: why } in &self.failures {
            let count = message::count(*records, "record");
            writeln!(f, "  {code}: {count}, such as {record} ({why})")?;
        }
        if self.superseded > 0 {
            let count = message::count(self.superseded, "older row");
            writeln!(
                f,
                "left out: {count} that were computed before the record or the analysis changed"
            )?;
        }
        if self.without_number > 0 {
            let count = message::count(self.without_number, "record");
            writeln!(f, "left out: {count} without a number in the name")?;
        }
        if self.analyses > 1 {
            writeln!(
                f,
                "note: the results come from {} different analyses or versions, which may not be comparable",
                self.analyses
            )?;
        }
        if self.without_interval > 0 {
            let count = message::count(self.without_interval, "value");
            writeln!(
                f,
                "note: {count} without an interval, because the record states no standard error: the figure shows \
                 only their points"
            )?;
        }
        write!(f, "\n{}", self.table())?;
        for (series, change) in self.changes() {
            writeln!(f, "{}", series.sentence(change))?;
        }
        let outliers =
            || self.series.iter().flat_map(|one| one.outliers().map(move |point| (one, point)));
        if outliers().next().is_some() {
            writeln!(
                f,
                "\noutliers, more than {OUTLIER} standard deviations from the baseline (with its steps and drifts):"
            )?;
        }
        for (series, point) in outliers().take(LISTED) {
            let value = format!("{} {}", significant(point.value, 6), series.unit);
            writeln!(f, "  {} of {}: {}", series.name, point.record, value.trim_end())?;
        }
        match outliers().count().saturating_sub(LISTED) {
            0 => Ok(()),
            more => writeln!(f, "  … ({more} more)"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bound_of_a_p_value_is_told_as_one() {
        let change = |is_bound| TrendChange {
            kind: ChangeKind::Step,
            record: "run-25".into(),
            at: 25.0,
            size: 2.0,
            p_value: 0.0012,
            is_bound,
        };
        assert_eq!([true, false].map(|is_bound| change(is_bound).p()), ["≤ 0.0012", "= 0.0012"]);
    }

    #[test]
    fn numbers_are_found_in_names() {
        let number = |record: &str, id: Option<&str>| {
            let analysis = crate::SavedAnalysis::default();
            let row = analysis.row(record, || Err(AnalysisError::NoRecord));
            number_in(&ResultRow { record_id: id.map(str::to_owned), ..row })
        };
        assert_eq!(number("day-2/speed-1500.csv", None), Some(1500.0));
        assert_eq!(number("load 1.5 kN.mat", None), Some(1.5));
        assert_eq!(number("week.parquet", Some("run 7")), Some(7.0));
        assert_eq!(number("2026/pump.csv", None), None);
    }
}
