//! Free decays from record to result; the reference is an exact sum of decays.

use std::f64::consts::TAU;

use mechid_analysis::modes::ModalTest;
use mechid_analysis::{
    AnalysisError, Channels, DecaySettings, Decayed, Measurement, ModesSettings, ResponseQuantity,
    Window, decay, modes,
};
use mechid_signal::{Sampling, noise};
use serde_json::Value;

const RELEASE: f64 = 0.5;

/// Two channels at 500 Hz: a static pull until [`RELEASE`], then decays of a mode at 6 Hz with 1 %
/// damping and one at 30 Hz with 2 %.
fn record() -> (Sampling, [Vec<f64>; 2]) {
    let sampling = Sampling::from_rate_hz(500.0, 2000).unwrap();
    let noise = noise::white(sampling, 2, 2e-6, 4).unwrap();
    let channel = |at: usize, sizes: [f64; 2]| {
        let value = |(k, t): (usize, f64)| {
            let t = (t - RELEASE).max(0.0);
            let mode = |hz: f64, zeta: f64| {
                let (decay, omega) = (zeta * TAU * hz, TAU * hz * (1.0 - zeta * zeta).sqrt());
                (-decay * t).exp() * ((omega * t).cos() + decay / omega * (omega * t).sin())
            };
            let clean = sizes[0] * mode(6.0, 0.01) + sizes[1] * mode(30.0, 0.02);
            1e-3 + clean + noise.channel(at)[k]
        };
        sampling.times().enumerate().map(value).collect()
    };
    (sampling, [channel(0, [4e-4, 1e-4]), channel(1, [-2e-4, 1.5e-4])])
}

fn measurement() -> Measurement {
    let (sampling, [x, y]) = record();
    let channels = Channels::from_responses(ResponseQuantity::Displacement, "x,y");
    let columns = [("x", x.as_slice()), ("y", y.as_slice())];
    Measurement::from_columns(sampling, &columns, &channels).unwrap()
}

fn found(how: &DecaySettings) -> Decayed {
    decay(&measurement(), how).unwrap()
}

fn first_hz(found: &Decayed) -> f64 {
    found.summary().modes[0].mode.row.natural_frequency_hz.value
}

#[test]
fn modes_and_their_release_are_found() {
    let found = found(&DecaySettings::default());
    let summary = found.summary();
    assert_eq!(summary.modes.len(), 2);
    let begins = (summary.first_sample - 1) as f64 / summary.sample_rate_hz;
    assert!((RELEASE..RELEASE + 0.2).contains(&begins), "{begins}");
    for (row, (hz, zeta)) in summary.modes.iter().zip([(6.0_f64, 0.01_f64), (30.0, 0.02)]) {
        let [frequency, damping] = [row.mode.row.natural_frequency_hz, row.mode.row.damping_ratio];
        assert!((frequency.value - hz).abs() < 4.0 * frequency.standard_error.unwrap());
        assert!((damping.value - zeta).abs() < 4.0 * damping.standard_error.unwrap());
        assert!(row.decays);
    }
    assert!((summary.modes[0].mode.shape[1].value[0] + 0.5).abs() < 0.01);
    assert!((summary.channels[0].offset - 1e-3).abs() < 1e-6);
    assert!(summary.channels.iter().all(|c| c.explained > 0.99 && c.noise_order == 0));
    assert!(summary.remarks.is_empty(), "{:?}", summary.remarks);
    let text = found.to_string();
    assert!(text.contains("2 modes; ± is one standard error"), "{text}");
}

