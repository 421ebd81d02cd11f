//! Coverage of intervals, and ratio of the scatter to the Cramér–Rao bound, for machines of named
//! elements; also the time for a rotor of 200 degrees of freedom.
//!
//! `cargo run --release -p mechid-estimate --example machine_study -- joint 200` runs 200 seeds of
//! the rows whose names contain "joint". Without arguments, 20 seeds of every row are run.

#![allow(dead_code, unused_imports, reason = "the modules are those of the tests")]
#![allow(clippy::print_stdout, reason = "a study prints")]

#[path = "../tests/suite/machine/chain.rs"]
mod chain;
#[path = "../tests/suite/machine/frame.rs"]
mod frame;
#[path = "../tests/suite/machine/generator.rs"]
mod generator;
#[path = "../tests/suite/machine/joint.rs"]
mod joint;
#[path = "../tests/suite/machine/judge.rs"]
mod judge;
#[path = "../tests/suite/machine/long_chain.rs"]
mod long_chain;
#[path = "../tests/suite/machine/pulses.rs"]
mod pulses;
#[path = "../tests/suite/machine/rotor.rs"]
mod rotor;

use std::time::Instant;

use judge::{Judged, judge};
use mechid_estimate::likelihood::machine::{MachineEstimate, identify_machine};
use mechid_estimate::likelihood::{LikelihoodEstimate, NoiseSource, Settings};
use mechid_model::elements::{Coefficient, Element, FreeCoefficient, Input, Speed};
use mechid_model::{ResponseQuantity, SecondOrderSystem};
use mechid_problems::RandomTest;
use mechid_signal::{NoiseLevel, Record, Sampling, noise};
use mechid_spectra::LineData;
use nalgebra::DMatrix;

/// Name of a study, true values of the parameters by name, and a function that returns the estimate
/// from the experiment with a given seed.
type Study = (
    &'static str,
    Vec<(String, f64)>,
    Box<dyn Fn(u64) -> Option<LikelihoodEstimate> + Sync + Send>,
);

fn row(name: &str, seeds: u64, start: Instant, judged: &Judged) {
    println!(
        "{name:<46} {seeds:>4} {:>7.3} {:>7.3} {:>8.3} {:>8.3} {:>6.2} {:>6} {:>8.1}",
        judged.coverage,
        judged.worst_coverage,
        judged.scatter,
        judged.worst_scatter,
        judged.bias,
        judged.failed,
        start.elapsed().as_secs_f64()
    );
}

/// Returns the experiment on a rotor of 52 degrees of freedom; the model has the true Young's
/// modulus times the factor `modulus`.
fn shaken(modulus: f64) -> impl Fn(u64) -> Option<LikelihoodEstimate> {
    let [right, model] = [1.0, modulus].map(|factor| rotor::Rotor::new(13, factor));
    move |seed| Some(rotor::fit(&rotor::shaken(&right, 120, seed), &model).ok()?.likelihood)
}

fn of_noise(noise: NoiseSource) -> impl Fn(u64) -> Option<LikelihoodEstimate> {
    move |seed| chain::fit(seed, &Settings { noise, ..Settings::default() })
}

/// Returns the experiment on two masses under a hammer. The measured force has noise, which the fit
/// knows or ignores.
fn struck(is_known: bool) -> impl Fn(u64) -> Option<LikelihoodEstimate> {
    move |seed| Some(pulses::experiment(0.1, is_known, seed)?.0)
}

fn studies() -> Vec<Study> {
    let known = |seed| chain::fit(seed, &Settings::default());
    let unbalance = |seed| rotor::fit_unbalance(&rotor::Rotor::new(13, 1.0), seed);
    vec![
        ("chain of five, two sensors, known noise", chain::truth(), Box::new(known)),
        (
            "chain of five, white noise from the residual",
            chain::truth(),
            Box::new(of_noise(NoiseSource::WhiteResidual)),
        ),
        (
            "chain of five, smooth noise from the residual",
            chain::truth(),
            Box::new(of_noise(NoiseSource::SmoothResidual)),
        ),
        (
            "chain of five, an absent spring, k >= 0",
            chain::truth_with_bound(),
            Box::new(chain::fit_with_bound),
        ),
        (
            "three masses, all unknown, two sensors",
            chain::three_masses_truth(),
            Box::new(chain::three_masses),
        ),
        ("rotor, sixteen bearing coefficients", rotor::truth(), Box::new(shaken(1.0))),
        ("rotor, E wrong by 1 %, scaled intervals", rotor::truth(), Box::new(shaken(0.99))),
        ("rotor, unbalance at 8 speeds, 3 runs", rotor::truth_of_unbalance(), Box::new(unbalance)),
        (
            "frame on a table, absolute accelerations",
            frame::truth(),
            Box::new(|seed| frame::fit([false; 2], seed)),
        ),
        (
            "frame on a table, relative accelerations",
            frame::truth(),
            Box::new(|seed| frame::fit([true; 2], seed)),
        ),
        ("joint of two measured beams", joint::truth(), Box::new(joint::fit)),
        ("chain of forty, open record", long_chain::truth(), Box::new(long_chain::fit)),
        ("two masses, hammer, noise 0.1 % of the peak", pulses::truth(), Box::new(struck(true))),
        ("the same, noise of the force ignored", pulses::truth(), Box::new(struck(false))),
    ]
}

