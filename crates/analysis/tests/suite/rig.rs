//! Records as real rigs make them: one shaker at a time, and disturbances with lines of their own.

use mechid_analysis::identify::{Disturbance, Fit, KnownMass, LeftOut, Method, SampleFit};
use mechid_analysis::{
    AnalysisError, FrfSettings, FrfTable, Identified, Identify, Measurement, ResponseQuantity,
    Segmentation, Window, frf, frf_of_records, identify,
};
use mechid_estimate::checks::{Concentration, Finding};
use mechid_model::{Response, Sdof, SecondOrderSystem};
use mechid_problems::exact_harmonic_periodic;
use mechid_problems::machines::{Support, chain};
use mechid_signal::{Multisine, NoiseLevel, Phases, Record, Sampling, noise};
use nalgebra::DMatrix;

const DOFS: usize = 3;
const PERIOD: usize = 256;
const PERIODS: usize = 4;

fn machine() -> SecondOrderSystem {
    chain(DOFS, Support::Held, 0.02, 3)
}

/// A period of the force at one degree of freedom and the steady motion that it makes, in closed form.
fn test(driven: usize, seed: u64) -> (Record, Response) {
    let period = Sampling::new(0.008, PERIOD).unwrap();
    let lines = Multisine::flat(1..=70, 10.0, Phases::Random { seed }).unwrap();
    let shaker = lines.sample(period).unwrap();
    let force =
        DMatrix::from_fn(
            PERIOD,
            DOFS,
            |k, dof| {
                if dof == driven { shaker.data()[(k, 0)] } else { 0.0 }
            },
        );
    let force = Record::new(period, force).unwrap();
    let motion = exact_harmonic_periodic(&machine(), &force).unwrap();
    (force, motion)
}

/// Records of the displacement, one for each shaker, with noise on response and on every channel of
/// the force, as parts of their RMS and of that of the shaker.
fn records(seed: u64, [on_response, on_force]: [f64; 2]) -> Vec<Measurement> {
    let record = |driven: usize| {
        let (force, motion) = test(driven, 10 * seed + driven as u64);
        let level = force.column(driven).norm() / (PERIOD as f64).sqrt() * on_force;
        let noisy = |record: &Record, level, seed| {
            let all = record.repeated(PERIODS).unwrap();
            if level == NoiseLevel::StandardDeviation(0.0) {
                return all;
            }
            noise::add_white(&all, level, seed).unwrap()
        };
        let seed = 100 * seed + 10 * driven as u64;
        let force = noisy(&force, NoiseLevel::StandardDeviation(level), seed);
        let x = noisy(motion.displacement(), NoiseLevel::FractionOfRms(on_response), seed + 1);
        let responses = [(ResponseQuantity::Displacement, &x)];
        Measurement::from_records(&force, &responses).unwrap().period(PERIOD).unwrap()
    };
    (0..DOFS).map(record).collect()
}

fn error(found: &SecondOrderSystem) -> f64 {
    let exact = machine();
    let pairs = [
        (found.mass(), exact.mass()),
        (found.damping(), exact.damping()),
        (found.stiffness(), exact.stiffness()),
    ];
    pairs.map(|(a, b)| (a - b).amax() / b.amax()).into_iter().fold(0.0, f64::max)
}

#[test]
fn idle_channels_do_not_keep_exact_records_from_a_fit() {
    let found = identify(&records(1, [0.0, 0.0]), &Identify::default()).unwrap();
    assert!(error(&found.system().unwrap()) < 1e-9, "{found}");

    let samples = |driven| {
        let (force, motion) = test(driven, driven as u64);
        let responses = [
            (ResponseQuantity::Displacement, motion.displacement()),
            (ResponseQuantity::Velocity, motion.velocity()),
            (ResponseQuantity::Acceleration, motion.acceleration()),
        ];
        Measurement::from_records(&force, &responses).unwrap()
    };
    let records: Vec<Measurement> = (0..DOFS).map(samples).collect();
    let how = Identify { fit: Fit::Samples(SampleFit::default()), ..Identify::default() };
    let found = identify(&records, &how).unwrap();
    assert!(error(&found.system().unwrap()) < 1e-9, "{found}");
}

