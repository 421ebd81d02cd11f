//! Free decays that are not a sum of decaying oscillations, and free decays that are.

use std::f64::consts::{PI, TAU};

use mechid_analysis::modes::ModalTest;
use mechid_analysis::{
    Channels, DecaySettings, Decayed, Measurement, ModesSettings, ResponseQuantity, decay, modes,
};
use mechid_signal::{Sampling, noise};

fn measured(sampling: Sampling, exact: Vec<f64>, level: f64, seed: u64) -> Measurement {
    let noise = noise::white(sampling, 1, level, seed).unwrap();
    let x: Vec<f64> = exact.iter().zip(noise.channel(0)).map(|(x, e)| x + e).collect();
    let channels = Channels::from_responses(ResponseQuantity::Displacement, "x");
    Measurement::from_columns(sampling, &[("x", x.as_slice())], &channels).unwrap()
}

fn analysed(sampling: Sampling, exact: Vec<f64>, level: f64, seed: u64) -> Decayed {
    decay(&measured(sampling, exact, level, seed), &DecaySettings::default()).unwrap()
}

fn told(found: &Decayed, words: &str) -> bool {
    found.summary().remarks.iter().any(|remark| remark.contains(words))
}

/// Solution of ẍ = f(x, ẋ) from rest at `first`, by the Runge–Kutta method with 50 steps per
/// sample.
fn solved(sampling: Sampling, first: f64, force: impl Fn(f64, f64) -> f64) -> Vec<f64> {
    const STEPS: usize = 50;
    let h = sampling.dt() / STEPS as f64;
    let slope = |[x, v]: [f64; 2]| [v, force(x, v)];
    let moved = |[x, v]: [f64; 2], [dx, dv]: [f64; 2], h: f64| [x + h * dx, v + h * dv];
    let mut state = [first, 0.0];
    let mut samples = Vec::new();
    for _ in 0..sampling.len() {
        samples.push(state[0]);
        for _ in 0..STEPS {
            let k1 = slope(state);
            let k2 = slope(moved(state, k1, 0.5 * h));
            let k3 = slope(moved(state, k2, 0.5 * h));
            let k4 = slope(moved(state, k3, h));
            let mean = [0, 1].map(|at| (k1[at] + 2.0 * (k2[at] + k3[at]) + k4[at]) / 6.0);
            state = moved(state, mean, h);
        }
    }
    samples
}

/// The oscillator ẍ + 2·0.005 ω ẋ + 3 |ẋ| ẋ + ω² x = 0: the mean power of the drag gives ζ(a) =
/// 0.005 + 4·3 a/(3π) at the amplitude a.
#[test]
fn quadratic_drag_is_damping_over_amplitude() {
    let sampling = Sampling::from_rate_hz(100.0, 1200).unwrap();
    let omega = TAU * 3.0;
    let drag = |x: f64, v: f64| -0.01 * omega * v - 3.0 * v.abs() * v - omega * omega * x;
    let found = analysed(sampling, solved(sampling, 0.05, drag), 2e-5, 1);
    let backbone = found.summary().backbone.as_ref().unwrap();
    assert!(backbone.modes.len() > 1, "{found}");
    assert!(told(&found, "does not fall exponentially"), "{found}");
    for point in &backbone.points {
        let zeta = 0.005 + 4.0 * point.amplitude / PI;
        let off = point.damping_ratio.value - zeta;
        let error = point.damping_ratio.standard_error.unwrap();
        // The formula for ζ(a) itself has an error of the order of ζ².
        assert!(off.abs() < 4.0 * error + 1.5 * zeta * zeta, "{found}");
        assert!(error < 0.1 * zeta, "{found}");
        let frequency = point.frequency_hz.value;
        assert!((frequency / 3.0 - 1.0).abs() < 0.004, "{found}");
    }
    let [first, last] = [0, backbone.points.len() - 1].map(|at| backbone.points[at].amplitude);
    assert!(first > 0.035 && last < 0.01, "{found}");
}

