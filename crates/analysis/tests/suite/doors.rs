//! The analysis as a Rust program uses it: files and arrays, units, windows, saved settings, and
//! errors. The references are exact steady states.

use mechid_analysis::identify::{KnownMass, Method, ValidationWindow};
use mechid_analysis::reconstruct::reconstruct_in_chunks;
use mechid_analysis::{
    AnalysisError, Channels, FrfSettings, Identify, Machine, Measurement, ModesSettings, Reading,
    Reconstruct, RecordPlan, ResponseQuantity, Segmentation, SweepSettings, Window, frf,
    frf_of_records, identify, modes, reconstruct, sweep_record,
};
use mechid_model::{Sdof, SecondOrderSystem};
use mechid_problems::exact_harmonic_periodic;
use mechid_signal::{Multisine, NoiseLevel, Phases, Record, Sampling, lines, noise};
use nalgebra::DMatrix;

const PERIOD: usize = 128;

fn machine() -> Sdof {
    Sdof::new(25.0, 188.0, 142_000.0).unwrap()
}

/// Two periods of a multisine and the exact displacement, velocity and acceleration.
fn steady_state() -> (Record, [Record; 3]) {
    let period = Sampling::from_rate_hz(128.0, PERIOD).unwrap();
    let force = Multisine::flat(lines::band(period, 3.0, 40.0), 2.0, Phases::Schroeder).unwrap();
    let force = force.sample(period).unwrap().repeated(2).unwrap();
    let exact = exact_harmonic_periodic(&machine().system(), &force.window(0, PERIOD).unwrap());
    let exact = exact.unwrap();
    let twice = |record: &Record| record.repeated(2).unwrap();
    let motion = [exact.displacement(), exact.velocity(), exact.acceleration()].map(twice);
    (force, motion)
}

fn displacement_test() -> Measurement {
    let (force, [x, ..]) = steady_state();
    let responses = [(ResponseQuantity::Displacement, &x)];
    Measurement::from_records(&force, &responses).unwrap().period(PERIOD).unwrap()
}

#[track_caller]
fn is_the_machine(found: &mechid_analysis::Identified) {
    for (name, value) in [("m", 25.0), ("c", 188.0), ("k", 142_000.0)] {
        let got = found.estimate().parameter(name).unwrap().value;
        assert!((got / value - 1.0).abs() < 1e-8, "{name} = {got}");
    }
}

#[test]
fn arrays_and_files_give_the_same_machine_whatever_their_units() {
    is_the_machine(&identify(&[displacement_test()], &Identify::default()).unwrap());

    let (force, [x, ..]) = steady_state();
    let sampling = force.sampling();
    let kilo: Vec<f64> = force.channel(0).iter().map(|f| f / 1e3).collect();
    let micro: Vec<f64> = x.channel(0).iter().map(|x| x * 1e6).collect();
    let channels = Channels::new("F [kN]", ResponseQuantity::Displacement, "x [um]");
    let columns = [("x [um]", micro.as_slice()), ("F [kN]", kilo.as_slice())];
    let test = Measurement::from_columns(sampling, &columns, &channels).unwrap();
    let found = identify(&[test.period(PERIOD).unwrap()], &Identify::default()).unwrap();
    is_the_machine(&found);
    assert!(found.summary().remarks[0].contains("converted to SI units"));

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rig.csv");
    let mut text = String::from("t,F [kN],x [um]\n");
    for (k, (f, x)) in kilo.iter().zip(&micro).enumerate() {
        text += &format!("{:?},{f:?},{x:?}\n", k as f64 / 128.0);
    }
    std::fs::write(&path, text).unwrap();
    let test = Measurement::open(&path, &channels).unwrap().period(PERIOD).unwrap();
    is_the_machine(&identify(&[test], &Identify::default()).unwrap());
}

#[test]
fn a_column_in_a_unit_of_another_quantity_is_refused() {
    let (force, [x, ..]) = steady_state();
    let channels = Channels::new("force", ResponseQuantity::Displacement, "x [mm/s]");
    let columns = [("force", force.channel(0)), ("x [mm/s]", x.channel(0))];
    let error = Measurement::from_columns(force.sampling(), &columns, &channels).unwrap_err();
    assert!(matches!(&error, AnalysisError::Unit { unit, .. } if unit == "mm/s"), "{error}");
}

