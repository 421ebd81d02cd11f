//! Frequency responses in arrays of complex numbers. Reference: SciPy and h5py wrote the files
//! (`data/make_arrays.py`); each value encodes its indices, which are counted from 0: line + 1 + 10
//! point + 100 reference + i line.

use mechid_io::{Evidence, FrequencyResponses, IoError};
use mechid_model::ResponseQuantity;
use nalgebra::Complex;

const FIRST: &[u8] = include_bytes!("../data/responses.mat");
const LAST: &[u8] = include_bytes!("../data/responses-last.mat");
const VECTORS: &[u8] = include_bytes!("../data/responses-vectors.mat");
#[cfg(feature = "hdf5")]
const HDF5: &[u8] = include_bytes!("../data/responses.h5");
#[cfg(feature = "hdf5")]
const VERSION73: &[u8] = include_bytes!("../data/arrays73.mat");

const HZ: [f64; 5] = [2.0, 3.0, 4.0, 5.0, 6.0];

fn value(line: usize, point: usize, reference: usize) -> Complex<f64> {
    let [line, point, reference] = [line, point, reference].map(|index| index as f64);
    Complex::new(line + 1.0 + 10.0 * point + 100.0 * reference, line)
}

fn read(bytes: &[u8]) -> FrequencyResponses {
    FrequencyResponses::parse("a.mat", bytes).unwrap()
}

/// Checks all frequency responses of 3 points to 2 forces.
fn check_all(responses: &FrequencyResponses, hz: [f64; 5]) {
    assert_eq!(responses.frequency_hz, hz);
    assert_eq!(responses.functions.len(), 6);
    for function in &responses.functions {
        let index = |point: &str| point.parse::<usize>().unwrap() - 1;
        let (point, reference) = (index(&function.response), index(&function.reference));
        let expected: Vec<_> = (0..5).map(|line| value(line, point, reference)).collect();
        assert_eq!(function.values, expected, "{point} {reference}");
    }
}

#[test]
fn frequencies_may_be_the_first_dimension_or_the_last() {
    let (first, last) = (read(FIRST), read(LAST));
    check_all(&first, HZ);
    check_all(&last, HZ);
    assert_eq!(first.functions[0].quantity, None);
    assert_eq!(last.functions[0].quantity, Some(ResponseQuantity::Acceleration));
    assert!(first.remarks[0].contains("3 by 2 responses"), "{:?}", first.remarks);
    // The coherences have one column for each point.
    assert_eq!(first.coherence.len(), 3);
    assert_eq!(first.coherence[2].response, "3");
    assert!((first.coherence[2].values[1] - 0.96).abs() < 1e-15);
}

#[cfg(feature = "hdf5")]
#[test]
fn hdf5_and_its_order_of_dimensions() {
    let responses = read(HDF5);
    check_all(&responses, HZ.map(|hz| 1e3 * hz));
    assert_eq!(responses.functions[0].quantity, Some(ResponseQuantity::Velocity));
    check_all(&read(VERSION73), HZ);
}

#[test]
fn vectors_are_known_by_the_points_in_their_names() {
    let responses = read(VECTORS);
    let points: Vec<[&str; 2]> =
        responses.functions.iter().map(|f| [f.response.as_str(), f.reference.as_str()]).collect();
    assert_eq!(points, [["1", "1"], ["2", "1"]]);
    assert_eq!(responses.functions[1].values[4], value(4, 1, 0));
}

/// Variable of a MATLAB file: name, lengths of the dimensions, real parts, imaginary parts.
type Variable<'a> = (&'a str, &'a [u32], &'a [f64], &'a [f64]);

