//! `mechid decay`: frequencies, damping ratios and shapes from a record without force.

use clap::Args;
use mechid::DecaySettings;
use mechid::analysis::modal::ShapedMode;

use super::modal::draw;
use crate::args::{
    PlotArgs, RecordArgs, ReportArgs, ResponseArgs, ShapeArgs, StyleArgs, at_least_one,
};
use crate::error::CliError;
use crate::outcome::{Files, Outcome};

/// Find the modes in a free response, without a force
///
/// For a structure that was plucked or struck, or whose shaker was switched off. Frequencies, damping
/// ratios and shapes are those of maximum likelihood; each channel has noise of its own level and
/// colour. The number of modes is found, too. The decay begins with the last sample at which the sum
/// of the squares of all channels, each over its own power, is at least 80 % of the largest; say
/// --from where a force acts longer.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  mechid decay examples/decay.csv --acceleration a1,a2,a3
  mechid decay bridge.csv --acceleration 2,3,4 --sample-rate 200 --from 12.5 --to 40
  mechid decay pluck.csv --displacement x --modes 2 --plot decay.svg --json")]
pub struct DecayArgs {
    #[command(flatten)]
    input: RecordArgs,
    #[command(flatten)]
    responses: ResponseArgs,
    /// Beginning of the decay, in seconds from the first sample of the window [default: found]
    #[arg(
        long,
        value_name = "SECONDS",
        allow_negative_numbers = true,
        help_heading = "Time and window"
    )]
    from: Option<f64>,
    /// End of what is used, in seconds from the first sample of the window [default: its end]
    #[arg(
        long,
        value_name = "SECONDS",
        allow_negative_numbers = true,
        help_heading = "Time and window"
    )]
    to: Option<f64>,
    /// Number of modes [default: as many as the record shows]
    #[arg(long, value_name = "COUNT", value_parser = at_least_one)]
    modes: Option<usize>,
    /// Largest number of modes to look for
    #[arg(long, value_name = "COUNT", default_value_t = DecaySettings::default().max_modes,
          value_parser = at_least_one, conflicts_with = "modes")]
    max_modes: usize,
    /// The channels have no constant
    #[arg(long)]
    no_offset: bool,
    #[command(flatten)]
    shapes: ShapeArgs,
    #[command(flatten)]
    plot: PlotArgs,
    #[command(flatten)]
    style: StyleArgs,
    #[command(flatten)]
    pub report: ReportArgs,
}

impl DecayArgs {
    /// Returns the files that the arguments name.
    pub fn files(&self) -> Files<'_> {
        let files = Files::default().reads([&self.input.record]).writes(&self.plot.plot);
        self.shapes.add_files(files)
    }

    /// Reads, fits, and reports.
    pub fn run(&self) -> Result<Outcome, CliError> {
        let how = DecaySettings {
            from_s: self.from,
            to_s: self.to,
            modes: self.modes,
            max_modes: self.max_modes,
            offset: !self.no_offset,
        };
        let found = mechid::decay(&self.input.open(&self.responses.channels())?, &how)?;
        let summary = found.summary();
        let modes: Vec<ShapedMode> = summary.modes.iter().map(|row| row.mode.clone()).collect();
        let names: Vec<String> = summary.channels.iter().map(|row| row.column.clone()).collect();
        let shapes = self.shapes.of(&modes, &names)?;
        let outcome = Outcome::new(found.to_string(), &found)?;
        let outcome = self.shapes.with_shapes(outcome, shapes.as_ref());
        draw(outcome, &self.plot, shapes.as_ref(), &found, self.style.style())
    }
}
