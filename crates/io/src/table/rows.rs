//! Rows of fields converted to columns of numbers; the text is not kept.

use std::collections::BTreeMap;

use super::batch::{BadRow, Batch, Plan};
use super::blocks::Block;
use super::dialect::{is_data, is_number};
use super::fields::{Fields, Layout, RowIter};
use super::heading::{self, Above};
use super::instant::{Clock, Instant};
use super::lvm::{self, LvmHeader};
use super::source::Stored;
use crate::IoError;
use crate::contents::{Axis, Column, Contents, DecimalSign, Lines, Place, Unusable};
use crate::limits::{Budget, Limit, Limits};

/// Columns that grow row by row.
#[derive(Debug)]
pub(super) struct Rows {
    file: String,
    layout: Layout,
    limits: Limits,
    /// Counter of the bytes of the file that were read.
    stored: Stored,
    /// Decimal sign of the numbers, if it is known.
    decimal: Option<DecimalSign>,
    /// Properties of the first row; `None` before it is read.
    first: Option<FirstRow>,
    columns: Vec<Column>,
    /// Columns to read; `None` before the first row if all are wanted.
    wanted: Option<Vec<usize>>,
    has_header: bool,
    has_units: bool,
    has_samples: bool,
    samples: usize,
    lines: Lines,
    /// Header of a LabVIEW measurement file.
    lvm: Option<LvmHeader>,
    /// Units that comments and rows above the table state in addition to the row of units, one list
    /// per comment or row. They are kept here until they are added to the units of the columns.
    further_units: Vec<Vec<String>>,
    /// Remarks on comments that were not read.
    remarks: Vec<String>,
    /// Reference day of the instants, for each column of instants, by the index of the column.
    origins: BTreeMap<usize, i64>,
    /// Clock, for each column of clock times without a date, by the index of the column.
    clocks: BTreeMap<usize, Clock>,
    /// Line and number of fields of each row of empty fields that is not followed by another row
    /// yet. At the end of the file such rows are ignored.
    empty: Vec<(u64, usize)>,
}

/// Line of the first row, and its numbers of fields, which all other rows must have.
#[derive(Debug, Clone, Copy)]
struct FirstRow {
    line: u64,
    /// Number of fields.
    width: usize,
    /// Number of fields up to the last one that is not empty.
    filled: usize,
}

impl Rows {
    /// Creates an empty reader of rows; it will read the columns `wanted`, by their indices, or
    /// all.
    pub fn new(
        file: String,
        layout: Layout,
        (limits, stored): (Limits, Stored),
        decimal: Option<DecimalSign>,
        wanted: Option<Vec<usize>>,
    ) -> Self {
        Self {
            file,
            layout,
            limits,
            stored,
            decimal,
            first: None,
            columns: Vec::new(),
            wanted,
            has_header: false,
            has_units: false,
            has_samples: false,
            samples: 0,
            lines: Lines::default(),
            lvm: None,
            further_units: Vec::new(),
            remarks: Vec::new(),
            origins: BTreeMap::new(),
            clocks: BTreeMap::new(),
            empty: Vec::new(),
        }
    }

    /// Adds units and time axes from the header of a LabVIEW measurement file.
    #[must_use]
    pub fn with_lvm(self, lvm: Option<LvmHeader>) -> Self {
        Self { lvm, ..self }
    }

    /// Returns the line of the first row, if there was one.
    pub fn first_line(&self) -> Option<u64> {
        self.first.map(|first| first.line)
    }

    /// Returns the number of columns.
    pub fn width(&self) -> usize {
        self.columns.len()
    }

    /// Returns the number of samples read so far.
    pub fn samples(&self) -> usize {
        self.samples
    }

    /// Returns the decimal sign of the numbers so far.
    pub fn decimal(&self) -> Option<DecimalSign> {
        self.decimal
    }

    /// Returns a column, by its index, with the samples since [`Rows::forget`].
    pub fn column(&self, column: usize) -> &Column {
        &self.columns[column]
    }

    /// Returns the line numbers of the samples since [`Rows::forget`].
    pub fn lines(&self) -> &Lines {
        &self.lines
    }

