//! Units of records: they are converted, or a check warns. Reference: an oscillator of 12 kg whose
//! exact steady state is written in the units of the header.

use mechid_analysis::{
    Channels, Identify, IdentifyResponses, Measurement, Reading, ResponseQuantity, Window,
    identify, identify_responses,
};
use mechid_io::FrequencyResponses;
use mechid_model::Sdof;
use mechid_problems::exact_harmonic_periodic;
use mechid_signal::{Multisine, Phases, Sampling, lines};

const PERIOD: usize = 128;
const RATE_HZ: f64 = 128.0;
const G: f64 = 9.80665;
const POUND: f64 = 4.448_221_615_260_5;

/// Two periods of force, displacement and acceleration, in SI units.
fn record() -> [Vec<f64>; 3] {
    let period = Sampling::from_rate_hz(RATE_HZ, PERIOD).unwrap();
    let force = Multisine::flat(lines::band(period, 3.0, 40.0), 2.0, Phases::Schroeder).unwrap();
    let force = force.sample(period).unwrap();
    let machine = Sdof::new(12.0, 90.0, 68_000.0).unwrap();
    let exact = exact_harmonic_periodic(&machine.system(), &force).unwrap();
    [&force, exact.displacement(), exact.acceleration()]
        .map(|record| record.repeated(2).unwrap().channel(0).to_vec())
}

