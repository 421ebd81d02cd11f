//! `mechid report`: one HTML file with all results of an identification.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;
use mechid::io::{Geometry, input_name, is_standard_output, output_name};
use mechid::report::{PageSettings, elements_page, page};
use serde::Serialize;

use crate::args::ReportArgs;
use crate::args::elements::ElementArgs;
use crate::args::fit::{FitArgs, TableArgs};
use crate::error::CliError;
use crate::outcome::{Files, Outcome};
use crate::{options, repeat};

/// Identify, and write a report: one HTML file with data, fit, intervals, residual and pictures
///
/// Takes the options of `mechid identify`. The file is self-contained: it can be sent, printed and
/// archived; its figures zoom and have a cursor. It ends with the command that writes it again.
///
/// A long text is read in chunks and kept in memory as by `mechid identify`: levels, time histories
/// and mean periods cover all samples; the residual in time and, for an open record, its spectrum
/// and the reconstructed force cover the first 262144 samples, and the page says so.
///
/// With --machine the page is that of a machine of named elements.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  mechid report record.csv --force force --displacement displacement --output report.html
  mechid report rotor.csv --force fx,fy --displacement x,y --period 1024 --reconstruct-force \\
      --title 'Rotor at 3000 rpm' --output rotor.html
  mechid report a.csv b.csv --force f --displacement x --period 512 --method maximum-likelihood \\
      --validate c.csv --output rig.html
  mechid report chain.csv --machine chain.json --period 2048 --output chain.html")]
pub struct PageArgs {
    #[command(flatten)]
    fit: FitArgs,
    #[command(flatten)]
    table: TableArgs,
    #[command(flatten)]
    elements: ElementArgs,
    /// Also reconstruct the force from the response with the identified system, and compare it with
    /// the measured one
    #[arg(long, conflicts_with = "machine")]
    reconstruct_force: bool,
    /// File for the report (-: standard output)
    #[arg(long, short, value_name = "FILE.html", value_parser = html_file, help_heading = "Output")]
    output: PathBuf,
    /// Heading of the report [default: the name of the record]
    #[arg(long, value_name = "TEXT", help_heading = "Output")]
    title: Option<String>,
    /// File with further details for the page, one `name: value` per line, such as sensors,
    /// operator, date, place and comment
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    about: Option<PathBuf>,
    /// Places of the channels, to draw the mode shapes on: a universal file (datasets 15 or 2411,
    /// and 82), or a table with rows name,x,y,z in m and line,name,name [default: a row, by the
    /// names of the channels]
    #[arg(long, value_name = "FILE", help_heading = "Output", conflicts_with = "machine")]
    geometry: Option<PathBuf>,
    #[command(flatten)]
    pub report: ReportArgs,
}

/// Reads lines of `name: value`; a line without a colon continues the one before.
fn read_about(file: &Path) -> Result<Vec<(String, String)>, CliError> {
    let text = fs::read_to_string(file)
        .map_err(|source| CliError::About { file: input_name(file), source })?;
    let mut about: Vec<(String, String)> = Vec::new();
    for line in text.lines().map(str::trim).filter(|line| !line.is_empty()) {
        match (line.split_once(':'), about.last_mut()) {
            (Some((name, value)), _) => about.push((name.trim().into(), value.trim().into())),
            (None, Some((_, value))) => *value += &format!(" {line}"),
            (None, None) => about.push(("Comment".into(), line.into())),
        }
    }
    Ok(about)
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

/// Identification, and path of the page.
#[derive(Serialize)]
struct Printed<'a, R> {
    #[serde(flatten)]
    identified: &'a R,
    html: String,
}

impl PageArgs {
    /// Returns the files that the arguments name.
    pub fn files(&self) -> Files<'_> {
        self.fit
            .files()
            .reads(self.elements.inputs())
            .reads(&self.about)
            .reads(&self.geometry)
            .writes([&self.output])
    }

    /// Reads, identifies, draws and writes; `words` are the arguments of the program.
    pub fn run(&self, words: &[OsString]) -> Result<Outcome, CliError> {
        let settings = PageSettings {
            title: self.title.clone(),
            reconstruct_force: self.reconstruct_force,
            command: Some(repeat::command(words)),
            about: self.about.as_deref().map(read_about).transpose()?.unwrap_or_default(),
            geometry: self.geometry.as_ref().map(Geometry::read).transpose()?,
        };
        if let Some(identified) = self.fit.identify_elements(&self.table, &self.elements)? {
            let text = self.fit.text_of_elements(&identified);
            return self.outcome(&text, &identified, &elements_page(&identified, &settings)?);
        }
        if self.table.is_given() {
            let (option, why) = ("--frf-table", "of a report belongs to --machine");
            return Err(CliError::MisplacedOption { option, why });
        }
        let identified = self.fit.identify()?;
        self.outcome(&self.fit.text(&identified), &identified, &page(&identified, &settings)?)
    }

    /// Prints the identification, and writes its page.
    fn outcome<R: Serialize>(
        &self,
        text: &str,
        identified: &R,
        page: &str,
    ) -> Result<Outcome, CliError> {
        let html = output_name(&self.output);
        let text = format!("{text}\nreport: {html}\n");
        Ok(Outcome::new(text, &Printed { identified, html })?
            .with_file(&self.output, options::spelled(page)))
    }
}
