//! Restoring force of a machine with nonlinear terms: its surface, its springs and dampers, and what they
//! leave.

use mechid_analysis::identify::WithTerms;
use mechid_analysis::identify::rows::CONFIDENCE;
use mechid_analysis::text::{compact, significant};
use mechid_plot::{Axis, Color, Curve, Figure, Panel};

use crate::ReportError;

/// Points of the surface that a picture shows at most.
const SHOWN: usize = 2000;

/// Ranges of force that the points of a surface are told apart by.
const LEVELS: usize = 6;

/// Points of a curve.
const POINTS: usize = 81;

/// Multiple of the largest displacement and velocity in the data that curves reach to.
const REACH: f64 = 1.2;

/// Returns four panels for each degree of freedom: the measured points of the surface over displacement and
/// velocity; spring and damper with their confidence intervals, beside the points less the rest of
/// the model; the residual over the displacement.
///
/// # Errors
/// [`ReportError::Estimate`] if an interval cannot be computed.
pub fn figure(title: &str, fitted: &WithTerms) -> Result<Figure, ReportError> {
    let (points, dofs) = (&fitted.restoring, fitted.restoring.displacement.channels());
    let every = points.displacement.len().div_ceil(SHOWN);
    let mut figure = Figure::new(format!("Restoring force: {title}")).columns(2);
    for dof in 0..dofs {
        let number = if dofs == 1 { String::new() } else { format!(" {}", dof + 1) };
        let thinned = |record: &mechid_signal::Record| -> Vec<f64> {
            record.channel(dof).iter().step_by(every).copied().collect()
        };
        let [x, v, measured, residual] =
            [&points.displacement, &points.velocity, &points.measured, &points.residual]
                .map(thinned);
        let displacement = || Axis::linear(format!("Displacement{number}"), "m");
        let velocity = || Axis::linear(format!("Velocity{number}"), "m/s");
        let force = |name: &str| Axis::linear(format!("{name}{number}"), "N");
        let surface = Panel::new(displacement(), velocity())
            .title("Measured restoring force")
            .curves(levels(&x, &v, &measured));
        let spring = side(fitted, dof, &x, &residual, true)?;
        let damper = side(fitted, dof, &v, &residual, false)?;
        figure = figure
            .panel(surface)
            .panel(Panel::new(displacement(), force("Spring force")).curves(spring))
            .panel(Panel::new(velocity(), force("Damping force")).curves(damper))
            .panel(
                Panel::new(displacement(), force("Residual force"))
                    .curve(Curve::points("", &x, &residual).color(Color::VERMILION)),
            );
    }
    Ok(figure)
}

/// Points over displacement and velocity, by the range their force lies in.
fn levels(x: &[f64], v: &[f64], force: &[f64]) -> Vec<Curve> {
    let low = force.iter().copied().fold(f64::INFINITY, f64::min);
    let step = (force.iter().copied().fold(f64::NEG_INFINITY, f64::max) - low) / LEVELS as f64;
    let of_level = |level: usize| {
        let [from, to] = [level, level + 1].map(|edge| low + edge as f64 * step);
        let inside = |f: f64| ((f - low) / step).floor().clamp(0.0, LEVELS as f64 - 1.0);
        let at = (0..force.len()).filter(|k| inside(force[*k]) as usize == level);
        let (x, v): (Vec<f64>, Vec<f64>) = at.map(|k| (x[k], v[k])).unzip();
        let name = format!("{} … {} N", significant(from, 2), significant(to, 2));
        (!x.is_empty()).then(|| Curve::points(name, &x, &v))
    };
    (0..LEVELS).filter_map(of_level).collect()
}

/// Force of the springs over the displacement, or of the dampers over the velocity, of one degree of
/// freedom with the others at rest; points are the model and its residual at each sample.
fn side(
    fitted: &WithTerms,
    dof: usize,
    values: &[f64],
    residual: &[f64],
    spring: bool,
) -> Result<Vec<Curve>, ReportError> {
    let dofs = fitted.restoring.displacement.channels();
    let force = |value: f64| {
        let mut moved = vec![0.0; dofs];
        moved[dof] = value;
        let rest = vec![0.0; dofs];
        let [x, v] = if spring { [&moved, &rest] } else { [&rest, &moved] };
        let found = fitted.estimate.restoring_force(x, v)?[dof];
        Ok::<_, ReportError>((found.value, found.interval(CONFIDENCE)?))
    };
    let largest = values.iter().fold(0.0f64, |largest, value| largest.max(value.abs()));
    let grid: Vec<f64> = (0..POINTS)
        .map(|k| REACH * largest * (2.0 * k as f64 / (POINTS - 1) as f64 - 1.0))
        .collect();
    let found: Vec<(f64, [f64; 2])> = grid.iter().map(|at| force(*at)).collect::<Result<_, _>>()?;
    let curve: Vec<f64> = found.iter().map(|(value, _)| *value).collect();
    let bound = |end: usize| found.iter().map(|(_, interval)| interval[end]).collect::<Vec<_>>();
    let measured: Vec<f64> = values
        .iter()
        .zip(residual)
        .map(|(at, left)| Ok(force(*at)?.0 + left))
        .collect::<Result<_, ReportError>>()?;
    let name = format!("{} % interval", compact(100.0 * CONFIDENCE, 3));
    Ok(vec![
        Curve::points("measured, less the rest of the model", values, &measured).color(Color::GREY),
        Curve::band(name, &grid, &bound(0), &bound(1)),
        Curve::line("identified", &grid, &curve).color(Color::VERMILION),
    ])
}
