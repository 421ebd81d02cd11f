//! Records shorter than a period: windows of a steady state under a random force with a far longer
//! period. The steady state is known in closed form at every line.

use std::f64::consts::TAU;

use mechid_estimate::frequency_domain::{OutputErrorFit, output_error};
use mechid_estimate::{EstimateError, Unknowns};
use mechid_model::{ResponseQuantity, Sdof, SecondOrderSystem};
use mechid_problems::RandomTest;
use mechid_signal::{NoiseLevel, Sampling, lines, noise};
use mechid_spectra::FrequencyData;
use nalgebra::dmatrix;
use rayon::prelude::*;

const SAMPLES: usize = 2048;
/// Ratio of the RMS of the noise to that of the response.
const LEVEL: f64 = 0.01;

/// Returns the test of an oscillator with 10 kg and a natural frequency of a twentieth of the
/// sampling rate.
fn one(damping_ratio: f64, quantity: ResponseQuantity) -> RandomTest {
    let omega = TAU * 25.0;
    let oscillator =
        Sdof::new(10.0, 2.0 * damping_ratio * 10.0 * omega, 10.0 * omega * omega).unwrap();
    test(oscillator.system(), quantity)
}

/// Two masses and two forces; only the mass matrix is symmetric.
fn two() -> RandomTest {
    let mass = dmatrix![10.0, 0.0; 0.0, 8.0];
    let damping = dmatrix![30.0, -8.0; -12.0, 25.0];
    let stiffness = dmatrix![2.5e5, -0.9e5; -1.1e5, 3.0e5];
    let system = SecondOrderSystem::new(mass, damping, stiffness).unwrap();
    test(system, ResponseQuantity::Displacement)
}

fn test(system: SecondOrderSystem, quantity: ResponseQuantity) -> RandomTest {
    let sampling = Sampling::new(0.002, SAMPLES).unwrap();
    RandomTest { system, sampling, quantity, force: 100.0 }
}

/// Spectra of a noisy record on the lines up to 120 of 250 Hz.
fn data(rig: &RandomTest, seed: u64) -> FrequencyData {
    let [force, response] = rig.measure(seed).unwrap();
    let level = NoiseLevel::FractionOfRms(LEVEL);
    let response = noise::add_white(&response, level, seed + 100_000).unwrap();
    let band = lines::band(force.sampling(), 3.0, 120.0);
    FrequencyData::from_records(&force, &response, rig.quantity, band).unwrap()
}

fn fit(rig: &RandomTest, seed: u64) -> Result<OutputErrorFit, EstimateError> {
    let unknowns = Unknowns::unknown_mass(rig.system.dof())?;
    output_error(&data(rig, seed).as_open_record(rig.sampling), &unknowns)
}

/// Returns the share of 95 % intervals that contain the truth in these runs, for the worst
/// parameter and for all parameters together, and the ratio of the RMS error of each parameter to
/// its mean standard error.
fn judge(rig: &RandomTest, runs: u64) -> ([f64; 2], Vec<f64>) {
    let fits: Vec<_> = (0..runs).into_par_iter().map(|seed| fit(rig, seed).unwrap()).collect();
    let free = Unknowns::unknown_mass(rig.system.dof()).unwrap().free();
    let (mut worst, mut all, mut ratios) = (1.0f64, 0.0, Vec::new());
    for (at, entry) in free.iter().enumerate() {
        let truth = rig.system.matrix(entry.matrix())[(entry.row(), entry.column())];
        let values: Vec<_> =
            fits.iter().map(|fit| fit.estimate.parameters().nth(at).unwrap()).collect();
        let held = values.iter().filter(|p| {
            let [low, high] = p.interval(0.95).unwrap();
            (low..=high).contains(&truth)
        });
        let share = held.count() as f64 / runs as f64;
        (worst, all) = (worst.min(share), all + share / free.len() as f64);
        let rms = |of: &dyn Fn(usize) -> f64| {
            ((0..values.len()).map(|k| of(k).powi(2)).sum::<f64>() / runs as f64).sqrt()
        };
        ratios.push(rms(&|k| values[k].value - truth) / rms(&|k| values[k].standard_error));
    }
    ([worst, all], ratios)
}