#[test]
fn every_kind_of_fit_is_a_value_that_survives_json() {
    let (force, exact) = steady_state();
    // The noise is needed because maximum likelihood refuses periods without noise.
    let noisy = |(seed, exact): (u64, &Record)| {
        let level = 1e-7 * exact.data().norm() / (exact.len() as f64).sqrt();
        let noise = noise::white(exact.sampling(), 1, level, seed).unwrap();
        Record::new(exact.sampling(), exact.data() + noise.data()).unwrap()
    };
    let [x, v, a] = [(1, &exact[0]), (2, &exact[1]), (3, &exact[2])].map(noisy);
    let all = [
        (ResponseQuantity::Displacement, &x),
        (ResponseQuantity::Velocity, &v),
        (ResponseQuantity::Acceleration, &a),
    ];
    let test = Measurement::from_records(&force, &all).unwrap().period(PERIOD).unwrap();
    let known = Identify { mass: KnownMass { values: vec![Some(25.0)] }, ..Identify::default() };
    for how in [
        Identify::spectra(Method::LeastSquares),
        Identify::spectra(Method::MaximumLikelihood),
        Identify::responses(Default::default(), Default::default()),
        Identify::samples(),
        known,
    ] {
        let saved = serde_json::to_string(&how).unwrap();
        let again: Identify = serde_json::from_str(&saved).unwrap();
        let [first, second] =
            [&how, &again].map(|how| identify(std::slice::from_ref(&test), how).unwrap());
        assert_eq!(serde_json::to_string(&first).unwrap(), serde_json::to_string(&second).unwrap());
        // A result contains the settings that repeat it.
        assert_eq!(first.summary().analysis, how);
        let free = first.estimate().parameter("k").unwrap().value;
        assert!((free / 142_000.0 - 1.0).abs() < 1e-5, "{saved}: {free}");
    }
}

#[test]
fn a_saved_record_opens_as_it_was() {
    let rig = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/machine.csv");
    let plan = RecordPlan {
        path: rig.into(),
        channels: Channels::new("force", ResponseQuantity::Displacement, "displacement"),
        reading: Reading::default(),
        window: Window { start: 1, period: Some(256), periods: Some(1) },
    };
    let saved = serde_json::to_string(&plan).unwrap();
    let opened = serde_json::from_str::<RecordPlan>(&saved).unwrap().open().unwrap();
    assert_eq!(opened.plan(), Some(plan));
    assert_eq!(opened.force().unwrap().len(), 256);
}

#[test]
fn a_prediction_of_the_same_machine_is_perfect_and_of_another_is_not() {
    let found = identify(&[displacement_test()], &Identify::default()).unwrap();
    let fit = found.validate(&displacement_test()).unwrap();
    assert!(fit.channels[0].fit_percent > 99.999);
    let (force, [x, ..]) = steady_state();
    let wrong = Record::new(x.sampling(), x.data() * 0.5).unwrap();
    let responses = [(ResponseQuantity::Displacement, &wrong)];
    let other = Measurement::from_records(&force, &responses).unwrap().period(PERIOD).unwrap();
    assert!(found.validate(&other).unwrap().channels[0].fit_percent < 1.0);
    let short = ValidationWindow { start: None, samples: Some(PERIOD - 1) };
    let refused = found.validation_window(other, &short).unwrap_err();
    assert!(matches!(refused, AnalysisError::ValidationPeriod { .. }), "{refused}");
}

#[test]
fn the_force_of_an_identified_machine_counts_its_covariance() {
    let test = displacement_test();
    let found = identify(std::slice::from_ref(&test), &Identify::default()).unwrap();
    let force = reconstruct(&test, &found.machine().unwrap(), &Reconstruct::auto()).unwrap();
    assert!(force.summary().machine_uncertainty);
    let (truth, _) = steady_state();
    let period = truth.window(0, PERIOD).unwrap();
    let apart = (force.force().record().data() - period.data()).norm() / period.data().norm();
    assert!(apart < 1e-3, "{apart}");
    // A known machine has no covariance, so its uncertainty is not included.
    let known = Machine::known(machine().system());
    let force = reconstruct(&test, &known, &Reconstruct::auto()).unwrap();
    assert!(!force.summary().machine_uncertainty);
}

#[test]
fn chunks_of_a_force_join_to_the_whole() {
    let (force, [x, v, a]) = steady_state();
    let all = [
        (ResponseQuantity::Displacement, &x),
        (ResponseQuantity::Velocity, &v),
        (ResponseQuantity::Acceleration, &a),
    ];
    let run = Measurement::from_records(&force, &all).unwrap();
    let known = Machine::known(machine().system());
    let mut joined = Vec::new();
    let summary = reconstruct_in_chunks(&run, &known, &Reconstruct::auto(), &mut |chunk| {
        joined.extend_from_slice(chunk.columns()[0].1);
        Ok(())
    });
    assert_eq!(summary.unwrap().samples, force.len());
    let worst = joined.iter().zip(force.channel(0)).map(|(f, t)| (f - t).abs());
    assert!(joined.len() == force.len() && worst.fold(0.0, f64::max) < 1e-9);
}

