//! Universal files. Reference: pyuff wrote them (`data/make.py`); the numbers are in this test.

use mechid_io::{IoError, Table, TimeAxis};
use proptest::prelude::*;

use super::matlab::{FORCE, X};

const PRINTED: &[u8] = include_bytes!("../../data/printed.unv");
const BINARY: &[u8] = include_bytes!("../../data/binary.unv");
const SINGLE: &[u8] = include_bytes!("../../data/single.unv");

fn both() -> [Table; 2] {
    [PRINTED, BINARY].map(|bytes| Table::parse("a.unv", bytes).unwrap())
}

#[test]
fn functions_of_time_are_columns_with_a_time_axis() {
    for table in both() {
        assert_eq!(
            table.names(),
            ["1-X", "12+Z", "12+RX time", "12+RX", "12+Z/1-X", "3"],
            "{}",
            table.available()
        );
        let record = table.record(&TimeAxis::OfFile, &["1-X", "2", "12+RX"]).unwrap();
        assert_eq!((record.len(), record.sampling().dt()), (8, 0.25));
        assert_eq!((record.channel(0), record.channel(1)), (&FORCE[..], &X[..]));
        assert_eq!(record.channel(2), X.map(|x| -x));
        assert_eq!(table.about(0), "rig 4, excitation force in N");
        assert_eq!(table.about(1), "rig 4, acceleration");
        assert_eq!(
            table.remarks(),
            [
                "units: code 1 SI: Meter (newton); to get SI units, divide lengths by 1 and forces \
                 by 1",
                "left out: datasets 15 (1)"
            ]
        );
    }
}

/// The steps between the instants of the file are 0.25 in the unit of the label.
#[test]
fn labels_of_the_abscissa_state_the_unit_of_the_instants() {
    let with = |unit: &str| {
        let text = String::from_utf8(PRINTED.to_vec()).unwrap();
        let (before, after) = ("        17    0    0    0", format!("{:<20} {unit:<20}", "Time"));
        let lines = text.split_inclusive('\n').map(|line| match line.starts_with(before) {
            true => format!("{before} {after}\n"),
            false => line.to_owned(),
        });
        Table::parse("a.unv", lines.collect::<String>().as_bytes()).unwrap()
    };
    for (unit, dt, remark) in [
        ("s", 0.25, None),
        ("NONE", 0.25, None),
        ("ms", 0.25e-3, Some("the instants were multiplied by 0.001")),
        (
            "samples",
            0.25,
            Some("the labels of the file state instants in samples, which is not a unit of time"),
        ),
    ] {
        let table = with(unit);
        let sampling = table.sampling(&TimeAxis::OfFile, &["1-X", "12+RX"]).unwrap();
        assert!((sampling.dt() / dt - 1.0).abs() < 1e-12, "{unit}: {}", sampling.dt());
        let remarks = table.remarks().join("; ");
        assert_eq!(remarks.contains("instants"), remark.is_some(), "{remarks}");
        assert!(remark.is_none_or(|remark| remarks.contains(remark)), "{remarks}");
    }
}

#[test]
fn single_precision_is_read_printed_and_binary() {
    let table = Table::parse("a.unv", SINGLE).unwrap();
    let record = table.record(&TimeAxis::OfFile, &["5+Z", "6+Z", "7+Z"]).unwrap();
    for channel in 0..3 {
        assert_eq!(record.channel(channel), X);
    }
}

#[test]
fn what_is_no_real_function_of_time_is_refused() {
    for table in both() {
        // `12+Z` is the name of a response; the frequency response function has the name
        // `12+Z/1-X`.
        let e = table.column("12+Z/1-X").unwrap_err().to_string();
        assert!(e.contains("it holds a frequency response function, but a channel needs"), "{e}");
        let e = table.column("3").unwrap_err().to_string();
        assert!(e.contains("6 \"3\": it holds complex numbers"), "{e}");
    }
}

#[test]
fn a_rate_may_only_say_what_the_file_says() {
    for table in both() {
        let at = |rate| table.record(&TimeAxis::RateHz(rate), &["12+Z", "12+RX"]);
        assert_eq!(at(4.0).unwrap().sampling().dt(), 0.25);
        assert_eq!(
            at(5.0).unwrap_err().to_string(),
            "the sample rate 5 Hz contradicts a.unv: column 2 \"12+Z\" has 4 Hz (leave the rate out)"
        );
    }
}

