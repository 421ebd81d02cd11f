//! Identified modes of a record, and predictions with them.

use std::ops::Range;

use mechid_numerics::Uncertain;
use mechid_spectra::LineData;
use nalgebra::{Complex, DMatrix};
use rayon::prelude::*;

use crate::ModalError;
use crate::compare::{ComparedMode, Comparison, Measured, PairingRule, compare};
use crate::constraint::{self, ConstraintTest, DrivingPoint, ModalConstraint};
use crate::covariance::Covariance;
use crate::delays::OutputDelay;
use crate::indicators::{Indicator, IndicatorError, mac_standard_errors, mpc_with_error};
use crate::limits::GROUP_HALF_WIDTHS;
use crate::lines::Lines;
use crate::modal_model::{ModalGroup, ModalModel, ModalTerm};
use crate::mode::{DroppedCandidate, IdentifiedMode};
use crate::mode_parameters::{MassNormalised, ModeParameters};
use crate::model::ResidualPowers;
use crate::noise::{Noise, shapes};
use crate::order::{removal_losses, required_gain};
use crate::results::identified_mode;
use crate::search::Fit;
use crate::synthesis::add_transients;

type C = Complex<f64>;

/// Identified modes, and the residual terms and the noise that were estimated together with the
/// modes.
#[derive(Debug, Clone)]
pub struct ModalEstimate {
    modes: Vec<IdentifiedMode>,
    /// Parameters of `modes` with their joint covariances.
    parameters: Vec<ModeParameters>,
    constraint_tests: Vec<ConstraintTest>,
    /// Modes of the model that were not requested.
    others: Vec<IdentifiedMode>,
    dropped: Vec<DroppedCandidate>,
    powers: ResidualPowers,
    model: ModalModel,
    delays: Vec<OutputDelay>,
    explained: Vec<f64>,
    noise_level: Vec<f64>,
    noise_spectrum: Vec<Vec<f64>>,
    log_likelihood: f64,
    required_gain: f64,
    /// Variance of the unmeasured force on each mode, for the mode shape as reported.
    unmeasured_variance: Vec<f64>,
    iterations: usize,
}

impl ModalEstimate {
    pub(crate) fn new(
        fit: &Fit<'_>,
        noise: &Noise,
        covariance: &Covariance,
        dropped: Vec<DroppedCandidate>,
        stated: &[bool],
        constraints: &[ModalConstraint],
    ) -> Self {
        let model = &fit.model;
        let shapes = shapes(&fit.projection, &fit.weights, model.modes());
        let gains = removal_losses(fit);
        let (requested, unrequested): (Vec<usize>, Vec<usize>) =
            (0..model.modes()).partition(|mode| stated[*mode]);
        let parameters = |mode: usize| covariance.mode_parameters(fit, mode, &shapes[mode]);
        let constrained = |(index, &mode): (usize, &usize)| {
            let (parameters, tests) = imposed(constraints, parameters(mode), index);
            let identified = identified_mode(fit, noise, &parameters, mode, gains[mode]);
            (identified, (parameters, tests))
        };
        let (modes, (parameters_of_modes, tests)): (Vec<_>, (Vec<_>, Vec<_>)) =
            requested.par_iter().enumerate().map(constrained).unzip();
        let parameters_of_others: Vec<ModeParameters> =
            unrequested.par_iter().map(|mode| parameters(*mode)).collect();
        let unrequested_mode = |(parameters, mode): (&ModeParameters, &usize)| {
            identified_mode(fit, noise, parameters, *mode, gains[*mode])
        };
        let terms = parameters_of_modes
            .iter()
            .chain(&parameters_of_others)
            .map(ModeParameters::term)
            .collect();
        let groups = if constraints.is_empty() {
            let neighbours = neighbours(&parameters_of_modes).into_iter();
            neighbours.map(|range| group(fit, covariance, &requested, &shapes, range)).collect()
        } else {
            groups_of_one(&parameters_of_modes)
        };
        let variance = |(mode, identified): (&usize, &IdentifiedMode)| {
            noise.process[*mode] * power(&shapes[*mode]) / power(&identified.shape)
        };
        let unmeasured_variance = requested.iter().zip(&modes).map(variance).collect();
        let level = |sensor: &Vec<f64>| (sensor.iter().sum::<f64>() / sensor.len() as f64).sqrt();
        Self {
            modes,
            parameters: parameters_of_modes,
            constraint_tests: tests.concat(),
            others: parameters_of_others.iter().zip(&unrequested).map(unrequested_mode).collect(),
            dropped,
            powers: model.powers.clone(),
            model: modal_model(fit, terms, groups),
            delays: fit.lines.delays.clone(),
            explained: explained(fit),
            noise_level: noise.sensor.iter().map(level).collect(),
            noise_spectrum: noise.sensor.clone(),
            log_likelihood: log_likelihood(fit),
            required_gain: required_gain(fit.lines),
            unmeasured_variance,
            iterations: fit.steps,
        }
    }

