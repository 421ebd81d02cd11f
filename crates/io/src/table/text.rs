//! Delimited text into columns of numbers, in one pass that holds no field as text.

use std::io::{self, BufRead, Read};

use csv::ByteRecord;

use super::column::{Axis, Column, Lines, Place, Unusable};
use super::source::{BYTE_ORDER_MARK, Source, failed};
use super::{Contents, dialect, preamble};
use crate::IoError;
use dialect::{COMMENT, Delimiter, number};

/// The table in a text, below some lines that are skipped.
pub(crate) fn read(source: Source<'_>, skip: u64) -> Result<Contents, IoError> {
    let Source { file, gzip, mut reader, .. } = source;
    let wrong = |e| failed(&file, gzip, e);
    for _ in 0..skip {
        reader.skip_until(b'\n').map_err(wrong)?;
    }
    let start = dialect::first_lines(&mut reader).map_err(wrong)?;
    let text = start.strip_prefix(BYTE_ORDER_MARK).unwrap_or(&start);
    let delimiter = dialect::detect(text);
    let mut stream = NumberedLines::new(text.chain(reader), skip);
    let mut rows = Rows::new(&file, delimiter);
    let taken = match delimiter {
        Delimiter::Blanks => rows.take_words(&mut stream, wrong),
        Delimiter::Byte(byte) => rows.take_fields(stream, byte, wrong),
    };
    let first = rows.shape.map(|shape| shape.line);
    let contents = taken.and_then(|()| rows.finish(delimiter.name()));
    let Some(table) = preamble::table(text).filter(|table| first < Some(skip + table.line)) else {
        return contents;
    };
    match contents {
        // Whatever else is wrong, it is no wonder.
        Err(IoError::Ragged { .. }) => {}
        Ok(contents) if contents.columns.len() < table.fields => {}
        other => return other,
    }
    Err(IoError::AboveTable { line: skip + table.line, fields: table.fields, file })
}

/// What the operating system or the decompressor said, without the csv reader's words around it.
fn plain(error: csv::Error) -> io::Error {
    match error.into_kind() {
        csv::ErrorKind::Io(e) => e,
        other => io::Error::other(format!("{other:?}")),
    }
}

/// A text whose lines are counted; all of them end with a line feed alone.
struct NumberedLines<R> {
    text: R,
    line: Vec<u8>,
    /// Bytes of `line` that were handed out.
    given: usize,
    /// Number of the line before the first.
    first: u64,
    /// Number of the line read last.
    count: u64,
    /// First and last of each run of lines that hold no row: empty ones and comments.
    idle: Vec<(u64, u64)>,
}

impl<R: BufRead> NumberedLines<R> {
    /// A text that follows so many lines.
    fn new(text: R, first: u64) -> Self {
        Self { text, line: Vec::new(), given: 0, first, count: first, idle: Vec::new() }
    }

    /// The next line and its number.
    fn next_line(&mut self) -> io::Result<Option<(u64, &[u8])>> {
        self.line.clear();
        self.given = 0;
        if self.text.read_until(b'\n', &mut self.line)? == 0 {
            return Ok(None);
        }
        self.count += 1;
        if self.line.ends_with(b"\r\n") {
            self.line.pop();
            self.line.pop();
            self.line.push(b'\n');
        }
        if matches!(self.line[0], COMMENT | b'\n') {
            match self.idle.last_mut() {
                Some((_, last)) if *last + 1 == self.count => *last = self.count,
                _ => self.idle.push((self.count, self.count)),
            }
        }
        Ok(Some((self.count, &self.line)))
    }

    /// The first line from `line` on, of those handed out, that holds a row.
    fn row_from(&self, line: u64) -> u64 {
        let line = self.first + line;
        let after = self.idle.partition_point(|(first, _)| *first <= line);
        match after.checked_sub(1).map(|run| self.idle[run]) {
            Some((_, last)) if last >= line => last + 1,
            _ => line,
        }
    }
}

impl<R: BufRead> Read for NumberedLines<R> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let mut filled = 0;
        while filled < into.len() {
            if self.given == self.line.len() && self.next_line()?.is_none() {
                break;
            }
            let some = (self.line.len() - self.given).min(into.len() - filled);
            into[filled..filled + some].copy_from_slice(&self.line[self.given..self.given + some]);
            self.given += some;
            filled += some;
        }
        Ok(filled)
    }
}

/// Columns that grow row by row.
struct Rows<'a> {
    file: &'a str,
    delimiter: Delimiter,
    /// Nothing before the first row.
    shape: Option<Shape>,
    columns: Vec<Column>,
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

impl<'a> Rows<'a> {
    fn new(file: &'a str, delimiter: Delimiter) -> Self {
        Self {
            file,
            delimiter,
            shape: None,
            columns: Vec::new(),
            has_header: false,
            has_units: false,
            samples: 0,
            lines: Lines::default(),
            empty: Vec::new(),
        }
    }

    /// Every row of a text with blanks between its fields.
    fn take_words(
        &mut self,
        stream: &mut NumberedLines<impl BufRead>,
        wrong: impl Fn(io::Error) -> IoError,
    ) -> Result<(), IoError> {
        while let Some((line, content)) = stream.next_line().map_err(&wrong)? {
            let fields: ByteRecord = dialect::words(content).collect();
            if fields.get(0).is_some_and(|word| word[0] != COMMENT) {
                self.push(line, &fields)?;
            }
        }
        Ok(())
    }

    /// Every row of a text with a delimiter between its fields.
    fn take_fields(
        &mut self,
        stream: NumberedLines<impl BufRead>,
        delimiter: u8,
        wrong: impl Fn(io::Error) -> IoError,
    ) -> Result<(), IoError> {
        let mut reader = dialect::fields(stream, delimiter);
        let mut fields = ByteRecord::new();
        while reader.read_byte_record(&mut fields).map_err(|e| wrong(plain(e)))? {
            let from = fields.position().map_or(0, csv::Position::line);
            self.push(reader.get_ref().row_from(from), &fields)?;
        }
        Ok(())
    }

    /// One more row.
    fn push(&mut self, line: u64, fields: &ByteRecord) -> Result<(), IoError> {
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
                if self.take_header(fields) {
                    return Ok(());
                }
            }
            // Fields beyond either end are forgiven where they are empty: rigs end some lines with
            // a delimiter and others not.
            Some(first) => {
                let (got, expected) = (fields.len(), first.filled);
                if got < expected || filled > first.width {
                    return Err(IoError::Ragged { file: self.file.into(), line, got, expected });
                }
            }
        }
        if self.take_units(fields) {
            return Ok(());
        }
        for (c, column) in self.columns.iter_mut().enumerate() {
            let field = fields.get(c).unwrap_or_default();
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

    fn finish(self, format: &str) -> Result<Contents, IoError> {
        if self.samples == 0 {
            let found = match self.has_header {
                true => "there is a header and nothing below it",
                false => "it is empty",
            };
            return Err(IoError::Empty { file: self.file.into(), found });
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
