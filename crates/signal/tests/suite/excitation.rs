//! Tests of the properties for which an excitation is chosen.

use mechid_signal::excitation::{HalfSine, Impulse, Prbs, Random, Sweep, SweepLaw};
use mechid_signal::{CrestSearch, Multisine, Phases, Record, Sampling, Spectrum, measures};

/// Returns (1/N) Σ x_n x_{n+k} with indices modulo N, summed term by term.
fn circular(x: &[f64], lag: usize) -> f64 {
    let n = x.len();
    (0..n).map(|k| x[k] * x[(k + lag) % n]).sum::<f64>() / n as f64
}

#[test]
fn prbs_autocorrelation_has_two_values() {
    for order in 2..=10 {
        let prbs = Prbs::new(order, 2.0, 1).unwrap();
        let record = prbs.sample(Sampling::new(0.1, prbs.period()).unwrap()).unwrap();
        let x = record.channel(0);
        assert_eq!(circular(x, 0), 4.0);
        for lag in 1..x.len() {
            let expected = -4.0 / x.len() as f64;
            // Sums of ±4 are exact; only the division rounds.
            assert!((circular(x, lag) - expected).abs() < 1e-15, "order {order}, lag {lag}");
        }
    }
}

/// Checks that a multisine of flat lines 1 … N−1 in 2N samples has the autocorrelation A²/2 Σ
/// cos(2π n k / 2N), which is −A²/2 at even lags and 0 at odd lags.
#[test]
fn flat_multisine_is_as_white_as_its_lines_allow() {
    let m = Multisine::flat(1..=127, 2.0, Phases::SchroederBinary).unwrap();
    let record = m.sample(Sampling::new(0.1, 256).unwrap()).unwrap();
    for lag in 1..256 {
        let expected = if lag % 2 == 0 { -2.0 } else { 0.0 };
        let got = circular(record.channel(0), lag);
        assert!((got - expected).abs() < 1e-11, "lag {lag}: {got}");
    }
}

/// Checks the table of the page studies/excitation.md of the book. A period has 1023 samples and
/// lasts 1 s, lines 1 to 400 are of interest, and the largest force is 1 N.
#[test]
fn excitations_side_by_side() {
    let s = Sampling::from_rate_hz(1023.0, 1023).unwrap();
    let multisine = |p| Multisine::flat(1..=400, 1.0, p).unwrap();
    let searched = CrestSearch { starts: 1, seed: 0 }.minimise(&multisine(Phases::Schroeder));
    let sweep = Sweep::new(1.0, 1.0, 400.0, 1.0, SweepLaw::Linear).unwrap();
    let log_sweep = Sweep::new(1.0, 1.0, 400.0, 1.0, SweepLaw::Logarithmic).unwrap();
    let random = Random::band_limited(1.0, 1.0, 400.0, 1).unwrap();
    let half_sine = HalfSine::new(1.0, 0.01, 0.002).unwrap();
    let rows = [
        ("searched phases", searched.unwrap().sample(s), (1.38, 1.0, 0.0514)),
        ("Schroeder", multisine(Phases::Schroeder).sample(s), (1.63, 1.0, 0.0434)),
        ("two-valued", multisine(Phases::SchroederBinary).sample(s), (2.11, 1.0, 0.0334)),
        ("random phases", multisine(Phases::Random { seed: 1 }).sample(s), (3.137, 1.0, 0.0225)),
        ("binary sequence", Prbs::new(10, 1.0, 1).unwrap().sample(s), (1.0, 1.0, 0.0626)),
        ("linear sweep", sweep.with_ramps(0.01).unwrap().sample(s), (1.43, 0.98, 0.0217)),
        ("log sweep", log_sweep.with_ramps(0.01).unwrap().sample(s), (1.44, 0.43, 0.0072)),
        ("random", random.sample(s), (3.46, 0.55, 0.0010)),
        ("burst random", random.burst(0.5).unwrap().sample(s), (4.87, 0.56, 0.0008)),
        ("half sine", half_sine.sample(s), (29.2, 0.92, 0.0014)),
        ("impulse", Impulse::new(1.0, 0.01).unwrap().sample(s), (32.0, 1.0, 0.0020)),
    ];
    for (name, record, (crest, flatness, weakest)) in rows {
        let got = figures(&record.unwrap());
        // The table prints the crest factor with three digits, the flatness with two decimals and
        // the weakest amplitude with four decimals.
        assert!((got.0 / crest - 1.0).abs() < 0.005, "{name}: crest factor {}", got.0);
        assert!((got.1 - flatness).abs() < 0.006, "{name}: flatness {}", got.1);
        assert!((got.2 - weakest).abs() < 0.0002, "{name}: weakest line {}", got.2);
    }
}

/// Returns the crest factor of the samples, the flatness of lines 1 to 400, and the smallest
/// amplitude of these lines for a peak of 1.
fn figures(record: &Record) -> (f64, f64, f64) {
    let spectrum = Spectrum::from_record(record);
    let flatness = measures::spectral_flatness(&spectrum, 0, 1..=400).unwrap();
    let weakest = (1..=400).map(|n| spectrum.line(n, 0).norm()).fold(f64::INFINITY, f64::min);
    let peak = measures::peak(record.channel(0));
    (measures::crest_factor(record, 0).unwrap(), flatness, weakest / peak)
}
