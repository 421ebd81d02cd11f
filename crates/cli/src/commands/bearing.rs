//! `mechid bearing`: the coefficients of a journal bearing on a test rig.

use std::ffi::OsString;
use std::path::PathBuf;

use clap::Args;
use mechid::analysis::bearing::{BearingPlan, BearingSize, BearingTable, Coefficients};
use mechid::analysis::{IdentifyBearing, Measurement};
use mechid::report::FigureStyle;
use mechid::{BearingData, identify_bearing};

use crate::args::fit::LineArgs;
use crate::args::word::word;
use crate::args::{ChannelArgs, FigureArgs, RecordArgs, ReportArgs, TimeLimitArgs, at_least_one};
use crate::error::CliError;
use crate::outcome::{Files, Outcome};

/// Identify the stiffness, damping and mass coefficients of a journal bearing from rig tests
///
/// The housing floats on the film of a rotating shaft in rigid supports; shakers in x and y excite
/// it in two separate tests, or in one test on alternate spectral lines. --force names the forces
/// of the shakers, --acceleration the accelerations of the housing, --displacement the motion of
/// the housing relative to the shaft, x before y. The window must hold whole periods; lines at
/// multiples of --rotation-hz are excluded. Baseline tests (no film, shaft at rest) are subtracted
/// with their uncertainty.
///
/// With --frf-table the files are frequency responses instead, two for each test: first the
/// displacement, then the acceleration per shaker force.
///
/// With --campaign the file is a JSON description of tests at several speeds and loads. It has a
/// list `points`; each point has `tests`, `baseline`, `rotation_hz` and `load`. Common to all
/// points are `channels`, `window` (or `frf_table`) and `settings`, as --json prints them.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  mechid bearing x.csv y.csv --force fx,fy --acceleration ax,ay --displacement dx,dy \\
      --stator-mass 20 --rotation-hz 50 --period 1024 --plot stiffness.svg
  mechid bearing x.csv y.csv --baseline dry-x.csv --baseline dry-y.csv --force fx,fy \\
      --acceleration ax,ay --displacement dx,dy --stator-mass 20 --rotation-hz 50 --load 2500 \\
      --clearance 100e-6 --period 1024 --output coefficients.csv
  mechid bearing d.unv a.unv --frf-table --averages 32 --stator-mass 20 --rotation-hz 50
  mechid bearing campaign.json --campaign --output coefficients.csv --plot speeds.svg")]
pub struct BearingArgs {
    #[command(flatten)]
    input: RecordArgs,
    /// Further records of the same speed and load, with the same columns and window
    #[arg(value_name = "RECORD")]
    more: Vec<PathBuf>,
    /// Baseline record, with the same columns and window; repeat the option for further records
    #[arg(long, value_name = "RECORD")]
    baseline: Vec<PathBuf>,
    /// The file describes tests at several speeds and loads
    #[arg(long, conflicts_with_all = ["more", "baseline", "force", "displacement", "acceleration",
          "velocity", "stator_mass", "rotation_hz", "load", "period", "sample_rate", "time",
          "detrend", "lines", "without_lines", "without_hz", "band_hz", "clearance", "diameter", "length", "viscosity", "frf_table"])]
    campaign: bool,
    #[command(flatten)]
    channels: ChannelArgs,
    /// Mass of the housing and all parts that move with it, in kg
    #[arg(long, value_name = "KG", required_unless_present = "campaign")]
    stator_mass: Option<f64>,
    /// Speed of rotation, in Hz; the lines at this frequency and its multiples are excluded
    /// [default: the shaft is at rest]
    #[arg(long, value_name = "HZ")]
    rotation_hz: Option<f64>,
    /// Static load, in N, for dimensionless coefficients
    #[arg(long, value_name = "N")]
    load: Option<f64>,
    /// Coefficients to identify: eight (stiffness and damping), twelve (also the added mass of the
    /// fluid), or automatic (twelve if a likelihood-ratio test at 5 % finds inertia, otherwise
    /// eight)
    #[arg(long, value_name = "WHICH", value_parser = word::<Coefficients>(), default_value = "automatic")]
    coefficients: Coefficients,
    #[command(flatten)]
    lines: LineArgs,
    #[command(flatten)]
    size: SizeArgs,
    #[command(flatten)]
    tables: TableArgs,
    /// Write the coefficients into this file (-: to standard output): speed in rad/s, load, kxx …
    /// myy, and their standard errors, one row per speed and load
    #[arg(long, value_name = "FILE.csv", help_heading = "Output")]
    output: Option<PathBuf>,
    /// Write the coefficients into this file (-: to standard output) in the axes of ROSS, whose
    /// load acts along −y: speed in rad/s, kxx … myy, one row per speed and load
    #[arg(long, value_name = "FILE.csv", help_heading = "Output")]
    ross: Option<PathBuf>,
    #[command(flatten)]
    page: FigureArgs,
    #[command(flatten)]
    pub limit: TimeLimitArgs,
    #[command(flatten)]
    pub report: ReportArgs,
}

