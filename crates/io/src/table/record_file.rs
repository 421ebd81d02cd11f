//! Records of any length, which are read repeatedly in blocks.

use std::fs;
use std::ops::{ControlFlow, Range};
use std::path::{Path, PathBuf};

use mechid_signal::Sampling;
use nalgebra::DMatrix;

use super::blocks::TextEnd;
use super::rows::Rows;
use super::source::{Kind, Source};
use super::text::{TextReader, Wanted};
use super::time_axis::{self, Steps};
use super::{FirstRows, Table, TimeAxis};
use crate::contents::{DecimalSign, Lines, Unusable};
use crate::limits::ReadOptions;
use crate::{IoError, standard};

/// Record file whose samples need not fit in memory.
///
/// A text with more rows than may be in memory is read again for each pass over its samples; the
/// memory needed does not grow with the file. Shorter texts, other formats, and sources that can be
/// read only once (a pipe) are kept in memory as a whole.
///
/// ```
/// use mechid_io::{IoError, ReadOptions, RecordFile, TimeAxis};
///
/// let path = std::env::temp_dir().join("mechid-record-file.csv");
/// std::fs::write(&path, "t,f\n0,1\n1,2\n2,3\n3,4\n4,5\n").unwrap();
/// let file = RecordFile::open(&path, &ReadOptions::default(), 2)?;
/// assert!(!file.is_whole());
/// let survey = file.survey(&TimeAxis::Column("t"), &["f"])?;
/// assert_eq!((survey.sampling.len(), survey.means[0]), (5, 3.0));
/// // Samples 2 to 5, two at a time.
/// let mut sums = Vec::new();
/// file.blocks(&["f"], 1..5, 2, 2, &mut |block| -> Result<(), IoError> {
///     sums.push(block.sum());
///     Ok(())
/// })?;
/// assert_eq!(sums, [5.0, 9.0]);
/// # std::fs::remove_file(path).unwrap();
/// # Ok::<(), IoError>(())
/// ```
#[derive(Debug)]
pub struct RecordFile {
    path: PathBuf,
    options: ReadOptions,
    /// All samples, or the first ones.
    pub(super) head: Table,
    whole: bool,
    /// Decimal sign of the first samples.
    decimal: Option<DecimalSign>,
    /// Memory that processing the record may use, in bytes.
    memory: usize,
}

/// Result of one pass over some columns.
#[derive(Debug, Clone, PartialEq)]
pub struct Survey {
    /// Time axis of the columns.
    pub sampling: Sampling,
    /// Mean of each column, in its unit.
    pub means: Vec<f64>,
    /// Largest magnitude of each column, in its unit.
    pub peaks: Vec<f64>,
    /// Notes about the file, as [`Table::remarks`].
    pub remarks: Vec<String>,
}

/// Consecutive rows of the columns of a file.
struct Chunk<'a> {
    /// Index of the first sample of the chunk, counted from 0.
    first: usize,
    columns: &'a [&'a [f64]],
    lines: &'a Lines,
}

/// Callback for a text that is read again in blocks. It receives the index of the first row of a
/// block, and the rows of the block; it returns whether to continue.
type TakeRows<'a, E> = dyn FnMut(usize, &Rows) -> Result<ControlFlow<()>, E> + 'a;

impl RecordFile {
    /// Opens a file, or standard input as `-`; at most `buffered_rows` rows of a text are kept in
    /// memory.
    ///
    /// # Errors
    /// As [`Table::read_with`].
    pub fn open(
        path: impl AsRef<Path>,
        options: &ReadOptions,
        buffered_rows: usize,
    ) -> Result<Self, IoError> {
        let path = path.as_ref().to_owned();
        let source = Source::open(&path)?;
        let file = !standard::is_input(&path) && fs::metadata(&path).is_ok_and(|m| m.is_file());
        let again = file && source.kind() == Kind::Text;
        let limit = if again { buffered_rows } else { usize::MAX };
        let FirstRows { table: head, is_whole: whole, decimal, stored } =
            Table::first_rows(source, options, limit)?;
        let whole_file = fs::metadata(&path).ok().filter(|_| file);
        let len = whole_file.map_or(0, |m| usize::try_from(m.len()).unwrap_or(usize::MAX));
        let stored = stored.bytes().max(len);
        let memory = options.limits.memory(stored);
        Ok(Self { path, options: *options, head, whole, decimal, memory })
    }

    /// Returns the memory, in bytes, that processing the record may use:
    /// [`Limits::memory`](crate::Limits::memory) for the size of the file.
    pub fn memory(&self) -> usize {
        self.memory
    }

    /// Creates a record file from a table in memory.
    pub fn from_table(table: Table) -> Self {
        let (path, options) = (PathBuf::from(table.file()), ReadOptions::default());
        let values = table.contents.columns.iter().filter_map(|column| column.values.as_ref().ok());
        let bytes = values.map(|values| size_of_val(values.as_slice())).sum();
        let memory = options.limits.memory(bytes);
        Self { path, options, head: table, whole: true, decimal: None, memory }
    }

