//! Decimal signs, quotes, and rows longer than a block. Reference: the csv crate, and the number
//! parser of Rust.

use std::fmt::Write as _;

use mechid_io::{DecimalSign, IoError, Place, Table};
use proptest::prelude::*;

use super::table;

#[test]
fn a_file_has_one_decimal_sign() {
    for (text, column, line, sign) in [
        ("t\tf\n0\t999.5\n1\t1,000\n", "f", 3, DecimalSign::Point),
        ("t;f\n0;999.5\n1;1,000\n", "f", 3, DecimalSign::Point),
        ("t f\n0 1,5\n1 2.5\n2 1,5\n", "f", 3, DecimalSign::Comma),
        // The decimal sign of the file is that of most numbers on its first lines, even if a number
        // with the other decimal sign comes first.
        ("version;f;g\n1.2;0,5;1,5\n1.3;0,5;1,5\n", "version", 2, DecimalSign::Comma),
    ] {
        let e = table(text).column(column).unwrap_err();
        match e {
            IoError::MixedDecimalSigns { line: at, sign: of_file, .. } => {
                assert_eq!((at, of_file), (line, sign), "{text}");
            }
            other => panic!("{text}: {other}"),
        }
    }
    assert_eq!(table("version;f\n1.2;0,5\n1.3;0,5\n1;1,5\n").column("f").unwrap(), [0.5, 0.5, 1.5]);
    let mixed = table("t\tf\n0\t999.5\n1\t1,000\n").column("f").unwrap_err().to_string();
    assert_eq!(
        mixed,
        "a.csv, line 3, column 2 \"f\": \"1,000\" does not have the decimal point that the other numbers \
         of the file have: use one decimal sign, and no separator between thousands"
    );
    let comma = table("t;f\n0;1,5\n1;2\n");
    assert_eq!(comma.format(), "text, fields between semicolons, decimal comma");
    assert_eq!(comma.column("f").unwrap(), [1.5, 2.0]);
    assert_eq!(table("t;f\n0;1.5\n").format(), "text, fields between semicolons");
}

/// In a text of two million bytes, the first number with a decimal sign determines the sign for all
/// numbers, even if this number is far from the beginning of the text.
#[test]
fn the_decimal_sign_of_a_long_file_is_that_of_its_first_number_with_one() {
    let text = |first: &str, second: &str| {
        let mut text = String::from("t;f;g\n");
        for k in 0..200_000 {
            let (f, g) = match k {
                150_000 => (first, "1"),
                190_000 => ("1", second),
                _ => ("1", "1"),
            };
            writeln!(text, "{k};{f};{g}").unwrap();
        }
        text
    };
    let table = table(&text("0,5", "0.5"));
    assert_eq!(table.column("f").unwrap()[150_000], 0.5);
    let e = table.column("g").unwrap_err();
    assert!(matches!(e, IoError::MixedDecimalSigns { line: 190_002, .. }), "{e}");
    let table = super::table(&text("0.5", "0,5"));
    assert_eq!(table.column("f").unwrap()[150_000], 0.5);
    let e = table.column("g").unwrap_err();
    assert!(
        matches!(e, IoError::MixedDecimalSigns { line: 190_002, sign: DecimalSign::Point, .. }),
        "{e}"
    );
}

/// Reads lines that end with a carriage return and no line feed, as some old programs wrote them.
#[test]
fn old_line_ends_are_understood() {
    let table = table("t,f\r0,1\r1,2\r");
    assert_eq!(table.column("f").unwrap(), [1.0, 2.0]);
    assert_eq!(table.position(1), Place::Line(3));
    let e = Table::parse("a.csv", b"t,f\r0,1\r1,?\r").unwrap().column("f").unwrap_err();
    assert!(matches!(e, IoError::NotANumber { line: 3, .. }), "{e}");
}

#[test]
fn zero_bytes_behind_the_rows_are_no_rows() {
    let text = "t,f\n0,1\n1,2\n";
    for zeros in [1, 600, 300_000] {
        let mut bytes = text.as_bytes().to_vec();
        bytes.resize(text.len() + zeros, 0);
        let table = Table::parse("a.csv", &bytes).unwrap();
        assert_eq!(table.column("f").unwrap(), [1.0, 2.0]);
        let remark = table.remarks().join("");
        assert!(remark.contains(&format!("{zeros} zero byte")), "{remark}");
        bytes.extend(b"2,3\n");
        let e = Table::parse("a.csv", &bytes).unwrap_err();
        assert!(
            matches!(e, IoError::UnknownFormat { .. })
                || matches!(e, IoError::Malformed { at: Place::Line(4), .. }),
            "{e}"
        );
    }
    assert!(table(text).remarks().is_empty());
}