/// Prints the number of experiments in which a test reports a fault at a level of 1 %.
fn told(name: &str, seeds: u64, p_value: impl Fn(u64) -> Option<f64>) {
    let count = (0..seeds).filter(|seed| p_value(*seed).is_some_and(|p| p < 0.01)).count();
    println!("{name}: told in {count} of {seeds}");
}

/// Returns the p-value of the comparisons of parts of the data: the probability that noise alone
/// makes the parts differ this much, adjusted for the number of comparisons.
fn parts(estimate: &MachineEstimate) -> Option<f64> {
    let p_values = estimate.parts.iter().map(|parts| parts.p_value);
    Some(p_values.min_by(f64::total_cmp)? * estimate.parts.len() as f64)
}

/// Function that returns the p-value of the experiment with a given seed.
type PValue = Box<dyn Fn(u64) -> Option<f64>>;

/// Prints the number of experiments in which parts of the data disagree, for correct and for wrong
/// models.
fn parts_rows(seeds: u64, is_wanted: impl Fn(&str) -> bool) {
    let chain = |noise: NoiseSource| {
        move |seed| {
            let data = chain::data(&chain::STIFFNESSES, seed);
            let settings = Settings { noise, ..Settings::default() };
            let instruments = chain::instruments();
            parts(&identify_machine(&data, &chain::machine(), &instruments, &settings).ok()?)
        }
    };
    let rotor = |modulus: f64| {
        let [right, model] = [1.0, modulus].map(|factor| rotor::Rotor::new(13, factor));
        move |seed| parts(&rotor::fit(&rotor::shaken(&right, 120, seed), &model).ok()?)
    };
    let rows: [(&str, PValue); 5] = [
        ("parts, chain of five, known noise", Box::new(chain(NoiseSource::Automatic))),
        ("parts, chain of five, noise from residual", Box::new(chain(NoiseSource::SmoothResidual))),
        ("parts, open record", Box::new(|seed| parts(&long_chain::estimate(seed)?))),
        ("parts, rotor", Box::new(rotor(1.0))),
        ("parts, rotor, E wrong by 1 %", Box::new(rotor(0.99))),
    ];
    for (name, p_value) in rows.iter().filter(|row| is_wanted(row.0)) {
        told(name, seeds, p_value);
    }
}

/// Prints the number of experiments in which a misfit is attributed to a stated coefficient of the
/// rotor, and the coverage of the intervals that include the error of this coefficient.
fn stated_row(name: &str, modulus: f64, seeds: u64) {
    let [right, model] = [1.0, modulus].map(|factor| rotor::Rotor::new(13, factor));
    let instruments = model.instruments(vec![model.shaker().0], Speed::Constant(300.0));
    let (machine, settings) = (model.machine(), Settings::default());
    let [mut misfits, mut shafts, mut others, mut passes, mut held, mut intervals] = [0; 6];
    let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
    for seed in 0..seeds {
        let data = rotor::shaken(&right, 120, seed);
        let Ok(mut estimate) = rotor::fit(&data, &model) else { continue };
        let warns = |p: Option<f64>| p.is_some_and(|p| p < 0.01);
        let has_misfit = warns(estimate.likelihood.misfit_p_value);
        misfits += u64::from(has_misfit);
        if has_misfit || warns(parts(&estimate)) {
            let freed =
                estimate.freed_coefficient(&data, (&machine, &instruments), None, &settings);
            if let Some(freed) = freed.filter(|freed| freed.p_value < 0.01) {
                let is_shaft = freed.name == "shaft.stiffness";
                shafts += u64::from(is_shaft);
                others += u64::from(!is_shaft);
                passes += u64::from(!warns(freed.misfit_p_value));
                (least, most) = (least.min(freed.value), most.max(freed.value));
                estimate = estimate.with_parameter_errors(&freed.changes);
            }
        }
        for (name, truth) in rotor::truth() {
            let [low, high] = estimate.likelihood.parameter(&name).expect("a parameter").interval;
            held += u64::from((low..=high).contains(&truth));
            intervals += 1;
        }
    }
    println!(
        "{name}: {misfits} misfits in {seeds}, {shafts} times shaft.stiffness ({least:.4} to {most:.4}), {others} \
         times another one, {passes} misfits pass with it; {held} of {intervals} intervals hold"
    );
}

