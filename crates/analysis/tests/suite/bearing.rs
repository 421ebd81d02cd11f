//! Bearing tests on a simulated rig with known film coefficients.

use std::f64::consts::TAU;

use mechid_analysis::bearing::{BearingSize, BearingTable, Coefficients};
use mechid_analysis::identify::LineChoice;
use mechid_analysis::{
    BearingData, FrfSettings, IdentifiedBearing, IdentifyBearing, Measurement, ResponseQuantity,
    frf, identify_bearing,
};
use mechid_checks::Finding;
use mechid_io::{FrequencyResponses, ResponseFunction};
use mechid_model::elements::{Element, Input, Instruments, Machine, Sensor};
use mechid_problems::rig::{BearingRig, RigTest, Shakers};
use mechid_signal::{Record, Sampling};
use nalgebra::{Complex, Matrix2};

const PERIOD: usize = 256;

fn sampling() -> Sampling {
    Sampling::from_rate_hz(1024.0, PERIOD).unwrap()
}

/// Returns the lines from 24 to 200 Hz, 8 Hz apart.
fn lines() -> Vec<usize> {
    (6..=50).step_by(2).collect()
}

/// Coefficients from the third row of Lund and Thomsen's table at 3000 rev/min, with or without
/// inertia of the fluid.
fn film(inertia: f64) -> [Matrix2<f64>; 3] {
    let load = 2500.0;
    let k = load / 100e-6;
    let c = k / (TAU * 50.0);
    [
        Matrix2::new(2.93, 3.37, -0.34, 1.90) * k,
        Matrix2::new(6.79, 2.06, 2.06, 2.32) * c,
        Matrix2::new(1.0, 0.3, -0.4, 0.8) * inertia,
    ]
}

pub(super) fn rig(inertia: f64) -> BearingRig {
    BearingRig::new(film(inertia))
}

pub(super) fn with_baseline(inertia: f64) -> BearingRig {
    let k = Matrix2::new(6.0, 0.5, 0.3, 5.0) * 1e6;
    let c = Matrix2::new(2.0, 0.1, 0.1, 1.5) * 1e3;
    BearingRig { baseline: [k, c, Matrix2::identity() * 0.4], ..rig(inertia) }
}

pub(super) fn settings(rig: &BearingRig) -> IdentifyBearing {
    IdentifyBearing {
        stator_mass: rig.stator_mass,
        rotation_hz: Some(rig.rotation_hz),
        ..IdentifyBearing::default()
    }
}

pub(super) fn measurement(test: &RigTest) -> Measurement {
    let responses = [
        (ResponseQuantity::Displacement, &test.displacement),
        (ResponseQuantity::Acceleration, &test.acceleration),
    ];
    Measurement::from_records(&test.force, &responses).unwrap().period(PERIOD).unwrap()
}

/// Periods of tests without noise; the shakers act one after the other.
pub(super) fn periods(rig: &BearingRig, amplitude: f64) -> Vec<RigTest> {
    let one = |(shakers, seed)| rig.period(sampling(), &lines(), amplitude, shakers, seed).unwrap();
    [(Shakers::X, 1), (Shakers::Y, 2)].map(one).to_vec()
}

pub(super) fn data(rig: &BearingRig, periods: &[RigTest], count: usize, seed: u64) -> BearingData {
    let test = |(at, period): (u64, &RigTest)| {
        measurement(&rig.measured(period, count, 10 * seed + at).unwrap())
    };
    let tests: Vec<Measurement> = (0..).zip(periods).map(test).collect();
    BearingData::from_records(&tests, &settings(rig)).unwrap()
}

fn truth(film: &[Matrix2<f64>; 3], count: usize) -> Vec<f64> {
    let all = film.iter().flat_map(|m| m.transpose().iter().copied().collect::<Vec<_>>());
    all.take(count).collect()
}

fn values(found: &IdentifiedBearing) -> Vec<f64> {
    found.summary().coefficients.iter().map(|c| c.estimate.value).collect()
}