#[test]
fn noise_in_idle_channels_is_no_cause_for_warnings() {
    const RUNS: u64 = 50;
    let exact = machine();
    let (mut warned, mut held, mut all) = (0, 0, 0);
    for seed in 0..RUNS {
        let found = identify(&records(seed, [0.005, 0.002]), &Identify::default()).unwrap();
        assert_eq!(named(&found), None, "{found}");
        warned += u64::from(found.checks().iter().any(|check| check.is_conspicuous()));
        for estimated in found.estimate().parameters() {
            let parameter = estimated.parameter;
            let truth = exact.matrix(parameter.matrix())[(parameter.row(), parameter.column())];
            let [low, high] = estimated.interval(0.95).unwrap();
            held += u64::from((low..=high).contains(&truth));
            all += 1;
        }
    }
    // With a rate of 1 in 50 more than four of fifty warn with a probability of 0.003.
    assert!(warned <= 4, "{warned} of {RUNS} warn");
    let coverage = held as f64 / f64::from(all);
    assert!((0.93..0.97).contains(&coverage), "{coverage}");
}

fn from_frf() -> Identify {
    Identify::responses(Default::default(), Segmentation::default())
}

/// A load cell where no force acts shows noise, to which nothing responds.
#[test]
fn noise_in_idle_channels_is_no_force_of_frequency_responses() {
    const RUNS: u64 = 40;
    let (mut warned, mut kept) = (0, 0);
    for seed in 0..RUNS {
        let found = identify(&records(seed, [0.005, 0.002]), &from_frf()).unwrap();
        // All lines of all shakers, and hardly ever those of a channel of noise.
        kept += found.summary().fit.equations / (2 * 70) - DOFS;
        let of_idle = |remark: &&String| remark.contains("taken as noise of the channel");
        assert_eq!(found.summary().remarks.iter().filter(of_idle).count(), DOFS, "{found}");
        warned += u64::from(found.checks().iter().any(|check| check.is_conspicuous()));
    }
    // Of 240 channels one in a thousand is kept: more than three with a probability of 10⁻⁴.
    assert!(kept <= 3, "{kept} channels are kept");
    // With a rate of 1 in 50 more than four of forty warn with a probability of 0.001.
    assert!(warned <= 4, "{warned} of {RUNS} warn");
}

/// A shaker of which nothing is known but its noisy channel, and no mass: the modes are left.
#[test]
fn a_channel_of_noise_is_no_force_that_scales_an_equation() {
    let test = records(7, [0.005, 0.002]).swap_remove(0);
    let found = identify(&[test], &from_frf()).unwrap();
    assert_eq!(found.summary().unscaled.as_ref().unwrap().degrees_of_freedom, [2, 3]);
    for (mode, exact) in found.summary().modes.iter().zip(machine().modes().unwrap()) {
        let estimate = mode.row.natural_frequency_hz;
        let apart = estimate.value - exact.natural_frequency() / std::f64::consts::TAU;
        // Noise on the driving force is taken for none.
        assert!(apart.abs() < 6.0 * estimate.standard_error.unwrap(), "{found}");
    }
}