fn time_of_large_rotor() {
    let rotor = rotor::Rotor::new(50, 1.0);
    let data = rotor::shaken(&rotor, 500, 0);
    let start = Instant::now();
    let searches = rotor::fit(&data, &rotor).map_or(0, |estimate| estimate.likelihood.searches);
    println!(
        "rotor of 200 degrees of freedom, 500 lines, 4 probes: {:.2} s, {searches} searches",
        start.elapsed().as_secs_f64()
    );
}

/// Prints the number of experiments in which the search finds every parameter of the chain with an
/// error below 10 %, the mean number of searches and the mean time. The open records have 8,192
/// samples, five forces and two sensors. The initial values of all springs and dampers are wrong by
/// the same `factor`.
fn search_row(name: &str, factor: f64, seeds: u64) {
    let mass = DMatrix::from_diagonal(&chain::MASSES.to_vec().into());
    let [damping, stiffness] = [&chain::DAMPINGS, &chain::STIFFNESSES].map(chain::chain);
    let rig = RandomTest {
        system: SecondOrderSystem::new(mass, damping, stiffness).expect("a machine"),
        sampling: Sampling::new(1.0 / 256.0, 8192).expect("a time axis"),
        quantity: ResponseQuantity::Displacement,
        force: 10.0,
    };
    let mut machine = chain::machine();
    for (_, element) in &mut machine.elements {
        let Element::Link { stiffness, damping, .. } = element else { continue };
        for coefficient in [stiffness, damping] {
            if let Coefficient::Free(FreeCoefficient { start: Some(start), .. }) = coefficient {
                *start *= factor;
            }
        }
    }
    let mut instruments = chain::instruments();
    instruments.inputs = machine.dofs.iter().map(|dof| Input::force(dof)).collect();
    let (mut right, mut searches, mut seconds) = (0, 0, 0.0);
    for seed in 0..seeds {
        let [force, response] = rig.measure(seed).expect("a record");
        let columns = response.data().select_columns(&[0, 4]);
        let response = Record::new(response.sampling(), columns).expect("two channels");
        let level = NoiseLevel::FractionOfRms(0.005);
        let response = noise::add_white(&response, level, seed + 100_000).expect("noise");
        let data = LineData::from_open_record(Some(&force), &response, [1.0, 60.0]).expect("lines");
        let start = Instant::now();
        let result = identify_machine(&data, &machine, &instruments, &Settings::default());
        seconds += start.elapsed().as_secs_f64();
        let Ok(estimate) = result.map(|result| result.likelihood) else { continue };
        let is_near = |(name, truth): (String, f64)| {
            estimate.parameter(&name).is_some_and(|p| (p.value / truth - 1.0).abs() < 0.1)
        };
        right += u64::from(chain::truth().into_iter().all(is_near));
        searches += estimate.searches;
    }
    let each = |sum: f64| sum / seeds as f64;
    println!(
        "{name}: right in {right} of {seeds}, {:.1} searches, {:.2} s",
        each(searches as f64),
        each(seconds)
    );
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let seeds = words.iter().find_map(|word| word.parse().ok()).unwrap_or(20);
    let part = words.iter().find(|word| word.parse::<u64>().is_err());
    let is_wanted = |name: &str| part.is_none_or(|part| name.contains(part.as_str()));
    println!(
        "{:<46} seeds    held   worst  scatter    worst   bias failed  seconds",
        "errors over standard errors: scatter, bias"
    );
    if is_wanted("time") {
        time_of_large_rotor();
    }
    for factor in [0.1, 0.25, 0.5, 0.75, 1.5, 2.0, 4.0] {
        let name = format!("search, start times {factor}");
        if is_wanted(&name) {
            search_row(&name, factor, seeds);
        }
    }
    for (name, truth, experiment) in studies().into_iter().filter(|study| is_wanted(study.0)) {
        let start = Instant::now();
        row(name, seeds, start, &judge(&truth, seeds, experiment));
    }
    for away in [0.0, 5.0] {
        let name = format!("prior {away} standard deviations away");
        if is_wanted(&name) {
            told(&name, seeds, |seed| {
                chain::fit_with_prior(seed, away)?.parameter("s1.k")?.prior?.p_value
            });
        }
    }
    parts_rows(seeds, is_wanted);
    for modulus in [1.0, 0.99] {
        let name = format!("stated coefficients, E times {modulus}");
        if is_wanted(&name) {
            stated_row(&name, modulus, seeds);
        }
    }
    let name = "rotor, E wrong by 1 %, misfit";
    if is_wanted(name) {
        told(name, seeds, |seed| shaken(0.99)(seed)?.misfit_p_value);
    }
}
