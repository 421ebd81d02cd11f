//! Result of an identification: parameters with their covariance.

use std::fmt;

use mechid_model::{Matrix, Parameter, SecondOrderSystem, UncertainSystem};
use mechid_numerics::{NumericsError, Uncertain, check_size, student_interval};
use mechid_signal::message;
use nalgebra::{DMatrix, DVector};

use crate::covariance::Covariance;
use crate::error::{NAMED_DIRECTIONS, NAMED_PARAMETERS};
use crate::relations::Relations;
use crate::{EstimateError, Unknowns};

/// M̂, Ĉ, K̂ with the covariance of what was estimated.
///
/// The standard errors assume a model that is right and regressors that are exact: they describe
/// the scatter between repeated experiments, not the bias of an estimator.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    unknowns: Unknowns,
    parameters: Vec<Parameter>,
    values: Vec<f64>,
    covariance: Covariance,
    degrees_of_freedom: usize,
    residual_nrmse: Vec<f64>,
    condition: f64,
    undetermined: Vec<Undetermined>,
}

/// Results from which an estimator makes an [`Estimate`]; values in the order of `unknowns.free()`.
pub struct EstimateParts {
    /// Unknown entries of M, C and K.
    pub unknowns: Unknowns,
    /// Values, in the SI unit of each.
    pub values: Vec<f64>,
    /// Covariance of the values.
    pub covariance: Covariance,
    /// Degrees of freedom of the residual variance.
    pub degrees_of_freedom: usize,
    /// Ratio of residual to right-hand side of each fitted equation.
    pub residual_nrmse: Vec<f64>,
    /// Condition number of the regressors with columns of unit length.
    pub condition: f64,
    /// Combinations of parameters on which the data say nothing.
    pub undetermined: Vec<Undetermined>,
}

/// One estimated entry of M, C or K.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimated {
    /// Entry of M, C or K.
    pub parameter: Parameter,
    /// Value in kg, N·s/m or N/m; NaN if the data do not determine it.
    pub value: f64,
    /// Standard error, in the same unit; infinite if the data do not determine it.
    pub standard_error: f64,
    /// Degrees of freedom of the residual variance behind the standard error.
    pub degrees_of_freedom: usize,
}

/// A combination of parameters on which the data say nothing.
#[derive(Debug, Clone, PartialEq)]
pub struct Undetermined {
    /// Strength with which the data excite it, as a ratio to the best determined combination.
    pub relative_singular_value: f64,
    /// The parameters and how much of each, in its unit (any multiple of all of them may be added).
    pub terms: Vec<(Parameter, f64)>,
}

impl Estimate {
    /// # Errors
    /// [`EstimateError::Unbounded`] if numbers beyond the largest one leave a parameter without a
    /// finite value or standard error, though there are equations enough for both.
    pub fn new(mut parts: EstimateParts) -> Result<Self, EstimateError> {
        let parameters = parts.unknowns.free();
        for undetermined in &parts.undetermined {
            for (parameter, _) in &undetermined.terms {
                let Some(at) = parameters.iter().position(|p| p == parameter) else { continue };
                parts.values[at] = f64::NAN;
                parts.covariance.leave_open(at);
            }
        }
        let open = |p: &Parameter| {
            parts.undetermined.iter().any(|u| u.terms.iter().any(|(term, _)| term == p))
        };
        for (at, p) in parameters.iter().enumerate().filter(|(_, p)| !open(p)) {
            let unbounded = !parts.values[at].is_finite() || !parts.covariance.of(at).is_finite();
            if unbounded && parts.degrees_of_freedom > 0 {
                return Err(EstimateError::Unbounded { parameter: p.to_string() });
            }
        }
        Ok(Self {
            unknowns: parts.unknowns,
            parameters,
            values: parts.values,
            covariance: parts.covariance,
            degrees_of_freedom: parts.degrees_of_freedom,
            residual_nrmse: parts.residual_nrmse,
            condition: parts.condition,
            undetermined: parts.undetermined,
        })
    }

