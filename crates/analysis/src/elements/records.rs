//! Spectral lines of records: of whole periods, with the noise from their scatter, or of open
//! records.

use mechid_checks::{Finding, NoiseSource};
use mechid_model::ResponseQuantity;
use mechid_model::elements::Input;
use mechid_signal::{HitRule, Record};
use mechid_spectra::{
    FrequencyData, LineData, LineNoise, Lines, Pooling, RepeatedPeriods, Transient,
};
use nalgebra::{DMatrix, DVector};

use super::data::{TestKind, TestRow, joined};
use super::{ElementData, IdentifyElements};
use crate::AnalysisError;
use crate::hits::{self, Windows};
use crate::identify::checks;
use crate::identify::left_out::LineRule;
use crate::identify::rows::WindowRow;
use crate::identify::{LeftOut, LineChoice};
use crate::limits::PULSE_EFFECTS;
use crate::measurement::{Block, Hold, Measurement, check_distinct};
use crate::modes::driven_band;

/// Inputs and outputs of one record, in the order of the instruments.
struct Signals {
    /// Input samples, one row per sample and one column per input, in the units of the inputs.
    inputs: Record,
    /// Output samples, one row per sample and one column per sensor, in the units of the sensors.
    outputs: Record,
}

impl ElementData {
    /// Reads records with the columns of [`IdentifyElements::channels`]: as hits if the settings
    /// have a rule for hits, as whole periods if the window has a period, otherwise as open
    /// records.
    ///
    /// # Errors
    /// [`AnalysisError::NoRecord`], [`AnalysisError::NoHit`] if no hit of a record is good,
    /// [`AnalysisError::Setting`] for settings that exclude each other or exclude all lines, and if
    /// a file cannot be read.
    pub fn from_records(
        measurements: &[Measurement],
        how: &IdentifyElements,
    ) -> Result<Self, AnalysisError> {
        check_distinct(measurements)?;
        joined(measurements.iter().map(|measurement| match &how.hits {
            Some(rule) => from_hits(measurement, rule, how, measurements.len()),
            None => from_record(measurement, how),
        }))
    }
}

/// Reads the good hits of a record as open records that contain only the forces of their pulses.
/// Hits without a gap are joined into one record. They remain separate if the noise of the joined
/// pulses needs more memory than the limit divided by `records`, the number of records.
fn from_hits(
    measurement: &Measurement,
    rule: &HitRule,
    how: &IdentifyElements,
    records: usize,
) -> Result<ElementData, AnalysisError> {
    if measurement.window_settings().period.is_some() {
        let why = "a record of hits has no periods: leave `period` out".into();
        return Err(AnalysisError::Setting { setting: "hits", why });
    }
    if measurement.channels().force.is_empty() {
        let why = "a hammer test needs an input that is a force".into();
        return Err(AnalysisError::Setting { setting: "hits", why });
    }
    let joined = from_windows(measurement, rule, how, Windows::Joined)?;
    if joined.lines.pulse_effects() <= PULSE_EFFECTS / records {
        return Ok(joined);
    }
    let mut separate = from_windows(measurement, rule, how, Windows::Separate)?;
    separate.remarks.push(format!(
        "{}: every hit was fitted with its own transient, because a joint fit of all pulses with their noise needs \
         too much memory; a smaller band or fewer hits may give smaller errors",
        separate.tests.first().map_or("", |test| &test.file)
    ));
    Ok(separate)
}

fn from_windows(
    measurement: &Measurement,
    rule: &HitRule,
    how: &IdentifyElements,
    windows: Windows,
) -> Result<ElementData, AnalysisError> {
    let cut = hits::cut(&[measurement.hold_any(Hold::Whole)?], rule, windows)?;
    let tests = cut.hits.into_iter().zip(&cut.noise).map(|(hit, noise)| {
        let block = hit.into_held();
        let data = Signals::new(&block, how)?.open(&block, TestKind::Hit, how)?;
        let mut data = data.with_force_noise(&block, &block.driven, Some(noise), how)?;
        data.remarks = block.unit_notes();
        data.findings = sensor_findings(&block);
        Ok(data)
    });
    let mut data = joined(tests)?;
    data.hits = cut.rows;
    data.remarks.extend(cut.remarks);
    Ok(data)
}