/// Two decays after different releases: each release hardly excites one of the two modes, and both
/// decays together give both modes. In 20 pairs of decays, 76 of the 80 intervals (95 %) of
/// frequency and damping ratio contain the true value on average, with a standard deviation of 2.
#[test]
fn several_decays_have_common_modes() {
    let truth = [(6.0_f64, 0.01_f64), (30.0, 0.02)];
    let sampling = Sampling::from_rate_hz(250.0, 1500).unwrap();
    let channels = Channels::from_responses(ResponseQuantity::Acceleration, "x,y");
    let shapes = [[1.0, -0.5], [0.4, 1.0]];
    let one = |sizes: [f64; 2], seed: u64| {
        let noise = noise::white(sampling, 2, 0.02, seed).unwrap();
        let channel = |at: usize| -> Vec<f64> {
            let value = |(k, t): (usize, f64)| {
                let t = t - RELEASE;
                let modes =
                    truth.iter().zip(sizes).zip(shapes).map(|(((hz, zeta), size), shape)| {
                        let omega = TAU * hz * (1.0 - zeta * zeta).sqrt();
                        size * shape[at] * (-zeta * TAU * hz * t).exp() * (omega * t).cos()
                    });
                let moves = if t < 0.0 { 0.0 } else { modes.sum() };
                moves + noise.channel(at)[k]
            };
            sampling.times().enumerate().map(value).collect()
        };
        let [x, y] = [channel(0), channel(1)];
        let columns = [("x", x.as_slice()), ("y", y.as_slice())];
        Measurement::from_columns(sampling, &columns, &channels).unwrap()
    };
    let settings = ModesSettings {
        test: ModalTest::Decay { from_s: None, to_s: None },
        ..ModesSettings::default()
    };
    let mut held = 0;
    for seed in 0..20 {
        let records = [one([1.0, 0.0], 2 * seed), one([0.0, 1.0], 2 * seed + 1)];
        let found = modes(&records, &settings).unwrap();
        let rows: Vec<_> = found.summary().modes.iter().map(|mode| &mode.mode).collect();
        assert_eq!(rows.len(), 2, "{seed}: {found}");
        for (at, (mode, (hz, zeta))) in rows.iter().zip(truth).enumerate() {
            let contains = |interval: Option<[f64; 2]>, value: f64| {
                usize::from(interval.is_some_and(|[low, high]| (low..=high).contains(&value)))
            };
            held += contains(mode.row.natural_frequency_hz.interval, hz);
            held += contains(mode.row.damping_ratio.interval, zeta);
            let other = mode.shape[1 - at].value[0];
            assert!((other - [-0.5, 0.4][at]).abs() < 0.05, "{seed}: {found}");
        }
    }
    assert!(held >= 70, "{held}");
    let (x, sampling) = (|t: f64| (0.5 * t).exp() * (TAU * 6.0 * t).sin(), sampling);
    let growing: Vec<f64> = sampling.times().map(x).collect();
    let columns = [("x", growing.as_slice()), ("y", growing.as_slice())];
    let growing = Measurement::from_columns(sampling, &columns, &channels).unwrap();
    let error = modes(&[one([1.0, 1.0], 1), growing], &settings).unwrap_err();
    assert!(matches!(error, AnalysisError::NoDecay { .. }), "{error}");
    let refused = ModesSettings { validate: 0.4, ..settings };
    let error = modes(&[measurement()], &refused).unwrap_err().to_string();
    assert!(error.contains("does not apply to free decays"), "{error}");
}

