//! `mechid modes`: natural frequencies, damping ratios and shapes, from any kind of data.

use std::f64::consts::TAU;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

use clap::Args;
use mechid::analysis::identify::Band;
use mechid::analysis::modal::ShapedMode;
use mechid::analysis::modes::{ModalTest, ModesSettings, Places, Properties, SavedModes};
use mechid::analysis::{AnalysisError, Machine, ModalSummary, ResponseQuantity};
use mechid::integrate::ModeSearch;
use mechid::io::{FrequencyResponses, IoError, input_name, read_sparse_system};
use mechid::report::{PageSettings, ToFigure, comparison_page, comparison_svg, modes_page};
use mechid::selected_modes::SelectedModes;
use mechid::{Channels, DecaySettings, Measurement, ModeSet, Modes};
use serde::Serialize;

use crate::args::hits::HitRuleArgs;
use crate::args::word::word;
use crate::args::{
    AboutArgs, ChannelArgs, PlotArgs, RecordArgs, ReportArgs, ShapeArgs, StyleArgs, TimeLimitArgs,
    at_least_one, positive,
};
use crate::error::CliError;
use crate::outcome::{Files, Outcome};
use crate::{options, repeat};

/// Find the modes: of a test with forces, of a table of frequency responses, of a free decay, of an
/// ambient record, of a machine
///
/// With --force the record has any number of measured forces and responses. The forces are those of
/// shakers, of a hammer (--hits excludes bad hits), or of a hammer that roves from point to point
/// (one record per point, --force-at). Frequencies, damping ratios and shapes are estimated by
/// maximum likelihood on the spectral lines of the whole records, without windows; the number of
/// modes is chosen automatically. Without --force the record is a free decay, or with --ambient the
/// response to unmeasured forces. Several free decays of one structure, each with its own initial
/// state, have common modes.
///
/// Without any column the file is a table of frequency responses: a universal file (datasets 58),
/// or a table with the columns that `mechid frf --output` writes. A file in JSON is the description
/// of a machine, or a result of `mechid identify --json`.
///
/// --compare compares the modes with another result, or with a finite-element model (datasets 55 of
/// a universal file): it pairs modes by frequency and shape, and divides each difference by its
/// standard error.
///
/// A large machine, up to some 100,000 degrees of freedom in sparse matrices, has too many modes to
/// compute all of them. --modes gives the number of modes to compute: the lowest modes or, with
/// --near-hz, the modes nearest to a frequency.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  mechid modes beam.csv --force hammer --acceleration a1 --band-hz 5:1200
  mechid modes frame.csv --force f1,f2 --acceleration a1,a2,a3,a4 --validate-percent 40
  mechid modes p1.csv p2.csv p3.csv --force f --force-at 1,2,3 --acceleration a --response-at 3 --hits
  mechid modes examples/decay.csv --acceleration a1,a2,a3
  mechid modes pull1.csv pull2.csv --acceleration a1,a2,a3
  mechid modes bridge.csv --acceleration a1,a2,a3 --ambient --band-hz 0.5:20
  mechid modes table.unv --plot modes.html
  mechid modes before.json --compare after.json
  mechid modes frame.csv --force f1,f2 --acceleration a1,a2 --response-at 1+Z,2+Z --compare model.unv
  mechid modes tower.csv --acceleration a1,a2 --ambient --response-at 1+X,2+X --compare model.unv
  mechid modes examples/machine.json --plot modes.svg
  mechid modes found.json --geometry frame.csv --plot modes.html --shapes modes.unv
  mechid modes casing.json --modes 4 --near-hz 50")]
