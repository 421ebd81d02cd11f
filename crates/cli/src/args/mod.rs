//! Arguments that several subcommands share, and their settings of the analysis.

pub mod channels;
pub mod elements;
pub mod fit;
pub mod hits;
mod style;
pub mod word;

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use clap::Args;
use mechid::analysis::modal::ShapedMode;
use mechid::analysis::{Detrend, Measurement, Reading, RecordPlan, Window};
use mechid::io::{FrequencyResponses, Geometry, IoError, input_name, record_details};
use mechid::report::{ModeShapes, PageSettings};

pub use self::channels::{ChannelArgs, ResponseArgs};
pub use self::style::StyleArgs;
use self::word::word;
use crate::error::CliError;
use crate::outcome::{Files, Outcome};
use crate::repeat;

/// Format of the printed result.
#[derive(Debug, Default, Args)]
pub struct ReportArgs {
    /// Print the report as JSON, for programs
    #[arg(long, help_heading = "Output")]
    pub json: bool,
    /// Print no report on success
    #[arg(long, short, help_heading = "Output", conflicts_with = "json")]
    pub quiet: bool,
}

/// Limit of the time of an analysis.
#[derive(Debug, Clone, Copy, Default, Args)]
pub struct TimeLimitArgs {
    /// Time after which all searches end at their best points so far, in s; the result then says
    /// that it is not final [default: a limit of the work that grows with the size of the file]
    #[arg(long, value_name = "SECONDS", value_parser = not_negative)]
    pub time_limit: Option<f64>,
}

/// File to draw the result into.
#[derive(Debug, Default, Args)]
pub struct PlotArgs {
    /// Draw the result into this file; the ending .svg, .png or .html selects the format; an .html
    /// page has zoom and a cursor
    #[arg(long, value_name = "FILE.svg|.png|.html", value_parser = plot_file, help_heading = "Output")]
    pub plot: Option<PathBuf>,
}

impl PlotArgs {
    /// Returns whether a page is requested.
    pub fn is_page(&self) -> bool {
        let ending = self.plot.as_ref().and_then(|path| path.extension());
        ending.is_some_and(|ending| ending.eq_ignore_ascii_case("html"))
    }
}

/// Mode shapes to draw and to write.
#[derive(Debug, Default, Args)]
#[command(next_help_heading = "Mode shapes")]
pub struct ShapeArgs {
    /// Positions of the channels: a universal file (datasets 15 or 2411, and 82), or a table with
    /// rows name,x,y,z in m and line,name,name [default: a row or a grid, from channel names such
    /// as 1+Z and 1.2+Z]
    #[arg(long, value_name = "FILE")]
    geometry: Option<PathBuf>,
    /// Write geometry and complex shapes into this universal file (datasets 164, 15, 82, 55; SI
    /// units)
    #[arg(long, value_name = "FILE.unv")]
    shapes: Option<PathBuf>,
}

impl ShapeArgs {
    /// Adds the files that the arguments name.
    pub fn add_files<'a>(&'a self, files: Files<'a>) -> Files<'a> {
        files.reads(&self.geometry).writes(&self.shapes)
    }

    /// Returns the shapes of modes whose entries have these names; `None` if no shape can be drawn.
    pub fn mode_shapes(
        &self,
        modes: &[ShapedMode],
        names: &[String],
    ) -> Result<Option<ModeShapes>, CliError> {
        let geometry = self.geometry.as_ref().map(Geometry::read).transpose()?;
        let shapes = ModeShapes::from_modes(modes, names, geometry.as_ref());
        if shapes.is_none() && (self.geometry.is_some() || self.shapes.is_some()) {
            return Err(CliError::NoShapes { names: names.join(", ") });
        }
        Ok(shapes)
    }

    /// Returns the outcome with the file of shapes, if requested.
    pub fn with_shapes(&self, outcome: Outcome, shapes: Option<&ModeShapes>) -> Outcome {
        match (&self.shapes, shapes) {
            (Some(path), Some(shapes)) => {
                outcome.with_file(path, shapes.geometry.universal_file(&shapes.modes))
            }
            _ => outcome,
        }
    }
}

fn plot_file(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    match path.extension().and_then(|e| e.to_str()).map(str::to_lowercase).as_deref() {
        Some("svg" | "png" | "html") => Ok(path),
        _ => Err("the file name must end in .svg, .png or .html".into()),
    }
}

/// Heading of a page, and details of the measurement that the page shows.
#[derive(Debug, Default, Args)]
#[command(next_help_heading = "Output")]
pub struct AboutArgs {
    /// Heading of the page [default: the name of the record]
    #[arg(long, value_name = "TEXT")]
    pub title: Option<String>,
    /// File with further details for the page, one `name: value` per line, such as sensors,
    /// operator, date, place and comment; details in the head of the record (comments above a
    /// table, .lvm, universal file, Parquet) are shown, too
    #[arg(long, value_name = "FILE")]
    pub about: Option<PathBuf>,
}

