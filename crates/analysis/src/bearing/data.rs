//! Forces and motions of the film, from records or from tables of frequency responses.

use std::f64::consts::TAU;
use std::sync::Arc;

use mechid_checks::{Finding, power, steady_periods};
use mechid_io::FrequencyResponses;
use mechid_model::ResponseQuantity;
use mechid_signal::Record;
use mechid_spectra::{FrequencyData, Lines, NoiseSpectrum, Pooling, RepeatedPeriods};
use nalgebra::{Complex, DMatrix};

use super::IdentifyBearing;
use crate::AnalysisError;
use crate::identify::Disturbance;
use crate::identify::IdentifyResponses;
use crate::identify::checks::sensor_findings;
use crate::identify::left_out::LineRule;
use crate::identify::table_fit::table_findings;
use crate::identify::tabulated::response_data;
use crate::measurement::{
    Block, CHUNK_SAMPLES, Channels, Hold, Measurement, Windowed, check_distinct,
};

/// Minimum number of degrees of freedom of a noise covariance that weights the rows: with at least
/// this number, the weights lose less than 3 % of the information.
const WELL_KNOWN: usize = 40;

/// Spectra of all tests of one condition of the rig (with the film, or the baseline without it):
/// the film force f − M_s a and the displacement d of the housing relative to the shaft.
#[derive(Debug, Clone)]
pub struct BearingData {
    /// Names of the tests.
    pub(super) names: Vec<String>,
    /// Rows of all tests, with their noise if it is known.
    pub(super) data: FrequencyData,
    /// Line spacing of a test, in Hz; 0 for a single frequency.
    pub(super) spacing_hz: f64,
    /// Rows of each test, with the findings on its record.
    pub(super) records: Vec<TestRecord>,
    /// Source of the noise, in words; `None` if it is not known.
    pub(super) noise: Option<&'static str>,
    /// Largest displacement of the housing from its mean position, relative to the shaft, in m;
    /// `None` for frequency responses.
    pub(super) largest_displacement: Option<f64>,
    /// Excluded frequencies at multiples of the rotation frequency, in Hz.
    pub(super) left_out_hz: Vec<f64>,
    pub(super) remarks: Vec<String>,
}

/// One test of the rig, with its spectra and the findings on its samples.
#[derive(Debug, Clone)]
pub(super) struct TestRecord {
    pub name: String,
    /// Names of the channels of the record.
    pub channels: Arc<Channels>,
    pub data: FrequencyData,
    /// Findings on the samples, before the fit.
    pub before: Vec<Finding>,
}

impl BearingData {
    /// Reads records of whole periods with the two shaker forces (`force`), the acceleration of the
    /// housing (`acceleration`) and the displacement of the housing relative to the shaft
    /// (`displacement`), x before y in each.
    ///
    /// # Errors
    /// [`AnalysisError::NoRecord`], [`AnalysisError::Setting`] if a record has no displacement or
    /// acceleration in two directions, or if all lines are excluded, the errors of
    /// [`choose_lines`](crate::identify::lines::choose_lines), and an error if a file cannot be
    /// read again.
    pub fn from_records(
        tests: &[Measurement],
        how: &IdentifyBearing,
    ) -> Result<Self, AnalysisError> {
        how.check()?;
        check_distinct(tests)?;
        let data = tests.iter().map(|test| Self::from_record(test, how));
        let data = data.collect::<Result<Vec<_>, _>>()?.into_iter();
        data.map(Ok).reduce(|a, b| a?.concatenate(b?)).ok_or(AnalysisError::NoRecord)?
    }

    /// Reads tables of frequency responses per shaker force. Each test has two tables at the same
    /// frequencies: first the displacement of the housing relative to the shaft, then the
    /// acceleration of the housing. A test has forces in both directions, or in one direction.
    ///
    /// The errors of displacement and acceleration are assumed to be independent, because they come
    /// from different sensors.
    ///
    /// # Errors
    /// [`AnalysisError::NoRecord`], the errors of
    /// [`identify_responses`](crate::identify_responses()), and [`AnalysisError::Setting`] if the
    /// tables do not match or lines are chosen by number.
    ///
    /// # Source
    /// Rouvas and Childs (1993).
    pub fn from_responses(
        tables: &[FrequencyResponses],
        how: &IdentifyBearing,
    ) -> Result<Self, AnalysisError> {
        how.check()?;
        let tests = tables.chunks(2).map(|test| match test {
            [displacement, acceleration] => Self::from_tables(displacement, acceleration, how),
            _ => Err(setting_error(&format!(
                "a test needs two tables, one of displacement and one of acceleration; the number of tables is {}",
                tables.len()
            ))),
        });
        let data = tests.collect::<Result<Vec<_>, _>>()?.into_iter();
        data.map(Ok).reduce(|a, b| a?.concatenate(b?)).ok_or(AnalysisError::NoRecord)?
    }

