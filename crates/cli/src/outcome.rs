//! What a subcommand found, and how it reaches the user.

use std::io;

use mechid::io::{BegunFile, OutputFile, is_standard_output, write_all};
use mechid::plot::Figure;
use serde::Serialize;

use crate::args::{PlotArgs, ReportArgs};
use crate::error::CliError;
use crate::options;

/// Pixels of a PNG file for each px of the drawing.
const PNG_SCALE: f64 = 2.0;

/// The result of a subcommand, complete before anything is written or printed.
#[derive(Debug)]
pub struct Outcome {
    /// What a person reads.
    text: String,
    /// The same for programs.
    json: String,
    /// Files to write.
    files: Vec<OutputFile>,
    /// Files too long to be held, complete but for their names.
    begun: Vec<BegunFile>,
}

impl Outcome {
    /// An outcome told as `text` to a person and as the fields of `report` to a program.
    pub fn new(text: String, report: &impl Serialize) -> Result<Self, CliError> {
        let json = serde_json::to_string_pretty(report)? + "\n";
        let text = options::spelled(&text);
        Ok(Self { text, json, files: Vec::new(), begun: Vec::new() })
    }

    /// An outcome that is a text and nothing else.
    pub fn of_text(text: String) -> Self {
        Self { text, json: String::new(), files: Vec::new(), begun: Vec::new() }
    }

    /// The same outcome with one more file to write.
    pub fn with_file(mut self, path: &std::path::Path, content: impl Into<Vec<u8>>) -> Self {
        self.files.push(OutputFile { path: path.to_owned(), content: content.into() });
        self
    }

    /// The same outcome with one more file, which only needs its name.
    pub fn with_begun(mut self, file: BegunFile) -> Self {
        self.begun.push(file);
        self
    }

    /// The same outcome with the figure that `--plot` asks for, drawn only then.
    pub fn with_plot(
        self,
        plot: &PlotArgs,
        figure: impl FnOnce() -> Result<Figure, CliError>,
    ) -> Result<Self, CliError> {
        let Some(path) = &plot.plot else { return Ok(self) };
        let figure = figure()?;
        let bitmap = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("png"));
        let content =
            if bitmap { figure.to_png(PNG_SCALE)? } else { figure.to_svg()?.into_bytes() };
        Ok(self.with_file(path, content))
    }

    /// Writes the files, all or none, and prints the report: on the error stream where a file goes
    /// to standard output, for whoever reads on there expects the file and nothing else.
    pub fn deliver(self, report: &ReportArgs) -> Result<(), CliError> {
        let taken = self.begun.iter().filter(|file| file.is_for_standard_output()).count()
            + self.files.iter().filter(|file| is_standard_output(&file.path)).count();
        if taken + usize::from(report.json) > 1 && taken > 0 {
            return Err(CliError::SharedOutput { files: taken, json: report.json });
        }
        write_all(self.begun, &self.files)?;
        let text = match report {
            ReportArgs { json: true, .. } => &self.json,
            ReportArgs { quiet: true, .. } => return Ok(()),
            _ => &self.text,
        };
        let printed = match taken {
            0 => print(io::stdout().lock(), text),
            _ => print(io::stderr().lock(), text),
        };
        match printed {
            // The reader has seen enough (`mechid … | head`).
            Err(e) if e.kind() == io::ErrorKind::BrokenPipe => Ok(()),
            other => Ok(other?),
        }
    }
}

fn print(mut out: impl io::Write, text: &str) -> io::Result<()> {
    out.write_all(text.as_bytes()).and_then(|()| out.flush())
}
