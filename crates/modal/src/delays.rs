//! Delays of the outputs relative to the forces, for example due to filters or scanning converters.
//!
//! A delay changes the phase of an output in proportion to the frequency. Modes and a few residual
//! terms cannot describe this change, so that a fit without the delay has false modes.

use std::f64::consts::{FRAC_PI_4, TAU};

use nalgebra::Complex;

use crate::limits::{
    DELAY_OUTPUTS, DELAY_SETTLED, DELAY_STEPS, LEAST_DELAY_INFORMATION, MAX_DELAY_STEP,
    MAX_DELAY_TURNS, ROUGH_DELAY_STEPS,
};
use crate::lines::Lines;
use crate::model::{Model, first_powers};
use crate::projection::{Design, Projection, Weights};
use crate::residues::FreeResidues;
use crate::search::Fit;

type C = Complex<f64>;

/// Delay of an output relative to the forces.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OutputDelay {
    /// Delay, in s; negative if the forces are late.
    pub seconds: f64,
    /// Standard error, in s.
    pub standard_error: f64,
}

impl OutputDelay {
    /// Returns a delay (s) without an error.
    pub(crate) fn exact(seconds: f64) -> Self {
        Self { seconds, standard_error: 0.0 }
    }
}

/// Returns the delays (s), one for each output, for which a model of modes at `poles` (rad/s) and
/// of the first residual terms explains the outputs best. `None` if the delays improve the fit by
/// less than the penalty of one unknown per output in Schwarz's criterion.
///
/// The first residual terms have even powers of jω, like the response of undamped modes outside the
/// band. They cannot represent a delay, because the effect of a delay has odd powers, too. The
/// residues are free. A grid of delays common to some outputs gives the initial estimate;
/// Gauss–Newton steps of each output follow.
pub(crate) fn apparent_delays(lines: &Lines, poles: &[C]) -> Option<Vec<f64>> {
    if lines.inputs() == 0 || poles.is_empty() {
        return None;
    }
    let (modes, loads, outputs) = (poles.len(), lines.loads.len(), lines.outputs.len());
    let model = Model {
        poles: poles.to_vec(),
        participation: vec![vec![C::from(1.0); loads]; modes],
        gauge: vec![0; modes],
        powers: first_powers(lines),
        reference: lines.band().1,
    };
    let weights = Weights { spectrum_shape: vec![1.0; lines.len()], level: vec![1.0; outputs] };
    let trial = Trial { lines, design: FreeResidues { model: &model }, weights: &weights };
    let delays = trial.refined(vec![trial.common_delay(); outputs], ROUGH_DELAY_STEPS)?;
    let before = trial.residuals(trial.advanced(&vec![0.0; outputs]));
    let after = trial.residuals(trial.advanced(&delays));
    let gain = |(before, after): (&Vec<f64>, &Vec<f64>)| {
        effective_count(after) * (square(before) / square(after)).ln()
    };
    let gain: f64 = before.iter().zip(&after).map(gain).sum();
    log::debug!("delays of {outputs} responses, gain {gain:.0}");
    (gain > outputs as f64 * lines.schwarz()).then_some(delays)
}

/// Returns the delays of the outputs. The search starts from `initial` delays (s); modes, residual
/// terms and weights are those of a fit. The delay is zero for outputs whose delay the data do not
/// determine. `None` if the delays improve the fit by less than the penalty of one unknown for each
/// delay.
///
/// For displacements, complex shapes can represent a small delay up to second order, so that the
/// derivative of the residual with respect to the delay contains only noise. For accelerations,
/// residual terms with odd powers of jω remain in this derivative.
pub(crate) fn determined_delays(
    lines: &Lines,
    fit: &Fit<'_>,
    initial: Vec<f64>,
) -> Option<Vec<OutputDelay>> {
    let trial = Trial { lines, design: fit.model.clone(), weights: &fit.weights };
    let outputs = initial.len();
    let delays = trial.refined(initial, DELAY_STEPS)?;
    let (values, slopes) = trial.residuals_and_slopes(&delays);
    let omega = trial.omega_of_values();
    let delay = |((value, slope), seconds): ((&Vec<f64>, &Vec<f64>), &f64)| {
        let variance = square(value) / value.len() as f64;
        let by_noise: f64 = value.iter().zip(&omega).map(|(r, omega)| (r * omega).powi(2)).sum();
        let information = square(slope) - by_noise;
        let is_determined = information > LEAST_DELAY_INFORMATION * square(slope);
        let standard_error = (variance / information).sqrt();
        is_determined.then_some(OutputDelay { seconds: *seconds, standard_error })
    };
    let determined: Vec<_> = values.iter().zip(&slopes).zip(&delays).map(delay).collect();
    let count = determined.iter().flatten().count();
    let or_zero = |delay: Option<OutputDelay>| delay.unwrap_or(OutputDelay::exact(0.0));
    let delays: Vec<OutputDelay> = determined.into_iter().map(or_zero).collect();
    let seconds: Vec<f64> = delays.iter().map(|delay| delay.seconds).collect();
    let sum = |delays: &[f64]| -> f64 { trial.costs(delays).iter().sum() };
    let gain = sum(&vec![0.0; outputs]) - sum(&seconds);
    log::debug!("delays of {count} responses, gain {gain:.0} with the final modes");
    (count > 0 && gain > count as f64 * lines.schwarz()).then_some(delays)
}

/// Linear fit of the outputs after removal of a trial delay from each output.
struct Trial<'a, D> {
    lines: &'a Lines,
    design: D,
    weights: &'a Weights,
}

