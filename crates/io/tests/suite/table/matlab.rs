//! MATLAB files. Reference: SciPy wrote them (`data/make.py`); the numbers are in this test.

use mechid_io::{IoError, Table, TimeAxis};
use proptest::prelude::*;

const PLAIN: &[u8] = include_bytes!("../../data/plain.mat");
const COMPRESSED: &[u8] = include_bytes!("../../data/compressed.mat");

pub const FORCE: [f64; 8] = [-3.0, -2.0, 1.0, -1.0, -1.0, 1.0, -2.0, -3.0];
pub const X: [f64; 8] = [1.0, 0.5, 0.25, 0.125, 0.0625, 0.03125, 0.015625, 0.0078125];

fn both() -> [Table; 2] {
    [PLAIN, COMPRESSED].map(|bytes| Table::parse("a.mat", bytes).unwrap())
}

#[test]
fn vectors_matrices_and_structs_are_columns() {
    for table in both() {
        let wanted = ["force", "motion[1]", "motion[2]", "rig.x", "single"];
        let record = table.record(&TimeAxis::Column("time"), &wanted).unwrap();
        assert_eq!((record.len(), record.sampling().dt()), (8, 0.25));
        assert_eq!(record.channel(0), FORCE);
        for channel in [1, 3, 4] {
            assert_eq!(record.channel(channel), X, "{}", wanted[channel]);
        }
        assert_eq!(record.channel(2), X.map(|x| -x));
        let low: Vec<f64> = (-4..4).map(f64::from).collect();
        assert_eq!(table.column("rig.limits.low").unwrap(), low);
        assert_eq!(table.column("counts").unwrap(), low);
        assert_eq!(table.len(), 8);
        let scalars =
            [("fs", 4.0), ("cells{1}", 1.0)].map(|(name, value)| (name.to_string(), value));
        assert_eq!(table.scalars(), scalars);
        assert_eq!(table.format(), "MATLAB level 5");
    }
}

#[test]
fn what_makes_no_channel_is_named_when_it_is_asked_for() {
    for table in both() {
        for (column, what) in [
            ("note", "text"),
            ("rig.label", "text"),
            ("analytic", "complex numbers (`frf_table` reads frequency responses)"),
            ("cells{2}", "text"),
            ("cube", "an array of more than two dimensions"),
            ("nothing", "nothing"),
        ] {
            let message = table.column(column).unwrap_err().to_string();
            assert!(message.contains(&format!("{column}\": it holds {what}, but a")), "{message}");
        }
        let e = table.column("gap").unwrap_err().to_string();
        assert!(e.ends_with("\"gap\": NaN is not a finite number"), "{e}");
        assert!(e.starts_with("a.mat, sample 2, column "), "{e}");
        assert!(matches!(table.column("fs"), Err(IoError::MissingColumn { .. })));
    }
}

#[test]
fn channels_of_different_lengths_make_no_record() {
    for table in both() {
        let e = table.record(&TimeAxis::RateHz(4.0), &["force", "short"]).unwrap_err().to_string();
        assert!(e.contains("2 \"force\" has 8, ") && e.contains("\"short\" has 3"), "{e}");
        let alone = table.record(&TimeAxis::RateHz(4.0), &["short"]).unwrap();
        assert_eq!(alone.channel(0), [1.0, 2.0, 3.0]);
        let e = table.record(&TimeAxis::Column("time"), &["short"]).unwrap_err();
        assert!(matches!(e, IoError::Lengths { .. }), "{e}");
    }
}

#[test]
fn uneven_time_is_refused_with_its_sample() {
    let table = Table::parse("a.mat", PLAIN).unwrap();
    let e = table.record(&TimeAxis::Column("rig.x"), &["force"]).unwrap_err().to_string();
    assert!(e.contains("not uniform") && e.contains("up to sample "), "{e}");
}

