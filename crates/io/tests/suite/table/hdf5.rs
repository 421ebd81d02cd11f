//! HDF5 and MATLAB 7.3. Reference: h5py wrote the files (`data/make_hdf5.py`); the numbers are in
//! this test.

use mechid_io::{IoError, Limits, Quantity, ReadOptions, Table, TimeAxis};
use proptest::prelude::*;

use super::matlab::{FORCE, X};

const GROUPS: &[u8] = include_bytes!("../../data/groups.h5");
const MATLAB: &[u8] = include_bytes!("../../data/matlab73.mat");

const UNITS: &[u8] = include_bytes!("../../data/units.h5");

fn groups() -> Table {
    Table::parse("a.h5", GROUPS).unwrap()
}

#[test]
fn data_sets_are_columns_with_the_units_and_rates_of_their_attributes() {
    let table = groups();
    assert_eq!(table.format(), "HDF5");
    let names: Vec<&str> = table.names().iter().map(String::as_str).collect();
    assert_eq!(
        names,
        [
            "analytic",
            "counts",
            "cube",
            "note",
            "nothing",
            "run 1/force",
            "run 1/motion[1]",
            "run 1/motion[2]",
            "run 2/acc",
            "run 2/time"
        ]
    );
    let si = |name: &str, quantity| table.to_si(table.find(name).unwrap(), quantity).unwrap();
    assert_eq!(table.column("run 1/force").unwrap(), FORCE);
    assert_eq!(si("run 1/force", Quantity::Force), 1e3);
    assert_eq!(table.column("run 1/motion[1]").unwrap(), X);
    assert_eq!(table.column("run 1/motion[2]").unwrap(), X.map(|x| -x));
    assert_eq!(si("run 1/motion[1]", Quantity::DISPLACEMENT), 1e-3);
    assert_eq!(si("run 1/motion[2]", Quantity::DISPLACEMENT), 1e-6);
    assert!((si("run 2/acc", Quantity::ACCELERATION) - 9.80665).abs() < 1e-12);
    // The time axis follows from the rate that the group `run 1` states, from the data set `time`
    // in the group `run 2`, or from the step that the data set `counts` states.
    for names in [&["run 1/force", "run 1/motion[2]"][..], &["run 2/acc"], &["counts"]] {
        let record = table.record(&TimeAxis::OfFile, names).unwrap();
        assert_eq!((record.len(), record.sampling().dt()), (8, 0.25), "{names:?}");
    }
    let counts: Vec<f64> = (-4..4).map(f64::from).collect();
    assert_eq!(table.column("counts").unwrap(), counts);
}

#[test]
fn variables_of_matlab_are_columns() {
    let table = Table::parse("a.mat", MATLAB).unwrap();
    assert_eq!(table.format(), "MATLAB 7.3 (HDF5)");
    assert_eq!(table.column("force").unwrap(), FORCE);
    assert_eq!(table.column("motion[2]").unwrap(), X.map(|x| -x));
    assert_eq!(table.column("single").unwrap(), X);
    assert_eq!(table.column("rig.x").unwrap(), X);
    assert_eq!(table.scalars(), [("fs".to_owned(), 4.0)]);
    // The struct contains its own time, which differs from the time outside the struct.
    assert_eq!(table.sampling(&TimeAxis::OfFile, &["rig.x"]).unwrap().dt(), 0.5);
    assert_eq!(table.sampling(&TimeAxis::OfFile, &["force"]).unwrap().dt(), 0.25);
}

#[test]
fn what_is_no_array_of_real_numbers_is_named() {
    let [groups, matlab] = [groups(), Table::parse("a.mat", MATLAB).unwrap()];
    for (table, column, what) in [
        (&groups, "analytic", "complex numbers"),
        (&groups, "note", "text"),
        (&groups, "cube", "3 dimensions"),
        (&groups, "nothing", "an empty array"),
        (&matlab, "rig.label", "text"),
        (&matlab, "nothing", "an empty array"),
    ] {
        let error = table.column(column).unwrap_err().to_string();
        assert!(error.contains(what), "{column}: {error}");
    }
}

/// The stored numbers −4 to 3 are multiplied by the factor that an attribute states, and the offset
/// is then added.
#[test]
fn factors_and_offsets_of_attributes_are_applied() {
    let table = Table::parse("a.h5", UNITS).unwrap();
    let numbers = |factor: f64, offset: f64| -> Vec<f64> {
        (-4..4).map(|k| factor * f64::from(k) + offset).collect()
    };
    assert_eq!(table.column("packed").unwrap(), numbers(0.25, 1.0));
    assert_eq!(table.column("scaled").unwrap(), numbers(0.5, 0.0));
    assert_eq!(table.to_si(table.find("packed").unwrap(), Quantity::Force).unwrap(), 1e3);
    let volts = table.find("volts").unwrap();
    assert!((table.to_si(volts, Quantity::ACCELERATION).unwrap() - 9.80665).abs() < 1e-12);
    for (column, what) in [("two_scales", "scale_factor"), ("doubtful_offset", "the offset offset")]
    {
        let error = table.column(column).unwrap_err().to_string();
        assert!(error.contains(what), "{error}");
    }
}

#[test]
fn what_cannot_be_read_and_is_not_used_does_no_harm() {
    let table = Table::parse("a.h5", include_bytes!("../../data/unreadable.h5")).unwrap();
    let numbers: Vec<f64> = (-4..4).map(f64::from).collect();
    assert_eq!(table.column("force").unwrap(), numbers);
    for (column, what) in [
        ("reserve", "more than the file"),
        ("packed", "cannot be read"),
        ("other", "cannot be read"),
    ] {
        let error = table.column(column).unwrap_err().to_string();
        assert!(error.contains(what), "{error}");
    }
}

/// The data sets in groups of the old format are read as h5py wrote them, and the soft links to
/// these data sets are skipped.
#[test]
fn groups_of_the_old_format_with_soft_links_are_read() {
    let table = Table::parse("a.h5", include_bytes!("../../data/links.h5")).unwrap();
    assert_eq!(table.names(), ["run/force", "run/x", "run/zero"]);
    assert_eq!(table.column("run/x").unwrap(), X);
    assert_eq!(table.column("run/zero").unwrap(), X.map(|x| -x));
    assert_eq!(table.sampling(&TimeAxis::OfFile, &["run/force"]).unwrap().dt(), 0.25);
}

#[test]
fn limits_hold() {
    let with = |limits| {
        let options = ReadOptions { limits, ..ReadOptions::default() };
        Table::parse_with("a.h5", GROUPS, &options).unwrap_err()
    };
    for limits in [
        Limits { columns: 5, ..Limits::DEFAULT },
        Limits { numbers: 20, ..Limits::DEFAULT },
        Limits { unpacked_bytes: 60, ..Limits::DEFAULT },
    ] {
        assert!(matches!(with(limits), IoError::TooLarge { .. }), "{limits:?}");
    }
    let skip = ReadOptions { skip_lines: 1, ..ReadOptions::default() };
    let error = Table::parse_with("a.h5", GROUPS, &skip).unwrap_err();
    assert!(matches!(error, IoError::NothingToSkip { .. }), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn no_damage_panics(at in 0..MATLAB.len().min(GROUPS.len()), byte: u8, cut in 0..GROUPS.len()) {
        for file in [GROUPS, MATLAB] {
            let mut bytes = file.to_vec();
            bytes[at] = byte;
            drop(Table::parse("a.h5", &bytes));
            bytes.truncate(cut);
            drop(Table::parse("a.h5", &bytes));
        }
    }
}
