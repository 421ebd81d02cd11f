//! A file that is read repeatedly gives the same results as the table in memory.

use std::fmt::Write as _;
use std::path::PathBuf;

use mechid_io::{IoError, Limits, ReadOptions, RecordFile, Table, TimeAxis};
use nalgebra::DMatrix;
use proptest::prelude::*;

const TIME: TimeAxis<'_> = TimeAxis::Column("t");

/// Options for a text with one line above the table.
const BELOW: ReadOptions = ReadOptions { skip_lines: 1, limits: Limits::DEFAULT };

/// Writes a text into a folder.
fn written(text: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    std::fs::write(&path, text).unwrap();
    (folder, path)
}

fn text(rows: usize) -> String {
    let mut text = String::from("rig 4\nt;f;note;x\ns;N;;m\n");
    for k in 0..rows {
        if k % 37 == 5 {
            text += "# a comment\n\n";
        }
        let value = 1.0 / (k + 1) as f64;
        writeln!(text, "{};{value};n{k};-{value}", 0.25 * k as f64).unwrap();
    }
    text
}

/// Opens a file in both ways: completely in memory, and read in blocks.
fn both(path: &PathBuf) -> [RecordFile; 2] {
    let files = [usize::MAX, 3].map(|held| RecordFile::open(path, &BELOW, held).unwrap());
    assert!(files[0].is_whole() && !files[1].is_whole());
    files
}

type Blocks = Vec<DMatrix<f64>>;

fn blocks(
    file: &RecordFile,
    window: std::ops::Range<usize>,
    rows: usize,
    advance: usize,
) -> Result<Blocks, IoError> {
    let mut all = Vec::new();
    file.blocks(&["x", "f"], window, rows, advance, &mut |block| {
        all.push(block);
        Ok::<_, IoError>(())
    })?;
    Ok(all)
}

#[test]
fn surveys_and_tables_agree() {
    let (_folder, path) = written(&text(9001));
    let table = Table::read_with(&path, &BELOW).unwrap();
    let record = table.record(&TIME, &["f", "x"]).unwrap();
    for file in both(&path) {
        let survey = file.survey(&TIME, &["f", "x"]).unwrap();
        assert_eq!(survey.sampling, record.sampling());
        assert_eq!(survey.peaks, [1.0, 1.0]);
        let mean = record.column(0).mean();
        assert!((survey.means[0] - mean).abs() < 1e-15 && survey.means[1] == -survey.means[0]);
        let rate = file.survey(&TimeAxis::RateHz(8.0), &["f"]).unwrap();
        assert_eq!((rate.sampling.dt(), rate.sampling.len()), (0.125, 9001));
        // One column is given twice, and one column cannot be used.
        let mut taken = vec![Vec::new(); 4];
        let inventory = file.inventory(&[1, 3, 1, 2], Some(0), &mut |at, first, values| {
            assert_eq!(taken[at].len(), first);
            taken[at].extend_from_slice(values);
        });
        let inventory = inventory.unwrap();
        assert_eq!(inventory.samples, 9001);
        assert_eq!(inventory.sampling.unwrap().unwrap(), record.sampling());
        for (&(at, column), mean) in [(0, 1), (1, 3), (2, 1), (3, 2)].iter().zip([0, 1, 0, 0]) {
            match (&inventory.columns[at], table.values(column)) {
                (Ok(tally), Ok(values)) => {
                    assert_eq!(tally.samples, 9001);
                    assert!((tally.mean - survey.means[mean]).abs() < 1e-15);
                    assert_eq!(values.len(), 9001);
                    assert_eq!(taken[at], values);
                }
                (Err(told), Err(why)) => assert_eq!(told.to_string(), why.to_string()),
                (told, why) => panic!("column {column}: {told:?}, held {why:?}"),
            }
        }
        assert_eq!(file.head().names(), table.names());
        assert_eq!(file.head().about(3), "m");
    }
}