    /// Sets the memory, in bytes, that processing the record may use.
    #[must_use]
    pub fn with_memory(self, memory: usize) -> Self {
        Self { memory, ..self }
    }

    /// Returns the table, with only the first samples if the file is not completely in memory.
    pub fn head(&self) -> &Table {
        &self.head
    }

    /// Sets the unit of a column, as [`Table::set_unit`] does.
    ///
    /// # Errors
    /// As [`Table::set_unit`].
    pub fn set_unit(&mut self, column: &str, unit: &str) -> Result<(), IoError> {
        self.head.set_unit(column, unit)
    }

    /// Sets the factor of a column, in SI units per unit of the column, as [`Table::set_scale`]
    /// does.
    ///
    /// # Errors
    /// As [`Table::set_scale`].
    pub fn set_scale(&mut self, column: &str, factor: f64) -> Result<(), IoError> {
        self.head.set_scale(column, factor)
    }

    /// Returns whether [`RecordFile::head`] has all samples.
    pub fn is_whole(&self) -> bool {
        self.whole
    }

    /// Removes the numbers of [`RecordFile::head`] from memory if the file is read again for each
    /// pass; names, units and remarks stay.
    pub fn forget_head(&mut self) {
        if self.whole {
            return;
        }
        for column in &mut self.head.contents.columns {
            if let Ok(values) = &mut column.values {
                *values = Vec::new();
            }
        }
    }

    /// Reads the columns `wanted` to the end and returns their time axis, means and peaks.
    ///
    /// # Errors
    /// As [`Table::record`].
    pub fn survey(
        &self,
        time: &TimeAxis<'_>,
        wanted: &[impl AsRef<str>],
    ) -> Result<Survey, IoError> {
        let mut columns = self.head.record_columns(time, wanted)?;
        let count = columns.len();
        let instants = match time {
            TimeAxis::Column(name) if !self.whole => Some(self.head.find(name)?),
            _ => None,
        };
        columns.extend(instants);
        let (mut len, mut sums, mut peaks) = (0, vec![0.0; count], vec![0.0_f64; count]);
        let mut lengths = vec![0; columns.len()];
        let mut steps = Steps::default();
        let end = self.chunks(&columns, &mut |chunk| {
            for (c, values) in chunk.columns[..count].iter().enumerate() {
                sums[c] = values.iter().fold(sums[c], |sum, v| sum + v);
                peaks[c] = values.iter().fold(peaks[c], |peak, v| peak.max(v.abs()));
            }
            if instants.is_some() {
                for (k, time) in (chunk.first..).zip(chunk.columns[count]) {
                    steps.push(*time, || chunk.lines.position(k));
                }
            }
            len = chunk.first + chunk.columns.first().map_or(0, |values| values.len());
            for (length, values) in lengths.iter_mut().zip(chunk.columns) {
                *length += values.len();
            }
            Ok::<_, IoError>(ControlFlow::Continue(()))
        })?;
        let sampling = match (self.whole, instants) {
            (true, _) => self.head.sampling(time, wanted)?,
            (false, Some(column)) => self.sampling_of(column, steps, lengths[count])?,
            (false, None) => match time {
                TimeAxis::RateHz(rate_hz) => time_axis::at_rate(self.head.file(), *rate_hz, len)?,
                // The header of the file may state the time axis; if it states none, this
                // expression returns the error.
                _ => self.head.signal(self.head.sampling(time, wanted)?.with_len(len))?,
            },
        };
        // The time column is checked first, as for a table in memory.
        let order = (count..columns.len()).chain(0..count);
        let order: Vec<_> = order.map(|c| (columns[c], lengths[c])).collect();
        time_axis::same_length(&self.head, &order)?;
        let means = sums.into_iter().map(|sum| sum / len as f64).collect();
        let mut remarks = self.head.remarks().to_vec();
        remarks.extend(end.and_then(TextEnd::remark));
        Ok(Survey { sampling, means, peaks, remarks })
    }

    /// Passes the samples `window` of the columns `wanted` to `take` in blocks of `rows` rows
    /// (samples × columns); each block begins `advance` rows after the previous one. The last block
    /// may be shorter.
    ///
    /// # Errors
    /// As [`Table::column`], [`IoError::Read`] if the file has become shorter, and those of `take`.
    ///
    /// # Panics
    /// If `rows` or `advance` is 0, or `advance` is more than `rows`.
    pub fn blocks<E: From<IoError>>(
        &self,
        wanted: &[impl AsRef<str>],
        window: Range<usize>,
        rows: usize,
        advance: usize,
        take: &mut dyn FnMut(DMatrix<f64>) -> Result<(), E>,
    ) -> Result<(), E> {
        let columns =
            wanted.iter().map(|w| self.head.find(w.as_ref())).collect::<Result<Vec<_>, _>>()?;
        self.blocks_at(&columns, window, rows, advance, take)
    }

