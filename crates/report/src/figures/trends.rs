//! Parameters and modes over many records.

use mechid_analysis::fleet::{TrendAxis, TrendPoint, TrendSeries, Trends};
use mechid_plot::{Axis, Curve, Figure, Panel, Reference};

/// Number of points of a series that are drawn; of more, every other one or fewer, but every outlier.
pub const DRAWN: usize = 1000;

/// All series below one another.
pub fn figure(trends: &Trends) -> Figure {
    let panels = trends.series.iter().map(|series| panel(series, trends.over));
    panels.fold(Figure::new("Results of many records"), Figure::panel).share_x()
}

/// One series: values with 95 % intervals, outliers in a colour of their own, and the median.
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
        Curve::points(name, &x, &y).slot(slot)
    };
    let ends = usual.iter().map(|point| Some((point.at, point.interval?)));
    let mut panel =
        Panel::new(Axis::linear(x, ""), Axis::linear(series.name.as_str(), &series.unit));
    if let Some(ends) = ends.collect::<Option<Vec<_>>>().filter(|ends| !ends.is_empty()) {
        let x: Vec<f64> = ends.iter().map(|(at, _)| *at).collect();
        let edge =
            |which: usize| -> Vec<f64> { ends.iter().map(|(_, ends)| ends[which]).collect() };
        panel = panel.curve(Curve::band("", &x, &edge(0), &edge(1)).slot(0));
    }
    if !usual.is_empty() {
        panel = panel.curve(curve("value", &usual, 0));
    }
    if !outliers.is_empty() {
        panel = panel.curve(curve("outlier", &outliers, 1));
    }
    panel.reference(Reference::horizontal("median", series.median))
}
