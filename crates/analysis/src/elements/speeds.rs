//! Tables of synchronous responses over the speed of the rotor.

use std::f64::consts::TAU;

use mechid_checks::NoiseSource;
use mechid_io::{Quantity, Table};
use mechid_model::elements::{Input, Speed};
use mechid_spectra::{LineData, LineNoise, Transient};
use nalgebra::{Complex, DMatrix, DVector};

use super::data::{TestKind, TestRow, joined};
use super::{ElementData, IdentifyElements};
use crate::AnalysisError;
use crate::measurement::Channels;

/// Possible names of the column of speeds, each with the factor that converts its values to Hz; the
/// column `speed` must state its unit.
const SPEEDS: [(&str, Option<f64>); 6] = [
    ("speed_rpm", Some(1.0 / 60.0)),
    ("rpm", Some(1.0 / 60.0)),
    ("speed_hz", Some(1.0)),
    ("frequency_hz", Some(1.0)),
    ("speed_rad_s", Some(1.0 / TAU)),
    ("speed", None),
];

impl ElementData {
    /// Reads tables of synchronous responses: one row per speed of a run, with complex amplitudes
    /// of e^{iΩt}.
    ///
    /// The speed is in a column `speed_rpm`, `speed_hz`, `speed_rad_s`, or `speed` with a unit.
    /// Each sensor and each input has the columns NAME_real and NAME_imaginary, or NAME_amplitude
    /// and NAME_phase_deg (or NAME_phase_rad), in SI units or in the units that their headers
    /// state; an unbalance is in kg·m. Optional columns NAME_standard_error have the standard error
    /// of real and imaginary part of a sensor.
    ///
    /// # Errors
    /// [`AnalysisError::Setting`] for a machine whose speed is not `synchronous` and for a missing
    /// column, and if a column contains a value that is not a number.
    pub fn from_speeds(tables: &[Table], how: &IdentifyElements) -> Result<Self, AnalysisError> {
        how.machine.assembly().map_err(AnalysisError::machine)?;
        how.refuse_force_noise("synchronous responses")?;
        if how.machine.instruments.speed != Speed::Synchronous {
            let why = "a table over the speed needs \"speed\": \"synchronous\" in the description of the \
                       machine";
            return Err(AnalysisError::Setting { setting: "machine", why: why.into() });
        }
        joined(tables.iter().map(|table| from_table(table, how)))
    }
}

fn refused(table: &Table, why: &str) -> AnalysisError {
    let why = format!("{}: {why}; its columns are {}", table.file(), table.available());
    AnalysisError::Setting { setting: "speed_table", why }
}

fn from_table(table: &Table, how: &IdentifyElements) -> Result<ElementData, AnalysisError> {
    let instruments = &how.machine.instruments;
    let (p, q) = (instruments.sensors.len(), instruments.inputs.len());
    let omega: Vec<f64> = speeds_hz(table)?.into_iter().map(|hz| TAU * hz).collect();
    let matrix = |columns: Vec<Vec<Complex<f64>>>| {
        DMatrix::from_fn(omega.len(), columns.len(), |row, column| columns[column][row])
    };
    let outputs = instruments
        .sensors
        .iter()
        .map(|sensor| amplitudes(table, &sensor.name, Some(Quantity::Response(sensor.quantity))));
    let inputs = instruments.inputs.iter().map(|input| {
        let quantity = match input {
            Input::Force { .. } => Some(Quantity::Force),
            Input::Support { quantity, .. } => Some(Quantity::Response(*quantity)),
            Input::Unbalance { .. } => None,
        };
        amplitudes(table, input.name(), quantity)
    });
    let outputs = matrix(outputs.collect::<Result<_, _>>()?);
    let inputs = matrix(inputs.collect::<Result<_, _>>()?);
    let mut lines = LineData::new(omega.clone(), inputs, outputs, Transient::None)?;
    let errors = instruments.sensors.iter().map(|sensor| {
        let name = format!("{}_standard_error", sensor.name);
        let column = table.find(&name).ok()?;
        let factor = table.to_si(column, Quantity::Response(sensor.quantity)).ok()?;
        Some(table.values(column).ok()?.iter().map(|error| error * factor).collect())
    });
    let errors: Option<Vec<Vec<f64>>> = errors.collect();
    let source = errors.as_ref().map(|_| NoiseSource::Stated);
    if let Some(errors) = errors {
        let covariance = (0..omega.len()).map(|row| {
            let variance = |at: usize| if at < p { 2.0 * errors[at][row].powi(2) } else { 0.0 };
            DMatrix::from_diagonal(&DVector::from_fn(p + q, |at, _| Complex::from(variance(at))))
        });
        lines = lines.with_noise(LineNoise::new(covariance.collect())?)?;
    }
    let band =
        |omega: f64| how.band.is_none_or(|b| (b.low_hz..=b.high_hz).contains(&(omega / TAU)));
    let lines = lines
        .retained(band)
        .ok_or_else(|| refused(table, "no speed lies in the band (`band_hz`)"))?;
    let lines = ElementData::kept(lines, 0.0, how)?;
    let test = TestRow { file: table.file().to_owned(), kind: TestKind::Speeds, window: None };
    let noise = match source {
        Some(_) => "from the standard errors of the table",
        None => "taken from the residual",
    };
    let data = ElementData::from_test(lines, test, Channels::default());
    Ok(ElementData { source, noise: noise.into(), ..data })
}