    /// Removes the samples read so far; their number and the reasons for unusable columns are kept.
    pub fn forget(&mut self) {
        for values in self.columns.iter_mut().filter_map(|column| column.values.as_mut().ok()) {
            values.clear();
        }
        self.lines.clear();
    }

    /// Keeps at most the first `samples` samples, counted from the beginning.
    pub fn truncate(&mut self, samples: usize) {
        for values in self.columns.iter_mut().filter_map(|column| column.values.as_mut().ok()) {
            values.truncate(samples);
        }
        self.samples = self.samples.min(samples);
    }

    /// Reads the names and units of the columns at the beginning of the text, until a row of
    /// samples follows; returns the offset of that row in the block.
    pub fn begin(&mut self, block: &Block) -> Result<usize, IoError> {
        if self.has_samples {
            return Ok(0);
        }
        if self.first.is_none()
            && let Some(at) = self.take_heading(block)?
        {
            return Ok(at);
        }
        let mut fields = Fields::default();
        for row in RowIter::new(&block.text, self.layout) {
            let line = block.line + row.line;
            if row.text.len() > self.limits.row_bytes {
                return Err(self.bad_row(BadRow::TooLong { line }));
            }
            fields.split(row.text, self.layout.delimiter);
            if fields.filled() == 0 {
                continue;
            }
            match self.first {
                None => {
                    self.take_first(line, &fields)?;
                    if self.has_header {
                        continue;
                    }
                }
                Some(_) => {
                    let fits = self.plan().check(line, fields.len(), fields.filled());
                    fits.map_err(|bad| self.bad_row(bad))?;
                    if !self.has_units && self.take_units(&fields) {
                        continue;
                    }
                }
            }
            self.begin_samples(&fields);
            return Ok(row.at);
        }
        Ok(block.text.len())
    }

    /// Reads names and units that are in several rows or in comments above the first row of
    /// numbers; returns the offset of that row in the block, or `None` if there is no such heading.
    fn take_heading(&mut self, block: &Block) -> Result<Option<usize>, IoError> {
        let rows = heading::first_rows(&block.text, self.layout);
        if rows.iter().any(|row| row.row.text.len() > self.limits.row_bytes) {
            return Ok(None);
        }
        let Above { heading, further_units, remarks } = Above::new(&block.text, &rows, self.layout);
        (self.further_units, self.remarks) = (further_units, remarks);
        let Some(heading) = heading else { return Ok(None) };
        let begin = &rows[heading.begin];
        let line = block.line + rows[heading.names_row.unwrap_or(heading.begin)].row.line;
        let width = begin.fields.len().max(heading.names.len());
        self.make_columns(line, width, heading.filled)?;
        self.has_header = true;
        self.has_units = !heading.units.is_empty();
        for (column, name) in self.columns.iter_mut().zip(heading.names) {
            column.filled = !name.is_empty();
            column.name = name;
        }
        for (column, unit) in self.columns.iter_mut().zip(heading.units) {
            column.about.clone_from(&unit);
            column.unit = unit;
        }
        self.begin_samples(&begin.fields);
        Ok(Some(begin.row.at))
    }

    /// Initialises the columns from the first row of numbers.
    fn begin_samples(&mut self, fields: &Fields) {
        for &column in self.wanted.iter().flatten() {
            self.columns[column].filled |= !fields.get(column).is_empty();
            let field = fields.get(column);
            let is_number = is_number(field, self.layout.delimiter);
            if let Some(instant) = Instant::parse(field).filter(|_| !is_number) {
                self.columns[column].has_instants = true;
                self.origins.insert(column, instant.day.unwrap_or(0));
                self.clocks.extend(instant.clock().map(|clock| (column, clock)));
            }
        }
        self.apply_lvm();
        self.add_further_units();
        self.has_samples = true;
    }

