//! A table of columns as a measuring program writes it.

use std::path::Path;

use mechid_signal::Record;
use nalgebra::DMatrix;

use crate::rows::{Delimiter, Row, check_width, detect_delimiter, rows};
use crate::{IoError, TimeAxis};

/// The rows of a delimited text file; columns become numbers when they are asked for.
///
/// - The delimiter (comma, semicolon, tab, blanks) is found by itself; between semicolons or tabs a
///   decimal comma is understood.
/// - The first row names the columns if any of its fields is not a number; otherwise columns have
///   numbers only.
/// - A column is chosen by its name, or by its number counted from 1.
/// - Lines that start with `#`, and empty lines, are left out; a column nobody asks for may hold
///   anything.
#[derive(Debug)]
pub struct Table {
    file: String,
    delimiter: Delimiter,
    width: usize,
    names: Vec<String>,
    rows: Vec<Row>,
}

impl Table {
    /// The table in a file.
    ///
    /// # Errors
    /// [`IoError::Read`] if it cannot be read, otherwise as [`Table::parse`].
    pub fn read(path: impl AsRef<Path>) -> Result<Self, IoError> {
        let file = path.as_ref().display().to_string();
        match std::fs::read(path) {
            Ok(text) => Self::parse(file, &text),
            Err(source) => Err(IoError::Read { file, source }),
        }
    }

    /// The table in a text; `file` is how messages call it.
    ///
    /// # Errors
    /// [`IoError::Empty`] without a line of data, [`IoError::Ragged`] where the number of fields
    /// changes, [`IoError::Encoding`] for UTF-16.
    pub fn parse(file: impl Into<String>, text: &[u8]) -> Result<Self, IoError> {
        let file = file.into();
        if text.starts_with(&[0xff, 0xfe]) || text.starts_with(&[0xfe, 0xff]) {
            return Err(IoError::Encoding { file });
        }
        let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
        let delimiter = detect_delimiter(text);
        let mut rows = rows(&file, text, delimiter)?;
        let width = check_width(&file, &rows)?;
        let is_header = |row: &Row| {
            row.fields.iter().any(|field| !field.is_empty() && number(field, delimiter).is_none())
        };
        let mut names = vec![String::new(); width];
        let mut found = "it is empty";
        if rows.first().is_some_and(is_header) {
            let header = rows.remove(0);
            for (name, field) in names.iter_mut().zip(&header.fields) {
                *name = String::from_utf8_lossy(field).into_owned();
            }
            found = "there is a header and nothing below it";
        }
        if rows.is_empty() {
            return Err(IoError::Empty { file, found });
        }
        Ok(Self { file, delimiter, width, names, rows })
    }

    /// How messages call the file.
    pub fn file(&self) -> &str {
        &self.file
    }