/// The settings in a result repeat the analysis, and unknown settings are refused.
#[test]
fn settings_are_saved_and_read_back() {
    let how = DecaySettings { from_s: Some(0.6), to_s: Some(3.0), ..DecaySettings::default() };
    let found = found(&how);
    let json: Value = serde_json::to_value(&found).unwrap();
    assert_eq!(json["first_sample"], 301);
    assert_eq!(json["last_sample"], 1500);
    let again: DecaySettings = serde_json::from_value(json["analysis"].clone()).unwrap();
    assert_eq!(again, how);
    assert!(serde_json::from_str::<DecaySettings>(r#"{"mode": 2}"#).is_err());
    assert_eq!(serde_json::from_str::<DecaySettings>("{}").unwrap(), DecaySettings::default());
    // The time of release counts from the start of the window.
    let window = Window { start: 101, ..Window::default() };
    let later = measurement().window(window).unwrap();
    let how = DecaySettings { from_s: Some(0.4), to_s: Some(2.8), ..DecaySettings::default() };
    assert_eq!(first_hz(&decay(&later, &how).unwrap()), first_hz(&found));
}

#[test]
fn what_speaks_against_a_fit_is_told() {
    let told = |how: DecaySettings, what: &str| {
        let remarks = found(&how).summary().remarks.clone();
        assert!(remarks.iter().any(|remark| remark.contains(what)), "{what}: {remarks:?}");
    };
    let from_s = Some(RELEASE);
    // With one mode too few the residual is coloured; it then looks like autoregressive noise.
    told(DecaySettings { modes: Some(1), from_s, ..DecaySettings::default() }, "coloured");
    // A start a hundredth of a second before the release gives a false mode, or a large residual.
    let early = DecaySettings { from_s: Some(RELEASE - 0.01), ..DecaySettings::default() };
    told(early, "hardly oscillates");
    told(DecaySettings { modes: Some(2), ..early }, "first samples");
    // The section has less than two cycles.
    let how = DecaySettings {
        from_s,
        to_s: Some(RELEASE + 0.25),
        modes: Some(2),
        ..DecaySettings::default()
    };
    told(how, "cycles in the record");
}

#[test]
fn what_cannot_be_analysed_is_refused() {
    let refused = |how: DecaySettings| decay(&measurement(), &how).unwrap_err().to_string();
    let default = DecaySettings::default();
    let outside = refused(DecaySettings { from_s: Some(9.0), ..default });
    assert_eq!(outside, "`from`: 9 s is not in the window, which is 4 s long");
    let nothing = refused(DecaySettings { from_s: Some(1.0), to_s: Some(1.0), ..default });
    assert_eq!(nothing, "`to`: it must be after `from`");
    assert!(refused(DecaySettings { from_s: Some(f64::NAN), ..default }).contains("NaN"));
    let period = decay(&measurement().period(100).unwrap(), &default);
    assert!(matches!(period, Err(AnalysisError::Setting { setting: "period", .. })));

    let (sampling, [x, y]) = record();
    let columns = [("x", x.as_slice()), ("v", y.as_slice())];
    let both = Channels::from_responses(ResponseQuantity::Displacement, "x")
        .and(ResponseQuantity::Velocity, "v");
    let both = Measurement::from_columns(sampling, &columns, &both).unwrap();
    let mixed = decay(&both, &default);
    assert!(matches!(mixed, Err(AnalysisError::Setting { setting: "response", .. })));
    let none = Measurement::from_columns(sampling, &columns, &Channels::default()).unwrap();
    assert!(matches!(decay(&none, &default), Err(AnalysisError::NoMotion)));
}

/// The record has no noise and is quantised, so the last cycles of the decay are a square wave. The
/// result must have only the two true modes, and a remark must report that the signal has few
/// quantisation steps.
#[test]
fn a_decay_in_steps_shows_no_modes_of_its_rounding() {
    for bits in [8, 10, 12] {
        let step = 2e-3 / f64::from(1 << bits);
        let sampling = Sampling::from_rate_hz(125.0, 4_000).unwrap();
        let exact = |at: usize, t: f64| {
            let t = (t - RELEASE).max(0.0);
            let mode = |hz: f64, zeta: f64| (-zeta * TAU * hz * t).exp() * (TAU * hz * t).cos();
            let [low, high] = [[4e-4, 1e-4], [-2e-4, 1.5e-4]][at];
            low * mode(6.0, 0.01) + high * mode(30.0, 0.02)
        };
        let rounded = [0, 1].map(|at| -> Vec<f64> {
            sampling.times().map(|t| (exact(at, t) / step).round() * step).collect()
        });
        let columns = [("x", rounded[0].as_slice()), ("y", rounded[1].as_slice())];
        let channels = Channels::from_responses(ResponseQuantity::Displacement, "x,y");
        let test = Measurement::from_columns(sampling, &columns, &channels).unwrap();
        let found = decay(&test, &DecaySettings::default()).unwrap();
        assert_eq!(found.summary().modes.len(), 2, "{bits}: {found}");
        assert!(found.summary().remarks.iter().any(|remark| remark.contains("few steps")));
        for (row, (hz, zeta)) in
            found.summary().modes.iter().zip([(6.0_f64, 0.01_f64), (30.0, 0.02)])
        {
            let [frequency, damping] =
                [row.mode.row.natural_frequency_hz, row.mode.row.damping_ratio];
            let hz = hz * (1.0 + zeta * zeta).sqrt();
            let off = (frequency.value - hz).abs() / frequency.standard_error.unwrap();
            assert!(off < 4.0, "{bits}: {frequency:?} {hz}");
            let off = (damping.value - zeta / (1.0 + zeta * zeta).sqrt()).abs();
            assert!(off < 4.0 * damping.standard_error.unwrap(), "{bits}: {damping:?}");
        }
        // The whole record shows more modes than the structure has.
        let whole = DecaySettings { to_s: Some(sampling.duration()), ..DecaySettings::default() };
        assert!(decay(&test, &whole).unwrap().summary().modes.len() > 2, "{bits}");
    }
}
