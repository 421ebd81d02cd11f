//! Forces with crosstalk between their channels or between the shakers, and sensors with a wrong
//! gain.

use mechid_analysis::{
    FrfSettings, FrfTable, Identify, Measurement, ResponseQuantity, Segmentation, frf, identify,
};
use mechid_checks::Finding;
use mechid_checks::Gain;
use mechid_model::SecondOrderSystem;
use mechid_problems::exact_harmonic_periodic;
use mechid_problems::machines::{Support, chain};
use mechid_signal::{Multisine, NoiseLevel, Phases, Record, Sampling, noise};
use nalgebra::DMatrix;

const PERIOD: usize = 256;

/// Returns a test with one shaker. A second force channel contains the fraction `part` of the force
/// of this shaker; both channels have noise of `level` times the RMS force.
fn one_shaker_and_its_shadow(periodic: bool, part: f64, level: f64, seed: u64) -> Measurement {
    let sampling = Sampling::new(0.008, 32 * PERIOD).unwrap();
    let system = chain(2, Support::Fixed, 0.02, 3);
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

/// Reference: (K − ω²M + iωC)⁻¹. If channel 2 of the force contains only noise and a part of force
/// 1, the responses to force 2 cannot be determined. An estimate would relate the response to the
/// noise, and would be a hundred times too large.
#[test]
fn a_force_that_follows_another_has_no_responses_and_is_told() {
    let system = chain(2, Support::Fixed, 0.02, 3);
    for (periodic, level) in [(true, 0.01), (true, 0.001), (false, 0.01), (false, 0.001)] {
        for seed in 1..6 {
            let measured = one_shaker_and_its_shadow(periodic, 0.02, level, seed);
            let how = FrfSettings {
                segments: Segmentation::with_samples(2048),
                ..FrfSettings::default()
            };
            let how = if periodic { FrfSettings::default() } else { how };
            let table = frf(&measured, &how).unwrap();
            let told = table
                .remarks
                .iter()
                .find(|remark| remark.contains("force 2 is coherent with force 1"));
            assert!(
                told.is_some_and(|told| told.contains("(at 2")),
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

/// A second shaker with a twentieth of the force of the first counts as an independent force; so
/// does a second shaker that is half coherent with the first.
#[test]
fn a_weak_shaker_of_its_own_is_kept() {
    let sampling = Sampling::new(0.008, 32 * PERIOD).unwrap();
    let system = chain(2, Support::Fixed, 0.02, 3);
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
            let how = FrfSettings {
                segments: Segmentation::with_samples(2048),
                ..FrfSettings::default()
            };
            let table = frf(&measured, &how).unwrap();
            assert_eq!(table.responses.len(), 4, "{follows} {own} {seed}: {table}");
        }
    }
}

/// Two shakers, each with every second line. A part of each force also acts at the other shaker.
/// All channels have noise of `level` times the RMS value.
fn interleaved_shakers(crosstalk: f64, level: f64, seed: u64) -> (SecondOrderSystem, FrfTable) {
    let period = Sampling::new(0.008, PERIOD).unwrap();
    let system = chain(2, Support::Fixed, 0.02, 3);
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

/// Reference: (K − ω²M + iωC)⁻¹. Two shakers excite alternate lines, with 1 % noise in all
/// channels. Each response is given only on the lines of its own force, and agrees with the
/// machine.
#[test]
fn responses_to_interleaved_forces_are_those_on_their_own_lines() {
    let (system, table) = interleaved_shakers(0.0, 0.01, 1);
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

/// RMS and largest error of the responses on the lines of their own force, divided by the standard
/// errors; and the RMS of the error that crosstalk of `part` would cause.
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

/// Reference: (K − ω²M + iωC)⁻¹. Noise alone is not reported as crosstalk, and the effect of 2 %
/// crosstalk is subtracted from the responses.
#[test]
fn crosstalk_between_interleaved_forces_is_told_and_taken_off() {
    let told = |table: &FrfTable| table.to_string().matches("% of the amplitude of").count();
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

/// Reference: the matrices of the machine, and the wrong factor of one sensor. A sensor in mm in a
/// record in m, or a sensor with a gain 20 % too large, changes only the symmetry of C and K; the
/// residual and the diagonal of M do not change. A correct record must not be reported. A bearing
/// must not be reported either, although its C and K are not symmetric.
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
            Finding::Gain(Gain { row, ratio, .. }) => Some((row, ratio)),
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
