//! `mechid stability`: what a time step does to a free motion, scheme by scheme.

use std::f64::consts::TAU;
use std::path::PathBuf;

use clap::Args;
use mechid::integrate::{
    Accuracy, Bathe, CentralDifference, GeneralisedAlpha, Houbolt, Newmark, RungeKutta4, Scheme,
    WilsonTheta, accuracy, critical_step, spectral_radius,
};
use mechid::io::Experiment;
use mechid::model::{Sdof, SecondOrderSystem};
use mechid::plot::{Axis, Curve, Figure, Panel, Reference};
use serde::Serialize;

use crate::args::{PlotArgs, ReportArgs};
use crate::error::CliError;
use crate::outcome::{Files, Outcome};
use mechid::analysis::text::{compact, paged_table, significant};

/// Show stability and accuracy of the time-stepping schemes
///
/// For a free oscillation of period T stepped by Δt: the spectral radius (above 1 the motion grows
/// without end), how much longer than T the numerical period is, and which share of its amplitude
/// it loses per period. All of it is read off the stepping code itself. The conventions of a scheme
/// on load and start do not matter to a free motion.
///
/// With the description of an experiment (see mechid simulate) also the largest stable step of each
/// scheme for that machine.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  mechid stability --plot charts.svg\n  \
                  mechid stability --damping 0.05 --step 0.05,0.1,0.2 --theta 2\n  \
                  mechid stability machine.json")]
pub struct StabilityArgs {
    /// A machine to find the largest stable steps for: the description of an experiment
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
    /// ρ∞ of the generalised-α scheme, its spectral radius at very large steps
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

/// A scheme under the name it has in tables and figures.
type Named = (String, Box<dyn Scheme>);

/// A quantity of a chart, where there is one.
type Quantity<T> = fn(&T) -> Option<f64>;

#[derive(Debug, Serialize)]
struct Report {
    damping_ratio: f64,
    schemes: Vec<SchemeReport>,
}

#[derive(Debug, Serialize)]
struct SchemeReport {
    #[serde(skip)]
    column: String,
    name: String,
    /// Largest stable Δt/T; null if every step is stable.
    stability_limit: Option<f64>,
    chart: Vec<Point>,
    #[serde(skip_serializing_if = "Option::is_none")]
    machine: Option<MachineReport>,
}

/// [`Accuracy`] for programs; null where the numerical motion does not oscillate.
#[derive(Debug, Serialize)]
struct Point {
    step_over_period: f64,
    spectral_radius: f64,
    period_elongation: Option<f64>,
    amplitude_decay: Option<f64>,
    numerical_damping_ratio: Option<f64>,
}

#[derive(Debug, Serialize)]
struct MachineReport {
    /// Largest stable step; null if every step is stable.
    critical_step_s: Option<f64>,
    /// The step of the experiment.
    step_s: f64,
    spectral_radius: f64,
}

impl StabilityArgs {
    /// Returns the files that the arguments name.
    pub fn files(&self) -> Files<'_> {
        Files::default().reads(&self.experiment).writes(&self.plot.plot)
    }

    /// Analyses every scheme.
    pub fn run(&self) -> Result<Outcome, CliError> {
        let schemes = self.schemes()?;
        let machine = match &self.experiment {
            None => None,
            Some(file) => {
                let experiment = Experiment::read(file)?;
                Some((experiment.system()?, experiment.force()?.sampling().dt()))
            }
        };
        let oscillator = Sdof::from_modal(1.0, self.damping, 1.0)?.system();
        let mut found = Vec::new();
        for (column, scheme) in &schemes {
            let scheme = scheme.as_ref();
            let points = self.step.iter().map(|step| accuracy(scheme, self.damping, *step));
            found.push(SchemeReport {
                column: column.clone(),
                name: scheme.name(),
                chart: points.map(|p| p.map(Point::from)).collect::<Result<_, _>>()?,
                stability_limit: critical_step(scheme, &oscillator)?.map(|dt| dt / TAU),
                machine: match &machine {
                    None => None,
                    Some((system, dt)) => Some(MachineReport::of(scheme, system, *dt)?),
                },
            });
        }
        let report = Report { damping_ratio: self.damping, schemes: found };
        Outcome::new(report.text(), &report)?.with_plot(&self.plot, || self.figure(&schemes))
    }

    fn schemes(&self) -> Result<Vec<Named>, CliError> {
        let newmark = Newmark::new(self.beta, self.gamma)?;
        let column = if newmark == Newmark::AVERAGE_ACCELERATION {
            "Newmark".into()
        } else {
            format!("Newmark {} {}", compact(self.beta, 4), compact(self.gamma, 4))
        };
        Ok(vec![
            (column, Box::new(newmark)),
            ("linear acceleration".into(), Box::new(Newmark::LINEAR_ACCELERATION)),
            ("central difference".into(), Box::new(CentralDifference::default())),
            ("Houbolt".into(), Box::new(Houbolt::default())),
            (
                format!("Wilson θ = {}", compact(self.theta, 6)),
                Box::new(WilsonTheta::new(self.theta)?),
            ),
            (
                format!("generalised-α {}", compact(self.rho_infinity, 6)),
                Box::new(GeneralisedAlpha::new(self.rho_infinity)?),
            ),
            ("Bathe".into(), Box::new(Bathe::HALVES)),
            ("Runge–Kutta 4".into(), Box::new(RungeKutta4::LINEAR)),
        ])
    }

