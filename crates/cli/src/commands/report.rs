//! `mechid report`: one HTML file with all results of an identification.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use clap::Args;
use mechid::analysis::Machine;
use mechid::analysis::modes::SavedModes;
use mechid::io::{Geometry, is_standard_output, output_name};
use mechid::report::{
    ModeShapes, PageSettings, ReportError, ToFigure, elements_page, modes_page, page,
};
use mechid::signal::message;
use serde::Serialize;

use crate::args::elements::ElementArgs;
use crate::args::fit::{FitArgs, TableArgs};
use crate::args::{AboutArgs, ReportArgs, TimeLimitArgs};
use crate::error::CliError;
use crate::outcome::{Files, Outcome};
use crate::{options, repeat};

/// Identify, and write a report: one HTML file with data, fit, intervals, residual and pictures
///
/// The options of `mechid identify` apply. The file is self-contained: it can be sent, printed and
/// archived; its figures zoom and have a cursor. It ends with the command that reproduces it.
///
/// A long text is read in chunks, and `mechid report` keeps as little of it in memory as `mechid
/// identify`. Levels, time histories and mean periods cover all samples. The residual over time
/// covers the first 262144 samples; for an open record, the spectrum of the residual and the
/// reconstructed force do, too. The page states this.
///
/// With --machine the page is that of a machine of named elements. A JSON file for which no columns
/// are given is a saved result of `mechid modes` or `mechid identify`, or the description of a
/// machine; the page then shows its modes.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  mechid report record.csv --force force --displacement displacement --output report.html
  mechid report rotor.csv --force fx,fy --displacement x,y --period 1024 --reconstruct-force \\
      --title 'Rotor at 3000 rpm' --output rotor.html
  mechid report a.csv b.csv --force f --displacement x --period 512 --method maximum-likelihood \\
      --validate c.csv --output rig.html
  mechid report chain.csv --machine chain.json --period 2048 --output chain.html
  mechid report modes.json --geometry frame.csv --output modes.html")]
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
    #[command(flatten)]
    about: AboutArgs,
    /// Positions of the channels, at which the mode shapes are drawn: a universal file (datasets 15
    /// or 2411, and 82), or a table with rows name,x,y,z in m and line,name,name [default: a row,
    /// by the names of the channels]
    #[arg(long, value_name = "FILE", help_heading = "Output", conflicts_with = "machine")]
    geometry: Option<PathBuf>,
    #[command(flatten)]
    pub limit: TimeLimitArgs,
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
            .reads(&self.about.about)
            .reads(&self.geometry)
            .writes([&self.output])
    }

    /// Reads, identifies, draws and writes; `words` are the arguments of the program.
    pub fn run(&self, words: &[OsString]) -> Result<Outcome, CliError> {
        let settings = PageSettings {
            title: self.about.title.clone(),
            reconstruct_force: self.reconstruct_force,
            about: self.about.details(self.fit.record())?,
            geometry: self.geometry.as_ref().map(Geometry::read).transpose()?,
            ..repeat::settings(words)
        };
        if let Some(saved) = self.fit.saved_result() {
            return self.saved_page(saved, &settings);
        }
        if let Some(identified) = self.fit.identify_elements(&self.table, &self.elements)? {
            let text = self.fit.text_of_elements(&identified);
            return self.outcome(&text, &identified, &elements_page(&identified, &settings)?);
        }
        if self.table.is_given() {
            let (option, why) = ("--frf-table", "needs --machine in a report");
            return Err(CliError::MisplacedOption { option, why });
        }
        let identified = self.fit.identify()?;
        self.outcome(&self.fit.text(&identified), &identified, &page(&identified, &settings)?)
    }

    /// Writes the page of a saved result with modes, or of a described machine.
    fn saved_page(&self, file: &Path, settings: &PageSettings) -> Result<Outcome, CliError> {
        let modes = SavedModes::read(file)?;
        let shapes = ModeShapes::from_saved(&modes, settings.geometry.as_ref());
        if shapes.is_none() && settings.geometry.is_some() {
            return Err(CliError::NoShapes { names: modes.shapes().1.join(", ") });
        }
        let figure = match modes.has_system().then(|| Machine::read(file)?.figure()) {
            Some(Ok(figure)) => Some(figure),
            None | Some(Err(ReportError::NothingResonates { .. })) => None,
            Some(Err(error)) => return Err(error.into()),
        };
        let page = modes_page(&modes, figure, shapes.as_ref(), settings)?;
        let text = format!("{}: {}\n", modes.name, message::count(modes.modes.len(), "mode"));
        self.outcome(&text, &serde_json::json!({}), &page)
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