#[test]
fn frequency_responses_are_those_of_the_machine() {
    let table = frf(&displacement_test(), &FrfSettings::default()).unwrap();
    let response = &table.responses[0];
    for (at, hz) in table.frequency_hz.iter().enumerate() {
        let stiffness = machine().dynamic_stiffness(hz * std::f64::consts::TAU);
        let product = stiffness * nalgebra::Complex::new(response.real[at], response.imaginary[at]);
        assert!((product - 1.0).norm() < 1e-9, "{hz} Hz: {product}");
    }
    assert!(table.remarks.is_empty(), "{:?}", table.remarks);
    let (force, [x, _, a]) = steady_state();
    let responses = [(ResponseQuantity::Displacement, &x), (ResponseQuantity::Acceleration, &a)];
    let both = Measurement::from_records(&force, &responses).unwrap().period(PERIOD).unwrap();
    let table = frf(&both, &FrfSettings::default()).unwrap();
    assert!(table.remarks[0].contains("not from the acceleration"), "{:?}", table.remarks);
}

#[test]
fn what_does_not_fit_together_is_refused_by_name() {
    let (force, [x, ..]) = steady_state();
    let two = Record::from_channels(x.sampling(), &[x.channel(0), x.channel(0)]).unwrap();
    let error = Measurement::from_records(&force, &[(ResponseQuantity::Displacement, &two)]);
    assert!(matches!(error, Err(AnalysisError::ArrayShape { got: [256, 2], .. })));

    let twice = Record::from_channels(x.sampling(), &[force.channel(0), force.channel(0)]).unwrap();
    let pair = Measurement::from_records(&twice, &[(ResponseQuantity::Displacement, &two)]);
    let pair = pair.unwrap().period(PERIOD).unwrap();
    let mixed = identify(&[displacement_test(), pair.clone()], &Identify::default());
    assert!(matches!(mixed, Err(AnalysisError::DegreesOfFreedom { got: 2, dofs: 1, .. })));
    assert!(matches!(identify(&[], &Identify::default()), Err(AnalysisError::NoRecord)));

    // A sweep is refused if the reference has another number of degrees of freedom than the record.
    let sweep = SweepSettings {
        kind: mechid_analysis::sweep::Kind::Decimation,
        settings: "1".parse().unwrap(),
        estimator: mechid_analysis::sweep::Estimator::LeastSquares,
        ..SweepSettings::default()
    };
    let refused = sweep_record(&pair, &sweep, Some(&machine().system()), &|| ());
    assert!(matches!(refused, Err(AnalysisError::DegreesOfFreedom { got: 1, dofs: 2, .. })));

    let known = Machine::known(machine().system());
    let elsewhere = Reconstruct::auto().forced([2]);
    let refused = reconstruct(&displacement_test(), &known, &elsewhere);
    assert!(matches!(refused, Err(AnalysisError::Forced { dof: 2, dofs: 1 })));
}

/// Two tests never have the same noise; a record given twice would halve all variances.
#[test]
fn a_record_given_twice_is_refused() {
    let (force, [x, ..]) = steady_state();
    let test = |response: &Record, name: &str| {
        let responses = [(ResponseQuantity::Displacement, response)];
        Measurement::from_records(&force, &responses).unwrap().named(name)
    };
    let periods = |test: Measurement| test.period(PERIOD).unwrap();
    let repeated = [test(&x, "a"), test(&x, "b")];
    let refused = |error: AnalysisError| {
        let named = matches!(&error, AnalysisError::RepeatedRecord { first, second }
            if first == "a" && second == "b");
        assert!(named, "{error}");
    };
    let pair = repeated.clone().map(periods);
    refused(identify(&pair, &Identify::default()).unwrap_err());
    refused(frf_of_records(&pair, &FrfSettings::default()).unwrap_err());
    refused(modes(&repeated, &ModesSettings::default()).unwrap_err());

    // Records with different samples, and different parts of one record, count as different tests
    // and are not refused.
    let noisy = noise::add_white(&x, NoiseLevel::FractionOfRms(1e-9), 1).unwrap();
    identify(&[test(&x, "a"), test(&noisy, "b")].map(periods), &Identify::default()).unwrap();
    let part = |start: usize| {
        let window = Window { start, period: Some(PERIOD), periods: Some(1) };
        test(&noisy, "a").window(window).unwrap()
    };
    identify(&[part(1), part(1 + PERIOD)], &Identify::default()).unwrap();
}

#[test]
fn a_window_outside_the_record_says_what_there_is() {
    let (force, [x, ..]) = steady_state();
    let test = Measurement::from_records(&force, &[(ResponseQuantity::Displacement, &x)]).unwrap();
    for window in [
        Window { start: 1, period: Some(257), periods: None },
        Window { start: 200, period: Some(64), periods: Some(1) },
        Window { start: usize::MAX, period: Some(usize::MAX), periods: Some(usize::MAX) },
    ] {
        let refused = test.clone().window(window);
        assert!(matches!(refused, Err(AnalysisError::Window { len: 256, .. })));
    }
}

