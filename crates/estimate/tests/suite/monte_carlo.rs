//! A thousand experiments: coverage of the intervals, and scatter compared with the Cramér–Rao
//! bound.

use crate::common::documentation::documented;
use crate::common::monte_carlo::{Estimator, Experiment, Scatter};
use crate::common::{bearing, oscillator};
use mechid_estimate::Unknowns;
use mechid_model::SecondOrderSystem;

fn known_mass(system: SecondOrderSystem, periods: usize, noise: f64) -> Experiment {
    let unknowns = Unknowns::known_mass(system.mass()).unwrap();
    Experiment::new(system, unknowns, periods, noise)
}

fn unknown_mass(system: SecondOrderSystem, periods: usize, noise: f64) -> Experiment {
    let unknowns = Unknowns::unknown_mass(system.dof()).unwrap();
    Experiment::new(system, unknowns, periods, noise)
}

/// With 1 % noise on the displacement and an exact force, maximum likelihood has intervals with the
/// stated coverage, a small bias, and a scatter near the Cramér–Rao bound.
#[test]
fn maximum_likelihood_is_as_good_as_it_says_and_as_good_as_can_be() {
    for (name, experiment) in [
        ("oscillator", unknown_mass(oscillator(), 16, 0.01)),
        ("bearing", known_mass(bearing(), 2, 0.01)),
    ] {
        let runs = 1000;
        let scatter = &experiment.scatter(&[Estimator::MaximumLikelihood], runs)[0];
        let bound = experiment.bound();
        for at in 0..bound.len() {
            let what = format!("{name}, {}", experiment.unknowns.free()[at]);
            // A coverage of 95 % in 1,000 runs has a standard deviation of 0.7 %; the limits of 93
            // and 97 % are about three standard deviations away.
            let coverage = scatter.coverage[at];
            assert!((0.93..=0.97).contains(&coverage), "{what}: {coverage}");
            let bias = scatter.bias[at].abs() / scatter.deviation[at];
            assert!(bias < 0.1, "{what}: bias of {bias} standard deviations");
            // The standard deviation of 1,000 runs itself has an uncertainty of 2.2 %.
            let ratio = scatter.deviation[at] / bound[at];
            assert!((0.95..1.1).contains(&ratio), "{what}: {ratio} times the bound");
        }
    }
}

const ESTIMATORS: [(Estimator, &str); 3] = [
    (Estimator::LeastSquares, "least squares"),
    (Estimator::InstrumentalVariables, "instrumental variables"),
    (Estimator::MaximumLikelihood, "maximum likelihood"),
];

fn row(experiment: &Experiment, scatter: &Scatter, name: &str) -> String {
    let bias = scatter.bias.component_div(&experiment.truth()).amax() * 100.0;
    let ratio = scatter.deviation.component_div(&experiment.bound());
    format!(
        "{name} | {:.0} % | {} | {bias:.2} | {:.1} | {:.1} | {:.0} | {:.0} |",
        experiment.noise * 100.0,
        experiment.periods,
        ratio.min(),
        ratio.max(),
        scatter.coverage.min() * 100.0,
        scatter.coverage.max() * 100.0,
    )
}

/// Computes the rows of the comparison in the book (`studies/estimators.md`): all rows if they are
/// to be written to the book, otherwise only the rows that no other test computes.
fn table() -> Vec<Option<String>> {
    let is_written = std::env::var_os("MECHID_BLESS").is_some();
    let mut rows = Vec::new();
    for (machine, runs) in [("oscillator", 2000), ("bearing", 400)] {
        for noise in [0.01, 0.05] {
            for periods in [2, 16] {
                if !is_written && (noise, periods) != (0.05, 2) {
                    rows.extend(ESTIMATORS.map(|_| None));
                    continue;
                }
                let experiment = match machine {
                    "oscillator" => unknown_mass(oscillator(), periods, noise),
                    _ => known_mass(bearing(), periods, noise),
                };
                let scatter = experiment.scatter(&ESTIMATORS.map(|(e, _)| e), runs);
                for ((_, name), scatter) in ESTIMATORS.iter().zip(&scatter) {
                    rows.push(Some(format!("| {machine} | {}", row(&experiment, scatter, name))));
                }
            }
        }
    }
    rows
}

#[test]
fn the_table_in_the_documentation_is_what_comes_out() {
    documented("<!-- table -->\n", "<!-- end of table -->\n", &table());
}
