//! Tests of a multisine against its definition.

use std::f64::consts::TAU;

use mechid_signal::{Multisine, Phases, Sampling, SignalError, Spectrum, lines};
use proptest::prelude::*;

/// Multisines with any lines, amplitudes and phases, each with a number of samples whose Nyquist
/// line is above the last line.
fn any_multisine() -> impl Strategy<Value = (Multisine, usize)> {
    let line = (any::<bool>(), 0.0..10.0f64, -4.0..4.0f64);
    (prop::collection::vec(line, 1..80), 0usize..50).prop_filter_map("no line", |(spec, extra)| {
        let chosen: Vec<_> = spec.iter().enumerate().filter(|(_, (on, ..))| *on).collect();
        let lines = chosen.iter().map(|(k, _)| k + 1).collect();
        let amplitudes = chosen.iter().map(|(_, (_, a, _))| *a).collect();
        let phases = chosen.iter().map(|(_, (_, _, p))| *p).collect();
        let m = Multisine::new(lines, amplitudes, Phases::Given(phases)).ok()?;
        Some((m, 2 * spec.len() + 1 + extra))
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn fast_sampling_is_the_sum_of_cosines((m, len) in any_multisine()) {
        let s = Sampling::new(0.02, len).unwrap();
        let record = m.sample(s).unwrap();
        let scale = m.amplitudes().iter().sum::<f64>().max(1.0);
        for (t, x) in s.times().zip(record.channel(0)) {
            // Phases of up to 80·2π have a rounding error of about 80·2π·ε.
            prop_assert!((x - m.value(t, s.omega0())).abs() < 1e-12 * scale);
        }
    }

    #[test]
    fn the_spectrum_is_what_was_asked((m, len) in any_multisine()) {
        let s = Sampling::new(0.02, len).unwrap();
        let spectrum = Spectrum::from_record(&m.sample(s).unwrap());
        let scale = m.amplitudes().iter().fold(1.0_f64, |a, b| a.max(*b));
        let mut asked = vec![(0.0, 0.0); s.lines()];
        for ((n, a), p) in m.lines().iter().zip(m.amplitudes()).zip(m.phases()) {
            asked[*n] = (a * p.cos(), a * p.sin());
        }
        for (n, (re, im)) in asked.into_iter().enumerate() {
            let got = spectrum.line(n, 0);
            prop_assert!((got.re - re).abs() < 1e-12 * scale && (got.im - im).abs() < 1e-12 * scale);
        }
    }

    #[test]
    fn periodic_and_with_the_rms_of_its_amplitudes((m, len) in any_multisine(), t in -50.0..50.0f64) {
        let s = Sampling::new(0.02, len).unwrap();
        let scale = m.amplitudes().iter().sum::<f64>().max(1.0);
        let again = m.value(t + s.duration(), s.omega0());
        // t = 50 is up to 2500 periods, so that ω0·t has an error of 2500·2π·ε, and the phase of
        // line 80 has 80 times this error.
        prop_assert!((m.value(t, s.omega0()) - again).abs() < 1e-8 * scale);
        let record = m.sample(s).unwrap();
        let rms = (record.column(0).norm_squared() / len as f64).sqrt();
        prop_assert!((rms - m.rms()).abs() <= 1e-12 * scale);
    }

    #[test]
    fn back_from_the_spectrum((m, len) in any_multisine()) {
        let s = Sampling::new(0.02, len).unwrap();
        let record = m.sample(s).unwrap();
        let again = Multisine::from_spectrum(&Spectrum::from_record(&record), 0).unwrap();
        let scale = m.amplitudes().iter().sum::<f64>().max(1.0);
        let difference = (again.sample(s).unwrap().data() - record.data()).amax();
        prop_assert!(difference < 1e-12 * scale);
    }
}

#[test]
fn crest_factors_by_hand() {
    let crest = |lines: Vec<usize>, p| Multisine::flat(lines, 3.0, p).unwrap().crest_factor();
    assert!((crest(vec![7], Phases::Zero).unwrap() - f64::sqrt(2.0)).abs() < 1e-12);
    // The sum of N cosines in phase has the peak N A and the RMS value A √(N/2).
    let zero = crest(lines::all(32), Phases::Zero).unwrap();
    assert!((zero - f64::sqrt(64.0)).abs() < 1e-12, "{zero}");
    let silent = Multisine::flat(1..=3, 0.0, Phases::Zero).unwrap();
    assert_eq!(silent.crest_factor(), Err(SignalError::Silent { channel: 0 }));
}

/// Checks the crest factors of 127 flat lines: below 1.75 for Schroeder's phases, below 2.2 for his
/// two-valued phases, and from 3.0 to 3.6 for random phases.
#[test]
fn schroeder_phases_keep_the_peak_low() {
    let crest = |p| Multisine::flat(1..=127, 1.0, p).unwrap().crest_factor().unwrap();
    assert!(crest(Phases::Schroeder) < 1.75, "{}", crest(Phases::Schroeder));
    assert!(crest(Phases::SchroederBinary) < 2.2, "{}", crest(Phases::SchroederBinary));
    // With random phases the signal is like Gaussian noise; its crest factor scatters around √(2 ln
    // 254) = 3.3.
    let mut random: Vec<f64> = (0..21).map(|seed| crest(Phases::Random { seed })).collect();
    random.sort_by(f64::total_cmp);
    assert!((3.0..3.6).contains(&random[10]), "{random:?}");
}

#[test]
fn levels_can_be_set() {
    let m = Multisine::flat(1..=20, 1.0, Phases::Schroeder).unwrap();
    assert!((m.clone().with_rms(7.0).unwrap().rms() - 7.0).abs() < 1e-13);
    assert!((m.clone().with_peak(7.0).unwrap().peak() - 7.0).abs() < 1e-13);
    assert_eq!(m.with_rms(-1.0), Err(SignalError::Negative { what: "RMS value", value: -1.0 }));
}

#[test]
fn value_keeps_its_digits_after_many_periods() {
    let m = Multisine::flat([1, 100], 1.0, Phases::Zero).unwrap();
    // With ω0 = 2π, whole seconds are exactly whole periods.
    assert_eq!(m.value(1e6, TAU), 2.0);
}

#[test]
fn impossible_multisines_are_refused_with_their_numbers() {
    let flat = |lines: Vec<usize>, a| Multisine::flat(lines, a, Phases::Zero).unwrap_err();
    assert_eq!(flat(vec![], 1.0), SignalError::NoLines);
    assert_eq!(flat(vec![0, 1], 1.0), SignalError::Line { line: 0, highest: Multisine::MAX_LINE });
    assert!(matches!(flat(vec![usize::MAX], 1.0), SignalError::Line { .. }));
    assert_eq!(flat(vec![2, 2], 1.0), SignalError::LineOrder { previous: 2, line: 2 });
    assert_eq!(flat(vec![1], -1.0), SignalError::Negative { what: "amplitude", value: -1.0 });
    assert!(matches!(flat(vec![1], f64::NAN), SignalError::Negative { .. }));
    let too_large = flat(vec![1, 2], f64::MAX);
    assert!(matches!(too_large, SignalError::Negative { what: "sum of all amplitudes", .. }));
    let large = Multisine::flat([1, 2], 1e200, Phases::Schroeder).unwrap();
    let crest = |m: &Multisine| m.crest_factor().unwrap();
    assert!((crest(&large) - crest(&large.clone().with_rms(1e-200).unwrap())).abs() < 1e-12);
    assert!(large.with_rms(f64::MAX).is_err());
    let wrong = Multisine::new(vec![1, 2], vec![1.0], Phases::Zero);
    assert_eq!(wrong, Err(SignalError::PerLine { what: "amplitudes", lines: 2, got: 1 }));
    let m = Multisine::flat([1, 4], 1.0, Phases::Zero).unwrap();
    let sampled = m.sample(Sampling::new(0.1, 8).unwrap());
    assert_eq!(sampled, Err(SignalError::Nyquist { line: 4, len: 8 }));
    assert!(m.sample(Sampling::new(0.1, 9).unwrap()).is_ok());
}