    /// Spectral radius above period elongation and amplitude decay.
    fn figure(&self, schemes: &[Named]) -> Result<Figure, CliError> {
        let log = |k: i32| 10f64.powf(-2.0 + 3.0 * f64::from(k) / 300.0);
        let wide: Vec<f64> = (0..=300).map(log).collect();
        let narrow: Vec<f64> = (1..=160).map(|k| 0.0025 * f64::from(k)).collect();
        let step = "Step over natural period Δt/T";
        let mut panels = [
            // An unstable scheme leaves through the roof; what happens below 1 is what is compared.
            Panel::new(
                Axis::log10(step, ""),
                Axis::linear("Spectral radius ρ", "").range(0.0, 1.6),
            )
            .reference(Reference::horizontal("limit of stability", 1.0)),
            Panel::new(
                Axis::linear(step, "").range(0.0, 0.4),
                Axis::linear("Period elongation", "%").range(-20.0, 60.0),
            ),
            Panel::new(
                Axis::linear(step, "").range(0.0, 0.4),
                Axis::linear("Amplitude decay per period", "%").range(-10.0, 80.0),
            ),
        ];
        for (slot, (name, scheme)) in schemes.iter().enumerate() {
            let analyse = |steps: &[f64]| -> Result<Vec<Accuracy>, CliError> {
                let all = steps.iter().map(|s| accuracy(scheme.as_ref(), self.damping, *s));
                Ok(all.collect::<Result<_, _>>()?)
            };
            let (far, mut near) = (analyse(&wide)?, analyse(&narrow)?);
            near.retain(|a| a.spectral_radius <= 1.0 + 1e-9);
            let quantities: [(&[Accuracy], Quantity<Accuracy>); 3] = [
                (&far, |a| Some(a.spectral_radius).filter(|r| *r < 2.0)),
                (&near, |a| a.period_elongation.map(|e| 100.0 * e)),
                (&near, |a| a.amplitude_decay.map(|d| 100.0 * d)),
            ];
            for (panel, (points, value)) in panels.iter_mut().zip(quantities) {
                let drawn = points.iter().filter_map(|a| Some((a.step_over_period, value(a)?)));
                let (x, y): (Vec<f64>, Vec<f64>) = drawn.unzip();
                if !x.is_empty() {
                    *panel = panel.clone().curve(Curve::line(name, &x, &y).slot(slot));
                }
            }
        }
        let title = match self.damping {
            0.0 => "Time-stepping schemes on an undamped oscillation".to_owned(),
            zeta => format!("Time-stepping schemes on an oscillation of damping ratio {zeta}"),
        };
        Ok(panels.into_iter().fold(Figure::new(title), Figure::panel).shared_legend())
    }
}

impl From<Accuracy> for Point {
    fn from(found: Accuracy) -> Self {
        Self {
            step_over_period: found.step_over_period,
            spectral_radius: found.spectral_radius,
            period_elongation: found.period_elongation,
            amplitude_decay: found.amplitude_decay,
            numerical_damping_ratio: found.numerical_damping_ratio,
        }
    }
}

impl Point {
    /// `value`, unless the motion grows.
    fn stable(&self, value: Option<f64>) -> Option<f64> {
        value.filter(|_| self.spectral_radius <= 1.0 + 1e-9)
    }
}

impl MachineReport {
    fn of(scheme: &dyn Scheme, system: &SecondOrderSystem, dt: f64) -> Result<Self, CliError> {
        Ok(Self {
            critical_step_s: critical_step(scheme, system)?,
            step_s: dt,
            spectral_radius: spectral_radius(scheme, system, dt)?,
        })
    }
}

impl Report {
    fn text(&self) -> String {
        let mut text = String::new();
        let tables: [(&str, Quantity<Point>); 4] = [
            ("Spectral radius", |p| Some(p.spectral_radius)),
            ("Period elongation (%)", |p| p.stable(p.period_elongation).map(|e| 100.0 * e)),
            ("Amplitude decay per period (%)", |p| p.stable(p.amplitude_decay).map(|d| 100.0 * d)),
            ("Numerical damping ratio", |p| p.stable(p.numerical_damping_ratio)),
        ];
        text += "– where the motion grows or does not oscillate\n\n";
        for (title, value) in tables {
            text += &format!("{title}\n{}\n", self.table(value));
        }
        let mut rows = vec![vec!["scheme".into(), "largest stable Δt/T".into()]];
        let machine = self.schemes.iter().any(|s| s.machine.is_some());
        if machine {
            rows[0].extend(["largest stable step (s)", "ρ at the step chosen"].map(String::from));
        }
        for scheme in &self.schemes {
            let limit = |limit: Option<f64>| limit.map_or("any".into(), |v| significant(v, 6));
            let mut row = vec![scheme.name.clone(), limit(scheme.stability_limit)];
            if let Some(machine) = &scheme.machine {
                row.extend([limit(machine.critical_step_s), rounded(machine.spectral_radius)]);
            }
            rows.push(row);
        }
        text + &paged_table(&rows, 1)
    }

    /// One row per step, one column per scheme.
    fn table(&self, value: Quantity<Point>) -> String {
        let mut header = vec!["Δt/T".to_owned()];
        header.extend(self.schemes.iter().map(|s| s.column.clone()));
        let mut rows = vec![header];
        let steps = self.schemes.first().map_or(&[][..], |s| s.chart.as_slice());
        for (k, step) in steps.iter().enumerate() {
            let mut row = vec![compact(step.step_over_period, 6)];
            row.extend(self.schemes.iter().map(|s| value(&s.chart[k]).map_or("–".into(), rounded)));
            rows.push(row);
        }
        paged_table(&rows, 1)
    }
}

/// Five digits; what is rounding of zero is zero.
fn rounded(value: f64) -> String {
    if value.abs() < 1e-10 { "0".into() } else { significant(value, 5) }
}
