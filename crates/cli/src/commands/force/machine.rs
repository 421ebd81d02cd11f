//! The machine, and how well it is known.

use std::path::Path;

use mechid::estimate::Parameter;
use mechid::force::{Entry, SystemCovariance};
use mechid::io::{input_name, read_covariance, read_system};
use mechid::model::SecondOrderSystem;

use crate::commands::modal::parameters;
use crate::error::CliError;

/// A machine read from a file.
pub struct Machine {
    pub system: SecondOrderSystem,
    /// Covariance of what was identified; nothing where the file does not have it.
    pub covariance: Option<SystemCovariance>,
}

impl Machine {
    /// Reads the system and, if it is there, its covariance.
    pub fn read(path: &Path) -> Result<Self, CliError> {
        let system = read_system(path)?;
        let covariance = match read_covariance(path)? {
            Some(found) => {
                let named = parameters(&input_name(path), &system, &found)?;
                let entry =
                    |p: &Parameter| Entry { matrix: p.matrix(), row: p.row(), column: p.column() };
                let entries = named.iter().map(entry).collect();
                Some(SystemCovariance::new(entries, found.matrix())?)
            }
            None => None,
        };
        Ok(Self { system, covariance })
    }
}