/// Returns a MATLAB file with one variable of doubles, composed by hand; the lengths of the
/// variable have the type `kind`.
fn by_hand(values: &[f64], (kind, lengths): (u32, &[u8]), big: bool) -> Vec<u8> {
    let word = |v: u32| if big { v.to_be_bytes() } else { v.to_le_bytes() };
    let double = |v: &f64| if big { v.to_be_bytes() } else { v.to_le_bytes() };
    let len = u32::try_from(values.len()).unwrap();
    let mut data = Vec::new();
    // Class 6 (double).
    for v in [6, 8, 6, 0, kind, u32::try_from(lengths.len()).unwrap()] {
        data.extend(word(v));
    }
    data.extend(lengths);
    data.resize(data.len().next_multiple_of(8), 0);
    data.extend([word(1), word(1)].concat());
    data.extend(b"v\0\0\0\0\0\0\0");
    data.extend([word(9), word(8 * len)].concat());
    values.iter().for_each(|v| data.extend(double(v)));
    let mut file = b"MATLAB 5.0 MAT-file, by hand".to_vec();
    file.resize(124, b' ');
    file.extend(if big { b"\x01\x00MI" } else { b"\x00\x01IM" });
    file.extend([word(14), word(data.len() as u32)].concat());
    file.extend(data);
    file
}

#[test]
fn both_byte_orders_are_read() {
    for big in [false, true] {
        let lengths = [2_u32, 1].map(|v| if big { v.to_be_bytes() } else { v.to_le_bytes() });
        let file = by_hand(&[1.5, -2.25e300], (5, &lengths.concat()), big);
        let table = Table::parse("a.mat", &file).unwrap();
        assert_eq!(table.column("v").unwrap(), [1.5, -2.25e300]);
    }
}

#[test]
fn lengths_that_are_none_are_refused() {
    let doubles =
        |lengths: &[f64]| -> Vec<u8> { lengths.iter().flat_map(|v| v.to_le_bytes()).collect() };
    let words =
        |lengths: &[i32]| -> Vec<u8> { lengths.iter().flat_map(|v| v.to_le_bytes()).collect() };
    let values = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0];
    for (kind, lengths, part) in [
        (5, words(&[-2, -4]), "-2 is not a possible size of a dimension"),
        (9, doubles(&[0.5, 16.0]), "0.5 is not a possible size of a dimension"),
        (9, doubles(&[f64::NAN, 8.0]), "is not a possible size"),
        (9, doubles(&[f64::INFINITY, 0.0]), "is not a possible size"),
        (5, words(&[0, 8]), "a variable of size 0 × 8 has 8 numbers"),
        (5, words(&[1 << 30, 1 << 30, 1 << 30]), "has 8 numbers"),
        (5, words(&[8]), "a variable has no size"),
        (5, words(&[1; 65]), "a variable has no size"),
    ] {
        let e = Table::parse("a.mat", &by_hand(&values, (kind, &lengths), false)).unwrap_err();
        assert!(matches!(e, IoError::Malformed { .. }), "{e}");
        assert!(e.to_string().contains(part), "\"{part}\" is missing in: {e}");
    }
    let table = Table::parse("a.mat", &by_hand(&values, (5, &words(&[4, 2])), false)).unwrap();
    assert_eq!(table.column("v[2]").unwrap(), [5.0, 6.0, 7.0, 8.0]);
}

/// Returns a MATLAB file with these vectors; a vector with one entry is a single number.
fn of_vectors(vectors: &[(&str, &[f64])]) -> Vec<u8> {
    let lengths = |values: &[f64]| [1, values.len() as u32].map(u32::to_le_bytes).concat();
    let variable = |(name, values): &(&str, &[f64])| {
        assert!(name.len() <= 8);
        let mut file = by_hand(values, (5, &lengths(values)), false).split_off(128);
        let at = 8 + 16 + 16;
        file[at + 4] = name.len() as u8;
        file[at + 8..at + 16].fill(0);
        file[at + 8..at + 8 + name.len()].copy_from_slice(name.as_bytes());
        file
    };
    let header = by_hand(&[0.0], (5, &lengths(&[0.0])), false)[..128].to_vec();
    [header, vectors.iter().flat_map(variable).collect()].concat()
}