/// Judges: the same periods in one record, and the receptance in closed form.
#[test]
fn records_are_averaged_together() {
    let whole = &records(3, [0.005, 0.0])[0];
    let how = FrfSettings::default();
    let part = |first: usize, periods: usize| {
        let window =
            Window { start: 1 + first * PERIOD, period: Some(PERIOD), periods: Some(periods) };
        whole.clone().window(window).unwrap()
    };
    let one = frf(whole, &how).unwrap();
    let parts = frf_of_records(&[part(0, 1), part(1, 3)], &how).unwrap();
    assert_eq!(parts.segments.count, 4);
    assert_eq!(parts.records.iter().map(|r| r.segments).collect::<Vec<_>>(), [1, 3]);
    let text = parts.to_string();
    assert!(text.contains("2 records, 4 periods of 256 samples, worth 4 averages"), "{text}");
    for (a, b) in one.responses.iter().zip(&parts.responses) {
        for (a, b) in [(&a.real, &b.real), (&a.standard_error, &b.standard_error)] {
            let apart = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            let largest = a.iter().map(|a| a.abs()).fold(0.0, f64::max);
            assert!(apart < 1e-9 * largest, "{apart} of {largest}");
        }
    }
    // One shaker at a time, and H whole.
    let table = frf_of_records(&records(4, [0.0, 0.0]), &how).unwrap();
    assert_eq!((table.responses.len(), table.records.len()), (DOFS * DOFS, DOFS));
    for response in &table.responses {
        for (at, hz) in table.frequency_hz.iter().enumerate() {
            let exact = machine().receptance(std::f64::consts::TAU * hz).unwrap();
            let exact = exact[(response.motion - 1, response.force - 1)];
            let found = nalgebra::Complex::new(response.real[at], response.imaginary[at]);
            assert!((found - exact).norm() < 1e-9 * exact.norm(), "{hz} Hz");
        }
    }
    let other = {
        let (force, motion) = test(0, 1);
        let responses = [(ResponseQuantity::Velocity, motion.velocity())];
        Measurement::from_records(&force, &responses).unwrap()
    };
    let refused = frf_of_records(&[whole.clone(), other], &how).unwrap_err();
    assert!(matches!(refused, AnalysisError::Setting { setting: "response", .. }), "{refused}");
    assert!(matches!(frf_of_records(&[], &how), Err(AnalysisError::NoRecord)));
}

#[test]
fn how_many_segments_each_record_has_is_told() {
    let found = identify(&records(5, [0.005, 0.0]), &from_frf()).unwrap();
    let told =
        "the frequency responses of 3 records, fitted together, are averages of 4, 4, 4 segments";
    assert!(found.summary().remarks.iter().any(|remark| remark == told), "{found}");
    assert_eq!(found.summary().fit.equations, 2 * 70 * DOFS);
}

/// The lines that the misfit of a fit names.
fn named(found: &Identified) -> Option<Concentration> {
    found.checks().iter().find_map(|check| match &check.finding {
        Finding::Misfit { concentration, .. } => concentration.clone(),
        _ => None,
    })
}

/// One mass with lines 1 Hz apart, four periods, its displacement with 1 % of noise and what is added.
fn single(seed: u64, added: impl Fn(f64) -> f64) -> Measurement {
    let period = Sampling::from_rate_hz(512.0, 512).unwrap();
    let force = Multisine::flat(1..=150, 10.0, Phases::Random { seed }).unwrap();
    let force = force.sample(period).unwrap();
    let system = Sdof::new(2.0, 60.0, 100_000.0).unwrap().system();
    let exact = exact_harmonic_periodic(&system, &force).unwrap();
    let x = exact.displacement().repeated(PERIODS).unwrap();
    let size = x.data().norm() / (x.len() as f64).sqrt();
    let x = noise::add_white(&x, NoiseLevel::FractionOfRms(0.01), 900 + seed).unwrap();
    let data = DMatrix::from_fn(x.len(), 1, |k, _| {
        x.data()[(k, 0)] + size * added(std::f64::consts::TAU * k as f64 / 512.0)
    });
    let x = Record::new(x.sampling(), data).unwrap();
    let force = force.repeated(PERIODS).unwrap();
    let responses = [(ResponseQuantity::Displacement, &x)];
    Measurement::from_records(&force, &responses).unwrap().period(512).unwrap()
}

/// Of 50 seeded records each with mains (50 and 100 Hz) and with run-out (24 and 48 Hz) of 1 % of the
/// response all are named; of 150 right records, and 50 fitted with a wrong known mass, none.
#[test]
fn the_misfit_names_the_few_lines_that_hold_it() {
    let how = Identify::spectra(Method::MaximumLikelihood);
    let lines = |seed: u64, base: f64| -> Option<Vec<f64>> {
        let record = single(seed, |turn| 0.02 * ((base * turn).sin() + (2.0 * base * turn).cos()));
        Some(named(&identify(&[record], &how).unwrap())?.frequencies_hz)
    };
    for (base, seeds) in [(50.0, 0..50), (24.0, 50..100)] {
        let right = seeds.filter(|seed| lines(*seed, base) == Some(vec![base, 2.0 * base])).count();
        assert!(right >= 49, "{base} Hz: {right} of 50");
    }
    let of_right = (0..150)
        .filter(|seed| named(&identify(&[single(*seed, |_| 0.0)], &how).unwrap()).is_some());
    assert_eq!(of_right.count(), 0);
    let wrong = Identify { mass: KnownMass { values: vec![Some(2.1)] }, ..how.clone() };
    let of_wrong = (0..50)
        .filter(|seed| named(&identify(&[single(*seed, |_| 0.0)], &wrong).unwrap()).is_some());
    assert_eq!(of_wrong.count(), 0);
}

