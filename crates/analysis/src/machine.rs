//! A machine, and how well it is known.

use std::path::Path;

use mechid_estimate::{Estimate, IdentifiedMode, Parameter, Unknowns, identified_modes};
use mechid_force::{Entry, SystemCovariance};
use mechid_io::{ParameterCovariance, input_name, read_covariance, read_system};
use mechid_model::SecondOrderSystem;
use nalgebra::DMatrix;

use crate::AnalysisError;

/// A system, and the covariance of its parameters where it was identified.
#[derive(Debug, Clone)]
pub struct Machine {
    /// Name for messages: the file it was read from.
    pub name: String,
    /// M, C and K.
    pub system: SecondOrderSystem,
    /// Uncertainty of its parameters; `None` for a system that is taken as exactly known.
    pub uncertainty: Option<Uncertainty>,
}

/// Covariance of some of the parameters of a machine.
#[derive(Debug, Clone)]
pub struct Uncertainty {
    /// The uncertain parameters.
    pub parameters: Vec<Parameter>,
    /// Their covariance, one row and one column each, in products of their SI units.
    pub covariance: DMatrix<f64>,
    /// Degrees of freedom of the variance behind it.
    pub degrees_of_freedom: usize,
}

impl Machine {
    /// Takes a system as exactly known.
    pub fn known(system: SecondOrderSystem) -> Self {
        Self { name: "the system".into(), system, uncertainty: None }
    }

    /// Takes what was identified, with the covariance of its parameters.
    ///
    /// # Errors
    /// [`AnalysisError::Estimate`] if the data leave a parameter undetermined.
    pub fn of_estimate(estimate: &Estimate) -> Result<Self, AnalysisError> {
        let uncertainty = Uncertainty {
            parameters: estimate.parameters().map(|p| p.parameter).collect(),
            covariance: estimate.covariance().clone(),
            degrees_of_freedom: estimate.degrees_of_freedom(),
        };
        let name = "the identified system".into();
        Ok(Self { name, system: estimate.system()?, uncertainty: Some(uncertainty) })
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
        let uncertainty = match read_covariance(path)? {
            Some(found) => Some(Uncertainty {
                parameters: parameters(&name, &system, &found)?,
                covariance: found.matrix(),
                degrees_of_freedom: found.degrees_of_freedom,
            }),
            None => None,
        };
        Ok(Self { name, system, uncertainty })
    }

    /// Returns natural frequencies, damping ratios and mode shapes with their standard errors, which
    /// are zero for a system that is taken as exactly known.
    ///
    /// # Errors
    /// [`AnalysisError::Estimate`] if the system has no modes.
    pub fn modes(&self) -> Result<Vec<IdentifiedMode>, AnalysisError> {
        Ok(match &self.uncertainty {
            Some(Uncertainty { parameters, covariance, degrees_of_freedom }) => {
                identified_modes(&self.system, parameters, covariance, *degrees_of_freedom)?
            }
            None => identified_modes(&self.system, &[], &DMatrix::zeros(0, 0), 0)?,
        })
    }

    /// Returns the covariance as the force reconstruction takes it.
    pub(crate) fn covariance(&self) -> Result<Option<SystemCovariance>, AnalysisError> {
        let Some(Uncertainty { parameters, covariance, .. }) = &self.uncertainty else {
            return Ok(None);
        };
        let entry = |p: &Parameter| Entry { matrix: p.matrix(), row: p.row(), column: p.column() };
        let entries = parameters.iter().map(entry).collect();
        Ok(Some(SystemCovariance::new(entries, covariance.clone())?))
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
