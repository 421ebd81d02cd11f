//! Coverage of the 95 % intervals of a force over many seeded records.

use mechid_force::{
    Filter, ForceUnknowns, IdentifiedForce, Measurement, Noise, Rule, Start, Tuning,
    frequency_domain, kalman, regularised,
};
use mechid_model::{InitialState, ResponseQuantity};
use mechid_problems::{exact_foh, exact_foh_periodic, exact_harmonic_periodic};
use mechid_signal::{Multisine, NoiseLevel, Phases, Record, noise};
use nalgebra::DMatrix;

use super::machine;

/// The forces of the coverage study.
#[derive(Clone, Copy, PartialEq)]
pub enum Shape {
    /// Lines of equal amplitude; the phases are drawn anew for each record.
    Flat(&'static str, usize, usize, usize),
    /// A random walk, whose power falls as 1/f²; in a period, a walk that returns to its first
    /// value.
    Walk,
}

/// Forces of the coverage study: flat bands, single lines and a random walk.
pub const SHAPES: [Shape; 5] = [
    Shape::Flat("lines 1–40", 1, 1, 40),
    Shape::Flat("lines 1–8", 1, 1, 8),
    Shape::Flat("every line", 1, 1, 127),
    Shape::Flat("every fifth to 61", 1, 5, 61),
    Shape::Walk,
];

impl Shape {
    pub fn name(self) -> &'static str {
        match self {
            Self::Flat(name, ..) => name,
            Self::Walk => "random walk",
        }
    }

    pub fn lines(self) -> Vec<usize> {
        match self {
            Self::Flat(_, first, step, last) => (first..=last).step_by(step).collect(),
            Self::Walk => (1..=127).collect(),
        }
    }
}

/// Kind of record.
#[derive(Clone, Copy, PartialEq)]
pub enum Extent {
    /// A period in steady state, without frequencies above the last line of the force.
    Period,
    /// A period in steady state whose samples a method treats as an open record.
    Open,
    /// An open record with a force that is linear between its samples.
    Linear,
}

/// A record with its force.
pub struct Draw {
    pub measured: Measurement,
    pub truth: Record,
    /// Standard deviation of the noise in each channel.
    pub noise: Vec<f64>,
    pub forced: [usize; 1],
}

/// Returns the displacements of one of the machines under a drawn force, with noise of `level`
/// times their RMS value.
///
/// In an open record, the random walk begins with the system at rest and is linear between samples.
pub fn draw(bearing: bool, shape: Shape, level: f64, open: Extent, seed: u64) -> Draw {
    let (system, sampling) = machine(bearing);
    let dof = system.dof();
    let path: Vec<f64> = match shape {
        Shape::Flat(..) => {
            let phases = Phases::Random { seed: 1000 + seed };
            let sine = Multisine::flat(shape.lines(), 50.0, phases).unwrap();
            sine.sample(sampling).unwrap().channel(0).to_vec()
        }
        Shape::Walk => {
            let steps = noise::white(sampling, 1, 20.0, 1000 + seed).unwrap();
            let mut sum = 0.0;
            let walk = steps.channel(0).iter().map(|step| {
                sum += step;
                sum
            });
            let walk: Vec<f64> = walk.collect();
            let last = walk[walk.len() - 1]
                + 20.0 * noise::white(sampling, 1, 1.0, 7777 + seed).unwrap().channel(0)[0];
            // The straight line from the start to the end of the walk is subtracted, so that the
            // walk is periodic.
            let closing = |k: usize| {
                if open != Extent::Period { 0.0 } else { last * k as f64 / walk.len() as f64 }
            };
            walk.iter().enumerate().map(|(k, f)| f - closing(k)).collect()
        }
    };
    let force =
        DMatrix::from_fn(sampling.len(), dof, |k, i| if i + 1 == dof { path[k] } else { 0.0 });
    let truth = Record::new(sampling, force).unwrap();
    let response = match (open, shape) {
        (Extent::Open, Shape::Walk) => exact_foh(&system, &truth, &InitialState::rest(dof)),
        (Extent::Linear, Shape::Walk) => exact_foh(&system, &truth, &InitialState::rest(dof)),
        (Extent::Linear, _) => exact_foh_periodic(&system, &truth),
        _ => exact_harmonic_periodic(&system, &truth),
    }
    .unwrap();
    let exact = response.displacement();
    let rms = |x: nalgebra::DVectorView<'_, f64>| x.norm() / (exact.len() as f64).sqrt();
    let noise_std = exact.data().column_iter().map(|x| level * rms(x)).collect();
    let level = NoiseLevel::FractionOfRms(level);
    let noisy = noise::add_white(response.displacement(), level, seed).unwrap();
    let measured = Measurement::from_record(ResponseQuantity::Displacement, noisy);
    Draw { measured, truth, noise: noise_std, forced: [dof - 1] }
}

