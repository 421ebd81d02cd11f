//! Responses of the sensors over frequency, measured and computed with the identified system.

use mechid_analysis::IdentifiedElements;
use mechid_analysis::elements::SensorSpectrum;
use mechid_plot::{Axis, Color, Curve, Figure, Panel};

/// Maximum number of sensors that are drawn, one panel each.
const SENSORS: usize = 6;

/// Maximum number of points of a curve; a panel cannot show more.
const POINTS: usize = 4000;

/// Returns a figure of the amplitudes for each sensor, with the name of the sensor.
pub fn set(identified: &IdentifiedElements) -> Vec<(String, Figure)> {
    let spectra = identified.spectra();
    spectra
        .iter()
        .map(|sensor| (sensor.name.clone(), Figure::new(&sensor.name).panel(panel(sensor))))
        .collect()
}

/// Returns a figure of the amplitudes of the first sensors: measured, computed with the model, and
/// their difference.
pub fn figure(identified: &IdentifiedElements) -> Figure {
    let tests = &identified.summary().tests;
    let files: Vec<&str> = tests.iter().map(|test| test.file.as_str()).collect();
    let spectra = identified.spectra();
    spectra
        .iter()
        .take(SENSORS)
        .fold(Figure::new(files.join(", ")), |figure, sensor| figure.panel(panel(sensor)))
}

fn panel(sensor: &SensorSpectrum) -> Panel {
    let step = sensor.frequency_hz.len().div_ceil(POINTS).max(1);
    let every = |values: &[f64]| -> Vec<f64> { values.iter().copied().step_by(step).collect() };
    let frequency = every(&sensor.frequency_hz);
    let curve = |name: &str, values: &[f64]| Curve::line(name, &frequency, &every(values));
    Panel::new(Axis::linear("Frequency", "Hz"), Axis::log10(&sensor.name, sensor.unit))
        .curve(curve("measured", &sensor.measured).color(Color::GREY).width(2.4))
        .curve(curve("machine", &sensor.modelled).color(Color::VERMILION))
        .curve(curve("difference", &sensor.residual))
}