pub struct ModesArgs {
    #[command(flatten)]
    input: RecordArgs,
    /// More records of the same structure, with the same columns and window: all are fitted
    /// together
    #[arg(value_name = "RECORD")]
    more: Vec<PathBuf>,
    #[command(flatten)]
    channels: ChannelArgs,
    /// Point of each force column, such as 3 or 12+Z; for one hammer column in several records, the
    /// struck point of each record
    #[arg(long, value_name = "PLACE,…", value_delimiter = ',')]
    force_at: Vec<String>,
    /// Point of each response column, such as 3 or 12+Z: the entries of shapes are compared at
    /// these points, and the report has modal masses if a force acts at one of them
    #[arg(long, value_name = "PLACE,…", value_delimiter = ',')]
    response_at: Vec<String>,
    /// Frequencies to use, in Hz [default: the band that the forces excite]
    #[arg(long, value_name = "LOW:HIGH")]
    band_hz: Option<Band>,
    /// Number of modes to report: those that explain most of the responses [default: as many as the
    /// record shows; for a machine, all]
    #[arg(long, value_name = "COUNT", value_parser = at_least_one)]
    modes: Option<usize>,
    /// Maximum number of modes
    #[arg(long, value_name = "COUNT", value_parser = at_least_one, conflicts_with = "modes")]
    max_modes: Option<usize>,
    /// Frequencies, in Hz: only the mode nearest to each, within 2 %, is reported, even if it is
    /// weak (not for an ambient record). For a machine with --modes: one frequency; the modes
    /// nearest to it are computed
    #[arg(long, value_name = "HZ,…", value_delimiter = ',', value_parser = positive,
          allow_negative_numbers = true)]
    near_hz: Vec<f64>,
    /// Impose real shapes: damping is proportional, so that all points of a mode move in phase or
    /// in opposite phase. If modes contradict this, the report names them, and real shapes are not
    /// imposed
    #[arg(long)]
    real_shapes: bool,
    /// Impose reciprocity: between two points with force and response, the response is the same in
    /// both directions. If modes contradict this, the report names them, and reciprocity is not
    /// imposed
    #[arg(long)]
    reciprocal: bool,
    /// Make a second fit that excludes this percentage at the end of each record, and predict the
    /// excluded part with this fit
    #[arg(long, value_name = "PERCENT", value_parser = positive, allow_negative_numbers = true)]
    validate_percent: Option<f64>,
    /// Predict this record, with the same columns, from its forces
    #[arg(long, value_name = "RECORD", conflicts_with = "validate_percent")]
    validate: Option<PathBuf>,
    /// Measured quantity of the responses of a table, if the table does not state it
    #[arg(long, value_name = "QUANTITY", value_parser = word::<ResponseQuantity>())]
    quantity: Option<ResponseQuantity>,
    #[command(flatten)]
    hits: HitRuleArgs,
    #[command(flatten)]
    unmeasured: UnmeasuredArgs,
    /// Compare with these modes: a result of `mechid modes --json`, a machine, or a universal file
    /// with datasets 55
    #[arg(long, value_name = "FILE", conflicts_with_all = ["shapes", "geometry", "synthesis"])]
    compare: Option<PathBuf>,
    /// Add the stabilisation diagram and the mode indicator to the JSON
    #[arg(long, help_heading = "Output")]
    diagrams: bool,
    /// Write the frequency responses of the modes into this universal file (datasets 58; SI units)
    #[arg(long, value_name = "FILE.unv", help_heading = "Output")]
    synthesis: Option<PathBuf>,
    #[command(flatten)]
    shapes: ShapeArgs,
    #[command(flatten)]
    plot: PlotArgs,
    #[command(flatten)]
    style: StyleArgs,
    #[command(flatten)]
    about: AboutArgs,
    #[command(flatten)]
    pub limit: TimeLimitArgs,
    #[command(flatten)]
    pub report: ReportArgs,
}

/// Records without measured forces.
#[derive(Debug, Args)]
#[command(next_help_heading = "Records without forces")]
struct UnmeasuredArgs {
    /// Forces act that are not measured, such as wind or traffic
    #[arg(long, conflicts_with_all = ["force", "from", "to", "no_offset"])]
    ambient: bool,
    /// Frequencies of machines nearby, in Hz, whose lines are excluded
    #[arg(long, value_name = "HZ,…", value_delimiter = ',', value_parser = positive,
          requires = "ambient", allow_negative_numbers = true)]
    without_hz: Vec<f64>,
    /// Exclude the lines of the harmonics that are found in the record
    #[arg(long, requires = "ambient")]
    without_harmonics: bool,
    /// Beginning of a free decay, in seconds from the first sample of the window [default:
    /// detected]
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    from: Option<f64>,
    /// End of the part of a free decay that is used, in seconds from the first sample of the window
    /// [default: the end of the window]
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    to: Option<f64>,
    /// Fit a free decay without a constant in each channel
    #[arg(long)]
    no_offset: bool,
}

