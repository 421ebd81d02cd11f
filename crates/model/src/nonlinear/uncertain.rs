//! Nonlinear systems with uncertain parameters.

use nalgebra::DMatrix;

use super::{NonlinearSystem, Terms};
use crate::uncertain_system::check_covariance;
use crate::{ModelError, Parameter};

/// A parameter of a [`NonlinearSystem`]; terms and their constants are counted from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NonlinearParameter {
    /// An entry of M, C or K.
    Entry(Parameter),
    /// The coefficient of a term.
    Coefficient(usize),
    /// A constant inside the law of a term.
    Constant {
        /// Index of the term.
        term: usize,
        /// Index of the constant among [`Law::constants`](crate::Law::constants).
        constant: usize,
    },
}

impl NonlinearParameter {
    /// Returns the parameter of this name: `k12`, the name of a term, or `c3.b` for the constant b
    /// inside the term `c3`.
    ///
    /// # Errors
    /// [`ModelError::NoSuchParameter`] if the system has no parameter of this name.
    pub fn named(name: &str, system: &NonlinearSystem) -> Result<Self, ModelError> {
        for (at, term) in system.terms().iter().enumerate() {
            if term.name() == name {
                return Ok(Self::Coefficient(at));
            }
            let Some(inner) = name.strip_prefix(term.name()).and_then(|n| n.strip_prefix('.'))
            else {
                continue;
            };
            let constants = term.law().constants();
            if let Some(constant) = constants.iter().position(|c| c.name == inner) {
                return Ok(Self::Constant { term: at, constant });
            }
        }
        Parameter::named(name, system.dof()).map(Self::Entry)
    }

    /// Returns the name of the parameter in a system with these terms.
    ///
    /// # Panics
    /// If there is no such term or constant.
    pub fn name(self, terms: &Terms) -> String {
        let term = |at: usize| terms.iter().nth(at).expect("a term of the system");
        match self {
            Self::Entry(parameter) => parameter.to_string(),
            Self::Coefficient(at) => term(at).name().to_owned(),
            Self::Constant { term: at, constant } => {
                format!("{}.{}", term(at).name(), term(at).law().constants()[constant].name)
            }
        }
    }
}

impl NonlinearSystem {
    /// Returns the same system with one parameter increased by `by`, in the unit of the parameter.
    ///
    /// # Errors
    /// [`ModelError`] if the changed system is invalid: a singular M, or a constant out of range.
    pub fn changed(&self, parameter: NonlinearParameter, by: f64) -> Result<Self, ModelError> {
        let mut changed = self.clone();
        match parameter {
            NonlinearParameter::Entry(entry) => changed.linear = self.linear.changed(entry, by)?,
            NonlinearParameter::Coefficient(at) => {
                let coefficient = changed.coefficients.get_mut(at);
                *coefficient.ok_or_else(|| self.no_term(at))? += by;
            }
            NonlinearParameter::Constant { term: at, constant } => {
                let mut terms: Vec<_> = self.terms.iter().cloned().collect();
                let term = terms.get_mut(at).ok_or_else(|| self.no_term(at))?;
                let mut values: Vec<f64> =
                    term.law().constants().iter().map(|constant| constant.value).collect();
                *values.get_mut(constant).ok_or_else(|| self.no_term(at))? += by;
                let refused = || ModelError::Term {
                    text: term.to_string(),
                    reason: format!("the sum of its constant and {by} is out of range"),
                };
                *term = term.with_constants(&values).ok_or_else(refused)?;
                changed.terms = Terms::new(terms)?;
            }
        }
        Ok(changed)
    }

    fn no_term(&self, at: usize) -> ModelError {
        ModelError::Coefficients { got: at + 1, terms: self.terms.len() }
    }
}

