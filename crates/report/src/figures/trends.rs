//! Parameters and modes over many records.

use mechid_analysis::fleet::{TrendAxis, TrendPoint, TrendSeries, Trends};
use mechid_analysis::text::significant;
use mechid_plot::{Axis, Color, Curve, Figure, Marker, Panel, Reference};

/// Maximum number of points of a series that are drawn; of a longer series, every k-th point and
/// every outlier are drawn.
pub const DRAWN: usize = 1000;

/// Returns all series, one below the other.
pub fn figure(trends: &Trends) -> Figure {
    let panels = trends.series.iter().map(|series| panel(series, trends.over));
    panels.fold(Figure::new("Results of many records"), Figure::panel).share_x()
}

/// Returns one series: values with 95 % intervals, outliers in another colour, and the median.
pub fn panel(series: &TrendSeries, over: TrendAxis) -> Panel {
    let x = match over {
        TrendAxis::Order => "Record",
        TrendAxis::Number => "Number in the name",
    };
    let every = series.points.len().div_ceil(DRAWN).max(1);
    let usual: Vec<&TrendPoint> =
        series.points.iter().filter(|point| !point.is_outlier).step_by(every).collect();
    let outliers: Vec<&TrendPoint> = series.outliers().collect();
    let curve = |name: &str, points: &[&TrendPoint], slot: usize| {
        let (x, y): (Vec<f64>, Vec<f64>) =
            points.iter().map(|point| (point.at, point.value)).unzip();
        let notes = points.iter().map(|point| note(series, point)).collect();
        Curve::points(name, &x, &y).slot(slot).notes(notes)
    };
    let mut panel =
        Panel::new(Axis::linear(x, ""), Axis::linear(series.name.as_str(), &series.unit));
    panel = panel.curves(bands(series, &usual));
    if !usual.is_empty() {
        panel = panel.curve(curve("value", &usual, 0));
    }
    let (low, high) = range(series, &usual);
    let (near, far): (Vec<&TrendPoint>, Vec<&TrendPoint>) =
        outliers.into_iter().partition(|point| (low..=high).contains(&point.value));
    if !near.is_empty() {
        panel = panel.curve(curve("outlier", &near, 1));
    }
    for (name, is_above, marker) in [
        ("outlier above the axis", true, Marker::Triangle),
        ("outlier below the axis", false, Marker::TriangleDown),
    ] {
        let some = far.iter().filter(|point| (point.value > high) == is_above);
        let (x, notes): (Vec<f64>, Vec<String>) = some.map(|p| (p.at, note(series, p))).unzip();
        if !x.is_empty() {
            let edge =
                if is_above { high - EDGE * (high - low) } else { low + EDGE * (high - low) };
            let edge = vec![edge; x.len()];
            let points = Curve::points(name, &x, &edge).slot(1).marker(marker);
            panel = panel.curve(points.notes(notes));
        }
    }
    for change in &series.changes {
        let label = format!("{}, p {}", change.kind.name(), change.p());
        panel = panel.reference(Reference::vertical(label, change.at).color(Color::PURPLE));
    }
    panel = panel.reference(Reference::horizontal("median", series.median));
    let axis = Axis::linear(series.name.as_str(), &series.unit).range(low, high);
    panel.y(axis)
}

/// Returns the 95 % intervals as bands. A band is interrupted at every step and drift; a value
/// without an interval is not part of a band.
fn bands(series: &TrendSeries, usual: &[&TrendPoint]) -> Vec<Curve> {
    let is_same = |a: &&TrendPoint, b: &&TrendPoint| {
        series.changes.iter().all(|change| (a.at < change.at) == (b.at < change.at))
    };
    let mut bands: Vec<Curve> = Vec::new();
    for run in usual.chunk_by(is_same) {
        let with = run.iter().filter_map(|point| Some((point.at, point.interval?)));
        let (x, ends): (Vec<f64>, Vec<[f64; 2]>) = with.unzip();
        if x.is_empty() {
            continue;
        }
        let edge = |which: usize| -> Vec<f64> { ends.iter().map(|ends| ends[which]).collect() };
        let label = if bands.is_empty() { "95 % interval" } else { "" };
        bands.push(Curve::band(label, &x, &edge(0), &edge(1)).slot(0));
    }
    bands
}

/// Distance from the edge of an axis at which outliers beyond this edge are drawn, as a fraction of
/// the length of the axis.
const EDGE: f64 = 0.04;

/// Margin of an axis, as a fraction of the length of the axis.
const MARGIN: f64 = 0.08;

/// Returns the range of the ordinate. It includes the median and the values without outliers, so
/// that an outlier does not hide the other values.
fn range(series: &TrendSeries, usual: &[&TrendPoint]) -> (f64, f64) {
    let ends = usual.iter().flat_map(|point| match point.interval {
        Some([low, high]) => {
            // An infinite interval would hide the values, so its length is limited.
            let most = 4.0 * series.spread;
            [low.max(point.value - most), high.min(point.value + most)]
        }
        None => [point.value; 2],
    });
    let (low, high) = ends
        .chain([series.median])
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
    if high > low {
        (low - MARGIN * (high - low), high + MARGIN * (high - low))
    } else {
        (low - 0.05 * low.abs() - f64::MIN_POSITIVE, high + 0.05 * high.abs() + f64::MIN_POSITIVE)
    }
}

/// Returns record and value of a point as text.
fn note(series: &TrendSeries, point: &TrendPoint) -> String {
    format!("{}: {} {}", point.record, significant(point.value, 6), series.unit)
}

#[cfg(test)]
mod tests {
    use mechid_analysis::batch::ModeCell;
    use mechid_analysis::{AnalysisError, ResultRow, SavedAnalysis};

    use super::*;

    /// A figure must be drawn even if some values have no standard error; the bands omit these
    /// values.
    #[test]
    fn values_without_an_interval_are_drawn_as_points() {
        let row = |number: usize| {
            let mode = ModeCell {
                natural_frequency_hz: 10.0 + 0.1 * number as f64,
                natural_frequency_standard_error_hz: (number != 1).then_some(0.1),
                damping_ratio: 0.01,
                damping_ratio_standard_error: (number > 3).then_some(0.001),
            };
            let refused = || Err(AnalysisError::NoRecord);
            let rejected = SavedAnalysis::default().row(&format!("r{number}.csv"), refused);
            ResultRow { error: None, modes: vec![mode], ..rejected }
        };
        let rows: Vec<ResultRow> = (0..4).map(row).collect();
        let trends = Trends::from_rows(&rows, TrendAxis::Order);
        let drawn = |series: &TrendSeries| bands(series, &series.points.iter().collect::<Vec<_>>());
        assert_eq!(drawn(&trends.series[0]).len(), 1);
        assert_eq!(drawn(&trends.series[1]).len(), 0);
        let svg = figure(&trends).to_svg().unwrap();
        assert!(svg.contains("95 % interval"));
    }
}
