//! The readers of `mechid-io`.

use std::fs;
use std::path::Path;

use mechid_io::{
    Experiment, IoError, Limits, LineSpec, ParquetFile, Quantity, ReadOptions, RecordFile, Table,
    TimeAxis, escaped, parse_matrix_market, read_covariance, read_system,
};
use mechid_signal::Sampling;

use crate::depth::{Depth, reached};
use crate::{Input, Target};

/// Words of delimited text.
const TEXT: &[&str] = &[
    "time",
    "t [ms]",
    "F [kN]",
    "x (µm)",
    "a / g",
    "\u{feff}",
    "\r\n",
    "\n\n",
    "# comment\n",
    "\"",
    "\"\"",
    "\",\n\"",
    "1,000",
    "999.5",
    "NaN",
    ";;;;",
    ",,,,",
    "\u{202e}",
    "\u{1b}[2J",
    "−",
    "LabVIEW Measurement\n",
    "***End_of_Header***\n",
    "X_Value",
    "Delta_X\t",
    "X_Columns\tMulti\n",
    "Y_Unit_Label\tN\tg\n",
    "2023-03-14T09:26:53.5",
    "09:26:53.5",
    "[mV; 11.2 mV/N]",
    "((((",
];

/// Words of MATLAB and universal files.
const BINARY: &[&str] = &[
    "MATLAB 5.0 MAT-file",
    "IM",
    "MI",
    "\x0e\0\0\0",
    "\x0f\0\0\0",
    "\x09\0\0\0",
    "    -1\n",
    "    58\n",
    "    58b",
    "   164\n",
    "  1.00000e+00",
    "  1.0D+00",
    "         1",
    "NONE",
];

const JSON: &[&str] = &[
    "{",
    "}",
    "[",
    "]",
    ":",
    ",",
    "null",
    "true",
    "\"\"",
    "1e999",
    "-1",
    "\"dof\"",
    "\"kind\"",
    "\"system\"",
    "\"mass\"",
    "\"phases\"",
    "\"random\"",
    "\"scheme\"",
    "\"name\"",
    "\"load\"",
    "\"from\"",
    "\"noise\"",
    "\"periods\"",
    "\"matrix\"",
    "\"odd\"",
    "{\"a\":",
    "[[[[",
];

/// Words of HDF5 files.
const HDF5: &[&str] = &[
    "\u{89}HDF",
    "MATLAB_class",
    "MATLAB_empty",
    "TREE",
    "SNOD",
    "HEAP",
    "OHDR",
    "units",
    "\u{7f}\u{7f}\u{7f}\u{7f}",
    "\0\0\0\0\0\0\0\0",
];

/// Words of LabVIEW measurement files.
const LABVIEW: &[&str] = &[
    "LabVIEW Measurement\n",
    "***End_of_Header***\n",
    "X_Value",
    "X0\t0\t0\n",
    "Delta_X\t",
    "Samples\t",
    "Channels\t65536\n",
    "X_Columns\tMulti\n",
    "X_Columns\tNo\n",
    "Multi_Headings\tYes\n",
    "Separator\tComma\n",
    "Decimal_Separator\t,\n",
    "Y_Unit_Label\tN\tg\n",
    "Comment",
    "\t",
    "\r\n",
    "-1",
    "1e308",
];

pub const TARGETS: [Target; 11] = [
    Target {
        name: "text",
        corpus: "text",
        input: Input::Mutations(TEXT),
        memory: [4 << 20, 100],
        run: record,
    },
    Target {
        name: "binary",
        corpus: "binary",
        input: Input::Mutations(BINARY),
        memory: [8 << 20, 100],
        run: record,
    },
    Target {
        name: "parquet",
        corpus: "parquet",
        input: Input::Mutations(&[
            "PAR1",
            "\x15\0",
            "\x19\x2c",
            "\u{7f}\u{7f}",
            "units",
            "{\"x\": \"mm\"}",
        ]),
        memory: [8 << 20, 200],
        run: record,
    },
    Target {
        name: "hdf5",
        corpus: "hdf5",
        input: Input::Mutations(HDF5),
        memory: [16 << 20, 400],
        run: record,
    },
    Target {
        name: "matlab73",
        corpus: "matlab73",
        input: Input::Few(HDF5),
        memory: [16 << 20, 400],
        run: record,
    },
    Target {
        name: "labview",
        corpus: "labview",
        input: Input::Mutations(LABVIEW),
        memory: [4 << 20, 100],
        run: record,
    },
    Target {
        name: "chunks",
        corpus: "text",
        input: Input::Mutations(TEXT),
        memory: [8 << 20, 200],
        run: chunks,
    },
    Target {
        name: "json",
        corpus: "json",
        input: Input::Mutations(JSON),
        memory: [4 << 20, 1000],
        run: descriptions,
    },
    Target {
        name: "matrix",
        corpus: "matrix",
        input: Input::Mutations(&[
            "%%MatrixMarket matrix coordinate real general\n",
            "array",
            "symmetric",
            "skew-symmetric",
            "% comment\n",
            "2000 2000 1\n",
            "1e308",
            "nan",
            "-1",
        ]),
        memory: [4 << 20, 200],
        run: matrix,
    },
    Target {
        name: "identifiers",
        corpus: "parquet",
        input: Input::Mutations(&["PAR1", "\x15\0", "\x19\x2c", "\u{7f}\u{7f}"]),
        // The list of the records may use as much memory as the reader allows for any small file.
        memory: [300 << 20, 600],
        run: identifiers,
    },
    Target {
        name: "lines",
        corpus: "lines",
        input: Input::Mutations(&["odd", "even", "all", ":", ","]),
        memory: [1 << 20, 1000],
        run: lines,
    },
];

