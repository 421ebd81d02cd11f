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

/// M̂, Ĉ, K̂ with the covariance of the estimated entries.
///
/// The standard errors assume a correct model and exact regressors: they describe the scatter
/// between repeated experiments, not the bias of an estimator.
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

/// Results of an estimator for an [`Estimate`]; values are in the order of `unknowns.free()`.
pub struct EstimateParts {
    /// Unknown entries of M, C and K.
    pub unknowns: Unknowns,
    /// Estimated values, each in the SI unit of its entry.
    pub values: Vec<f64>,
    /// Covariance of the values.
    pub covariance: Covariance,
    /// Degrees of freedom of the residual variance.
    pub degrees_of_freedom: usize,
    /// Ratio of residual to right-hand side of each fitted equation.
    pub residual_nrmse: Vec<f64>,
    /// Condition number of the regressors with columns of unit length.
    pub condition: f64,
    /// Combinations of parameters that the data do not determine.
    pub undetermined: Vec<Undetermined>,
}

/// One estimated entry of M, C or K.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimated {
    /// Entry of M, C or K.
    pub parameter: Parameter,
    /// Value in kg, N·s/m or N/m; NaN if the data do not determine it.
    pub value: f64,
    /// Standard error, in the unit of the value; infinite if the data do not determine the
    /// parameter.
    pub standard_error: f64,
    /// Degrees of freedom of the residual variance that the standard error comes from.
    pub degrees_of_freedom: usize,
}

/// A combination of parameters that the data do not determine.
#[derive(Debug, Clone, PartialEq)]
pub struct Undetermined {
    /// Ratio of the singular value of this combination to that of the best determined combination.
    pub relative_singular_value: f64,
    /// Parameters, each with its weight in the unit of the parameter. If the same multiple of every
    /// weight is added to its parameter, the fit to the data does not change.
    pub terms: Vec<(Parameter, f64)>,
}

impl Estimate {
    /// Creates an estimate from the results of an estimator.
    ///
    /// # Errors
    /// [`EstimateError::Unbounded`] if a parameter or its standard error overflows although there
    /// are enough equations for both.
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
            let variance = parts.covariance.variance_of(at);
            let unbounded = !parts.values[at].is_finite() || !variance.is_finite();
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

    /// Returns the squared Mahalanobis distance dᵀ Cov⁻¹ d, a pure number: d is the difference
    /// between the parameters of the two estimates, and Cov is the covariance of this estimate. If
    /// the estimates differ by noise alone, the mean of the distance is about the number of
    /// parameters. `None` if the covariance has no inverse, as with related entries, or if the two
    /// estimates have different unknowns.
    ///
    /// # Source
    /// Mahalanobis (1936), Proceedings of the National Institute of Sciences of India 2, 49–55.
    pub fn squared_distance(&self, other: &Self) -> Option<f64> {
        if self.parameters != other.parameters || self.unknowns.is_related() {
            return None;
        }
        let change = self.values.iter().zip(&other.values).map(|(value, other)| other - value);
        self.squared_length(&DVector::from_iterator(self.values.len(), change))
    }

    /// Returns the squared Mahalanobis length of a change of the parameters, a pure number, as in
    /// [`Estimate::squared_distance`]. A change has one entry per parameter, in the SI unit of the
    /// parameter.
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

    /// Returns the same fit with other values and another covariance. There is one value per
    /// parameter, in the order of [`Unknowns::free`] and in the SI unit of the parameter.
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

    /// Returns the estimate without the damping that an exponential window exp(−σt) on force and
    /// response adds: windowed responses belong to M, C + 2σM and K + σC + σ²M.
    ///
    /// `rate` is σ, in 1/s. `unknowns` has the known entries without the damping that the window
    /// adds; its free entries are those of the estimate.
    ///
    /// # Errors
    /// [`EstimateError::Undetermined`] if the data do not determine an entry,
    /// [`NumericsError::Size`] for another number of free entries.
    ///
    /// # Source
    /// Ewins, *Modal Testing*, 2nd ed. (2000), the section on transient excitation (exponential
    /// window).
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

    /// Number of mechanical degrees of freedom, n.
    pub fn dof(&self) -> usize {
        self.unknowns.dof()
    }

