//! Section 5.6: the direction of the excitation.

use mechid::integrate::integrate_periodic;
use mechid::model::Discretisation;
use mechid::signal::{Multisine, Phases, Record, lines};
use nalgebra::DMatrix;

use super::super::super::case::Case;
use super::super::super::estimates;
use super::super::super::published::Method::Newmark;
use super::super::super::simulate::{Sequences, scheme, slipped};
use super::super::evidence::{Source, View, mean};
use super::super::markdown::number;
use super::super::rerun::{bearing, percent};
use super::{Claim, Finding, Support};

pub const CLAIMS: &[Claim] = &[Claim {
    number: 35,
    section: "5.6, after Oliveira (1988)",
    statement: "The direction of the excitation is irrelevant as long as all modes are excited.",
    test: "Newmark's mean error over NPI 2–20 of each coefficient with a force along X, along Y and along both: the largest of the three at most twice the smallest",
    support: Support::Nothing,
    judge: direction,
}];

/// Returns the force along X, along Y, or along both directions. A force along both directions has
/// the same lines in both channels, with different phases.
fn force(case: Case, along: [bool; 2]) -> Result<Record, String> {
    let sampling = case.sampling();
    let signal = |phases| {
        Multisine::flat(lines::full(sampling), case.machine.amplitude(), phases)
            .and_then(|m| m.sample(sampling))
            .map_err(|e| e.to_string())
    };
    let signals = [signal(Phases::Schroeder)?, signal(Phases::SchroederBinary)?];
    let data =
        DMatrix::from_fn(case.nt, 2, |k, c| if along[c] { signals[c].channel(0)[k] } else { 0.0 });
    Record::new(sampling, data).map_err(|e| e.to_string())
}

fn sequences(source: Source, case: Case, along: [bool; 2]) -> Result<Sequences, String> {
    let machine = match source {
        Source::Printed => slipped(case, Newmark)?.machine,
        Source::Corrected => case.machine,
    };
    let force = force(case, along)?;
    let response = integrate_periodic(scheme(Newmark).as_ref(), &machine.system(), &force)
        .map_err(|e| e.to_string())?;
    Ok(Sequences { machine, response, force })
}

fn direction(view: &View) -> Result<Finding, String> {
    let names = bearing(256, 2.0).machine.parameters();
    let mut euler = vec![[0.0; 3]; names.len()];
    let mut best = [0.0; 3];
    for (at, along) in [[true, false], [false, true], [true, true]].into_iter().enumerate() {
        let sweep: Result<Vec<[Vec<f64>; 2]>, String> = (1..=10)
            .map(|half| {
                let case = bearing(256, f64::from(2 * half));
                let sequences = sequences(view.source, case, along)?;
                let errors = |d| {
                    Ok::<_, String>(percent(&estimates::fit_in_time(&sequences, d)?, case.machine))
                };
                Ok([errors(Discretisation::Euler)?, errors(Discretisation::FirstOrderHold)?])
            })
            .collect();
        let sweep = sweep?;
        for (parameter, means) in euler.iter_mut().enumerate() {
            means[at] = mean(sweep.iter().map(|[e, _]| e[parameter]));
        }
        best[at] = mean(sweep.iter().flat_map(|[_, b]| b.iter().copied()));
    }
    let within = |means: &[f64; 3]| {
        let low = means.iter().copied().fold(f64::INFINITY, f64::min);
        means.iter().copied().fold(0.0, f64::max) <= 2.0 * low
    };
    let shown = |means: [f64; 3]| means.map(number).join(" / ");
    let words: Vec<String> =
        names.iter().zip(&euler).map(|(n, means)| format!("{n} {}", shown(*means))).collect();
    let numbers = format!(
        "X / Y / both: {}. Exact discretisation on the same data, mean of all eight: {}.",
        words.join(", "),
        shown(best)
    );
    Ok(Finding::new(euler.iter().map(within), numbers))
}
