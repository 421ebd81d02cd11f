//! Parquet files of four programs, and tables of results.

use std::fs;

use mechid_io::{
    IoError, Limit, Limits, ParquetColumn, ParquetFile, ParquetValues, Quantity, ReadOptions,
    RecordRows, Table, TimeAxis, parquet_bytes, read_parquet_metadata, write_parquet,
};
use mechid_model::ResponseQuantity;

const SAMPLES: usize = 300;

fn bytes(program: &str) -> Vec<u8> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data");
    fs::read(format!("{folder}/{program}.parquet")).unwrap()
}

fn table(program: &str) -> Table {
    Table::parse(program, &bytes(program)).unwrap()
}

/// Returns the columns that `make_parquet.py` writes, exact to the last bit.
fn written(name: &str) -> Vec<f64> {
    let value = |k: i64| match name {
        "time" => k as f64 / 128.0,
        "force" => ((k * k) % 7 - 3) as f64 * 0.1,
        "x" => f64::from((k as f64 * 0.3) as f32),
        "count" => (k * 7 - 900) as f64,
        "unsigned" => (k + 4_294_966_000) as f64,
        "stamp" => k as f64 * 7_812_500.0 / 1e9,
        _ => unreachable!("{name}"),
    };
    (0..SAMPLES as i64).map(value).collect()
}

#[test]
fn files_of_four_programs_hold_the_same_numbers() {
    for program in ["pyarrow", "pandas", "polars", "duckdb"] {
        let table = table(program);
        assert_eq!(table.format(), "Parquet");
        assert_eq!(table.len(), SAMPLES);
        for name in ["time", "force", "x", "count"] {
            assert_eq!(table.column(name).unwrap(), written(name), "{program}: {name}");
        }
        let record = table.record(&TimeAxis::Column("time"), &["force", "x"]).unwrap();
        assert_eq!(record.sampling().dt(), 1.0 / 128.0, "{program}");
    }
}

#[test]
fn keys_of_the_file_state_units_and_rate() {
    for program in ["pyarrow", "pandas"] {
        let table = table(program);
        let unit = |name| table.to_si(table.find(name).unwrap(), Quantity::Force);
        assert_eq!(unit("force").unwrap(), 1e-3, "{program}");
        let x = table.find("x").unwrap();
        let displacement = ResponseQuantity::Displacement.into();
        assert_eq!(table.to_si(x, displacement).unwrap(), 1e-3, "{program}");
    }
    let table = table("pyarrow");
    assert!(table.scalars().contains(&("sample_rate_hz".into(), 128.0)));
    let sampling = table.sampling(&TimeAxis::OfFile, &["force"]).unwrap();
    assert_eq!(sampling.dt(), 1.0 / 128.0);
}

#[test]
fn columns_of_other_kinds_are_refused_where_they_are_used() {
    let table = table("pyarrow");
    assert_eq!(table.column("unsigned").unwrap(), written("unsigned"));
    assert_eq!(table.column("stamp").unwrap(), written("stamp"));
    let refused = |name: &str| table.column(name).unwrap_err().to_string();
    assert!(refused("note").contains("it holds text"), "{}", refused("note"));
    assert!(refused("list").contains("it holds lists"), "{}", refused("list"));
    assert!(refused("holed").contains("sample 5"), "{}", refused("holed"));
}

#[test]
fn damage_is_an_error_and_no_panic() {
    let whole = bytes("pyarrow");
    let cut = Table::parse("a", &whole[..whole.len() / 2]).unwrap_err();
    assert!(matches!(cut, IoError::Parquet { .. }), "{cut}");
    assert!(matches!(Table::parse("a", &whole[..6]), Err(IoError::Parquet { .. })));
    for at in (0..whole.len()).step_by(97) {
        let mut damaged = whole.clone();
        damaged[at] ^= 0x55;
        // The file is read or refused: a flipped bit of a number cannot be detected.
        let _ = Table::parse("a", &damaged);
    }
    // In a text file, PAR1 is the name of a column, not the mark of a Parquet file.
    assert_eq!(Table::parse("a.csv", b"PAR1,PAR2\n1,2\n").unwrap().names(), ["PAR1", "PAR2"]);
    let skipped = ReadOptions { skip_lines: 1, ..ReadOptions::default() };
    let error = Table::parse_with("a", &whole, &skipped).unwrap_err();
    assert!(matches!(error, IoError::NothingToSkip { .. }), "{error}");
}