fn from_record(
    measurement: &Measurement,
    how: &IdentifyElements,
) -> Result<ElementData, AnalysisError> {
    let block = measurement.whole_block()?;
    let signals = Signals::new(&block, how)?;
    let is_periodic = measurement.window_settings().period.is_some();
    let mut data = if is_periodic {
        signals.periods(&block, how)?
    } else {
        let forces: Vec<usize> = (0..block.force.channels()).collect();
        let data = signals.open(&block, TestKind::Open, how)?;
        data.with_force_noise(&block, &forces, None, how)?
    };
    data.remarks = block.unit_notes();
    data.findings = sensor_findings(&block);
    Ok(data)
}

/// Returns the faults of the sensors of one test.
fn sensor_findings(block: &Block) -> Vec<(usize, Finding)> {
    checks::sensor_findings(block).into_iter().map(|finding| (0, finding)).collect()
}

impl Signals {
    fn new(block: &Block, how: &IdentifyElements) -> Result<Self, AnalysisError> {
        let instruments = &how.machine.instruments;
        // Among the columns of a quantity the sensors come first, then the motions of the support.
        let mut next = [0; 3];
        let mut response = |quantity: ResponseQuantity| {
            let of_kind = match quantity {
                ResponseQuantity::Displacement => &block.displacement,
                ResponseQuantity::Velocity => &block.velocity,
                ResponseQuantity::Acceleration => &block.acceleration,
            };
            let index = &mut next[quantity as usize];
            *index += 1;
            of_kind.as_ref().map(|record| record.channel(*index - 1))
        };
        let outputs: Vec<_> =
            instruments.sensors.iter().map(|sensor| response(sensor.quantity)).collect();
        let mut forces = 0..block.force.channels();
        let inputs: Vec<_> = instruments
            .inputs
            .iter()
            .map(|input| match input {
                Input::Force { .. } => forces.next().map(|at| block.force.channel(at)),
                Input::Support { quantity, .. } => response(*quantity),
                Input::Unbalance { .. } => None,
            })
            .collect();
        let record = |columns: Vec<Option<&[f64]>>| -> Result<Record, AnalysisError> {
            let columns = columns.into_iter().map(|column| column.map(DVector::from_column_slice));
            let columns: Vec<_> = columns.collect::<Option<_>>().ok_or_else(|| {
                let why = "the record needs a column for each sensor and each input of the machine"
                    .into();
                AnalysisError::Setting { setting: "machine", why }
            })?;
            Ok(Record::new(block.force.sampling(), DMatrix::from_columns(&columns))?)
        };
        if inputs.is_empty() {
            let why =
                "a record needs a measured input: a force, or the motion of the support".into();
            return Err(AnalysisError::Setting { setting: "machine", why });
        }
        Ok(Self { inputs: record(inputs)?, outputs: record(outputs)? })
    }

    fn test(&self, block: &Block, kind: TestKind) -> TestRow {
        TestRow { file: block.file.clone(), kind, window: Some(WindowRow::from_block(block)) }
    }

