//! Tables of frequency responses, of the machine and of its measured parts.

use std::f64::consts::TAU;

use mechid_checks::NoiseSource;
use mechid_estimate::likelihood::machine::MeasuredReceptance;
use mechid_io::{FrequencyResponses, ResponseFunction};
use mechid_model::ResponseQuantity;
use mechid_model::elements::Sensor;
use mechid_spectra::{LineData, LineNoise, Transient};
use nalgebra::{Complex, DMatrix, DVector};

use super::data::{TestKind, TestRow, joined};
use super::{ElementData, IdentifyElements};
use crate::AnalysisError;
use crate::limits::SAME_FREQUENCY;
use crate::measurement::Channels;

impl ElementData {
    /// Reads tables of frequency responses, whose points have the names of the sensors and of the
    /// inputs.
    ///
    /// # Errors
    /// [`AnalysisError::NoResponse`] if a response of a sensor to a force is missing, and
    /// [`AnalysisError::Setting`] for a table of another quantity, or without a force of the
    /// machine.
    pub fn from_responses(
        tables: &[FrequencyResponses],
        how: &IdentifyElements,
    ) -> Result<Self, AnalysisError> {
        how.machine.assembly().map_err(AnalysisError::machine)?;
        how.refuse_force_noise("frequency responses")?;
        joined(tables.iter().map(|table| from_table(table, how)))
    }

    /// Returns the data with the measured receptances of some parts of the machine. Each table has
    /// the receptance of one part, measured while it was not connected to the other parts. A point
    /// of a table is the degree of freedom with the same name in the field `measured` of the
    /// machine.
    ///
    /// # Errors
    /// [`AnalysisError::NoResponse`] if a response between two degrees of freedom of a part is
    /// missing, [`AnalysisError::Setting`] if a frequency of the data is missing.
    pub fn with_parts(
        mut self,
        parts: &[FrequencyResponses],
        how: &IdentifyElements,
    ) -> Result<Self, AnalysisError> {
        self.part = Some(receptance_of(parts, &self.lines, &how.machine.machine.measured)?);
        Ok(self)
    }
}

fn refused(setting: &'static str, why: String) -> AnalysisError {
    AnalysisError::Setting { setting, why }
}

fn from_table(
    table: &FrequencyResponses,
    how: &IdentifyElements,
) -> Result<ElementData, AnalysisError> {
    let instruments = &how.machine.instruments;
    let (sensors, inputs) = (&instruments.sensors, &instruments.inputs);
    let band = |hz: f64| how.band.is_none_or(|band| (band.low_hz..=band.high_hz).contains(&hz));
    let rows: Vec<usize> = (0..table.frequency_hz.len())
        .filter(|row| table.frequency_hz[*row] > 0.0 && band(table.frequency_hz[*row]))
        .collect();
    let omega: Vec<f64> = rows.iter().map(|row| TAU * table.frequency_hz[*row]).collect();
    let of_inputs = inputs.iter().enumerate().filter(|(_, input)| {
        table.functions.iter().any(|function| function.reference == input.name())
    });
    let mut tests = Vec::new();
    for (at, input) in of_inputs {
        let responses = sensors.iter().map(|sensor| response(table, sensor, input.name()));
        let responses = responses.collect::<Result<Vec<_>, _>>()?;
        let unit = |_, column| Complex::from(if column == at { 1.0 } else { 0.0 });
        let forces = DMatrix::from_fn(rows.len(), inputs.len(), unit);
        let outputs =
            DMatrix::from_fn(rows.len(), sensors.len(), |row, of| responses[of].values[rows[row]]);
        let mut lines = LineData::new(omega.clone(), forces, outputs, Transient::None)?;
        let stated: Option<Vec<&Vec<f64>>> =
            responses.iter().map(|function| function.standard_error.as_ref()).collect();
        let source = stated.as_ref().map(|_| NoiseSource::Stated);
        if let Some(errors) = stated {
            lines = lines.with_noise(noise(&errors, &rows, inputs.len())?)?;
        }
        let lines = ElementData::kept(lines, spacing_hz(table), how)?;
        let test = TestRow { file: table.file.clone(), kind: TestKind::Responses, window: None };
        let noise = match source {
            Some(_) => "from the standard errors of the table",
            None => "taken from the residual",
        };
        let data = ElementData::from_test(lines, test, Channels::default());
        tests.push(Ok(ElementData { source, noise: noise.into(), ..data }));
    }
    if tests.is_empty() {
        let names: Vec<&str> = inputs.iter().map(|input| input.name()).collect();
        let why = format!("{} has no response to {}", table.file, names.join(", "));
        return Err(refused("machine", why));
    }
    let mut data = joined(tests)?;
    data.remarks = table.remarks.clone();
    Ok(data)
}

