//! Tests of the measures against their definitions.

use std::f64::consts::SQRT_2;

use mechid_signal::excitation::HalfSine;
use mechid_signal::measures::*;
use mechid_signal::{Multisine, Phases, Record, Sampling, SignalError, Spectrum, phases};
use nalgebra::DMatrix;
use proptest::prelude::*;

fn record(x: &[f64]) -> Record {
    Record::from_channel(Sampling::new(0.01, x.len()).unwrap(), x.to_vec()).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn autocorrelations_are_their_sums(x in prop::collection::vec(-10.0..10.0f64, 1..70)) {
        let n = x.len();
        let (circular, aperiodic) = (circular_autocorrelation(&x), aperiodic_autocorrelation(&x));
        for k in 0..n {
            let all: f64 = (0..n).map(|i| x[i] * x[(i + k) % n]).sum();
            let inside: f64 = (0..n - k).map(|i| x[i] * x[i + k]).sum();
            prop_assert!((circular[k] - all / n as f64).abs() < 1e-12);
            prop_assert!((aperiodic[k] - inside / n as f64).abs() < 1e-12);
        }
    }

    /// Checks the order of excitation against its definition: the largest order of an
    /// autocorrelation matrix that is regular.
    #[test]
    fn excitation_order_is_the_rank_of_the_autocorrelation_matrix(
        amplitudes in prop::collection::vec(prop_oneof![Just(0.0), 1.0..3.0f64], 1..8),
        offset in prop_oneof![Just(0.0), Just(1.0)],
    ) {
        let lines: Vec<usize> = (1..=amplitudes.len()).collect();
        let m = Multisine::new(lines, amplitudes, Phases::Random { seed: 1 }).unwrap();
        let sampled = m.sample(Sampling::new(0.1, 19).unwrap()).unwrap();
        let x: Vec<f64> = sampled.channel(0).iter().map(|v| v + offset).collect();
        let r = circular_autocorrelation(&x);
        prop_assume!(r[0] > 0.1);
        let matrix = DMatrix::from_fn(19, 19, |i, j| r[(19 + i - j) % 19]);
        // The weakest line has a power of 1/2, and the total power is at most 37; rounding errors
        // are 1e-15 of the total power.
        #[allow(clippy::disallowed_methods, reason = "mechid-signal has no linear algebra")]
        let rank = matrix.svd(false, false).rank(1e-6);
        let order = persistent_excitation_order(&Spectrum::from_record(&record(&x)), 0, 1e-9).unwrap();
        prop_assert_eq!(order, rank);
    }
}

#[test]
fn levels_by_hand() {
    let r = record(&[3.0, -4.0, 0.0, 5.0, 0.0]);
    assert_eq!((peak(r.channel(0)), rms(r.channel(0))), (5.0, f64::sqrt(10.0)));
    assert!((crest_factor(&r, 0).unwrap() - 5.0 / f64::sqrt(10.0)).abs() < 1e-15);
    let square = record(&[2.0, -2.0, 2.0, -2.0]);
    assert_eq!(crest_factor(&square, 0), Ok(1.0));
    assert!((relative_peak_factor(&square, 0).unwrap() - 1.0 / SQRT_2).abs() < 1e-15);
    assert_eq!(crest_factor(&record(&[0.0; 4]), 0), Err(SignalError::Silent { channel: 0 }));
    assert!(relative_peak_factor(&record(&[7.0; 4]), 0).is_err());
    assert_eq!((rms(&[]), peak(&[])), (0.0, 0.0));
}

/// Checks known values of Schroeder's two-valued sequence of 128 terms: side lobes below 0.15,
/// relative to the value at lag zero, and a relative peak factor of 1.47 for a multisine with these
/// phases. With Schroeder's phases the factor is 1.18.
#[test]
fn schroeders_binary_sequence() {
    let lines: Vec<usize> = (1..=128).collect();
    let beta: Vec<f64> = phases::schroeder_binary(&lines, 128).iter().map(|p| p.cos()).collect();
    let alpha = aperiodic_autocorrelation(&beta);
    assert!((alpha[0] - 1.0).abs() < 1e-14);
    let side_lobe = peak(&alpha[1..]);
    assert!((0.13..0.15).contains(&side_lobe), "{side_lobe}");
    let factor = |p: Phases| {
        let m = Multisine::flat(1..=127, 1.0, p).unwrap();
        relative_peak_factor(&m.sample(Sampling::new(1.0, 4096).unwrap()).unwrap(), 0).unwrap()
    };
    let figures = (factor(Phases::SchroederBinary), factor(Phases::Schroeder));
    assert!((figures.0 - 1.47).abs() < 0.02 && (figures.1 - 1.18).abs() < 0.02, "{figures:?}");
}

#[test]
fn flatness_by_hand() {
    let m = Multisine::new(vec![1, 2], vec![1.0, 2.0], Phases::Zero).unwrap();
    let spectrum = m.spectrum(Sampling::new(0.1, 9).unwrap()).unwrap();
    let flatness = |lines: std::ops::Range<usize>| spectral_flatness(&spectrum, 0, lines);
    // The powers 1 and 4 have a flatness of √4 / 2.5.
    assert!((flatness(1..3).unwrap() - 0.8).abs() < 1e-15);
    assert_eq!(flatness(1..4), Ok(0.0));
    assert_eq!(flatness(3..3), Err(SignalError::NoLines));
    assert_eq!(flatness(3..4), Err(SignalError::Silent { channel: 0 }));
    assert!(matches!(flatness(4..6), Err(SignalError::Range { value: 5.0, .. })));
}

/// Checks the 20 dB band of a half sine of duration d. The magnitude of the transform is F_max
/// (2d/π) |cos(π f d)| / |1 − (2 f d)²|. With increasing f, the magnitude first reaches a tenth of
/// the value for f = 0 at f d = 1.3033, found by bisection.
#[test]
fn effective_band_of_a_half_sine() {
    let s = Sampling::new(1e-5, 100_000).unwrap(); // lines every 1 Hz
    let blow = HalfSine::new(1.0, 0.0, 0.005).unwrap().sample(s).unwrap();
    let band = effective_band(&Spectrum::from_record(&blow), 0, 20.0).unwrap();
    let fall = |u: f64| (std::f64::consts::PI * u).cos().abs() / (1.0 - 4.0 * u * u).abs() - 0.1;
    let (mut low, mut high) = (1.0, 1.5);
    while high - low > 1e-9 {
        let middle = 0.5 * (low + high);
        if fall(middle) > 0.0 { low = middle } else { high = middle }
    }
    assert_eq!(band.low_hz, 1.0);
    // The tolerance is one line; the amplitude of line 1 is slightly below the value at zero.
    assert!((band.high_hz - low / 0.005).abs() <= 1.0, "{band:?}, {}", low / 0.005);
    let silent = Spectrum::from_record(&record(&[1.0; 8]));
    assert!(effective_band(&silent, 0, 20.0).is_err());
}
