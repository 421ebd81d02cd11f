//! Time-domain estimators on forces that are held, linear or band-limited between samples, with and
//! without noise: hundreds of seeded experiments, each on an exact response.

use mechid_estimate::time_domain::{TimeDomain, equation_of_motion};
use mechid_estimate::{Estimate, Unknowns};
use mechid_model::{Discretisation, Response, SecondOrderSystem};
use mechid_problems::{exact_foh_periodic, exact_harmonic_periodic, exact_zoh_periodic};
use mechid_signal::{Extent, Multisine, NoiseLevel, Phases, Record, Sampling, noise};
use rayon::prelude::*;

use crate::common::documentation::documented;
use crate::common::oscillator;

const RUNS: u64 = 400;

/// Sampling interval with twenty samples per cycle of the natural frequency, 22.36 rad/s.
const DT: f64 = 0.014;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Estimator {
    Euler,
    Held,
    Linear,
    EquationOfMotion,
}

const ESTIMATORS: [(Estimator, &str); 4] = [
    (Estimator::Euler, "Euler"),
    (Estimator::Held, "held"),
    (Estimator::Linear, "linear"),
    (Estimator::EquationOfMotion, "equation of motion"),
];

/// One period of a force and of the exact response to this force.
struct Experiment {
    force: Record,
    motion: Response,
}

impl Experiment {
    fn new(between: &str, system: &SecondOrderSystem) -> Self {
        let force = Multisine::flat(1..=60, 20.0, Phases::Schroeder).unwrap();
        let force = force.sample(Sampling::new(DT, 512).unwrap()).unwrap();
        let motion = match between {
            "held" => exact_zoh_periodic(system, &force),
            "linear" => exact_foh_periodic(system, &force),
            _ => exact_harmonic_periodic(system, &force),
        };
        Self { force, motion: motion.unwrap() }
    }

    /// Returns the response of the experiment with this seed, with independent noise on
    /// displacement, velocity and acceleration.
    fn measure(&self, share: f64, seed: u64) -> Response {
        let add = |record: &Record, channel: u64| {
            noise::add_white(record, NoiseLevel::FractionOfRms(share), 3 * seed + channel).unwrap()
        };
        let m = &self.motion;
        Response::new(add(m.displacement(), 0), add(m.velocity(), 1), add(m.acceleration(), 2))
            .unwrap()
    }

    fn estimate(&self, motion: &Response, estimator: Estimator) -> Estimate {
        let unknowns = Unknowns::unknown_mass(1).unwrap();
        let discretisation = match estimator {
            Estimator::Euler => Discretisation::Euler,
            Estimator::Held => Discretisation::ZeroOrderHold,
            Estimator::Linear => Discretisation::FirstOrderHold,
            Estimator::EquationOfMotion => {
                return equation_of_motion(motion, &self.force, &unknowns).unwrap();
            }
        };
        TimeDomain::new(discretisation, Extent::WholePeriod)
            .fit(motion.displacement(), motion.velocity(), &self.force, &unknowns)
            .unwrap()
            .into_estimate()
    }

    /// Returns four values over all parameters: the largest relative bias, the largest relative
    /// scatter, and the smallest and the largest share of 95 % intervals that contain the truth.
    fn study(&self, estimator: Estimator, share: f64) -> [f64; 4] {
        let runs = if share > 0.0 { RUNS } else { 1 };
        let truth = [10.0, 180.0, 5000.0];
        let found: Vec<Vec<(f64, bool)>> = (0..runs)
            .into_par_iter()
            .map(|seed| {
                let estimate = self.estimate(&self.measure(share, seed), estimator);
                let held = |(p, truth): (mechid_estimate::Estimated, &f64)| {
                    let [low, high] = p.interval(0.95).unwrap();
                    (p.value / truth - 1.0, low <= *truth && *truth <= high)
                };
                estimate.parameters().zip(&truth).map(held).collect()
            })
            .collect();
        let [mut bias, mut scatter, mut least, mut most] = [0.0, 0.0, 1.0, 0.0];
        for at in 0..truth.len() {
            let count = runs as f64;
            let mean = found.iter().map(|run| run[at].0).sum::<f64>() / count;
            let square = found.iter().map(|run| (run[at].0 - mean).powi(2)).sum::<f64>() / count;
            let held = found.iter().filter(|run| run[at].1).count() as f64 / count;
            bias = f64::max(bias, mean.abs());
            scatter = f64::max(scatter, square.sqrt());
            (least, most) = (f64::min(least, held), f64::max(most, held));
        }
        [bias, scatter, least, most]
    }
}

/// Computes the comparison table of the page on estimators.
fn table() -> Vec<String> {
    let mut rows = Vec::new();
    for between in ["held", "linear", "band-limited"] {
        let experiment = Experiment::new(between, &oscillator());
        for (estimator, name) in ESTIMATORS {
            for share in [0.0, 0.01] {
                let [bias, scatter, least, most] = experiment.study(estimator, share);
                let percent = 100.0 * share;
                rows.push(match share > 0.0 {
                    false => {
                        format!("| {between} | {name} | 0 % | {:.2} | – | – | – |", 100.0 * bias)
                    }
                    true => format!(
                        "| {between} | {name} | {percent:.0} % | {:.2} | {:.2} | {:.0} | {:.0} |",
                        100.0 * bias,
                        100.0 * scatter,
                        100.0 * least,
                        100.0 * most
                    ),
                });
            }
        }
    }
    rows
}

#[test]
fn the_table_of_the_time_domain_is_what_comes_out() {
    let all: Vec<Option<String>> = table().into_iter().map(Some).collect();
    documented("<!-- time domain -->\n", "<!-- end of time domain -->\n", &all);
}

/// The main statement of the table: without noise, an estimator is exact if its assumption about
/// the force between samples is true.
#[test]
fn the_right_assumption_is_exact() {
    for (between, estimator) in [
        ("held", Estimator::Held),
        ("linear", Estimator::Linear),
        ("held", Estimator::EquationOfMotion),
        ("band-limited", Estimator::EquationOfMotion),
    ] {
        let [bias, ..] = Experiment::new(between, &oscillator()).study(estimator, 0.0);
        assert!(bias < 1e-9, "{between}, {estimator:?}: {bias:e}");
    }
}