    /// Returns the mean of the periods with the noise from their scatter.
    fn periods(&self, block: &Block, how: &IdentifyElements) -> Result<ElementData, AnalysisError> {
        how.refuse_force_noise("whole periods")?;
        let choice = how.band.map_or(LineChoice::Driven, LineChoice::Band);
        let without = LeftOut { lines: None, frequencies: how.without_hz.clone() };
        let rule = LineRule { choice: &choice, without: &without };
        let (period, count) = (block.period, block.periods);
        let chosen = rule.lines(&self.inputs, period)?;
        let lines = Lines::new(self.inputs.sampling().with_len(period)?, chosen)?;
        let (p, q) = (self.outputs.channels(), self.inputs.channels());
        // `RepeatedPeriods` needs equal numbers of forces and responses, so columns of zeros are
        // added to the record with fewer channels.
        let channels = p.max(q);
        let padded = |record: &Record| {
            let data = record.data().rows(0, period * count);
            let added = channels - record.channels();
            let data = data.into_owned().insert_columns(record.channels(), added, 0.0);
            Record::new(record.sampling().with_len(period * count)?, data)
        };
        let as_measured = ResponseQuantity::Displacement;
        let mut periods = RepeatedPeriods::expecting(&lines, channels, as_measured, count);
        periods.push(&padded(&self.inputs)?, &padded(&self.outputs)?)?;
        let (mean, noise) = with_noise(&periods, how.noise)?;
        let inputs = mean.force().columns(0, q).into_owned();
        let outputs = mean.displacement().columns(0, p).into_owned();
        let data = LineData::new(lines.omega(), inputs, outputs, Transient::None)?;
        let of_channels: Vec<usize> = (0..p).chain(channels..channels + q).collect();
        let (data, source, noise) = match (mean.noise(), noise) {
            (Some(spectrum), Some(words)) => {
                let covariance = (0..mean.len()).map(|row| {
                    let matrix = spectrum.covariance(row);
                    matrix.select_rows(&of_channels).select_columns(&of_channels)
                });
                let noise = LineNoise::new(covariance.collect())?
                    .with_degrees_of_freedom(spectrum.degrees_of_freedom(), spectrum.deviations());
                (data.with_noise(noise)?, Some(NoiseSource::Periods), words)
            }
            _ => (data, None, "taken from the residual".to_owned()),
        };
        let test = self.test(block, TestKind::Periods);
        let of_test = ElementData::from_test(data, test, block.names.as_ref().clone());
        Ok(ElementData { source, noise, ..of_test })
    }

    /// Returns all lines of a band of an open record, without a window function.
    fn open(
        &self,
        block: &Block,
        kind: TestKind,
        how: &IdentifyElements,
    ) -> Result<ElementData, AnalysisError> {
        let is_of_periods = matches!(how.noise, Pooling::Neighbours(_) | Pooling::PerLine);
        if is_of_periods {
            let why = format!(
                "{} is for whole periods (`period`): an open record has only one value at each line, so its scatter is not known",
                how.noise
            );
            return Err(AnalysisError::Setting { setting: "noise", why });
        }
        let band_hz = match how.band {
            Some(band) => [band.low_hz, band.high_hz],
            None => driven_band([&self.inputs])?,
        };
        let data = LineData::from_open_record(Some(&self.inputs), &self.outputs, band_hz)?;
        let spacing_hz = self.inputs.sampling().line_spacing_hz();
        let data = ElementData::kept(data, spacing_hz, how)?;
        let test = self.test(block, kind);
        let of_test = ElementData::from_test(data, test, block.names.as_ref().clone());
        Ok(ElementData { noise: "taken from the residual".to_owned(), ..of_test })
    }
}

/// Returns the mean over the periods, with its noise and the noise model in words; without noise if
/// there is one period, or if the periods differ only by rounding.
fn with_noise(
    periods: &RepeatedPeriods,
    noise: Pooling,
) -> Result<(FrequencyData, Option<String>), AnalysisError> {
    let count = periods.count();
    if count < 2 {
        if noise == Pooling::PerLine {
            let why = "per-line takes the noise of each line from the scatter of two or more periods, but there is \
                       only one period: measure more periods, or choose another noise";
            return Err(AnalysisError::Setting { setting: "noise", why: why.into() });
        }
        return Ok((periods.mean()?, None));
    }
    if periods.mean_with_noise(Pooling::AllLines)?.noise_above_rounding().is_none() {
        return Ok((periods.mean()?, None));
    }
    let data = periods.mean_with_noise(noise)?;
    let models = data.noise().map(|noise| {
        let mut models: Vec<String> = noise.models().iter().map(ToString::to_string).collect();
        models.dedup();
        format!("from {count} periods: {}", models.join("; "))
    });
    Ok((data, models))
}