    /// Every estimated entry, in the order of [`Unknowns::free`].
    pub fn parameters(&self) -> impl ExactSizeIterator<Item = Estimated> + '_ {
        self.parameters.iter().enumerate().map(|(at, parameter)| Estimated {
            parameter: *parameter,
            value: self.values[at],
            standard_error: self.covariance.variance_of(at).sqrt(),
            degrees_of_freedom: self.degrees_of_freedom,
        })
    }

    /// Returns the same estimate with standard errors multiplied by `scale` (a pure number): the
    /// Birge ratio of data that differ by more than their noise. If `scale` has fewer degrees of
    /// freedom than this estimate, the result has those of `scale`.
    ///
    /// # Source
    /// Birge (1932), Physical Review 40, 207–227.
    #[must_use]
    pub fn with_error_scale(mut self, scale: f64, degrees_of_freedom: usize) -> Self {
        self.covariance = self.covariance.scaled(scale * scale);
        self.degrees_of_freedom = self.degrees_of_freedom.min(degrees_of_freedom.max(1));
        self
    }

    /// Returns the same estimate with a mean square error of the model added to its covariance.
    /// Each entry of `mean_square_error` is in the product of the units of its two parameters.
    ///
    /// # Errors
    /// [`NumericsError::Size`] for another number of parameters.
    pub fn with_mean_square(
        mut self,
        mean_square_error: &DMatrix<f64>,
    ) -> Result<Self, EstimateError> {
        check_size("parameters", self.parameters.len(), mean_square_error.nrows())?;
        self.covariance = (self.covariance.full() + mean_square_error).into();
        Ok(self)
    }

    /// Returns one estimated entry by its name, such as `"k12"`.
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

    /// Covariance of the estimated entries, in the order of [`Unknowns::free`], each in the product
    /// of the two parameters' units (kg, N·s/m, N/m).
    ///
    /// An undetermined parameter has an infinite variance and NaN covariances. After least squares
    /// on the equations of motion only the factors are stored: each call multiplies the factors and
    /// returns (3n²)² entries for n degrees of freedom.
    pub fn covariance(&self) -> DMatrix<f64> {
        self.covariance.full()
    }

    /// Covariance in the form that the estimator stores, full or as factors.
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

    /// Factors α (1/s) and β (s) of a damping C = αM + βK; `None` unless the unknowns have
    /// proportional damping.
    ///
    /// # Source
    /// Rayleigh, *The Theory of Sound*, vol. 1 (1877), article 97.
    pub fn proportional_damping(&self) -> Option<[Uncertain; 2]> {
        let relations = Relations::from_unknowns(&self.unknowns)?;
        let factors = relations.damping_factors(&self.values)?;
        Some(factors.map(|(value, gradient)| Uncertain {
            value,
            standard_error: self.covariance.variance(&gradient).max(0.0).sqrt(),
            degrees_of_freedom: self.degrees_of_freedom,
        }))
    }

    /// The identified system.
    ///
    /// # Errors
    /// [`EstimateError::Undetermined`] if the data do not determine an entry,
    /// [`EstimateError::Model`] if M̂ is singular.
    pub fn system(&self) -> Result<SecondOrderSystem, EstimateError> {
        self.check_determined()?;
        let [mass, damping, stiffness] = self.unknowns.assemble(&self.values);
        Ok(SecondOrderSystem::new(mass, damping, stiffness)?)
    }

    /// The identified system with the covariance of its estimated entries, for example for a force
    /// reconstruction.
    ///
    /// # Errors
    /// As [`Estimate::system`]; [`EstimateError::Model`] if the covariance is not finite, for
    /// example if there are as many unknowns as equations.
    pub fn uncertain_system(&self) -> Result<UncertainSystem, EstimateError> {
        let covariance = self.covariance();
        Ok(UncertainSystem::new(self.system()?, self.parameters.clone(), covariance)?)
    }

    /// Checks that the data determine every parameter; the error names the undetermined ones.
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

    /// Number of rows minus number of unknowns: the smallest value of all equations of motion.
    pub fn degrees_of_freedom(&self) -> usize {
        self.degrees_of_freedom
    }

    /// Ratio √(Σe² / Σb²) of residual e to right-hand side b of each fitted equation.
    pub fn residual_nrmse(&self) -> &[f64] {
        &self.residual_nrmse
    }

    /// Condition number of the regressors with columns of unit length.
    pub fn condition(&self) -> f64 {
        self.condition
    }

    /// Combinations of parameters that the data do not determine, one entry for each; empty if the
    /// data determine every parameter.
    pub fn undetermined(&self) -> &[Undetermined] {
        &self.undetermined
    }
}

impl Estimated {
    /// Returns the confidence interval [low, high] at `level` (0.95 for 95 %), by Student's t.
    ///
    /// # Errors
    /// [`NumericsError::Level`] unless 0 < level < 1.
    pub fn interval(&self, level: f64) -> Result<[f64; 2], NumericsError> {
        student_interval(self.value, self.standard_error, self.degrees_of_freedom, level)
    }
}

impl fmt::Display for Estimated {
    /// Writes `k12 = 1.234560e7 ± 3.2e4 N/m`; the number after ± is one standard error.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (parameter, unit) = (self.parameter, self.parameter.matrix().unit());
        if self.value.is_nan() {
            return write!(f, "{parameter} is not determined by the data");
        }
        write!(f, "{parameter} = {:.6e} ± {:.1e} {unit}", self.value, self.standard_error)
    }
}

impl fmt::Display for Undetermined {
    /// Writes the undetermined combination, such as `k12 − 0.500·c12`.
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
    /// Writes one parameter per line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.parameters().try_for_each(|parameter| writeln!(f, "{parameter}"))
    }
}