#[test]
fn lines_of_a_disturbance_are_left_out() {
    // Lines are 1/(256 · 0.008 s) = 0.488 Hz apart; run-out at lines 12, 24, 36 … repeats like a response.
    let line_hz = 1.0 / (PERIOD as f64 * 0.008);
    let shaken = |seed: u64| {
        let records = records(seed, [0.002, 0.0]);
        records
            .into_iter()
            .map(|record| {
                let (force, x) = (record.force().unwrap(), record.responses().unwrap().remove(0).1);
                let level = 0.2 * x.data().amax();
                let data = DMatrix::from_fn(x.len(), DOFS, |k, dof| {
                    let turn = std::f64::consts::TAU * 12.0 * k as f64 / PERIOD as f64;
                    x.data()[(k, dof)]
                        + level * (turn.sin() + 0.5 * (2.0 * turn).cos() + 0.2 * (3.0 * turn).sin())
                });
                let x = Record::new(x.sampling(), data).unwrap();
                let responses = [(ResponseQuantity::Displacement, &x)];
                Measurement::from_records(&force, &responses).unwrap().period(PERIOD).unwrap()
            })
            .collect::<Vec<_>>()
    };
    let records = shaken(5);
    let spoilt = identify(&records, &Identify::default()).unwrap();
    assert!(spoilt.checks().iter().any(|check| check.is_conspicuous()), "{spoilt}");
    assert!(error(&spoilt.system().unwrap()) > 0.1);
    let named = named(&spoilt).expect("three lines hold the misfit");
    let run_out = [12.0, 24.0, 36.0].map(|line| line * line_hz);
    assert_eq!(named.frequencies_hz.len(), 3, "{spoilt}");
    for (found, expected) in named.frequencies_hz.iter().zip(run_out) {
        assert!((found - expected).abs() < 1e-9, "{named:?}");
    }
    assert!(spoilt.to_string().contains("Leave out with `without_hz`"), "{spoilt}");

    let lines = LeftOut { lines: Some("12,24,36".parse().unwrap()), ..LeftOut::default() };
    let rotation = Disturbance::rotation(12.0 * line_hz);
    let rotation = LeftOut { frequencies: vec![rotation], ..LeftOut::default() };
    for without in [lines, rotation] {
        let found = identify(&records, &Identify::default().without(without)).unwrap();
        assert!(!found.checks().iter().any(|check| check.is_conspicuous()), "{found}");
        assert!(error(&found.system().unwrap()) < 0.01, "{found}");
    }
}

/// One shaker beside a second channel that has a part of its force, with noise of this part of the force in both.
fn one_shaker_and_its_shadow(periodic: bool, part: f64, level: f64, seed: u64) -> Measurement {
    let sampling = Sampling::new(0.008, 32 * PERIOD).unwrap();
    let system = chain(2, Support::Held, 0.02, 3);
    let lines: Vec<usize> =
        if periodic { (32..=2240).step_by(32).collect() } else { (32..=2240).collect() };
    let one = Multisine::flat(lines, 10.0, Phases::Random { seed }).unwrap();
    let one = one.sample(sampling).unwrap();
    let other: Vec<f64> = one.channel(0).iter().map(|f| part * f).collect();
    let force = Record::from_channels(sampling, &[one.channel(0), &other[..]]).unwrap();
    let motion = exact_harmonic_periodic(&system, &force).unwrap();
    let size = NoiseLevel::StandardDeviation(level * one.column(0).variance().sqrt());
    let force = noise::add_white(&force, size, 2 * seed).unwrap();
    let x = noise::add_white(motion.displacement(), NoiseLevel::FractionOfRms(level), 2 * seed + 1);
    let x = x.unwrap();
    let responses = [(ResponseQuantity::Displacement, &x)];
    let measured = Measurement::from_records(&force, &responses).unwrap();
    if periodic { measured.period(PERIOD).unwrap() } else { measured }
}