    fn from_tables(
        displacement: &FrequencyResponses,
        acceleration: &FrequencyResponses,
        how: &IdentifyBearing,
    ) -> Result<Self, AnalysisError> {
        let (d, a, noise) = matching_responses(displacement, acceleration, how)?;
        let spacing_hz = spacing(d.omega());
        let is_kept = |omega: f64| {
            let (hz, others) = (omega / TAU, &how.without.frequencies);
            !rotates(hz, how.rotation_hz, spacing_hz)
                && !others.iter().any(|other| other.reaches(hz, spacing_hz))
        };
        let (keep, rotating): (Vec<usize>, Vec<usize>) =
            (0..d.len()).partition(|row| is_kept(d.omega()[*row]));
        if keep.is_empty() {
            return Err(setting_error(
                "every frequency is a multiple of the rotation frequency (`rotation_hz`) or excluded \
                 (`without_hz`): measure frequencies between these multiples",
            ));
        }
        let data = film_data(&d, &a, &keep, how.stator_mass, noise.is_some())?;
        let names = vec![displacement.file.clone(), acceleration.file.clone()];
        let mut remarks = [&displacement.remarks[..], &acceleration.remarks[..]].concat();
        remarks.extend(noise.is_none().then(|| {
            format!(
                "{}: at least one of the tables has neither standard errors nor coherences; the noise was estimated from the residual, as noise on the displacement only",
                names.join(", ")
            )
        }));
        let left_out_hz = rotating.into_iter().map(|row| d.omega()[row] / TAU).collect();
        let record = TestRecord {
            name: names.join(", "),
            channels: Arc::default(),
            data: data.clone(),
            before: [displacement, acceleration].into_iter().flat_map(table_findings).collect(),
        };
        Ok(Self {
            names,
            data,
            spacing_hz,
            records: vec![record],
            noise,
            largest_displacement: None,
            left_out_hz: distinct(left_out_hz),
            remarks,
        })
    }

    fn from_record(test: &Measurement, how: &IdentifyBearing) -> Result<Self, AnalysisError> {
        let recorded = test.hold(Hold::Periods)?;
        let block = &recorded.held;
        let (film_force, d) = force_and_motion(block, how.stator_mass)?;
        how.check_rotation(block.force.sampling().rate_hz())?;
        let period = block.force.sampling().with_len(block.period)?;
        let spacing_hz = period.line_spacing_hz();
        let rule = LineRule { choice: &how.lines, without: &how.without };
        let chosen = rule.lines(&block.force, block.period)?;
        let (rotating, kept): (Vec<usize>, Vec<usize>) = chosen
            .into_iter()
            .partition(|line| rotates(*line as f64 * spacing_hz, how.rotation_hz, spacing_hz));
        if kept.is_empty() {
            let why = "every line is at a multiple of the rotation frequency: excite lines between these multiples";
            return Err(AnalysisError::Setting { setting: "lines", why: why.into() });
        }
        let lines = Lines::new(period, kept)?;
        let periods = film_periods(&recorded, &lines, how.stator_mass)?;
        let (data, noise) = mean_with_noise(&periods)?;
        let mut remarks = block.unit_notes();
        if noise.is_none() {
            remarks.push(format!(
                "{}: the periods ({}) show no noise; the noise was estimated from the residual, as noise on the displacement only",
                block.file,
                periods.count()
            ));
        }
        let record = TestRecord {
            name: block.file.clone(),
            channels: Arc::clone(&block.names),
            data: data.clone(),
            before: record_findings(block, &film_force, &d)?,
        };
        Ok(Self {
            names: vec![block.file.clone()],
            data,
            spacing_hz,
            records: vec![record],
            noise,
            largest_displacement: Some(largest_orbit(&d)),
            left_out_hz: rotating.into_iter().map(|line| line as f64 * spacing_hz).collect(),
            remarks,
        })
    }

