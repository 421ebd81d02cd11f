//! Rows of fields into columns of numbers, none of which is held as text.

use csv::ByteRecord;

use super::Contents;
use super::column::{Axis, Column, Lines, Place, Unusable};
use super::dialect::{Delimiter, number};
use crate::IoError;

/// Columns that grow row by row.
pub(super) struct Rows {
    file: String,
    delimiter: Delimiter,
    /// Nothing before the first row.
    shape: Option<Shape>,
    columns: Vec<Column>,
    /// Columns whose fields are read; all of them, once they are known, if nothing is said.
    wanted: Option<Vec<usize>>,
    has_header: bool,
    has_units: bool,
    samples: usize,
    lines: Lines,
    /// Rows of empty fields not yet followed by another one: line and number of fields. At the end
    /// of the file they do not count.
    empty: Vec<(u64, usize)>,
}

/// The first row: its line, and its fields, all of them and up to the last that is not empty.
#[derive(Debug, Clone, Copy)]
struct Shape {
    line: u64,
    width: usize,
    filled: usize,
}

impl Rows {
    /// No rows yet; the fields of the columns `wanted` will be read, or of all.
    pub fn new(file: String, delimiter: Delimiter, wanted: Option<Vec<usize>>) -> Self {
        Self {
            file,
            delimiter,
            shape: None,
            columns: Vec::new(),
            wanted,
            has_header: false,
            has_units: false,
            samples: 0,
            lines: Lines::default(),
            empty: Vec::new(),
        }
    }

    /// Line of the first row, if there was one.
    pub fn first_line(&self) -> Option<u64> {
        self.shape.map(|shape| shape.line)
    }

    /// Number of columns.
    pub fn width(&self) -> usize {
        self.columns.len()
    }

    /// Samples so far.
    pub fn samples(&self) -> usize {
        self.samples
    }

    /// A column, by its index; it has the samples since [`Rows::forget`].
    pub fn column(&self, column: usize) -> &Column {
        &self.columns[column]
    }

    /// Where the samples since [`Rows::forget`] stand.
    pub fn lines(&self) -> &Lines {
        &self.lines
    }

    /// Forgets the samples so far, but neither their number nor what is wrong with a column.
    pub fn forget(&mut self) {
        for values in self.columns.iter_mut().filter_map(|column| column.values.as_mut().ok()) {
            values.clear();
        }
        self.lines = Lines::default();
    }

    /// One more row.
    pub fn push(&mut self, line: u64, fields: &ByteRecord) -> Result<(), IoError> {
        if fields.iter().all(<[u8]>::is_empty) {
            self.empty.push((line, fields.len()));
            return Ok(());
        }
        for (line, width) in std::mem::take(&mut self.empty) {
            let blank: ByteRecord = std::iter::repeat_n("", width).collect();
            self.take(line, &blank)?;
        }
        self.take(line, fields)
    }

    fn take(&mut self, line: u64, fields: &ByteRecord) -> Result<(), IoError> {
        let filled = fields.iter().rposition(|field| !field.is_empty()).map_or(0, |last| last + 1);
        match self.shape {
            None => {
                let shape = Shape { line, width: fields.len(), filled };
                self.shape = Some(shape);
                self.columns = (0..shape.width).map(|_| new_column()).collect();
                self.wanted.get_or_insert_with(|| (0..shape.width).collect());
                if self.take_header(fields) {
                    return Ok(());
                }
            }
            // Fields beyond either end are forgiven where they are empty: rigs end some lines with
            // a delimiter and others not.
            Some(first) => {
                let (got, expected) = (fields.len(), first.filled);
                if got < expected || filled > first.width {
                    return Err(IoError::Ragged { file: self.file.clone(), line, got, expected });
                }
            }
        }
        if self.take_units(fields) {
            return Ok(());
        }
        for &c in self.wanted.iter().flatten() {
            let (column, field) = (&mut self.columns[c], fields.get(c).unwrap_or_default());
            column.filled |= self.samples == 0 && !field.is_empty();
            let Ok(values) = &mut column.values else { continue };
            match value(line, field, self.delimiter) {
                Ok(value) => values.push(value),
                Err(wrong) => column.values = Err(wrong),
            }
        }
        self.lines.push(self.samples, line);
        self.samples += 1;
        Ok(())
    }

    /// Takes the names of the columns, if the first row has any field that is no number.
    fn take_header(&mut self, fields: &ByteRecord) -> bool {
        self.has_header =
            fields.iter().any(|field| !field.is_empty() && number(field, self.delimiter).is_none());
        if self.has_header {
            for (column, field) in self.columns.iter_mut().zip(fields) {
                column.name = String::from_utf8_lossy(field).into_owned();
                column.filled = !field.is_empty();
            }
        }
        self.has_header
    }

    /// Takes the units of the columns, if the row below the names has no number at all.
    fn take_units(&mut self, fields: &ByteRecord) -> bool {
        let below_names = self.has_header && self.samples == 0 && !self.has_units;
        let wordy = fields.iter().all(|field| number(field, self.delimiter).is_none());
        self.has_units |= below_names && wordy;
        if below_names && wordy {
            for (column, field) in self.columns.iter_mut().zip(fields) {
                column.about = String::from_utf8_lossy(field).into_owned();
            }
        }
        below_names && wordy
    }

    /// The columns with all samples since [`Rows::forget`].
    pub fn finish(self, format: &str) -> Result<Contents, IoError> {
        if self.samples == 0 {
            let found = match self.has_header {
                true => "there is a header and nothing below it",
                false => "it is empty",
            };
            return Err(IoError::Empty { file: self.file, found });
        }
        Ok(Contents {
            format: format.into(),
            columns: self.columns,
            lines: self.lines,
            samples: self.samples,
            ..Contents::default()
        })
    }
}

fn new_column() -> Column {
    let (name, about) = (String::new(), String::new());
    Column { name, filled: false, values: Ok(Vec::new()), axis: Axis::Unknown, about }
}

/// The number in a field, or what is wrong with it.
fn value(line: u64, field: &[u8], delimiter: Delimiter) -> Result<f64, Unusable> {
    match number(field, delimiter) {
        Some(value) if value.is_finite() => Ok(value),
        Some(value) => Err(Unusable::NotFinite { at: Place::Line(line), value }),
        None if field.is_empty() => Err(Unusable::Empty { line }),
        None => {
            let text = String::from_utf8_lossy(field).chars().take(40).collect();
            Err(Unusable::Text { line, text })
        }
    }
}
