//! Columns over time, with their spectra.

use mechid_analysis::Inspected;
use mechid_analysis::inspect::Drawn;
use mechid_plot::{Axis, Color, Curve, Figure, Panel};
use mechid_signal::message;

use crate::ReportError;

/// Minimum amplitude that is considered for the range of the axis, relative to the largest
/// amplitude; smaller ones are rounding errors.
const FAINTEST: f64 = 1e-5;

/// The lower end of an amplitude axis, without the margin, is at most this fraction of the largest
/// amplitude.
const MAX_LOWER_END: f64 = 1e-2;

/// Maximum number of characters of a title above a panel.
const TITLE_LENGTH: usize = 40;

/// Returns a row of panels for each column: the whole window on the left, amplitudes on the right.
///
/// # Errors
/// [`ReportError::NoColumnToDraw`].
pub fn figure(inspected: &Inspected) -> Result<Figure, ReportError> {
    let file = &inspected.summary().file;
    if inspected.drawn().is_empty() {
        return Err(ReportError::NoColumnToDraw { file: file.clone() });
    }
    let title = match inspected.spectral_samples() {
        Some((first, last)) => format!("{file}; spectra of samples {first} to {last}"),
        None => file.clone(),
    };
    let dt = inspected.dt();
    let columns = inspected.drawn().iter();
    let rows = columns.flat_map(|column| [history(column, dt), spectrum(column, dt)]);
    Ok(rows.fold(Figure::new(title), Figure::panel).columns(2).share_x())
}

/// Returns a separate figure for each column, by its name: its history above its spectrum.
///
/// # Errors
/// As [`figure`].
pub fn figures(inspected: &Inspected) -> Result<Vec<(String, Figure)>, ReportError> {
    if inspected.drawn().is_empty() {
        return Err(ReportError::NoColumnToDraw { file: inspected.summary().file.clone() });
    }
    let dt = inspected.dt();
    let of_column = |column: &Drawn| {
        let figure = Figure::new("").panel(history(column, dt).title(""));
        (shortened(&column.name), figure.panel(spectrum(column, dt)))
    };
    Ok(inspected.drawn().iter().map(of_column).collect())
}

fn history(column: &Drawn, dt: Option<f64>) -> Panel {
    let points = column.extremes.points();
    let (axis, (x, y)): (_, (Vec<f64>, Vec<f64>)) = match dt {
        Some(dt) => (
            Axis::linear("Time in the window", "s"),
            points.map(|(k, value)| (k as f64 * dt, value)).unzip(),
        ),
        None => (
            Axis::linear("Sample", ""),
            points.map(|(k, value)| ((column.start + k + 1) as f64, value)).unzip(),
        ),
    };
    Panel::new(axis, Axis::linear("Value", unit(column)))
        .title(shortened(&column.name))
        .curve(Curve::line("", &x, &y).width(1.0))
}

fn spectrum(column: &Drawn, dt: Option<f64>) -> Panel {
    let per_second = |cycles: f64| dt.map_or(cycles, |dt| cycles / dt);
    let unit_of_frequency = if dt.is_some() { "Hz" } else { "cycles/sample" };
    let half = per_second(0.5);
    let frequency = Axis::linear("Frequency", unit_of_frequency).range(0.0, half);
    let points = column.lines.points().filter(|(_, amplitude)| *amplitude > 0.0);
    let mut points: Vec<(f64, f64)> = points.map(|(cycles, a)| (per_second(cycles), a)).collect();
    let panel = |y: Axis, title: String, curve: Curve| {
        Panel::new(frequency, y).title(title).curve(curve.color(Color::VERMILION))
    };
    let Some((low, high)) = amplitude_range(&points) else {
        let nothing = Curve::line("", &[0.0, half], &[0.0, 0.0]);
        return panel(Axis::linear("Amplitude", unit(column)), "constant".into(), nothing);
    };
    let period = column.lines.period();
    if period.is_some() {
        // A stem below the axis is not visible, whereas a line continues below it.
        points.retain(|(_, amplitude)| *amplitude > low);
    }
    let (hz, amplitude): (Vec<f64>, Vec<f64>) = points.into_iter().unzip();
    let (title, curve) = match period {
        Some(period) => (
            format!("period of {}", message::count(period, "sample")),
            Curve::stems("", &hz, &amplitude),
        ),
        None => ("Hann window, no period".into(), Curve::line("", &hz, &amplitude).width(1.0)),
    };
    panel(Axis::log10("Amplitude", unit(column)).range(low, high), title, curve)
}

/// Returns the range of an axis for these amplitudes; `None` if there are no amplitudes.
fn amplitude_range(points: &[(f64, f64)]) -> Option<(f64, f64)> {
    let amplitudes = points.iter().map(|(_, amplitude)| *amplitude);
    let strongest = amplitudes.clone().reduce(f64::max)?;
    let faintest =
        amplitudes.filter(|a| *a > FAINTEST * strongest).fold(MAX_LOWER_END * strongest, f64::min);
    Some((faintest / 1.5, strongest * 1.5))
}

fn unit(column: &Drawn) -> &str {
    column.unit.as_ref().map_or("", |unit| unit.name.as_str())
}

fn shortened(name: &str) -> String {
    if name.chars().count() <= TITLE_LENGTH {
        name.to_owned()
    } else {
        name.chars().take(TITLE_LENGTH - 1).chain(['…']).collect()
    }
}
