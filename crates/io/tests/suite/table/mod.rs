//! Tables in every dialect and format, and the messages about wrong tables.

mod arrays;
mod dialects;
#[cfg(feature = "hdf5")]
mod hdf5;
mod headings;
mod matlab;
mod packed;
#[cfg(feature = "parquet")]
mod parquet;
mod stretches;
#[cfg(feature = "hdf5")]
mod timetables;
mod universal;

use mechid_io::{IoError, Quantity, ReadOptions, Table, TimeAxis, csv_text};
use mechid_model::ResponseQuantity;
use mechid_signal::Sampling;
use proptest::prelude::*;

fn table(text: &str) -> Table {
    Table::parse("a.csv", text.as_bytes()).unwrap()
}

fn refused(text: &str) -> String {
    Table::parse("a.csv", text.as_bytes()).unwrap_err().to_string()
}

const RATE: TimeAxis<'_> = TimeAxis::RateHz(100.0);

#[test]
fn dialects_agree() {
    for (text, what) in [
        ("t,f\n0,1.5\n1,-2\n", "comma"),
        ("\u{feff}\"t\",\"f\",\r\n0, 1.5,\r\n1,-2,\r\n", "byte order mark, quotes, trailing comma"),
        ("t;f\n0;1,5\n1;-2,0\n", "semicolon, decimal comma"),
        ("t\tf\n0\t1.5\n1\t-2\n", "tab"),
        ("  t    f\n  0  1.50\n  1  -2e0\n\n\n", "blanks, empty lines at the end"),
        ("# rig 4\nt,f\n\n0,1.5\n# pause\n1,-2\n", "comments and empty lines"),
        ("t,f\n0,1.5\n1,-2\n,\n,\n", "empty rows at the end"),
        ("t,f,note\n0,1.5,start\n1,-2,\"end, of it\"\n", "a column of text that nobody asks for"),
        ("t,f,\n0,1.5\n1,-2,\n", "a trailing comma on some lines only"),
    ] {
        let table = table(text);
        let record = table.record(&TimeAxis::Column("t"), &["f"]).expect(what);
        assert_eq!(record.channel(0), [1.5, -2.0], "{what}");
        assert_eq!(record.sampling().dt(), 1.0, "{what}");
    }
}

#[test]
fn columns_by_number_without_header() {
    let t = table("0.0,1\n0.5,2\n");
    assert_eq!((t.len(), t.width()), (2, 2));
    let record = t.record(&TimeAxis::Column("1"), &["2"]).unwrap();
    assert_eq!((record.channel(0), record.sampling().dt()), ([1.0, 2.0].as_slice(), 0.5));
}

#[test]
fn a_name_that_is_a_number_wins_over_the_number() {
    let t = table("2,x\n5,6\n");
    assert_eq!(t.column("2").unwrap(), [5.0]);
    let t = table("x,1\n5,6\n");
    assert_eq!(t.column("1").unwrap(), [6.0]);
}

/// Reads the format of the measured benchmark record: leading columns that are empty after the
/// first row, and a trailing comma.
#[test]
fn leading_columns_with_one_value() {
    let t = table("\"Ovld2\",\"Ovld1\",\"V1\",\"V2\",\n0,0,0.5,1,\n,,-0.5,2,\n");
    let record = t.record(&RATE, &["V1", "4"]).unwrap();
    assert_eq!(
        (record.channel(0), record.channel(1)),
        ([0.5, -0.5].as_slice(), [1.0, 2.0].as_slice())
    );
    assert_eq!(t.available(), "1 \"Ovld2\", 2 \"Ovld1\", 3 \"V1\", 4 \"V2\"");
    let e = t.column("Ovld2").unwrap_err();
    assert!(matches!(e, IoError::EmptyField { line: 3, .. }), "{e}");
}

