//! `mechid stability`: effect of the time step on a free motion, scheme by scheme.

use std::ffi::OsString;
use std::path::PathBuf;

use clap::Args;
use mechid::analysis::text::compact;
use mechid::integrate::{
    Bathe, CentralDifference, GeneralisedAlpha, Houbolt, MatrixExponential, Newmark, RungeKutta4,
    Scheme, System, WilsonTheta,
};
use mechid::io::Experiment;
use mechid::{NamedScheme, SimulatedSystem, SteppedMachine, compare_schemes, stability_figure};

use crate::args::{PlotArgs, ReportArgs};
use crate::error::CliError;
use crate::outcome::{Files, Outcome};

/// Show stability and accuracy of the time-stepping schemes
///
/// The tables have, for a free oscillation of period T and the step Δt, the spectral radius (above
/// 1 the motion grows without end), the relative elongation of the period, and the share of the
/// amplitude lost per period. All values are computed by the code of the schemes. The options of a
/// scheme for load and start have no effect on a free motion.
///
/// With the description of an experiment (see mechid simulate) the report also has the largest
/// stable step of each scheme for that machine.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  mechid stability --plot charts.svg\n  \
                  mechid stability --damping 0.05 --step 0.05,0.1,0.2 --theta 2\n  \
                  mechid stability machine.json")]
pub struct StabilityArgs {
    /// Description of an experiment; the largest stable steps are those for its machine
    #[arg(value_name = "SYSTEM.json")]
    experiment: Option<PathBuf>,
    /// Damping ratio of the oscillation, at least 0 and less than 1
    #[arg(long, value_name = "RATIO", default_value_t = 0.0, allow_negative_numbers = true)]
    damping: f64,
    /// Steps Δt/T of the tables, as fractions of the undamped period
    #[arg(
        long,
        value_name = "STEPS",
        value_delimiter = ',',
        default_value = "0.01,0.02,0.05,0.1,0.15,0.2,0.3,0.5,1,10"
    )]
    step: Vec<f64>,
    /// β of Newmark's scheme
    #[arg(long, default_value_t = 0.25, allow_negative_numbers = true, help_heading = "Schemes")]
    beta: f64,
    /// γ of Newmark's scheme
    #[arg(long, default_value_t = 0.5, allow_negative_numbers = true, help_heading = "Schemes")]
    gamma: f64,
    /// θ of Wilson's scheme
    #[arg(long, default_value_t = 1.4, allow_negative_numbers = true, help_heading = "Schemes")]
    theta: f64,
    /// ρ∞ of the generalised-α schemes and of ρ∞-Bathe, the spectral radius at very large steps;
    /// HHT-α is shown only if ρ∞ is at least 0.5
    #[arg(
        long = "rho-infinity",
        value_name = "RADIUS",
        default_value_t = 0.8,
        allow_negative_numbers = true,
        help_heading = "Schemes"
    )]
    rho_infinity: f64,
    #[command(flatten)]
    plot: PlotArgs,
    #[command(flatten)]
    pub report: ReportArgs,
}

impl StabilityArgs {
    /// Returns the files that the arguments name.
    pub fn files(&self) -> Files<'_> {
        Files::default().reads(&self.experiment).writes(&self.plot.plot)
    }

    /// Compares the schemes.
    pub fn run(&self, words: &[OsString]) -> Result<Outcome, CliError> {
        let mut schemes = self.schemes()?;
        let machine = match &self.experiment {
            None => None,
            Some(file) => {
                let experiment = Experiment::read(file)?;
                let system = match experiment.sparse_system() {
                    Some(sparse) => SimulatedSystem::Sparse(sparse.clone()),
                    None => SimulatedSystem::Dense(experiment.system()?),
                };
                Some((system, experiment.force()?.sampling().dt()))
            }
        };
        let machine = machine
            .as_ref()
            .map(|(system, dt)| SteppedMachine { system: system.matrices(), dt: *dt });
        let dof = machine.map_or(1, |machine| System::dof(&machine.system));
        if dof <= MatrixExponential::MOST_DOF {
            let (label, scheme) = ("matrix exponential".into(), MatrixExponential::LINEAR);
            schemes.push(NamedScheme { label, scheme: Box::new(scheme) });
        }
        let compared = compare_schemes(&schemes, self.damping, &self.step, machine)?;
        Outcome::new(compared.to_string(), &compared)?
            .with_plot(&self.plot, words, || Ok(stability_figure(&schemes, self.damping)?))
    }

    fn schemes(&self) -> Result<Vec<NamedScheme>, CliError> {
        let newmark = Newmark::new(self.beta, self.gamma)?;
        let wilson = WilsonTheta::new(self.theta)?;
        let rho = self.rho_infinity;
        let (alpha, wbz) =
            (GeneralisedAlpha::new(rho)?, GeneralisedAlpha::wood_bossak_zienkiewicz(rho)?);
        let of_newmark = if newmark == Newmark::AVERAGE_ACCELERATION {
            "Newmark".into()
        } else {
            format!("Newmark {} {}", compact(self.beta, 4), compact(self.gamma, 4))
        };
        let of_wilson = format!("Wilson θ = {}", compact(self.theta, 6));
        let with_radius = |name: &str| format!("{name} {}", compact(rho, 6));
        let hht = GeneralisedAlpha::hilber_hughes_taylor(rho);
        let hht = hht.map(|hht| (with_radius("HHT-α"), Box::new(hht) as Box<dyn Scheme>));
        let schemes: Vec<(String, Box<dyn Scheme>)> = vec![
            (of_newmark, Box::new(newmark)),
            ("linear acceleration".into(), Box::new(Newmark::LINEAR_ACCELERATION)),
            ("central difference".into(), Box::new(CentralDifference::default())),
            ("Houbolt".into(), Box::new(Houbolt::default())),
            (of_wilson, Box::new(wilson)),
            (with_radius("generalised-α"), Box::new(alpha)),
            ("Bathe".into(), Box::new(Bathe::HALVES)),
            ("Runge–Kutta 4".into(), Box::new(RungeKutta4::LINEAR)),
        ];
        let variants: [(String, Box<dyn Scheme>); 2] = [
            (with_radius("WBZ-α"), Box::new(wbz)),
            (with_radius("ρ∞-Bathe"), Box::new(Bathe::new(rho)?)),
        ];
        let schemes = schemes.into_iter().chain(hht).chain(variants);
        Ok(schemes.map(|(label, scheme)| NamedScheme { label, scheme }).collect())
    }
}
