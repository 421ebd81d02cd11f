//! Error of a sweep as a function of its settings.

use mechid_analysis::SweepSummary;
use mechid_plot::charts::{self, Quantity, Series};
use mechid_plot::{Axis, Figure};

/// Returns the error as a function of the settings.
pub fn figure(swept: &SweepSummary) -> Figure {
    let points = || swept.points.iter().filter_map(|p| Some((p.setting, 100.0 * p.error?)));
    let (x, y): (Vec<f64>, Vec<f64>) = points().unzip();
    let (name, unit) = swept.setting.label();
    let error = if swept.has_reference() { "Worst error" } else { "Worst standard error" };
    charts::sweep(
        &format!("Error over {name}: {}", swept.estimator),
        Axis::linear(name, unit),
        Quantity::new(error, "%"),
        &[Series::new(swept.estimator, &x, &y)],
        None,
    )
}
