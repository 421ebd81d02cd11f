//! The machine, and how well it is known.

use std::path::Path;

use mechid::io::{input_name, read_covariance, read_system};
use mechid::model::{SecondOrderSystem, UncertainSystem};

use crate::commands::modal::parameters;
use crate::error::CliError;

/// A machine read from a file.
pub struct Machine {
    pub system: SecondOrderSystem,
    /// The same with the covariance of what was identified; `None` where the file does not have it.
    pub uncertain: Option<UncertainSystem>,
}

impl Machine {
    /// Reads the system and, if it is there, its covariance.
    pub fn read(path: &Path) -> Result<Self, CliError> {
        let system = read_system(path)?;
        let uncertain = match read_covariance(path)? {
            Some(found) => {
                let named = parameters(&input_name(path), &system, &found)?;
                Some(UncertainSystem::new(system.clone(), named, found.matrix())?)
            }
            None => None,
        };
        Ok(Self { system, uncertain })
    }
}
