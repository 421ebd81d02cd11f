//! Modes of a test that predict other records and reconstruct their forces; the reference is the
//! closed form.

use std::f64::consts::TAU;

use mechid_analysis::identify::Band;
use mechid_analysis::{
    AnalysisError, Channels, Measurement, ModalSystem, ModesSettings, Predict, Reconstruct,
    predict_with_modes, reconstruct_with_modes,
};
use mechid_model::ResponseQuantity::Displacement;
use mechid_signal::{NoiseLevel, Record, Sampling, Spectrum, measures, noise};
use nalgebra::{Complex, DMatrix};

use crate::modes::{FORCES, modes, plain, receptance};

type C = Complex<f64>;

const RATE_HZ: f64 = 256.0;
const SAMPLES: usize = 8192;

/// Two pulses of 30 and 50 Hz that last a tenth of a second; the force begins at zero.
fn pulses() -> Record {
    let pulse = |k: usize, at: f64, hz: f64| {
        let t = k as f64 / RATE_HZ - at;
        3.0 * (-(t / 0.05).powi(2)).exp() * (TAU * hz * t).cos()
    };
    let data = DMatrix::from_fn(SAMPLES, 2, |k, force| match force {
        0 => pulse(k, 2.0, 30.0),
        _ => pulse(k, 3.0, 50.0),
    });
    Record::new(Sampling::from_rate_hz(RATE_HZ, SAMPLES).unwrap(), data).unwrap()
}

/// Exact response to pulses. The response decays before the end of the record, so it equals the
/// periodic response.
fn response(forces: &Record) -> Record {
    let spectrum = Spectrum::from_record(forces);
    let mut lines = DMatrix::<C>::zeros(spectrum.len(), 4);
    for n in 0..spectrum.len() - 1 {
        let forces = spectrum.lines().row(n).transpose();
        let motion = receptance(C::new(0.0, spectrum.omega(n)), [1.0; 3]) * forces;
        lines.set_row(n, &motion.transpose());
    }
    Spectrum::from_lines(forces.sampling(), lines).unwrap().to_record().unwrap()
}

fn measurement(forces: &Record, motion: &Record) -> Measurement {
    let channels = Channels::new("f1,f2", Displacement, "x1,x2,x3,x4");
    let forced = ["f1", "f2"].into_iter().zip(0..).map(|(name, at)| (name, forces.channel(at)));
    let moved =
        ["x1", "x2", "x3", "x4"].into_iter().zip(0..).map(|(name, at)| (name, motion.channel(at)));
    let columns: Vec<(&str, &[f64])> = forced.chain(moved).collect();
    Measurement::from_columns(forces.sampling(), &columns, &channels).unwrap()
}