impl AboutArgs {
    /// Returns the name of the given option, `--title` or `--about`; `--title` if both are given,
    /// and `None` if neither is given.
    pub fn given(&self) -> Option<&'static str> {
        let title = self.title.as_ref().map(|_| "--title");
        title.or(self.about.as_ref().map(|_| "--about"))
    }

    /// Returns the details in the `--about` file, then the details in the record whose names are
    /// not in that file.
    pub fn details(&self, record: &Path) -> Result<Vec<(String, String)>, CliError> {
        let mut about = self.stated()?;
        for (name, value) in record_details(record) {
            if about.iter().all(|(other, _)| !other.eq_ignore_ascii_case(&name)) {
                about.push((name, value));
            }
        }
        Ok(about)
    }

    /// Reads lines of `name: value`; a line without a colon continues the one before.
    fn stated(&self) -> Result<Vec<(String, String)>, CliError> {
        let Some(file) = &self.about else { return Ok(Vec::new()) };
        let text = std::fs::read_to_string(file)
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
}

/// Options that draw a result as a picture or as a page; a page also has a heading and details.
#[derive(Debug, Default, Args)]
pub struct FigureArgs {
    #[command(flatten)]
    pub plot: PlotArgs,
    #[command(flatten)]
    about: AboutArgs,
}

impl FigureArgs {
    /// Adds the files that the arguments name.
    pub fn add_files<'a>(&'a self, files: Files<'a>) -> Files<'a> {
        files.reads(&self.about.about).writes(&self.plot.plot)
    }

    /// Returns heading, details and command for the page of a record; `None` if no page is
    /// requested. `words` are the arguments of the program.
    ///
    /// # Errors
    /// [`CliError::MisplacedOption`] if a heading or details are given, but no page is requested.
    pub fn settings(
        &self,
        record: &Path,
        words: &[OsString],
    ) -> Result<Option<PageSettings>, CliError> {
        if self.plot.is_page() {
            let (title, about) = (self.about.title.clone(), self.about.details(record)?);
            return Ok(Some(PageSettings { title, about, ..repeat::settings(words) }));
        }
        match self.about.given() {
            Some(option) => {
                let why = "needs a page: --plot FILE.html";
                Err(CliError::MisplacedOption { option, why })
            }
            None => Ok(None),
        }
    }
}

/// Record, and its window.
#[allow(rustdoc::broken_intra_doc_links, reason = "brackets of a help text")]
#[derive(Debug, Clone, Args)]
pub struct RecordArgs {
    /// The record: text with one row per sample, MATLAB .mat, HDF5, universal file (dataset 58), or
    /// Parquet; also in gzip; - is standard input
    ///
    /// The format is detected. Text: the delimiter (comma, semicolon, tab, blanks) and the header
    /// are detected too; the header may be a comment (#, %, !) or that of LabVIEW (.lvm). MATLAB: a
    /// vector is one column, a matrix has the columns name[1], name[2] …, a field of a struct is
    /// called name.field. HDF5: a data set is one column, called by its path, such as run/force.
    /// Universal file: a function of time is one column, named after its node and direction, such
    /// as 12+Z, and has its own time axis. Parquet: times are read as seconds from the first one;
    /// the keys of the file may state units and sample_rate_hz.
    #[arg(value_name = "RECORD")]
    pub record: PathBuf,
    /// Number of header lines to skip above the table
    #[arg(long, value_name = "COUNT", default_value_t = 0)]
    pub skip_lines: u64,
    /// Column that names the record of each row, if a Parquet file holds many records
    #[arg(long, value_name = "COLUMN")]
    pub record_column: Option<String>,
    /// Record to read from a file of many records, by its name in --record-column [default: the
    /// only one]
    #[arg(long, value_name = "ID", requires = "record_column")]
    pub record_id: Option<String>,
    /// Factor that raises all limits on a file: 4 MiB per row of text, 4 KiB per name, 65536
    /// columns, 1 GiB of unpacked data from a compressed file, 2^28 numbers, and memory
    /// (--memory-gb)
    #[arg(long, value_name = "FACTOR", value_parser = at_least_one)]
    pub raise_limits: Option<usize>,
    /// Maximum memory for the numbers of a file and for the computation, in GB [default: 0.27 GB
    /// plus 512 bytes per byte of the file, at most 8.6 GB]
    #[arg(long, value_name = "GB", value_parser = positive)]
    pub memory_gb: Option<f64>,
    /// Time column: name or number, counted from 1; in the unit that its name (time_ms, Time [s])
    /// or the line of units below it states, otherwise in s [default: the file's own time axis, or
    /// a column called time or t]
    #[arg(long, value_name = "COLUMN", help_heading = "Time and window")]
    pub time: Option<String>,
    /// Sampling rate, in Hz, if there is no time column
    #[arg(
        long,
        value_name = "HZ",
        conflicts_with = "time",
        allow_negative_numbers = true,
        help_heading = "Time and window"
    )]
    pub sample_rate: Option<f64>,
    /// Unit of a column, with priority over its header: acc=g, Force=lbf, time=ms; may be repeated
    #[arg(long = "unit", value_name = "COLUMN=UNIT", value_parser = column_and_text, help_heading = "Units")]
    pub units: Vec<(String, String)>,
    /// Factor that converts a column to SI units, for example of a sensor: Force=0.0893 for 11.2
    /// mV/N and numbers in mV; may be repeated
    #[arg(long = "scale", value_name = "COLUMN=FACTOR", value_parser = column_and_factor,
          help_heading = "Units")]
    pub scales: Vec<(String, f64)>,
    /// First sample of the window, counted from 1
    #[arg(long, value_name = "SAMPLE", default_value_t = 1, value_parser = at_least_one,
          help_heading = "Time and window")]
    pub start: usize,
    /// Samples in one period [default: all samples from --start on]
    #[arg(long, value_name = "SAMPLES", value_parser = at_least_one, help_heading = "Time and window")]
    pub period: Option<usize>,
    /// Whole periods in the window [default: as many as there are]
    #[arg(long, value_name = "COUNT", value_parser = at_least_one, requires = "period",
          help_heading = "Time and window")]
    pub periods: Option<usize>,
    /// Constant to subtract from every channel: none, or the mean of the whole record (not only of
    /// the window) [default: none]
    #[arg(long, value_name = "WHAT", value_parser = word::<Detrend>(), help_heading = "Time and window")]
    pub detrend: Option<Detrend>,
}