/// Largest error of a coefficient, divided by the largest coefficient of its matrix.
fn worst(found: &IdentifiedBearing, film: &[Matrix2<f64>; 3]) -> f64 {
    let kinds = [found.stiffness(), found.damping(), found.mass()];
    let error = |(a, b): (&Matrix2<f64>, &Matrix2<f64>)| (a - b).amax() / b.amax();
    kinds.iter().zip(film).map(error).fold(0.0, f64::max)
}

#[test]
fn without_noise_twelve_coefficients_are_exact() {
    let quiet = |rig: BearingRig| BearingRig {
        force_noise: 0.0,
        acceleration_noise: 0.0,
        displacement_noise: 0.0,
        ..rig
    };
    let plain = quiet(rig(3.0));
    let of = |rig: &BearingRig, tests: &[RigTest]| {
        let tests: Vec<Measurement> = tests.iter().map(measurement).collect();
        BearingData::from_records(&tests, &settings(rig)).unwrap()
    };
    let in_turn = of(&plain, &periods(&plain, 20.0));
    let both = plain.period(sampling(), &lines(), 20.0, Shakers::Interleaved, 3).unwrap();
    for data in [in_turn, of(&plain, &[both])] {
        let found = identify_bearing(&data, None, &settings(&plain)).unwrap();
        assert!(worst(&found, &plain.film) < 1e-9, "{found}");
        for line in &found.summary().dynamic_stiffness {
            let h = plain.dynamic_stiffness(TAU * line.frequency_hz);
            let entries = [h[(0, 0)], h[(0, 1)], h[(1, 0)], h[(1, 1)]];
            for (at, z) in entries.into_iter().enumerate() {
                let error = Complex::new(line.real[at], line.imaginary[at]) - z;
                assert!(error.norm() < 1e-8 * h.norm(), "{line:?}");
            }
        }
    }
    // With a baseline and run-out, the lines of the run-out are excluded.
    let whole = BearingRig { run_out: vec![2e-6, 1e-6, 5e-7], ..quiet(with_baseline(3.0)) };
    let rig_test = of(&whole, &periods(&whole, 20.0));
    let dry = of(&whole.dry(), &periods(&whole.dry(), 20.0));
    let found = identify_bearing(&rig_test, Some(&dry), &settings(&whole)).unwrap();
    assert!(worst(&found, &whole.film) < 1e-9, "{found}");
    assert_eq!(found.summary().left_out_hz, [48.0, 152.0, 200.0]);
}

/// Frequency responses d/f and a/f of a rig at 24, 28 … 200 Hz: relative displacement and
/// acceleration over force.
fn tables(rig: &BearingRig) -> [FrequencyResponses; 2] {
    let frequency_hz: Vec<f64> = (0..45).map(|k| 24.0 + 4.0 * f64::from(k)).collect();
    [ResponseQuantity::Displacement, ResponseQuantity::Acceleration].map(|quantity| {
        let at = |hz: &f64| {
            let omega = TAU * hz;
            let inertia = Complex::from(-omega * omega * rig.stator_mass);
            let h = rig.dynamic_stiffness(omega) + Matrix2::from_diagonal_element(inertia);
            h.lu().solve(&Matrix2::identity()).unwrap() * quantity.per_displacement(omega)
        };
        let all: Vec<_> = frequency_hz.iter().map(at).collect();
        let pairs = [(0, 0), (0, 1), (1, 0), (1, 1)];
        let functions = pairs.map(|(i, j)| ResponseFunction {
            response: format!("{}", i + 1),
            reference: format!("{}", j + 1),
            quantity: None,
            values: all.iter().map(|h| h[(i, j)]).collect(),
            standard_error: None,
        });
        FrequencyResponses {
            file: format!("{quantity}.csv"),
            frequency_hz: frequency_hz.clone(),
            functions: functions.to_vec(),
            ..FrequencyResponses::default()
        }
    })
}

