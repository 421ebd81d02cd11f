//! What the excitations are chosen for.

use mechid_signal::excitation::Prbs;
use mechid_signal::{Multisine, Phases, Sampling};

/// (1/N) Σ x_n x_{n+k}, indices modulo N, term by term.
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

/// The multisine with the same flat lines: Σ cos over lines 1 … N−1 of 2N samples correlates as
/// A²/2 Σ cos(2π n k / 2N), which is −A²/2 at even and 0 at odd lags.
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