    /// Returns these data followed by the rows of `other`.
    fn concatenate(mut self, other: Self) -> Result<Self, AnalysisError> {
        self.data = self.data.and(&other.data)?;
        self.noise = self.noise.and(other.noise);
        self.largest_displacement = match (self.largest_displacement, other.largest_displacement) {
            (Some(a), Some(b)) => Some(a.max(b)),
            (a, b) => a.or(b),
        };
        self.names.extend(other.names);
        self.records.extend(other.records);
        self.remarks.extend(other.remarks);
        self.left_out_hz.extend(other.left_out_hz);
        self.left_out_hz = distinct(self.left_out_hz);
        Ok(self)
    }
}

/// Returns the mean of the periods of a test with its noise, and the source of the noise in words.
/// The mean has no noise if there is one period, or if the periods differ only by rounding.
fn mean_with_noise(
    periods: &RepeatedPeriods,
) -> Result<(FrequencyData, Option<&'static str>), AnalysisError> {
    let count = periods.count();
    if count < 2 {
        return Ok((periods.mean()?, None));
    }
    // The covariance is pooled over enough neighbouring lines to have `WELL_KNOWN` degrees of
    // freedom.
    let pooling = match WELL_KNOWN.div_ceil(count - 1) / 2 {
        0 => Pooling::PerLine,
        half_width => Pooling::Neighbours(half_width),
    };
    let noisy = periods.mean_with_noise(pooling)?;
    if shows_noise(&noisy) {
        Ok((noisy, Some("estimated from the periods")))
    } else {
        Ok((periods.mean()?, None))
    }
}

/// Returns the responses of the displacement and the acceleration from two tables, and the source
/// of the noise in words. The source is `None` if one of the tables does not state its noise.
fn matching_responses(
    displacement: &FrequencyResponses,
    acceleration: &FrequencyResponses,
    how: &IdentifyBearing,
) -> Result<(FrequencyData, FrequencyData, Option<&'static str>), AnalysisError> {
    let settings = how.response_settings()?;
    let read = |table: &FrequencyResponses, quantity| {
        let how = IdentifyResponses { quantity: Some(quantity), ..settings.clone() };
        response_data(table, &how)
    };
    let (d, noise) = read(displacement, ResponseQuantity::Displacement)?;
    let (a, noise_of_a) = read(acceleration, ResponseQuantity::Acceleration)?;
    if (d.dof(), a.dof()) != (2, 2) {
        return Err(setting_error("a bearing has two directions: choose two `points`"));
    }
    if d.omega() != a.omega() || d.force() != a.force() {
        return Err(setting_error(&format!(
            "{} and {} need the same frequencies and forces",
            displacement.file, acceleration.file
        )));
    }
    Ok((d, a, noise.zip(noise_of_a).map(|(noise, _)| noise)))
}

/// Returns the film force f − M a and the displacement at the rows `keep` of two tables of
/// frequency responses. The table `d` has the responses of the displacement, and the table `a` has
/// those of the acceleration.
///
/// `mass` is the mass of the stator, in kg. With `noise`, the covariance of the result is computed
/// from the covariances of both tables, if both have one.
fn film_data(
    d: &FrequencyData,
    a: &FrequencyData,
    keep: &[usize],
    mass: f64,
    noise: bool,
) -> Result<FrequencyData, AnalysisError> {
    let omega: Vec<f64> = keep.iter().map(|row| d.omega()[*row]).collect();
    let displacement = d.displacement().select_rows(keep);
    let mut force = d.force().select_rows(keep);
    for (index, row) in keep.iter().enumerate() {
        // The table `a` holds displacements computed from the accelerations; the factor converts
        // them back.
        let factor = ResponseQuantity::Acceleration.per_displacement(d.omega()[*row]) * mass;
        for direction in 0..2 {
            force[(index, direction)] -= a.displacement()[(*row, direction)] * factor;
        }
    }
    let kind = ResponseQuantity::Displacement;
    let data = FrequencyData::from_amplitudes(omega.clone(), force, displacement, kind)?;
    let (true, Some(d_noise), Some(a_noise)) = (noise, d.noise(), a.noise()) else {
        return Ok(data);
    };
    let covariance = keep.iter().map(|row| {
        let factor = (mass * d.omega()[*row].powi(2)).powi(2);
        let mut both = d_noise.covariance(*row).clone();
        let force_block = a_noise.covariance(*row).view((0, 0), (2, 2)) * Complex::from(factor);
        both.view_mut((2, 2), (2, 2)).copy_from(&force_block);
        both
    });
    Ok(data.with_noise(NoiseSpectrum::new(omega, covariance.collect())?)?)
}