    /// Appends the units in comments and in further rows to the units of the columns, separated by
    /// a semicolon.
    fn add_further_units(&mut self) {
        for units in std::mem::take(&mut self.further_units) {
            for (column, unit) in self.columns.iter_mut().zip(units) {
                if unit.is_empty() || column.unit.split("; ").any(|known| known == unit) {
                    continue;
                }
                let separator = if column.unit.is_empty() { "" } else { "; " };
                column.unit = format!("{}{separator}{unit}", column.unit);
                column.about.clone_from(&column.unit);
            }
        }
    }

    /// Assigns the units and the time axes of a LabVIEW header to the columns.
    fn apply_lvm(&mut self) {
        let Some(lvm) = self.lvm.take() else { return };
        for (channel, unit) in lvm.units.iter().enumerate() {
            if let Some(column) = self.columns.get_mut(lvm.column(channel)) {
                column.unit.clone_from(unit);
                column.about.clone_from(unit);
            }
        }
        for channel in 0..self.columns.len() {
            let at = lvm.column(channel);
            let axis = match (lvm.instants, lvm.axes.get(channel)) {
                (lvm::Instants::No, Some((start, step))) if *step > 0.0 && start.is_finite() => {
                    Axis::Even { start: *start, step: *step }
                }
                (lvm::Instants::Each, _) => Axis::Column(at - 1),
                _ => continue,
            };
            let Some(column) = self.columns.get_mut(at) else { break };
            column.axis = axis;
        }
        // All columns of instants have the same name, so the second and further ones get a number.
        let instants = self.columns.iter_mut().filter(|column| column.name == lvm::X);
        for (number, column) in instants.enumerate().skip(1) {
            column.name = format!("{} {}", lvm::X, number + 1);
        }
    }

    /// Reads the number of columns from the first row and, if any of its fields is not a number,
    /// their names.
    fn take_first(&mut self, line: u64, fields: &Fields) -> Result<(), IoError> {
        self.make_columns(line, fields.len(), fields.filled())?;
        let is_name = |field: &[u8]| !field.is_empty() && !is_data(field, self.layout.delimiter);
        self.has_header = fields.iter().any(is_name);
        if self.has_header {
            for (column, field) in self.columns.iter_mut().zip(fields.iter()) {
                column.name = text_of(field);
                column.filled = !field.is_empty();
            }
        }
        Ok(())
    }

    /// Creates columns without names, for rows of `width` fields.
    fn make_columns(&mut self, line: u64, width: usize, filled: usize) -> Result<(), IoError> {
        if width > self.limits.columns {
            let (at, limit) = (Place::Line(line), Limit::Columns(self.limits.columns));
            return Err(IoError::TooLarge { file: self.file.clone(), at, limit });
        }
        self.first = Some(FirstRow { line, width, filled });
        let empty = || Column::named(String::new());
        self.columns = std::iter::repeat_with(empty).take(width).collect();
        self.wanted.get_or_insert_with(|| (0..width).collect());
        Ok(())
    }

    /// Reads the units of the columns, if the row below the names has no number at all.
    fn take_units(&mut self, fields: &Fields) -> bool {
        self.has_units =
            self.has_header && !fields.iter().any(|field| is_data(field, self.layout.delimiter));
        if self.has_units {
            for (column, field) in self.columns.iter_mut().zip(fields.iter()) {
                column.about = text_of(field);
                column.unit.clone_from(&column.about);
            }
        }
        self.has_units
    }

    /// Returns layout and decimal sign, as far as they are known before the next rows are read.
    pub fn plan(&self) -> Plan {
        let (width, filled) = self.first.map_or((0, 0), |first| (first.width, first.filled));
        let origins = match (self.origins.is_empty(), &self.wanted) {
            (false, Some(wanted)) => {
                wanted.iter().map(|column| self.origins.get(column).copied()).collect()
            }
            _ => Vec::new(),
        };
        Plan {
            origins,
            layout: self.layout,
            width,
            filled,
            wanted: self.wanted.clone().unwrap_or_default(),
            decimal: self.decimal,
            row_bytes: self.limits.row_bytes,
        }
    }

    /// Returns whether rows were read with the wrong decimal sign, because the rows before them had
    /// none.
    pub fn contradicts(&self, batch: &Batch) -> bool {
        self.decimal.is_some() && batch.decimal.is_some() && self.decimal != batch.decimal
    }

