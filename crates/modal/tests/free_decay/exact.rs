//! Free decays, compared with exact sums of decaying oscillations.

use std::f64::consts::TAU;

use mechid_modal::free_decay::{FreeDecay, FreeDecayError, FreeDecayEstimate, free_decay};
use mechid_signal::SignalError;
use mechid_signal::{NoiseLevel, Record, Sampling, noise};

use crate::noisy::{Case, found_in_noise};

const CASE: Case = Case { modes: 2, channels: 2, noise: 0.01, coloured: false, close: false };

/// A few experiments check the number of modes, the coverage of the intervals, and the scatter; the
/// book (`studies/decays.md`) has the results of more experiments.
#[test]
fn intervals_hold_and_the_scatter_is_that_of_the_bound() {
    for (case, runs) in [
        (CASE, 40),
        (Case { modes: 5, channels: 4, ..CASE }, 6),
        (Case { noise: 0.05, close: true, ..CASE }, 20),
        (Case { coloured: true, ..CASE }, 20),
    ] {
        let outcome = case.run(runs);
        let name = case.name();
        assert!(outcome.right() >= 98.0, "{name}: {} %", outcome.right());
        // Tolerances: four standard deviations of a share of the runs, and of a root mean square
        // over the runs.
        let (share, rms) =
            (400.0 * (0.95f64 * 0.05 / runs as f64).sqrt(), 4.0 / (2.0 * runs as f64).sqrt());
        for coverage in outcome.coverage() {
            assert!((coverage - 95.0).abs() < share, "{name}: {coverage} %");
        }
        for scatter in outcome.scatter() {
            assert!((scatter - 1.0).abs() < rms, "{name}: {scatter} times the bound");
        }
        for rate in outcome.alarm_rates() {
            assert!(rate < 4.0, "{name}: {rate} % false alarms at 1 %");
        }
    }
}

#[test]
fn noise_alone_has_no_modes() {
    for coloured in [false, true] {
        assert_eq!(found_in_noise(2, coloured, 12), 0);
    }
}

/// Returns the sum of decaying cosines, one for each (Hz, damping ratio, amplitude, phase).
fn decays(sampling: Sampling, modes: &[[f64; 4]]) -> Vec<f64> {
    let value = |t: f64| {
        let one = |[hz, zeta, size, phase]: &[f64; 4]| {
            let omega = TAU * hz;
            let turn = omega * (1.0 - zeta * zeta).sqrt() * t + phase;
            size * (-zeta * omega * t).exp() * turn.cos()
        };
        modes.iter().map(one).sum()
    };
    sampling.times().map(value).collect()
}

fn found(sampling: Sampling, channels: &[Vec<f64>]) -> Result<FreeDecayEstimate, FreeDecayError> {
    free_decay(&Record::from_channels(sampling, channels).unwrap(), &FreeDecay::default())
}

/// Without noise, only rounding errors remain in the estimates.
#[test]
fn exact_decays_are_found_to_rounding() {
    let sampling = Sampling::new(1e-3, 1500).unwrap();
    let modes = [[12.0, 0.01, 1.0, 0.3], [40.0, 0.002, 0.5, -1.0], [130.0, 0.03, 0.2, 2.0]];
    let other = [[12.0, 0.01, -0.4, 0.3], [40.0, 0.002, 1.0, -1.0], [130.0, 0.03, 0.1, 2.0]];
    for unit in [1.0, 1e-170, 1e150] {
        let scaled = |modes: &[[f64; 4]]| -> Vec<f64> {
            decays(sampling, modes).into_iter().map(|x| unit * (x + 3.0)).collect()
        };
        let found = found(sampling, &[scaled(&modes), scaled(&other)]).unwrap();
        assert_eq!(found.modes().len(), 3, "{unit}");
        for (mode, truth) in found.modes().iter().zip(modes) {
            let pole = &mode.mode;
            assert!((pole.natural_frequency_hz.value / truth[0] - 1.0).abs() < 1e-10);
            assert!((pole.damping_ratio.value / truth[1] - 1.0).abs() < 1e-8);
            assert!(mode.decays());
        }
        let first = &found.modes()[0];
        assert!((first.mode.mode.shape()[1].re + 0.4).abs() < 1e-9);
        assert!((first.amplitude.value / unit - 1.0).abs() < 1e-9);
        assert!((first.phase - 0.3).abs() < 1e-9);
        assert!((found.channels()[0].offset / unit - 3.0).abs() < 1e-9);
        assert!(found.modes().iter().map(|m| m.energy_share).sum::<f64>() > 1.0 - 1e-12);
    }
}

