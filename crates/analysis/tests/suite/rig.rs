//! Records like those of real test rigs: one shaker acts at a time, and disturbances are on single
//! spectral lines.

use mechid_analysis::identify::{Disturbance, KnownMass, LeftOut, Method};
use mechid_analysis::{
    AnalysisError, FrfSettings, Identified, Identify, Measurement, ResponseQuantity, Segmentation,
    Window, frf, frf_of_records, identify,
};
use mechid_checks::Misfit;
use mechid_checks::{Concentration, Finding};
use mechid_model::{Response, Sdof, SecondOrderSystem};
use mechid_problems::exact_harmonic_periodic;
use mechid_problems::machines::{Support, chain};
use mechid_signal::{Multisine, NoiseLevel, Phases, Record, Sampling, noise};
use nalgebra::DMatrix;

const DOFS: usize = 3;
const PERIOD: usize = 256;
const PERIODS: usize = 4;

fn machine() -> SecondOrderSystem {
    chain(DOFS, Support::Fixed, 0.02, 3)
}

/// One period of the force at one degree of freedom, and the steady response in closed form.
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

/// Displacement records, one for each shaker. `on_response` is the ratio of the noise on the
/// response to its RMS; `on_force` is the ratio of the noise on every force channel to the RMS of
/// the shaker's force.
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
    let how = Identify::samples();
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
    // At a rate of 1 in 50, the probability of warnings in more than four of fifty records is
    // 0.003.
    assert!(warned <= 4, "{warned} of {RUNS} warn");
    let coverage = held as f64 / f64::from(all);
    assert!((0.93..0.97).contains(&coverage), "{coverage}");
}

fn from_frf() -> Identify {
    Identify::responses(Default::default(), Segmentation::default())
}

/// The load cell of a shaker at rest shows only noise, which must not count as a force.
#[test]
fn noise_in_idle_channels_is_no_force_of_frequency_responses() {
    const RUNS: u64 = 40;
    let (mut warned, mut kept) = (0, 0);
    for seed in 0..RUNS {
        let found = identify(&records(seed, [0.005, 0.002]), &from_frf()).unwrap();
        // All lines of the acting shakers are used. The lines of a channel with only noise are used
        // in very few cases.
        kept += found.summary().fit.equations / (2 * 70) - DOFS;
        let of_idle = |remark: &&String| remark.contains("only noise in force");
        assert_eq!(found.summary().remarks.iter().filter(of_idle).count(), DOFS, "{found}");
        warned += u64::from(found.checks().iter().any(|check| check.is_conspicuous()));
    }
    // If one in a thousand channels is kept, the probability that more than three of 240 are kept
    // is 10⁻⁴.
    assert!(kept <= 3, "{kept} channels are kept");
    // At a rate of 1 in 50, the probability of warnings in more than four of forty records is
    // 0.001.
    assert!(warned <= 4, "{warned} of {RUNS} warn");
}

/// If a force channel contains only noise, and if no mass is known, the equation of this degree of
/// freedom has no scale. The result then gives only the modes.
#[test]
fn a_channel_of_noise_is_no_force_that_scales_an_equation() {
    let test = records(7, [0.005, 0.002]).swap_remove(0);
    let found = identify(&[test], &from_frf()).unwrap();
    assert_eq!(found.summary().unscaled.as_ref().unwrap().degrees_of_freedom, [2, 3]);
    for (mode, exact) in found.summary().modes.iter().zip(machine().modes().unwrap()) {
        let estimate = mode.row.natural_frequency_hz;
        let apart = estimate.value - exact.natural_frequency() / std::f64::consts::TAU;
        // The method ignores the noise on the driving force, so the limit is wide.
        assert!(apart.abs() < 6.0 * estimate.standard_error.unwrap(), "{found}");
    }
}

/// References: the same periods in one record, and the receptance in closed form.
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
    assert!(
        text.contains("2 records, 4 periods of 256 samples, equivalent to 4 averages"),
        "{text}"
    );
    for (a, b) in one.responses.iter().zip(&parts.responses) {
        for (a, b) in [(&a.real, &b.real), (&a.standard_error, &b.standard_error)] {
            let apart = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            let largest = a.iter().map(|a| a.abs()).fold(0.0, f64::max);
            assert!(apart < 1e-9 * largest, "{apart} of {largest}");
        }
    }
    // Records with one shaker at a time give the complete matrix H.
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

/// Returns the spectral lines that the misfit check names as the main part of the residual.
fn named(found: &Identified) -> Option<Concentration> {
    found.checks().iter().find_map(|check| match &check.finding {
        Finding::Misfit(Misfit { concentration, .. }) => concentration.clone(),
        _ => None,
    })
}

/// Four periods of one mass with lines 1 Hz apart; the displacement has 1 % noise, and `added` is
/// added to it.
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

/// In 50 records with mains interference (50 and 100 Hz) and 50 with run-out (24 and 48 Hz), each 1
/// % of the response, all these lines are named. In 150 correct records and 50 with a wrong known
/// mass no line is named.
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
    // Lines are 1/(256 · 0.008 s) = 0.488 Hz apart; the run-out at lines 12, 24, 36 … is periodic,
    // too.
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
    assert!(spoilt.to_string().contains("Exclude these lines with `without_hz`"), "{spoilt}");

    let lines = LeftOut { lines: Some("12,24,36".parse().unwrap()), ..LeftOut::default() };
    let rotation = Disturbance::rotation(12.0 * line_hz);
    let rotation = LeftOut { frequencies: vec![rotation], ..LeftOut::default() };
    for without in [lines, rotation] {
        let found = identify(&records, &Identify::default().without(without)).unwrap();
        assert!(!found.checks().iter().any(|check| check.is_conspicuous()), "{found}");
        assert!(error(&found.system().unwrap()) < 0.01, "{found}");
    }
}