    /// Returns the modes, by rising frequency.
    pub fn modes(&self) -> &[IdentifiedMode] {
        &self.modes
    }

    /// Returns the poles of all modes of the model, including the modes that were not requested.
    pub(crate) fn poles(&self) -> Vec<C> {
        self.modes.iter().chain(&self.others).map(|mode| mode.pole).collect()
    }

    /// Returns the modal mass of a mode for the shape with a largest entry of 1. The input of
    /// `point` must be a force, and its output must be the `derivative`-th time derivative of the
    /// displacement where the force acts. `None` if there is no such mode, output or input, or if
    /// the mode does not move at the point.
    ///
    /// The mass is valid for light, proportional damping, and is in kg if the input is in N and the
    /// output in m, m/s or m/s². The mass is negative if the response has the wrong sign. A delay
    /// of less than a quarter of a period between the channels does not change the mass.
    ///
    /// # Source
    /// Ewins, *Modal Testing*, 2nd ed. (2000), sections 2.4 and 3.5; the standard error is to first
    /// order.
    pub fn modal_mass(
        &self,
        mode: usize,
        point: DrivingPoint,
        derivative: i32,
    ) -> Option<Uncertain> {
        let parameters = self.parameters.get(mode)?;
        let exists = point.output < parameters.outputs && point.input < parameters.inputs;
        if exists { parameters.modal_mass(point, derivative) } else { None }
    }

    /// Returns the mass-normalised shape of a mode, in kg^(−1/2): its shape with a largest entry of
    /// 1, divided by the root of its modal mass. Arguments are those of
    /// [`modal_mass`](Self::modal_mass); `None` if the modal mass is not positive.
    ///
    /// # Source
    /// Ewins, *Modal Testing*, 2nd ed. (2000), section 2.2 (mass-normalised mode shapes) and 3.5
    /// (a row of a response matrix is as good as a column); the standard errors are to first order.
    pub fn mass_normalised_shape(
        &self,
        mode: usize,
        point: DrivingPoint,
        derivative: i32,
    ) -> Option<MassNormalised> {
        let parameters = self.parameters.get(mode)?;
        let exists = point.output < parameters.outputs && point.input < parameters.inputs;
        if exists { parameters.mass_normalised_shape(point, derivative) } else { None }
    }

    /// Returns the modal phase collinearity of each mode with its standard error; `None` if the
    /// covariance of the shape is not finite.
    ///
    /// # Source
    /// As [`mpc_with_error`].
    pub fn phase_collinearities(&self) -> Vec<Option<Indicator>> {
        let indicator = |parameters: &ModeParameters| {
            Some(mpc_with_error(&parameters.shape_with_covariance()?))
        };
        self.parameters.par_iter().map(indicator).collect()
    }

    /// Returns the standard error of the modal assurance criterion of each pair of modes, modes ×
    /// modes; NaN if the covariance of a shape is not finite.
    ///
    /// # Source
    /// As [`mac_within_set`](crate::indicators::mac_within_set).
    pub fn mac_standard_errors(&self) -> DMatrix<f64> {
        let shapes: Vec<_> =
            self.parameters.iter().map(ModeParameters::shape_with_covariance).collect();
        mac_standard_errors(&shapes, |a, b| self.model.cross_covariance(a, b))
    }

    /// Returns the modes with the joint covariance of their shapes, for comparisons.
    pub fn compared_modes(&self) -> Vec<ComparedMode> {
        let measured = |value: Uncertain| Measured {
            value: value.value,
            standard_error: value.standard_error,
            degrees_of_freedom: value.degrees_of_freedom as f64,
        };
        let compared = |(mode, parameters): (&IdentifiedMode, &ModeParameters)| {
            let shape = parameters.shape_with_covariance()?;
            Some(ComparedMode {
                natural_frequency_hz: measured(mode.natural_frequency_hz),
                damping_ratio: Some(measured(mode.damping_ratio)),
                shape,
            })
        };
        self.modes.iter().zip(&self.parameters).filter_map(compared).collect()
    }

    /// Compares these modes with the modes of another record, or of another part of the same
    /// record, and tests which modes have changed (due to damage, temperature or loosening).
    ///
    /// # Errors
    /// [`IndicatorError::Size`] if the numbers of outputs differ.
    pub fn changes_to(&self, other: &Self) -> Result<Comparison, IndicatorError> {
        compare(&self.compared_modes(), &other.compared_modes(), PairingRule::default())
    }

