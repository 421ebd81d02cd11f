//! Rules for modes that are significant in the likelihood but are not resonances of the structure.

use std::f64::consts::TAU;

use nalgebra::{Complex, DMatrix};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::covariance::Covariance;
use crate::limits::{
    DIFFERENCE_PROBABILITY, MAX_UNMEASURED_RATIO, MIN_DAMPING_ERRORS, TWIN_HALF_WIDTHS,
};
use crate::mode::DropReason;
use crate::mode_parameters::natural_frequency_and_damping;
use crate::noise::{Noise, shapes};
use crate::results::unmeasured_ratio;
use crate::search::Fit;

/// Returns for each mode the reason to remove it, if any.
pub(crate) fn drop_reasons(
    fit: &Fit<'_>,
    noise: &Noise,
    covariance: &Covariance,
) -> Vec<Option<DropReason>> {
    let model = &fit.model;
    let reason = |mode: usize| {
        if !fit.lines.contains(model.poles[mode]) {
            return None;
        }
        let (_, damping, _) = natural_frequency_and_damping(
            model.poles[mode],
            &covariance.pole_covariance(mode),
            covariance.degrees_of_freedom[mode],
        );
        if damping.value < MIN_DAMPING_ERRORS * damping.standard_error {
            let standard_error = damping.standard_error;
            return Some(DropReason::UndeterminedDamping { standard_error });
        }
        let ratio = unmeasured_ratio(fit.lines, model, noise, mode);
        if let Some(ratio) = ratio.filter(|ratio| *ratio > MAX_UNMEASURED_RATIO) {
            return Some(DropReason::Undriven { ratio });
        }
        None
    };
    let mut reasons: Vec<Option<DropReason>> = (0..model.modes()).map(reason).collect();
    let losses = crate::order::removal_losses(fit);
    let shapes = shapes(&fit.projection, &fit.weights, model.modes());
    for a in 0..model.modes() {
        for b in a + 1..model.modes() {
            let width = TWIN_HALF_WIDTHS * (-model.poles[a].re).max(-model.poles[b].re);
            let near = (model.poles[a].im - model.poles[b].im).abs() < width;
            let inside = [a, b].iter().all(|mode| fit.lines.contains(model.poles[*mode]));
            if near && inside && reasons[a].is_none() && reasons[b].is_none() {
                let differ = differ(fit, covariance, [&shapes[a], &shapes[b]], [a, b]);
                let (weak, strong) = if losses[a] < losses[b] { (a, b) } else { (b, a) };
                let other_hz = model.poles[strong].norm() / TAU;
                reasons[weak] = (!differ).then_some(DropReason::Twin { other_hz });
            }
        }
    }
    reasons
}

/// Returns whether the shapes or participations of two modes differ significantly.
fn differ(
    fit: &Fit<'_>,
    covariance: &Covariance,
    shapes: [&[Complex<f64>]; 2],
    modes: [usize; 2],
) -> bool {
    let size = |output: &usize| shapes[0][*output].norm() * shapes[1][*output].norm();
    let outputs = shapes[0].len();
    let reference = (0..outputs).max_by(|a, b| size(a).total_cmp(&size(b))).unwrap_or(0);
    let (mut statistic, mut freedom) = (0.0, 0.0);
    let mut add = |difference: Complex<f64>, variance: DMatrix<f64>| {
        let determinant = variance[(0, 0)] * variance[(1, 1)] - variance[(0, 1)].powi(2);
        if determinant > 0.0 {
            let (x, y) = (difference.re, difference.im);
            let form = variance[(1, 1)] * x * x - 2.0 * variance[(0, 1)] * x * y
                + variance[(0, 0)] * y * y;
            statistic += form / determinant;
            freedom += 2.0;
        }
    };
    for output in (0..outputs).filter(|output| *output != reference) {
        let value = |k: usize| shapes[k][output] / shapes[k][reference];
        let variance = |k: usize| {
            let levels = &fit.weights.level;
            covariance.normalised_entry_covariance(modes[k], output, reference, shapes[k], levels)
        };
        add(value(0) - value(1), variance(0) + variance(1));
    }
    let [a, b] = modes;
    let gauge = fit.model.gauge[a];
    if gauge == fit.model.gauge[b] {
        let loads = fit.lines.loads.len();
        for load in (0..loads).filter(|load| *load != gauge) {
            let value = |mode: usize| fit.model.participation[mode][load];
            let variance = |mode: usize| {
                let pair = 2 * fit.model.pair_of(mode, load, loads);
                covariance.parameters.view((pair, pair), (2, 2)).into_owned()
            };
            add(value(a) - value(b), variance(a) + variance(b));
        }
    }
    let Ok(distribution) = ChiSquared::new(freedom) else { return false };
    distribution.sf(statistic) < DIFFERENCE_PROBABILITY
}