/// Judge: (K − ω²M + iωC)⁻¹. Nothing tells what a force does that is nothing but a part of another one and noise: its
/// responses would be those to the noise, a hundred times those of the machine.
#[test]
fn a_force_that_follows_another_has_no_responses_and_is_told() {
    let system = chain(2, Support::Held, 0.02, 3);
    for (periodic, level) in [(true, 0.01), (true, 0.001), (false, 0.01), (false, 0.001)] {
        for seed in 1..6 {
            let measured = one_shaker_and_its_shadow(periodic, 0.02, level, seed);
            let how = FrfSettings { segments: Segmentation::of(2048), ..FrfSettings::default() };
            let how = if periodic { FrfSettings::default() } else { how };
            let table = frf(&measured, &how).unwrap();
            let told =
                table.remarks.iter().find(|remark| remark.contains("force 2 follows force 1"));
            assert!(
                told.is_some_and(|told| told.contains(" at 2")),
                "{periodic} {level} {seed}: {table}"
            );
            assert_eq!(table.responses.len(), 2);
            for response in &table.responses {
                for (at, magnitude) in response.magnitude.iter().enumerate() {
                    let omega = std::f64::consts::TAU * table.frequency_hz[at];
                    let truth = system.receptance(omega).unwrap().row(response.motion - 1).norm();
                    let error = response.standard_error[at];
                    assert!(magnitude - 6.0 * error < 1.5 * truth, "{magnitude} {truth} {error}");
                }
            }
        }
    }
}

/// A second shaker of a twentieth of the force is one, and so is one that half follows the first.
#[test]
fn a_weak_shaker_of_its_own_is_kept() {
    let sampling = Sampling::new(0.008, 32 * PERIOD).unwrap();
    let system = chain(2, Support::Held, 0.02, 3);
    let random = |seed| {
        let drawn = Multisine::flat(32..=2240, 10.0, Phases::Random { seed }).unwrap();
        drawn.sample(sampling).unwrap()
    };
    for (follows, own) in [(0.0, 0.05), (0.02, 0.05), (0.5, 0.2), (0.9, 0.4)] {
        for seed in 1..6 {
            let (one, two) = (random(seed), random(100 + seed));
            let other =
                one.channel(0).iter().zip(two.channel(0)).map(|(a, b)| follows * a + own * b);
            let other: Vec<f64> = other.collect();
            let force = Record::from_channels(sampling, &[one.channel(0), &other[..]]).unwrap();
            let motion = exact_harmonic_periodic(&system, &force).unwrap();
            let noisy = |record: &Record, seed| {
                noise::add_white(record, NoiseLevel::FractionOfRms(0.001), seed).unwrap()
            };
            let (force, x) = (noisy(&force, 2 * seed), noisy(motion.displacement(), 2 * seed + 1));
            let responses = [(ResponseQuantity::Displacement, &x)];
            let measured = Measurement::from_records(&force, &responses).unwrap();
            let how = FrfSettings { segments: Segmentation::of(2048), ..FrfSettings::default() };
            let table = frf(&measured, &how).unwrap();
            assert_eq!(table.responses.len(), 4, "{follows} {own} {seed}: {table}");
        }
    }
}