/// Writes three columns of numbers below a header, and opens them by their column numbers.
fn open(
    header: &str,
    response: ResponseQuantity,
    numbers: [f64; 3],
    reading: &Reading,
) -> Measurement {
    let [force, x, a] = record();
    let response_values = if response == ResponseQuantity::Displacement { x } else { a };
    let [time, per_newton, per_si] = numbers;
    let mut text = format!("{header}\n");
    for (k, (f, r)) in force.iter().zip(&response_values).enumerate() {
        let t = time * k as f64 / RATE_HZ;
        text += &format!("{t:?},{:?},{:?}\n", f * per_newton, r * per_si);
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rig.csv");
    std::fs::write(&path, text).unwrap();
    let channels = Channels::new("2", response, "3");
    let record = Measurement::open_with(&path, &channels, reading).unwrap();
    record.window(Window { start: 1, period: Some(PERIOD), periods: None }).unwrap()
}

/// Identified mass in kg, and the warnings with the subject `unit`.
fn mass(measurement: Measurement) -> (f64, Vec<String>) {
    let found = identify(&[measurement], &Identify::default()).unwrap();
    let warnings =
        found.summary().checks.iter().filter(|check| check.subject.to_string() == "unit");
    let warnings = warnings.filter(|check| check.is_conspicuous()).map(|check| check.text.clone());
    (found.estimate().parameter("m").unwrap().value, warnings.collect())
}

#[test]
fn units_in_any_place_give_the_mass() {
    use ResponseQuantity::{Acceleration, Displacement};
    for (header, response, numbers) in [
        ("time,force_N,accel_g", Acceleration, [1.0, 1.0, 1.0 / G]),
        ("time,Force [N],Acc (G)", Acceleration, [1.0, 1.0, 1.0 / G]),
        ("time,Force [N],Acceleration (g) - X", Acceleration, [1.0, 1.0, 1.0 / G]),
        ("time,Force (lbs),x [m]", Displacement, [1.0, 1.0 / POUND, 1.0]),
        ("time,[kN] Force,Disp (in.)", Displacement, [1.0, 1e-3, 1.0 / 0.0254]),
        ("time,Force (kN) CH1,Disp [micron]", Displacement, [1.0, 1e-3, 1e6]),
        ("# time [s],force [N],acc [g]", Acceleration, [1.0, 1.0, 1.0 / G]),
        ("Time (msec),Force [mV; 11.2 mV/N],x [m]", Displacement, [1e3, 11.2, 1.0]),
    ] {
        let reading = Reading { time: Some("1".into()), ..Reading::default() };
        let (mass, warnings) = mass(open(header, response, numbers, &reading));
        assert!((mass / 12.0 - 1.0).abs() < 1e-6, "{header}: {mass}");
        assert!(warnings.is_empty(), "{header}: {warnings:?}");
    }
}

#[test]
fn what_is_not_understood_is_a_warning_with_its_factor() {
    use ResponseQuantity::{Acceleration, Displacement};
    let days = 1.0 / 86_400.0;
    for (header, response, time, told) in [
        ("time,Force [mV],x [m]", Displacement, 1.0, "\"mV\" in the header of column 2"),
        ("time,force,a_g", Acceleration, 1.0, "with the factor 9.80665"),
        ("time,force,x", Displacement, days, "in days the rate would be 128"),
    ] {
        let (_, warnings) = mass(open(header, response, [time, 1.0, 1.0], &Reading::default()));
        assert_eq!(warnings.len(), 1, "{header}: {warnings:?}");
        assert!(warnings[0].contains(told), "{header}: {warnings:?}");
    }
}

#[test]
fn a_unit_or_a_factor_that_is_stated_counts() {
    let mut reading = Reading::default();
    reading.units.insert("acc [V]".into(), "g".into());
    reading.units.insert("time".into(), "days".into());
    reading.scales.insert("Force [mV]".into(), 1.0 / 11.2);
    let numbers = [1.0 / 86_400.0, 11.2, 1.0 / G];
    let header = "time,Force [mV],acc [V]";
    let (mass, warnings) = mass(open(header, ResponseQuantity::Acceleration, numbers, &reading));
    assert!((mass / 12.0 - 1.0).abs() < 1e-4, "{mass}");
    assert!(warnings.is_empty(), "{warnings:?}");
}

/// A dataset 58 of an accelerance with this label and this direction of the force; `per_si` is the
/// number of its units in one SI unit.
fn accelerance(label: &str, per_si: f64, direction: i32) -> String {
    let hz: Vec<f64> = (1..=60).map(f64::from).collect();
    let mut text = format!(
        "    -1\n    58\nNONE\nNONE\nNONE\nNONE\nNONE\n\
         {:>5}{:>10}{:>5}{:>10} {:>10}{:>10}{:>4} {:>10}{:>10}{:>4}\n\
         {:>10}{:>10}{:>10}{:>13.5e}{:>13.5e}{:>13.5e}\n\
         {:>10}{:>5}{:>5}{:>5} {:20} {:20}\n\
         {:>10}{:>5}{:>5}{:>5} {:20} {label:20}\n\
         {:>10}{:>5}{:>5}{:>5} {:20} {:20}\n\
         {:>10}{:>5}{:>5}{:>5} {:20} {:20}\n",
        4,
        0,
        0,
        0,
        "NONE",
        1,
        3,
        "NONE",
        1,
        direction,
        6,
        hz.len(),
        1,
        1.0,
        1.0,
        0.0,
        18,
        0,
        0,
        0,
        "Frequency",
        "Hz",
        12,
        0,
        0,
        0,
        "Acceleration",
        13,
        0,
        0,
        0,
        "Force",
        "N",
        0,
        0,
        0,
        0,
        "NONE",
        "NONE",
    );
    for f in hz {
        let w = std::f64::consts::TAU * f;
        let (re, im) = (68_000.0 - 12.0 * w * w, 90.0 * w);
        let size = -w * w / (re * re + im * im) * per_si * f64::from(direction.signum());
        text += &format!("{:>20.11e}{:>20.11e}\n", size * re, -size * im);
    }
    text + "    -1\n"
}

#[test]
fn labels_and_directions_of_universal_files_are_read() {
    for (label, per_si, direction) in
        [("m/s^2", 1.0, 3), ("g", 1.0 / G, 3), ("mm/s^2", 1e3, 3), ("m/s^2", 1.0, -3)]
    {
        let text = accelerance(label, per_si, direction);
        let table = FrequencyResponses::parse("a.unv", text.as_bytes()).unwrap();
        let found = identify_responses(&[table], &IdentifyResponses::default()).unwrap();
        let mass = found.estimate().parameter("m").unwrap().value;
        assert!((mass / 12.0 - 1.0).abs() < 1e-6, "{label} {direction}: {mass}");
    }
}

/// Reference: the second response is the first times −0.5.
#[test]
fn frequency_responses_take_one_force_and_several_responses() {
    use mechid_analysis::{FrfSettings, frf};
    let [force, x, _] = record();
    let sampling = Sampling::from_rate_hz(RATE_HZ, force.len()).unwrap();
    let other: Vec<f64> = x.iter().map(|x| -0.5 * x).collect();
    let columns = [("f", &force[..]), ("x", &x[..]), ("y", &other[..])];
    let few = Channels::new("f", ResponseQuantity::Displacement, "x,y");
    let test = Measurement::from_columns(sampling, &columns, &few).unwrap();
    let table = frf(&test.period(PERIOD).unwrap(), &FrfSettings::default()).unwrap();
    assert_eq!(table.responses.len(), 2);
    for (at, re) in table.responses[0].real.iter().enumerate() {
        assert!((table.responses[1].real[at] + 0.5 * re).abs() <= 1e-12 * re.abs());
    }
}

/// Reference: the rows of H1 do not depend on each other, so the frequency responses of one output
/// are the same with and without other outputs.
#[test]
fn frequency_responses_take_fewer_responses_than_forces() {
    use mechid_analysis::frf::Estimator;
    use mechid_analysis::{FrfSettings, frf};
    use mechid_signal::noise;
    let sampling = Sampling::from_rate_hz(RATE_HZ, 32 * PERIOD).unwrap();
    let forces = noise::white(sampling, 2, 1.0, 3).unwrap();
    let [f1, f2] = [0, 1].map(|at| forces.channel(at));
    let delayed = |f: &[f64], k: usize| if k == 0 { 0.0 } else { f[k - 1] };
    let rows = 0..sampling.len();
    let x: Vec<f64> = rows.clone().map(|k| f1[k] - 0.3 * delayed(f2, k)).collect();
    let y: Vec<f64> = rows.map(|k| 0.7 * f2[k] + 0.2 * delayed(f1, k)).collect();
    let columns = [("f1", f1), ("f2", f2), ("x", &x[..]), ("y", &y[..])];
    let open = |force: &str, response: &str| {
        let channels = Channels::new(force, ResponseQuantity::Displacement, response);
        let test = Measurement::from_columns(sampling, &columns, &channels).unwrap();
        test.period(PERIOD).unwrap()
    };
    let how = |estimator| FrfSettings { estimator, ..FrfSettings::default() };
    for estimator in [Estimator::H1, Estimator::Hv] {
        let [alone, both] =
            ["x", "x,y"].map(|response| frf(&open("f1,f2", response), &how(estimator)).unwrap());
        assert_eq!([alone.responses.len(), both.responses.len()], [2, 4]);
        assert_eq!((alone.coherence.len(), alone.response_names.len()), (1, 1));
        assert_eq!(alone.force_names, ["f1", "f2"]);
        for (one, other) in alone.responses.iter().zip(&both.responses) {
            assert_eq!(one.real, other.real);
            assert_eq!(one.imaginary, other.imaginary);
        }
        let points = alone.to_responses(&["1+X".into(), "2+X".into()]).unwrap();
        assert_eq!(points.functions[1].reference, "2+X");
    }
    let why = |force: &str, response: &str, estimator| {
        frf(&open(force, response), &how(estimator)).unwrap_err().to_string()
    };
    let h2 = why("f1,f2", "x", Estimator::H2);
    assert!(
        h2.contains(
            "h2 of 2 forces needs as many responses as forces; the number of responses is 1"
        ),
        "{h2}"
    );
    let same = why("f1,f1", "x", Estimator::H1);
    assert!(same.contains("do not act independently"), "{same}");
    // With only as many periods as forces, no average is possible.
    let short = open("f1,f2", "x");
    let window = Window { start: 1, period: Some(PERIOD), periods: Some(2) };
    let few = frf(&short.window(window).unwrap(), &how(Estimator::H1)).unwrap_err().to_string();
    assert!(few.contains('3'), "{few}");
}

#[test]
fn a_drop_out_of_the_force_is_named_among_the_checks() {
    let [force, x, _] = record().map(|channel| channel.repeat(5));
    let sampling = Sampling::from_rate_hz(RATE_HZ, force.len()).unwrap();
    let channels = Channels::new("f", ResponseQuantity::Displacement, "x");
    let named = |force: &[f64]| {
        let columns = [("f", force), ("x", &x[..])];
        let test = Measurement::from_columns(sampling, &columns, &channels).unwrap();
        let found = identify(&[test.period(PERIOD).unwrap()], &Identify::default()).unwrap();
        let checks = found.summary().checks.iter().map(|check| check.text.clone());
        checks.filter(|text| text.contains("drop-out")).collect::<Vec<_>>()
    };
    assert_eq!(named(&force), [] as [String; 0]);
    let mut faulty = force.clone();
    faulty[500..530].fill(0.0);
    let [text] = &named(&faulty)[..] else { panic!("{:?}", named(&faulty)) };
    assert!(text.contains("f ") && text.contains("sample 501"), "{text}");
}
