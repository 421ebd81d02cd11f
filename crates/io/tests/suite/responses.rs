//! Reading and writing of frequency responses. Reference for universal files: pyuff wrote
//! `printed.unv` and `binary.unv` (`data/make.py`).

use mechid_io::{
    AveragedSegments, CoherenceFunction, Evidence, FrequencyResponses, IoError, Quantity,
    ResponseFunction,
};
use mechid_model::ResponseQuantity;
use mechid_signal::Window;
use nalgebra::Complex;

const PRINTED: &[u8] = include_bytes!("../data/printed.unv");
const BINARY: &[u8] = include_bytes!("../data/binary.unv");

fn parse(text: &str) -> Result<FrequencyResponses, IoError> {
    FrequencyResponses::parse("a.csv", text.as_bytes())
}

#[test]
fn universal_files_of_another_program_are_read() {
    for bytes in [PRINTED, BINARY] {
        let found = FrequencyResponses::parse("a.unv", bytes).unwrap();
        assert_eq!(found.functions.len(), 1);
        let function = &found.functions[0];
        assert_eq!((function.response.as_str(), function.reference.as_str()), ("12+Z", "1-X"));
        assert_eq!(function.quantity, Some(ResponseQuantity::Acceleration));
        let expected: Vec<_> = (0..8).map(|k| Complex::new(0.5_f64.powi(k), 1.0)).collect();
        assert_eq!(function.values, expected);
        let hz: Vec<f64> = (0..8).map(|k| 1.0 + 0.25 * f64::from(k)).collect();
        assert_eq!(found.frequency_hz, hz);
        assert!(found.remarks[0].contains("neither a frequency response nor a coherence (4)"));
    }
}

fn two_by_one(frequency_hz: Vec<f64>) -> FrequencyResponses {
    let function = |response: &str, of: f64| ResponseFunction {
        response: response.into(),
        reference: "1+X".into(),
        quantity: Some(ResponseQuantity::Velocity),
        values: frequency_hz.iter().map(|f| Complex::new(of / f, -of * f * 1e-7)).collect(),
        standard_error: None,
    };
    let coherence = |response: &str, of: f64| CoherenceFunction {
        response: response.into(),
        reference: Some("1+X".into()),
        values: frequency_hz.iter().map(|f| 1.0 - of / (100.0 + f)).collect(),
    };
    FrequencyResponses {
        file: "rig\n    -1".into(),
        functions: vec![function("1+X", 1.0), function("2-RY", -3e-12)],
        coherence: vec![coherence("1+X", 0.3), coherence("2-RY", 0.5)],
        frequency_hz,
        added_decay: Some(4.964_321),
        segments: Some(AveragedSegments {
            samples: 1024,
            hop: 512,
            count: 155,
            window: Some(Window::Hann),
            sample_rate_hz: 1000.0 / 3.0,
        }),
        remarks: Vec::new(),
        doubts: Vec::new(),
        memory: None,
    }
}

/// Universal files are read back. Their numbers have 13 digits; their frequencies have as many
/// digits as fit into 13 columns.
#[test]
fn universal_files_are_read_back() {
    let even: Vec<f64> = (0..101).map(|k| 78.125 + 0.59604644775 * f64::from(k)).collect();
    let uneven: Vec<f64> = (0..10).map(|k| 10.0 * 1.25_f64.powi(k)).collect();
    for frequency_hz in [even, uneven, vec![31.25]] {
        let written = two_by_one(frequency_hz);
        let text = written.to_universal_file().unwrap();
        assert!(text.lines().all(|line| line.len() <= 80), "{text}");
        let numbers: Vec<&str> = text
            .lines()
            .zip(text.lines().skip(1))
            .filter_map(|(mark, id)| (mark == "    -1" && id != "    -1").then_some(id))
            .collect();
        assert_eq!(numbers, ["   151", "   164", "    58", "    58", "    58", "    58"]);
        let read = FrequencyResponses::parse("b.unv", text.as_bytes()).unwrap();
        assert!(read.remarks.is_empty(), "{:?}", read.remarks);
        assert_eq!(read.added_decay, written.added_decay);
        assert_eq!(read.segments, written.segments);
        let near = |a: f64, b: f64, by: f64| (a - b).abs() <= by * a.abs();
        let pairs = written.frequency_hz.iter().zip(&read.frequency_hz);
        assert!(pairs.into_iter().all(|(a, b)| near(*a, *b, 1e-7)), "{:?}", read.frequency_hz);
        assert_eq!(written.functions.len(), read.functions.len());
        for (a, b) in written.functions.iter().zip(&read.functions) {
            assert_eq!(
                (&a.response, &a.reference, a.quantity),
                (&b.response, &b.reference, b.quantity)
            );
            let pairs = a.values.iter().zip(&b.values);
            assert!(pairs.into_iter().all(|(a, b)| (a - b).norm() <= 1e-12 * a.norm()));
        }
        for (a, b) in written.coherence.iter().zip(&read.coherence) {
            assert_eq!((&a.response, &a.reference), (&b.response, &b.reference));
            assert!(a.values.iter().zip(&b.values).all(|(a, b)| near(*a, *b, 1e-12)));
        }
    }
}