#[test]
fn missing_and_duplicate_columns_list_those_there_are() {
    let t = table("t,f,f\n0,1,2\n1,1,2\n");
    assert_eq!(
        t.column("x").unwrap_err().to_string(),
        "a.csv has no column \"x\"; its columns are 1 \"t\", 2 \"f\", 3 \"f\""
    );
    for number in ["0", "4", "-1", ""] {
        assert!(matches!(t.column(number), Err(IoError::MissingColumn { .. })), "{number}");
    }
    let e = t.column("f").unwrap_err();
    assert!(matches!(e, IoError::AmbiguousColumn { .. }), "{e}");
    assert!(e.to_string().contains("3 \"f\""), "{e}");
    let e = t.record(&TimeAxis::Column("t"), &["2", "3", "2"]).unwrap_err();
    assert!(matches!(e, IoError::DuplicateColumn { column: 2, .. }), "{e}");
    let e = t.record(&TimeAxis::Column("t"), &["1"]).unwrap_err();
    assert!(matches!(e, IoError::DuplicateColumn { column: 1, .. }), "{e}");
}

#[test]
fn a_column_is_found_by_its_name_before_the_unit() {
    let t = table("Time [s],Fx [N],Fy [N],Fx,x_mm,a / g,2 [V]\n0,1,2,3,4,5,6\n1,1,2,3,4,5,6\n");
    for (wanted, column) in [("Fy", 2), ("Fx", 3), ("Fx [N]", 1), ("x", 4), ("a", 5), ("Time", 0)] {
        assert_eq!(t.find(wanted).unwrap(), column, "{wanted}");
    }
    // `2` means the column with the name `2 [V]`, not the second column: a name has priority over a
    // number, also if its unit is omitted.
    assert_eq!((t.find("2").unwrap(), t.find("3").unwrap()), (6, 2));
    let t = table("F [N],F (kN)\n0,1\n");
    assert_eq!(
        table("Fx,Fy [N],Fy_kN\n0,1,2\n").find("Fy").unwrap_err().to_string(),
        "a.csv has several columns \"Fy\"; choose one by its number: 2 \"Fy [N]\", 3 \"Fy_kN\""
    );
    assert!(matches!(t.find("F"), Err(IoError::AmbiguousColumn { .. })));
    assert!(matches!(table("[N],x\n0,1\n").find(""), Err(IoError::MissingColumn { .. })));
}

#[test]
fn units_have_a_factor_to_the_si() {
    let t = table("F [kN],x [um],y\n1,2,3\n");
    let displacement = ResponseQuantity::Displacement.into();
    assert_eq!(t.to_si(0, Quantity::Force).unwrap(), 1e3);
    assert_eq!(t.to_si(1, displacement).unwrap(), 1e-6);
    assert_eq!(t.to_si(2, displacement).unwrap(), 1.0);
    assert_eq!(
        t.to_si(0, displacement).unwrap_err().to_string(),
        "a.csv, column 1 \"F [kN]\": its unit kN is a unit of force, but a unit of displacement is needed"
    );
}

/// Instants at 25.6 kHz that are printed with six decimals are uniform, although the steps differ
/// by up to 2.6 %.
#[test]
fn instants_rounded_to_printed_digits_are_uniform() {
    for (decimals, unit) in [(6, ""), (5, ""), (3, "_ms"), (2, " [ms]")] {
        let scale = if unit.is_empty() { 1.0 } else { 1e3 };
        let times = (0..20_000).map(|k| f64::from(k) / 25_600.0 * scale);
        let rows: String = times.map(|t| format!("{t:.decimals$},1\n")).collect();
        let time = format!("t{unit}");
        let t = table(&format!("{time},f\n{rows}"));
        let record = t.record(&TimeAxis::Column(&time), &["f"]).unwrap();
        let error = record.sampling().dt() * 25_600.0 - 1.0;
        assert!(error.abs() < 1e-5, "{decimals} {unit}: {error}");
        // If one instant is missing, the instants are not uniform.
        let (before, after) = rows.split_at(rows.match_indices('\n').nth(9_000).unwrap().0 + 1);
        let gap = after.split_once('\n').unwrap().1;
        let t = table(&format!("{time},f\n{before}{gap}"));
        let e = t.record(&TimeAxis::Column(&time), &["f"]).unwrap_err();
        assert!(matches!(e, IoError::NonUniformTime { .. }), "{e}");
    }
}