impl ModesArgs {
    /// Returns the files that the arguments name.
    pub fn files(&self) -> Files<'_> {
        let files = Files::default().reads([&self.input.record]).reads(&self.more);
        let files = files.reads(&self.compare).reads(&self.validate).writes(&self.synthesis);
        let files = files.reads(&self.about.about);
        self.shapes.add_files(files.writes(&self.plot.plot))
    }

    /// Reads the data, identifies the modes, and reports.
    pub fn run(&self, words: &[OsString]) -> Result<Outcome, CliError> {
        if let Some(option) = self.about.given()
            && !self.plot.is_page()
        {
            let why = "needs a page: --plot FILE.html";
            return Err(CliError::MisplacedOption { option, why });
        }
        let mut channels = self.channels.channels();
        let path = &self.input.record;
        if channels.first_response().is_none() {
            if !channels.force.is_empty() {
                return Err(AnalysisError::NoMotion.into());
            }
            let is_json =
                path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("json"));
            if is_json || path == Path::new("-") {
                return match &self.compare {
                    Some(_) => self.compared(&ModeSet::read(path)?, words),
                    None => self.machine_modes(path, words),
                };
            }
            match self.read_tables() {
                Ok(tables) => return self.table_modes(&tables, words),
                Err(error) => {
                    let stated = self.channels_of(path);
                    channels = stated
                        .ok_or_else(|| self.refuse_record_options().err().unwrap_or(error))?;
                }
            }
        }
        self.refuse("a record", &[("quantity", self.quantity.is_some())])?;
        let is_decay = channels.force.is_empty() && !self.unmeasured.ambient;
        // Stated frequencies need the fit of several decays, even for a single decay: only this fit
        // searches near stated frequencies.
        let is_common = !(self.more.is_empty() && self.near_hz.is_empty());
        if is_decay && is_common {
            self.refuse("free decays", &self.decay_refusals())?;
        } else if is_decay {
            return self.decay_modes(&channels, words);
        }
        if self.unmeasured.ambient {
            self.refuse("an ambient record", &[("hits", self.hits.rule().is_some())])?;
        }
        let records = self.open_records(&channels)?;
        let mut modes = mechid::modes(&records, &self.settings(&channels))?;
        if let Some(other) = &self.validate {
            modes.add_validation(&[self.input.open_other(
                other,
                &channels,
                self.input.window(),
            )?])?;
        }
        self.test_outcome(modes, words)
    }

    /// Opens the records with the columns of the first record.
    fn open_records(&self, channels: &Channels) -> Result<Vec<Measurement>, CliError> {
        let mut records = vec![self.input.open(channels)?];
        for record in &self.more {
            let mut channels = channels.clone();
            // All records have the columns of the first one, except for the force column of a
            // roving hammer: if the user names no column, each record states its force column.
            if let Some(Channels { force, .. }) = self.channels_of(record)
                && force.len() == 1
                && channels.force.len() == 1
            {
                channels.force = force;
            }
            records.push(self.input.open_other(record, &channels, self.input.window())?);
        }
        Ok(records)
    }

    /// Identifies the modes of one free decay.
    fn decay_modes(&self, channels: &Channels, words: &[OsString]) -> Result<Outcome, CliError> {
        let mut refused = self.force_options();
        refused.retain(|(name, _)| *name != "response_at");
        self.refuse("a free decay", &refused)?;
        let mut decayed = mechid::decay(&self.input.open(channels)?, &self.decay())?;
        if !self.response_at.is_empty() {
            decayed = decayed.with_points(self.response_at.clone())?;
        }
        let summary = decayed.summary();
        let modes: Vec<ShapedMode> = summary.modes.iter().map(|m| m.mode.clone()).collect();
        let names = summary.points();
        if self.compare.is_some() {
            let set = ModeSet::from_shaped(&summary.file, names, &modes)?;
            return self.compared(&set, words);
        }
        let outcome = Outcome::new(decayed.to_string(), &decayed)?;
        let drawn = (&decayed, decayed.summary());
        self.drawn((outcome, words), drawn, &modes, &names)
    }

    /// Returns the columns of a record: the columns that the user names, or the columns that the
    /// file states to be forces and responses. `None` if there is no response.
    fn channels_of(&self, record: &Path) -> Option<Channels> {
        let mut channels = self.channels.in_file(record, &self.input).ok()?;
        if self.unmeasured.ambient {
            channels.force.clear();
        }
        channels.first_response().is_some().then_some(channels)
    }

    fn read_tables(&self) -> Result<Vec<FrequencyResponses>, CliError> {
        let files = std::iter::once(&self.input.record).chain(&self.more);
        let read = |file: &PathBuf| {
            self.input.read_table(file).map_err(|error| match error {
                IoError::Responses { file, available } => {
                    AnalysisError::NeitherRecordNorTable { file, available }
                }
                other => other.into(),
            })
        };
        Ok(files.map(read).collect::<Result<Vec<_>, _>>()?)
    }

    fn refuse_record_options(&self) -> Result<(), CliError> {
        self.refuse(
            "a table of frequency responses. A file without named columns is read as such a table \
             where possible; name the columns of a record, for example --acceleration a1,a2",
            &self.record_options(),
        )
    }

    fn table_modes(
        &self,
        tables: &[FrequencyResponses],
        words: &[OsString],
    ) -> Result<Outcome, CliError> {
        self.refuse_record_options()?;
        self.input.refuse_units()?;
        self.test_outcome(
            mechid::modes_of_responses(tables, &self.settings(&Channels::default()))?,
            words,
        )
    }

    /// Reports the modes of a test, or compares them.
    fn test_outcome(&self, mut modes: Modes, words: &[OsString]) -> Result<Outcome, CliError> {
        if self.compare.is_some() {
            return self.compared(&ModeSet::from_summary(modes.summary())?, words);
        }
        if self.diagrams {
            modes.add_diagrams()?;
        }
        let (shaped, names) = modes.summary().shapes();
        let outcome = Outcome::new(modes.to_string(), &modes)?;
        let outcome = match (&self.synthesis, modes.synthesis()) {
            (Some(path), Some(responses)) => {
                outcome.with_file(path, responses.to_universal_file()?)
            }
            (Some(_), None) => {
                let why = "without measured forces there are no frequency responses".into();
                return Err(AnalysisError::Setting { setting: "synthesis", why }.into());
            }
            (None, _) => outcome,
        };
        self.drawn((outcome, words), (&modes, modes.summary()), &shaped, &names)
    }

    /// Compares modes with `--compare`, and draws the modal assurance criterion for `--plot`.
    fn compared(&self, first: &ModeSet, words: &[OsString]) -> Result<Outcome, CliError> {
        let second = self.compare.as_ref().map(ModeSet::read).transpose()?;
        let second = second.as_ref().unwrap_or(first);
        let comparison = mechid::compare_modes(first, second)?;
        let outcome = Outcome::new(comparison.to_string(), &comparison)?;
        let Some(path) = &self.plot.plot else { return Ok(outcome) };
        let page = || Ok(comparison_page(&comparison, &self.page_settings(words)?));
        outcome.with_drawing(path, &comparison_svg(&comparison), page)
    }

    /// Returns heading, details and command of the page.
    fn page_settings(&self, words: &[OsString]) -> Result<PageSettings, CliError> {
        Ok(PageSettings {
            title: self.about.title.clone(),
            about: self.about.details(&self.input.record)?,
            ..repeat::settings(words)
        })
    }

    /// Adds the requested pictures and files of shapes.
    fn drawn(
        &self,
        (outcome, words): (Outcome, &[OsString]),
        (result, summary): (&impl ToFigure, &impl Serialize),
        modes: &[ShapedMode],
        names: &[String],
    ) -> Result<Outcome, CliError> {
        let saved = SavedModes::from_result(summary)?;
        // The points of the geometry have the names of the columns, or the names of the measured
        // points.
        let shapes = self.shapes.mode_shapes(modes, names).or_else(|error| {
            self.shapes.mode_shapes(modes, &saved.shapes().1).map_err(|_| error)
        })?;
        let outcome = self.shapes.with_shapes(outcome, shapes.as_ref());
        let style = self.style.style();
        let Some(path) = self.plot.plot.as_ref().filter(|_| self.plot.is_page()) else {
            return outcome.with_plot(&self.plot, words, || Ok(result.styled_figure(style)?));
        };
        let settings = self.page_settings(words)?;
        let figure = result.styled_figure(style)?;
        let page = modes_page(&saved, Some(figure), shapes.as_ref(), &settings)?;
        Ok(outcome.with_file(path, options::spelled(&page)))
    }

    /// Returns an error for the first of the `options` that is given; `what` names the data to
    /// which it does not apply.
    fn refuse(&self, what: &str, options: &[(&'static str, bool)]) -> Result<(), CliError> {
        let Some(&(setting, _)) = options.iter().find(|(_, given)| *given) else { return Ok(()) };
        let why = format!("it does not apply to {what}");
        Err(AnalysisError::Setting { setting, why }.into())
    }

    /// Returns the options of records with forces, and whether each was given.
    fn record_options(&self) -> Vec<(&'static str, bool)> {
        vec![
            ("force_at", !self.force_at.is_empty()),
            ("response_at", !self.response_at.is_empty()),
            ("validate_percent", self.validate_percent.is_some()),
            ("real_shapes", self.real_shapes),
            ("reciprocal", self.reciprocal),
            ("validate", self.validate.is_some()),
            ("hits", self.hits.rule().is_some()),
            ("ambient", self.unmeasured.ambient),
        ]
    }

    /// Returns the options that are refused for several free decays, and whether each was given.
    fn decay_refusals(&self) -> Vec<(&'static str, bool)> {
        let mut options = self.record_options();
        options.retain(|(name, _)| *name != "response_at");
        options.extend([
            ("quantity", self.quantity.is_some()),
            ("synthesis", self.synthesis.is_some()),
            ("no_offset", self.unmeasured.no_offset),
        ]);
        options
    }

    /// Returns the options of tests with forces, and whether each was given.
    fn force_options(&self) -> Vec<(&'static str, bool)> {
        let mut options = self.record_options();
        options.extend([
            ("band_hz", self.band_hz.is_some()),
            ("near_hz", !self.near_hz.is_empty()),
            ("quantity", self.quantity.is_some()),
            ("diagrams", self.diagrams),
            ("synthesis", self.synthesis.is_some()),
        ]);
        options
    }

    fn machine_modes(&self, path: &Path, words: &[OsString]) -> Result<Outcome, CliError> {
        let mut refused = self.force_options();
        refused.retain(|(name, _)| *name != "near_hz");
        refused.push(("further files", !self.more.is_empty()));
        self.refuse("a machine", &refused)?;
        if self.modes.is_none() && !self.near_hz.is_empty() {
            let why = "for a machine, `near_hz` needs `modes`, the number of modes to find".into();
            return Err(AnalysisError::Setting { setting: "near_hz", why }.into());
        }
        if let Some(count) = self.modes {
            self.refuse("some modes of a large machine", &[("plot", self.plot.plot.is_some())])?;
            let machine = read_sparse_system(path)?;
            let near = self.near_hz.first();
            let search = near.map_or(ModeSearch::Lowest, |hz| ModeSearch::NearOmega(TAU * hz));
            let selected = SelectedModes::compute(input_name(path), &machine, search, count)?;
            return Outcome::new(selected.to_string(), &selected);
        }
        let machine = Machine::read(path)?;
        let modes = ModalSummary::from_machine(&machine)?;
        let names = if modes.response_names.is_empty() {
            (1..=modes.degrees_of_freedom).map(|dof| dof.to_string()).collect()
        } else {
            modes.response_names.clone()
        };
        let outcome = Outcome::new(modes.to_string(), &modes)?;
        self.drawn((outcome, words), (&machine, &modes), &modes.modes, &names)
    }

    fn settings(&self, channels: &Channels) -> ModesSettings {
        let UnmeasuredArgs { ambient, without_hz, without_harmonics, from, to, .. } =
            &self.unmeasured;
        let test = if *ambient {
            let (without_hz, without_harmonics) = (without_hz.clone(), *without_harmonics);
            ModalTest::Ambient { without_hz, without_harmonics }
        } else if channels.force.is_empty() && channels.first_response().is_some() {
            ModalTest::Decay { from_s: *from, to_s: *to }
        } else {
            ModalTest::Forced { hits: self.hits.rule() }
        };
        ModesSettings {
            test,
            band_hz: self.band_hz.map(|band| [band.low_hz, band.high_hz]),
            modes: self.modes,
            max_modes: self.max_modes,
            near_hz: self.near_hz.clone(),
            quantity: self.quantity,
            properties: Properties { real_shapes: self.real_shapes, reciprocal: self.reciprocal },
            places: Places { forces: self.force_at.clone(), responses: self.response_at.clone() },
            validate: self.validate_percent.unwrap_or(0.0) / 100.0,
        }
    }

    fn decay(&self) -> DecaySettings {
        let usual = DecaySettings::default();
        DecaySettings {
            from_s: self.unmeasured.from,
            to_s: self.unmeasured.to,
            modes: self.modes,
            max_modes: self.max_modes.unwrap_or(usual.max_modes),
            offset: !self.unmeasured.no_offset,
        }
    }
}
