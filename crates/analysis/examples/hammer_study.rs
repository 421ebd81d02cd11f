//! Study of hammer tests of three masses, with five hits on each, two of them bad: percentage of
//! bad hits that are detected, percentage of good hits that are excluded, and coverage of the
//! intervals.
//!
//! ```text
//! cargo run --release -p mechid-analysis --example hammer_study -- 1000 100
//! ```
//! counts the hits of 1,000 tests and fits 100 of them. A third argument is a noise level of the
//! force, in N: only rows with this level are computed.
#![allow(clippy::print_stdout, reason = "a study prints its table")]

use mechid_analysis::identify::{Band, LineChoice};
use mechid_analysis::{
    Channels, HitRule, Identified, Identify, Measurement, ResponseQuantity, identify,
};
use mechid_problems::{HammerRecord, HammerTest};
use mechid_signal::{NoiseLevel, Record, Sampling, hits, noise};
use nalgebra::dmatrix;
use rayon::prelude::*;

/// Ratio of the RMS of the noise on the response to the RMS of the response.
const LEVEL: f64 = 0.01;
/// Lines that are fitted.
const BAND: Band = Band { low_hz: 2.0, high_hz: 200.0 };
/// Mean peak of the hits, in N.
const PEAK: f64 = 200.0;

fn main() {
    let count = |at: usize| std::env::args().nth(at).and_then(|count| count.parse().ok());
    let (tests, fits) = (count(1).unwrap_or(200), count(2).unwrap_or(20));
    let wanted: Option<f64> = std::env::args().nth(3).and_then(|level| level.parse().ok());
    println!(
        "{tests} tests of 15 hits, 6 of them bad, {} % of noise on the response; {fits} fitted, and as many \
         with hits on the first mass alone",
        100.0 * LEVEL
    );
    println!(
        "| response | noise on the force (N) | bad hits found (%) | good hits lost (%) | points struck | intervals that hold: \
         parameters, modes (%) | damping ratio: bias, scatter (%) | a warning (%) |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for (quantity, force_noise) in [
        (ResponseQuantity::Acceleration, 0.01),
        (ResponseQuantity::Displacement, 0.01),
        (ResponseQuantity::Acceleration, 0.1),
        (ResponseQuantity::Acceleration, 0.2),
    ] {
        if wanted.is_some_and(|level| level != force_noise) {
            continue;
        }
        for points in [3, 1] {
            study(quantity, force_noise, points, tests, fits);
        }
    }
}

/// Returns a hammer test of three masses with natural frequencies of 18, 41 and 73 Hz: one hit per
/// second, 1,024 samples per second.
fn rig(quantity: ResponseQuantity, force_noise: f64) -> HammerTest {
    HammerTest {
        frequencies_hz: vec![18.0, 41.0, 73.0],
        damping_ratios: vec![0.006, 0.01, 0.015],
        shapes: dmatrix![0.20, -0.25, 0.15; 0.30, 0.05, -0.28; 0.22, 0.30, 0.20],
        sampling: Sampling::from_rate_hz(1024.0, 5 * 1024).expect("a rate"),
        quantity,
        hits: 5,
        peak: PEAK,
        duration: 0.010,
        force_noise,
    }
}

/// A fit of one test.
#[derive(Default)]
struct Run {
    /// Fractions of the 95 % intervals that contain the true value, for parameters and for modes.
    holding: [f64; 2],
    /// Relative error of each damping ratio.
    damping: Vec<f64>,
    warned: f64,
}

fn study(quantity: ResponseQuantity, force_noise: f64, points: usize, tests: u64, fits: u64) {
    let rig = rig(quantity, force_noise);
    // The noise level follows from one record, and is the same for all hits.
    let usual = rig.measure(0, 0, 0).expect("a record").response;
    let noise = LEVEL * (usual.data().norm_squared() / usual.data().len() as f64).sqrt();
    let counts: Vec<[f64; 4]> =
        (0..tests).into_par_iter().filter_map(|seed| count_hits(&rig, noise, seed)).collect();
    let all: Vec<Run> =
        (0..fits).into_par_iter().filter_map(|seed| fit(&rig, noise, points, seed)).collect();
    let count = all.len() as f64;
    let sum = |of: &dyn Fn(&Run) -> f64| all.iter().map(of).sum::<f64>();
    let total = |at: usize| counts.iter().map(|counts| counts[at]).sum::<f64>();
    let (found, lost) = (100.0 * total(1) / total(0), 100.0 * total(3) / total(2));
    let modes = 100.0 * sum(&|run| run.holding[1]) / count;
    // Hits on one mass determine the modes, but not M, C and K.
    let parameters = match points {
        1 => "–".to_owned(),
        _ => format!("{:.1}", 100.0 * sum(&|run| run.holding[0]) / count),
    };
    // The row shows the mode with the largest bias.
    let of_mode = |mode: usize| {
        let mean = sum(&|run| run.damping[mode]) / count;
        let square = sum(&|run| (run.damping[mode] - mean).powi(2)) / count;
        [100.0 * mean, 100.0 * square.sqrt()]
    };
    let worst = (0..3).map(of_mode).max_by(|a, b| a[0].abs().total_cmp(&b[0].abs()));
    let [bias, scatter] = worst.expect("three modes");
    let warned = 100.0 * sum(&|run| run.warned) / count;
    println!(
        "| {quantity} | {force_noise} | {found:.2} | {lost:.2} | {points} | {parameters}, {modes:.1} | {bias:.3}, \
         {scatter:.3} | {warned:.1} |"
    );
    if all.len() as u64 != fits {
        println!("{} of {fits} fits failed", fits - all.len() as u64);
    }
}