/// Nonlinear system with some uncertain parameters, and their covariance; all others are known.
///
/// ```
/// use mechid_model::{NonlinearParameter, NonlinearSystem, Sdof, UncertainNonlinearSystem};
/// use nalgebra::dmatrix;
///
/// let linear = Sdof::new(10.0, 180.0, 5000.0)?.system();
/// let system = NonlinearSystem::new(linear, "k3: x^3".parse()?, vec![2e6])?;
/// let cubic = NonlinearParameter::named("k3", &system)?;
/// let uncertain = UncertainNonlinearSystem::new(system, vec![cubic], dmatrix![1e4 * 1e4])?;
/// assert_eq!(uncertain.parameters(), [NonlinearParameter::Coefficient(0)]);
/// # Ok::<(), mechid_model::ModelError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct UncertainNonlinearSystem {
    system: NonlinearSystem,
    parameters: Vec<NonlinearParameter>,
    covariance: DMatrix<f64>,
}

impl UncertainNonlinearSystem {
    /// Creates a system with uncertain parameters. The covariance has one row and one column per
    /// parameter, in the products of their units.
    ///
    /// # Errors
    /// [`ModelError::CovarianceShape`] unless the covariance has this shape,
    /// [`ModelError::Covariance`] if it has a negative variance or an entry that is not finite,
    /// [`ModelError::RepeatedParameter`] if a parameter is named twice, and the errors of
    /// [`NonlinearSystem::changed`] if the system does not have one of the parameters.
    pub fn new(
        system: NonlinearSystem,
        parameters: Vec<NonlinearParameter>,
        covariance: DMatrix<f64>,
    ) -> Result<Self, ModelError> {
        for parameter in &parameters {
            system.changed(*parameter, 0.0)?;
        }
        let names: Vec<String> = parameters.iter().map(|p| p.name(&system.terms)).collect();
        check_covariance(&names, &covariance)?;
        Ok(Self { system, parameters, covariance })
    }

    /// Creates a system with known parameters only.
    pub fn exact(system: NonlinearSystem) -> Self {
        Self { system, parameters: Vec::new(), covariance: DMatrix::zeros(0, 0) }
    }

    /// The system with the uncertain parameters at their estimates.
    pub fn system(&self) -> &NonlinearSystem {
        &self.system
    }

    /// Uncertain parameters, in the order of the covariance.
    pub fn parameters(&self) -> &[NonlinearParameter] {
        &self.parameters
    }

    /// Covariance of the uncertain parameters, with one row and one column per parameter, in the
    /// products of the units of the parameters.
    pub fn covariance(&self) -> &DMatrix<f64> {
        &self.covariance
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::dmatrix;

    use super::*;
    use crate::Sdof;

    fn system() -> NonlinearSystem {
        let linear = Sdof::new(2.0, 0.5, 8.0).unwrap().system();
        let terms = "k3: x^3, c3: v^3/(1 + (v/20)^2)".parse().unwrap();
        NonlinearSystem::new(linear, terms, vec![5.0, 0.5]).unwrap()
    }

    #[test]
    fn every_parameter_is_found_by_its_name_and_changed_alone() {
        let system = system();
        for name in ["m", "c", "k", "k3", "c3", "c3.b"] {
            let parameter = NonlinearParameter::named(name, &system).unwrap();
            assert_eq!(parameter.name(system.terms()), name);
            let other = system.changed(parameter, 0.25).unwrap();
            assert_ne!(other, system, "{name}");
            assert_eq!(other.changed(parameter, -0.25).unwrap(), system, "{name}");
        }
        assert!(NonlinearParameter::named("c3.a", &system).is_err());
        let bend = NonlinearParameter::named("c3.b", &system).unwrap();
        assert!(system.changed(bend, -20.0).unwrap_err().to_string().contains("-20"));
    }

    #[test]
    fn a_covariance_that_does_not_fit_is_refused() {
        let of = |parameters: &[NonlinearParameter], covariance| {
            UncertainNonlinearSystem::new(system(), parameters.to_vec(), covariance)
        };
        let cubic = NonlinearParameter::Coefficient(0);
        assert!(of(&[cubic], dmatrix![1.0]).is_ok());
        assert!(of(&[cubic], DMatrix::identity(2, 2)).is_err());
        assert!(of(&[cubic, cubic], DMatrix::identity(2, 2)).is_err());
        assert!(of(&[cubic], dmatrix![-1.0]).unwrap_err().to_string().contains("k3"));
        assert!(of(&[NonlinearParameter::Coefficient(2)], dmatrix![1.0]).is_err());
    }
}