    /// Returns the same estimate; the standard errors of each mode are multiplied by the entry of
    /// `scales` for this mode (a pure number). Use this method if parts of the data differ by more
    /// than the noise.
    ///
    /// # Errors
    /// [`ModalError::Setting`] for another number of modes, or a scale that is not positive and
    /// finite.
    ///
    /// # Source
    /// Birge (1932), Physical Review 40, 207–227.
    pub fn with_error_scales(mut self, scales: &[f64]) -> Result<Self, ModalError> {
        let refused = |value, required| ModalError::Setting { setting: "scales", value, required };
        if scales.len() != self.modes.len() {
            return Err(refused(scales.len() as f64, "one for each mode"));
        }
        if let Some(bad) = scales.iter().find(|scale| !(scale.is_finite() && **scale > 0.0)) {
            return Err(refused(*bad, "a positive and finite scale"));
        }
        let modes = self.modes.iter_mut().zip(&mut self.parameters);
        for ((mode, parameters), scale) in modes.zip(scales) {
            *mode = mode.clone().with_error_scale(*scale);
            parameters.covariance *= scale * scale;
        }
        self.model.scale_errors(scales);
        Ok(self)
    }

    /// Returns the test of each constraint of the settings on each mode, against the fit without
    /// constraints.
    pub fn constraint_tests(&self) -> &[ConstraintTest] {
        &self.constraint_tests
    }

    /// Returns the rejected candidates, each with the reason for its rejection.
    pub fn dropped(&self) -> &[DroppedCandidate] {
        &self.dropped
    }

    /// Returns, for each output, the fraction of its power in the band that the model explains.
    pub fn variance_explained(&self) -> Vec<f64> {
        self.explained.clone()
    }

    /// Returns, for each sensor, the RMS value of its noise on a line, in the unit of the output;
    /// the noise does not include unmeasured forces.
    pub fn noise_levels(&self) -> &[f64] {
        &self.noise_level
    }

    /// Returns the variance of the noise of each sensor on every line: `[output][line]`; the noise
    /// does not include unmeasured forces.
    pub fn noise_spectra(&self) -> &[Vec<f64>] {
        &self.noise_spectrum
    }

    /// Returns the variance of the unmeasured force on each mode, for the mode shape as reported.
    pub(crate) fn unmeasured_variance(&self) -> &[f64] {
        &self.unmeasured_variance
    }

    /// Returns the log-likelihood at the weights of the fit, without constants.
    pub fn log_likelihood(&self) -> f64 {
        self.log_likelihood
    }

    /// Returns the decrease of −2 log L, a pure number, that a mode must cause to be significant:
    /// the penalty of its parameters.
    ///
    /// # Source
    /// Schwarz (1978), Annals of Statistics 6, 461–464.
    pub fn required_gain(&self) -> f64 {
        self.required_gain
    }

    /// Returns the powers of jω that represent modes outside the band.
    pub fn residual_powers(&self) -> &ResidualPowers {
        &self.powers
    }

    /// Returns the number of steps of all searches.
    pub fn iterations(&self) -> usize {
        self.iterations
    }

    /// Returns the modes and residual terms as frequency responses with their covariance.
    pub fn model(&self) -> &ModalModel {
        &self.model
    }

    /// Returns the delay of each output relative to the forces; the shapes do not contain these
    /// delays. Empty if the data do not determine any delay.
    pub fn delays(&self) -> &[OutputDelay] {
        &self.delays
    }

    /// Returns the frequency response at ω (rad/s), outputs × inputs.
    pub fn response(&self, omega: f64) -> DMatrix<C> {
        self.model.response(omega)
    }

    /// Predicts the outputs of line data (lines × outputs) from its inputs. The transients of open
    /// records are estimated from the outputs: modal loads for each record, and residual terms for
    /// each output.
    ///
    /// # Errors
    /// [`ModalError::Size`] if the numbers of inputs or outputs differ.
    pub fn synthesis(&self, data: &LineData) -> Result<DMatrix<C>, ModalError> {
        let (inputs, outputs) = (data.inputs().ncols(), data.outputs().ncols());
        let (model_inputs, model_outputs) = (self.model.inputs(), self.model.outputs());
        if inputs != model_inputs || outputs != model_outputs {
            return Err(ModalError::Size { inputs, outputs, model_inputs, model_outputs });
        }
        let mut predicted = DMatrix::zeros(data.len(), outputs);
        for (line, omega) in data.omega().iter().enumerate() {
            let row = self.model.undelayed(*omega) * data.inputs().row(line).transpose();
            predicted.row_mut(line).copy_from(&row.transpose());
        }
        let lines = Lines::new(data).advanced(self.delays.clone());
        let modes: Vec<&IdentifiedMode> = self.modes.iter().chain(&self.others).collect();
        add_transients(&lines, &modes, &self.powers.transients, &mut predicted);
        for (output, mut column) in predicted.column_iter_mut().enumerate() {
            for (value, omega) in column.iter_mut().zip(data.omega()) {
                *value *= self.model.delay_factor(output, *omega);
            }
        }
        Ok(predicted)
    }
}