#[test]
fn stated_units_become_si_units() {
    // Responses in mm/s per mN: a factor of 1000 each for length and force.
    let text = two_by_one(vec![1.0, 2.0]).to_universal_file().unwrap();
    let one = "  1.00000000000000000D+00";
    let milli = "  1.00000000000000000D+03";
    let inch = "  3.93700787401574800D+01";
    let of = |length: &str, force: &str| {
        let factors = format!("{length}{force}{one}");
        FrequencyResponses::parse("b.unv", text.replace(&one.repeat(3), &factors).as_bytes())
            .unwrap()
    };
    assert_eq!(of(milli, milli).functions[0].values[0].re, 1.0);
    let found = of(inch, one);
    assert!((found.functions[0].values[0].re - 0.0254).abs() < 1e-15);
    assert!(found.remarks[0].contains("multiplied by 0.0254"), "{:?}", found.remarks);
}

/// The frequencies of the file are 1 and 2 in the unit of the label. Reference: 2π rad per cycle,
/// 60 s per minute.
#[test]
fn labels_of_the_abscissa_state_the_unit_of_the_frequencies() {
    let text = two_by_one(vec![1.0, 2.0]).to_universal_file().unwrap();
    let label = format!("{:<20} {:<20}", "Frequency", "Hz");
    assert!(text.contains(&label));
    let with = |name: &str, unit: &str| {
        let text = text.replace(&label, &format!("{name:<20} {unit:<20}"));
        FrequencyResponses::parse("b.unv", text.as_bytes()).unwrap()
    };
    for (name, unit, in_hz) in [
        ("Frequency", "rad/s", 0.5 / std::f64::consts::PI),
        ("NONE", "rad/s", 0.5 / std::f64::consts::PI),
        ("Frequency (rad/s)", "NONE", 0.5 / std::f64::consts::PI),
        ("Frequency", "kHz", 1e3),
        ("Speed", "RPM", 1.0 / 60.0),
    ] {
        let found = with(name, unit);
        for (hz, number) in found.frequency_hz.iter().zip([1.0, 2.0]) {
            assert!((hz / (number * in_hz) - 1.0).abs() < 1e-12, "{name}, {unit}: {hz}");
        }
        let remarks = found.remarks.join("; ");
        assert!(remarks.contains("the frequencies were multiplied by"), "{remarks}");
        assert!(found.doubts.is_empty(), "{name}, {unit}: {:?}", found.doubts);
    }
    for (name, unit) in [("NONE", "NONE"), ("Frequency", "FREQUENCY"), ("Frequency", "HERTZ")] {
        let found = with(name, unit);
        assert_eq!((found.frequency_hz.len(), found.frequency_hz[1]), (2, 2.0), "{name}, {unit}");
        assert!(found.doubts.is_empty() && found.remarks.is_empty(), "{name}, {unit}");
    }
    for unit in ["orders", "ms"] {
        let found = with("Frequency", unit);
        assert_eq!(found.frequency_hz, [1.0, 2.0]);
        let (_, stated, quantity) = &found.doubts[0];
        assert_eq!((stated.text.as_str(), *quantity), (unit, Quantity::Frequency));
        assert_eq!((stated.evidence, found.doubts.len()), (Evidence::Unused, 1));
    }
}