#[test]
fn time_is_taken_in_the_unit_that_its_name_or_the_line_of_units_says() {
    for text in [
        "Time [ms],f\n0,1\n2,-1\n4,1\n",
        "t;f\nms;N\n0;1\n2;-1\n4;1\n",
        "time_s f\n0 1\n0.002 -1\n0.004 1\n",
        "f,TIME,\nN,s,\n1,0,\n-1,0.002,\n1,0.004,\n",
    ] {
        let t = table(text);
        let time = t.time_column().expect(text);
        let record = t.record(&TimeAxis::Column(time), &["f"]).unwrap();
        assert!((record.sampling().dt() - 2e-3).abs() < 1e-15, "{text}");
        assert_eq!(record.channel(0), [1.0, -1.0, 1.0], "{text}");
    }
    let uneven = table("time_ms,f\n0,1\n2,1\n4,1\n9,1\n");
    let e = uneven.record(&TimeAxis::Column("time_ms"), &["f"]).unwrap_err();
    assert!(
        matches!(e, IoError::NonUniformTime { step, usual, .. } if step == 5e-3 && usual == 2e-3)
    );
    // One line of units is read, not two.
    let twice = table("t,f\ns,N\nx,y\n0,1\n");
    assert!(matches!(twice.column("f"), Err(IoError::NotANumber { line: 3, .. })));
    assert_eq!(table("speed,f\n0,1\n1,2\n").time_column(), None);
}

#[test]
fn bad_fields_are_named_with_line_and_column() {
    for (field, message) in [
        ("abc", "a.csv, line 4, column 2 \"f\": \"abc\" is not a number"),
        ("1.2.3", "a.csv, line 4, column 2 \"f\": \"1.2.3\" is not a number"),
        ("", "a.csv, line 4, column 2 \"f\": the field is empty, a number is needed"),
        ("NaN", "a.csv, line 4, column 2 \"f\": NaN is not a finite number"),
        ("-inf", "a.csv, line 4, column 2 \"f\": -inf is not a finite number"),
        ("1e999", "a.csv, line 4, column 2 \"f\": inf is not a finite number"),
    ] {
        let t = table(&format!("t,f\n0,1\n# a comment counts as a line\n1,{field}\n2,2\n"));
        assert_eq!(t.column("f").unwrap_err().to_string(), message);
    }
    // If the fields are not separated by semicolons, a comma is not a decimal comma.
    assert!(table("t;f\n0;1\n1;2,5,5\n").column("f").is_err());
}

#[test]
fn ragged_rows_are_named() {
    assert_eq!(
        refused("t,f\n0,1\n1\n2,3\n"),
        "a.csv, line 3: this line has 1 field, but the first line has 2"
    );
    assert_eq!(
        refused("t,f\n0,1\n1,2,3\n"),
        "a.csv, line 3: this line has 3 fields, but the first line has 2"
    );
    assert_eq!(
        refused("1 2\n3 4\n5\n"),
        "a.csv, line 3: this line has 1 field, but the first line has 2"
    );
}

#[test]
fn files_without_data_are_refused() {
    assert_eq!(refused(""), "a.csv holds no data: it is empty");
    assert_eq!(refused("\n\n# only a comment\n"), "a.csv holds no data: it is empty");
    assert_eq!(refused("t,f\n"), "a.csv holds no data: there is a header and nothing below it");
    let utf32 = b"\xff\xfe\0\0t\0\0\0,\0\0\0f\0\0\0";
    assert!(matches!(Table::parse("a.csv", utf32), Err(IoError::UnknownFormat { .. })));
    assert!(matches!(Table::read("no/such.csv"), Err(IoError::Read { .. })));
}

