//! `mechid modal`: frequencies, damping ratios and shapes of a machine.

mod picture;

use std::path::PathBuf;

use clap::Args;
use mechid::estimate::{IdentifiedMode, Unknowns, identified_modes};
use mechid::io::{ParameterCovariance, SystemMatrices, read_covariance, read_system};
use mechid::model::{Parameter, SecondOrderSystem, UncertainSystem};
use serde::Serialize;

use super::identify::report::{CONFIDENCE, Uncertain};
use crate::error::CliError;
use crate::options::{PlotArgs, ReportArgs};
use crate::outcome::Outcome;
use crate::text_table::{compact, significant, text_table};

/// Natural frequencies, damping ratios and complex mode shapes of a machine
///
/// The file is the description of a machine, or what `mechid identify --json` printed: then every
/// frequency, ratio and shape comes with the standard error that the uncertainty of mass, damping and
/// stiffness gives it. Shapes are scaled so that their largest entry is 1. The picture shows the
/// receptance of the machine around its natural frequencies: of one or two degrees of freedom for
/// every pair of motion and force, of more where motion and force share their place, up to six of
/// them.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  mechid identify rotor.csv --force fx,fy --displacement x,y --json > found.json
  mechid modal found.json
  mechid identify rotor.csv --force fx,fy --displacement x,y --json | mechid modal -
  mechid modal examples/machine.json --plot modes.svg")]
pub struct ModalArgs {
    /// JSON with a `system`: mass, damping and stiffness in kg, N·s/m and N/m (-: on standard input)
    #[arg(value_name = "SYSTEM.json")]
    system: PathBuf,
    #[command(flatten)]
    plot: PlotArgs,
    #[command(flatten)]
    pub report: ReportArgs,
}

#[derive(Debug, Serialize)]
struct Report {
    file: String,
    degrees_of_freedom: usize,
    confidence: f64,
    modes: Vec<ModeRow>,
    system: SystemMatrices,
}

#[derive(Debug, Serialize)]
struct ModeRow {
    oscillates: bool,
    /// Real and imaginary part, in rad/s.
    eigenvalue: [f64; 2],
    damped_frequency_hz: Uncertain,
    natural_frequency_hz: Uncertain,
    damping_ratio: Uncertain,
    shape: Vec<ShapeEntry>,
}

/// One entry of a mode shape: real and imaginary part.
#[derive(Debug, Serialize)]
struct ShapeEntry {
    value: [f64; 2],
    /// Nothing for a machine that is known.
    standard_error: Option<[f64; 2]>,
}

impl ModalArgs {
    /// Reads the machine and finds its modes.
    pub fn run(&self) -> Result<Outcome, CliError> {
        let system = read_system(&self.system)?;
        let file = mechid::io::input_name(&self.system);
        let covariance = read_covariance(&self.system)?;
        let modes = match &covariance {
            Some(covariance) => {
                let parameters = parameters(&file, &system, covariance)?;
                let of = covariance.degrees_of_freedom;
                let matrix = covariance.matrix();
                let machine = UncertainSystem::new(system.clone(), parameters, matrix)?;
                identified_modes(&machine, of)?
            }
            None => identified_modes(&UncertainSystem::exact(system.clone()), 0)?,
        };
        let known = covariance.is_none();
        let rows = modes.iter().map(|mode| ModeRow::of(mode, known));
        let report = Report {
            file,
            degrees_of_freedom: system.dof(),
            confidence: CONFIDENCE,
            modes: rows.collect::<Result<_, _>>()?,
            system: SystemMatrices::from(&system),
        };
        Outcome::new(report.text(), &report)?.with_plot(&self.plot, || {
            let of = |found: &IdentifiedMode| {
                (found.natural_frequency_hz.value, found.damping_ratio.value)
            };
            let resonances: Vec<_> = modes.iter().map(of).collect();
            picture::figure(&report.file, &system, &resonances)
        })
    }
}