#[test]
fn tables_in_every_form() {
    let polar = parse("f;h_2_1_magnitude;h_2_1_phase_deg\n1,5;2,0;90\n2,5;1,0;-90\n").unwrap();
    assert_eq!(polar.frequency_hz, [1.5, 2.5]);
    let function = &polar.functions[0];
    assert_eq!((function.response.as_str(), function.reference.as_str()), ("2", "1"));
    assert!((function.values[0] - Complex::new(0.0, 2.0)).norm() < 1e-15);
    let radians = parse("freq,magnitude,phase_rad\n1,2,1.5707963267948966\n2,1,0\n").unwrap();
    assert!((radians.functions[0].values[0] - Complex::new(0.0, 2.0)).norm() < 1e-15);
    let whole = "frequency_hz,h_1_1_real,h_1_1_imaginary,h_1_1_standard_error,h_2_1_real,\
                 h_2_1_imaginary,coherence_1,coherence_2_1\n5,1,2,0.1,3,4,0.9,0.8\n";
    let whole = parse(whole).unwrap();
    assert_eq!(whole.functions[0].standard_error.as_deref(), Some(&[0.1][..]));
    assert_eq!(whole.functions[1].values, [Complex::new(3.0, 4.0)]);
    assert_eq!(whole.coherence[0].reference, None);
    assert_eq!(whole.coherence[1].reference.as_deref(), Some("1"));
}

/// Levels in dB, orders of a rotational speed, and points in brackets are read. Reference: a level
/// is 20 log₁₀ of the magnitude, and a frequency is the order times the speed.
#[test]
fn levels_orders_and_points_in_brackets() {
    let level =
        parse("f,\"H(2,1) mag [dB(g/N)]\",\"H(2,1) phase [deg]\"\n1,20,0\n2,40,0\n").unwrap();
    let function = &level.functions[0];
    assert_eq!((function.response.as_str(), function.reference.as_str()), ("2", "1"));
    assert_eq!(function.quantity, Some(ResponseQuantity::Acceleration));
    assert!((function.values[0].re - 98.0665).abs() < 1e-12, "{}", function.values[0]);
    let orders = parse("order,speed_rpm,real,imaginary\n1,1500,1,0\n2,1500,1,0\n").unwrap();
    assert_eq!(orders.frequency_hz, [25.0, 50.0]);
    let message = parse("order,real,imaginary\n1,1,0\n").unwrap_err().to_string();
    assert!(message.contains("multiply the orders") && message.contains("speed_rpm"), "{message}");
}

#[test]
fn broken_tables_are_refused() {
    for (text, message) in [
        ("frequency_hz,x\n1,2\n", "a.csv has no frequency response: name columns h_1_1_real and"),
        (
            "f,real [g/N],imag [g/N]\nHz,m/s²/N,g/N\n1,2,3\n2,3,4\n",
            "a.csv: column 2 \"real [g/N]\" states m/s²/N and g/N: state one unit",
        ),
        (
            "f,receptance real [g/N],receptance imag [g/N]\n1,2,3\n2,3,4\n",
            "states g/N and a displacement per force in the name",
        ),
        ("frequency_hz,real\n1,2\n", "a.csv: column 2 \"real\" has no imaginary part beside it"),
        ("frequency_hz,real,imag\n1,2,\n", "a.csv, line 2, column 3 \"imag\": the field is empty"),
        ("    -1\n   164\n         1\n    -1\n", "a.csv, line 4: the units"),
    ] {
        let e = parse(text).unwrap_err().to_string();
        assert!(e.contains(message.split(':').next().unwrap()), "{e}");
    }
    let mut nameless = two_by_one(vec![1.0]);
    nameless.functions[0].response = "drive end".into();
    let e = nameless.to_universal_file().unwrap_err().to_string();
    assert!(e.starts_with("\"drive end\" is not a point of a universal file"), "{e}");
    let text = two_by_one(vec![1.0, 2.0, 3.0]).to_universal_file().unwrap();
    for (what, by, message) in [
        ("        18    0", "        17    0", "needs type 18 (frequency)"),
        ("        13    0", "        12    0", "must be per excitation force"),
    ] {
        assert!(text.contains(what));
        let e = FrequencyResponses::parse("b.unv", text.replace(what, by).as_bytes()).unwrap_err();
        assert!(e.to_string().contains(message), "{e}");
    }
    for end in 40..text.len() - 8 {
        match FrequencyResponses::parse("b.unv", &text.as_bytes()[..end]) {
            Ok(found) => assert!(found.functions.len() + found.coherence.len() < 4, "{end}"),
            Err(IoError::Malformed { .. } | IoError::Empty { .. }) => {}
            Err(e) => panic!("cut at {end}: {e}"),
        }
    }
}