    /// Squared distance of the parameters of another estimate from these, in units of this covariance: dᵀ Cov⁻¹ d, a
    /// pure number; of estimates that differ by noise alone about as much as there are parameters, if this one is the
    /// best. `None` where the covariance has no inverse, as where entries follow from others, or the other has other
    /// parameters.
    ///
    /// # Source
    /// Mahalanobis (1936), Proceedings of the National Institute of Sciences of India 2, 49–55.
    pub fn squared_distance(&self, other: &Self) -> Option<f64> {
        if self.parameters != other.parameters || self.unknowns.is_related() {
            return None;
        }
        let change = self.values.iter().zip(&other.values).map(|(own, other)| other - own);
        self.squared_length(&DVector::from_iterator(self.values.len(), change))
    }

    /// The same of a change of the parameters.
    /// A change has one entry per parameter, in its SI unit; the length is a pure number.
    ///
    /// # Source
    /// Mahalanobis (1936), Proceedings of the National Institute of Sciences of India 2, 49–55.
    pub fn squared_length(&self, change: &DVector<f64>) -> Option<f64> {
        let errors = self.parameters().map(|p| p.standard_error);
        let scale = DVector::from_iterator(self.values.len(), errors);
        if !scale.iter().all(|error| *error > 0.0 && error.is_finite()) {
            return None;
        }
        let change = change.component_div(&scale);
        let mut correlation = self.covariance();
        for (mut column, size) in correlation.column_iter_mut().zip(&scale) {
            column.iter_mut().zip(&scale).for_each(|(entry, other)| *entry /= other * size);
        }
        Some(change.dot(&correlation.cholesky()?.solve(&change)))
    }

    /// The same fit at other values, in the order of [`Unknowns::free`], with another covariance.
    /// Values have one entry per parameter, in its SI unit.
    ///
    /// # Errors
    /// As [`Estimate::new`].
    pub fn moved(
        &self,
        values: Vec<f64>,
        covariance: DMatrix<f64>,
        degrees_of_freedom: usize,
    ) -> Result<Self, EstimateError> {
        Self::new(EstimateParts {
            unknowns: self.unknowns.clone(),
            values,
            covariance: covariance.into(),
            degrees_of_freedom,
            residual_nrmse: self.residual_nrmse.clone(),
            condition: self.condition,
            undetermined: self.undetermined.clone(),
        })
    }

    /// Returns the machine without the decay that an exponential window exp(−σt) on force and response adds, from
    /// the fit of responses under it: these are of M, C + 2σM and K + σC + σ²M.
    ///
    /// `rate` is σ, in 1/s; `unknowns` has the known entries of the machine itself, and the same ones free.
    ///
    /// # Errors
    /// [`EstimateError::Undetermined`] if the data leave an entry open, [`NumericsError::Size`] if others are free.
    ///
    /// # Source
    /// Ewins, *Modal Testing*, 2nd ed. (2000), the section on transient excitation (exponential window).
    pub fn without_added_decay(
        &self,
        rate: f64,
        unknowns: Unknowns,
    ) -> Result<Self, EstimateError> {
        self.check_determined()?;
        check_size("free entries", self.parameters.len(), unknowns.free().len())?;
        let count = self.parameters.len();
        let mut change = DMatrix::identity(count, count);
        for (at, p) in self.parameters.iter().enumerate() {
            let weights = match p.matrix() {
                Matrix::Mass => continue,
                Matrix::Damping => [-2.0 * rate, 0.0],
                Matrix::Stiffness => [rate * rate, -rate],
            };
            for (matrix, weight) in [Matrix::Mass, Matrix::Damping].into_iter().zip(weights) {
                let is_same = |q: &Parameter| {
                    (q.matrix(), q.row(), q.column()) == (matrix, p.row(), p.column())
                };
                if let Some(place) = self.parameters.iter().position(is_same).filter(|q| *q != at) {
                    change[(at, place)] = weight;
                }
            }
        }
        let [mass, damping, stiffness] = self.unknowns.assemble(&self.values);
        let stiffness = stiffness - &damping * rate + &mass * (rate * rate);
        let damping = damping - &mass * (2.0 * rate);
        let value = |p: &Parameter| {
            let of = match p.matrix() {
                Matrix::Mass => &mass,
                Matrix::Damping => &damping,
                Matrix::Stiffness => &stiffness,
            };
            of[(p.row(), p.column())]
        };
        let values = self.parameters.iter().map(value).collect();
        let covariance = &change * self.covariance() * change.transpose();
        Self::new(EstimateParts {
            unknowns,
            values,
            covariance: covariance.into(),
            degrees_of_freedom: self.degrees_of_freedom,
            residual_nrmse: self.residual_nrmse.clone(),
            condition: self.condition,
            undetermined: Vec::new(),
        })
    }