#[test]
fn what_is_wrong_is_said_in_the_same_words() {
    // The text has more rows than are read at a time.
    let good = text(9001);
    let replaced = |from: &str, to: &str| {
        assert!(good.contains(from), "{from}");
        good.replacen(from, to, 1)
    };
    let late = [
        replaced(";n8000;", ";n8000;oops"),
        replaced(";n8000;-", ";n8000;-inf;-"),
        replaced("\n2000;", "\n2000.1;"),
        replaced(";n8000", ""),
        replaced(";n8500;-", ";n8500;x").replacen(";n8000;", ";n8000;;", 1),
    ];
    for text in late {
        let (_folder, path) = written(&text);
        let said = Table::read_with(&path, &BELOW)
            .and_then(|table| table.record(&TIME, &["f", "x"]).map(|_| ()))
            .unwrap_err()
            .to_string();
        let file = RecordFile::open(&path, &BELOW, 3).unwrap();
        let e = file.survey(&TIME, &["f", "x"]).unwrap_err().to_string();
        assert_eq!(e, said);
        assert!(e.contains("line "), "{e}");
    }
    let (_folder, path) = written(&good);
    for file in both(&path) {
        let words = |time: &TimeAxis<'_>, columns: &[&str]| {
            file.survey(time, columns).unwrap_err().to_string()
        };
        assert!(words(&TIME, &["f", "f"]).contains("is used twice"));
        assert!(words(&TIME, &["t"]).contains("is used twice"));
        assert!(words(&TIME, &["y"]).contains("has no column"));
        assert!(words(&TIME, &["note"]).contains("is not a number"));
        assert!(words(&TimeAxis::RateHz(-1.0), &["f"]).contains("got -1"));
        assert!(words(&TimeAxis::OfFile, &["f"]).contains("does not say when"));
        assert!(matches!(blocks(&file, 0..9002, 100, 100), Err(IoError::Read { .. })));
    }
}

#[test]
fn a_block_begins_where_it_is_told_to() {
    let (_folder, path) = written(&text(20));
    for file in both(&path) {
        let first = |all: Blocks| -> Vec<(f64, usize)> {
            all.iter().map(|block| ((1.0 / block[(0, 1)]).round(), block.nrows())).collect()
        };
        let at = |window, rows, advance| first(blocks(&file, window, rows, advance).unwrap());
        assert_eq!(at(0..20, 8, 8), [(1.0, 8), (9.0, 8), (17.0, 4)]);
        assert_eq!(at(4..12, 4, 4), [(5.0, 4), (9.0, 4)]);
        assert_eq!(at(0..20, 50, 50), [(1.0, 20)]);
        // A further block is given only if it has a row that no earlier block had.
        assert_eq!(at(0..9, 5, 4), [(1.0, 5), (5.0, 5)]);
        assert_eq!(at(0..10, 5, 4), [(1.0, 5), (5.0, 5), (9.0, 2)]);
    }
}

#[test]
fn a_file_that_is_gone_is_missed() {
    let (folder, path) = written(&text(20));
    let [whole, part] = both(&path);
    drop(folder);
    assert!(blocks(&whole, 0..20, 8, 8).is_ok());
    assert!(matches!(blocks(&part, 0..20, 8, 8), Err(IoError::Read { .. })));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn blocks_are_the_same_from_memory_and_from_the_file(
        start in 0_usize..200, len in 1_usize..9000, rows in 1_usize..6000, share in 0.0..1.0,
    ) {
        let (_folder, path) = written(&text(9201));
        let advance = 1 + (share * (rows - 1) as f64) as usize;
        // Long blocks with a short advance would take much time, and they would not test anything
        // else.
        prop_assume!(len / advance < 500);
        let [whole, part] = both(&path);
        let window = start..start + len;
        let expected = blocks(&whole, window.clone(), rows, advance).unwrap();
        prop_assert_eq!(&blocks(&part, window.clone(), rows, advance).unwrap(), &expected);
        // If the blocks do not overlap, every sample is in exactly one block.
        if advance == rows {
            prop_assert_eq!(expected.iter().map(DMatrix::nrows).sum::<usize>(), len);
        }
    }
}