/// The oscillator ẍ + 2·0.01 ω ẋ + ω² x (1 + κ x²) = 0 has the frequency ω (1 + 3/8 κ a²) at the
/// amplitude a, to first order.
#[test]
fn a_duffing_oscillator_is_frequency_over_amplitude() {
    let sampling = Sampling::from_rate_hz(200.0, 2000).unwrap();
    let (omega, kappa) = (TAU * 5.0, 0.1);
    let cubic = |x: f64, v: f64| -0.02 * omega * v - omega * omega * x * (1.0 + kappa * x * x);
    let found = analysed(sampling, solved(sampling, 1.0, cubic), 1e-3, 2);
    let backbone = found.summary().backbone.as_ref().unwrap();
    for point in &backbone.points {
        let square = point.amplitude * point.amplitude;
        // The damping ratio of 1 % lowers the frequency to 0.99995 of the undamped one.
        let exact = 5.0 * (0.99995 + 0.375 * kappa * square);
        let error = point.frequency_hz.standard_error.unwrap();
        let off = (point.frequency_hz.value - exact).abs();
        assert!(off < 4.0 * error + 5.0 * 0.1 * (kappa * square).powi(2), "{exact}: {found}");
        assert!(error < 0.01, "{found}");
    }
    assert!(told(&found, "does not fall exponentially"), "{found}");
}

/// Sum of decays, each given by frequency, damping ratio and amplitude.
fn decays(sampling: Sampling, modes: &[[f64; 3]]) -> Vec<f64> {
    let value = |t: f64| {
        let each = modes.iter().map(|[hz, zeta, size]| {
            let omega = TAU * hz;
            size * (-zeta * omega * t).exp() * (omega * (1.0 - zeta * zeta).sqrt() * t).cos()
        });
        each.sum::<f64>()
    };
    sampling.times().map(value).collect()
}

#[test]
fn linear_decays_have_no_backbone_no_harmonic_and_no_second_hit() {
    let sampling = Sampling::from_rate_hz(200.0, 1000).unwrap();
    let sets: [&[[f64; 3]]; 4] = [
        &[[5.0, 0.01, 1.0]],
        &[[5.0, 0.01, 1.0], [17.0, 0.02, 0.5]],
        // The next case has two close modes. The last case has two modes with nearly equal
        // frequencies.
        &[[5.0, 0.01, 1.0], [5.1, 0.008, 0.7]],
        &[[5.0, 0.004, 1.0], [5.05, 0.02, 0.8], [23.0, 0.01, 0.4]],
    ];
    let mut false_alarms = 0;
    for (modes, seed) in sets.into_iter().flat_map(|set| (0..15).map(move |seed| (set, seed))) {
        let found = analysed(sampling, decays(sampling, modes), 0.01, seed);
        let summary = found.summary();
        let is_wrong = summary.backbone.is_some()
            || summary.excited_again_s.is_some()
            || summary.modes.iter().any(|mode| mode.harmonic.is_some());
        false_alarms += u32::from(is_wrong);
    }
    // With a rate of 2 %, 1.2 false alarms in 60 records are expected.
    assert!(false_alarms <= 1, "{false_alarms}");
}

#[test]
fn a_light_decay_is_used_from_its_first_crest() {
    let sampling = Sampling::from_rate_hz(50.0, 825).unwrap();
    let found = analysed(sampling, decays(sampling, &[[0.42, 0.0027, 1.0]]), 0.005, 3);
    assert!(found.summary().first_sample < 50, "{found}");
    let damping = found.summary().modes[0].mode.row.damping_ratio;
    assert!((damping.value - 0.0027).abs() < 4.0 * damping.standard_error.unwrap(), "{found}");
    assert!(damping.standard_error.unwrap() < 1e-4, "{found}");
}

#[test]
fn what_is_no_decaying_oscillation_is_said() {
    let sampling = Sampling::from_rate_hz(200.0, 2000).unwrap();
    let refused = |exact: Vec<f64>, level: f64| {
        let measured = measured(sampling, exact, level, 4);
        decay(&measured, &DecaySettings::default()).unwrap_err().to_string()
    };
    let grows = |t: f64| 0.01 * (0.02 * TAU * 5.0 * t).exp() * (TAU * 5.0 * t).cos();
    let told_of_growth = refused(sampling.times().map(grows).collect(), 1e-3);
    assert!(
        told_of_growth.contains("the response at 5.0") && told_of_growth.contains("grows"),
        "{told_of_growth}"
    );
    let returns = |t: f64| if t < 1.0 { 1.0 } else { (-3.0 * (t - 1.0)).exp() };
    let told_of_return = refused(sampling.times().map(returns).collect(), 2e-3);
    assert!(told_of_return.contains("does not oscillate: a decay of"), "{told_of_return}");
    let rate: f64 = told_of_return
        .split("a decay of ")
        .nth(1)
        .unwrap()
        .split(' ')
        .next()
        .unwrap()
        .parse()
        .unwrap();
    assert!((rate - 3.0).abs() < 0.05, "{told_of_return}");
}