/// Averaging segments with impossible settings are ignored and reported.
#[test]
fn impossible_segments_are_reported() {
    let table = |segments: [&str; 5]| {
        let names = AveragedSegments::COLUMNS.join(",");
        let row = |hz: u32| format!("\n{hz},1,0,{}", segments.join(","));
        let text = format!("frequency_hz,h_1_1_real,h_1_1_imaginary,{names}{}{}", row(1), row(2));
        FrequencyResponses::parse("a.csv", text.as_bytes()).unwrap()
    };
    let good = table(["1024", "512", "10", "1", "512"]);
    assert_eq!(good.segments.unwrap().window, Some(Window::Hann));
    assert!(good.remarks.is_empty());
    for wrong in [
        ["1024", "512", "10", "9", "512"],
        ["1024", "2048", "10", "1", "512"],
        ["1024", "512", "0", "1", "512"],
        ["1024.5", "512", "10", "1", "512"],
        ["1e12", "512", "10", "1", "512"],
        ["1024", "512", "10", "1", "-1"],
    ] {
        let read = table(wrong);
        assert_eq!(read.segments, None, "{wrong:?}");
        assert!(read.remarks[0].contains("segment_samples"), "{:?}", read.remarks);
    }
}

/// Returns frequencies, in Hz, and the accelerance of a mass of 5 kg with a natural frequency of 18
/// Hz.
fn accelerance() -> (Vec<f64>, Vec<Complex<f64>>) {
    let hz: Vec<f64> = (1..=40).map(f64::from).collect();
    let value = |hz: &f64| {
        let (w, w0) = (std::f64::consts::TAU * hz, std::f64::consts::TAU * 18.0);
        Complex::from(-w * w) / (5.0 * Complex::new(w0 * w0 - w * w, 2.0 * 0.03 * w0 * w))
    };
    let values = hz.iter().map(value).collect();
    (hz, values)
}

fn written(header: &str, rows: impl Fn(f64, Complex<f64>) -> Vec<f64>) -> String {
    let (hz, values) = accelerance();
    let row = |(hz, value): (&f64, &Complex<f64>)| {
        let fields = rows(*hz, *value).iter().map(|x| format!("{x:e}")).collect::<Vec<_>>();
        fields.join(",") + "\n"
    };
    format!("{header}\n{}", hz.iter().zip(&values).map(row).collect::<String>())
}

/// Reference: the closed form of one degree of freedom, written in the unit that the header states.
#[test]
fn units_of_axes_and_responses_are_read() {
    use std::f64::consts::TAU;
    const G: f64 = 9.80665;
    let (hz, values) = accelerance();
    let acceleration = Some(ResponseQuantity::Acceleration);
    type Row = Box<dyn Fn(f64, Complex<f64>) -> Vec<f64>>;
    let cases: [(&str, Row, Option<ResponseQuantity>); 14] = [
        ("frequency (rad/s),real,imaginary", Box::new(|f, z| vec![TAU * f, z.re, z.im]), None),
        ("omega_rad_s,real,imaginary", Box::new(|f, z| vec![TAU * f, z.re, z.im]), None),
        ("w,real,imaginary", Box::new(|f, z| vec![TAU * f, z.re, z.im]), None),
        ("freq [kHz],Re,Im", Box::new(|f, z| vec![f / 1e3, z.re, z.im]), None),
        ("speed [rpm],real,imag", Box::new(|f, z| vec![60.0 * f, z.re, z.im]), None),
        (
            "frequency_hz,real,imaginary\nHz,g/N,g/N",
            Box::new(|f, z| vec![f, z.re / G, z.im / G]),
            acceleration,
        ),
        (
            "Frequency [Hz],real [g/N],imaginary [g/N]",
            Box::new(|f, z| vec![f, z.re / G, z.im / G]),
            acceleration,
        ),
        (
            "f,accelerance real,accelerance imaginary",
            Box::new(|f, z| vec![f, z.re, z.im]),
            acceleration,
        ),
        (
            "f,magnitude [dB re 1 (m/s^2)/N],phase [deg]",
            Box::new(|f, z| vec![f, 20.0 * z.norm().log10(), z.arg().to_degrees()]),
            acceleration,
        ),
        (
            "f,magnitude (dB),phase (rad)",
            Box::new(|f, z| vec![f, 20.0 * z.norm().log10(), z.arg()]),
            None,
        ),
        (
            "f,mag_db,phase",
            Box::new(|f, z| vec![f, 20.0 * z.norm().log10(), z.arg().to_degrees()]),
            None,
        ),
        ("f,H11 mag,H11 phase", Box::new(|f, z| vec![f, z.norm(), z.arg().to_degrees()]), None),
        (
            "f,apparent mass magnitude [kg],apparent mass phase [deg]",
            Box::new(|f, z| vec![f, 1.0 / z.norm(), -z.arg().to_degrees()]),
            acceleration,
        ),
        (
            "f,real [N/(m/s²)],imag [N/(m/s²)]",
            Box::new(|f, z| vec![f, z.inv().re, z.inv().im]),
            acceleration,
        ),
    ];
    for (header, row, quantity) in cases {
        let found = parse(&written(header, row)).unwrap_or_else(|e| panic!("{header}: {e}"));
        let function = &found.functions[0];
        assert_eq!((found.functions.len(), function.quantity), (1, quantity), "{header}");
        for at in 0..hz.len() {
            assert!((found.frequency_hz[at] / hz[at] - 1.0).abs() < 1e-12, "{header}");
            let error = (function.values[at] - values[at]).norm() / values[at].norm();
            assert!(error < 1e-12, "{header}: {error}");
        }
        // The file does not state the meaning of `w`, or the reference of a level in dB.
        let is_doubtful =
            header.starts_with("w,") || header.contains("(dB)") || header.contains("_db");
        assert_eq!(found.doubts.len(), usize::from(is_doubtful), "{header}: {:?}", found.doubts);
    }
}

