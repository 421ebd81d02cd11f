//! Receptance of a system around its modes.

use std::f64::consts::TAU;

use mechid_analysis::text::compact;
use mechid_model::{ResponseQuantity, SecondOrderSystem};
use mechid_plot::Figure;

use super::receptance::Names;
use super::style::{FigureStyle, FrequencyScale, derivative, per_force};
use super::trace::Trace;
use crate::ReportError;

/// Maximum number of degrees of freedom for which every pair of response and force is drawn; with
/// more degrees of freedom, only the driving points are drawn.
const PAIRS: usize = 2;

/// Maximum number of driving points that are drawn: the number of colours of curves.
const DRIVING_POINTS: usize = 6;

/// Ratio of the lowest natural frequency to the lower end of the frequency range, and of the upper
/// end of the range to the highest natural frequency.
const BEYOND: f64 = 5.0;

/// Number of points on the whole axis.
const COARSE: usize = 600;

/// Number of additional points on either side of a mode.
const BESIDE: u32 = 40;

/// Distances from a resonance, in widths of its peak, at which the additional points begin and end.
/// No point is at the resonance itself, because an undamped system has no receptance there.
const BESIDE_WIDTHS: (f64, f64) = (0.05, 20.0);

/// Minimum damping ratio for the width of a peak. With less damping, a peak is drawn only up to 1e5
/// times the response without resonance.
const SHARPEST: f64 = 1e-4;

/// Maximum ratio of a natural frequency that counts as zero to the highest natural frequency.
const ROUNDING: f64 = 1e-7;

/// Maximum number of natural frequencies whose values are listed in the legend.
const LISTED: usize = 3;

/// A natural frequency, in Hz, with its damping ratio.
pub type Resonance = (f64, f64);

/// Returns a figure of magnitude above phase, with a curve for each pair of response and force, and
/// with the natural frequencies marked.
///
/// # Errors
/// [`ReportError::NothingResonates`] if all natural frequencies of the system are zero, and errors
/// of the receptance.
pub fn figure(
    file: &str,
    system: &SecondOrderSystem,
    names: Names<'_>,
    modes: &[Resonance],
    style: FigureStyle,
) -> Result<Figure, ReportError> {
    // Rigid-body modes are at 0 Hz up to rounding, and a logarithmic axis cannot show them.
    let highest = modes.iter().map(|(hz, _)| *hz).fold(0.0, f64::max);
    let resonates = |(hz, _): &Resonance| *hz > ROUNDING * highest;
    let modes: Vec<Resonance> = modes.iter().copied().filter(resonates).collect();
    if modes.is_empty() {
        return Err(ReportError::NothingResonates { file: file.into() });
    }
    let frequency_hz = grid(&modes);
    let omega: Vec<f64> = frequency_hz.iter().map(|hz| TAU * hz).collect();
    let receptances = system.receptances(&omega)?;
    let shown = style.quantity.unwrap_or(ResponseQuantity::Displacement);
    let pairs = pairs(system, names);
    let alone = pairs.len() == 1;
    let traces = pairs.into_iter().map(|(i, j, name)| {
        let name = if alone { String::new() } else { name };
        let responses = omega.iter().zip(&receptances);
        Trace::line(style, name, responses.map(|(w, h)| (*w, h[(i, j)] * derivative(shown, *w))))
    });
    // A response that no force excites is zero, and a logarithmic axis cannot show it.
    let traces: Vec<Trace> = traces.filter(|trace| !trace.is_empty()).collect();
    let title = match system.dof() {
        dof if dof > DRIVING_POINTS => {
            format!("{file}, driving points 1 to {DRIVING_POINTS} of {dof}")
        }
        _ => file.to_owned(),
    };
    let natural: Vec<f64> = modes.iter().map(|(hz, _)| *hz).collect();
    let drawn = style.chart(&title, FrequencyScale::Logarithmic, per_force(shown), [&[], &traces]);
    Ok(drawn.mark_x(&label(&natural), &natural))
}

/// Returns the indices of response and force, and the name, of each curve.
fn pairs(system: &SecondOrderSystem, names: Names<'_>) -> Vec<(usize, usize, String)> {
    let dof = system.dof();
    let name = |i: usize, j: usize| names.pair(i, j);
    if dof > PAIRS {
        return (0..dof.min(DRIVING_POINTS)).map(|i| (i, i, name(i, i))).collect();
    }
    // If the matrices are symmetric, response and force can be interchanged (reciprocity).
    let reciprocal = [system.mass(), system.damping(), system.stiffness()]
        .into_iter()
        .all(|matrix| *matrix == matrix.transpose());
    let all_pairs = (0..dof).flat_map(|i| (0..dof).map(move |j| (i, j)));
    all_pairs
        .filter(|(i, j)| !reciprocal || i <= j)
        .map(|(i, j)| {
            if reciprocal && i != j {
                (i, j, format!("{} = {}", name(i, j), name(j, i)))
            } else {
                (i, j, name(i, j))
            }
        })
        .collect()
}

fn label(natural: &[f64]) -> String {
    let frequencies: Vec<String> = natural.iter().map(|hz| compact(*hz, 5)).collect();
    match frequencies.len() {
        1 => format!("natural frequency, {} Hz", frequencies[0]),
        len if len <= LISTED => format!("natural frequencies, {} Hz", frequencies.join(", ")),
        _ => "natural frequencies".into(),
    }
}

/// Returns frequencies, in Hz, from below to above the modes, with smaller distances near a
/// resonance.
fn grid(modes: &[Resonance]) -> Vec<f64> {
    let lowest = modes.iter().map(|(hz, _)| *hz).fold(f64::INFINITY, f64::min) / BEYOND;
    let highest = modes.iter().map(|(hz, _)| *hz).fold(0.0, f64::max) * BEYOND;
    let step = (highest / lowest).ln() / COARSE as f64;
    let mut grid: Vec<f64> = (0..=COARSE).map(|k| lowest * (step * k as f64).exp()).collect();
    let width = |ratio: f64| ratio.abs().max(SHARPEST);
    let (nearest, farthest) = BESIDE_WIDTHS;
    let growth = (farthest / nearest).powf(1.0 / f64::from(BESIDE));
    for (hz, ratio) in modes {
        let apart = (0..=BESIDE).map(|k| width(*ratio) * nearest * growth.powf(f64::from(k)));
        grid.extend(apart.flat_map(|apart| [hz * (1.0 - apart), hz * (1.0 + apart)]));
    }
    let clear =
        |f: f64| modes.iter().all(|(hz, _)| (f / hz - 1.0).abs() > 0.99 * nearest * SHARPEST);
    grid.retain(|f| (lowest..=highest).contains(f) && clear(*f));
    grid.sort_by(f64::total_cmp);
    grid
}