/// A method of the coverage study.
pub type Interval = (&'static str, Extent, fn(bool, Shape, &Draw) -> Option<IdentifiedForce>);

fn known(
    bearing: bool,
    shape: Shape,
    draw: &Draw,
    filter: Option<Filter>,
) -> Option<IdentifiedForce> {
    let lines = shape.lines();
    let (system, _) = machine(bearing);
    let noise = if lines.len() > 100 { return None } else { Noise::OutsideLines };
    Some(match filter {
        None => frequency_domain(&system, &draw.measured, &draw.forced, &lines, &noise).unwrap(),
        Some(filter) => {
            let lines = ForceUnknowns::Lines(lines);
            regularised(&system, &draw.measured, &draw.forced, &lines, filter, &noise)
                .unwrap()
                .force
        }
    })
}

fn unknown(bearing: bool, draw: &Draw, filter: Filter, open: bool) -> Option<IdentifiedForce> {
    let (system, _) = machine(bearing);
    let extent =
        if open { ForceUnknowns::Samples(Start::InMotion) } else { ForceUnknowns::EveryLine };
    let found =
        regularised(&system, &draw.measured, &draw.forced, &extent, filter, &Noise::Unknown);
    Some(found.unwrap().force)
}

const TIKHONOV: Filter = Filter::Tikhonov(Rule::Likelihood);
const TRUNCATED: Filter = Filter::TruncatedSvd(Rule::Likelihood);

/// The methods whose standard error covers all errors, with the extent of the record and the
/// function that identifies the force.
pub const INTERVALS: [Interval; 12] = [
    ("frequency domain, lines known", Extent::Period, |b, s, d| known(b, s, d, None)),
    ("Tikhonov, lines known", Extent::Period, |b, s, d| known(b, s, d, Some(TIKHONOV))),
    ("truncated SVD, lines known", Extent::Period, |b, s, d| known(b, s, d, Some(TRUNCATED))),
    ("shrinkage", Extent::Period, |b, _, d| unknown(b, d, Filter::Shrinkage, false)),
    ("shrinkage, noise known", Extent::Period, |b, _, d| {
        let (system, _) = machine(b);
        let (noise, filter) = (Noise::PerChannel(d.noise.clone()), Filter::Shrinkage);
        let lines = ForceUnknowns::EveryLine;
        let found = regularised(&system, &d.measured, &d.forced, &lines, filter, &noise);
        Some(found.unwrap().force)
    }),
    ("Tikhonov", Extent::Period, |b, _, d| unknown(b, d, TIKHONOV, false)),
    ("truncated SVD", Extent::Period, |b, _, d| unknown(b, d, TRUNCATED, false)),
    ("shrinkage, open", Extent::Linear, |b, _, d| unknown(b, d, Filter::Shrinkage, true)),
    ("Tikhonov, open", Extent::Linear, |b, _, d| unknown(b, d, TIKHONOV, true)),
    ("truncated SVD, open", Extent::Linear, |b, _, d| unknown(b, d, TRUNCATED, true)),
    ("Kalman smoother", Extent::Open, |b, _, d| {
        let (system, _) = machine(b);
        let found = kalman(&system, &d.measured, &d.forced, Start::InMotion, &Tuning::Likelihood);
        Some(found.unwrap().force)
    }),
    ("Kalman smoother, noise known", Extent::Open, |b, _, d| {
        let (system, _) = machine(b);
        let tuning = Tuning::NoiseKnown(d.noise.clone());
        let found = kalman(&system, &d.measured, &d.forced, Start::InMotion, &tuning);
        Some(found.unwrap().force)
    }),
];

/// Returns three numbers over this many records: the share of samples within 1.96 standard errors
/// of the truth, the RMS error relative to the RMS force, and the RMS standard error relative to
/// the RMS error.
pub fn coverage(
    interval: &Interval,
    bearing: bool,
    shape: Shape,
    level: f64,
    runs: u64,
) -> Option<[f64; 3]> {
    let (mut held, mut samples) = (0, 0);
    let (mut error, mut stated, mut size) = (0.0, 0.0, 0.0);
    for seed in 1..=runs {
        let draw = draw(bearing, shape, level, interval.1, seed);
        let found = (interval.2)(bearing, shape, &draw)?;
        let dof = draw.forced[0];
        let (record, se) =
            (found.record().channel(dof), found.standard_error().unwrap().channel(dof));
        for ((f, t), se) in record.iter().zip(draw.truth.channel(dof)).zip(se) {
            held += usize::from((f - t).abs() <= 1.96 * se);
            samples += 1;
            error += (f - t).powi(2);
            stated += se * se;
            size += t * t;
        }
    }
    Some([held as f64 / samples as f64, (error / size).sqrt(), (stated / error).sqrt()])
}

/// Returns the table of the coverage, in per cent.
pub fn coverage_table(runs: u64, of: &[String]) -> String {
    let mut out =
        String::from("| Method | Force | SDOF, 1 % | SDOF, 5 % | bearing, 1 % | bearing, 5 % |\n");
    out.push_str("|---|---|---|---|---|---|\n");
    let asked = |i: &&Interval| of.is_empty() || of.iter().any(|name| name == i.0);
    for interval in INTERVALS.iter().filter(asked) {
        for shape in SHAPES {
            out.push_str(&format!("| {} | {} |", interval.0, shape.name()));
            for (bearing, level) in [(false, 0.01), (false, 0.05), (true, 0.01), (true, 0.05)] {
                match coverage(interval, bearing, shape, level, runs) {
                    Some([c, e, s]) => {
                        out.push_str(&format!(" {:.1} ({e:.3}, {s:.2}) |", 100.0 * c))
                    }
                    None => out.push_str(" – |"),
                }
            }
            out.push('\n');
        }
    }
    out
}
