//! Coefficients at several speeds and loads as one table.

use std::f64::consts::TAU;
use std::fmt::{self, Write as _};
use std::path::PathBuf;

use mechid_io::FrequencyResponses;
use serde::{Deserialize, Serialize};

use super::film::NAMED;
use super::{
    BearingData, BearingSummary, CoefficientRow, IdentifiedBearing, IdentifyBearing,
    identify_bearing,
};
use crate::AnalysisError;
use crate::identify::rows::Uncertain;
use crate::identify::summary::verdict;
use crate::measurement::{Channels, Measurement, Reading, RecordPlan, Window};
use crate::text::{compact, paged_table, significant};

/// Plan of a test campaign: tests at several speeds and loads, all with the same columns.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BearingPlan {
    /// Columns of force, acceleration and displacement.
    pub channels: Channels,
    /// Settings for reading the files.
    pub reading: Reading,
    /// Samples to use.
    pub window: Window,
    /// Settings of all points; the speed and the load of a point, if given, replace those of the
    /// settings.
    pub settings: IdentifyBearing,
    /// Baseline tests for the points without their own baseline tests.
    pub baseline: Vec<PathBuf>,
    /// `true` if the files are tables of frequency responses, alternately of displacement and
    /// acceleration.
    pub frf_table: bool,
    /// Speeds and loads.
    pub points: Vec<BearingPoint>,
}

/// Tests at one speed and load.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BearingPoint {
    /// Records of the tests, or their tables of frequency responses.
    pub tests: Vec<PathBuf>,
    /// Records of the baseline tests, or their tables of frequency responses.
    pub baseline: Vec<PathBuf>,
    /// Speed of rotation, in Hz; `None`: as in the settings.
    pub rotation_hz: Option<f64>,
    /// Static load, in N; `None`: as in the settings.
    pub load: Option<f64>,
}

impl BearingPlan {
    /// Identifies the bearing at every point.
    ///
    /// # Errors
    /// [`AnalysisError::NoRecord`] for a point without tests, and the errors of
    /// [`BearingData::from_records`] and [`identify_bearing`](super::identify_bearing()).
    pub fn run(&self) -> Result<BearingTable, AnalysisError> {
        let bearings = self.points.iter().map(|point| self.at(point));
        Ok(BearingTable::new(bearings.collect::<Result<Vec<_>, _>>()?))
    }

    fn at(&self, point: &BearingPoint) -> Result<IdentifiedBearing, AnalysisError> {
        let how = IdentifyBearing {
            rotation_hz: point.rotation_hz.or(self.settings.rotation_hz),
            load: point.load.or(self.settings.load),
            ..self.settings.clone()
        };
        let data = |paths: &[PathBuf]| {
            if self.frf_table {
                let tables = paths.iter().map(FrequencyResponses::read);
                return BearingData::from_responses(&tables.collect::<Result<Vec<_>, _>>()?, &how);
            }
            let open = |path: &PathBuf| {
                let (path, channels) = (path.clone(), self.channels.clone());
                let (reading, window) = (self.reading.clone(), self.window.clone());
                RecordPlan { path, channels, reading, window }.open()
            };
            let tests: Vec<Measurement> = paths.iter().map(open).collect::<Result<_, _>>()?;
            BearingData::from_records(&tests, &how)
        };
        let tests = data(&point.tests)?;
        let recorded = if point.baseline.is_empty() { &self.baseline } else { &point.baseline };
        let baseline = if recorded.is_empty() { None } else { Some(data(recorded)?) };
        identify_bearing(&tests, baseline.as_ref(), &how)
    }
}

/// Coefficients of a bearing, one row per speed and load.
#[derive(Debug, Serialize)]
pub struct BearingTable {
    /// Results by rising speed, then load.
    pub rows: Vec<BearingSummary>,
}