/// Returns the record of hits on one degree of freedom, with noise on the response.
fn measure(rig: &HammerTest, noise: f64, dof: usize, seed: u64) -> Option<HammerRecord> {
    let seed = 3 * seed + dof as u64;
    let record = rig.measure(dof, 2, seed).ok()?;
    let level = NoiseLevel::StandardDeviation(noise);
    let response = noise::add_white(&record.response, level, 2_000_000 + seed).ok()?;
    Some(HammerRecord { response, ..record })
}

/// Returns four numbers: the bad hits, the bad hits that are excluded, the good hits, and the good
/// hits that are excluded.
fn count_hits(rig: &HammerTest, noise: f64, seed: u64) -> Option<[f64; 4]> {
    let mut counts = [0.0; 4];
    for dof in 0..3 {
        let record = measure(rig, noise, dof, seed)?;
        let dt = rig.sampling.dt();
        let mut found = hits(record.force.channel(0), dt, &HitRule::default()).ok()?;
        found.check_response(&record.response).ok()?;
        for (start, fault) in record.hits {
            let used = found.all.iter().any(|hit| {
                hit.faults.is_empty() && (hit.pulse.start as f64 * dt - start).abs() < 0.02
            });
            let at = if fault.is_some() { 0 } else { 2 };
            counts[at] += 1.0;
            counts[at + 1] += f64::from(u8::from(!used));
        }
    }
    Some(counts)
}

fn fit(rig: &HammerTest, noise: f64, points: usize, seed: u64) -> Option<Run> {
    let tests: Option<Vec<Measurement>> = (0..points)
        .map(|dof| {
            let record = measure(rig, noise, dof, seed)?;
            measured(&record.force, &record.response, rig.quantity, dof)
        })
        .collect();
    // The fit uses the band in which the hammer has a significant force.
    let how = Identify::hits(HitRule::default()).lines(LineChoice::Band(BAND));
    compare(&identify(&tests?, &how).ok()?, rig)
}

fn measured(
    force: &Record,
    response: &Record,
    quantity: ResponseQuantity,
    dof: usize,
) -> Option<Measurement> {
    let names = ["a1", "a2", "a3"];
    let mut columns: Vec<(&str, &[f64])> = vec![("f", force.channel(0))];
    columns.extend(names.iter().enumerate().map(|(at, name)| (*name, response.channel(at))));
    let forces: Vec<&str> = (0..3).map(|at| if at == dof { "f" } else { "0" }).collect();
    let channels = Channels::new(&forces.join(","), quantity, &names.join(","));
    let measured = Measurement::from_columns(force.sampling(), &columns, &channels).ok()?;
    Some(measured.named(&format!("point {}", dof + 1)))
}

fn compare(found: &Identified, rig: &HammerTest) -> Option<Run> {
    let mut run = Run::default();
    let system = rig.system().ok()?;
    let mut held = [0.0; 2];
    let mut total = [0.0; 2];
    let mut hold = |kind: usize, interval: [f64; 2], truth: f64| {
        total[kind] += 1.0;
        held[kind] += f64::from(u8::from((interval[0]..=interval[1]).contains(&truth)));
    };
    let scaled = found.summary().unscaled.is_none();
    for p in found.estimate().parameters().filter(|_| scaled) {
        let truth = system.matrix(p.parameter.matrix())[(p.parameter.row(), p.parameter.column())];
        hold(0, p.interval(0.95).ok()?, truth);
    }
    for (at, mode) in found.summary().modes.iter().enumerate() {
        let (hz, ratio) = (rig.frequencies_hz[at], rig.damping_ratios[at]);
        hold(1, mode.row.natural_frequency_hz.interval?, hz);
        hold(1, mode.row.damping_ratio.interval?, ratio);
        run.damping.push(mode.row.damping_ratio.value / ratio - 1.0);
    }
    run.holding = [held[0] / total[0], held[1] / total[1]];
    run.warned =
        f64::from(u8::from(found.summary().checks.iter().any(|check| check.is_conspicuous())));
    Some(run)
}