/// Reads quoted fields that contain delimiters, quotes and line breaks, from a file of many blocks.
#[test]
fn quotes_are_followed_over_a_long_file() {
    let note = |k: usize| match k % 5 {
        0 => "\"a, b\"",
        1 => "\"two\nlines\"",
        2 => "\"a \"\"quote\"\"\n#no comment\"",
        3 => "plain \" quote",
        _ => "# no comment",
    };
    let (mut text, mut line, mut lines) = (String::from("t,note,\"f, N\"\n"), 2, Vec::new());
    for k in 0..60_000 {
        lines.push(line);
        let row = format!("{k},{},{}\n", note(k), k % 10);
        line += row.matches('\n').count() as u64;
        text += &row;
    }
    let table = table(&text);
    assert_eq!(table.len(), 60_000);
    let wanted: Vec<f64> = (0..60_000).map(|k| f64::from(k % 10)).collect();
    assert_eq!(table.column("f, N").unwrap(), wanted);
    for k in [0, 1, 2, 3, 29_999, 59_999] {
        assert_eq!(table.position(k), Place::Line(lines[k]), "sample {k}");
    }
}

/// Returns the rows that the csv crate reads from a text.
fn by_csv(text: &str, delimiter: u8) -> Vec<Vec<Vec<u8>>> {
    let reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .delimiter(delimiter)
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let fields = |row: csv::ByteRecord| row.iter().map(<[u8]>::to_vec).collect::<Vec<_>>();
    reader.into_byte_records().map(|row| fields(row.unwrap())).collect()
}

proptest! {
    /// Tests any text of a few different characters in the second and third of four fields; the
    /// reference is the csv crate.
    #[test]
    fn fields_are_those_of_the_csv_crate(
        fields in prop::collection::vec("[a,;\" \n#]{0,6}", 2..12),
    ) {
        // The delimiter is detected from these rows.
        let mut text = "0,0,0,0\n".repeat(9);
        for pair in fields.chunks_exact(2) {
            // The field is written between quotes without a check of its contents, so that the
            // quoting can be wrong.
            writeln!(text, "7,{},\"{}\",9", pair[0].replace('\n', ""), pair[1]).unwrap();
        }
        let rows = by_csv(&text, b',');
        // A text is not compared if a row does not have four fields, because `Table` refuses such a
        // row, or if a row begins with a semicolon, because only `Table` reads such a row as a
        // comment.
        if rows.iter().any(|row| row.len() != 4 || row[0].starts_with(b";")) {
            return Ok(());
        }
        let table = Table::parse("a.csv", text.as_bytes()).unwrap();
        prop_assert_eq!(table.len(), rows.len());
        for (column, first) in [(1, "1"), (2, "2"), (3, "3"), (4, "4")] {
            // The error repeats the first field that is not a number.
            let wrong = rows.iter().map(|row| String::from_utf8(row[column - 1].clone()).unwrap());
            let wrong = wrong.into_iter().find(|field| field.parse::<f64>().is_err());
            match (table.column(&column.to_string()), wrong) {
                (Ok(_), None) => {}
                (Err(IoError::EmptyField { .. }), Some(field)) => prop_assert_eq!(field, ""),
                (Err(IoError::NotANumber { text, .. }), Some(field)) => {
                    prop_assert_eq!(text, field.chars().take(40).collect::<String>());
                }
                (read, wrong) => prop_assert!(false, "{first}: {:?}, {:?}", read, wrong),
            }
        }
    }

    /// Numbers are exactly the texts that Rust accepts, with equal values to the last bit.
    #[test]
    fn numbers_are_those_of_rust(
        fields in prop::collection::vec(
            prop_oneof![
                "[-+]?[0-9]{0,20}\\.?[0-9]{0,20}([eE][-+]?[0-9]{0,3})?",
                "[-+.0-9eEinfatyNxd_]{1,8}",
                any::<f64>().prop_map(|v| format!("{v:e}")),
                any::<f64>().prop_map(|v| format!("{v:?}")),
            ],
            1..40,
        ),
    ) {
        for field in fields {
            let text = format!("t,f\n0,1\n1, {field} \n");
            let column = Table::parse("a.csv", text.as_bytes()).unwrap();
            match (column.column("f"), field.parse::<f64>()) {
                (Ok(values), Ok(value)) => prop_assert_eq!(values[1].to_bits(), value.to_bits()),
                (Err(IoError::NotFinite { value: a, .. }), Ok(b)) => {
                    prop_assert!(a.is_nan() && b.is_nan() || a == b, "{}", field);
                }
                (Err(IoError::NotANumber { .. } | IoError::EmptyField { .. }), Err(_)) => {}
                (read, parsed) => prop_assert!(false, "{}: {:?}, {:?}", field, read, parsed),
            }
        }
    }
}

/// Reads a file of several blocks and compares all bits of every number.
#[test]
fn a_long_file_is_read_to_the_last_bit() {
    let value = |k: u64| {
        let bits = k.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (k << 29);
        let value = f64::from_bits(bits);
        if value.is_finite() { value } else { 0.5 }
    };
    for delimiter in [",", ";", "\t", " ", ", "] {
        let mut text = String::from("t x y z\n").replace(' ', delimiter);
        for k in 0..30_000_u64 {
            let [x, y, z] = [3 * k, 3 * k + 1, 3 * k + 2].map(value);
            writeln!(text, "{k}{delimiter}{x:e}{delimiter}{y}{delimiter}{z:?}").unwrap();
        }
        let table = table(&text);
        let columns = ["x", "y", "z"].map(|name| table.column(name).unwrap());
        for k in 0..30_000_u64 {
            for c in 0..3 {
                let read = columns[c as usize][k as usize];
                assert_eq!(read.to_bits(), value(3 * k + c).to_bits(), "{k} {c}");
            }
        }
    }
}
