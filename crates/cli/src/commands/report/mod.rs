//! `mechid report`: one HTML file with everything an identification has to show.

mod channels;
mod excitation;
mod figures;
mod judgement;
mod page;
mod receptance;
mod reconstruction;
mod repeat;
mod residual;
mod sections;
mod tables;

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use self::channels::Channel;
use self::excitation::Excitation;
use self::receptance::Receptance;
use self::reconstruction::Reconstruction;
use self::residual::Residual;
use crate::commands::identify::course::{Compared, Course};
use crate::commands::identify::measurement::{Hold, Measurement};
use crate::commands::identify::report::Report;
use crate::commands::identify::{Identification, Identified};
use crate::error::CliError;
use crate::options::ReportArgs;
use crate::outcome::Outcome;

/// Identify, and write a report: one HTML file with data, fit, intervals, residual and pictures
///
/// Takes the options of `mechid identify`. The file needs nothing else: it can be sent, printed and
/// kept, and ends with the command that writes it again. The records are held whole, to be drawn.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  mechid report record.csv --force force --displacement displacement --output report.html
  mechid report rotor.csv --force fx,fy --displacement x,y --period 1024 --reconstruct-force \\
      --title 'Rotor at 3000 rpm' --output rotor.html
  mechid report a.csv b.csv --force f --displacement x --period 512 --method maximum-likelihood \\
      --validate c.csv --output rig.html")]
pub struct PageArgs {
    #[command(flatten)]
    identification: Identification,
    /// Find the force from the motion with the identified machine, too, and hold it against the
    /// measured one
    #[arg(long)]
    reconstruct_force: bool,
    /// Where the report goes
    #[arg(long, short, value_name = "FILE.html", value_parser = html_file, help_heading = "Output")]
    output: PathBuf,
    /// Heading of the report [default: the name of the record]
    #[arg(long, value_name = "TEXT", help_heading = "Output")]
    title: Option<String>,
    #[command(flatten)]
    pub report: ReportArgs,
}

fn html_file(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    match path.extension().and_then(|e| e.to_str()).map(str::to_lowercase).as_deref() {
        Some("html" | "htm") => Ok(path),
        _ => Err("the file name must end in .html".into()),
    }
}

/// Everything the page shows, computed.
struct Contents<'a> {
    title: String,
    found: &'a Identified,
    parts: Vec<Part<'a>>,
    /// The receptance that the records show, or why there is none.
    receptance: Result<Receptance, String>,
    /// The motions of a record that was not fitted, measured and predicted.
    validation: Vec<Compared>,
    command: String,
}

/// What the page shows of one record.
struct Part<'a> {
    measured: &'a Measurement,
    /// The name of the record, where there are several.
    name: Option<&'a str>,
    /// What makes the names of this record's figures its own.
    suffix: String,
    /// Lines of a period, where the fit was done on such.
    lines: Option<Vec<usize>>,
    channels: Vec<Channel>,
    excitations: Vec<Excitation>,
    /// Or why there is none.
    residual: Result<Residual, String>,
    reconstruction: Option<Reconstruction>,
}

/// The report of `mechid identify`, and where the page is.
#[derive(Serialize)]
struct Printed<'a> {
    #[serde(flatten)]
    report: &'a Report,
    html: String,
}

impl PageArgs {
    /// Reads, identifies, draws and writes.
    pub fn run(&self) -> Result<Outcome, CliError> {
        let found = self.identification.identify(Hold::Whole)?;
        let contents = self.contents(&found)?;
        let page = page::html(&contents)?;
        let html = self.output.display().to_string();
        let text = format!("{}\nreport: {html}\n", found.report.text());
        let printed = Printed { report: &found.report, html };
        Ok(Outcome::new(text, &printed)?.with_file(&self.output, page))
    }

    fn contents<'a>(&self, found: &'a Identified) -> Result<Contents<'a>, CliError> {
        let name = PathBuf::from(&found.report.file);
        let name = name.file_name().unwrap_or_default().to_string_lossy();
        let parts = 0..found.records.len();
        let validation = match &found.validated {
            Some(other) => found.fitted.course.predict(&found.fitted.estimate.system()?, other)?,
            None => Vec::new(),
        };
        Ok(Contents {
            title: self.title.clone().unwrap_or_else(|| format!("Identification of {name}")),
            found,
            parts: parts.map(|at| self.part(found, at)).collect::<Result<_, _>>()?,
            receptance: Receptance::of(found).map_err(|reason| reason.to_string()),
            validation,
            command: repeat::command(std::env::args_os().skip(1)),
        })
    }

    fn part<'a>(&self, found: &'a Identified, at: usize) -> Result<Part<'a>, CliError> {
        let measured = &found.records[at];
        let lines = match found.fitted.frequency {
            // Lines of segments are not those of the record.
            Some(_) if found.fitted.course == Course::Steady => {
                Some(self.identification.choose(&measured.force, measured.period)?)
            }
            _ => None,
        };
        let reconstruction = match self.reconstruct_force {
            true => Some(Reconstruction::of(found, measured, lines.clone())?),
            false => None,
        };
        Ok(Part {
            measured,
            name: (found.records.len() > 1).then_some(measured.file.as_str()),
            suffix: if at == 0 { String::new() } else { format!("-{}", at + 1) },
            channels: channels::channels(measured, &self.identification.channels)?,
            excitations: excitation::excitations(measured, lines.is_some())?,
            residual: Residual::of(found, at).map_err(|reason| reason.to_string()),
            reconstruction,
            lines,
        })
    }
}

impl Part<'_> {
    /// The name of a figure of this record.
    fn id(&self, figure: &str) -> String {
        format!("{figure}{}", self.suffix)
    }
}
