//! Small files that claim much memory are refused before the memory is allocated.

use std::io::Write as _;

use flate2::Compression;
use flate2::write::{GzEncoder, ZlibEncoder};
use mechid_io::{IoError, Limit, Limits, Place, ReadOptions, RecordFile, Table, TimeAxis, escaped};

const LIMITS: Limits = Limits {
    row_bytes: 1 << 16,
    columns: 100,
    unpacked_bytes: 1 << 20,
    numbers: 1 << 16,
    ..Limits::DEFAULT
};

const OPTIONS: ReadOptions = ReadOptions { skip_lines: 0, limits: LIMITS };

fn limit(bytes: &[u8]) -> (Limit, Place) {
    match Table::parse_with("a", bytes, &OPTIONS) {
        Err(IoError::TooLarge { limit, at, .. }) => (limit, at),
        other => panic!("{other:?}"),
    }
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

/// Returns a MATLAB file with one compressed variable.
fn compressed(variable: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(variable).unwrap();
    let packed = encoder.finish().unwrap();
    let mut file = b"MATLAB 5.0 MAT-file".to_vec();
    file.resize(124, b' ');
    file.extend(b"\x00\x01IM");
    file.extend([15_u32, packed.len() as u32].map(u32::to_le_bytes).concat());
    file.extend(packed);
    file
}

/// Returns a MATLAB variable that is a vector of `len` bytes.
fn bytes_variable(len: u32) -> Vec<u8> {
    let words = [14, 56 + len.next_multiple_of(8), 6, 8, 9, 0, 5, 8, len, 1, 1, 1];
    let mut variable = words.map(u32::to_le_bytes).concat();
    variable.extend(b"v\0\0\0\0\0\0\0");
    variable.extend([2, len].map(u32::to_le_bytes).concat());
    variable.resize(variable.len() + len.next_multiple_of(8) as usize, 0);
    variable
}

#[test]
fn rows_have_a_limit() {
    let row = Limit::RowBytes(LIMITS.row_bytes);
    let long = "1".repeat(1 << 21);
    assert_eq!(limit(long.as_bytes()), (row, Place::Line(1)));
    assert_eq!(limit(&gzip(long.as_bytes())), (row, Place::Line(1)));
    assert_eq!(limit(format!("t,f\n0,1\n1,{long}\n").as_bytes()), (row, Place::Line(3)));
    // A row that is only a few bytes longer than the limit is refused, too.
    let some = "1".repeat(LIMITS.row_bytes);
    assert_eq!(limit(format!("t,f\n0,1\n1,{some}\n").as_bytes()), (row, Place::Line(3)));
    assert_eq!(limit(format!("{some},1\n").as_bytes()), (row, Place::Line(1)));
    let unclosed = format!("t,f\n0,1\n1,\"{}", "2,3\n".repeat(1 << 19));
    assert_eq!(limit(unclosed.as_bytes()), (row, Place::Line(3)));
    let e = Table::parse_with("a", unclosed.as_bytes(), &OPTIONS).unwrap_err().to_string();
    assert_eq!(
        e,
        "a, line 3: the row is longer than 65536 bytes (is a quote not closed?); if the record is \
         correct, raise the limit"
    );
    // A row of the maximum length.
    let padded = format!("t,f\n0,{}1\n", " ".repeat(LIMITS.row_bytes - 3));
    assert_eq!(Table::parse_with("a", padded.as_bytes(), &OPTIONS).unwrap().len(), 1);
}

#[test]
fn columns_have_a_limit() {
    let columns = Limit::Columns(LIMITS.columns);
    assert_eq!(limit(format!("0{}\n", ",1".repeat(100)).as_bytes()), (columns, Place::Line(1)));
    assert!(Table::parse_with("a", format!("0{}\n", ",1".repeat(99)).as_bytes(), &OPTIONS).is_ok());
    let many = compressed(&bytes_variable(8))[128..].repeat(101);
    let file = [&compressed(&bytes_variable(8))[..128], &many].concat();
    assert_eq!(limit(&file).0, columns);
    // Each empty variable in a struct takes a few bytes.
    let names = 1_000_u32;
    let mut data = [6, 8, 2, 0, 5, 8, 1, 1, 1, 1].map(u32::to_le_bytes).concat();
    data.extend(b"s\0\0\0\0\0\0\0");
    data.extend([5 | 4 << 16, 1, 1, names].map(u32::to_le_bytes).concat());
    data.resize(data.len() + names as usize, b'x');
    data.extend([14_u32, 0].map(u32::to_le_bytes).concat().repeat(names as usize));
    let variable = [[14, data.len() as u32].map(u32::to_le_bytes).concat(), data].concat();
    assert_eq!(limit(&compressed(&variable)).0, columns);
}

#[test]
fn what_is_packed_has_a_limit() {
    let unpacked = Limit::UnpackedBytes(LIMITS.unpacked_bytes);
    let file = compressed(&bytes_variable(1 << 22));
    assert!(file.len() < 10_000);
    assert_eq!(limit(&file), (unpacked, Place::Byte(137)));
    let whole = [&file[..128], &vec![0; 1 << 21]].concat();
    assert_eq!(limit(&gzip(&whole)), (unpacked, Place::Byte(LIMITS.unpacked_bytes)));
    let universal = [&b"    -1\n    15\n"[..], &vec![b'\n'; 1 << 21]].concat();
    assert_eq!(limit(&gzip(&universal)).0, unpacked);
    // The limit holds for the sum of two variables.
    let twice = compressed(&file[128..]);
    let e = Table::parse_with("a", &twice, &OPTIONS).unwrap_err().to_string();
    assert!(e.contains("the compressed data are not a variable"), "{e}");
}

#[test]
fn numbers_held_have_a_limit() {
    let numbers = Limit::Numbers(LIMITS.numbers);
    assert_eq!(limit(&compressed(&bytes_variable(1 << 17))).0, numbers);
    assert!(Table::parse_with("a", &compressed(&bytes_variable(1 << 16)), &OPTIONS).is_ok());
    let text = format!("t,f\n{}", "0,1\n".repeat(1 << 18));
    assert_eq!(limit(&gzip(text.as_bytes())).0, numbers);
    // A text that is not kept in memory may have more rows than the limit on numbers allows.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv.gz");
    std::fs::write(&path, gzip(text.as_bytes())).unwrap();
    let file = RecordFile::open(&path, &OPTIONS, 1000).unwrap();
    let survey = file.survey(&TimeAxis::RateHz(1.0), &["f"]).unwrap();
    assert_eq!(survey.sampling.len(), 1 << 18);
}

/// The memory limit follows from the size of the file: a small file that claims much memory is
/// refused, even if the limits on numbers and on unpacked bytes allow its contents.
#[test]
fn memory_has_a_limit_by_the_size_of_the_file() {
    let memory = |bytes: &[u8]| match Table::parse("a", bytes) {
        Err(IoError::TooLarge { limit: limit @ Limit::Memory(_), .. }) => limit,
        other => panic!("{other:?}"),
    };
    // 30 million bytes in zlib: 240 MB as numbers, and the same amount while they are read.
    let file = compressed(&bytes_variable(30_000_000));
    assert!(file.len() < 40_000, "{}", file.len());
    let allowed = Limits::DEFAULT.memory(file.len());
    assert!(allowed < 400 << 20);
    assert_eq!(memory(&file), Limit::Memory(allowed));
    let e = Table::parse("a", &file).unwrap_err().to_string();
    assert!(e.contains("MiB of memory, which is the limit for a file of this size"), "{e}");
    // The whole file is packed with gzip: the size of the gzip file sets the limit.
    let whole = [&file[..128], &bytes_variable(160_000_000)].concat();
    assert!(matches!(memory(&gzip(&whole)), Limit::Memory(_)));
    // The limit can be raised.
    let limits = Limits::DEFAULT.with_memory(1_000_000_000);
    let options = ReadOptions { skip_lines: 0, limits };
    let table = Table::parse_with("a", &file, &options).unwrap();
    assert_eq!(table.len(), 30_000_000);
}

#[test]
fn names_have_a_limit() {
    let name = "x".repeat(Limits::DEFAULT.name_bytes + 1);
    let refused = |bytes: &[u8]| match Table::parse("a", bytes) {
        Err(IoError::TooLarge { at, limit: Limit::NameBytes(4096), .. }) => at,
        other => panic!("{other:?}"),
    };
    assert_eq!(refused(format!("t,{name}\n0,1\n1,2\n").as_bytes()), Place::Column(2));
    assert_eq!(refused(format!("t,f\ns,{name}\n0,1\n1,2\n").as_bytes()), Place::Column(2));
    assert!(Table::parse("a", format!("t,{}\n0,1\n", &name[1..]).as_bytes()).is_ok());
}

#[test]
fn more_lines_are_skipped_than_there_are() {
    let options = ReadOptions { skip_lines: 1_000_000_000_000, ..OPTIONS };
    let e = Table::parse_with("a", b"t,f\n0,1\n", &options).unwrap_err();
    assert_eq!(e.to_string(), "a holds no data: all lines of the file are skipped");
}

/// Messages repeat the text of a file on one line, with control characters as escapes and all other
/// characters unchanged.
#[test]
fn messages_hold_nothing_that_a_terminal_obeys() {
    let name = "x\u{1b}[31m\u{202e}\u{7}";
    let rows = "2,3,4\n".repeat(8);
    let text = format!("\"{name}\n\",{name}b,c\n0,{name},1\n1,2,\u{9b}\n{rows}");
    let table = Table::parse(format!("{name}.csv"), text.as_bytes()).unwrap();
    let errors = [
        table.column(&format!("{name}?")).map(drop),
        table.column(&format!("{name}b")).map(drop),
        table.column("c").map(drop),
        table.record(&TimeAxis::RateHz(1.0), &["1", name]).map(drop),
        Table::parse(name, b"").map(drop),
        mechid_io::Experiment::parse(name, &format!("{{\"{name}\": 3}}")).map(drop),
        name.parse::<mechid_io::LineSpec>().map(drop),
    ];
    for e in errors.map(|e| e.unwrap_err().to_string()) {
        assert_eq!(escaped(&e), e);
        assert!(e.contains(r"x\u{1b}[31m\u{202e}\u{7}") || e.contains(r"\u{9b}"), "{e}");
    }
    for shown in [table.available(), table.label(1), table.file().to_owned(), table.format()] {
        assert_eq!(escaped(&shown), shown);
    }
}