#[test]
fn tables_of_frequency_responses_give_the_same() {
    let rig = rig(3.0);
    let how = settings(&rig);
    let [d, a] = tables(&rig);
    let tables = [d, a];
    let data = BearingData::from_responses(&tables, &how).unwrap();
    let found = identify_bearing(&data, None, &how).unwrap();
    assert!(worst(&found, &rig.film) < 1e-9, "{found}");
    let left_out: Vec<f64> = found.summary().left_out_hz.iter().map(|hz| hz.round()).collect();
    assert_eq!(left_out, [48.0, 52.0, 100.0, 148.0, 152.0, 200.0]);
    assert!(found.summary().remarks[0].contains("neither standard errors nor coherence"));
    let refused = |tables: &[FrequencyResponses], how: &IdentifyBearing, words: &str| {
        let told = BearingData::from_responses(tables, how).unwrap_err().to_string();
        assert!(told.contains(words), "{told}");
    };
    let one = IdentifyBearing { points: vec!["1".into()], ..how.clone() };
    refused(&tables, &one, "choose two `points`");
    refused(
        &tables[..1],
        &how,
        "a test needs two tables, one of displacement and one of acceleration; the number of tables is 1",
    );
    refused(&[], &how, "no record");
    let numbered =
        IdentifyBearing { lines: "3:9".parse().map(LineChoice::Lines).unwrap(), ..how.clone() };
    refused(&tables, &numbered, "`lines`: the lines of frequency responses have no numbers");
    let still = IdentifyBearing { rotation_hz: Some(4.0), ..how };
    refused(&tables, &still, "every frequency is a multiple of the rotation frequency");
}

/// Records of `count` periods in x and as many in y, and the tables of d/f and a/f that `mechid
/// frf` would write for these records.
fn records_and_tables(
    rig: &BearingRig,
    count: usize,
    seed: u64,
) -> (Vec<Measurement>, Vec<FrequencyResponses>) {
    let mut tables = Vec::new();
    let mut tests = Vec::new();
    for (at, period) in (0..).zip(&periods(rig, 20.0)) {
        let test = rig.measured(period, count, 10 * seed + at).unwrap();
        tests.push(measurement(&test));
        // The load cell of the shaker at rest measures only noise, so no table is made from it.
        let mut force = test.force.data().clone();
        force.fill_column(1 - at as usize, 0.0);
        let force = Record::new(test.force.sampling(), force).unwrap();
        for (quantity, response) in [
            (ResponseQuantity::Displacement, &test.displacement),
            (ResponseQuantity::Acceleration, &test.acceleration),
        ] {
            let one = Measurement::from_records(&force, &[(quantity, response)]).unwrap();
            let table = frf(&one.period(PERIOD).unwrap(), &FrfSettings::default()).unwrap();
            tables.push(FrequencyResponses::parse("h.csv", table.csv().as_bytes()).unwrap());
        }
    }
    (tests, tables)
}

/// Results from records of `count` periods in x and as many in y, and results from their tables.
fn from_records_and_tables(rig: &BearingRig, count: usize, seed: u64) -> [IdentifiedBearing; 2] {
    let (tests, tables) = records_and_tables(rig, count, seed);
    // Without a rotation frequency, the records and the tables are fitted on the same lines. With a
    // rotation frequency, a record and its table would exclude different lines near the multiples
    // of this frequency.
    let twelve = Coefficients::Twelve;
    let how = IdentifyBearing { rotation_hz: None, coefficients: twelve, ..settings(rig) };
    [BearingData::from_records(&tests, &how), BearingData::from_responses(&tables, &how)]
        .map(|data| identify_bearing(&data.unwrap(), None, &how).unwrap())
}

/// A table whose phase is missing is named by a check before the fit.
#[test]
fn tables_are_checked_before_the_fit() {
    let rig = rig(3.0);
    let (_, mut tables) = records_and_tables(&rig, 16, 1);
    let how = IdentifyBearing { rotation_hz: None, ..settings(&rig) };
    let is_named = |tables: &[FrequencyResponses]| {
        let data = BearingData::from_responses(tables, &how).unwrap();
        let found = identify_bearing(&data, None, &how).unwrap();
        let mut checks = found.summary().checks.iter();
        checks.any(|check| matches!(check.finding, Finding::ConstantPhase(_)))
    };
    assert!(!is_named(&tables));
    for function in &mut tables[1].functions {
        function.values.iter_mut().for_each(|value| *value = value.norm().into());
    }
    assert!(is_named(&tables));
}