    /// Free and known entries.
    pub fn unknowns(&self) -> &Unknowns {
        &self.unknowns
    }

    /// Degrees of freedom of the machine, n.
    pub fn dof(&self) -> usize {
        self.unknowns.dof()
    }

    /// Every estimated entry, in the order of [`Unknowns::free`].
    pub fn parameters(&self) -> impl ExactSizeIterator<Item = Estimated> + '_ {
        self.parameters.iter().enumerate().map(|(at, parameter)| Estimated {
            parameter: *parameter,
            value: self.values[at],
            standard_error: self.covariance.of(at).sqrt(),
            degrees_of_freedom: self.degrees_of_freedom,
        })
    }

    /// The same estimate with standard errors `scale` times as large (a pure number), which is known to that many
    /// degrees of freedom: the Birge ratio, where the data disagree beyond their noise.
    ///
    /// # Source
    /// Birge (1932), Physical Review 40, 207–227.
    #[must_use]
    pub fn with_error_scale(mut self, scale: f64, degrees_of_freedom: usize) -> Self {
        self.covariance = self.covariance.scaled(scale * scale);
        self.degrees_of_freedom = self.degrees_of_freedom.min(degrees_of_freedom.max(1));
        self
    }

    /// One estimated entry by its name, such as `"k12"`.
    ///
    /// # Errors
    /// [`EstimateError::NoSuchParameter`] if it is not among the unknowns.
    pub fn parameter(&self, name: &str) -> Result<Estimated, EstimateError> {
        self.parameters().find(|estimated| estimated.parameter.to_string() == name).ok_or_else(
            || {
                let known: Vec<String> = self.parameters.iter().map(Parameter::to_string).collect();
                EstimateError::NoSuchParameter { name: name.to_owned(), known: known.join(", ") }
            },
        )
    }

    /// Covariance of the estimated entries, in the order of [`Unknowns::free`], each in the product of
    /// the two parameters' units (kg, N·s/m, N/m).
    ///
    /// An undetermined parameter has an infinite variance and NaN covariances.
    /// Least squares on the equations of motion keep its factors only: each call multiplies them out, and
    /// n degrees of freedom have (3n²)² entries.
    pub fn covariance(&self) -> DMatrix<f64> {
        self.covariance.full()
    }

    /// Covariance in the form that the estimator found it in.
    pub fn spread(&self) -> &Covariance {
        &self.covariance
    }

    /// M̂, in kg: the known entries and the estimated ones.
    pub fn mass(&self) -> DMatrix<f64> {
        let [mass, _, _] = self.unknowns.assemble(&self.values);
        mass
    }

    /// Ĉ, n × n, in N·s/m.
    pub fn damping(&self) -> DMatrix<f64> {
        let [_, damping, _] = self.unknowns.assemble(&self.values);
        damping
    }

    /// K̂, n × n, in N/m.
    pub fn stiffness(&self) -> DMatrix<f64> {
        let [_, _, stiffness] = self.unknowns.assemble(&self.values);
        stiffness
    }

    /// α (1/s) and β (s) of a damping C = αM + βK, where the unknowns say that it is proportional.
    ///
    /// # Source
    /// Rayleigh, *The Theory of Sound*, vol. 1 (1877), article 97.
    pub fn proportional_damping(&self) -> Option<[Uncertain; 2]> {
        let relations = Relations::of(&self.unknowns)?;
        let factors = relations.damping_factors(&self.values)?;
        Some(factors.map(|(value, gradient)| Uncertain {
            value,
            standard_error: self.covariance.variance(&gradient).max(0.0).sqrt(),
            degrees_of_freedom: self.degrees_of_freedom,
        }))
    }

    /// The identified machine.
    ///
    /// # Errors
    /// [`EstimateError::Undetermined`] if the data leave any entry open,
    /// [`EstimateError::Model`] if M̂ is singular.
    pub fn system(&self) -> Result<SecondOrderSystem, EstimateError> {
        self.check_determined()?;
        let [mass, damping, stiffness] = self.unknowns.assemble(&self.values);
        Ok(SecondOrderSystem::new(mass, damping, stiffness)?)
    }

    /// The identified machine with the covariance of what was estimated, such as a force
    /// reconstruction counts.
    ///
    /// # Errors
    /// As [`Estimate::system`]; [`EstimateError::Model`] if the covariance is not finite, which it is
    /// not with as many unknowns as equations.
    pub fn uncertain_system(&self) -> Result<UncertainSystem, EstimateError> {
        let covariance = self.covariance();
        Ok(UncertainSystem::new(self.system()?, self.parameters.clone(), covariance)?)
    }

    /// An error that names what the data leave open, if they do.
    ///
    /// # Errors
    /// [`EstimateError::Undetermined`].
    pub fn check_determined(&self) -> Result<(), EstimateError> {
        if !self.undetermined.is_empty() {
            let open = self.parameters().filter(|p| p.value.is_nan());
            return Err(EstimateError::Undetermined {
                parameters: message::list(open.map(|p| p.parameter), ", ", NAMED_PARAMETERS),
                directions: message::list(&self.undetermined, "; ", NAMED_DIRECTIONS),
            });
        }
        Ok(())
    }

    /// Equations minus unknowns, of the equation of motion that has the fewest to spare.
    pub fn degrees_of_freedom(&self) -> usize {
        self.degrees_of_freedom
    }

    /// √(Σe² / Σb²), the ratio of residual to right-hand side, of each fitted equation.
    pub fn residual_nrmse(&self) -> &[f64] {
        &self.residual_nrmse
    }

    /// Condition number of the regressors with columns of unit length.
    pub fn condition(&self) -> f64 {
        self.condition
    }

    /// The combinations of parameters on which the data say nothing, one entry for each; empty when
    /// all is well.
    pub fn undetermined(&self) -> &[Undetermined] {
        &self.undetermined
    }
}

