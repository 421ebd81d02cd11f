//! What a subcommand found, and how it reaches the user.

use std::io::{self, Write as _};

use mechid::io::{OutputFile, write_all};
use serde::Serialize;

use crate::error::CliError;
use crate::options::ReportArgs;

/// The result of a subcommand, complete before anything is written or printed.
#[derive(Debug)]
pub struct Outcome {
    /// What a person reads.
    text: String,
    /// The same for programs.
    json: String,
    /// Files to write.
    files: Vec<OutputFile>,
}

impl Outcome {
    /// An outcome told as `text` to a person and as the fields of `report` to a program.
    pub fn new(text: String, report: &impl Serialize) -> Result<Self, CliError> {
        let json = serde_json::to_string_pretty(report)? + "\n";
        Ok(Self { text, json, files: Vec::new() })
    }

    /// The same outcome with one more file to write.
    #[allow(dead_code, reason = "for the subcommands that write")]
    pub fn with_file(mut self, path: &std::path::Path, content: impl Into<Vec<u8>>) -> Self {
        self.files.push(OutputFile { path: path.to_owned(), content: content.into() });
        self
    }

    /// Writes the files, all or none, and prints the report.
    pub fn deliver(&self, report: &ReportArgs) -> Result<(), CliError> {
        write_all(&self.files)?;
        let text = match report {
            ReportArgs { json: true, .. } => &self.json,
            ReportArgs { quiet: true, .. } => return Ok(()),
            _ => &self.text,
        };
        let mut out = io::stdout().lock();
        match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
            // The reader has seen enough (`mechid … | head`).
            Err(e) if e.kind() == io::ErrorKind::BrokenPipe => Ok(()),
            other => Ok(other?),
        }
    }
}