    /// Number of columns, nameless ones included.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Number of samples.
    #[allow(clippy::len_without_is_empty, reason = "never empty")]
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Names of the columns, empty where they have none.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Indices, counted from 0, of the columns that have a name or a first value: not those that a
    /// trailing delimiter leaves.
    pub fn filled_columns(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.width).filter(|c| {
            !self.names[*c].is_empty()
                || self.rows[0].fields.get(*c).is_some_and(|first| !first.is_empty())
        })
    }

    /// Line of the file on which a sample stands, both as they are counted there (line from 1,
    /// sample from 0).
    ///
    /// # Panics
    /// If there is no such sample.
    pub fn line(&self, sample: usize) -> u64 {
        self.rows[sample].line
    }

    /// The columns there are, for a message: `1 "time", 2 "force"`.
    pub fn available(&self) -> String {
        let columns: Vec<String> = self.filled_columns().map(|c| self.label(c)).collect();
        columns.join(", ")
    }

    /// Index, counted from 0, of the column with this name or, failing that, with this number
    /// counted from 1.
    ///
    /// # Errors
    /// [`IoError::MissingColumn`], [`IoError::AmbiguousColumn`].
    pub fn find(&self, wanted: &str) -> Result<usize, IoError> {
        let wanted = wanted.trim();
        let mut named = (0..self.width).filter(|c| !wanted.is_empty() && self.names[*c] == wanted);
        let (file, available) = (|| self.file.clone(), || self.available());
        match (named.next(), named.next()) {
            (Some(column), None) => Ok(column),
            (Some(_), Some(_)) => Err(IoError::AmbiguousColumn {
                file: file(),
                wanted: wanted.into(),
                available: available(),
            }),
            (None, _) => match wanted.parse::<usize>() {
                Ok(n) if (1..=self.width).contains(&n) => Ok(n - 1),
                _ => Err(IoError::MissingColumn {
                    file: file(),
                    wanted: wanted.into(),
                    available: available(),
                }),
            },
        }
    }

    /// The numbers of the column `wanted`, chosen as in [`Table::find`].
    ///
    /// # Errors
    /// [`IoError::NotANumber`], [`IoError::EmptyField`] and [`IoError::NotFinite`] with line and
    /// column, and those of [`Table::find`].
    pub fn column(&self, wanted: &str) -> Result<Vec<f64>, IoError> {
        let column = self.find(wanted)?;
        self.rows.iter().map(|row| self.value(row, column)).collect()
    }

    /// A record of the columns `wanted`, one channel each, on the given time axis.
    ///
    /// # Errors
    /// [`IoError::DuplicateColumn`] if a column is used twice (the time column included), those of
    /// [`Table::column`], and those of the time axis: [`IoError::NonUniformTime`],
    /// [`IoError::SingleSample`], [`IoError::SampleRate`].
    pub fn record(
        &self,
        time: &TimeAxis<'_>,
        wanted: &[impl AsRef<str>],
    ) -> Result<Record, IoError> {
        let mut used: Vec<&str> = Vec::new();
        if let TimeAxis::Column(column) = time {
            used.push(column);
        }
        used.extend(wanted.iter().map(AsRef::as_ref));
        self.check_distinct(&used)?;
        let sampling = time.sampling(self)?;
        let channels: Vec<Vec<f64>> =
            wanted.iter().map(|w| self.column(w.as_ref())).collect::<Result<_, _>>()?;
        let data = DMatrix::from_fn(self.len(), channels.len(), |k, c| channels[c][k]);
        Record::new(sampling, data)
            .map_err(|source| IoError::Signal { file: self.file.clone(), source })
    }

    fn check_distinct(&self, wanted: &[&str]) -> Result<(), IoError> {
        let columns: Vec<usize> = wanted.iter().map(|w| self.find(w)).collect::<Result<_, _>>()?;
        for (second, column) in columns.iter().enumerate() {
            if let Some(first) = columns[..second].iter().position(|c| c == column) {
                return Err(IoError::DuplicateColumn {
                    file: self.file.clone(),
                    column: column + 1,
                    first: wanted[first].into(),
                    second: wanted[second].into(),
                    available: self.available(),
                });
            }
        }
        Ok(())
    }

    fn value(&self, row: &Row, column: usize) -> Result<f64, IoError> {
        let field = row.fields.get(column).unwrap_or_default();
        let (file, line) = (self.file.clone(), row.line);
        match number(field, self.delimiter) {
            Some(value) if value.is_finite() => Ok(value),
            Some(value) => {
                Err(IoError::NotFinite { file, line, column: self.label(column), value })
            }
            None if field.is_empty() => {
                Err(IoError::EmptyField { file, line, column: self.label(column) })
            }
            None => {
                let text = String::from_utf8_lossy(field).chars().take(40).collect();
                Err(IoError::NotANumber { file, line, column: self.label(column), text })
            }
        }
    }

    fn label(&self, column: usize) -> String {
        match self.names[column].as_str() {
            "" => format!("{}", column + 1),
            name => format!("{} \"{name}\"", column + 1),
        }
    }
}

/// The number a field holds; a decimal comma is understood where commas do not separate fields.
fn number(field: &[u8], delimiter: Delimiter) -> Option<f64> {
    let text = std::str::from_utf8(field).ok()?;
    let parsed = text.parse().ok();
    if parsed.is_some() || delimiter == Delimiter::Byte(b',') || text.contains('.') {
        return parsed;
    }
    let (whole, fraction) = text.split_once(',')?;
    format!("{whole}.{fraction}").parse().ok()
}