    /// Appends the rows of the next block.
    ///
    /// # Errors
    /// [`IoError::Ragged`] for a row with a wrong number of fields, [`IoError::TooLarge`] for a row
    /// that is too long.
    pub fn append(&mut self, batch: &mut Batch) -> Result<(), IoError> {
        log::trace!("row {}", self.samples + batch.samples);
        let plan = self.plan();
        if batch.samples > 0 {
            for (line, fields) in std::mem::take(&mut self.empty) {
                plan.check(line, fields, 0).map_err(|bad| self.bad_row(bad))?;
                for column in &plan.wanted {
                    let values = &mut self.columns[*column].values;
                    if values.is_ok() {
                        *values = Err(Unusable::Empty { line });
                    }
                }
                self.lines.push(self.samples, line);
                self.samples += 1;
            }
        }
        for (at, column) in plan.wanted.iter().enumerate() {
            if let Some(clock) = self.clocks.get_mut(column) {
                let times = batch.columns[at].iter_mut();
                times.for_each(|seconds| *seconds = clock.continued(*seconds));
            }
            let column = &mut self.columns[*column];
            match (&mut column.values, batch.unusable[at].take()) {
                (Err(_), _) => {}
                (values, Some(why)) => *values = Err(why),
                (Ok(values), None) if values.is_empty() => {
                    std::mem::swap(values, &mut batch.columns[at]);
                }
                (Ok(values), None) => values.extend_from_slice(&batch.columns[at]),
            }
        }
        self.lines.append(self.samples, &batch.lines);
        self.samples += batch.samples;
        self.empty.append(&mut batch.empty);
        self.decimal = self.decimal.or(batch.decimal);
        batch.bad_row.map_or(Ok(()), |bad| Err(self.bad_row(bad)))
    }

    fn bad_row(&self, bad: BadRow) -> IoError {
        let file = self.file.clone();
        match bad {
            BadRow::Ragged { line, fields } => {
                let expected = self.first.map_or(0, |first| first.filled);
                IoError::Ragged { file, line, got: fields, expected }
            }
            BadRow::TooLong { line } => {
                let limit = Limit::RowBytes(self.limits.row_bytes);
                IoError::TooLarge { file, at: Place::Line(line), limit }
            }
        }
    }

    /// Returns the columns with all samples since [`Rows::forget`].
    ///
    /// # Errors
    /// [`IoError::Empty`] without samples.
    pub fn finish(self) -> Result<Contents, IoError> {
        if self.samples == 0 {
            let finding = if self.has_header {
                "there is a header and nothing below it"
            } else {
                "it is empty"
            };
            return Err(IoError::Empty { file: self.file, found: finding });
        }
        let comma = match self.decimal {
            Some(DecimalSign::Comma) => ", decimal comma",
            _ => "",
        };
        Ok(Contents {
            format: format!("{}{comma}", self.layout.delimiter.name()),
            columns: self.columns,
            lines: self.lines,
            samples: self.samples,
            remarks: self.remarks,
            ..Contents::default()
        })
    }

    /// Returns an error if more numbers are in memory than the limit allows.
    pub fn check_numbers(&self) -> Result<(), IoError> {
        let width = self.wanted.as_ref().map_or(0, Vec::len);
        let numbers = self.samples.saturating_mul(width);
        let mut budget = Budget::new(&self.limits, self.stored.bytes());
        budget.take_numbers(numbers).map_err(|limit| {
            let at = self.lines.position(self.samples.saturating_sub(1));
            IoError::TooLarge { file: self.file.clone(), at, limit }
        })
    }
}

/// Converts a field to text from UTF-8, or otherwise from Latin-1, in which Windows spreadsheets
/// write `µm` and `m/s²`.
pub(super) fn text_of(field: &[u8]) -> String {
    match std::str::from_utf8(field) {
        Ok(text) => text.to_owned(),
        Err(_) => field.iter().map(|byte| char::from(*byte)).collect(),
    }
}