impl RecordArgs {
    /// Refuses units and factors of columns, which only records have.
    pub fn refuse_units(&self) -> Result<(), CliError> {
        let why = "belongs to records; a table states its units in its header";
        match (self.units.is_empty(), self.scales.is_empty()) {
            (true, true) => Ok(()),
            (false, _) => Err(CliError::MisplacedOption { option: "--unit", why }),
            (true, false) => Err(CliError::MisplacedOption { option: "--scale", why }),
        }
    }

    /// Reads the record and `more` files as tables of frequency responses.
    pub fn read_responses(&self, more: &[PathBuf]) -> Result<Vec<FrequencyResponses>, CliError> {
        self.refuse_units()?;
        let files = std::iter::once(&self.record).chain(more);
        Ok(files.map(|file| self.read_table(file)).collect::<Result<_, _>>()?)
    }

    /// Reads a table of frequency responses within the limits of the options.
    pub fn read_table(&self, file: &Path) -> Result<FrequencyResponses, IoError> {
        FrequencyResponses::read_with(file, &self.reading().limits())
    }
}

/// Parses a column and the text after the last equals sign.
fn column_and_text(text: &str) -> Result<(String, String), String> {
    match text.rsplit_once('=') {
        Some((column, value)) if !column.is_empty() && !value.is_empty() => {
            Ok((column.trim().into(), value.trim().into()))
        }
        _ => Err("a column and a value with = between them are needed".into()),
    }
}

/// Parses a column and a factor.
fn column_and_factor(text: &str) -> Result<(String, f64), String> {
    let (column, factor) = column_and_text(text)?;
    let factor = factor.parse::<f64>().map_err(|e| format!("a number is needed: {e}"))?;
    if !factor.is_normal() {
        return Err(format!("a finite factor other than 0 is needed, got {factor}"));
    }
    Ok((column, factor))
}

/// Parses a positive, finite number.
pub fn positive(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if value > 0.0 && f64::is_finite(value) => Ok(value),
        Ok(value) => Err(format!("a positive number is needed, got {value}")),
        Err(e) => Err(format!("a number is needed: {e}")),
    }
}

/// Parses a finite number that is not negative.
pub fn not_negative(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if value >= 0.0 && f64::is_finite(value) => Ok(value),
        Ok(value) => Err(format!("a finite number of at least 0 is needed, got {value}")),
        Err(e) => Err(format!("a number is needed: {e}")),
    }
}

/// Parses a count of at least one.
pub fn at_least_one(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(0) => Err("a number of at least 1 is needed, got 0 (counted from 1)".into()),
        Ok(n) => Ok(n),
        Err(e) => Err(format!("a whole number is needed: {e}")),
    }
}

impl RecordArgs {
    /// Returns the settings for reading the file.
    pub fn reading(&self) -> Reading {
        Reading {
            skip_lines: self.skip_lines,
            time: self.time.clone(),
            sample_rate_hz: self.sample_rate,
            detrend: self.detrend.unwrap_or_default(),
            record_column: self.record_column.clone(),
            record_id: self.record_id.clone(),
            units: self.units.iter().cloned().collect(),
            scales: self.scales.iter().cloned().collect(),
            limits_factor: self.raise_limits,
            memory_gb: self.memory_gb,
        }
    }

    /// Returns the window.
    pub fn window(&self) -> Window {
        Window { start: self.start, period: self.period, periods: self.periods }
    }

    /// Opens the record with these columns.
    pub fn open(&self, channels: &mechid::Channels) -> Result<Measurement, CliError> {
        self.open_other(&self.record, channels, self.window())
    }

    /// Opens another record, read in the same way.
    pub fn open_other(
        &self,
        record: &std::path::Path,
        channels: &mechid::Channels,
        window: Window,
    ) -> Result<Measurement, CliError> {
        let (path, channels, reading) = (record.to_owned(), channels.clone(), self.reading());
        Ok(RecordPlan { path, channels, reading, window }.open()?)
    }
}
