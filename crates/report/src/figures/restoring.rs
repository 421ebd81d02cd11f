//! Restoring force of a system with nonlinear terms: its surface, its springs and dampers, and the
//! residual.

use mechid_analysis::Identified;
use mechid_analysis::identify::rows::CONFIDENCE;
use mechid_analysis::identify::{RestoringForce, WithTerms};
use mechid_analysis::text::{compact, significant};
use mechid_plot::{Axis, Color, Curve, Figure, Panel};

use crate::ReportError;

/// Maximum number of points of the surface that are drawn.
const SHOWN: usize = 2000;

/// Number of ranges of force, each with its own colour.
const LEVELS: usize = 6;

/// Number of points of a curve.
const POINTS: usize = 81;

/// Range of the curves, as a multiple of the largest displacement and velocity in the data.
const REACH: f64 = 1.2;

/// Returns the nonlinear terms of a fit of whole periods, and the points of the restoring-force
/// surface; `None` for any other fit.
pub fn whole_periods(identified: &Identified) -> Option<(&WithTerms, &RestoringForce)> {
    let fitted = identified.fitted().nonlinear.as_ref()?;
    Some((fitted, fitted.restoring.as_ref()?))
}

/// Returns four panels for each degree of freedom: the measured points of the surface over
/// displacement and velocity; one panel each for spring and damper, with the confidence interval
/// and with the measured points minus all other terms of the model; the residual over the
/// displacement.
///
/// # Errors
/// [`ReportError::Estimate`] if an interval cannot be computed.
pub fn figure(
    title: &str,
    fitted: &WithTerms,
    points: &RestoringForce,
) -> Result<Figure, ReportError> {
    let dofs = points.displacement.channels();
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

/// Returns the points over displacement and velocity, grouped by ranges of force.
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

/// Returns the force of the springs over the displacement, or of the dampers over the velocity, for
/// one degree of freedom while the others are at rest. The points are the sum of the force of the
/// model and the residual at each sample.
fn side(
    fitted: &WithTerms,
    dof: usize,
    values: &[f64],
    residual: &[f64],
    spring: bool,
) -> Result<Vec<Curve>, ReportError> {
    let dofs = fitted.estimate.linear().dof();
    let force = |value: f64| {
        let mut moved = vec![0.0; dofs];
        moved[dof] = value;
        let at_rest = vec![0.0; dofs];
        let [x, v] = if spring { [&moved, &at_rest] } else { [&at_rest, &moved] };
        let fitted_force = fitted.estimate.restoring_force(x, v)?[dof];
        Ok::<_, ReportError>((fitted_force.value, fitted_force.interval(CONFIDENCE)?))
    };
    let largest = values.iter().fold(0.0f64, |largest, value| largest.max(value.abs()));
    let grid: Vec<f64> = (0..POINTS)
        .map(|k| REACH * largest * (2.0 * k as f64 / (POINTS - 1) as f64 - 1.0))
        .collect();
    let forces: Vec<(f64, [f64; 2])> =
        grid.iter().map(|at| force(*at)).collect::<Result<_, _>>()?;
    let curve: Vec<f64> = forces.iter().map(|(value, _)| *value).collect();
    let bound = |end: usize| forces.iter().map(|(_, interval)| interval[end]).collect::<Vec<_>>();
    let measured: Vec<f64> = values
        .iter()
        .zip(residual)
        .map(|(at, left)| Ok(force(*at)?.0 + left))
        .collect::<Result<_, ReportError>>()?;
    let name = format!("{} % interval", compact(100.0 * CONFIDENCE, 3));
    Ok(vec![
        Curve::points("measured, minus all other terms of the model", values, &measured)
            .color(Color::GREY),
        Curve::band(name, &grid, &bound(0), &bound(1)),
        Curve::line("identified", &grid, &curve).color(Color::VERMILION),
    ])
}