impl Estimated {
    /// The confidence interval [low, high] at `level` (0.95 for 95 %), by Student's t.
    ///
    /// # Errors
    /// [`NumericsError::Level`] unless 0 < level < 1.
    pub fn interval(&self, level: f64) -> Result<[f64; 2], NumericsError> {
        student_interval(self.value, self.standard_error, self.degrees_of_freedom, level)
    }
}

impl fmt::Display for Estimated {
    /// `k12 = 1.234560e7 ± 3.2e4 N/m`, the number after ± being one standard error.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (parameter, unit) = (self.parameter, self.parameter.matrix().unit());
        if self.value.is_nan() {
            return write!(f, "{parameter} is not determined by the data");
        }
        write!(f, "{parameter} = {:.6e} ± {:.1e} {unit}", self.value, self.standard_error)
    }
}

impl fmt::Display for Undetermined {
    /// `k12 − 0.500·c12`: the combination that may be added freely.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (at, (parameter, weight)) in self.terms.iter().enumerate() {
            let size = weight.abs();
            match (at, *weight < 0.0) {
                (0, false) => {}
                (0, true) => f.write_str("−")?,
                (_, false) => f.write_str(" + ")?,
                (_, true) => f.write_str(" − ")?,
            }
            if (size - 1.0).abs() < 1e-9 {
                write!(f, "{parameter}")?;
            } else if (1e-2..1e4).contains(&size) {
                write!(f, "{size:.3}·{parameter}")?;
            } else {
                write!(f, "{size:.3e}·{parameter}")?;
            }
        }
        Ok(())
    }
}

impl fmt::Display for Estimate {
    /// One parameter a line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.parameters().try_for_each(|parameter| writeln!(f, "{parameter}"))
    }
}
