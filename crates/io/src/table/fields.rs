//! Rows of a text and their fields.

use std::ops::Range;

use memchr::{memchr, memchr_iter};

use super::delimiter::{Delimiter, is_comment, words};

/// Quote around fields that contain delimiters or line breaks.
const QUOTE: u8 = b'"';

/// Separators of rows and fields.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Layout {
    pub delimiter: Delimiter,
    /// Last byte of a line: a line feed, or a carriage return in a text without line feeds.
    pub terminator: u8,
}

/// A row of a text that is neither empty nor a comment.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Row<'a> {
    /// Text without the end of its line.
    pub text: &'a [u8],
    /// Offset of the row in the text.
    pub at: usize,
    /// Number of line ends before the row in the text.
    pub line: u64,
    /// `true` if the row has a quote that may enclose a field.
    pub is_quoted: bool,
}

/// Iterator over the rows of a text; the first byte of the text begins a row.
#[derive(Debug, Clone)]
pub(crate) struct RowIter<'a> {
    text: &'a [u8],
    layout: Layout,
    /// `true` if quotes are interpreted.
    has_quotes: bool,
    at: usize,
    line: u64,
}

impl<'a> RowIter<'a> {
    pub fn new(text: &'a [u8], layout: Layout) -> Self {
        let has_quotes = layout.delimiter != Delimiter::Blanks && memchr(QUOTE, text).is_some();
        Self { text, layout, has_quotes, at: 0, line: 0 }
    }

    /// Returns the offset after the last complete row or line.
    pub fn complete(text: &'a [u8], layout: Layout) -> usize {
        let mut rows = Self::new(text, layout);
        if !rows.has_quotes {
            return memchr::memrchr(layout.terminator, text).map_or(0, |last| last + 1);
        }
        let mut complete = 0;
        while let Some((_, is_complete)) = rows.next_line() {
            if is_complete {
                complete = rows.at;
            }
        }
        complete
    }

    /// Returns the next row, empty line or comment, and whether it ends with a line break.
    fn next_line(&mut self) -> Option<(Row<'a>, bool)> {
        if self.at >= self.text.len() {
            return None;
        }
        let (at, line, rest) = (self.at, self.line, &self.text[self.at..]);
        let end_from = |from: usize| match memchr(self.layout.terminator, &rest[from..]) {
            Some(len) => (from + len, true),
            None => (rest.len(), false),
        };
        let (mut end, mut ended) = end_from(0);
        let mut is_quoted = false;
        self.line += 1;
        if let (true, Delimiter::Byte(delimiter)) = (self.has_quotes, self.layout.delimiter)
            && memchr(QUOTE, &rest[..end]).is_some()
            && !is_comment(&rest[..end], self.layout.delimiter)
        {
            is_quoted = true;
            let (mut state, mut from) = (State::FieldStart, 0);
            loop {
                state = state.after(&rest[from..end], delimiter);
                if state != State::Quoted || !ended {
                    break;
                }
                // This line break is inside the quotes, so it belongs to the field.
                from = end;
                (end, ended) = end_from(end + 1);
                self.line += 1;
            }
            ended &= state != State::Quoted;
        }
        self.at += if end < rest.len() { end + 1 } else { end };
        let mut text = &rest[..end];
        while let Some((b'\r', before)) = text.split_last() {
            text = before;
        }
        Some((Row { text, at, line, is_quoted }, ended))
    }
}

impl<'a> Iterator for RowIter<'a> {
    type Item = Row<'a>;

    fn next(&mut self) -> Option<Row<'a>> {
        loop {
            let (row, _) = self.next_line()?;
            let is_blank = row.text.iter().all(|b| *b == b' ');
            if !is_blank && !is_comment(row.text, self.layout.delimiter) {
                return Some(row);
            }
        }
    }
}

/// Position in a row relative to delimiters and quotes, as in RFC 4180 and in programs that extend
/// it: a quote counts only at the beginning of a field, two quotes within a quoted field stand for
/// one, and text after the closing quote belongs to the field.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    FieldStart,
    Plain,
    Quoted,
    /// After a quote within a quoted field.
    QuoteInQuoted,
}

impl State {
    fn next(self, byte: u8, delimiter: u8) -> Self {
        match (self, byte) {
            (Self::Quoted, QUOTE) => Self::QuoteInQuoted,
            (Self::Quoted, _) => Self::Quoted,
            (Self::FieldStart | Self::QuoteInQuoted, QUOTE) => Self::Quoted,
            (_, byte) if byte == delimiter => Self::FieldStart,
            _ => Self::Plain,
        }
    }

    fn after(self, text: &[u8], delimiter: u8) -> Self {
        text.iter().fold(self, |state, byte| state.next(*byte, delimiter))
    }
}

/// Fields of one row, without the blanks and the quotes around them.
#[derive(Debug, Default)]
pub(crate) struct Fields {
    text: Vec<u8>,
    ranges: Vec<Range<usize>>,
    /// `true` if blanks separate the fields and some fields contain blanks.
    pub is_joined: bool,
}

impl Fields {
    /// Makes fields of names that may contain blanks.
    pub fn joined(names: &[String]) -> Self {
        let mut fields = Self { is_joined: true, ..Self::default() };
        names.iter().for_each(|name| fields.push(name.as_bytes()));
        fields
    }

    /// Splits a row.
    pub fn split(&mut self, row: &[u8], delimiter: Delimiter) {
        self.text.clear();
        self.ranges.clear();
        match delimiter {
            Delimiter::Blanks => words(row).for_each(|word| self.push(word)),
            Delimiter::Byte(byte) if memchr(QUOTE, row).is_none() => {
                let mut from = 0;
                for at in memchr_iter(byte, row).chain([row.len()]) {
                    self.push(&row[from..at]);
                    from = at + 1;
                }
            }
            Delimiter::Byte(byte) => self.split_quoted(row, byte),
        }
    }

    fn split_quoted(&mut self, row: &[u8], delimiter: u8) {
        let mut state = State::FieldStart;
        let mut field = Vec::new();
        for (at, byte) in row.iter().enumerate() {
            // A line break inside a field is read as a line feed on every system.
            if *byte == b'\r' && row.get(at + 1) == Some(&b'\n') {
                continue;
            }
            let next = state.next(*byte, delimiter);
            match (state, next) {
                // This quote opens a field, or may close it.
                (State::FieldStart, State::Quoted) | (_, State::QuoteInQuoted) => {}
                (_, State::FieldStart) => {
                    self.push(&field);
                    field.clear();
                }
                _ => field.push(*byte),
            }
            state = next;
        }
        self.push(&field);
    }

    fn push(&mut self, field: &[u8]) {
        let from = self.text.len();
        self.text.extend_from_slice(field.trim_ascii());
        self.ranges.push(from..self.text.len());
    }

    /// Returns the number of fields.
    pub fn len(&self) -> usize {
        self.ranges.len()
    }

    /// Returns the number of fields up to the last one that is not empty.
    pub fn filled(&self) -> usize {
        self.ranges.iter().rposition(|range| !range.is_empty()).map_or(0, |last| last + 1)
    }

    /// Returns the field with this index; an empty text if there is no such field.
    pub fn get(&self, field: usize) -> &[u8] {
        self.ranges.get(field).map_or(&[], |range| &self.text[range.clone()])
    }

    pub fn iter(&self) -> impl Iterator<Item = &[u8]> {
        self.ranges.iter().map(|range| &self.text[range.clone()])
    }
}