/// If the force is measured without noise and the weights are accurate, a record and its tables
/// give the same results. Noise on the force causes correlated errors of both responses, and the
/// tables do not state this correlation.
#[test]
fn records_and_their_tables_agree() {
    let rig = rig(3.0);
    let exact_force = BearingRig { force_noise: 0.0, ..rig.clone() };
    for (rig, count, runs, allowed) in [(exact_force, 256, 3, 0.1), (rig, 16, 30, 0.4)] {
        let (mut inside, mut apart) = (0.0, 0.0_f64);
        for seed in 0..runs {
            let [of_records, of_tables] = from_records_and_tables(&rig, count, seed);
            inside += share(&of_tables, &rig.film) / runs as f64;
            let pairs = of_records.summary().coefficients.iter();
            for (a, b) in pairs.zip(&of_tables.summary().coefficients) {
                let (a, b) = (a.estimate, b.estimate);
                let difference = (a.value - b.value) / a.standard_error.unwrap();
                apart += difference.powi(2) / (12 * runs) as f64;
            }
        }
        // The RMS of the differences is given in standard errors.
        assert!(apart.sqrt() < allowed, "{}", apart.sqrt());
        // The share of correct intervals may differ from 95 %, because the 360 intervals are
        // correlated and their standard errors come from only sixteen periods.
        assert!(runs < 30 || (0.88..=0.985).contains(&inside), "{inside}");
    }
}

/// Share of the 95 % intervals that contain the true value.
fn share(found: &IdentifiedBearing, film: &[Matrix2<f64>; 3]) -> f64 {
    let rows = &found.summary().coefficients;
    let truth = truth(film, rows.len());
    let inside = rows.iter().zip(&truth).filter(|(row, exact)| {
        let [low, high] = row.estimate.interval.unwrap();
        (low..=high).contains(exact)
    });
    inside.count() as f64 / rows.len() as f64
}

/// Coefficients of one test are correlated, so the mean coverage of 80 tests scatters by about 1 %.
/// The example `bearing_study` uses thousands of tests.
#[test]
fn intervals_hold_with_the_baseline_subtracted_and_not_without() {
    let runs = 80;
    for (inertia, coefficients) in [(3.0, Coefficients::Twelve), (0.0, Coefficients::Eight)] {
        let rig = with_baseline(inertia);
        let dry = rig.dry();
        let (tests, baseline) = (periods(&rig, 20.0), periods(&dry, 20.0));
        let how = IdentifyBearing { coefficients, ..settings(&rig) };
        let (mut with, mut without, mut rejected) = (0.0, 0.0, 0);
        for seed in 0..runs {
            let test = data(&rig, &tests, 8, seed);
            let base = data(&dry, &baseline, 8, 100_000 + seed);
            let found = identify_bearing(&test, Some(&base), &how).unwrap();
            with += share(&found, &rig.film) / runs as f64;
            rejected += u64::from(found.inertia_test().unwrap().p_value < 0.05);
            let bare = identify_bearing(&test, None, &how).unwrap();
            without += share(&bare, &rig.film) / runs as f64;
        }
        assert!((0.915..=0.985).contains(&with), "{coefficients:?}: {with}");
        assert!(without < 0.7, "{coefficients:?}: {without}");
        let false_alarms = rejected as f64 / runs as f64;
        match coefficients {
            // At an expected rate of false alarms of 5 %, four standard errors of the rate in 80
            // tests are 10 %.
            Coefficients::Eight => assert!(false_alarms < 0.15, "{false_alarms}"),
            _ => assert!(false_alarms > 0.95, "{false_alarms}"),
        }
    }
}

