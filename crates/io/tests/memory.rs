//! The memory that the estimators need does not grow with the length of a text file.
//!
//! The counter of allocated bytes covers the whole program. Therefore this file has only one test.

use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::Path;

use mechid_estimate::{EquationOfMotion, EstimateError};
use mechid_io::{IoError, ReadOptions, RecordFile, TimeAxis};
use mechid_model::ResponseQuantity;
use mechid_signal::Record;
use mechid_spectra::frf::{FrfAverage, Segments};
use mechid_spectra::{Lines, RepeatedPeriods, SpectraError};
use peak_alloc::PeakAlloc;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Number of samples in a period.
const PERIOD: usize = 500;
/// Number of periods in a section.
const AT_ONCE: usize = 4;

/// Number of rows at the beginning that stay in memory.
const HELD: usize = 2000;

/// Number of bytes that a block of text and its numbers occupy.
const BLOCK: usize = 130_000;

const COLUMNS: [&str; 4] = ["f", "x", "v", "a"];

#[derive(Debug)]
#[allow(dead_code, reason = "shown if the test fails")]
enum Failure {
    Io(IoError),
    Estimate(EstimateError),
    Spectra(SpectraError),
}

impl From<IoError> for Failure {
    fn from(error: IoError) -> Self {
        Failure::Io(error)
    }
}

impl From<EstimateError> for Failure {
    fn from(error: EstimateError) -> Self {
        Failure::Estimate(error)
    }
}

impl From<SpectraError> for Failure {
    fn from(error: SpectraError) -> Self {
        Failure::Spectra(error)
    }
}

/// Writes four columns and the time, with an empty line and a comment from time to time.
fn write(path: &Path, rows: usize) {
    let mut file = BufWriter::new(File::create(path).unwrap());
    writeln!(file, "time,{},unused", COLUMNS.join(",")).unwrap();
    for k in 0..rows {
        if k % 700 == 0 {
            writeln!(file, "\n# block {k}").unwrap();
        }
        let turn = std::f64::consts::TAU * (k % PERIOD) as f64 / PERIOD as f64;
        let (f, x) = (turn.cos() + (7.0 * turn).sin(), (turn - 0.1).cos());
        writeln!(file, "{},{f},{x},{},{},word", k as f64 / 100.0, -turn.sin(), 0.5 * x).unwrap();
    }
}

/// Returns the maximum number of bytes that a pass over a record allocates.
fn peak(path: &Path, rows: usize) -> usize {
    MEMORY.reset_peak_usage();
    let before = MEMORY.current_usage();
    let file = RecordFile::open(path, &ReadOptions::default(), HELD).unwrap();
    assert!(!file.is_whole());
    let survey = file.survey(&TimeAxis::Column("time"), &COLUMNS).unwrap();
    assert_eq!(survey.sampling.len(), rows);
    let inventory = file.inventory(&[1, 2, 3, 4], Some(0), &mut |_, _, _| {}).unwrap();
    assert_eq!(inventory.samples, rows);
    let stretch = survey.sampling.with_len(PERIOD).unwrap();
    let lines = Lines::new(stretch, 1..=20).unwrap();
    let motion = ResponseQuantity::Displacement;
    let mut periods = RepeatedPeriods::expecting(&lines, 1, motion, rows / PERIOD);
    let mut average = FrfAverage::new(lines, [1, 1], motion, Segments::Periods(PERIOD)).unwrap();
    let mut equations = EquationOfMotion::new(1);
    let samples = AT_ONCE * PERIOD;
    file.blocks(&COLUMNS, 0..rows, samples, samples, &mut |block| -> Result<(), Failure> {
        let [f, x, v, a] = [0, 1, 2, 3].map(|c| block.columns(c, 1));
        equations.push_rows(a, v, x, f)?;
        let sampling = survey.sampling.with_len(block.nrows()).unwrap();
        let record = |c: usize| Record::new(sampling, block.columns(c, 1).into_owned()).unwrap();
        periods.push(&record(0), &record(1))?;
        Ok(average.push(&record(0), &record(1))?)
    })
    .unwrap();
    assert_eq!((periods.count(), equations.rows()), (rows / PERIOD, rows));
    MEMORY.peak_usage() - before
}

#[test]
fn memory_does_not_grow_with_the_record() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    let [short, long] = [10_000, 200_000].map(|rows| {
        write(&path, rows);
        peak(&path, rows)
    });
    // Five columns of the long record are 8 MB.
    assert!(long < 2_000_000, "{long} bytes");
    // The long record has twenty times as many rows as the short one. It may need slightly more
    // memory only because its printed instants have more digits, and because the threads may read
    // and parse more blocks at the same time.
    assert!(
        long < short + short / 20 + 2 * BLOCK,
        "{short} bytes for the short record, {long} for the long one"
    );
}