#[test]
fn a_binary_dataset_with_a_misplaced_number_is_told() {
    let text = String::from_utf8_lossy(BINARY).into_owned();
    assert!(text.contains("\n    58b     1"));
    let first = BINARY.windows(7).position(|bytes| bytes == b"    58b").unwrap();
    for id in [&b"   58b "[..], b"  58b  ", b"58b    ", b"     58"] {
        let only = [&b"    -1\n"[..], id, &BINARY[first + 7..]].concat();
        let e = Table::parse("a.unv", &only).unwrap_err();
        assert!(matches!(e, IoError::Malformed { .. }), "{e}");
        let whole = [&BINARY[..first], id, &BINARY[first + 7..]].concat();
        let e = Table::parse("a.unv", &whole).unwrap_err();
        assert!(matches!(e, IoError::Malformed { .. }), "{e}");
        if id[6] != b'8' {
            assert!(e.to_string().contains("58 in columns 5 and 6, followed by b"), "{e}");
        }
    }
}

/// Returns the printed file in which occurrence `nth` of a text (from 0) is replaced by another
/// text of the same length.
fn with(what: &str, by: &str, nth: usize) -> Vec<u8> {
    assert_eq!(what.len(), by.len());
    let text = std::str::from_utf8(PRINTED).unwrap();
    let (at, _) = text.match_indices(what).nth(nth).unwrap();
    [&text[..at], by, &text[at + what.len()..]].concat().into_bytes()
}

#[test]
fn channels_with_other_instants_make_no_record() {
    let bytes = with("1.00000e+00  2.50000e-01", "1.00000e+00  2.00000e-01", 0);
    let table = Table::parse("a.unv", &bytes).unwrap();
    assert_eq!(
        table.record(&TimeAxis::OfFile, &["1-X", "12+Z"]).unwrap_err().to_string(),
        "a.unv: the columns of a record need the same time axis; column 1 \"1-X\" begins at 1 s with \
         steps of 0.2 s, column 2 \"12+Z\" at 1 s with steps of 0.25 s"
    );
    let late = with("1.00000e+00  2.50000e-01", "9.00000e+00  2.50000e-01", 0);
    let table = Table::parse("a.unv", &late).unwrap();
    let e = table.record(&TimeAxis::OfFile, &["1-X", "12+Z"]).unwrap_err();
    assert!(matches!(e, IoError::TimeAxes { .. }), "{e}");
    let uneven = with("1.75000e+00  -1.25000000000e-01", "1.85000e+00  -1.25000000000e-01", 0);
    let table = Table::parse("a.unv", &uneven).unwrap();
    let e = table.record(&TimeAxis::OfFile, &["12+RX"]).unwrap_err();
    assert!(matches!(e, IoError::NonUniformTime { .. }), "{e}");
    assert!(table.record(&TimeAxis::OfFile, &["12+Z"]).is_ok());
}

#[test]
fn other_files_have_no_time_axis_of_their_own() {
    let table = Table::parse("a.csv", b"t,f\n0,1\n1,2\n").unwrap();
    assert!(!table.has_time_axis());
    let e = table.record(&TimeAxis::OfFile, &["f"]).unwrap_err();
    assert!(matches!(e, IoError::NoTimeAxis { .. }), "{e}");
}

/// Reads numbers in the form in which Fortran writes them: without blanks between full fields, and
/// with the exponent letter D in double precision.
#[test]
fn touching_numbers_and_fortran_exponents() {
    let rows = "  -3.00000000000e+00  -2.00000000000e+00   1.00000000000e+00  -1.00000000000e+00";
    let touch = " -3.000000000000D+00-2.0000000000000D+00 1.0000000000000D+00-1.0000000000000D+00";
    let table = Table::parse("a.unv", &with(rows, touch, 0)).unwrap();
    assert_eq!(table.column("1-X").unwrap(), FORCE);
}