#[test]
fn a_result_tells_what_a_bearing_engineer_asks() {
    let rig = rig(0.0);
    let size = BearingSize {
        clearance: Some(100e-6),
        diameter: Some(0.1),
        length: Some(0.05),
        viscosity: Some(0.02),
    };
    let how = IdentifyBearing { load: Some(2500.0), size, ..settings(&rig) };
    let tests = |amplitude: f64| data(&rig, &periods(&rig, amplitude), 8, 5);
    let found = identify_bearing(&tests(20.0), None, &how).unwrap();
    let summary = found.summary();
    let scaled = summary.dimensionless.as_ref().unwrap();
    // The table of Lund and Thomsen has 2.93 for kxx and 6.79 for cxx.
    for (name, exact) in [("kxx", 2.93), ("kyx", -0.34), ("cxx", 6.79)] {
        let row = scaled.coefficients.iter().find(|row| row.name == name).unwrap();
        let error = row.estimate.standard_error.unwrap();
        assert!((row.estimate.value - exact).abs() < 4.0 * error && error < 0.1, "{row:?}");
    }
    let sommerfeld = scaled.sommerfeld_number.unwrap();
    assert!((sommerfeld - 0.02 * 50.0 * 0.05 * 0.1 * 500.0_f64.powi(2) / 2500.0).abs() < 1e-12);
    let stability = summary.stability.as_ref().unwrap();
    let ratio = stability.whirl_frequency_ratio.unwrap();
    assert!((0.2..0.6).contains(&ratio.value) && ratio.standard_error.unwrap() < 0.05, "{ratio:?}");
    assert!(summary.amplitude.unwrap().over_clearance.unwrap() < 0.05);
    assert!(summary.remarks.is_empty(), "{:?}", summary.remarks);

    let massless = |machine: Machine, dof| machine.with(dof, Element::mass(dof, 0.0));
    let machine = ["x", "y"].into_iter().fold(summary.machine.clone().unwrap(), massless);
    let instruments = Instruments {
        sensors: vec![Sensor::new("x", ResponseQuantity::Displacement)],
        inputs: vec![Input::force("x")],
        ..Instruments::default()
    };
    let assembly = machine.assembly(&instruments).unwrap();
    let omega = TAU * 70.0;
    let stiffness = assembly.dynamic_stiffness(&assembly.start(), omega, |_| true);
    let expected = found.stiffness().map(Complex::from)
        + found.damping().map(|c| Complex::new(0.0, omega * c))
        - found.mass().map(|m| Complex::from(omega * omega * m));
    let difference = expected - stiffness.fixed_view::<2, 2>(0, 0);
    assert!(difference.norm() < 1e-12 * expected.norm(), "{stiffness} {expected}");
    let priors: Vec<f64> =
        assembly.parameters().iter().map(|p| p.prior.unwrap().standard_deviation).collect();
    let errors = summary.coefficients.iter().map(|row| row.estimate.standard_error.unwrap());
    assert_eq!(priors, errors.collect::<Vec<_>>());
    assert_eq!(serde_json::to_value(&machine).unwrap()["elements"][0]["kind"], "bearing");

    let loud = identify_bearing(&tests(2000.0), None, &how).unwrap();
    assert!(loud.summary().remarks[0].contains("of the clearance. Above 0.05"));

    let stability = found.summary().stability.clone().unwrap();
    let table = BearingTable::new([loud, found]).csv();
    let header = table.lines().next().unwrap();
    assert!(
        header.starts_with("speed,load,kxx,kxy,kyx,kyy,cxx,cxy,cyx,cyy,mxx,mxy,myx,myy,kxx_st")
    );
    let speed: f64 = table.lines().nth(1).unwrap().split(',').next().unwrap().parse().unwrap();
    assert_eq!(speed, TAU * 50.0);
    let cells = [stability.whirl_frequency_ratio, stability.critical_mass].map(|value| {
        let value = value.unwrap();
        format!(",{:?},{:?}", value.value, value.standard_error.unwrap())
    });
    assert!(header.ends_with("critical_mass,critical_mass_standard_error"), "{header}");
    assert!(table.lines().any(|row| row.ends_with(&cells.concat())), "{table}");
    let negative = IdentifyBearing { stator_mass: -1.0, ..how };
    let refused = identify_bearing(&tests(20.0), None, &negative).unwrap_err().to_string();
    assert_eq!(refused, "`stator_mass`: a positive number is needed, not -1");
    assert_eq!(values(&identify_bearing(&tests(20.0), None, &settings(&rig)).unwrap()).len(), 8);
}