/// Two shakers with every second line each, of which a part of the force of each acts at the other too, with noise
/// of this part of the RMS value in all channels.
fn interleaved_shakers(crosstalk: f64, level: f64, seed: u64) -> (SecondOrderSystem, FrfTable) {
    let period = Sampling::new(0.008, PERIOD).unwrap();
    let system = chain(2, Support::Held, 0.02, 3);
    let shaker = |first: usize| {
        let lines = (first..=70).step_by(2);
        Multisine::flat(lines, 10.0, Phases::Random { seed: 4 }).unwrap().sample(period).unwrap()
    };
    let [one, two] = [shaker(1), shaker(2)];
    let both = |a: &Record, b: &Record| -> Vec<f64> {
        a.channel(0).iter().zip(b.channel(0)).map(|(a, b)| a + crosstalk * b).collect()
    };
    let force =
        Record::from_channels(period, &[&both(&one, &two)[..], &both(&two, &one)[..]]).unwrap();
    let motion = exact_harmonic_periodic(&system, &force).unwrap();
    let noisy = |record: &Record, seed| {
        let all = record.repeated(8).unwrap();
        noise::add_white(&all, NoiseLevel::FractionOfRms(level), seed).unwrap()
    };
    let (force, x) = (noisy(&force, 2 * seed), noisy(motion.displacement(), 2 * seed + 1));
    let responses = [(ResponseQuantity::Displacement, &x)];
    let measured = Measurement::from_records(&force, &responses).unwrap().period(PERIOD).unwrap();
    (system, frf(&measured, &FrfSettings::default()).unwrap())
}

/// Errors of responses on the lines of their own force, over their standard errors: RMS and largest, and the RMS of
/// what a part of the other force would make of them.
fn errors_on_own_lines(system: &SecondOrderSystem, table: &FrfTable, part: f64) -> [f64; 3] {
    let (mut errors, mut parts) = (Vec::new(), Vec::new());
    for response in &table.responses {
        let values = response.real.iter().zip(&response.imaginary).zip(&response.standard_error);
        for (at, ((re, im), error)) in values.enumerate().filter(|(_, ((re, _), _))| re.is_finite())
        {
            let omega = std::f64::consts::TAU * table.frequency_hz[at];
            let row = system.receptance(omega).unwrap().row(response.motion - 1).into_owned();
            let (own, other) = (row[response.force - 1], row[2 - response.force]);
            errors.push((re - own.re).hypot(im - own.im) / (2_f64.sqrt() * error));
            parts.push(part * other.norm() / (2_f64.sqrt() * error));
        }
    }
    let rms = |all: &[f64]| (all.iter().map(|x| x * x).sum::<f64>() / all.len() as f64).sqrt();
    [rms(&errors), errors.iter().copied().fold(0.0, f64::max), rms(&parts)]
}

/// Judge: (K − ω²M + iωC)⁻¹. Noise in the channels alone is no crosstalk, and what 2 % of it would do is no longer in
/// the responses.
#[test]
fn crosstalk_between_interleaved_forces_is_told_and_taken_off() {
    let told = |table: &FrfTable| table.to_string().matches("of that one").count();
    for seed in 0..10 {
        let (_, table) = interleaved_shakers(0.0, 0.002, seed);
        assert_eq!(told(&table), 0, "{seed}: {table}");
        let (system, table) = interleaved_shakers(0.02, 0.002, seed);
        assert_eq!(told(&table), 2, "{seed}: {table}");
        let [error, largest, untold] = errors_on_own_lines(&system, &table, 0.02);
        assert!((0.7..1.15).contains(&error) && largest < 5.0, "{seed}: {error} {largest}");
        assert!(untold > 2.0, "{seed}: {untold}");
    }
}