/// The noise of each channel has its own level: the quiet channel determines the result.
#[test]
fn channels_count_by_their_own_noise() {
    let sampling = Sampling::new(1e-2, 600).unwrap();
    let x = decays(sampling, &[[4.0, 0.02, 1.0, 0.0]]);
    let quiet = noise::white(sampling, 2, 1.0, 3).unwrap();
    let add = |level: f64, c: usize| -> Vec<f64> {
        x.iter().zip(quiet.channel(c)).map(|(x, e)| x + level * e).collect()
    };
    let error = |channels: &[Vec<f64>]| {
        let found = found(sampling, channels).unwrap();
        found.modes()[0].mode.natural_frequency_hz.standard_error
    };
    let (alone, both) = (error(&[add(0.01, 0)]), error(&[add(0.01, 0), add(1.0, 1)]));
    assert!((both / alone - 1.0).abs() < 0.02, "{both} {alone}");
    let noisy = found(sampling, &[add(0.01, 0), add(1.0, 1)]).unwrap();
    let levels = noisy.channels().iter().map(|c| c.noise).collect::<Vec<_>>();
    assert!((levels[0] / 0.01 - 1.0).abs() < 0.1 && (levels[1] - 1.0).abs() < 0.1, "{levels:?}");
}

/// A hum that does not decay is distinguished from a mode and does not change the modes.
#[test]
fn a_steady_hum_does_not_decay() {
    let sampling = Sampling::new(1e-3, 2000).unwrap();
    let x = decays(sampling, &[[23.0, 0.01, 1.0, 0.0], [50.0, 0.0, 0.1, 1.0]]);
    let record = Record::from_channel(sampling, x).unwrap();
    let noisy = noise::add_white(&record, NoiseLevel::FractionOfRms(0.02), 5).unwrap();
    let found = free_decay(&noisy, &FreeDecay::default()).unwrap();
    let [mode, hum] = found.modes() else { panic!("{}", found.modes().len()) };
    assert!(mode.decays() && !hum.decays());
    assert!((hum.mode.natural_frequency_hz.value - 50.0).abs() < 0.01);
}

/// The requested number of modes is reported; a third mode, which the record does not have, has
/// little energy.
#[test]
fn the_number_of_modes_can_be_given() {
    let sampling = Sampling::new(1e-3, 800).unwrap();
    let x = decays(sampling, &[[23.0, 0.01, 1.0, 0.0], [60.0, 0.01, 0.5, 1.0]]);
    let record = Record::from_channel(sampling, x).unwrap();
    let noisy = noise::add_white(&record, NoiseLevel::FractionOfRms(0.02), 6).unwrap();
    for modes in 1..=3 {
        let settings = FreeDecay { modes: Some(modes), ..FreeDecay::default() };
        let found = free_decay(&noisy, &settings).unwrap();
        assert_eq!(found.modes().len(), modes);
        if modes == 3 {
            let least = found.modes().iter().map(|m| m.energy_share).fold(1.0, f64::min);
            assert!(least < 0.01, "{least}");
        }
    }
}

#[test]
fn what_is_no_free_decay_is_told() {
    let sampling = Sampling::new(1e-2, 500).unwrap();
    let growing = decays(sampling, &[[5.0, -0.01, 1.0, 0.0]]);
    assert!(matches!(found(sampling, &[growing]), Err(FreeDecayError::Grows { .. })));
    let fine = decays(sampling, &[[5.0, 0.01, 1.0, 0.0]]);
    let silent = found(sampling, &[fine.clone(), vec![2.0; 500]]);
    assert_eq!(silent, Err(FreeDecayError::SilentChannel { channel: 1, value: 2.0 }));
    let short = Sampling::new(1e-2, 8).unwrap();
    let few = FreeDecayError::Signal(SignalError::TooShort { samples: 8, needed: 13 });
    assert_eq!(found(short, &[fine[..8].to_vec()]), Err(few));
    let white = noise::white(sampling, 1, 1.0, 7).unwrap();
    let nothing = free_decay(&white, &FreeDecay::default());
    let Err(FreeDecayError::NoDecay { samples: 500, gained, needed }) = nothing else {
        panic!("{nothing:?}")
    };
    assert!(0.0 < gained && gained < needed);
    for modes in [0, 1000] {
        let settings = FreeDecay { modes: Some(modes), ..FreeDecay::default() };
        let refused = free_decay(&white, &settings);
        assert_eq!(refused, Err(FreeDecayError::NumberOfModes { modes, most: 40 }));
    }
}

/// Low modes at a high sampling rate need a long record. The modes must be found, although a square
/// Hankel matrix of this record would not fit into memory.
#[test]
fn low_modes_of_a_long_record_are_found() {
    let sampling = Sampling::new(1e-4, 30_000).unwrap();
    let x = decays(sampling, &[[7.0, 0.01, 1.0, 0.0], [7.4, 0.008, 0.7, 1.0]]);
    let record = Record::from_channel(sampling, x).unwrap();
    let noisy = noise::add_white(&record, NoiseLevel::FractionOfRms(0.05), 8).unwrap();
    let found = free_decay(&noisy, &FreeDecay::default()).unwrap();
    let hz: Vec<f64> = found.modes().iter().map(|m| m.mode.natural_frequency_hz.value).collect();
    assert!(hz.len() == 2 && (hz[0] - 7.0).abs() < 0.01 && (hz[1] - 7.4).abs() < 0.01, "{hz:?}");
}
