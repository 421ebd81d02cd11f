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
mod whole;

use std::path::PathBuf;

use clap::Args;
use mechid::io::{is_standard_output, output_name};
use serde::Serialize;

use self::channels::Channel;
use self::excitation::Excitation;
use self::receptance::Receptance;
use self::reconstruction::Reconstruction;
use self::residual::Residual;
use self::whole::Whole;
use crate::commands::identify::course::{Compared, Course};
use crate::commands::identify::measurement::{Measurement, Recorded};
use crate::commands::identify::report::Report;
use crate::commands::identify::{Identification, Identified};
use crate::error::CliError;
use crate::options::ReportArgs;
use crate::outcome::Outcome;

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
    identification: Identification,
    /// Find the force from the motion with the identified machine, too, and hold it against the
    /// measured one
    #[arg(long)]
    reconstruct_force: bool,
    /// Where the report goes (-: to standard output)
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
        _ if is_standard_output(&path) => Ok(path),
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
    recorded: &'a Recorded,
    whole: Whole,
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
        let found = self.identification.identify(self.identification.hold())?;
        let contents = self.contents(&found)?;
        let page = page::html(&contents)?;
        let html = output_name(&self.output);
        let text = format!("{}\nreport: {html}\n", found.report.text());
        let printed = Printed { report: &found.report, html };
        Ok(Outcome::new(text, &printed)?.with_file(&self.output, page))
    }

    fn contents<'a>(&self, found: &'a Identified) -> Result<Contents<'a>, CliError> {
        let name = PathBuf::from(&found.report.file);
        let name = name.file_name().unwrap_or_default().to_string_lossy();
        let parts = (0..found.records.len()).map(|at| self.part(found, at));
        let parts: Vec<Part<'_>> = parts.collect::<Result<_, _>>()?;
        let validation = match &found.validated {
            Some(other) => found.fitted.course.predict(&found.fitted.estimate.system()?, other)?,
            None => Vec::new(),
        };
        Ok(Contents {
            title: self.title.clone().unwrap_or_else(|| format!("Identification of {name}")),
            found,
            receptance: Receptance::of(found, &parts).map_err(|reason| reason.to_string()),
            parts,
            validation,
            command: repeat::command(std::env::args_os().skip(1)),
        })
    }

    fn part<'a>(&self, found: &'a Identified, at: usize) -> Result<Part<'a>, CliError> {
        let recorded = &found.records[at];
        let held = &recorded.held;
        let lines = match found.fitted.frequency {
            // Lines of segments are not those of the record.
            Some(_) if found.fitted.course == Course::Steady => {
                Some(self.identification.choose(&held.force, held.period)?)
            }
            _ => None,
        };
        let whole = Whole::of(recorded)?;
        let mean = whole.mean.as_ref().filter(|_| lines.is_some());
        let period = mean.unwrap_or(held);
        let reconstruction = match self.reconstruct_force {
            true => Some(Reconstruction::of(found, period, lines.clone())?),
            false => None,
        };
        Ok(Part {
            recorded,
            name: (found.records.len() > 1).then_some(held.file.as_str()),
            suffix: if at == 0 { String::new() } else { format!("-{}", at + 1) },
            channels: channels::channels(held, &whole, &self.identification.channels),
            excitations: excitation::excitations(&period.force)?,
            residual: Residual::of(found, at, mean).map_err(|reason| reason.to_string()),
            reconstruction,
            lines,
            whole,
        })
    }
}

impl Part<'_> {
    /// What of the record is held.
    fn held(&self) -> &Measurement {
        &self.recorded.held
    }

    /// What spectra are of: the mean period where lines of periods were fitted, otherwise what is
    /// held.
    fn period(&self) -> &Measurement {
        match self.lines {
            Some(_) => self.whole.period(self.held()),
            None => self.held(),
        }
    }

    /// The name of a figure of this record.
    fn id(&self, figure: &str) -> String {
        format!("{figure}{}", self.suffix)
    }

    /// A caption of what is told of the samples held, with their numbers where these are not all.
    fn of_held(&self, caption: &str) -> String {
        match self.held().held_to() {
            Some(last) => format!("{caption}, samples {} to {last}", self.held().first_sample),
            None => caption.into(),
        }
    }

    /// The same of what is told of [`Part::period`].
    fn of_period(&self, caption: &str) -> String {
        match self.lines {
            Some(_) => caption.into(),
            None => self.of_held(caption),
        }
    }
}
