//! Identification of the unknowns of a machine.

use mechid_model::elements::{Assembly, Instruments, Machine};
use mechid_spectra::{LineData, Transient};
use nalgebra::{Complex, DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

use super::parts::compared_parts;
use super::{MachineModel, MeasuredPart};
use crate::frequency_domain::PartsComparison;
use crate::likelihood::delay_score::{DelayScore, delay_score};
use crate::likelihood::estimate::LikelihoodEstimate;
use crate::likelihood::fit::{ParameterSpace, fit};
use crate::likelihood::residual::PriorRow;
use crate::likelihood::search::Bounds;
use crate::likelihood::{LikelihoodError, Settings};

/// Measured receptance of a part of a machine: the part with the degrees of freedom
/// [`Machine::measured`], in the order of this list.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredReceptance {
    /// Receptance, d × d, in m/N, one for each line of the data.
    pub receptance: Vec<DMatrix<Complex<f64>>>,
    /// Mean square error E|ΔH|² of each entry, in (m/N)²; `None` if it is unknown.
    pub variance: Option<Vec<DMatrix<f64>>>,
}

/// Identified machine.
#[derive(Debug, Clone, PartialEq)]
pub struct MachineEstimate {
    /// Parameters, intervals, minima and undetermined combinations.
    pub likelihood: LikelihoodEstimate,
    /// The machine with its degrees of freedom by index.
    pub assembly: Assembly,
    /// Variance of the noise of each output, lines × p.
    pub(super) variance: DMatrix<f64>,
    /// Difference of measured and modelled outputs, lines × p, in the units of the outputs; the
    /// transients of open records and the effects of the errors of pulses are subtracted.
    pub errors: DMatrix<Complex<f64>>,
    /// Residual in units of the noise: row 2(p·line + output) is a real part, the next row the
    /// imaginary part.
    pub residual: DVector<f64>,
    /// Columns Q (pure numbers), with the rows of [`MachineEstimate::residual`]: the covariance of
    /// the residual is the identity minus Q Qᵀ. First come orthonormal columns that span the
    /// sensitivities, then the columns that the errors of pulses explain.
    pub explained: DMatrix<f64>,
    /// Comparisons of parts of the data: bands of lines, and records if there are several.
    pub parts: Vec<PartsComparison>,
    /// Delay that explains the largest part of the residual; `None` if the data do not determine a
    /// delay.
    pub delay: Option<DelayScore>,
    /// Part of the machine with a measured receptance, if there is one.
    pub(super) part: Option<MeasuredPart>,
}

impl MachineEstimate {
    /// Returns the same estimate with all standard errors multiplied by a factor (pure number);
    /// `degrees_of_freedom` is the number of degrees of freedom of this factor. The intervals
    /// become wider accordingly, up to the bounds of the parameters; `confidence` is the level of
    /// the intervals, a probability.
    ///
    /// # Source
    /// Birge (1932), Physical Review 40, 207–227; Student's t for a factor from few differences.
    #[must_use]
    pub fn with_error_scale(
        mut self,
        factor: f64,
        degrees_of_freedom: usize,
        confidence: f64,
    ) -> Self {
        let end = 0.5 * (1.0 + confidence);
        let students = StudentsT::new(0.0, 1.0, degrees_of_freedom.max(1) as f64);
        let quantile = students.map_or(f64::INFINITY, |law| law.inverse_cdf(end));
        let wider = factor * quantile / Normal::standard().inverse_cdf(end);
        self.likelihood.covariance *= factor * factor;
        self.likelihood.error_scale *= factor;
        let parameters = self.likelihood.parameters.iter_mut().zip(self.assembly.parameters());
        for (parameter, described) in parameters {
            let value = parameter.value;
            let end = |end: f64| (value + (end - value) * wider).max(described.min);
            parameter.interval = parameter.interval.map(|at| end(at).min(described.max));
            parameter.standard_error = parameter.standard_error.map(|error| factor * error);
        }
        self
    }