/// Returns the parameters of a mode with the constraints imposed, and the tests of the constraints.
fn imposed(
    constraints: &[ModalConstraint],
    free: ModeParameters,
    index: usize,
) -> (ModeParameters, Vec<ConstraintTest>) {
    let tests = constraint::test(constraints, &free, index);
    let imposed = constraint::impose(constraints, &free).map(|(_, _, mode)| mode);
    (imposed.unwrap_or(free), tests)
}

/// Returns one group for each mode: a constrained estimate has no covariance between different
/// modes.
fn groups_of_one(modes: &[ModeParameters]) -> Vec<ModalGroup> {
    let alone =
        |(index, mode): (usize, &ModeParameters)| ModalGroup::new(vec![index], &mode.covariance);
    modes.iter().enumerate().map(alone).collect()
}

/// Returns the joint covariance of neighbouring modes.
fn group(
    fit: &Fit<'_>,
    covariance: &Covariance,
    requested: &[usize],
    shapes: &[Vec<C>],
    range: Range<usize>,
) -> ModalGroup {
    let modes: Vec<_> =
        requested[range.clone()].iter().map(|mode| (*mode, &shapes[*mode][..])).collect();
    ModalGroup::new(range.collect(), &covariance.joint(fit, &modes).1)
}

/// Returns the frequency responses of a fit with the given modes.
fn modal_model(fit: &Fit<'_>, terms: Vec<ModalTerm>, groups: Vec<ModalGroup>) -> ModalModel {
    ModalModel {
        terms,
        reference: fit.model.reference,
        powers: fit.model.powers.forces.clone(),
        residuals: residual_coefficients(fit),
        delays: fit.lines.delays.iter().map(|delay| delay.seconds).collect(),
        groups,
    }
}

/// Returns the coefficients of the residual terms: `[output][input][power]`.
fn residual_coefficients(fit: &Fit<'_>) -> Vec<Vec<Vec<f64>>> {
    let columns = fit.model.residual_columns(fit.lines);
    let of_output = |output: usize| {
        let unknowns = fit.projection.unknowns_of(output, &fit.weights);
        let of_input = |input: usize| unknowns[columns[input].clone()].to_vec();
        (0..fit.lines.inputs()).map(of_input).collect()
    };
    (0..fit.lines.outputs.len()).map(of_output).collect()
}

/// Returns ranges of neighbouring modes, by rising frequency. Only errors of modes in different
/// ranges are treated as independent.
fn neighbours(modes: &[ModeParameters]) -> Vec<Range<usize>> {
    let poles: Vec<C> = modes.iter().map(ModeParameters::pole).collect();
    let mut ranges: Vec<Range<usize>> = Vec::new();
    for (index, pole) in poles.iter().enumerate() {
        let is_near = |before: C| {
            let width = GROUP_HALF_WIDTHS * -pole.re.min(before.re);
            (pole.im - before.im).abs() < width
        };
        match ranges.last_mut() {
            Some(last) if is_near(poles[index - 1]) => last.end = index + 1,
            _ => ranges.push(index..index + 1),
        }
    }
    ranges
}

fn explained(fit: &Fit<'_>) -> Vec<f64> {
    let lines = fit.lines;
    let mut residual_power = vec![0.0; lines.outputs.len()];
    for (block, arrays) in lines.blocks.iter().zip(&fit.projection.blocks) {
        let n = block.len();
        for (output, column) in arrays.residual.chunks_exact(2 * n).enumerate() {
            let scale = fit.weights.level[output];
            for line in 0..n {
                let power = column[line].powi(2) + column[n + line].powi(2);
                residual_power[output] += power * (scale / arrays.weight[line]).powi(2);
            }
        }
    }
    let total = |output: &Vec<C>| output.iter().map(|z| z.norm_sqr()).sum::<f64>();
    lines
        .outputs
        .iter()
        .zip(&residual_power)
        .map(|(output, residual_power)| 1.0 - residual_power / total(output))
        .collect()
}

/// Returns the log-likelihood at the weights of a fit, without constants.
pub(crate) fn log_likelihood(fit: &Fit<'_>) -> f64 {
    let outputs = fit.weights.level.len() as f64;
    let lines = fit.lines.len() as f64;
    let shapes: f64 = fit.weights.spectrum_shape.iter().map(|value| value.ln()).sum();
    let levels: f64 = fit.weights.level.iter().map(|value| value.ln()).sum();
    -(fit.cost() / 2.0 + 2.0 * (outputs * shapes + lines * levels))
}

/// Returns the sum of the squares of the entries of a shape.
fn power(shape: &[C]) -> f64 {
    shape.iter().map(|z| z.norm_sqr()).sum()
}