#[test]
fn what_is_not_understood_in_a_table_of_responses_is_reported_or_refused() {
    let row = |f: f64, z: Complex<f64>| vec![f, z.re, z.im];
    let doubted = parse(&written("x,real [V],imaginary [V]", row)).unwrap();
    assert_eq!(doubted.doubts.len(), 3, "{:?}", doubted.doubts);
    for (header, told) in [
        ("orders,real,imaginary", "speed of rotation"),
        ("f,real,other", "imaginary part"),
        ("f,magnitude,other", "phase"),
        ("f [mm],real,imaginary", "frequency is needed"),
    ] {
        let error = parse(&written(header, row)).unwrap_err().to_string();
        assert!(error.contains(told), "{header}: {error}");
    }
}

/// Mirrored and unsorted tables give the one-sided table in rising order.
#[test]
fn mirrored_and_unsorted_tables_are_the_one_sided_ones() {
    let n = 16_i32;
    let value = |k: i32| {
        Complex::new(
            1.0 / f64::from(1 + k * k),
            if k == n / 2 || k == 0 { 0.0 } else { -0.1 * f64::from(k) },
        )
    };
    let of = |k: i32| if k <= n / 2 { value(k) } else { value(n - k).conj() };
    let text = |order: &[i32], hz: &dyn Fn(i32) -> f64| {
        let rows = order.iter().map(|k| format!("{:?},{:?},{:?}\n", hz(*k), of(*k).re, of(*k).im));
        format!("frequency_hz,real,imaginary\n{}", rows.collect::<String>())
    };
    let all: Vec<i32> = (0..n).collect();
    let shuffled: Vec<i32> = (0..=n / 2).map(|k| k * 5 % (n / 2 + 1)).collect();
    let signed = |k: i32| f64::from(if k <= n / 2 { k } else { k - n });
    for (name, text, left_out) in [
        ("mirrored", text(&all, &f64::from), 7),
        ("mirrored without 0 Hz", text(&all[1..], &f64::from), 7),
        ("negative", text(&all, &signed), 7),
        ("unsorted", text(&shuffled, &f64::from), 0),
    ] {
        let found = parse(&text).unwrap();
        let first = i32::from(name.ends_with("without 0 Hz"));
        let expected: Vec<f64> = (first..=n / 2).map(f64::from).collect();
        assert_eq!(found.frequency_hz, expected, "{name}");
        let values: Vec<_> = (first..=n / 2).map(of).collect();
        assert_eq!(found.functions[0].values, values, "{name}");
        let told = found.remarks.iter().any(|remark| remark.contains("left out: 7 mirrored"));
        assert_eq!(told, left_out > 0, "{name}: {:?}", found.remarks);
    }
    let twice = parse("f,real,imaginary\n1,2,3\n1,2,3\n").unwrap_err().to_string();
    assert!(twice.contains("twice"), "{twice}");
}

