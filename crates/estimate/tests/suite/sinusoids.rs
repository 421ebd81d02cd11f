//! Detection of sinusoids in the responses of open records. No force causes these sinusoids, and
//! their frequencies and amplitudes are known.

use std::f64::consts::TAU;

use mechid_estimate::Unknowns;
use mechid_estimate::frequency_domain::{OutputErrorFit, output_error};
use mechid_model::{ResponseQuantity, Sdof, SecondOrderSystem};
use mechid_problems::{Fault, RandomTest};
use mechid_signal::noise::{self, Colour};
use mechid_signal::{NoiseLevel, Record, Sampling, lines};
use mechid_spectra::FrequencyData;
use nalgebra::dmatrix;
use rayon::prelude::*;

const SAMPLES: usize = 4096;
const DT: f64 = 0.002;

fn rig(quantity: ResponseQuantity) -> RandomTest {
    let mass = dmatrix![10.0, 0.0; 0.0, 8.0];
    let damping = dmatrix![30.0, -8.0; -12.0, 25.0];
    let stiffness = dmatrix![2.5e5, -0.9e5; -1.1e5, 3.0e5];
    let system = SecondOrderSystem::new(mass, damping, stiffness).unwrap();
    let sampling = Sampling::new(DT, SAMPLES).unwrap();
    RandomTest { system, sampling, quantity, force: 100.0 }
}

/// Returns the force, and the response with noise of 0.5 % of its RMS value.
fn noisy(rig: &RandomTest, seed: u64) -> [Record; 2] {
    let [force, response] = rig.measure(seed).unwrap();
    let level = NoiseLevel::FractionOfRms(0.005);
    [force, noise::add_white(&response, level, seed + 100_000).unwrap()]
}

fn fit(rig: &RandomTest, [force, response]: [&Record; 2]) -> OutputErrorFit {
    let band = lines::band(force.sampling(), 3.0, 190.0);
    let data = FrequencyData::from_records(force, response, rig.quantity, band).unwrap();
    let data = data.as_open_record(force.sampling());
    output_error(&data, &Unknowns::unknown_mass(rig.system.dof()).unwrap()).unwrap()
}

/// Returns the mean square of the parameter differences between two fits, each difference divided
/// by the standard error of `other`.
fn gap(one: &OutputErrorFit, other: &OutputErrorFit) -> f64 {
    let pairs = one.estimate.parameters().zip(other.estimate.parameters());
    let squares = pairs.map(|(a, b)| ((a.value - b.value) / b.standard_error).powi(2));
    squares.sum::<f64>() / one.estimate.parameters().len() as f64
}

/// Run-out adds two sinusoids to the response, between the lines. The fit finds both frequencies,
/// and its parameters agree with those of the fit to the record without run-out. The smallest
/// possible standard deviation of a frequency is √24 σ/(A N^1.5 Δt) rad/s, for amplitude A and
/// noise σ in N samples.
#[test]
fn run_out_between_lines_does_no_harm() {
    for quantity in ResponseQuantity::ALL {
        let rig = rig(quantity);
        let check = |seed: u64| {
            let [force, response] = noisy(&rig, seed);
            let rotation_hz = 23.7 + 0.013 * seed as f64;
            let run_out = Fault::RunOut { rotation_hz, amplitudes: vec![0.1, 0.0, 0.05] };
            let seen = run_out.apply(&response, seed).unwrap();
            let (without, with) = (fit(&rig, [&force, &response]), fit(&rig, [&force, &seen]));
            assert!(without.sinusoids.iter().all(Vec::is_empty), "{quantity} {seed}");
            let mut found = with.sinusoids[0].clone();
            found.sort_by(|a, b| a.omega().total_cmp(&b.omega()));
            assert_eq!(found.len(), 2, "{quantity} {seed}: {found:?}");
            for (sinusoid, (multiple, amplitude)) in found.iter().zip([(1.0, 0.1), (3.0, 0.05)]) {
                let bound = 24_f64.sqrt() * 0.005 / (amplitude * (SAMPLES as f64).powf(1.5) * DT);
                let error = (sinusoid.omega() - TAU * multiple * rotation_hz).abs();
                assert!(error < 6.0 * bound, "{quantity} {seed}: {error} {bound}");
            }
            gap(&with, &without)
        };
        let gaps: Vec<f64> = (0..2_u64).into_par_iter().map(check).collect();
        // A sinusoid next to a resonance reduces the information of the neighbouring lines, so the
        // parameters with and without the sinusoids differ slightly.
        let gap = (gaps.iter().sum::<f64>() / gaps.len() as f64).sqrt();
        assert!(gap < 0.3, "{quantity}: {gap} standard errors");
    }
}