    /// Returns the same estimate with possible `errors` of the parameters, one for each parameter
    /// in its unit. The product of two errors is added to the covariance of the two parameters. The
    /// intervals become wider by the ratio of the new to the old standard errors, up to the bounds
    /// of the parameters.
    ///
    /// # Source
    /// Ours: the mean square of an estimate's error is its variance plus the square of its bias.
    #[must_use]
    pub fn with_parameter_errors(mut self, errors: &[f64]) -> Self {
        let error = DVector::from_column_slice(errors);
        self.likelihood.covariance += &error * error.transpose();
        let parameters = self.likelihood.parameters.iter_mut().zip(self.assembly.parameters());
        for ((parameter, described), error) in parameters.zip(errors) {
            let Some(before) = parameter.standard_error.filter(|before| *before > 0.0) else {
                continue;
            };
            let (value, after) = (parameter.value, before.hypot(*error));
            let wider = |end: f64| value + (end - value) * after / before;
            let within = |end: f64| wider(end).max(described.min).min(described.max);
            parameter.interval = parameter.interval.map(within);
            parameter.standard_error = Some(after);
        }
        self
    }
}

/// Identifies the unknown coefficients of a machine from line data. The outputs of the data are the
/// readings of the sensors, and the inputs are those of the instruments, in this order.
///
/// ```
/// use mechid_estimate::likelihood::{Settings, machine::identify_machine};
/// use mechid_model::ResponseQuantity;
/// use mechid_model::elements::{Element, FreeCoefficient, Input, Instruments, Machine, Sensor};
/// use mechid_spectra::{LineData, Transient};
/// use nalgebra::{Complex, DMatrix, DVector};
///
/// // A mass of 2 kg on a spring and a damper: exact receptance plus a small disturbance.
/// let omega: Vec<f64> = (1..40).map(|line| 5.0 * line as f64).collect();
/// let response = |w: f64| Complex::new(2e4 - 2.0 * w * w, 8.0 * w).inv();
/// let disturbed = |at: usize| response(omega[at]) + Complex::cis((at * at) as f64) * 1e-7;
/// let outputs = DMatrix::from_fn(omega.len(), 1, |at, _| disturbed(at));
/// let inputs = DMatrix::from_element(omega.len(), 1, Complex::new(1.0, 0.0));
/// let data = LineData::new(omega, inputs, outputs, Transient::None)?;
///
/// let machine = Machine::new(["x"]).with("m", Element::mass("x", 2.0)).with(
///     "foot",
///     Element::spring_damper(
///         ["x", "support"],
///         FreeCoefficient::from_start(3e4).at_least(0.0),
///         FreeCoefficient::from_start(5.0).at_least(0.0),
///     ),
/// );
/// let instruments = Instruments {
///     sensors: vec![Sensor::new("x", ResponseQuantity::Displacement)],
///     inputs: vec![Input::force("x")],
///     ..Instruments::default()
/// };
/// let estimate = identify_machine(&data, &machine, &instruments, &Settings::default())?;
/// let stiffness = estimate.likelihood.parameter("foot.k").unwrap();
/// assert!((stiffness.value - 2e4).abs() < 4.0 * stiffness.standard_error.unwrap());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`LikelihoodError::Machine`] if the description of the machine is not consistent, and the other
/// errors of a fit.
///
/// # Source
/// Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed. (2012),
/// chapter 9 (maximum likelihood); Mottershead & Friswell (1993), J. Sound and Vibration 167,
/// 347–375 (updating of the parameters of a model).
pub fn identify_machine(
    data: &LineData,
    machine: &Machine,
    instruments: &Instruments,
    settings: &Settings,
) -> Result<MachineEstimate, LikelihoodError> {
    identify(data, machine, instruments, None, settings)
}

/// Identifies a machine that has a part with a measured receptance. The degrees of freedom of this
/// part are [`Machine::measured`].
///
/// # Errors
/// As [`identify_machine`]; [`LikelihoodError::Size`] unless `part` has one receptance for each
/// line, with one row and one column for each degree of freedom of the part.
///
/// # Source
/// de Klerk, Rixen & Voormeeren (2008), AIAA Journal 46, 1169–1181 (coupling of measured parts).
pub fn identify_joined(
    data: &LineData,
    machine: &Machine,
    instruments: &Instruments,
    part: &MeasuredReceptance,
    settings: &Settings,
) -> Result<MachineEstimate, LikelihoodError> {
    identify(data, machine, instruments, Some(part), settings)
}

