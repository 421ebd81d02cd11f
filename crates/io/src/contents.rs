//! The contents of a record file, in the form into which every format is read.

use std::fmt;

use nalgebra::Complex;

use crate::limits::{Limit, Limits};
use crate::{IoError, Quantity, Unit};

/// Position in a file, counted from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// Line number, as in a text editor.
    Line(u64),
    /// Number of a sample of a column, if the file has no lines.
    Sample(usize),
    /// A byte, in a binary file.
    Byte(usize),
    /// A column.
    Column(usize),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Place::Line(n) => write!(f, "line {n}"),
            Place::Sample(n) => write!(f, "sample {n}"),
            Place::Byte(n) => write!(f, "byte {n}"),
            Place::Column(n) => write!(f, "column {n}"),
        }
    }
}

/// Contents of a record file of any format.
#[derive(Debug, Default)]
pub(crate) struct Contents {
    /// Name of the format, as messages show it.
    pub format: String,
    pub columns: Vec<Column>,
    /// Line numbers of the samples, in a text file.
    pub lines: Lines,
    /// Most frequent number of samples of a column.
    pub samples: usize,
    /// Single numbers that the file has in addition to its columns.
    pub scalars: Vec<(String, f64)>,
    /// Arrays of complex numbers, which are frequency responses rather than channels.
    pub complex: Vec<ComplexArray>,
    /// MATLAB text variables, by their names.
    pub texts: Vec<(String, String)>,
    /// Notes about the file, for example about omitted contents.
    pub remarks: Vec<String>,
    /// Number of the last line of a text, if no line break ends it.
    pub open_line: Option<u64>,
}

impl Contents {
    /// Refuses names and units that are longer than the limit.
    pub fn check_names(&self, file: &str, limits: &Limits) -> Result<(), IoError> {
        let most = limits.name_bytes;
        let is_long = |column: &Column| column.name.len().max(column.about.len()) > most;
        let at = match self.columns.iter().position(is_long) {
            Some(column) => Place::Column(column + 1),
            None if self.scalars.iter().any(|(name, _)| name.len() > most) => Place::Byte(1),
            None => return Ok(()),
        };
        Err(IoError::TooLarge { file: file.into(), at, limit: Limit::NameBytes(most) })
    }

    /// Sets `samples` to the most frequent column length; of equally frequent ones, to the longest.
    pub fn with_usual_length(mut self) -> Self {
        let lengths: Vec<usize> =
            self.columns.iter().filter_map(|c| c.values.as_ref().ok()).map(Vec::len).collect();
        let mut sorted = lengths;
        sorted.sort_unstable();
        let runs = sorted.chunk_by(|a, b| a == b);
        self.samples = runs.max_by_key(|run| (run.len(), run[0])).map_or(0, |run| run[0]);
        self
    }
}

/// Array of complex numbers with any number of dimensions.
#[derive(Debug)]
pub(crate) struct ComplexArray {
    pub name: String,
    /// Lengths of the dimensions, in the order of the indices in programs that write such files.
    pub lengths: Vec<usize>,
    /// Distance between neighbouring elements in `values`, along each dimension.
    pub strides: Vec<usize>,
    pub values: Vec<Complex<f64>>,
    /// Text that states the unit, from an attribute or a neighbouring field; empty if there is
    /// none.
    pub unit: String,
}

impl ComplexArray {
    /// Creates an array whose first index varies fastest, as MATLAB and Fortran store it.
    pub fn first_fastest(name: String, lengths: Vec<usize>, values: Vec<Complex<f64>>) -> Self {
        let strides = strides(lengths.iter());
        Self { name, strides, lengths, values, unit: String::new() }
    }

    /// Creates an array whose last index varies fastest, as C and Python store it.
    #[cfg(feature = "hdf5")]
    pub fn last_fastest(name: String, lengths: Vec<usize>, values: Vec<Complex<f64>>) -> Self {
        let mut strides = strides(lengths.iter().rev());
        strides.reverse();
        Self { name, strides, lengths, values, unit: String::new() }
    }
}

/// Returns the distance between neighbouring elements along each dimension; the first index varies
/// fastest.
fn strides<'a>(lengths: impl Iterator<Item = &'a usize>) -> Vec<usize> {
    let next = |stride: &mut usize, len: &usize| {
        let this = *stride;
        *stride *= len;
        Some(this)
    };
    lengths.scan(1, next).collect()
}

/// A column of a file.
#[derive(Debug)]
pub(crate) struct Column {
    /// Name; empty if the column has none.
    pub name: String,
    /// `true` if the column has a name or a first value; `false` for the column that a trailing
    /// delimiter creates.
    pub filled: bool,
    /// Numbers, all finite, or the reason why the column cannot be used.
    pub values: Result<Vec<f64>, Unusable>,
    /// Time axis of the column in the file.
    pub axis: Axis,
    /// Description that the file gives in addition to the name.
    pub about: String,
    /// Text that states the unit, from a line of units, a label or an attribute; empty if there is
    /// none.
    pub unit: String,
    /// Quantity that the file states by a code; `None` if it states none.
    pub kind: Option<Quantity>,
    /// `true` if the numbers of the column are instants, in s, that were read from dates or clock
    /// times.
    pub has_instants: bool,
    /// Unit or factor that the user states; it replaces what the file states.
    pub overriding: Option<Override>,
}