/// No sinusoid is reported in six records without sinusoids, even if the resonance has only 0.1 %
/// damping and is narrower than the line spacing. By chance, fewer than one in 20 such records has
/// a false report.
#[test]
fn records_without_sinusoids_have_none() {
    let light = Sdof::new(10.0, 2.0 * 0.001 * 10.0 * 157.0, 10.0 * 157.0 * 157.0).unwrap();
    let displacement = ResponseQuantity::Displacement;
    let light = RandomTest { system: light.system(), ..rig(displacement) };
    for rig in [rig(displacement), light] {
        let found = |seed: &u64| {
            let [force, response] = rig.measure(*seed).unwrap();
            let (sampling, channels) = (response.sampling(), response.channels());
            let size = 0.05 * response.column(0).variance().sqrt();
            let pink = Colour::PowerLaw { exponent: 1.0 };
            let noise = noise::coloured(sampling, channels, size, pink, *seed).unwrap();
            let seen = Record::new(sampling, response.data() + noise.data()).unwrap();
            fit(&rig, [&force, &seen]).sinusoids.iter().any(|found| !found.is_empty())
        };
        let found = (200..206_u64).into_par_iter().filter(found).count();
        assert_eq!(found, 0, "{:?}", rig.system.damping());
    }
}

/// A disturbance over ten lines is noise, and a sinusoid at a line of the force may be the response
/// of the machine: neither is reported as a sinusoid.
#[test]
fn what_is_no_sinusoid_is_not_taken_for_one() {
    let rig = rig(ResponseQuantity::Displacement);
    for seed in 0..2 {
        let [force, response] = noisy(&rig, seed);
        let spacing_hz = 1.0 / (SAMPLES as f64 * DT);
        let unit = response.column(0).variance().sqrt();
        // The disturbance is the sum of 80 cosines with random phases. Their frequencies are an
        // eighth of the line spacing apart and cover ten lines.
        let phases = noise::white(Sampling::new(1.0, 80).unwrap(), 1, 10.0, seed).unwrap();
        let disturbance = |t: f64| {
            let lines =
                phases.channel(0).iter().enumerate().map(|(k, phase)| {
                    (TAU * (40.0 + k as f64 * spacing_hz / 8.0) * t + phase).cos()
                });
            0.01 * unit * lines.sum::<f64>()
        };
        let mut data = response.data().clone();
        for (mut row, t) in data.row_iter_mut().zip(response.sampling().times()) {
            row.add_scalar_mut(disturbance(t));
        }
        let seen = Record::new(response.sampling(), data).unwrap();
        let found = fit(&rig, [&force, &seen]).sinusoids;
        assert!(found.iter().all(Vec::is_empty), "{seed}: {found:?}");

        let hum = |of: &Record, size: f64| {
            let size = size * of.column(0).variance().sqrt();
            let mut data = of.data().clone();
            for (mut row, t) in data.row_iter_mut().zip(of.sampling().times()) {
                row.add_scalar_mut(size * (TAU * 50.03 * t).cos());
            }
            Record::new(of.sampling(), data).unwrap()
        };
        let found = fit(&rig, [&hum(&force, 0.5), &hum(&response, 0.02)]).sinusoids;
        assert!(found.iter().all(Vec::is_empty), "{seed}: {found:?}");
    }
}