#[test]
fn broken_files_are_refused_with_the_line() {
    for (bytes, message) in [
        (
            with("  -3.00000000000e+00  -2.0", "  -3.0000000x000e+00  -2.0", 0),
            "a.unv, line 25: \"-3.0000000x000e+00\" is not a number",
        ),
        (
            with("4         8         1", "4         9         1", 0),
            "a.unv, line 27: a function should have 9 numbers, but it ends after 8",
        ),
        (
            with("4         8         1", "4         7         1", 0),
            "a.unv, line 26: a function should have 7 numbers, but it has more",
        ),
        (
            with("4         8         1", "3         8         1", 0),
            "a.unv, line 20: an ordinate of data type 3 with spacing 1 cannot be read: the \
             possible types are 2, 4, 5 and 6, with spacing 0 or 1",
        ),
        (
            with("NONE         1  -1       NONE", "NONE         1  -9       NONE", 0),
            "a.unv, line 19: direction -9 is not between -6 and 6",
        ),
        (
            with("17    0    0    0 NONE", "a7    0    0    0 NONE", 0),
            "a.unv, line 21: \"a7\" in columns 1 to 10 is not a whole number",
        ),
    ] {
        assert_eq!(Table::parse("a.unv", &bytes).unwrap_err().to_string(), message);
    }
    let cut = &PRINTED[..PRINTED.len() - 300];
    let e = Table::parse("a.unv", cut).unwrap_err().to_string();
    assert!(e.contains("cut short"), "{e}");
    let vax = String::from_utf8_lossy(SINGLE).replace("58b     1     2", "58b     1     1");
    let e = Table::parse("a.unv", vax.as_bytes()).unwrap_err().to_string();
    assert!(
        e.starts_with("a.unv, line 18: floating point format 1 (DEC VMS) of a dataset 58b"),
        "{e}"
    );
    let only_nodes = "    -1\n    15\n         1\n    -1\n";
    let e = Table::parse("a.unv", only_nodes.as_bytes()).unwrap_err().to_string();
    assert_eq!(e, "a.unv holds no data: there is no dataset 58");
}

#[test]
fn a_file_cut_short_is_refused_wherever_it_ends() {
    for bytes in [PRINTED, BINARY] {
        let whole = Table::parse("a.unv", bytes).unwrap().width();
        for end in 30..bytes.len() - 1 {
            match Table::parse("a.unv", &bytes[..end]) {
                Ok(table) => assert!(table.width() < whole || end > bytes.len() - 4, "{end}"),
                Err(IoError::Malformed { .. } | IoError::Empty { .. }) => {}
                Err(e) => panic!("cut at {end}: {e}"),
            }
        }
    }
}

proptest! {
    #[test]
    fn no_damage_panics(at in 0..BINARY.len(), byte in any::<u8>(), binary in any::<bool>()) {
        let mut bytes = if binary { BINARY } else { PRINTED }.to_vec();
        let at = at % bytes.len();
        bytes[at] = byte;
        if let Ok(table) = Table::parse("a.unv", &bytes) {
            super::use_all(&table);
        }
    }
}

/// Reads single-precision instants with double-precision values. The standard requires this
/// combination; pyuff writes double-precision instants.
#[test]
fn narrow_instants_among_wide_values() {
    let pairs = |narrow: bool| -> Vec<u8> {
        let pair = |k: usize| {
            let (time, value) = (1.0 + 0.25 * k as f64, -X[k]);
            let time = if narrow {
                (time as f32).to_le_bytes().to_vec()
            } else {
                time.to_le_bytes().to_vec()
            };
            [time, value.to_le_bytes().to_vec()].concat()
        };
        (0..8).flat_map(pair).collect()
    };
    let wide = pairs(false);
    let at = BINARY.windows(wide.len()).position(|window| window == wide).unwrap();
    let bytes = [&BINARY[..at], &pairs(true), &BINARY[at + wide.len()..]].concat();
    let table = Table::parse("a.unv", &bytes).unwrap();
    let record = table.record(&TimeAxis::OfFile, &["12+RX"]).unwrap();
    assert_eq!((record.sampling().dt(), record.channel(0)), (0.25, &X.map(|x| -x)[..]));
}