#[test]
fn utf16_is_read_in_either_byte_order() {
    let text = "\u{feff}t [µs]\tκ\r\n0\t1,5\r\n1\t−\r\n";
    for encode in [u16::to_le_bytes, u16::to_be_bytes] {
        let mut bytes: Vec<u8> = text.encode_utf16().flat_map(encode).collect();
        let table = Table::parse("a.txt", &bytes).unwrap();
        assert_eq!(table.names(), ["t [µs]", "κ"]);
        assert_eq!(table.format(), "text, fields between tabs, decimal comma, in UTF-16");
        assert_eq!(table.column("t [µs]").unwrap(), [0.0, 1.0]);
        let e = table.column("κ").unwrap_err().to_string();
        assert_eq!(e, "a.txt, line 3, column 2 \"κ\": \"−\" is not a number");
        // The file ends after the first of the two bytes of its last character, a line break: this
        // byte belongs to the last field.
        bytes.pop();
        let e = Table::parse("a.txt", &bytes).unwrap().column("κ").unwrap_err().to_string();
        assert!(e.starts_with("a.txt, line 3, column 2 \"κ\": \"−\\r\u{fffd}\" is not"), "{e}");
    }
}

#[test]
fn json_is_no_record() {
    for text in ["{}", "{", "\u{feff}{\n  \"system\": 3 }", "[ { \"a\": 1 } ]"] {
        let e = Table::parse("a.json", text.as_bytes()).unwrap_err();
        assert!(matches!(e, IoError::JsonRecord { .. }), "{text}: {e}");
        assert!(
            e.to_string().starts_with("a.json is JSON, not a table of samples; simulate"),
            "{e}"
        );
    }
    assert_eq!(table("{a},[b]\n1,2\n").names(), ["{a}", "[b]"]);
    assert_eq!(table("[a],[b]\n1,2\n").names(), ["[a]", "[b]"]);
}

/// Reads the table below some header lines.
fn read_below(path: &std::path::Path, skip_lines: u64) -> Result<Table, IoError> {
    Table::read_with(path, &ReadOptions { skip_lines, ..ReadOptions::default() })
}

/// Texts that instruments write above a table. In the tests, tables with the same three columns
/// follow these texts.
const ABOVE: [&str; 3] = [
    "Analyser 7\n",
    "Device: shaker, left\nDate;2024-03-01\n\nChannel 1 2 3\n",
    "a\nb\nc\nd\ne\nf\ng\nh\ni\n",
];

#[test]
fn what_stands_above_the_table_is_left_out_when_told() {
    let folder = tempfile::tempdir().unwrap();
    for above in ABOVE {
        for below in ["t,f,x\ns,N,m\n0,1,2\n1,2,3\n2,1,1\n", "0 1 2\n1 2 3\n2 1 1\n"] {
            let text = format!("{above}{below}");
            let lines = above.lines().count() as u64;
            let e = refused(&text);
            let begins = format!("begin on line {}, with 3 fields", lines + 1);
            assert!(e.contains(&begins) && e.ends_with(&format!("`skip_lines` {lines}")), "{e}");
            let path = folder.path().join("a.csv");
            std::fs::write(&path, &text).unwrap();
            let told = read_below(&path, lines).unwrap();
            let alone = table(below);
            assert_eq!((told.names(), told.len()), (alone.names(), 3), "{text}");
            assert_eq!(told.column("3").unwrap(), [2.0, 3.0, 1.0]);
            // Line numbers are those of the file.
            let mut rows = text.lines().count() as u64;
            assert_eq!(told.position(2).to_string(), format!("line {rows}"));
            std::fs::write(&path, text + "3,4\n").unwrap();
            rows += 1;
            let e = read_below(&path, lines).unwrap_err().to_string();
            assert!(e.contains(&format!("a.csv, line {rows}: ")), "{e}");
        }
    }
    // Comments, and a wrong row further down, do not count as text above the table.
    assert!(refused("# rig\nt,f\n0,1\n1,2\n3\n").contains("line 5: this line has 1 field"));
    let path = folder.path().join("a.csv");
    std::fs::write(&path, "t,f\n0,1\n").unwrap();
    assert!(matches!(read_below(&path, 9), Err(IoError::Empty { .. })));
    std::fs::write(&path, "MATLAB 5.0 MAT-file").unwrap();
    assert!(matches!(read_below(&path, 1), Err(IoError::NothingToSkip { .. })));
}

