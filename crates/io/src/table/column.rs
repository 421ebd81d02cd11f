//! One column of a table: its numbers, or why it has none.

use std::fmt;

use crate::IoError;

/// Where something stands in a file, counted from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// A line, as a text editor counts them.
    Line(u64),
    /// A sample of a column, where the file has no lines.
    Sample(usize),
    /// A byte, in a binary file.
    Byte(usize),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Place::Line(n) => write!(f, "line {n}"),
            Place::Sample(n) => write!(f, "sample {n}"),
            Place::Byte(n) => write!(f, "byte {n}"),
        }
    }
}

/// A column of a file.
#[derive(Debug)]
pub(crate) struct Column {
    /// Empty where it has none.
    pub name: String,
    /// Whether it has a name or a first value: not what a trailing delimiter leaves.
    pub filled: bool,
    /// Its numbers, all finite, or what is wrong with them.
    pub values: Result<Vec<f64>, Unusable>,
    /// The instants its file gives it.
    pub axis: Axis,
    /// What the file says of it beyond its name.
    pub about: String,
}

/// The instants that a file gives a column.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Axis {
    /// None: a column of instants or a rate says when the samples were taken.
    Unknown,
    /// Equally spaced, in s.
    Even { start: f64, step: f64 },
    /// In the column with this index.
    Column(usize),
}

/// Why a column cannot be used; told when it is asked for.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Unusable {
    Empty { line: u64 },
    Text { line: u64, text: String },
    NotFinite { at: Place, value: f64 },
    Kind(String),
}

impl Unusable {
    /// The error of whoever asks for the column that `label` names.
    pub fn error(&self, file: &str, label: String) -> IoError {
        let file = file.to_owned();
        match self.clone() {
            Self::Empty { line } => IoError::EmptyField { file, line, column: label },
            Self::Text { line, text } => IoError::NotANumber { file, line, column: label, text },
            Self::NotFinite { at, value } => IoError::NotFinite { file, at, column: label, value },
            Self::Kind(what) => IoError::NoNumbers { file, column: label, what },
        }
    }
}

impl Column {
    /// A column of numbers from a file without lines, which are checked here.
    pub fn of_numbers(name: String, values: Vec<f64>) -> Self {
        let values = match values.iter().position(|v| !v.is_finite()) {
            None => Ok(values),
            Some(k) => Err(Unusable::NotFinite { at: Place::Sample(k + 1), value: values[k] }),
        };
        Self { name, filled: true, values, axis: Axis::Unknown, about: String::new() }
    }

    /// A column that nobody can use.
    pub fn unusable(name: String, what: impl Into<String>) -> Self {
        let values = Err(Unusable::Kind(what.into()));
        Self { name, filled: true, values, axis: Axis::Unknown, about: String::new() }
    }
}

/// The lines on which the samples stand, as runs of consecutive ones: a file of ten million rows
/// and one comment has two.
#[derive(Debug, Default)]
pub(crate) struct Lines {
    /// Sample, counted from 0, and line with which a run begins.
    runs: Vec<(usize, u64)>,
}

impl Lines {
    /// Says that `sample` stands on `line`; samples come in order.
    pub fn push(&mut self, sample: usize, line: u64) {
        let expected = self.runs.last().map(|(first, at)| at + (sample - first) as u64);
        if expected != Some(line) {
            self.runs.push((sample, line));
        }
    }

    /// Where a sample, counted from 0, stands.
    pub fn place(&self, sample: usize) -> Place {
        let after = self.runs.partition_point(|(first, _)| *first <= sample);
        match after.checked_sub(1).map(|run| self.runs[run]) {
            Some((first, line)) => Place::Line(line + (sample - first) as u64),
            None => Place::Sample(sample + 1),
        }
    }
}
