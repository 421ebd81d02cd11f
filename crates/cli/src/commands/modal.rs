//! `mechid modal`: frequencies, damping ratios and shapes of a machine.

use std::f64::consts::TAU;
use std::path::PathBuf;

use clap::Args;
use mechid::analysis::{Machine, ModalSummary};
use mechid::integrate::ModeSearch;
use mechid::io::{input_name, read_sparse_system};
use mechid::modes::SelectedModes;
use mechid::report::{FigureStyle, ModeShapes, ToFigure, figure_page};

use crate::args::{PlotArgs, ReportArgs, ShapeArgs, StyleArgs, at_least_one, positive};
use crate::error::CliError;
use crate::outcome::{Files, Outcome};

/// Adds what `--plot` asks for: the figure of a result, or a page of it with the shapes of its modes.
pub fn draw(
    outcome: Outcome,
    plot: &PlotArgs,
    shapes: Option<&ModeShapes>,
    result: &impl ToFigure,
    style: FigureStyle,
) -> Result<Outcome, CliError> {
    match &plot.plot {
        Some(path) if plot.is_page() => {
            let figure = result.styled_figure(style)?;
            let title = figure.name().to_owned();
            let page = figure_page(&title, vec![(String::new(), figure)], shapes)?;
            Ok(outcome.with_file(path, page))
        }
        _ => outcome.with_plot(plot, || Ok(result.styled_figure(style)?)),
    }
}

/// Natural frequencies, damping ratios and complex mode shapes of a machine
///
/// The file is the description of a machine, or what `mechid identify --json` printed: then every
/// frequency, ratio and shape comes with the standard error that the uncertainty of mass, damping and
/// stiffness gives it. Shapes are scaled so that their largest entry is 1. The picture shows the
/// receptance of the machine around its natural frequencies: of one or two degrees of freedom for
/// every pair of motion and force, of more where motion and force share their place, up to six of
/// them. Of a machine whose nonlinear terms were identified the frequency of each mode over its
/// amplitude is told and drawn instead, as far as the data reached.
///
/// A large machine, up to some 100,000 degrees of freedom in sparse matrices, has too many modes
/// to find all: --modes takes those of lowest frequency, --near-hz those around a frequency. They
/// have no standard errors and no picture; --json has their shapes. Each is exact to rounding; that
/// none between them was missed is likely, not proved. Instability is told of the modes found, not
/// of others.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  mechid identify rotor.csv --force fx,fy --displacement x,y --json > found.json
  mechid modal found.json
  mechid identify rotor.csv --force fx,fy --displacement x,y --json | mechid modal -
  mechid modal examples/machine.json --plot modes.svg
  mechid modal found.json --geometry frame.csv --plot modes.html --shapes modes.unv
  mechid modal casing.json --modes 10
  mechid modal casing.json --modes 4 --near-hz 50")]
pub struct ModalArgs {
    /// JSON with a `system`: mass, damping and stiffness in kg, N·s/m and N/m (-: on standard input)
    #[arg(value_name = "SYSTEM.json")]
    system: PathBuf,
    /// Find only this many modes, those of the lowest natural frequencies
    #[arg(long, value_name = "COUNT", value_parser = at_least_one, conflicts_with = "plot")]
    modes: Option<usize>,
    /// With --modes: find those nearest to this frequency, in Hz
    #[arg(long, value_name = "HZ", requires = "modes", value_parser = positive,
          allow_negative_numbers = true)]
    near_hz: Option<f64>,
    #[command(flatten)]
    shapes: ShapeArgs,
    #[command(flatten)]
    plot: PlotArgs,
    #[command(flatten)]
    style: StyleArgs,
    #[command(flatten)]
    pub report: ReportArgs,
}

impl ModalArgs {
    /// Returns the files that the arguments name.
    pub fn files(&self) -> Files<'_> {
        self.shapes.add_files(Files::default().reads([&self.system]).writes(&self.plot.plot))
    }

    /// Reads the machine and finds its modes.
    pub fn run(&self) -> Result<Outcome, CliError> {
        if let Some(count) = self.modes {
            let machine = read_sparse_system(&self.system)?;
            let search =
                self.near_hz.map_or(ModeSearch::Lowest, |hz| ModeSearch::NearOmega(TAU * hz));
            let found = SelectedModes::of(input_name(&self.system), &machine, search, count)?;
            return Outcome::new(found.to_string(), &found);
        }
        let machine = Machine::read(&self.system)?;
        let modes = ModalSummary::of(&machine)?;
        let names = match modes.response_names.is_empty() {
            true => (1..=modes.degrees_of_freedom).map(|dof| dof.to_string()).collect(),
            false => modes.response_names.clone(),
        };
        let shapes = self.shapes.of(&modes.modes, &names)?;
        let outcome = Outcome::new(modes.to_string(), &modes)?;
        let outcome = self.shapes.with_shapes(outcome, shapes.as_ref());
        draw(outcome, &self.plot, shapes.as_ref(), &machine, self.style.style())
    }
}
