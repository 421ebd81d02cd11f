//! Delimited text into columns of numbers, as many rows at a time as are asked for.

use std::io::{self, BufRead, Cursor, Read as _};

use csv::ByteRecord;

use super::Contents;
use super::dialect::{self, COMMENT, Delimiter};
use super::numbered_lines::NumberedLines;
use super::preamble::{self, Beginning};
use super::rows::Rows;
use super::source::{BYTE_ORDER_MARK, Source, failed};
use crate::IoError;

/// A text on its way into columns.
pub(super) struct TextReader<'a> {
    file: String,
    gzip: bool,
    delimiter: Delimiter,
    /// Where the table seems to begin, lines counted in the file.
    table: Option<Beginning>,
    stream: Stream<'a>,
    fields: ByteRecord,
    rows: Rows,
}

type Text<'a> = NumberedLines<Box<dyn BufRead + 'a>>;

/// How the fields of a row are told apart.
enum Stream<'a> {
    Words(Text<'a>),
    Fields(Box<csv::Reader<Text<'a>>>),
}

impl<'a> TextReader<'a> {
    /// Finds out how a text tells fields, below some lines that are skipped; of the columns `wanted`,
    /// or of all, the numbers will be read.
    pub fn open(
        source: Source<'a>,
        skip: u64,
        wanted: Option<Vec<usize>>,
    ) -> Result<Self, IoError> {
        let Source { file, gzip, mut reader, .. } = source;
        let wrong = |e| failed(&file, gzip, e);
        for _ in 0..skip {
            reader.skip_until(b'\n').map_err(wrong)?;
        }
        let mut start = dialect::first_lines(&mut reader).map_err(wrong)?;
        if start.starts_with(BYTE_ORDER_MARK) {
            start.drain(..BYTE_ORDER_MARK.len());
        }
        let delimiter = dialect::detect(&start);
        let table = preamble::table(&start).map(|t| Beginning { line: skip + t.line, ..t });
        let text: Box<dyn BufRead + 'a> = Box::new(Cursor::new(start).chain(reader));
        let lines = NumberedLines::new(text, skip);
        let stream = match delimiter {
            Delimiter::Blanks => Stream::Words(lines),
            Delimiter::Byte(byte) => Stream::Fields(Box::new(dialect::fields(lines, byte))),
        };
        let rows = Rows::new(file.clone(), delimiter, wanted);
        Ok(Self { file, gzip, delimiter, table, stream, fields: ByteRecord::new(), rows })
    }

    /// The rows so far.
    pub fn rows(&mut self) -> &mut Rows {
        &mut self.rows
    }

    /// Number of the line read last, if nothing ends it.
    pub fn open_line(&self) -> Option<u64> {
        match &self.stream {
            Stream::Words(text) => text.open_line(),
            Stream::Fields(reader) => reader.get_ref().open_line(),
        }
    }

    /// Reads about so many more samples; whether there may be more still.
    pub fn read(&mut self, count: usize) -> Result<bool, IoError> {
        let goal = self.rows.samples().saturating_add(count);
        while self.rows.samples() < goal {
            let next = self.stream.next(&mut self.fields);
            match next.map_err(|e| failed(&self.file, self.gzip, e))? {
                None => return Ok(false),
                Some(line) => self.rows.push(line, &self.fields).map_err(|e| self.above_or(e))?,
            }
        }
        Ok(true)
    }

    /// What was read, as the contents of a file.
    pub fn finish(self) -> Result<Contents, IoError> {
        match self.above() {
            Some(above) if self.table.is_some_and(|t| self.rows.width() < t.fields) => Err(above),
            _ => {
                let open_line = self.open_line();
                let contents = self.rows.finish(self.delimiter.name())?;
                Ok(Contents { open_line, ..contents })
            }
        }
    }

    /// That rows differ in length is no wonder where something stands above the table.
    fn above_or(&self, error: IoError) -> IoError {
        match error {
            IoError::Ragged { .. } => self.above().unwrap_or(error),
            other => other,
        }
    }

    /// That something stands above the table, if it does.
    fn above(&self) -> Option<IoError> {
        let Beginning { line, fields } = self.table?;
        let above = self.rows.first_line()? < line;
        above.then(|| IoError::AboveTable { file: self.file.clone(), line, fields })
    }
}

impl Stream<'_> {
    /// The fields of the next row, and its line.
    fn next(&mut self, into: &mut ByteRecord) -> io::Result<Option<u64>> {
        match self {
            Stream::Words(text) => {
                while let Some((line, content)) = text.next_line()? {
                    into.clear();
                    dialect::words(content).for_each(|word| into.push_field(word));
                    if into.get(0).is_some_and(|word| word[0] != COMMENT) {
                        return Ok(Some(line));
                    }
                }
                Ok(None)
            }
            Stream::Fields(reader) => {
                if !reader.read_byte_record(into).map_err(plain)? {
                    return Ok(None);
                }
                let from = into.position().map_or(0, csv::Position::line);
                Ok(Some(reader.get_mut().row_from(from)))
            }
        }
    }
}

/// What the operating system or the decompressor said, without the csv reader's words around it.
fn plain(error: csv::Error) -> io::Error {
    match error.into_kind() {
        csv::ErrorKind::Io(e) => e,
        other => io::Error::other(format!("{other:?}")),
    }
}