#[test]
fn a_rate_stated_by_its_name_is_the_time_axis() {
    let x = ("x", &[1.0, 2.0, 3.0][..]);
    let of = |vectors: &[(&str, &[f64])]| Table::parse("a.mat", &of_vectors(vectors)).unwrap();
    for (name, value) in
        [("Fs", 4.0), ("fs_hz", 4.0), ("SampFreq", 4.0), ("dt", 0.25), ("T_s", 0.25)]
    {
        let table = of(&[(name, &[value]), x]);
        assert!(table.has_time_axis(), "{name}");
        assert_eq!(table.stated_rate(), Some(&(name.to_owned(), value)));
        let record = table.record(&TimeAxis::OfFile, &["x"]).unwrap();
        assert_eq!((record.sampling().dt(), record.len()), (0.25, 3), "{name}");
        // A rate that the user gives has priority.
        let other = table.record(&TimeAxis::RateHz(8.0), &["x"]).unwrap();
        assert_eq!(other.sampling().dt(), 0.125);
    }
    // Two equal statements of the rate are a time axis, and a contradiction is an error. A rate
    // that is not positive, or a number with another name, is no time axis. A column of instants
    // has priority over a stated rate.
    assert!(of(&[("Fs", &[4.0]), ("dt", &[0.25]), x]).has_time_axis());
    let table = of(&[("Fs", &[5.0]), ("dt", &[0.25]), x]);
    let told = table.record(&TimeAxis::OfFile, &["x"]).unwrap_err().to_string();
    assert!(told.contains("Fs = 5, which is 5 Hz, and dt = 0.25, which is 4 Hz"), "{told}");
    assert_eq!(table.record(&TimeAxis::RateHz(4.0), &["x"]).unwrap().sampling().dt(), 0.25);
    for numbers in [("Fs", 0.0, "g", 9.8), ("Fs", -4.0, "f0", 4.0)] {
        let (a, b) = ([numbers.1], [numbers.3]);
        let table = of(&[(numbers.0, &a), (numbers.2, &b), x]);
        assert!(!table.has_time_axis(), "{numbers:?}");
        let e = table.record(&TimeAxis::OfFile, &["x"]).unwrap_err();
        assert!(matches!(e, IoError::NoTimeAxis { .. }), "{e}");
    }
    let table = of(&[("Fs", &[4.0]), ("time", &[0.0, 0.5, 1.0]), x]);
    assert_eq!((table.has_time_axis(), table.time_column()), (false, Some("time")));
}

#[test]
fn other_versions_say_how_to_save() {
    let mut header = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".to_vec();
    header.resize(512, 0);
    for bytes in [&header[..], b"\x89HDF\r\n\x1a\n rest"] {
        let e = Table::parse("a.mat", bytes).unwrap_err();
        let what = if cfg!(feature = "hdf5") { "HDF5 format error" } else { "save it with -v7" };
        assert!(e.to_string().contains(what), "{e}");
    }
    // Level 4 has no header: a type, rows, columns, a flag for complex numbers, and the length of
    // the name.
    let level_4 = b"\0\0\0\0\x01\0\0\0\x01\0\0\0\0\0\0\0\x02\0\0\0a\0\0\0\0\0\0\0\xf0\x3f";
    let e = Table::parse("a.mat", level_4).unwrap_err().to_string();
    assert!(e.contains("MATLAB level 5 (save with -v7)"), "{e}");
}

#[test]
fn a_file_cut_short_is_refused_wherever_it_ends() {
    for (name, bytes) in [("plain", PLAIN), ("compressed", COMPRESSED)] {
        let whole = Table::parse("a.mat", bytes).unwrap().names().len();
        let mut complete = 0;
        for end in 20..bytes.len() {
            match Table::parse("a.mat", &bytes[..end]) {
                // A file that ends between two variables gives no sign that there were more.
                Ok(table) => {
                    assert!(table.names().len() < whole, "{name} {end}");
                    complete += 1;
                }
                Err(IoError::Malformed { .. } | IoError::Empty { .. }) => {}
                Err(e) => panic!("{name} cut at {end}: {e}"),
            }
        }
        assert!(complete < 14, "{name}: {complete} cuts of 14 variables were not noticed");
    }
    let e = Table::parse("a.mat", &PLAIN[..200]).unwrap_err().to_string();
    assert_eq!(e, "a.mat, byte 129: an element of 112 bytes has only 64: the file is cut short");
}

proptest! {
    #[test]
    fn no_damage_panics(at in 0..PLAIN.len(), byte in any::<u8>(), packed in any::<bool>()) {
        let mut bytes = if packed { COMPRESSED } else { PLAIN }.to_vec();
        let at = at % bytes.len();
        bytes[at] = byte;
        if let Ok(table) = Table::parse("a.mat", &bytes) {
            super::use_all(&table);
        }
    }
}