#[test]
fn a_second_hit_and_the_largest_number_of_modes_are_said() {
    let sampling = Sampling::from_rate_hz(200.0, 1600).unwrap();
    let modes = [[5.0, 0.01, 1.0], [17.0, 0.02, 0.5]];
    let one = decays(sampling, &modes);
    let second = 600;
    let twice: Vec<f64> = (0..one.len())
        .map(|k| one[k] + if k < second { 0.0 } else { 0.6 * one[k - second] })
        .collect();
    let found = analysed(sampling, twice, 0.005, 5);
    let at = found.summary().excited_again_s.unwrap_or_else(|| panic!("{found}"));
    assert!((at - 3.0).abs() < 0.1, "{found}");
    let few = DecaySettings { max_modes: 1, ..DecaySettings::default() };
    let found = decay(&measured(sampling, one, 0.005, 6), &few).unwrap();
    assert!(told(&found, "as many modes were found as `max_modes` allows"), "{found}");
}

/// A second hit during the decay must be reported, even if both decays have the same phase. If
/// there is little noise, an autoregression then describes the record better than a decay does. The
/// response is the sum of the closed-form responses to the hits.
#[test]
fn hits_in_phase_are_said() {
    let sampling = Sampling::from_rate_hz(200.0, 3000).unwrap();
    let omega = TAU * 5.0;
    let struck = |hits: &[[f64; 2]], level: f64, seed: u64| {
        let response = |t: f64, [at, size]: [f64; 2]| {
            let after = t - at;
            if after < 0.0 {
                return 0.0;
            }
            size * (-0.01 * omega * after).exp() * (omega * after).sin()
        };
        let value = |t: f64| hits.iter().map(|hit| response(t, *hit)).sum::<f64>();
        let exact = sampling.times().map(value).collect();
        decay(&measured(sampling, exact, level, seed), &DecaySettings::default())
    };
    for (level, seed) in [1e-5, 1e-4, 1e-3, 1e-2].into_iter().zip(0..) {
        for [first, second, size] in [[0.0, 8.0, 1.0], [0.0, 6.0, 0.7], [0.5, 6.5, 0.7]] {
            let message = match struck(&[[first, 1.0], [second, size]], level, seed) {
                Err(error) => error.to_string(),
                Ok(found) => found.to_string(),
            };
            let at = message.split("excited again at about ").nth(1).unwrap_or_default();
            let at: f64 =
                at.split(' ').next().unwrap().parse().unwrap_or_else(|_| panic!("{message}"));
            assert!((at - second).abs() < 0.05, "{second} s: {message}");
        }
        for seed in 0..10 {
            let found = struck(&[[0.5, 1.0]], level, 10 + seed).unwrap();
            assert_eq!(found.summary().excited_again_s, None, "{found}");
        }
    }
}

/// The notes on several decays together are the same as the notes on each decay alone.
#[test]
fn decays_that_are_analysed_together_are_judged_one_by_one() {
    let sampling = Sampling::from_rate_hz(200.0, 1600).unwrap();
    let omega = TAU * 5.0;
    let cubic = |x: f64, v: f64| -0.02 * omega * v - omega * omega * x * (1.0 + 0.1 * x * x);
    let linear = |seed| measured(sampling, decays(sampling, &[[5.0, 0.01, 1.0]]), 1e-3, seed);
    let hardening = measured(sampling, solved(sampling, 1.0, cubic), 1e-3, 2);
    let mut struck = decays(sampling, &[[5.0, 0.01, 1.0], [17.0, 0.02, 0.5]]);
    let again = struck.clone();
    struck[600..].iter_mut().zip(again).for_each(|(x, second)| *x += 0.6 * second);
    let struck = measured(sampling, struck, 0.005, 5);
    let settings = ModesSettings {
        test: ModalTest::Decay { from_s: None, to_s: None },
        ..ModesSettings::default()
    };
    let notes = |records: &[Measurement]| {
        let found = modes(records, &settings).unwrap();
        let alone = found.summary().notes.iter().filter(|note| note.contains("analysed alone"));
        alone.cloned().collect::<Vec<_>>()
    };
    let right = notes(&[linear(4), linear(5)]);
    assert!(right.is_empty(), "{right:?}");
    let wrong = notes(&[linear(4), hardening, struck]);
    assert_eq!(wrong.len(), 2, "{wrong:?}");
    assert!(wrong[0].contains("does not fall exponentially"), "{wrong:?}");
    assert!(wrong[1].contains("excited again at about 3"), "{wrong:?}");
}