fn setting_error(why: &str) -> AnalysisError {
    AnalysisError::Setting { setting: "frf_table", why: why.into() }
}

/// Minimum ratio of the scatter of the periods to the displacement; a smaller scatter is rounding.
const ROUNDING: f64 = 1e-12;

/// Returns whether the scatter of the periods is more than rounding.
fn shows_noise(data: &FrequencyData) -> bool {
    let Some(noise) = data.noise() else { return false };
    let variance = |row: usize| (0..2).map(|c| noise.covariance(row)[(c, c)].re).sum::<f64>();
    let scatter: f64 = (0..data.len()).map(variance).sum();
    scatter > ROUNDING * ROUNDING * data.displacement().norm_squared()
}

/// Returns the numbers in rising order, without duplicates.
fn distinct(mut numbers: Vec<f64>) -> Vec<f64> {
    numbers.sort_by(f64::total_cmp);
    numbers.dedup();
    numbers
}

/// Returns the smallest distance between different frequencies, in Hz; 0 for a single frequency.
fn spacing(omega: &[f64]) -> f64 {
    let sorted = distinct(omega.to_vec());
    let smallest = sorted.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::INFINITY, f64::min);
    if smallest.is_finite() { smallest / TAU } else { 0.0 }
}

/// Returns whether a line is at a multiple of the speed of rotation.
pub(super) fn rotates(hz: f64, rotation_hz: Option<f64>, spacing_hz: f64) -> bool {
    rotation_hz.is_some_and(|rotation| Disturbance::rotation(rotation).reaches(hz, spacing_hz))
}

/// Returns the film force f − M_s a and the relative displacement d of consecutive samples.
fn force_and_motion(block: &Block, mass: f64) -> Result<(Record, Record), AnalysisError> {
    let missing = |setting| AnalysisError::Setting {
        setting,
        why: format!(
            "{}: a bearing test needs two columns, x and y, of each quantity: force of the shakers, \
             acceleration of the housing, and displacement of the housing relative to the shaft",
            block.file
        ),
    };
    let a = block.acceleration.as_ref().ok_or_else(|| missing("acceleration"))?;
    let d = block.displacement.as_ref().ok_or_else(|| missing("displacement"))?;
    if block.force.channels() != 2 {
        return Err(missing("force"));
    }
    let force = Record::new(block.force.sampling(), block.force.data() - a.data() * mass)?;
    Ok((force, d.clone()))
}

/// Checks the channels of a record, its periods, and the power into the housing and into the film.
fn record_findings(
    block: &Block,
    film_force: &Record,
    d: &Record,
) -> Result<Vec<Finding>, AnalysisError> {
    let kind = ResponseQuantity::Displacement;
    let mut findings = block.unit_findings.clone();
    findings.extend(sensor_findings(block));
    findings.extend(steady_periods(&block.force, d, block.period)?);
    if let Some(a) = &block.acceleration {
        findings.extend(power(&block.force, a, ResponseQuantity::Acceleration)?);
    }
    findings.extend(power(film_force, d, kind)?);
    Ok(findings)
}

/// Reads all periods of a test, chunk by chunk.
fn film_periods(
    recorded: &Windowed,
    lines: &Lines,
    mass: f64,
) -> Result<RepeatedPeriods, AnalysisError> {
    let Block { period, periods, .. } = &recorded.held;
    let kind = ResponseQuantity::Displacement;
    let mut spectra = RepeatedPeriods::expecting(lines, 2, kind, *periods);
    let samples = period * (CHUNK_SAMPLES / period).max(1);
    recorded.chunks(samples, samples, &mut |chunk| {
        let (force, d) = force_and_motion(chunk, mass)?;
        Ok(spectra.push(&force, &d)?)
    })?;
    Ok(spectra)
}

/// Returns the largest displacement from the mean position, in m.
fn largest_orbit(d: &Record) -> f64 {
    let d: DMatrix<f64> = d.without_mean().into_data();
    d.row_iter().map(|row| row.norm()).fold(0.0, f64::max)
}
