//! The rows of a block as columns of numbers.

use memchr::{memchr, memchr_iter};

use super::blocks::Block;
use super::delimiter::{Delimiter, words};
use super::dialect::{Number, number};
use super::fields::{Fields, Layout, Row, RowIter};
use super::instant::Instant;
use crate::contents::{DecimalSign, Lines, Place, Unusable};

/// Maximum number of characters of a field that a message repeats.
const SHOWN: usize = 40;

/// Properties of a text that are known before its rows are read.
#[derive(Debug, Clone)]
pub(super) struct Plan {
    pub layout: Layout,
    /// Number of fields of the first row.
    pub width: usize,
    /// Number of fields of the first row up to the last one that is not empty.
    pub filled: usize,
    /// Indices of the columns to read, in rising order.
    pub wanted: Vec<usize>,
    /// Reference day of the instants of each wanted column, counted from 1970-01-01; `None` for
    /// columns of numbers. Empty if no column has instants.
    pub origins: Vec<Option<i64>>,
    /// Decimal sign of all numbers, if it is known.
    pub decimal: Option<DecimalSign>,
    pub row_bytes: usize,
}

/// Row that cannot be read: it has another number of fields than the first row, or too many bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum BadRow {
    /// A row whose number of fields differs from that of the first row.
    Ragged { line: u64, fields: usize },
    /// A row that is too long.
    TooLong { line: u64 },
}

/// The rows of one block.
#[derive(Debug, Default)]
pub(super) struct Batch {
    /// Number of samples.
    pub samples: usize,
    /// Numbers of the wanted columns; an unusable column has fewer than `samples` numbers.
    pub columns: Vec<Vec<f64>>,
    /// Reason why a wanted column cannot be used.
    pub unusable: Vec<Option<Unusable>>,
    /// Line numbers of the samples.
    pub lines: Lines,
    /// Line and number of fields of each row of empty fields at the end of the block. These rows
    /// count as samples only if other rows follow.
    pub empty: Vec<(u64, usize)>,
    /// The row at which reading stopped.
    pub bad_row: Option<BadRow>,
    /// Decimal sign of all numbers so far.
    pub decimal: Option<DecimalSign>,
    /// Fields of a row with quotes.
    fields: Fields,
    /// Buffer for a number whose comma is replaced by a point.
    with_point: String,
    /// Faults in the fields of the current row, by the index of the wanted column.
    faults: Vec<(usize, Unusable)>,
}

impl Batch {
    /// Reads the rows of a block, beginning at an offset.
    pub fn read(&mut self, plan: &Plan, block: &Block, offset: usize) {
        self.clear(plan);
        let (above, text) = block.text.split_at(offset);
        let line = block.line + memchr_iter(plan.layout.terminator, above).count() as u64;
        for row in RowIter::new(text, plan.layout) {
            let row = Row { line: line + row.line, ..row };
            self.bad_row = self.take(plan, &row).err();
            if self.bad_row.is_some() {
                return;
            }
        }
    }

    fn clear(&mut self, plan: &Plan) {
        self.samples = 0;
        self.columns.resize_with(plan.wanted.len(), Vec::new);
        self.columns.iter_mut().for_each(Vec::clear);
        self.unusable.clear();
        self.unusable.resize(plan.wanted.len(), None);
        self.lines.clear();
        self.empty.clear();
        self.bad_row = None;
        self.decimal = plan.decimal;
    }

    fn take(&mut self, plan: &Plan, row: &Row<'_>) -> Result<(), BadRow> {
        let line = row.line;
        if row.text.len() > plan.row_bytes {
            return Err(BadRow::TooLong { line });
        }
        self.faults.clear();
        let (fields, filled) = match plan.layout.delimiter {
            _ if row.is_quoted => self.quoted(plan, row),
            Delimiter::Byte(delimiter) => self.delimited(plan, row, delimiter),
            Delimiter::Blanks => self.words(plan, row),
        };
        if filled == 0 {
            self.empty.push((line, fields));
            return Ok(());
        }
        for (line, fields) in std::mem::take(&mut self.empty) {
            plan.check(line, fields, 0)?;
            self.unusable.iter_mut().for_each(|why| {
                why.get_or_insert(Unusable::Empty { line });
            });
            self.lines.push(self.samples, line);
            self.samples += 1;
        }
        plan.check(line, fields, filled)?;
        for (column, fault) in self.faults.drain(..) {
            self.unusable[column].get_or_insert(fault);
        }
        self.lines.push(self.samples, line);
        self.samples += 1;
        Ok(())
    }

