//! Columns of forces and responses.

use std::path::Path;

use clap::Args;
use mechid::Channels;

use super::RecordArgs;
use crate::error::CliError;

/// Columns of force and response; one column per degree of freedom, in the same order everywhere.
#[derive(Debug, Clone, Args)]
pub struct ChannelArgs {
    /// Force columns, in N, one per degree of freedom; 0 where no force acts. In frf, identify and
    /// modes, no column has to be named if every column states its unit
    #[arg(long, value_name = "COLUMN,…", value_delimiter = ',')]
    pub force: Vec<String>,
    /// Displacement columns, in m
    #[arg(long, value_name = "COLUMN,…", value_delimiter = ',')]
    displacement: Vec<String>,
    /// Velocity columns, in m/s
    #[arg(long, value_name = "COLUMN,…", value_delimiter = ',')]
    velocity: Vec<String>,
    /// Acceleration columns, in m/s²
    #[arg(long, value_name = "COLUMN,…", value_delimiter = ',')]
    acceleration: Vec<String>,
}

impl ChannelArgs {
    /// Returns the columns. If none is named, returns the columns of the file that state a force or
    /// a response; the file is read with the settings of `record`.
    pub fn in_file(&self, file: &Path, record: &RecordArgs) -> Result<Channels, CliError> {
        let named = self.channels();
        if !named.is_empty() || file == Path::new("-") {
            return Ok(named);
        }
        Ok(Channels::stated(file, &record.reading())?)
    }

    /// Returns the columns that are named.
    pub fn channels(&self) -> Channels {
        Channels {
            force: self.force.clone(),
            displacement: self.displacement.clone(),
            velocity: self.velocity.clone(),
            acceleration: self.acceleration.clone(),
        }
    }
}

/// Columns of responses; one entry per degree of freedom, in the order of the machine.
#[derive(Debug, Args)]
pub struct ResponseArgs {
    /// Displacement columns, in m, one per degree of freedom; 0 where it was not measured
    #[arg(long, value_name = "COLUMN,…", value_delimiter = ',')]
    displacement: Vec<String>,
    /// Velocity columns, in m/s, one per degree of freedom; 0 where it was not measured
    #[arg(long, value_name = "COLUMN,…", value_delimiter = ',')]
    velocity: Vec<String>,
    /// Acceleration columns, in m/s², one per degree of freedom; 0 where it was not measured
    #[arg(long, value_name = "COLUMN,…", value_delimiter = ',')]
    acceleration: Vec<String>,
}

impl ResponseArgs {
    /// Returns the columns.
    pub fn channels(&self) -> Channels {
        Channels {
            force: Vec::new(),
            displacement: self.displacement.clone(),
            velocity: self.velocity.clone(),
            acceleration: self.acceleration.clone(),
        }
    }
}
