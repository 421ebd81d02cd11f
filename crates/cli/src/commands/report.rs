//! `mechid report`: one HTML file with everything an identification has to show.

use std::ffi::OsString;
use std::path::PathBuf;

use clap::Args;
use mechid::analysis::Identified;
use mechid::io::{is_standard_output, output_name};
use mechid::report::{PageSettings, page};
use serde::Serialize;

use crate::args::ReportArgs;
use crate::args::fit::FitArgs;
use crate::error::CliError;
use crate::outcome::{Files, Outcome};
use crate::{options, repeat};

/// Identify, and write a report: one HTML file with data, fit, intervals, residual and pictures
///
/// Takes the options of `mechid identify`. The file needs nothing else: it can be sent, printed and
/// kept, and ends with the command that writes it again.
///
/// A long text is gone through a stretch at a time and held as by `mechid identify`: levels, time
/// histories and mean periods are those of all samples; the residual in time and, of an open record,
/// its spectrum and the force found are those of the first 262144 samples, and the page says so.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  mechid report record.csv --force force --displacement displacement --output report.html
  mechid report rotor.csv --force fx,fy --displacement x,y --period 1024 --reconstruct-force \\
      --title 'Rotor at 3000 rpm' --output rotor.html
  mechid report a.csv b.csv --force f --displacement x --period 512 --method maximum-likelihood \\
      --validate c.csv --output rig.html")]
pub struct PageArgs {
    #[command(flatten)]
    fit: FitArgs,
    /// Also reconstruct the force from the response with the identified system, and compare it with
    /// the measured one
    #[arg(long)]
    reconstruct_force: bool,
    /// File for the report (-: standard output)
    #[arg(long, short, value_name = "FILE.html", value_parser = html_file, help_heading = "Output")]
    output: PathBuf,
    /// Heading of the report [default: the name of the record]
    #[arg(long, value_name = "TEXT", help_heading = "Output")]
    title: Option<String>,
    #[command(flatten)]
    pub report: ReportArgs,
}

/// Parses the name of a page.
pub fn html_file(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    match path.extension().and_then(|e| e.to_str()).map(str::to_lowercase).as_deref() {
        Some("html" | "htm") => Ok(path),
        _ if is_standard_output(&path) => Ok(path),
        _ => Err("the file name must end in .html".into()),
    }
}

/// The identification, and where the page is.
#[derive(Serialize)]
struct Printed<'a> {
    #[serde(flatten)]
    identified: &'a Identified,
    html: String,
}

impl PageArgs {
    /// Returns the files that the arguments name.
    pub fn files(&self) -> Files<'_> {
        self.fit.files().writes([&self.output])
    }

    /// Reads, identifies, draws and writes; `words` are the arguments of the program.
    pub fn run(&self, words: &[OsString]) -> Result<Outcome, CliError> {
        let identified = self.fit.identify()?;
        let settings = PageSettings {
            title: self.title.clone(),
            reconstruct_force: self.reconstruct_force,
            command: Some(repeat::command(words)),
        };
        let page = options::spelled(&page(&identified, &settings)?);
        let html = output_name(&self.output);
        let text = format!("{}\nreport: {html}\n", self.fit.text(&identified));
        Ok(Outcome::new(text, &Printed { identified: &identified, html })?
            .with_file(&self.output, page))
    }
}