/// A response that equals the force has no residual; the analysis must not panic.
#[test]
fn a_response_equal_to_the_force_is_no_panic() {
    for periods in [1, 2, 4] {
        let one = Multisine::flat(1..=9, 1.0, Phases::Schroeder)
            .unwrap()
            .sample(Sampling::new(0.01, 24).unwrap())
            .unwrap();
        let force = one.repeated(periods).unwrap();
        for kind in [ResponseQuantity::Displacement, ResponseQuantity::Acceleration] {
            let test = Measurement::from_records(&force, &[(kind, &force)]).unwrap();
            for how in [Identify::default(), Identify::spectra(Method::LeastSquares)] {
                // The identification may return a machine or an error.
                if let Ok(found) = identify(&[test.clone().period(24).unwrap()], &how) {
                    assert!(found.checks().iter().all(|check| !check.text.contains("NaN")));
                }
            }
        }
    }
}

/// A grounded chain of 26 masses with a force on each has 2,028 parameters, and their covariance
/// has four million entries. The summary must omit this covariance, but a call must return it.
#[test]
fn the_covariance_of_very_many_parameters_is_there_for_those_who_ask() {
    let n = 26;
    let identity = DMatrix::identity(n, n);
    let stiffness = DMatrix::from_fn(n, n, |i, j| match i.abs_diff(j) {
        0 => 2500.0,
        1 => -1000.0,
        _ => 0.0,
    });
    let damping = &stiffness * 2e-3;
    let system = SecondOrderSystem::new(identity, damping, stiffness).unwrap();
    let period = Sampling::from_rate_hz(64.0, 256).unwrap();
    let force: Vec<Vec<f64>> = (0..n as u64)
        .map(|seed| {
            let lines = Multisine::flat(2..=80, 1.0, Phases::Random { seed }).unwrap();
            lines.sample(period).unwrap().channel(0).to_vec()
        })
        .collect();
    let force = Record::from_channels(period, &force).unwrap();
    let exact = exact_harmonic_periodic(&system, &force).unwrap();
    let noisy = noise::add_white(exact.displacement(), NoiseLevel::FractionOfRms(1e-4), 1).unwrap();
    let responses = [(ResponseQuantity::Displacement, &noisy)];
    let test = Measurement::from_records(&force, &responses).unwrap().period(256).unwrap();
    let found = identify(&[test], &Identify::spectra(Method::LeastSquares)).unwrap();
    assert!(found.summary().covariance.is_none());
    let told = found.summary().remarks.iter().any(|remark| remark.contains("2028 parameters"));
    assert!(told && found.summary().system.is_some(), "{found}");
    let covariance = found.covariance();
    let (matrix, parameters) = (covariance.matrix(), found.estimate().parameters());
    assert_eq!((covariance.parameters.len(), matrix.ncols()), (2028, 2028));
    for (at, parameter) in parameters.enumerate() {
        assert!((matrix[(at, at)].sqrt() / parameter.standard_error - 1.0).abs() < 1e-9);
    }
}

/// Spreadsheets on Windows write names in Latin-1, in which `µ` and `²` are one byte each.
#[test]
fn units_are_read_in_names_that_are_not_utf8() {
    let folder = tempfile::tempdir().unwrap();
    let read = |unit: &[u8]| {
        let mut text = [b"t [s];Force [N];Disp [", unit, b"]\n"].concat();
        for k in 0..64 {
            let t = 0.01 * f64::from(k);
            let row = format!("{t};{};{}\n", (40.0 * t).sin(), 250.0 * (40.0 * t + 0.3).sin());
            text.extend(row.into_bytes());
        }
        let path = folder.path().join("a.csv");
        std::fs::write(&path, text).unwrap();
        let channels = Channels::new("Force", ResponseQuantity::Displacement, "Disp");
        let measured = Measurement::open(&path, &channels).unwrap();
        let how =
            FrfSettings { segments: Segmentation::with_samples(16), ..FrfSettings::default() };
        frf(&measured, &how).unwrap().remarks.join("; ")
    };
    assert_eq!(read(b"\xb5m"), read("µm".as_bytes()));
    assert!(read(b"\xb5m").contains("converted to SI units: "), "{}", read(b"\xb5m"));
    assert!(read(b"\xb5in").contains("in µin"), "{}", read(b"\xb5in"));
    assert!(read(b"\xb5xy").contains("µxy"), "{}", read(b"\xb5xy"));
    assert!(!read(b"m").contains("unit"), "{}", read(b"m"));
}
