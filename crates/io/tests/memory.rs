//! A text of any length goes through the estimators in the same memory.
//!
//! The counter is that of the whole program: this file has one test.

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

/// Samples in a period, and periods in a stretch.
const PERIOD: usize = 500;
const AT_ONCE: usize = 4;

/// Rows held of the beginning.
const HELD: usize = 2000;

/// Bytes of a block of text with its numbers.
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

/// Four columns and the time, with an empty line and a comment every so often.
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

/// Bytes that a pass over a record takes at most, beyond what was there before.
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
    // Twenty times the rows: what may grow is the width of numbers, and how many of the blocks that threads read
    // and parse at a time meet at the peak.
    assert!(
        long < short + short / 20 + 2 * BLOCK,
        "{short} bytes for the short record, {long} for the long one"
    );
}
