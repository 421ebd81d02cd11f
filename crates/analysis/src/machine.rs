//! A machine, and how well it is known.

use std::path::Path;

use mechid_estimate::{Estimate, IdentifiedMode, Unknowns, identified_modes};
use mechid_io::{ParameterCovariance, input_name, read_covariance, read_system};
use mechid_model::{Parameter, SecondOrderSystem, UncertainSystem};

use crate::AnalysisError;

/// A system with the covariance of its parameters, where it was identified.
#[derive(Debug, Clone, PartialEq)]
pub struct Machine {
    /// Name for messages: the file it was read from.
    pub name: String,
    /// M, C and K, and the covariance of those of their entries that are uncertain.
    pub uncertain: UncertainSystem,
    /// Degrees of freedom of the variance behind the covariance.
    pub degrees_of_freedom: usize,
}

impl Machine {
    /// Takes a system as exactly known.
    pub fn known(system: SecondOrderSystem) -> Self {
        let uncertain = UncertainSystem::exact(system);
        Self { name: "the system".into(), uncertain, degrees_of_freedom: 0 }
    }

    /// Takes what was identified, with the covariance of its parameters.
    ///
    /// # Errors
    /// [`AnalysisError::Estimate`] if the data leave a parameter undetermined.
    pub fn of_estimate(estimate: &Estimate) -> Result<Self, AnalysisError> {
        Ok(Self {
            name: "the identified system".into(),
            uncertain: estimate.uncertain_system()?,
            degrees_of_freedom: estimate.degrees_of_freedom(),
        })
    }

    /// Reads the `system` of a JSON file (`-`: of standard input) and, if it is there, its
    /// `covariance`: the description of an experiment, or the result of an identification.
    ///
    /// # Errors
    /// [`AnalysisError::Io`] if the file cannot be read, [`AnalysisError::UnknownParameter`] if the
    /// covariance names a parameter that the system does not have.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, AnalysisError> {
        let path = path.as_ref();
        let (name, system) = (input_name(path), read_system(path)?);
        let Some(found) = read_covariance(path)? else {
            return Ok(Self { name, ..Self::known(system) });
        };
        let parameters = parameters(&name, &system, &found)?;
        let degrees_of_freedom = found.degrees_of_freedom;
        let uncertain = UncertainSystem::new(system, parameters, found.matrix())?;
        Ok(Self { name, uncertain, degrees_of_freedom })
    }

    /// Returns M, C and K.
    pub fn system(&self) -> &SecondOrderSystem {
        self.uncertain.system()
    }

    /// Returns whether the system is taken as exactly known.
    pub fn is_exact(&self) -> bool {
        self.uncertain.parameters().is_empty()
    }

    /// Returns natural frequencies, damping ratios and mode shapes with their standard errors, which
    /// are zero for a system that is taken as exactly known.
    ///
    /// # Errors
    /// [`AnalysisError::Estimate`] if the system has no modes.
    pub fn modes(&self) -> Result<Vec<IdentifiedMode>, AnalysisError> {
        Ok(identified_modes(&self.uncertain, self.degrees_of_freedom)?)
    }
}

/// Returns the parameters of the system that a covariance names.
fn parameters(
    file: &str,
    system: &SecondOrderSystem,
    covariance: &ParameterCovariance,
) -> Result<Vec<Parameter>, AnalysisError> {
    let all = Unknowns::unknown_mass(system.dof())?.free();
    let find = |name: &String| {
        all.iter().find(|p| p.to_string() == *name).copied().ok_or_else(|| {
            let names: Vec<String> = all.iter().map(Parameter::to_string).collect();
            AnalysisError::UnknownParameter {
                file: file.into(),
                name: name.clone(),
                known: names.join(", "),
            }
        })
    };
    covariance.parameters.iter().map(find).collect()
}