/// The intervals of an open record have the stated coverage for any damping and any response
/// quantity. The probability that fewer than 85 % of 60 intervals of 95 %, or fewer than 80 % of
/// 40, contain the truth is 0.001. Standard deviations of 40 runs have an uncertainty of 11 %.
#[test]
fn intervals_hold_whatever_the_damping_and_the_quantity() {
    let of = |damping_ratio, kind, runs, least: f64| {
        let ([worst, _], ratios) = judge(&one(damping_ratio, kind), runs);
        assert!(worst >= least, "{damping_ratio} {kind}: {worst}");
        assert!(
            ratios.iter().all(|r| (0.75..1.3).contains(r)),
            "{damping_ratio} {kind}: {ratios:?}"
        );
    };
    of(0.001, ResponseQuantity::Displacement, 60, 0.85);
    of(0.1, ResponseQuantity::Displacement, 40, 0.8);
    for kind in [ResponseQuantity::Velocity, ResponseQuantity::Acceleration] {
        of(0.01, kind, 40, 0.8);
    }
}

#[test]
fn intervals_hold_with_two_forces_at_a_time() {
    let ([worst, all], ratios) = judge(&two(), 40);
    assert!(worst >= 0.8 && all >= 0.92, "{worst} {all}");
    assert!(ratios.iter().all(|r| (0.65..1.4).contains(r)), "{ratios:?}");
}

/// With 0.1 % damping the response decays over 6,400 samples. If the record is treated as a period,
/// its transient makes the error of the damping more than 20 times as large as in a fit of an open
/// record.
#[test]
fn a_record_taken_as_a_period_misleads() {
    let rig = one(0.001, ResponseQuantity::Displacement);
    let (truth, unknowns) = (rig.system.damping()[(0, 0)], Unknowns::unknown_mass(1).unwrap());
    let error = |data: &FrequencyData| {
        output_error(data, &unknowns).unwrap().estimate.damping()[(0, 0)] / truth - 1.0
    };
    let rms =
        |errors: Vec<f64>| (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
    let all = |of: &(dyn Fn(FrequencyData) -> FrequencyData + Sync)| -> f64 {
        rms((0..6).into_par_iter().map(|seed| error(&of(data(&rig, seed)))).collect())
    };
    let (period, open) = (all(&|data| data), all(&|data| data.as_open_record(rig.sampling)));
    assert!(period > 20.0 * open, "{period} {open}");
}

/// Each entry is identified from records without noise, with an error below 10⁻⁴ of the largest
/// entry of its matrix. The error is not zero, because the transient loads do not describe the part
/// of the transient that is aliased from above half the sampling rate.
#[test]
fn records_without_noise_are_fitted_but_for_aliases_of_their_ends() {
    let rig = two();
    let record = |seed: u64, len: usize| {
        let [force, response] = rig.period(seed).unwrap().map(|all| all.window(400, len).unwrap());
        let band = lines::band(force.sampling(), 3.0, 190.0);
        let data = FrequencyData::from_records(&force, &response, rig.quantity, band).unwrap();
        data.as_open_record(force.sampling())
    };
    let records = [record(1, 1500), record(2, 1100)];
    let data = records[0].and(&records[1]).unwrap();
    let fit = output_error(&data, &Unknowns::unknown_mass(2).unwrap()).unwrap();
    for p in fit.estimate.parameters() {
        let matrix = rig.system.matrix(p.parameter.matrix());
        let error = (p.value - matrix[(p.parameter.row(), p.parameter.column())]).abs();
        assert!(error < 1e-4 * matrix.amax(), "{}: {error:e}", p.parameter);
    }
    // The transient has 24 loads: two records × six powers × two degrees of freedom.
    let ends = fit.ends.unwrap();
    assert_eq!(ends.len(), 24);
    assert!(ends.p_value() < 1e-12 && ends.share > 1e-4, "{ends:?}");
    // After the transient is subtracted, the lines are those of a periodic response.
    let closed = ends.without_transients(&records).unwrap();
    let again =
        output_error(&closed[0].and(&closed[1]).unwrap(), &Unknowns::unknown_mass(2).unwrap())
            .unwrap();
    let gap = (again.estimate.stiffness() - fit.estimate.stiffness()).amax();
    assert!(again.ends.is_none() && gap < 1e-5 * rig.system.stiffness().amax(), "{gap:e}");
}