/// Limits that a small input can exceed.
const OPTIONS: ReadOptions = ReadOptions {
    skip_lines: 0,
    limits: Limits {
        row_bytes: 1 << 14,
        columns: 200,
        unpacked_bytes: 1 << 20,
        numbers: 1 << 17,
        ..Limits::DEFAULT
    },
};

/// Longest message, in bytes: a name may be as long as a row.
const LONGEST_MESSAGE: usize = 1 << 20;

/// Checks a text for the user: it must be short and contain no control characters.
fn shown(text: &str) -> Result<(), String> {
    if escaped(text) != text {
        return Err(format!("a message is not escaped: {text:?}"));
    }
    if text.len() > LONGEST_MESSAGE {
        return Err(format!("a message has {} bytes", text.len()));
    }
    Ok(())
}

/// Returns the value, if any, and checks the message of an error.
fn checked<T>(result: Result<T, IoError>) -> Result<Option<T>, String> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(error) => shown(&error.to_string()).map(|()| None),
    }
}

fn ensure(holds: bool, what: &str) -> Result<(), String> {
    if holds { Ok(()) } else { Err(what.into()) }
}

/// Reads a matrix and checks its shape and its number of entries.
fn matrix(bytes: &[u8]) -> Result<(), String> {
    let Some(matrix) = checked(parse_matrix_market("k\u{1b}.mtx", bytes, &OPTIONS.limits))? else {
        return Ok(());
    };
    reached(Depth::Fitted);
    ensure(matrix.nrows() == matrix.ncols(), "the matrix is not square")?;
    ensure(matrix.nnz() <= 2 * bytes.len(), "there are more entries than can stand in the file")
}

/// Reads a record and calls all methods of its table.
fn record(bytes: &[u8]) -> Result<(), String> {
    let Some(table) = checked(Table::parse_with("a\u{1b}.csv", bytes, &OPTIONS))? else {
        return Ok(());
    };
    reached(Depth::Read);
    for text in [table.file().to_owned(), table.format(), table.available()] {
        shown(&text)?;
    }
    ensure(table.width() <= OPTIONS.limits.columns, "there are more columns than allowed")?;
    let axes = [
        table.has_time_axis().then_some(TimeAxis::OfFile),
        table.time_column().map(TimeAxis::Column),
        Some(TimeAxis::RateHz(100.0)),
        Some(TimeAxis::Column("1")),
    ];
    let mut good = Vec::new();
    for column in 0..table.width() {
        shown(&table.label(column))?;
        let _ = (table.unit(column), table.about(column), table.says_unit_of_time(column));
        let _ = table.stated_unit(column, Some(Quantity::Force));
        if let Some(values) = checked(table.values(column))? {
            ensure(values.iter().all(|v| v.is_finite()), "a column is not finite")?;
            good.push((column + 1).to_string());
        }
        let number = (column + 1).to_string();
        for axis in axes.iter().flatten() {
            if let Some(record) = checked(table.record(axis, &[&number]))? {
                reached(Depth::Fitted);
                ensure(record.sampling().dt() > 0.0, "the time step is not positive")?;
            }
        }
    }
    for name in table.names() {
        checked(table.column(name))?;
    }
    for axis in axes.iter().flatten() {
        checked(table.record(axis, &good))?;
        checked(table.sampling(axis, &[] as &[&str]))?;
    }
    checked(table.common_length(&good))?;
    shown(&table.position(0).to_string())
}