/// Returns the speeds, in Hz.
fn speeds_hz(table: &Table) -> Result<Vec<f64>, AnalysisError> {
    let named_column = SPEEDS.iter().find_map(|(name, hz)| Some((table.find(name).ok()?, *hz)));
    let missing = "a column speed_rpm, speed_hz or speed_rad_s is missing";
    let (column, hz) = named_column.ok_or_else(|| refused(table, missing))?;
    let stated = table.unit(column).filter(|unit| unit.quantity == Quantity::Frequency);
    let factor = hz.or(stated.map(|unit| unit.in_si)).ok_or_else(|| {
        refused(table, "the column speed needs a unit, as in speed_rpm or speed_hz")
    })?;
    let speeds: Vec<f64> = table.values(column)?.iter().map(|value| value * factor).collect();
    if speeds.iter().all(|hz| *hz > 0.0) {
        Ok(speeds)
    } else {
        Err(refused(table, "a speed must be positive"))
    }
}

/// Returns the complex amplitudes of a channel, in SI units.
fn amplitudes(
    table: &Table,
    name: &str,
    quantity: Option<Quantity>,
) -> Result<Vec<Complex<f64>>, AnalysisError> {
    let column = |part: &str| table.find(&format!("{name}_{part}")).ok();
    let factor = |column: usize| match quantity {
        Some(quantity) => table.to_si(column, quantity),
        None => Ok(1.0),
    };
    let pairs = |first: usize, second: usize, value: &dyn Fn(f64, f64) -> Complex<f64>| {
        let (a, b) = (table.values(first)?, table.values(second)?);
        let scale = factor(first)?;
        Ok(a.iter().zip(b).map(|(a, b)| value(*a, *b) * scale).collect())
    };
    let degrees = |amplitude: f64, phase: f64| Complex::from_polar(amplitude, phase.to_radians());
    if let (Some(real), Some(imaginary)) = (column("real"), column("imaginary")) {
        return pairs(real, imaginary, &Complex::new);
    }
    let phase = column("phase_deg").map(|at| (at, true));
    let phase = phase.or_else(|| column("phase_rad").map(|at| (at, false)));
    match (column("amplitude"), phase) {
        (Some(amplitude), Some((phase, true))) => pairs(amplitude, phase, &degrees),
        (Some(amplitude), Some((phase, false))) => {
            pairs(amplitude, phase, &|amplitude, phase| Complex::from_polar(amplitude, phase))
        }
        _ => Err(refused(
            table,
            &format!(
                "columns of {name} are missing: {name}_real and {name}_imaginary, or {name}_amplitude and \
                 {name}_phase_deg"
            ),
        )),
    }
}