/// Root mean square of the ratios of error to stated standard error. In each ratio, the error and
/// the standard error are RMS values over a record.
fn ratio(pairs: impl IntoIterator<Item = (f64, f64)>) -> f64 {
    let squares: Vec<f64> =
        pairs.into_iter().map(|(error, stated)| (error / stated).powi(2)).collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

#[test]
fn predictions_and_forces_err_as_they_state() {
    let forces = pulses();
    let record = measurement(&forces, &response(&forces));
    let (mut predicted, mut found) = (Vec::new(), Vec::new());
    for seed in 0..6 {
        let system = ModalSystem::new(&modes(&plain([1.0; 3], seed))).unwrap();
        let prediction = predict_with_modes(&record, &system, &Predict::default()).unwrap();
        for channel in &prediction.summary().channels {
            assert!(channel.nrmse < 0.01, "{prediction}");
            predicted.push((channel.rmse, channel.standard_error.unwrap()));
        }
        assert!(prediction.to_string().contains("begins at rest"), "{prediction}");
        let how = Reconstruct { at_rest: true, ..Reconstruct::default() };
        let force = reconstruct_with_modes(&record, &system, &how, &mut |_| Ok(())).unwrap();
        assert!(force.to_string().contains("assumed to begin and end at rest"), "{force}");
        let difference = force.force().record().data() - forces.data();
        for (at, row) in force.summary().forces.iter().enumerate() {
            let error = measures::rms(difference.column(at).as_slice());
            assert!(error < 0.05 * measures::rms(forces.channel(at)), "{force}");
            found.push((error, row.standard_error.unwrap()));
        }
    }
    // The RMS ratio comes from 6 experiments with about 15 parameters each, so it scatters by about
    // a fifth of its value.
    assert!((0.5..2.0).contains(&ratio(predicted.iter().copied())), "{predicted:?}");
    assert!((0.5..2.0).contains(&ratio(found.iter().copied())), "{found:?}");
}

/// A record that begins during a decay: the motion at its start is fitted to the first samples.
#[test]
fn a_record_that_begins_in_motion_is_predicted_from_its_first_samples() {
    let forces = pulses();
    let motion = response(&forces);
    let from = (2.2 * RATE_HZ) as usize;
    let [forces, motion] = [forces, motion].map(|r| r.window(from, SAMPLES - from).unwrap());
    let record = measurement(&forces, &motion);
    let mut pairs = Vec::new();
    for seed in 0..6 {
        let system = ModalSystem::new(&modes(&plain([1.0; 3], seed))).unwrap();
        let at_rest = predict_with_modes(&record, &system, &Predict::default()).unwrap();
        assert!(at_rest.to_string().contains("`settle` fits this motion"), "{at_rest}");
        let settled = predict_with_modes(&record, &system, &Predict { settle: Some(64) }).unwrap();
        let channels = at_rest.summary().channels.iter().zip(&settled.summary().channels);
        for (rest, fitted) in channels {
            assert!(rest.nrmse > 0.1 && fitted.nrmse < 0.01, "{at_rest}\n{settled}");
            pairs.push((fitted.rmse, fitted.standard_error.unwrap()));
        }
    }
    assert!((0.5..2.0).contains(&ratio(pairs.iter().copied())), "{pairs:?}");
}

#[test]
fn one_of_the_forces_is_found_from_some_of_the_responses() {
    let both = pulses();
    let mut data = both.data().clone();
    data.column_mut(0).fill(0.0);
    let forces = Record::new(both.sampling(), data).unwrap();
    let record = measurement(&forces, &response(&forces));
    let system = ModalSystem::new(&modes(&plain([1.0; 3], 3))).unwrap();
    let json = serde_json::to_value(modes(&plain([1.0; 3], 3)).summary()).unwrap();
    assert_eq!(ModalSystem::from_json("table", json).unwrap(), system);
    assert_eq!(system.inputs.len(), FORCES.len());
    let how = Reconstruct { at_rest: true, ..Reconstruct::default().forced([2]) };
    let force = reconstruct_with_modes(&record, &system, &how, &mut |_| Ok(())).unwrap();
    let difference = force.force().record().data() - forces.data();
    assert_eq!(difference.column(0).amax(), 0.0);
    let error = measures::rms(difference.column(1).as_slice());
    assert!(error < 0.02 * measures::rms(forces.channel(1)), "{force}");
    for channel in &force.summary().channels {
        assert!(channel.unexplained.unwrap() < 0.02, "{force}");
    }
    // A force at the wrong position cannot explain the responses.
    let how = Reconstruct { at_rest: true, ..Reconstruct::default().forced([1]) };
    let wrong = reconstruct_with_modes(&record, &system, &how, &mut |_| Ok(())).unwrap();
    assert!(wrong.to_string().contains("the identified force leaves"), "{wrong}");
}

#[test]
fn what_modes_cannot_do_is_refused() {
    let forces = pulses();
    let record = measurement(&forces, &response(&forces));
    let system = ModalSystem::new(&modes(&plain([1.0; 3], 1))).unwrap();
    let refused = |how: Reconstruct| {
        reconstruct_with_modes(&record, &system, &how, &mut |_| Ok(())).unwrap_err().to_string()
    };
    let at_rest = Reconstruct { at_rest: true, ..Reconstruct::default() };
    let outside = at_rest.clone().band(Band { low_hz: 100.0, high_hz: 120.0 });
    assert!(refused(outside).contains("does not overlap the band of the modes"));
    assert!(refused(at_rest.forced([3])).contains('3'));
    let refused = |samples: usize| {
        let settle = Predict { settle: Some(samples) };
        predict_with_modes(&record, &system, &settle).unwrap_err().to_string()
    };
    assert!(refused(2).contains("do not determine the motion of all modes"), "{}", refused(2));
    assert!(refused(SAMPLES).contains("needs 2 to 8191"), "{}", refused(SAMPLES));
}

/// The same force results whether rest is stated or detected; a record that begins or ends in
/// motion is refused. Noise must not be mistaken for motion.
#[test]
fn rest_at_both_ends_is_detected() {
    let forces = pulses();
    let exact = response(&forces);
    let system = ModalSystem::new(&modes(&plain([1.0; 3], 4))).unwrap();
    let force = |record: &Measurement, at_rest: bool| {
        let how = Reconstruct { at_rest, ..Reconstruct::default() };
        reconstruct_with_modes(record, &system, &how, &mut |_| Ok(()))
    };
    for (level, seed) in [(0.0, 0), (1e-4, 1), (1e-3, 2), (1e-2, 3), (1e-2, 4), (0.1, 5)] {
        let motion = match level {
            0.0 => exact.clone(),
            _ => noise::add_white(&exact, NoiseLevel::FractionOfRms(level), seed).unwrap(),
        };
        let record = measurement(&forces, &motion);
        let [stated, detected] = [true, false].map(|at_rest| force(&record, at_rest).unwrap());
        assert_eq!(stated.force().record(), detected.force().record());
        assert!(detected.to_string().contains("begins and ends at rest"), "{detected}");
        let at = |seconds: f64| (seconds * RATE_HZ) as usize;
        for (from, to) in [(at(2.2), SAMPLES), (0, at(4.0))] {
            let [forces, motion] =
                [&forces, &motion].map(|record| record.window(from, to - from).unwrap());
            let error = force(&measurement(&forces, &motion), false).unwrap_err().to_string();
            assert!(error.contains("`at_rest`") && error.contains("moves at its beginning"));
        }
    }
}

/// The hammer strikes downwards, and the positive direction of the sensors is upwards. Modal masses
/// and reciprocity equal those of the same test with the hammer and the sensors in one direction.
#[test]
fn forces_against_the_direction_of_their_sensors_give_masses_and_reciprocity() {
    let forces = pulses();
    let motion = noise::add_white(&response(&forces), NoiseLevel::FractionOfRms(0.01), 3).unwrap();
    let downwards = Record::new(forces.sampling(), -forces.data()).unwrap();
    let mut first_downwards = forces.data().clone();
    first_downwards.column_mut(0).neg_mut();
    let first_downwards = Record::new(forces.sampling(), first_downwards).unwrap();
    let masses = |forces: &Record, places: [&str; 2]| -> Vec<f64> {
        let mut settings = ModesSettings { modes: Some(2), ..ModesSettings::default() };
        settings.band_hz = Some([10.0, 60.0]);
        settings.properties.reciprocal = true;
        settings.places.forces = places.map(str::to_owned).to_vec();
        settings.places.responses = ["1+Z", "2+Z", "3+Z", "4+Z"].map(str::to_owned).to_vec();
        let found = mechid_analysis::modes(&[measurement(forces, &motion)], &settings).unwrap();
        let masses: Vec<f64> =
            found.summary().modes.iter().map(|row| row.modal_mass.unwrap()).collect();
        let mut checks = found.summary().checks.iter();
        let passes = checks.all(|check| check.code != "driving_point" || check.passed);
        assert_eq!(passes, masses.iter().all(|mass| *mass > 0.0), "{found}");
        let reciprocity = found.summary().checks.iter().find(|check| check.code == "reciprocity");
        assert!(reciprocity.unwrap().passed, "{found}");
        masses
    };
    let upwards = masses(&forces, ["1+Z", "4+Z"]);
    let against = masses(&downwards, ["1-z", "4-Z"]);
    let mixed = masses(&first_downwards, ["1-Z", "4+z"]);
    assert!(masses(&forces, ["1-Z", "4-Z"]).iter().all(|mass| *mass < 0.0));
    assert_eq!(upwards.len(), 2);
    for (at, one) in upwards.iter().enumerate() {
        // The largest entry of each mass-normalised shape is 0.5/√kg, so the modal mass is 4 kg.
        assert!((one / 4.0 - 1.0).abs() < 0.01, "{upwards:?}");
        for other in [&against, &mixed] {
            assert!((one / other[at] - 1.0).abs() < 1e-6, "{upwards:?} {other:?}");
        }
    }
}

#[test]
fn forces_that_do_not_vary_are_refused() {
    let forces = pulses();
    let motion = response(&forces);
    let still = Record::new(forces.sampling(), forces.data().map(|_| 2.0)).unwrap();
    let settings = ModesSettings::default();
    let error = mechid_analysis::modes(&[measurement(&still, &motion)], &settings).unwrap_err();
    assert!(matches!(error, AnalysisError::IdleInputs), "{error}");
}

#[test]
fn records_with_other_columns_are_refused() {
    let forces = pulses();
    let both = measurement(&forces, &response(&forces));
    let channels = Channels::new("f1", Displacement, "x1,x2");
    let columns: Vec<(&str, &[f64])> =
        vec![("f1", forces.channel(0)), ("x1", forces.channel(1)), ("x2", forces.channel(0))];
    let fewer = Measurement::from_columns(forces.sampling(), &columns, &channels).unwrap();
    let settings = ModesSettings::default();
    let error = mechid_analysis::modes(&[both, fewer], &settings).unwrap_err().to_string();
    assert!(error.contains("has 1 column, but the first record has 2 columns"), "{error}");
}