    /// Passes samples as [`RecordFile::blocks`] does, of columns by their indices, counted from 0.
    ///
    /// # Errors
    /// As [`RecordFile::blocks`].
    ///
    /// # Panics
    /// As [`RecordFile::blocks`], and if there is no such column.
    pub fn blocks_at<E: From<IoError>>(
        &self,
        columns: &[usize],
        window: Range<usize>,
        rows: usize,
        advance: usize,
        take: &mut dyn FnMut(DMatrix<f64>) -> Result<(), E>,
    ) -> Result<(), E> {
        assert!(0 < advance && advance <= rows, "blocks of {rows} rows, {advance} apart");
        let mut buffered: Vec<Vec<f64>> = vec![Vec::new(); columns.len()];
        let (mut end, mut fresh) = (window.start, false);
        self.chunks(columns, &mut |chunk| {
            let last = chunk.first + chunk.columns.first().map_or(0, |values| values.len());
            let mut next = window.start.max(chunk.first);
            // A table in memory is a single chunk. A copy of the whole chunk would need the same
            // memory again, so it is copied in blocks.
            while next < last.min(window.end) {
                let upto = last.min(window.end).min(next + rows);
                for (values, column) in buffered.iter_mut().zip(chunk.columns) {
                    values.extend_from_slice(&column[next - chunk.first..upto - chunk.first]);
                }
                (next, end, fresh) = (upto, upto, true);
                while buffered.first().is_some_and(|values| values.len() >= rows) {
                    take(matrix(&buffered, rows))?;
                    buffered.iter_mut().for_each(|values| drop(values.drain(..advance)));
                    fresh = buffered.first().is_some_and(|values| values.len() > rows - advance);
                }
            }
            Ok::<_, E>(if last < window.end {
                ControlFlow::Continue(())
            } else {
                ControlFlow::Break(())
            })
        })?;
        if end < window.end {
            let source = std::io::ErrorKind::UnexpectedEof.into();
            return Err(IoError::Read { file: self.head.file().into(), source }.into());
        }
        match buffered.first().map_or(0, Vec::len) {
            rest if rest > 0 && fresh => take(matrix(&buffered, rest)),
            _ => Ok(()),
        }
    }

    /// Passes all samples of the columns with the indices `columns` to `take`, in order, until
    /// `take` breaks. Returns the end of the text if the text was read again.
    fn chunks<E: From<IoError>>(
        &self,
        columns: &[usize],
        take: &mut dyn FnMut(Chunk<'_>) -> Result<ControlFlow<()>, E>,
    ) -> Result<Option<TextEnd>, E> {
        if self.whole {
            let values = columns.iter().map(|c| self.head.values(*c));
            let values = values.collect::<Result<Vec<_>, _>>()?;
            let lines = &self.head.contents.lines;
            return take(Chunk { first: 0, columns: &values, lines }).map(|_| None);
        }
        let reader = self.rows(columns, &mut |first, rows| {
            let values = columns.iter().map(|c| rows.column(*c).values.as_deref().ok());
            match values.collect::<Option<Vec<_>>>() {
                Some(columns) => take(Chunk { first, columns: &columns, lines: rows.lines() }),
                None => Ok(ControlFlow::Continue(())),
            }
        })?;
        // The first unusable column is reported, as for a table in memory.
        for column in columns {
            if let Err(why) = &reader.rows().column(*column).values {
                return Err(self.unusable(*column, why).into());
            }
        }
        Ok(reader.end())
    }

    /// Reads the numbers of some columns of a text again, block by block, until `take` breaks. The
    /// returned reader has the reason if a column is unusable.
    pub(super) fn rows<E: From<IoError>>(
        &self,
        columns: &[usize],
        take: &mut TakeRows<'_, E>,
    ) -> Result<TextReader<'static>, E> {
        let mut once = columns.to_vec();
        once.sort_unstable();
        once.dedup();
        let wanted = Wanted { columns: Some(once), decimal: self.decimal };
        let mut reader = TextReader::open(Source::open(&self.path)?, &self.options, wanted)?;
        let mut first = 0;
        reader.read(&mut |rows| {
            let flow = take(first, rows)?;
            first = rows.samples();
            rows.forget();
            Ok::<_, E>(flow)
        })?;
        Ok(reader)
    }

    pub(super) fn unusable(&self, column: usize, why: &Unusable) -> IoError {
        why.error(self.head.file(), self.head.label(column))
    }
}

/// Returns the first rows of some columns.
fn matrix(columns: &[Vec<f64>], rows: usize) -> DMatrix<f64> {
    let mut matrix = DMatrix::zeros(rows, columns.len());
    for (mut into, column) in matrix.column_iter_mut().zip(columns) {
        into.copy_from_slice(&column[..rows]);
    }
    matrix
}