#[test]
fn uneven_time_is_refused_with_its_worst_step() {
    let of = |times: &[f64]| {
        let rows: String = times.iter().map(|t| format!("{t},1\n")).collect();
        table(&format!("t,f\n{rows}")).record(&TimeAxis::Column("t"), &["f"])
    };
    let record = of(&[5.0, 5.1, 5.2, 5.3]).unwrap();
    assert!((record.sampling().dt() - 0.1).abs() < 1e-12, "rounding of 5.3 − 5");
    // The mean step stays right for any rounding of the printed times.
    assert!((of(&[0.0, 0.333, 0.667, 1.0]).unwrap().sampling().dt() - 1.0 / 3.0).abs() < 1e-12);
    let e = of(&[0.0, 1.0, 2.0, 3.5, 4.75]).unwrap_err();
    assert!(
        e.to_string().starts_with(
            "a.csv: the time steps are not uniform: the step up to line 5 is 1.5 s, but the usual step is 1.25 s"
        ),
        "{e}"
    );
    assert!(e.to_string().contains("resample the record"), "{e}");
    // The time of the second run starts again at zero.
    let e = of(&[0.0, 1.0, 2.0, 0.0, 1.0, 2.0]).unwrap_err().to_string();
    assert!(e.contains("the step up to line 5 is -2 s") && e.contains("had been appended"), "{e}");
    assert!(!e.contains("resample"), "{e}");
    for times in
        [&[0.0, 1.0, 0.5, 1.5][..], &[0.0, 0.0, 0.0], &[2.0, 1.0, 0.0], &[-1.7e308, 1.7e308]]
    {
        let e = of(times).unwrap_err();
        assert!(matches!(e, IoError::NonUniformTime { .. }), "{times:?}: {e}");
    }
    assert!(matches!(of(&[1.0]), Err(IoError::SingleSample { .. })));
    for rate in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-320] {
        let e = table("f\n1\n2\n").record(&TimeAxis::RateHz(rate), &["f"]).unwrap_err();
        assert!(matches!(e, IoError::SampleRate { .. }), "{rate}");
    }
}

/// Generates texts that resemble a table more often than random bytes do.
fn tables() -> impl Strategy<Value = String> {
    let field = prop_oneof![
        Just(String::new()),
        any::<f64>().prop_map(|v| v.to_string()),
        "[a-z\"# ]{0,4}",
        "-?[0-9]{1,3}[.,]?[0-9]{0,2}",
    ];
    let line = prop::collection::vec(field, 0..5);
    (prop::collection::vec(line, 0..8), prop::sample::select(vec![",", ";", "\t", " ", ", "]))
        .prop_map(|(lines, d)| lines.iter().map(|l| l.join(d)).collect::<Vec<_>>().join("\n"))
}

fn use_all(table: &Table) {
    let columns: Vec<String> = (1..=table.width()).map(|c| c.to_string()).collect();
    for column in columns.iter().chain(table.names()) {
        let _ = table.column(column).map_err(|e| e.to_string());
        let _ = table.record(&TimeAxis::Column(column), &columns).map_err(|e| e.to_string());
        let _ = table.record(&RATE, &[column]).map_err(|e| e.to_string());
    }
    let _ = table.available();
}

proptest! {
    #[test]
    fn no_bytes_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        if let Ok(table) = Table::parse("a.csv", &bytes) {
            use_all(&table);
        }
    }

    #[test]
    fn no_table_panics(text in tables()) {
        if let Ok(table) = Table::parse("a.csv", text.as_bytes()) {
            use_all(&table);
        }
    }

    #[test]
    fn what_is_written_is_read_back_bit_for_bit(
        values in prop::collection::vec(prop::num::f64::NORMAL | prop::num::f64::ZERO, 2..40),
        name in "[a-z][a-z ,;\"]{0,6}[a-z]",
    ) {
        let sampling = Sampling::new(1e-3, values.len()).unwrap();
        let text = csv_text(sampling, &[(name.clone(), &values)]);
        let table = Table::parse("a.csv", text.as_bytes()).unwrap();
        for (back, value) in table.column(&name).unwrap().iter().zip(&values) {
            prop_assert_eq!(back.to_bits(), value.to_bits());
        }
    }
}