/// Levels in dB give the response H: a level is 20 log |H/reference|.
#[test]
fn levels_in_decibels_are_read_with_their_reference() {
    const G: f64 = 9.80665;
    let value = Complex::from_polar(0.25_f64, -1.2);
    let phase = value.arg().to_degrees();
    let micro = 1e-6;
    for (columns, reference) in [
        ("H [dB],Phase [deg]", None),
        ("H1 (dB),H1 phase", None),
        ("Mag dB,Phase [deg]", None),
        ("20log|H|,Phase", None),
        ("dB,deg", None),
        ("dB (g/N),Phase [deg]", Some(G)),
        ("Accelerance [dB re 1 g/N],Phase [deg]", Some(G)),
        ("dB re 1 g/N,deg", Some(G)),
        ("H11 dB re 1 m/s^2/N,H11 phase", Some(1.0)),
        ("H11 dB receptance,H11 phase", None),
        ("Level [dB re 1e-6 m/N],Phase", Some(micro)),
    ] {
        let level = 20.0 * (value.norm() / reference.unwrap_or(1.0)).log10();
        let text =
            format!("Frequency [Hz],{columns}\n1,{level:?},{phase:?}\n2,{level:?},{phase:?}\n");
        let found = parse(&text).unwrap_or_else(|e| panic!("{columns}: {e}"));
        let error = (found.functions[0].values[0] - value).norm() / value.norm();
        assert!(error < 1e-12, "{columns}: {error}");
        // A reference that is not stated is assumed to be 1, and that is reported.
        let has_doubt = found.doubts.iter().any(|(_, doubt, _)| doubt.text.starts_with("dB"));
        assert_eq!(has_doubt, reference.is_none(), "{columns}: {:?}", found.doubts);
    }
    for columns in ["H [dB]", "Mag dB", "dB (g/N)", "Accelerance [dB re 1 g/N]"] {
        let why = parse(&format!("f,{columns}\n1,3\n2,4\n")).unwrap_err().to_string();
        assert!(why.contains("decibels") && why.contains("phase is missing"), "{columns}: {why}");
    }
}

/// Reads phases in any unit of angle, coherences in per cent, and symbols in brackets. Values that
/// cannot be right are refused.
#[test]
fn units_of_phases_and_coherences_are_read_or_refused() {
    let value = |header: &str, row: &str| {
        let text = format!("frequency_hz,{header}\n1,{row}\n2,{row}\n");
        parse(&text).map(|read| (read.functions[0].values[0], read.coherence.first().cloned()))
    };
    let quarter = std::f64::consts::FRAC_PI_4;
    for (unit, phase) in [
        ("deg", "45".to_owned()),
        ("mrad", (1e3 * quarter).to_string()),
        ("gon", "50".to_owned()),
        ("turns", "0.125".to_owned()),
        ("unwrapped] [deg", "45".to_owned()),
        ("H11/F1] [deg", "45".to_owned()),
        ("unwrapped", "0.7853981633974483".to_owned()),
    ] {
        let found = value(&format!("magnitude [g/N],phase [{unit}]"), &format!("1,{phase}"));
        let (found, _) = found.unwrap();
        assert!((found.arg() - quarter).abs() < 1e-12, "{unit}: {found}");
        assert!((found.norm() / 9.806_65 - 1.0).abs() < 1e-12, "{unit}: {found}");
    }
    let (found, coherence) =
        value("Re(H) [mm/s/N],Im(H) [mm/s/N],coherence [%]", "1,2,98").unwrap();
    assert!((found - Complex::new(1e-3, 2e-3)).norm() < 1e-18, "{found}");
    assert!((coherence.unwrap().values[0] - 0.98).abs() < 1e-15);
    let text = "frequency_hz,Re(H) [mm/s/N],Im(H) [mm/s/N]\n1,1,2\n2,1,2\n";
    assert!(parse(text).unwrap().doubts.is_empty());
    for (header, row, named) in [
        ("magnitude [g/N],phase [furlong]", "1,45", "not a unit of angle"),
        ("real [g/N],imaginary [m/s^2/N]", "1,2", "state one unit for both parts"),
        ("magnitude [g/N],phase [deg]", "-40,45", "it is no magnitude"),
    ] {
        let error = value(header, row).unwrap_err().to_string();
        assert!(error.contains(named), "{error}");
    }
}