fn identify(
    data: &LineData,
    machine: &Machine,
    instruments: &Instruments,
    part: Option<&MeasuredReceptance>,
    settings: &Settings,
) -> Result<MachineEstimate, LikelihoodError> {
    let assembly = machine.assembly(instruments)?;
    let part = match part {
        Some(part) => Some(checked_part(data, &assembly, part)?),
        None if assembly.measured().is_empty() => None,
        None => {
            let what = "measured receptances of the part `measured`";
            return Err(LikelihoodError::Size { what, expected: data.len(), got: 0 });
        }
    };
    let open = data.records().iter().any(|(_, kind)| *kind != Transient::None);
    let model = MachineModel::new(&assembly, data.omega(), part.as_ref(), open)?;
    let space = parameter_space(&assembly);
    let fit = fit(&model, data, &space, settings)?;
    let names: Vec<String> = assembly.parameters().iter().map(|p| p.name.clone()).collect();
    let likelihood = LikelihoodEstimate::new(&fit, &names, settings.confidence);
    let variance = DMatrix::from_fn(data.len(), data.outputs().ncols(), |row, output| {
        fit.weights.variance(row, output)
    });
    let parameters = &fit.minimum.parameters;
    let failed = || LikelihoodError::NoResponse { at: "the estimate" };
    let linearised = fit.residual().linearise(parameters).ok_or_else(failed)?;
    let errors = fit.residual().errors(parameters).ok_or_else(failed)?.errors;
    let rows = 2 * data.outputs().len();
    let known: Vec<bool> =
        assembly.sensors().iter().map(|sensor| sensor.delay_parameter.is_none()).collect();
    let delay = delay_score(&fit, &linearised, &known);
    let of_parameters = linearised.jacobian.rows(0, rows).into_owned().qr().q();
    let of_pulses = fit.residual().explained_by_pulses(parameters).ok_or_else(failed)?;
    let parts = compared_parts(&fit, &linearised, &of_pulses, &names);
    let columns = of_parameters.column_iter().chain(of_pulses.column_iter());
    let explained = DMatrix::from_columns(&columns.collect::<Vec<_>>());
    let residual = linearised.residual.rows(0, rows).into_owned();
    Ok(MachineEstimate {
        likelihood,
        assembly,
        variance,
        errors,
        residual,
        explained,
        parts,
        delay,
        part,
    })
}

pub(super) fn parameter_space(assembly: &Assembly) -> ParameterSpace {
    let parameters = assembly.parameters();
    let priors = parameters.iter().enumerate().filter_map(|(parameter, described)| {
        let prior = described.prior?;
        Some(PriorRow { parameter, mean: prior.mean, deviation: prior.standard_deviation })
    });
    ParameterSpace {
        start: assembly.start(),
        bounds: Bounds {
            min: parameters.iter().map(|parameter| parameter.min).collect(),
            max: parameters.iter().map(|parameter| parameter.max).collect(),
        },
        priors: priors.collect(),
    }
}

pub(super) fn checked_part(
    data: &LineData,
    assembly: &Assembly,
    part: &MeasuredReceptance,
) -> Result<MeasuredPart, LikelihoodError> {
    let size = |what, expected, got| {
        if expected == got { Ok(()) } else { Err(LikelihoodError::Size { what, expected, got }) }
    };
    let dofs = assembly.measured().to_vec();
    size("measured receptances, one per line", data.len(), part.receptance.len())?;
    for matrix in &part.receptance {
        size("rows of a measured receptance", dofs.len(), matrix.nrows())?;
        size("columns of a measured receptance", dofs.len(), matrix.ncols())?;
    }
    if let Some(variance) = &part.variance {
        size("variances of receptances, one per line", data.len(), variance.len())?;
        for matrix in variance {
            size("rows of a variance of receptances", dofs.len(), matrix.nrows())?;
            size("columns of a variance of receptances", dofs.len(), matrix.ncols())?;
        }
    }
    let (receptance, variance) = (part.receptance.clone(), part.variance.clone());
    Ok(MeasuredPart { dofs, receptance, variance })
}