    /// Reads fields separated by a delimiter; returns their number, and the number up to the last
    /// field that is not empty.
    fn delimited(&mut self, plan: &Plan, row: &Row<'_>, delimiter: u8) -> (usize, usize) {
        let mut wanted = plan.wanted.iter().copied().enumerate().peekable();
        let (mut rest, mut fields, mut filled) = (row.text, 0, 0);
        loop {
            let column = wanted.next_if(|(_, field)| *field == fields).map(|(column, _)| column);
            fields += 1;
            let number = column.and_then(|column| {
                if plan.origin(column).is_some() {
                    return None;
                }
                let (value, len) = plain_number(rest)?;
                let is_whole = rest.get(len).is_none_or(|next| *next == delimiter);
                (is_whole && self.accept(column, value, &rest[..len])).then_some(len)
            });
            let len = match number {
                Some(len) => {
                    filled = fields;
                    len
                }
                None => {
                    let len = memchr(delimiter, rest).unwrap_or(rest.len());
                    let field = rest[..len].trim_ascii();
                    if !field.is_empty() {
                        filled = fields;
                    }
                    if let Some(column) = column {
                        self.field(plan, row.line, column, field);
                    }
                    len
                }
            };
            match rest.get(len + 1..) {
                Some(behind) => rest = behind,
                None if len < rest.len() => rest = &[],
                None => return (fields, filled),
            }
        }
    }

    /// Reads fields separated by blanks; such fields cannot be empty.
    fn words(&mut self, plan: &Plan, row: &Row<'_>) -> (usize, usize) {
        let mut wanted = plan.wanted.iter().copied().enumerate().peekable();
        let mut fields = 0;
        for word in words(row.text) {
            let column = wanted.next_if(|(_, field)| *field == fields);
            fields += 1;
            if let Some((column, _)) = column {
                let number = plain_number(word)
                    .filter(|(_, len)| *len == word.len() && plan.origin(column).is_none());
                if !number.is_some_and(|(value, _)| self.accept(column, value, word)) {
                    self.field(plan, row.line, column, word);
                }
            }
        }
        // `Plan::check` reports fields that are missing.
        (fields, fields)
    }

    fn quoted(&mut self, plan: &Plan, row: &Row<'_>) -> (usize, usize) {
        let mut fields = std::mem::take(&mut self.fields);
        fields.split(row.text, plan.layout.delimiter);
        for (column, field) in plan.wanted.iter().enumerate() {
            self.field(plan, row.line, column, fields.get(*field));
        }
        let counts = (fields.len(), fields.filled());
        self.fields = fields;
        counts
    }

    /// Accepts a number that needs no further check: finite, and with the decimal sign of the file.
    fn accept(&mut self, column: usize, value: f64, text: &[u8]) -> bool {
        let has_usual_sign =
            self.decimal == Some(DecimalSign::Point) || memchr(b'.', text).is_none();
        let is_plain = value.is_finite() && has_usual_sign;
        if is_plain && self.unusable[column].is_none() {
            self.columns[column].push(value);
        }
        is_plain
    }

    /// Reads a field of a wanted column; a field that cannot be used is added to `faults`.
    fn field(&mut self, plan: &Plan, line: u64, column: usize, field: &[u8]) {
        if self.unusable[column].is_some() {
            return;
        }
        if let Some(origin) = plan.origin(column) {
            match Instant::parse(field) {
                Some(instant) => self.columns[column].push(instant.since(origin)),
                None if field.is_empty() => self.faults.push((column, Unusable::Empty { line })),
                None => self.faults.push((column, Unusable::Text { line, text: shown(field) })),
            }
            return;
        }
        match number(field, plan.layout.delimiter, &mut self.with_point) {
            Some(Number { value, .. }) if !value.is_finite() => {
                let at = Place::Line(line);
                self.faults.push((column, Unusable::NotFinite { at, value }));
            }
            Some(Number { value, sign })
                if sign.is_none_or(|s| s == *self.decimal.get_or_insert(s)) =>
            {
                self.columns[column].push(value);
            }
            // The decimal sign of this number differs from that of the rest of the file.
            Some(Number { sign, .. }) => {
                let sign = match sign {
                    Some(DecimalSign::Comma) => DecimalSign::Point,
                    _ => DecimalSign::Comma,
                };
                let text = shown(field);
                self.faults.push((column, Unusable::DecimalSign { line, text, sign }));
            }
            None if field.is_empty() => self.faults.push((column, Unusable::Empty { line })),
            None => self.faults.push((column, Unusable::Text { line, text: shown(field) })),
        }
    }
}

impl Plan {
    /// Returns the reference day of the instants of a wanted column; `None` for a column of
    /// numbers.
    fn origin(&self, column: usize) -> Option<i64> {
        self.origins.get(column).copied().flatten()
    }

    /// Checks the number of fields of a row. A different number of empty fields at the end is
    /// accepted: some programs end only some of the lines with a delimiter.
    pub fn check(&self, line: u64, fields: usize, filled: usize) -> Result<(), BadRow> {
        if fields < self.filled || filled > self.width {
            return Err(BadRow::Ragged { line, fields });
        }
        Ok(())
    }
}

/// Returns the number at the beginning of a text, and its length including the blanks around it.
fn plain_number(text: &[u8]) -> Option<(f64, usize)> {
    let blanks = text.iter().take_while(|b| **b == b' ').count();
    let (value, len) = fast_float2::parse_partial(&text[blanks..]).ok()?;
    let end = blanks + len;
    Some((value, end + text[end..].iter().take_while(|b| **b == b' ').count()))
}

fn shown(field: &[u8]) -> String {
    String::from_utf8_lossy(field).chars().take(SHOWN).collect()
}