/// Returns the response at the point of a sensor, and checks its quantity.
fn response<'a>(
    table: &'a FrequencyResponses,
    sensor: &Sensor,
    input: &str,
) -> Result<&'a ResponseFunction, AnalysisError> {
    let named = |f: &&ResponseFunction| f.response == sensor.name && f.reference == input;
    let function = table.functions.iter().find(named).ok_or_else(|| AnalysisError::NoResponse {
        file: table.file.clone(),
        response: sensor.name.clone(),
        force: input.into(),
        advice: "",
    })?;
    match function.quantity.filter(|quantity| *quantity != sensor.quantity) {
        None => Ok(function),
        Some(quantity) => {
            let (name, wanted) = (&sensor.name, sensor.quantity);
            let why = format!(
                "{} states {quantity} at {name:?}, but that sensor measures {wanted}",
                table.file
            );
            Err(refused("machine", why))
        }
    }
}

/// Returns the noise from standard errors; each standard error applies to the real part and to the
/// imaginary part.
fn noise(errors: &[&Vec<f64>], rows: &[usize], inputs: usize) -> Result<LineNoise, AnalysisError> {
    let covariance = rows.iter().map(|row| {
        let variances = errors.iter().map(|error| Complex::from(2.0 * error[*row] * error[*row]));
        let none = std::iter::repeat_n(Complex::default(), inputs);
        DMatrix::from_diagonal(&DVector::from_iterator(
            errors.len() + inputs,
            variances.chain(none),
        ))
    });
    Ok(LineNoise::new(covariance.collect())?)
}

/// Returns the smallest distance between two frequencies of a table, in Hz.
fn spacing_hz(table: &FrequencyResponses) -> f64 {
    let mut sorted = table.frequency_hz.clone();
    sorted.sort_by(f64::total_cmp);
    let gaps = sorted.windows(2).map(|pair| pair[1] - pair[0]).filter(|gap| *gap > 0.0);
    gaps.fold(f64::INFINITY, f64::min)
}

/// Returns the receptance of parts that are not connected to each other, at the lines of the data.
fn receptance_of(
    parts: &[FrequencyResponses],
    lines: &LineData,
    measured: &[String],
) -> Result<MeasuredReceptance, AnalysisError> {
    let d = measured.len();
    let none = DMatrix::<Complex<f64>>::zeros(d, d);
    let mut receptance = vec![none; lines.len()];
    let mut variance = vec![DMatrix::<f64>::zeros(d, d); lines.len()];
    let mut is_stated = true;
    let mut is_known = vec![false; d];
    for part in parts {
        let rows = rows_at(part, lines.omega())?;
        let is_here = |name: &String| {
            part.functions.iter().any(|f| f.response == *name || f.reference == *name)
        };
        let dofs: Vec<usize> = (0..d).filter(|at| is_here(&measured[*at])).collect();
        for row in &dofs {
            is_known[*row] = true;
            for column in &dofs {
                let function = between(part, &measured[*row], &measured[*column])?;
                is_stated &= function.standard_error.is_some();
                for (line, at) in rows.iter().enumerate() {
                    let quantity = function.quantity.unwrap_or(ResponseQuantity::Displacement);
                    let factor = quantity.per_displacement(lines.omega()[line]);
                    receptance[line][(*row, *column)] = function.values[*at] / factor;
                    let error = function.standard_error.as_ref().map_or(0.0, |errors| errors[*at]);
                    variance[line][(*row, *column)] = 2.0 * error * error / factor.norm_sqr();
                }
            }
        }
    }
    if let Some(at) = is_known.iter().position(|known| !known) {
        let why = format!(
            "no table has a response or a force at {:?}, a measured degree of freedom",
            measured[at]
        );
        return Err(refused("part", why));
    }
    Ok(MeasuredReceptance { receptance, variance: is_stated.then_some(variance) })
}

/// Returns the response between two points of a part, in one direction or, by reciprocity, in the
/// opposite direction.
fn between<'a>(
    part: &'a FrequencyResponses,
    response: &str,
    force: &str,
) -> Result<&'a ResponseFunction, AnalysisError> {
    let find = |response: &str, force: &str| {
        part.functions.iter().find(|f| f.response == response && f.reference == force)
    };
    find(response, force).or_else(|| find(force, response)).ok_or_else(|| {
        AnalysisError::NoResponse {
            file: part.file.clone(),
            response: response.into(),
            force: force.into(),
            advice: "",
        }
    })
}

/// Returns the rows of a table at the frequencies of the data.
fn rows_at(part: &FrequencyResponses, omega: &[f64]) -> Result<Vec<usize>, AnalysisError> {
    let row = |omega: &f64| {
        let hz = omega / TAU;
        let is_same = |of: &f64| (of - hz).abs() <= SAME_FREQUENCY * hz;
        part.frequency_hz.iter().position(is_same).ok_or_else(|| {
            let why =
                format!(
                    "{} has no response at {hz} Hz, but the other data have this frequency: all data need the same \
                     frequencies",
                    part.file
                );
            refused("part", why)
        })
    };
    omega.iter().map(row).collect()
}