/// Judge: (K − ω²M + iωC)⁻¹. Two shakers with every second line each, 1 % of noise in all channels: each
/// response is given on the lines of its force alone, and there it is the machine's.
#[test]
fn responses_to_interleaved_forces_are_those_on_their_own_lines() {
    let period = Sampling::new(0.008, PERIOD).unwrap();
    let system = chain(2, Support::Held, 0.02, 3);
    let shaker = |first: usize| {
        let lines = (first..=70).step_by(2);
        Multisine::flat(lines, 10.0, Phases::Random { seed: 4 }).unwrap().sample(period).unwrap()
    };
    let [one, two] = [shaker(1), shaker(2)];
    let force = Record::from_channels(period, &[one.channel(0), two.channel(0)]).unwrap();
    let motion = exact_harmonic_periodic(&system, &force).unwrap();
    let noisy = |record: &Record, seed| {
        let all = record.repeated(8).unwrap();
        noise::add_white(&all, NoiseLevel::FractionOfRms(0.01), seed).unwrap()
    };
    let (force, x) = (noisy(&force, 1), noisy(motion.displacement(), 2));
    let responses = [(ResponseQuantity::Displacement, &x)];
    let measured = Measurement::from_records(&force, &responses).unwrap().period(PERIOD).unwrap();
    let table = frf(&measured, &FrfSettings::default()).unwrap();
    assert_eq!((table.frequency_hz.len(), table.responses.len()), (70, 4));
    for response in &table.responses {
        let values = response.real.iter().zip(&response.imaginary).zip(&response.standard_error);
        let mut given = Vec::new();
        for (at, ((re, im), error)) in values.enumerate() {
            if re.is_nan() {
                continue;
            }
            given.push(at + 1);
            let omega = std::f64::consts::TAU * table.frequency_hz[at];
            let truth =
                system.receptance(omega).unwrap()[(response.motion - 1, response.force - 1)];
            let off = (re - truth.re).hypot(im - truth.im);
            assert!(off < 6.0 * error + 0.01 * truth.norm(), "{off} {error}, line {}", at + 1);
        }
        let own: Vec<usize> = (response.force..=70).step_by(2).collect();
        assert_eq!(given, own);
    }
    assert!(table.csv().lines().nth(1).unwrap().contains(",,,"));
    assert!(table.to_responses(&[]).is_err());
}

/// Judge: the machine, and the factor. One sensor in mm beside one in m, or 20 % off, leaves nothing in the residual and
/// M diagonal; a bearing, whose C and K are not symmetric either, is no such case, nor is a right record.
#[test]
fn a_sensor_with_another_gain_is_told_by_damping_and_stiffness() {
    let period = Sampling::new(0.002, 1024).unwrap();
    let measured = |system: &SecondOrderSystem, gain: f64, seed: u64| {
        let shaker = |first: usize, seed| {
            let lines = (first..=180).step_by(2);
            let drawn = Multisine::flat(lines, 100.0, Phases::Random { seed }).unwrap();
            drawn.sample(period).unwrap()
        };
        let [one, two] = [shaker(10, seed), shaker(11, seed + 50)];
        let force = Record::from_channels(period, &[one.channel(0), two.channel(0)]).unwrap();
        let motion = exact_harmonic_periodic(system, &force).unwrap();
        let mut x = motion.displacement().repeated(8).unwrap().into_data();
        x.column_mut(0).scale_mut(gain);
        let x = Record::new(force.repeated(8).unwrap().sampling(), x).unwrap();
        let x = noise::add_white(&x, NoiseLevel::FractionOfRms(0.005), seed).unwrap();
        let responses = [(ResponseQuantity::Displacement, &x)];
        let force = force.repeated(8).unwrap();
        Measurement::from_records(&force, &responses).unwrap().period(1024).unwrap()
    };
    let system = |c: [f64; 4], k: [f64; 4]| {
        let [m, c, k] =
            [[10.0, 0.0, 0.0, 8.0], c, k].map(|all| DMatrix::from_row_slice(2, 2, &all));
        SecondOrderSystem::new(m, c, k).unwrap()
    };
    let frame = system([120.0, -60.0, -60.0, 110.0], [5.5e5, -2.5e5, -2.5e5, 4.5e5]);
    let bearing = system([400.0, -60.0, -60.0, 500.0], [5.5e5, 1.5e5, -2.5e5, 7.5e5]);
    let told = |system: &SecondOrderSystem, gain: f64, seed: u64| {
        let found = identify(&[measured(system, gain, seed)], &Identify::default()).unwrap();
        found.checks().iter().find_map(|check| match check.finding {
            Finding::Gain { row, ratio, .. } => Some((row, ratio)),
            _ => None,
        })
    };
    for seed in 0..8 {
        for gain in [1000.0, 1.2] {
            let (row, ratio) = told(&frame, gain, seed).expect("a gain");
            assert!(row == 0 && (ratio / gain - 1.0).abs() < 0.02, "{gain} {seed}: {row} {ratio}");
        }
        assert_eq!(told(&frame, 1.0, seed), None);
        assert_eq!(told(&bearing, 1.0, seed), None);
    }
}
