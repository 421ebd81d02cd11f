//! Timetables of MATLAB 7.3. Reference: mat-io wrote the file (`data/make_timetable.py`); the
//! numbers are in this test.

use mechid_io::{Quantity, Table, TimeAxis};
use proptest::prelude::*;

use super::matlab::{FORCE, X};

const TIMETABLES: &[u8] = include_bytes!("../../data/timetable73.mat");

#[test]
fn variables_of_timetables_are_columns_with_the_times_of_their_rows() {
    let table = Table::parse("a.mat", TIMETABLES).unwrap();
    for rows in ["rows", "dates", "step", "rate"] {
        let [force, x] = ["force", "x"].map(|name| format!("{rows}.{name}"));
        assert_eq!(table.column(&force).unwrap(), FORCE);
        assert_eq!(table.column(&x).unwrap(), X);
        let record = table.record(&TimeAxis::OfFile, &[force, x]).unwrap();
        let dt = record.sampling().dt();
        // mat-io writes dates with a resolution of 0.25 µs.
        let digits = if rows == "dates" { 1e-6 } else { 1e-12 };
        assert!(record.len() == 8 && (dt - 0.25).abs() < digits, "{rows}: {dt}");
    }
    let si = |name: &str, quantity| table.to_si(table.find(name).unwrap(), quantity).unwrap();
    assert_eq!(si("rate.force", Quantity::Force), 1e3);
    assert_eq!(si("step.x", Quantity::DISPLACEMENT), 1e-3);
    assert_eq!(si("rows.x", Quantity::DISPLACEMENT), 1.0);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn no_damage_panics(at in 0..TIMETABLES.len(), byte: u8, cut in 0..TIMETABLES.len()) {
        let mut bytes = TIMETABLES.to_vec();
        bytes[at] = byte;
        drop(Table::parse("a.mat", &bytes));
        bytes.truncate(cut);
        drop(Table::parse("a.mat", &bytes));
    }
}