/// The parameters of the machine that a covariance names.
pub fn parameters(
    file: &str,
    system: &SecondOrderSystem,
    covariance: &ParameterCovariance,
) -> Result<Vec<Parameter>, CliError> {
    let all = Unknowns::unknown_mass(system.dof())?.free();
    let find = |name: &String| {
        all.iter().find(|p| p.to_string() == *name).copied().ok_or_else(|| {
            let names: Vec<String> = all.iter().map(Parameter::to_string).collect();
            CliError::UnknownParameter {
                file: file.into(),
                name: name.clone(),
                known: names.join(", "),
            }
        })
    };
    covariance.parameters.iter().map(find).collect()
}

impl ModeRow {
    fn of(found: &IdentifiedMode, known: bool) -> Result<Self, CliError> {
        let uncertain = |value: &mechid::estimate::Uncertain| match known {
            true => Ok(Uncertain::known(value.value)),
            false => Uncertain::of(value),
        };
        let eigenvalue = found.mode.eigenvalue();
        let entries = found.mode.shape().iter().zip(found.shape_standard_error.iter());
        Ok(Self {
            oscillates: found.mode.oscillates(),
            eigenvalue: [eigenvalue.re, eigenvalue.im],
            damped_frequency_hz: uncertain(&found.damped_frequency_hz)?,
            natural_frequency_hz: uncertain(&found.natural_frequency_hz)?,
            damping_ratio: uncertain(&found.damping_ratio)?,
            shape: entries
                .map(|(value, error)| ShapeEntry {
                    value: [value.re, value.im],
                    standard_error: (!known).then_some([error.re, error.im]),
                })
                .collect(),
        })
    }
}

impl Report {
    fn text(&self) -> String {
        let (dof, modes) = (self.degrees_of_freedom, self.modes.len());
        let plural = |count: usize| if count == 1 { "" } else { "s" };
        let freedom = if dof == 1 { "degree" } else { "degrees" };
        format!(
            "{}: {dof} {freedom} of freedom, {modes} mode{}\n\n{}\n{}",
            self.file,
            plural(modes),
            self.mode_table(),
            self.shape_table()
        )
    }

    fn mode_table(&self) -> String {
        let interval = format!("{} % interval", compact(100.0 * self.confidence, 3));
        let header = ["mode", "value", "standard error", &interval, "unit"];
        let mut rows = vec![header.map(String::from).to_vec()];
        for (number, mode) in (1..).zip(&self.modes) {
            for (name, value, unit) in [
                ("natural frequency", &mode.natural_frequency_hz, "Hz"),
                ("damped frequency", &mode.damped_frequency_hz, "Hz"),
                ("damping ratio", &mode.damping_ratio, "–"),
            ] {
                // A mode that does not oscillate has no damped frequency to speak of.
                if mode.oscillates || !name.starts_with("damped") {
                    let mut row = vec![format!("{number} {name}")];
                    row.extend(value.cells());
                    row.push(unit.into());
                    rows.push(row);
                }
            }
        }
        text_table(&rows)
    }

    fn shape_table(&self) -> String {
        let header = ["shape", "modulus", "phase, °", "real part", "±", "imaginary part", "±"];
        let mut rows = vec![header.map(String::from).to_vec()];
        for (number, mode) in (1..).zip(&self.modes) {
            for (dof, entry) in (1..).zip(&mode.shape) {
                let [re, im] = entry.value;
                let error = |part: usize| {
                    entry.standard_error.map_or("–".into(), |e| significant(e[part], 2))
                };
                rows.push(vec![
                    format!("{number} direction {dof}"),
                    significant(re.hypot(im), 5),
                    format!("{:.1}", im.atan2(re).to_degrees()),
                    format!("{re:.5}"),
                    error(0),
                    format!("{im:.5}"),
                    error(1),
                ]);
            }
        }
        text_table(&rows)
    }
}