impl BearingTable {
    /// Sorts results by speed and load.
    pub fn new(bearings: impl IntoIterator<Item = IdentifiedBearing>) -> Self {
        let mut rows: Vec<BearingSummary> = bearings.into_iter().map(|one| one.summary).collect();
        let key = |row: &BearingSummary| [row.rotation_hz, row.load].map(|x| x.unwrap_or(0.0));
        rows.sort_by(|a, b| {
            let [a, b] = [key(a), key(b)];
            a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1]))
        });
        Self { rows }
    }

    /// Returns the table as text: `speed` in rad/s, `load` in N, the coefficients kxx … myy in SI
    /// units (zero if they were not identified), and their standard errors; then the whirl
    /// frequency ratio and the critical mass (kg), each with its standard error. The columns from
    /// kxx to myy are the arguments of a bearing element in rotor-dynamics programs. Without a
    /// threshold of instability, the cells of the whirl frequency ratio are empty, and the critical
    /// mass is `inf` if every rotor is stable.
    pub fn csv(&self) -> String {
        let names = NAMED;
        let mut text = String::from("speed,load");
        for name in names {
            let _ = write!(text, ",{name}");
        }
        for name in names {
            let _ = write!(text, ",{name}_standard_error");
        }
        for name in ["whirl_frequency_ratio", "critical_mass"] {
            let _ = write!(text, ",{name},{name}_standard_error");
        }
        for row in &self.rows {
            let speed = row.rotation_hz.unwrap_or(0.0) * TAU;
            let load = row.load.map_or(String::new(), |load| format!("{load:?}"));
            let _ = write!(text, "\n{speed:?},{load}");
            let coefficient =
                |name: &str| row.coefficients.iter().find(|c: &&CoefficientRow| c.name == name);
            for name in names {
                let _ = write!(text, ",{:?}", coefficient(name).map_or(0.0, |c| c.estimate.value));
            }
            for name in names {
                // The error cell is empty if the estimate has no error, and 0 if the mass is not
                // identified.
                let error = coefficient(name).map_or(Some(0.0), |c| c.estimate.standard_error);
                text += &cell(error);
            }
            text += &threshold_cells(row);
        }
        text + "\n"
    }
}

/// Returns a comma and the cell of a value; the cell is empty if the value is `None`.
fn cell(value: Option<f64>) -> String {
    value.map_or_else(|| ",".to_owned(), |value| format!(",{value:?}"))
}

/// Returns the cells of the whirl frequency ratio and the critical mass (kg), with their standard
/// errors.
fn threshold_cells(row: &BearingSummary) -> String {
    let Some(stability) = &row.stability else { return cell(None).repeat(4) };
    let with_error = |estimate: Option<&Uncertain>, otherwise: Option<f64>| {
        let value = estimate.map_or(otherwise, |estimate| Some(estimate.value));
        cell(value) + &cell(estimate.and_then(|estimate| estimate.standard_error))
    };
    with_error(stability.whirl_frequency_ratio.as_ref(), None)
        + &with_error(stability.critical_mass.as_ref(), Some(f64::INFINITY))
}

impl fmt::Display for BearingTable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names = self.rows.iter().map(|row| &row.coefficients).max_by_key(|rows| rows.len());
        let mut table = vec![vec!["rotation, Hz".to_owned(), "load, N".to_owned()]];
        for row in names.into_iter().flatten() {
            table[0].push(format!("{}, {}", row.name, row.unit));
        }
        let coefficients = table[0].len();
        table[0].extend(["whirl ratio".to_owned(), "critical mass, kg".to_owned()]);
        for row in &self.rows {
            let cell = |value: Option<f64>| value.map_or(String::new(), |value| compact(value, 6));
            let mut cells = vec![cell(row.rotation_hz), cell(row.load)];
            let with_error = |estimate: &Uncertain| {
                let value = significant(estimate.value, 4);
                match estimate.standard_error {
                    Some(error) => format!("{value} ± {}", significant(error, 2)),
                    None => value,
                }
            };
            cells.extend(row.coefficients.iter().map(|c| with_error(&c.estimate)));
            cells.resize(coefficients, String::new());
            let stability = row.stability.as_ref();
            let of_rotor = [
                stability.map(|stability| &stability.whirl_frequency_ratio),
                stability.map(|stability| &stability.critical_mass),
            ];
            cells.extend(of_rotor.map(|value| match value {
                Some(Some(value)) => with_error(value),
                Some(None) => "stable".into(),
                None => String::new(),
            }));
            table.push(cells);
        }
        f.write_str(&paged_table(&table, 6))?;
        for row in &self.rows {
            write!(f, "{}: {}", row.tests.join(", "), verdict(&row.checks))?;
        }
        for row in &self.rows {
            for remark in &row.remarks {
                writeln!(f, "note: {}: {remark}", row.tests.join(", "))?;
            }
        }
        Ok(())
    }
}
