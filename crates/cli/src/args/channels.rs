//! Columns of forces and responses.

use std::path::Path;

use clap::Args;
use mechid::analysis::AnalysisError;
use mechid::{Channels, Reading};

use super::RecordArgs;
use crate::error::CliError;

/// Columns of force and response; one column per degree of freedom, in the same order everywhere.
#[derive(Debug, Clone, Args)]
pub struct ChannelArgs {
    /// Force columns, in N, one per degree of freedom; 0 where no force acts [default: if no column
    /// is named at all, forces and responses are the columns with the unit of a force or of a
    /// response]
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
    /// Returns the columns; if none is named, those that state a force or a response in a file that
    /// is read like the `record`.
    pub fn in_file(&self, file: &Path, record: &RecordArgs) -> Result<Channels, CliError> {
        self.named_or((file, record), Channels::stated)
    }

    /// Returns the columns of each degree of freedom; if none is named, those that state a force or
    /// a response in the record, if each force has its response.
    pub fn pairs_in_record(&self, record: &RecordArgs) -> Result<Channels, CliError> {
        self.named_or((&record.record, record), Channels::stated_pairs)
    }

    fn named_or(
        &self,
        (file, record): (&Path, &RecordArgs),
        stated: impl Fn(&Path, &Reading) -> Result<Channels, AnalysisError>,
    ) -> Result<Channels, CliError> {
        let named = self.channels();
        if !named.is_empty() || file == Path::new("-") {
            return Ok(named);
        }
        Ok(stated(file, &record.reading())?)
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
