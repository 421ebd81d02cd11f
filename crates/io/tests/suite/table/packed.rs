//! Files in gzip, and text that arrives piece by piece.

use std::io::Write as _;

use flate2::Compression;
use flate2::write::GzEncoder;
use mechid_io::{IoError, Place, Table, TimeAxis};

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

const FILES: [&[u8]; 4] = [
    b"t;f\r\n0,0;1,5\r\n0,5;-2\r\n",
    include_bytes!("../../data/plain.mat"),
    include_bytes!("../../data/compressed.mat"),
    include_bytes!("../../data/binary.unv"),
];

#[test]
fn every_format_is_read_through_gzip() {
    for bytes in FILES {
        let (plain, packed) =
            (Table::parse("a", bytes).unwrap(), Table::parse("a", &gzip(bytes)).unwrap());
        assert_eq!(plain.names(), packed.names());
        assert_eq!(packed.format(), format!("{}, in gzip", plain.format()));
        for column in (1..=plain.width()).map(|c| c.to_string()) {
            match (plain.column(&column), packed.column(&column)) {
                (Ok(a), Ok(b)) => assert_eq!(a, b),
                (a, b) => assert_eq!(a.unwrap_err().to_string(), b.unwrap_err().to_string()),
            }
        }
    }
}

#[test]
fn members_one_after_the_other_are_one_file() {
    let both = [gzip(b"t,f\n0,1\n"), gzip(b"1,2\n")].concat();
    assert_eq!(Table::parse("a.csv.gz", &both).unwrap().column("f").unwrap(), [1.0, 2.0]);
}

#[test]
fn damaged_gzip_is_refused_wherever_it_is_cut() {
    for bytes in FILES {
        let packed = gzip(bytes);
        for end in 2..packed.len() {
            let e = Table::parse("a.gz", &packed[..end]).unwrap_err();
            assert!(matches!(e, IoError::Gzip { .. }), "cut at {end}: {e}");
        }
        let mut wrong = packed.clone();
        let checksum = wrong.len() - 6;
        wrong[checksum] ^= 1;
        let e = Table::parse("a.gz", &wrong).unwrap_err().to_string();
        assert!(e.starts_with("a.gz is damaged or cut short (gzip: "), "{e}");
    }
}

#[test]
fn a_binary_file_of_no_known_format_is_refused() {
    let e = Table::parse("a.xlsx", b"PK\x03\x04\x14\0\x06\0").unwrap_err();
    assert!(matches!(e, IoError::UnknownFormat { .. }), "{e}");
}

/// Lines are counted in a text that is longer than one block and has comments, empty lines and both
/// kinds of line ends.
#[test]
fn lines_are_counted_through_a_long_file() {
    for end in ["\n", "\r\n"] {
        let mut text = format!("# rig{end}t,f{end}");
        let (mut line, mut lines) = (2, Vec::new());
        for k in 0..20_000 {
            if k % 7 == 3 {
                text += &format!("# pause{end}{end}");
                line += 2;
            }
            text += &format!("{k},{}{end}", k % 10);
            line += 1;
            lines.push(line);
        }
        let table = Table::parse("a.csv", text.as_bytes()).unwrap();
        assert_eq!(table.len(), 20_000);
        for k in [0, 1, 3, 4, 9_999, 19_999] {
            assert_eq!(table.position(k), Place::Line(lines[k]), "sample {k}");
        }
        let bad = text.replace(&format!("{end}17777,7{end}"), &format!("{end}17777,?{end}"));
        let e = Table::parse("a.csv", bad.as_bytes()).unwrap().column("f").unwrap_err();
        assert!(matches!(e, IoError::NotANumber { line, .. } if line == lines[17_777]), "{e}");
        // The other column remains usable.
        let table = Table::parse("a.csv", bad.as_bytes()).unwrap();
        assert!(table.record(&TimeAxis::Column("t"), &[] as &[&str]).is_ok());
    }
}

#[test]
fn names_over_several_lines_and_a_start_without_delimiters() {
    let text = "# long\n\"time\n[s]\",\"force\n[N]\"\n0,1\n1,2\n2,3\n3,4\n";
    let table = Table::parse("a.csv", text.as_bytes()).unwrap();
    assert_eq!(table.names(), ["time\n[s]", "force\n[N]"]);
    assert_eq!(table.position(0), Place::Line(5));
    let comments = "# a comment without any of the usual delimiters\n".repeat(1000);
    let table = Table::parse("a.csv", format!("{comments}0;1\n1;2\n").as_bytes()).unwrap();
    assert_eq!((table.width(), table.position(1)), (2, Place::Line(1002)));
}
