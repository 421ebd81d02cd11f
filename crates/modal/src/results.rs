//! Results of a mode from a fit and its covariance.

use nalgebra::Complex;

use crate::limits::EDGE_HALF_WIDTHS;
use crate::lines::{Lines, Load};
use crate::mode::IdentifiedMode;
use crate::mode_parameters::ModeParameters;
use crate::model::Model;
use crate::noise::{Noise, modal_gain};
use crate::search::Fit;

/// Returns the power of a mode from the measured forces, and its power from the unmeasured force.
fn powers(lines: &Lines, model: &Model, noise: &Noise, mode: usize) -> (f64, f64) {
    let (mut measured, mut unmeasured) = (0.0, 0.0);
    for block in &lines.blocks {
        for row in block.rows.clone() {
            let gain = modal_gain(model.poles[mode], lines.omega[row]).norm_sqr();
            let load_force = |load: &usize| match lines.loads[*load] {
                Load::Force(_) => model.participation[mode][*load] * lines.load(*load, row),
                Load::Transient(_) => Complex::default(),
            };
            let force: Complex<f64> = block.active.iter().map(load_force).sum();
            measured += gain * force.norm_sqr();
            unmeasured += gain * noise.process[mode];
        }
    }
    (measured, unmeasured)
}

/// Returns the ratio of the unmeasured to the measured modal force, or `None` without measured
/// forces.
pub(crate) fn unmeasured_ratio(
    lines: &Lines,
    model: &Model,
    noise: &Noise,
    mode: usize,
) -> Option<f64> {
    if lines.inputs() == 0 {
        return None;
    }
    let (measured, unmeasured) = powers(lines, model, noise, mode);
    Some((unmeasured / measured).sqrt())
}

/// Returns one mode of a fit with the values of `parameters`; `gain` is the decrease of −2 log L
/// due to the mode.
pub(crate) fn identified_mode(
    fit: &Fit<'_>,
    noise: &Noise,
    parameters: &ModeParameters,
    mode: usize,
    gain: f64,
) -> IdentifiedMode {
    let unmeasured_ratio = unmeasured_ratio(fit.lines, &fit.model, noise, mode);
    let (low, high) = fit.lines.band();
    let pole = parameters.pole();
    let width = EDGE_HALF_WIDTHS * -pole.re;
    IdentifiedMode {
        driven_share: unmeasured_ratio.map(|ratio| 1.0 / (1.0 + ratio * ratio)),
        unmeasured_ratio,
        gain,
        near_edge: pole.im - low < width || high - pole.im < width,
        ..parameters.mode()
    }
}