/// Unit or factor that a user states for a column; it has priority over a unit in the column's
/// name.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Override {
    /// Unit of the numbers.
    Unit(Unit),
    /// SI units per unit of the numbers.
    Scale(f64),
}

/// Time axis of a column, as its file states it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Axis {
    /// No axis in the file: a time column or a sample rate is needed.
    Unknown,
    /// Uniform, in s.
    Even { start: f64, step: f64 },
    /// Uniform from 0 s, with a step in s that follows from a named number of the file, such as
    /// `Fs`.
    Stated { step: f64, scalar: usize },
    /// Contradiction between two named numbers of the file that state different steps.
    Contradiction { scalars: [usize; 2], steps: [f64; 2] },
    /// Column with this index.
    Column(usize),
}

/// Reason why a column cannot be used; it is reported only if the column is needed.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Unusable {
    Empty {
        line: u64,
    },
    Text {
        line: u64,
        text: String,
    },
    /// Number whose decimal sign differs from that of the other numbers.
    DecimalSign {
        line: u64,
        text: String,
        sign: DecimalSign,
    },
    NotFinite {
        at: Place,
        value: f64,
    },
    Kind(String),
}

impl Unusable {
    /// Returns the error for the column with this label.
    pub fn error(&self, file: &str, label: String) -> IoError {
        let file = file.to_owned();
        match self.clone() {
            Self::Empty { line } => IoError::EmptyField { file, line, column: label },
            Self::Text { line, text } => IoError::NotANumber { file, line, column: label, text },
            Self::DecimalSign { line, text, sign } => {
                IoError::MixedDecimalSigns { file, line, column: label, text, sign }
            }
            Self::NotFinite { at, value } => IoError::NotFinite { file, at, column: label, value },
            Self::Kind(what) => IoError::NoNumbers { file, column: label, what },
        }
    }
}

impl Column {
    /// Creates a column of numbers from a file without lines; infinite values and NaN make it
    /// unusable.
    pub fn from_numbers(name: String, values: Vec<f64>) -> Self {
        let values = match values.iter().position(|v| !v.is_finite()) {
            None => Ok(values),
            Some(k) => Err(Unusable::NotFinite { at: Place::Sample(k + 1), value: values[k] }),
        };
        Self { filled: true, values, ..Self::named(name) }
    }

    /// Creates a column without numbers.
    pub fn named(name: String) -> Self {
        Self {
            name,
            filled: false,
            values: Ok(Vec::new()),
            axis: Axis::Unknown,
            about: String::new(),
            unit: String::new(),
            kind: None,
            has_instants: false,
            overriding: None,
        }
    }

    /// Creates a column that has no real numbers over time; `what` describes what it has instead.
    pub fn unusable(name: String, what: impl Into<String>) -> Self {
        let values = Err(Unusable::Kind(what.into()));
        Self { filled: true, values, ..Self::named(name) }
    }
}

/// The sign between the whole and the decimal places of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DecimalSign {
    /// `1.5`.
    Point,
    /// `1,5`.
    Comma,
}

impl fmt::Display for DecimalSign {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Point => "point",
            Self::Comma => "comma",
        })
    }
}

/// Line numbers of the samples, stored as runs of consecutive lines: a file of ten million rows
/// with one comment has two runs.
#[derive(Debug, Default)]
pub(crate) struct Lines {
    /// First sample, counted from 0, and first line of each run.
    runs: Vec<(usize, u64)>,
}

impl Lines {
    pub fn clear(&mut self) {
        self.runs.clear();
    }

    /// Appends the line numbers in `other`, whose sample 0 is sample number `samples` of `self`.
    pub fn append(&mut self, samples: usize, other: &Self) {
        other.runs.iter().for_each(|(first, line)| self.push(samples + first, *line));
    }

    /// Appends the line number of `sample`; samples are passed in order.
    pub fn push(&mut self, sample: usize, line: u64) {
        let expected = self.runs.last().map(|(first, at)| at + (sample - first) as u64);
        if expected != Some(line) {
            self.runs.push((sample, line));
        }
    }

    /// Returns the line of the file that contains `sample`, which is counted from 0; if the line is
    /// not known, returns the number of the sample, counted from 1.
    pub fn position(&self, sample: usize) -> Place {
        let after = self.runs.partition_point(|(first, _)| *first <= sample);
        match after.checked_sub(1).map(|run| self.runs[run]) {
            Some((first, line)) => Place::Line(line + (sample - first) as u64),
            None => Place::Sample(sample + 1),
        }
    }
}

/// An error in a binary or universal file.
#[derive(Debug)]
pub(crate) struct Fault {
    /// Offset of the byte with the error.
    pub at: usize,
    pub cause: Cause,
}

/// Kinds of [`Fault`].
#[derive(Debug)]
pub(crate) enum Cause {
    /// The file breaks its format.
    Malformed(String),
    /// The file is larger than a limit allows.
    TooLarge(Limit),
}

impl Fault {
    pub fn new(at: usize, what: impl Into<String>) -> Self {
        Self { at, cause: Cause::Malformed(what.into()) }
    }

    pub fn too_large(at: usize, limit: Limit) -> Self {
        Self { at, cause: Cause::TooLarge(limit) }
    }

    /// Returns the error for a file at the given position.
    pub fn error(self, file: &str, at: Place) -> IoError {
        let file = file.to_owned();
        match self.cause {
            Cause::Malformed(what) => IoError::Malformed { file, at, what },
            Cause::TooLarge(limit) => IoError::TooLarge { file, at, limit },
        }
    }
}