#[test]
fn columns_and_numbers_have_limits() {
    let refused = |limits: Limits| {
        let options = ReadOptions { skip_lines: 0, limits };
        match Table::parse_with("a", &bytes("pyarrow"), &options) {
            Err(IoError::TooLarge { limit, .. }) => limit,
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(refused(Limits { columns: 3, ..Limits::DEFAULT }), Limit::Columns(3));
    assert_eq!(refused(Limits { numbers: 1000, ..Limits::DEFAULT }), Limit::Numbers(1000));
}

#[test]
fn a_table_of_results_is_read_back() {
    let path = std::env::temp_dir().join(format!("mechid-io-{}.parquet", std::process::id()));
    let column = |name, values| ParquetColumn { name, values };
    let columns = [
        column("record", ParquetValues::Text(vec![Some("a".into()), None])),
        column("rows", ParquetValues::Count(vec![None, Some(-7)])),
        column("value", ParquetValues::Number(vec![Some(0.1), Some(2.5)])),
        column("names", ParquetValues::Texts(vec![vec![], vec!["m".into(), "c".into()]])),
        column("errors", ParquetValues::Numbers(vec![vec![Some(1.0), None], vec![]])),
    ];
    write_parquet(&path, &columns, &[("mechid", "{}".into())]).unwrap();
    assert!(read_parquet_metadata(&path).unwrap().contains(&("mechid".into(), "{}".into())));
    let table = Table::read(&path).unwrap();
    assert_eq!(table.column("value").unwrap(), [0.1, 2.5]);
    assert!(table.column("rows").unwrap_err().to_string().contains("sample 1"));
    let unequal = [
        column("a", ParquetValues::Number(vec![Some(1.0)])),
        column("b", ParquetValues::Number(vec![])),
    ];
    let error = write_parquet(&path, &unequal, &[]).unwrap_err();
    assert!(matches!(error, IoError::Parquet { .. }), "{error}");
    fs::remove_file(path).unwrap();
}

fn many() -> ParquetFile {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/many.parquet");
    ParquetFile::open(path, &Limits::default()).unwrap()
}

#[test]
fn a_column_tells_the_records_of_a_file_apart() {
    let rows = |ids: [&str; 3]| {
        let spans = ids.into_iter().zip([0..100, 100..220, 220..300]);
        spans.map(|(id, rows)| RecordRows { id: id.into(), rows }).collect::<Vec<_>>()
    };
    assert_eq!(many().records("machine").unwrap(), rows(["pump 1", "pump 2", "fan"]));
    assert_eq!(many().records("day").unwrap(), rows(["7", "8", "9"]));
    let error = many().records("again").unwrap_err();
    assert!(matches!(&error, IoError::RecordApart { id, row: 221, .. } if id == "1"), "{error}");
    let error = many().records("named").unwrap_err();
    assert!(matches!(error, IoError::RecordColumn { row: 6, what: "nothing", .. }), "{error}");
    let error = many().records("x").unwrap_err();
    assert!(matches!(error, IoError::RecordColumn { row: 1, .. }), "{error}");
    assert!(matches!(many().records("lost").unwrap_err(), IoError::MissingColumn { .. }));
}

#[test]
fn records_of_a_file_are_read_together_and_alone_alike() {
    let (file, path) = (many(), "many.parquet");
    let records = file.records("machine").unwrap();
    let wanted = ["stamp", "force"].map(|name| file.head().find(name).unwrap());
    let together = file.tables(Some(&wanted), &records).unwrap();
    for (record, table) in records.iter().zip(&together) {
        let alone = file.tables(None, std::slice::from_ref(record)).unwrap().swap_remove(0);
        let rows = record.rows.clone();
        assert_eq!(alone.column("x").unwrap(), &written("x")[rows.clone()]);
        // Instants are relative to the first instant of the record, for any set of records that are
        // read together.
        let first = written("stamp")[rows.start];
        for (read, stamp) in
            table.column("stamp").unwrap().iter().zip(&written("stamp")[rows.clone()])
        {
            assert!((read - (stamp - first)).abs() < 1e-12, "{read}");
        }
        assert_eq!(table.column("stamp").unwrap(), alone.column("stamp").unwrap());
        // A value that is not finite affects only its own record.
        match (record.id.as_str(), table.column("force")) {
            ("pump 2", force) => {
                let error = force.unwrap_err().to_string();
                assert!(error.contains("many.parquet (record pump 2)"), "{error}");
                assert!(error.contains("sample 51"), "{error}");
            }
            (_, force) => assert_eq!(force.unwrap(), &written("force")[rows]),
        }
        assert!(matches!(table.column("x").unwrap_err(), IoError::NoNumbers { .. }), "{path}");
    }
}

#[test]
fn damage_of_a_file_of_many_records_is_an_error_and_no_panic() {
    let whole = bytes("many");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("damaged.parquet");
    let mut refused = 0;
    for at in (0..whole.len()).step_by(61) {
        let mut damaged = whole.clone();
        damaged[at] ^= 0x55;
        fs::write(&path, &damaged).unwrap();
        // The file is read or refused: a flipped bit of a number cannot be detected.
        let read = ParquetFile::open(&path, &Limits::default()).and_then(|file| {
            let records = file.records("machine")?;
            file.tables(None, &records).map(drop)
        });
        refused += usize::from(read.is_err());
    }
    assert!(refused > 0);
}

/// Returns a file that ends with a footer in the compact form of Thrift.
fn with_footer(footer: &[u8]) -> Vec<u8> {
    let len = (footer.len() as u32).to_le_bytes();
    [b"PAR1\x15\x00", footer, &len, b"PAR1"].concat()
}

/// The decoder allocates the memory that the schema claims, and recurses as deep as the schema is
/// nested. A false claim and deep nesting are therefore refused before decoding.
#[test]
fn a_schema_that_claims_more_than_it_has_is_refused() {
    let element = |children: &[u8]| [&[0x48, 0x01, b'r', 0x15], children, &[0x00]].concat();
    let forged = |elements: &[Vec<u8>], count: &[u8]| {
        let head = [&[0x15, 0x02, 0x19, 0xfc], count].concat();
        let tail = [0x16, 0x00, 0x19, 0x0c, 0x00];
        with_footer(&[head, elements.concat(), tail.to_vec()].concat())
    };
    let refused = |file: &[u8]| match Table::parse("a", file) {
        Err(IoError::Parquet { what, .. }) => what,
        other => panic!("{other:?}"),
    };
    // The root claims 2³¹ − 1 children, for which the decoder would allocate 17 GB.
    let root = forged(&[element(&[0xfe, 0xff, 0xff, 0xff, 0x0f])], &[0x01]);
    assert_eq!(refused(&root), "the footer contradicts the length of the file");
    // A hundred thousand nested groups would exhaust the stack of a recursive decoder.
    let nested = forged(&vec![element(&[0x02]); 100_000], &[0xa0, 0x8d, 0x06]);
    assert_eq!(refused(&nested), "the footer contradicts the length of the file");
}

/// Constant columns take hardly any space in a file. A small file with a very long constant column
/// is refused, because the numbers need more memory than the limit for files of this size.
#[test]
fn memory_has_a_limit_by_the_size_of_the_file() {
    use parquet::data_type::DoubleType;
    use parquet::file::properties::WriterProperties;
    use parquet::file::writer::SerializedFileWriter;
    use parquet::schema::parser::parse_message_type;

    let schema = parse_message_type("message m { required double x; }").unwrap();
    let mut file = Vec::new();
    let properties = WriterProperties::builder().set_dictionary_enabled(true).build();
    let mut writer =
        SerializedFileWriter::new(&mut file, schema.into(), properties.into()).unwrap();
    let zeros = vec![0.0; 1 << 20];
    let mut group = writer.next_row_group().unwrap();
    let mut column = group.next_column().unwrap().unwrap();
    for _ in 0..40 {
        column.typed::<DoubleType>().write_batch(&zeros, None, None).unwrap();
    }
    column.close().unwrap();
    group.close().unwrap();
    writer.close().unwrap();
    assert!(file.len() < 200_000, "{} bytes", file.len());
    match Table::parse("a", &file) {
        Err(IoError::TooLarge { limit: Limit::Memory(bytes), .. }) => {
            assert_eq!(bytes, Limits::DEFAULT.memory(file.len()));
        }
        other => panic!("{other:?}"),
    }
}

/// A list of records that needs more memory than the limit is refused. A small file can name
/// millions of records, because equal differences between consecutive identifiers take hardly any
/// space; an earlier version needed 5 GB for the list.
#[test]
fn the_list_of_the_records_has_a_limit() {
    use parquet::basic::Encoding;
    use parquet::data_type::Int64Type;
    use parquet::file::properties::WriterProperties;
    use parquet::file::writer::SerializedFileWriter;
    use parquet::schema::parser::parse_message_type;

    let schema = parse_message_type("message m { required int64 id; }").unwrap();
    let properties = WriterProperties::builder()
        .set_dictionary_enabled(false)
        .set_encoding(Encoding::DELTA_BINARY_PACKED)
        .build();
    let mut file = Vec::new();
    let mut writer =
        SerializedFileWriter::new(&mut file, schema.into(), properties.into()).unwrap();
    let mut group = writer.next_row_group().unwrap();
    let mut column = group.next_column().unwrap().unwrap();
    for part in 0..4 {
        let ids: Vec<i64> = (0..1 << 19).map(|id| id + (part << 19)).collect();
        column.typed::<Int64Type>().write_batch(&ids, None, None).unwrap();
    }
    column.close().unwrap();
    group.close().unwrap();
    writer.close().unwrap();
    assert!(file.len() < 100_000, "{} bytes", file.len());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ids.parquet");
    std::fs::write(&path, &file).unwrap();
    let opened = ParquetFile::open(&path, &Limits::DEFAULT).unwrap();
    match opened.records("id") {
        Err(IoError::TooLarge { limit: Limit::Memory(bytes), .. }) => {
            assert_eq!(bytes, Limits::DEFAULT.memory(file.len()));
        }
        other => panic!("{:?}", other.map(|records| records.len())),
    }
}

/// An identifier that is longer than the limit is refused. An earlier version repeated such an
/// identifier in the rows and messages of a fleet, and needed 1.9 GB for a file of 2 MB.
#[test]
fn the_identifier_of_a_record_has_a_limit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ids.parquet");
    let most = Limits::DEFAULT.name_bytes;
    let records = |bytes: usize, limits: &Limits| {
        let ids = [Some("a".to_owned()), Some("x".repeat(bytes))];
        let id = ParquetColumn { name: "id", values: ParquetValues::Text(ids.to_vec()) };
        std::fs::write(&path, parquet_bytes(&[id]).unwrap()).unwrap();
        ParquetFile::open(&path, limits).unwrap().records("id")
    };
    assert_eq!(records(most, &Limits::DEFAULT).unwrap()[1].id.len(), most);
    match records(most + 1, &Limits::DEFAULT) {
        Err(IoError::TooLarge { limit: Limit::NameBytes(bytes), .. }) => assert_eq!(bytes, most),
        other => panic!("{:?}", other.map(|records| records.len())),
    }
    // The limit can be raised.
    assert_eq!(records(most + 1, &Limits::DEFAULT.times(2)).unwrap().len(), 2);
}

/// The time to read a file must not grow with the square of the number of columns. In an earlier
/// version it did, and sixty thousand columns took 18 s.
#[test]
fn many_columns_are_read_in_a_time_that_grows_with_their_number() {
    let read = |count: usize| {
        let columns: Vec<ParquetColumn> = (0..count)
            .map(|_| ParquetColumn {
                name: "c",
                values: ParquetValues::Number(vec![Some(1.0), Some(2.0)]),
            })
            .collect();
        let file = parquet_bytes(&columns).unwrap();
        let begun = std::time::Instant::now();
        assert_eq!(Table::parse("a", &file).unwrap().width(), count);
        begun.elapsed().as_secs_f64()
    };
    let (few, many) = (read(2_000), read(40_000));
    // Twenty times as many columns: quadratic growth would give a factor of four hundred.
    assert!(many < 100.0 * few.max(1e-3), "{few} s, {many} s");
}