impl<D: Design> Trial<'_, D> {
    /// Returns the whitened residuals of columns, each with the index of its output.
    fn residuals(&self, columns: Vec<(usize, Vec<C>)>) -> Vec<Vec<f64>> {
        let level = columns.iter().map(|(output, _)| self.weights.level[*output]).collect();
        let outputs: Vec<Vec<C>> = columns.into_iter().map(|(_, column)| column).collect();
        let mut residuals = vec![Vec::with_capacity(2 * self.lines.len()); outputs.len()];
        let lines = Lines { outputs, ..self.lines.clone() };
        let mut projection = Projection::default();
        projection.whiten(
            &lines,
            &Weights { spectrum_shape: self.weights.spectrum_shape.clone(), level },
        );
        projection.solve(&lines, &self.design);
        for (arrays, block) in projection.blocks.iter().zip(&lines.blocks) {
            let columns = arrays.residual.chunks_exact(2 * block.len());
            residuals.iter_mut().zip(columns).for_each(|(to, column)| to.extend_from_slice(column));
        }
        residuals
    }

    /// Returns the angular frequency of each value of a residual.
    fn omega_of_values(&self) -> Vec<f64> {
        let blocks = self.lines.blocks.iter().map(|block| &self.lines.omega[block.rows.clone()]);
        blocks.flat_map(|omega| omega.iter().chain(omega).copied()).collect()
    }

    /// Returns the outputs without their delays.
    fn advanced(&self, delays: &[f64]) -> Vec<(usize, Vec<C>)> {
        let advanced =
            |(output, delay): (usize, &f64)| (output, self.lines.advanced_output(output, *delay));
        delays.iter().enumerate().map(advanced).collect()
    }

    /// Returns the sum of the squared residuals of each output.
    fn costs(&self, delays: &[f64]) -> Vec<f64> {
        self.residuals(self.advanced(delays)).iter().map(|residual| square(residual)).collect()
    }

    /// Returns the delay (s) on a grid that, as a common delay, best fits the [`DELAY_OUTPUTS`]
    /// outputs whose power the model without delays explains best.
    fn common_delay(&self) -> f64 {
        let costs = self.costs(&vec![0.0; self.lines.outputs.len()]);
        let unexplained = |output: &usize| {
            let power: f64 = self.lines.outputs[*output].iter().map(|z| z.norm_sqr()).sum();
            costs[*output] / power
        };
        let mut strongest: Vec<usize> = (0..self.lines.outputs.len()).collect();
        strongest.sort_by(|a, b| unexplained(a).total_cmp(&unexplained(b)));
        strongest.truncate(DELAY_OUTPUTS);
        let steps = (MAX_DELAY_TURNS * TAU / FRAC_PI_4) as i32;
        let grid = (-steps..=steps).map(|k| f64::from(k) * FRAC_PI_4 / self.lines.band().1);
        let grid: Vec<f64> = grid.collect();
        let advanced = |delay: &f64| {
            let delay = *delay;
            let one = move |output: &usize| (*output, self.lines.advanced_output(*output, delay));
            strongest.iter().map(one).collect::<Vec<_>>()
        };
        let residuals = self.residuals(grid.iter().flat_map(advanced).collect());
        let cost = |residuals: &[Vec<f64>]| residuals.iter().map(|r| square(r).ln()).sum::<f64>();
        let costs = residuals.chunks_exact(strongest.len()).map(cost);
        let best = grid.iter().zip(costs).min_by(|a, b| a.1.total_cmp(&b.1));
        best.map_or(0.0, |(delay, _)| *delay)
    }

    /// Returns the residuals of the outputs and their derivatives with respect to the delays.
    fn residuals_and_slopes(&self, delays: &[f64]) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
        let mut columns = self.advanced(delays);
        let slope = |(output, column): &(usize, Vec<C>)| {
            let turned = column.iter().zip(&self.lines.omega);
            (*output, turned.map(|(z, omega)| z * C::new(0.0, *omega)).collect())
        };
        let slopes: Vec<(usize, Vec<C>)> = columns.iter().map(slope).collect();
        columns.extend(slopes);
        let mut residuals = self.residuals(columns);
        let slopes = residuals.split_off(delays.len());
        (residuals, slopes)
    }

    /// Returns the delays after Gauss–Newton steps. The steps end when each step is a small
    /// fraction of the standard error of its delay. `None` if a delay is not finite or exceeds the
    /// maximum.
    fn refined(&self, mut delays: Vec<f64>, most: usize) -> Option<Vec<f64>> {
        let largest = MAX_DELAY_TURNS * TAU / self.lines.band().1;
        for _ in 0..most {
            let (values, slopes) = self.residuals_and_slopes(&delays);
            let mut settled = true;
            for ((delay, value), slope) in delays.iter_mut().zip(&values).zip(&slopes) {
                let product: f64 = value.iter().zip(slope).map(|(a, b)| a * b).sum();
                let step = -product / square(slope);
                *delay += step.clamp(-MAX_DELAY_STEP * largest, MAX_DELAY_STEP * largest);
                let error = (square(value) / value.len() as f64 / square(slope)).sqrt();
                settled &= step.abs() < DELAY_SETTLED * error;
            }
            if !delays.iter().all(|delay| delay.abs() < largest) {
                return None;
            }
            if settled {
                break;
            }
        }
        Some(delays)
    }
}

/// Returns the effective number 3(Σr²)²/Σr⁴ of residuals r. For normal residuals, this number is
/// equal to the number of residuals. It is smaller if errors of the initial poles make the
/// residuals near resonances large.
fn effective_count(values: &[f64]) -> f64 {
    let fourth: f64 = values.iter().map(|value| value.powi(4)).sum();
    3.0 * square(values).powi(2) / fourth
}

fn square(values: &[f64]) -> f64 {
    values.iter().map(|value| value * value).sum()
}
