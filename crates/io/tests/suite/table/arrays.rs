//! Cell arrays and arrays of structs. Reference: SciPy and h5py wrote the files
//! (`data/make_arrays.py`); the numbers are in this test.

use mechid_io::{Quantity, Table, TimeAxis};

use super::matlab::{FORCE, X};

const LEVEL5: &[u8] = include_bytes!("../../data/arrays.mat");
#[cfg(feature = "hdf5")]
const VERSION73: &[u8] = include_bytes!("../../data/arrays73.mat");

fn tables() -> Vec<Table> {
    let files = [
        LEVEL5,
        #[cfg(feature = "hdf5")]
        VERSION73,
    ];
    files.into_iter().map(|bytes| Table::parse("a.mat", bytes).unwrap()).collect()
}

#[test]
fn elements_of_cell_arrays_are_columns() {
    for table in tables() {
        assert_eq!(table.column("cells{1}").unwrap(), FORCE);
        assert_eq!(table.column("cells{3}[2]").unwrap(), X.map(|x| -x));
        let text = table.column("cells{2}").unwrap_err().to_string();
        assert!(text.contains("text"), "{text}");
        // A cell array of texts gives one column, not one column for each text.
        let text = table.column("texts").unwrap_err().to_string();
        assert!(text.contains("a cell array"), "{text}");
    }
}

#[test]
fn channels_in_an_array_of_structs_have_their_names_units_and_rate() {
    for table in tables() {
        let [force, x] = ["rec.Y(1).Data", "rec.Y(2).Data"].map(|name| table.find(name).unwrap());
        assert_eq!(table.values(force).unwrap(), FORCE);
        assert_eq!(table.values(x).unwrap(), X);
        assert_eq!([table.about(force), table.about(x)], ["hammer", "tip"]);
        assert_eq!(table.to_si(force, Quantity::Force).unwrap(), 1e3);
        assert!((table.to_si(x, Quantity::ACCELERATION).unwrap() - 9.80665).abs() < 1e-12);
        let sampling = table.sampling(&TimeAxis::OfFile, &["rec.Y(2).Data"]).unwrap();
        assert_eq!((sampling.len(), sampling.dt()), (8, 0.25));
    }
}

#[test]
fn a_unit_of_a_struct_is_not_that_of_its_time() {
    let table = Table::parse("a.mat", LEVEL5).unwrap();
    assert_eq!(table.to_si(table.find("one.x").unwrap(), Quantity::DISPLACEMENT).unwrap(), 1e-3);
    assert_eq!(table.sampling(&TimeAxis::OfFile, &["one.x"]).unwrap().dt(), 0.25);
}

/// Returns a MATLAB file with one variable: the class code `class`, then `elements`.
fn one_variable(class: u32, elements: &[(u32, &[u8])]) -> Vec<u8> {
    let mut variable = Vec::new();
    let flags = [class.to_le_bytes(), 0_u32.to_le_bytes()].concat();
    for (kind, data) in [(6, flags.as_slice())].iter().chain(elements) {
        variable.extend(kind.to_le_bytes());
        variable.extend((data.len() as u32).to_le_bytes());
        variable.extend(*data);
        variable.resize(variable.len().next_multiple_of(8), 0);
    }
    let mut file = b"MATLAB 5.0 MAT-file".to_vec();
    file.resize(124, b' ');
    file.extend(b"\x00\x01IM\x0e\0\0\0");
    file.extend((variable.len() as u32).to_le_bytes());
    file.extend(variable);
    file
}

#[test]
fn a_timetable_is_refused_with_the_way_to_save_it() {
    // An object in this format contains its name, its kind and its class.
    let file = one_variable(17, &[(1, b"T"), (1, b"MCOS"), (1, b"timetable")]);
    let error = Table::parse("a.mat", &file).unwrap().column("T").unwrap_err().to_string();
    assert!(error.contains("a timetable") && error.contains("struct('time'"), "{error}");
}

#[test]
fn structs_that_are_promised_and_not_there_are_refused() {
    // The file claims 65,536 by 65,535 structs with one field each, but contains none.
    let sizes = [65_536_u32, 65_535].map(u32::to_le_bytes).concat();
    let length = 2_u32.to_le_bytes();
    let file = one_variable(2, &[(5, &sizes), (1, b"s"), (5, &length), (1, b"x\0")]);
    let error = Table::parse("a.mat", &file).unwrap_err().to_string();
    assert!(error.contains("ends before its elements"), "{error}");
    // An array of structs without fields has no contents, whatever its size.
    let file = one_variable(2, &[(5, &sizes), (1, b"s"), (5, &length), (1, b"")]);
    let error = Table::parse("a.mat", &file).unwrap().column("s").unwrap_err().to_string();
    assert!(error.contains("nothing"), "{error}");
}