/// Returns a MATLAB file whose variables are these vectors; a vector is complex if it has imaginary
/// parts.
fn file(variables: &[Variable<'_>]) -> Vec<u8> {
    let mut file = b"MATLAB 5.0 MAT-file".to_vec();
    file.resize(124, b' ');
    file.extend(b"\x00\x01IM");
    for (name, lengths, re, im) in variables {
        let mut variable = Vec::new();
        let mut add = |kind: u32, data: Vec<u8>| {
            variable.extend(kind.to_le_bytes());
            variable.extend((data.len() as u32).to_le_bytes());
            variable.extend(&data);
            variable.resize(variable.len().next_multiple_of(8), 0);
        };
        let complex = if im.is_empty() { 0 } else { 0x800_u32 };
        add(6, [(6 | complex).to_le_bytes(), [0; 4]].concat());
        add(5, lengths.iter().flat_map(|len| len.to_le_bytes()).collect());
        add(1, name.as_bytes().to_vec());
        for part in [re, im].into_iter().filter(|part| !part.is_empty()) {
            add(9, part.iter().flat_map(|value| value.to_le_bytes()).collect());
        }
        file.extend(14_u32.to_le_bytes());
        file.extend((variable.len() as u32).to_le_bytes());
        file.extend(variable);
    }
    file
}

fn refused(bytes: &[u8]) -> String {
    match FrequencyResponses::parse("a.mat", bytes) {
        Err(IoError::Description { what, .. }) => what,
        other => panic!("{other:?}"),
    }
}

#[test]
fn what_is_missing_or_does_not_go_together_is_said() {
    let three: &[f64] = &[1.0, 2.0, 3.0];
    let four: &[f64] = &[1.0, 2.0, 3.0, 4.0];
    let h: (&str, &[u32], &[f64], &[f64]) = ("H", &[3, 1], three, three);
    let text = refused(&file(&[h]));
    assert!(text.contains("need a vector of their frequencies"), "{text}");
    let text = refused(&file(&[("f", &[4, 1], four, &[]), h]));
    assert!(text.contains("H (3 × 1) equals the number of frequencies, 4"), "{text}");
    let f: (&str, &[u32], &[f64], &[f64]) = ("f", &[3, 1], three, &[]);
    let text = refused(&file(&[f, h, ("G", &[3, 1], three, three)]));
    assert!(text.contains("G and another array have the response at 1"), "{text}");
    let text = refused(&file(&[f, ("H", &[3, 1], &[1.0, f64::NAN, 1.0], three)]));
    assert!(text.contains("entry 2 of H is not finite"), "{text}");
    let text = refused(&file(&[f, ("H", &[3, 1, 1, 1], three, three)]));
    assert!(text.contains("more than three dimensions"), "{text}");
    // An array that is not a response is omitted.
    let analytic: (&str, &[u32], &[f64], &[f64]) = ("z", &[4, 1], four, four);
    let responses = FrequencyResponses::parse("a.mat", &file(&[f, h, analytic])).unwrap();
    assert_eq!(responses.functions.len(), 1);
    assert!(responses.remarks.iter().any(|r| r.contains("left out: z")), "{:?}", responses.remarks);
}

/// A unit at the end of the name of an array is applied to the values: 1 g/N is 9.80665 m/s² per N.
/// Reference: the definitions of the units.
#[test]
fn units_in_the_names_of_arrays_are_read() {
    let three: &[f64] = &[1.0, 2.0, 3.0];
    let f: Variable<'_> = ("f", &[3, 1], three, &[]);
    let with = |name: &str| {
        let bytes = file(&[f, (name, &[3, 1], three, &[1.0; 3])]);
        FrequencyResponses::parse("a.mat", &bytes)
    };
    let (acceleration, displacement) =
        (ResponseQuantity::Acceleration, ResponseQuantity::Displacement);
    for (name, quantity, factor) in [
        ("accelerance_g_N", acceleration, 9.80665),
        ("accelerance_g_per_N", acceleration, 9.80665),
        ("H_mm_s2_N", acceleration, 1e-3),
        ("receptance_um_N", displacement, 1e-6),
        ("H21_um_N", displacement, 1e-6),
        ("H_2_1_um_N", displacement, 1e-6),
    ] {
        let responses = with(name).unwrap();
        let function = &responses.functions[0];
        let expected = Complex::new(2.0, 1.0) * factor;
        assert!((function.values[1] - expected).norm() < 1e-12 * factor, "{name}");
        assert_eq!(function.quantity, Some(quantity), "{name}");
        let point = if name.contains('2') && !name.contains("s2") { "2" } else { "1" };
        assert_eq!((function.response.as_str(), function.reference.as_str()), (point, "1"));
        let remark = responses.remarks.join("; ");
        assert!(remark.contains("multiplied by") && !remark.contains("no units"), "{remark}");
        assert!(responses.doubts.is_empty(), "{name}");
    }
    // A dynamic stiffness in N/mm is inverted.
    let stiffness = with("H_N_mm").unwrap();
    let expected = Complex::new(2e3, 1e3).inv();
    assert!((stiffness.functions[0].values[1] - expected).norm() < 1e-15);
    for (name, text) in [("accelerance_mV_N", "mV/N"), ("accelerance_g", "g")] {
        let responses = with(name).unwrap();
        assert_eq!(responses.functions[0].values[1], Complex::new(2.0, 1.0), "{name}");
        let (_, stated, _) = &responses.doubts[0];
        assert_eq!((stated.text.as_str(), stated.evidence), (text, Evidence::Unused), "{name}");
        assert!(responses.remarks.iter().all(|r| !r.contains("no units")), "{name}");
    }
    let error = with("accelerance_um_N").unwrap_err().to_string();
    assert!(error.contains("um/N") && error.contains("contradicts this name"), "{error}");
}

/// A unit in an attribute of an array is applied to the values. Reference: the definitions of the
/// units; the stored values are the frequencies + i.
#[cfg(feature = "hdf5")]
#[test]
fn units_in_attributes_of_arrays_are_read() {
    let responses = read(include_bytes!("../data/units.h5"));
    let function = |point: &str| {
        responses.functions.iter().find(|function| function.response == point).unwrap()
    };
    for (point, quantity, factor) in [
        ("1", Some(ResponseQuantity::Acceleration), 9.80665),
        ("2", Some(ResponseQuantity::Displacement), 1e-6),
        ("3", None, 1.0),
    ] {
        let expected = Complex::new(HZ[1], 1.0) * factor;
        assert!((function(point).values[1] - expected).norm() < 1e-12 * factor, "{point}");
        assert_eq!(function(point).quantity, quantity, "{point}");
    }
    let texts: Vec<&str> =
        responses.doubts.iter().map(|(_, stated, _)| stated.text.as_str()).collect();
    assert_eq!(texts, ["mV/N"]);
    assert!(responses.remarks.iter().all(|r| !r.contains("no units")), "{:?}", responses.remarks);
}