/// Frequency responses that were measured elsewhere.
#[derive(Debug, Args)]
#[command(next_help_heading = "Tables of frequency responses")]
struct TableArgs {
    /// The files are tables of frequency responses, alternately of displacement and of
    /// acceleration: text with columns h_1_1_real, h_1_1_imaginary … as `mechid frf --output`
    /// writes it, or universal files (datasets 58 of types 4 and 6)
    #[arg(long, conflicts_with_all = ["force", "displacement", "acceleration", "velocity",
          "sample_rate", "time", "period", "detrend", "lines", "without_lines"])]
    frf_table: bool,
    /// Number of independent averages of the coherence, for the standard errors; not needed if the
    /// tables have standard errors
    #[arg(long, value_name = "COUNT", value_parser = at_least_one, requires = "frf_table")]
    averages: Option<usize>,
    /// The two points to use, by their names in the tables: the point in direction x, then that in
    /// direction y [default: all]
    #[arg(long, value_name = "POINT,…", value_delimiter = ',', requires = "frf_table")]
    points: Vec<String>,
}

/// Size of the bearing.
#[derive(Debug, Args)]
#[command(next_help_heading = "Size")]
struct SizeArgs {
    /// Radial clearance, in m
    #[arg(long, value_name = "METRES")]
    clearance: Option<f64>,
    /// Diameter of the journal, in m, for the Sommerfeld number
    #[arg(long, value_name = "METRES")]
    diameter: Option<f64>,
    /// Length of the bearing, in m, for the Sommerfeld number
    #[arg(long, value_name = "METRES")]
    length: Option<f64>,
    /// Dynamic viscosity of the oil, in Pa·s, for the Sommerfeld number
    #[arg(long, value_name = "PA·S")]
    viscosity: Option<f64>,
}

impl BearingArgs {
    /// Returns the files that the arguments name.
    pub fn files(&self) -> Files<'_> {
        let outputs = [&self.output, &self.ross].into_iter().flatten();
        let inputs = [&self.input.record].into_iter().chain(&self.more).chain(&self.baseline);
        self.page.add_files(Files::default().reads(inputs).writes(outputs))
    }

    /// Reads, identifies, and reports.
    pub fn run(&self, words: &[OsString]) -> Result<Outcome, CliError> {
        if self.campaign {
            let plan: BearingPlan = mechid::io::read_json(&self.input.record)?;
            let speeds = plan.run()?;
            let outcome = Outcome::new(speeds.to_string(), &speeds)?.with_result_page(
                &self.page,
                (&self.input.record, words),
                &speeds,
                FigureStyle::default(),
            )?;
            return Ok(self.with_table(outcome, &speeds));
        }
        let how = self.settings();
        let channels = self.channels.channels();
        if !self.tables.frf_table {
            channels.check_pairs()?;
        }
        let data = |paths: &mut dyn Iterator<Item = &PathBuf>| -> Result<BearingData, CliError> {
            if self.tables.frf_table {
                self.input.refuse_units()?;
                let read = |path: &PathBuf| self.input.read_table(path);
                let tables = paths.map(read).collect::<Result<Vec<_>, _>>()?;
                return Ok(BearingData::from_responses(&tables, &how)?);
            }
            let open = |path: &PathBuf| self.input.open_other(path, &channels, self.input.window());
            let tests: Vec<Measurement> = paths.map(open).collect::<Result<_, _>>()?;
            Ok(BearingData::from_records(&tests, &how)?)
        };
        let tests = data(&mut [&self.input.record].into_iter().chain(&self.more))?;
        let baseline =
            if self.baseline.is_empty() { None } else { Some(data(&mut self.baseline.iter())?) };
        let identified = identify_bearing(&tests, baseline.as_ref(), &how)?;
        let outcome = Outcome::new(identified.to_string(), &identified)?.with_result_page(
            &self.page,
            (&self.input.record, words),
            &identified,
            FigureStyle::default(),
        )?;
        Ok(self.with_table(outcome, &BearingTable::new([identified])))
    }

    fn settings(&self) -> IdentifyBearing {
        let SizeArgs { clearance, diameter, length, viscosity } = self.size;
        IdentifyBearing {
            stator_mass: self.stator_mass.unwrap_or_default(),
            rotation_hz: self.rotation_hz,
            load: self.load,
            size: BearingSize { clearance, diameter, length, viscosity },
            coefficients: self.coefficients,
            lines: self.lines.choice(),
            without: self.lines.without(),
            averages: self.tables.averages.map(|count| count as f64),
            points: self.tables.points.clone(),
        }
    }

    fn with_table(&self, outcome: Outcome, table: &BearingTable) -> Outcome {
        let outcome = match &self.output {
            Some(path) => outcome.with_file(path, table.csv()),
            None => outcome,
        };
        match &self.ross {
            Some(path) => outcome.with_file(path, table.ross_csv()),
            None => outcome,
        }
    }
}