/// Reads a Parquet file with each of its columns in turn as the identifiers of the records.
fn identifiers(bytes: &[u8]) -> Result<(), String> {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let path = folder.path().join("a.parquet");
    fs::write(&path, bytes).map_err(|e| e.to_string())?;
    let Some(file) = checked(ParquetFile::open(&path, &OPTIONS.limits))? else { return Ok(()) };
    reached(Depth::Read);
    for column in 0..file.head().width() {
        let Some(records) = checked(file.records(&(column + 1).to_string()))? else { continue };
        reached(Depth::Reached);
        let ends = records.iter().scan(0, |end, record| {
            let follows = record.rows.start == *end && record.rows.end > *end;
            *end = record.rows.end;
            Some(follows)
        });
        ensure(ends.into_iter().all(|follows| follows), "the records leave rows out")?;
        if checked(file.tables(None, &records[..records.len().min(3)]))?.is_some() {
            reached(Depth::Fitted);
        }
    }
    Ok(())
}

/// Checks that a text read in chunks gives the same numbers as one held in memory.
fn chunks(bytes: &[u8]) -> Result<(), String> {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let path = folder.path().join("a.csv");
    fs::write(&path, bytes).map_err(|e| e.to_string())?;
    let open = |held| RecordFile::open(&path, &OPTIONS, held);
    let (Some(held), Some(part)) = (checked(open(usize::MAX))?, checked(open(1))?) else {
        return Ok(());
    };
    reached(Depth::Read);
    ensure(held.head().names() == part.head().names(), "the names of the columns differ")?;
    let time = held.head().time_column().map_or(TimeAxis::RateHz(10.0), TimeAxis::Column);
    let columns: Vec<usize> = (0..held.head().width().min(8)).collect();
    let mut sums = [Vec::new(), Vec::new()];
    for (file, sums) in [&held, &part].into_iter().zip(&mut sums) {
        for column in &columns {
            let name = (column + 1).to_string();
            match file.survey(&time, &[&name]) {
                Ok(survey) => {
                    sums.push(format!(
                        "{:?} {:?} {:?}",
                        survey.sampling, survey.means, survey.peaks
                    ));
                    reached(Depth::Fitted);
                    let len = survey.sampling.len();
                    let mut all = Vec::new();
                    let read = file.blocks(&[&name], 0..len, 7, 7, &mut |block| {
                        all.extend(block.iter().map(|v| v.to_bits()));
                        Ok::<_, IoError>(())
                    });
                    checked(read)?;
                    ensure(all.len() == len, "the blocks have a different number of samples")?;
                    sums.push(format!("{all:?}"));
                }
                Err(error) => {
                    let text = error.to_string();
                    shown(&text)?;
                    sums.push(text);
                }
            }
        }
    }
    let [a, b] = sums;
    match a.iter().zip(&b).find(|(a, b)| a != b) {
        Some((a, b)) => Err(format!("{a} from memory, {b} in chunks")),
        None => ensure(a.len() == b.len(), "one way gives more results than the other"),
    }
}

/// Maximum number of samples per period for which the forces of an experiment are computed.
const MOST_SAMPLES: usize = 1 << 12;

/// Parses a text as each kind of description in turn, such as a covariance, a system or an
/// experiment.
fn descriptions(bytes: &[u8]) -> Result<(), String> {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let path = folder.path().join("a.json");
    fs::write(&path, bytes).map_err(|e| e.to_string())?;
    described(&path)
}

fn described(path: &Path) -> Result<(), String> {
    if let Some(covariance) = checked(read_covariance(path))?.flatten() {
        let n = covariance.parameters.len();
        ensure(covariance.matrix().shape() == (n, n), "the covariance is not square")?;
    }
    if let Some(system) = checked(read_system(path))? {
        reached(Depth::Fitted);
        ensure(system.stiffness().iter().all(|k| k.is_finite()), "the system is not finite")?;
    }
    let Some(experiment) = checked(Experiment::read(path))? else { return Ok(()) };
    reached(Depth::Fitted);
    checked(experiment.system())?;
    checked(experiment.initial_state())?;
    if experiment.samples() <= MOST_SAMPLES && experiment.periods <= 4 {
        for force in [experiment.force(), experiment.force_within_steps(0.5)] {
            if let Some(force) = checked(force)? {
                ensure(force.len() == experiment.samples(), "the force has a different length")?;
            }
        }
    }
    Ok(())
}

/// Parses a choice of spectral lines.
fn lines(bytes: &[u8]) -> Result<(), String> {
    let text = String::from_utf8_lossy(bytes);
    let Some(lines) = checked(text.parse::<LineSpec>())? else { return Ok(()) };
    reached(Depth::Fitted);
    ensure(lines.to_string() == text, "the choice is written differently from how it was read")?;
    for len in [1, 2, 3, 16, 1000] {
        let period = Sampling::new(0.01, len).map_err(|e| e.to_string())?;
        if let Some(lines) = checked(lines.lines(period))? {
            ensure(
                lines.is_sorted() && lines.iter().all(|n| 2 * n < len),
                "the lines are not sorted, or one is not below the Nyquist frequency",
            )?;
        }
    }
    Ok(())
}
