//! Many records in one file, identified by a column.

use std::collections::BTreeSet;
use std::fs::File;
use std::ops::Range;
use std::path::Path;
use std::slice;

use ::parquet::basic::Type;
use ::parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use ::parquet::data_type::{AsBytes as _, DataType};
use ::parquet::file::reader::Length as _;

use super::read::{CHUNK_ROWS, Columns, Trouble, guarded, usable};
use crate::limits::{Budget, Limit, Limits, RECORD_BYTES};
use crate::standard::input_name;
use crate::{IoError, Table, escaped};

/// Parquet file whose rows are read on request.
///
/// Only the row groups and columns with the requested rows are read, so that the memory needed does
/// not grow with the file.
#[derive(Debug)]
pub struct ParquetFile {
    head: Table,
    columns: Columns<File>,
    limits: Limits,
    bytes: usize,
}

/// Rows of a file that belong to one record.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordRows {
    /// Value of the identifier column in these rows.
    pub id: String,
    /// The rows, counted from 0.
    pub rows: Range<usize>,
}

impl ParquetFile {
    /// Opens a file and reads the description of its columns.
    ///
    /// # Errors
    /// [`IoError::Read`] if there is no such file, [`IoError::Parquet`] if it is damaged or of
    /// another format, [`IoError::Empty`] without columns, [`IoError::TooLarge`].
    pub fn open(path: impl AsRef<Path>, limits: &Limits) -> Result<Self, IoError> {
        let file = input_name(path.as_ref());
        let open =
            || File::open(&path).map_err(|source| IoError::Read { file: file.clone(), source });
        let (source, same) = (open()?, open()?);
        let bytes = usize::try_from(source.len()).unwrap_or(usize::MAX);
        let read = guarded(|| {
            let columns = Columns::new(source, same)?;
            let budget = Budget::new(limits, bytes);
            let head = columns.contents(None, slice::from_ref(&(0..0)), budget)?.swap_remove(0);
            Ok((columns, head))
        });
        let (columns, head) = read.map_err(|trouble| trouble.error(&file))?;
        let head = usable(&file, head)?;
        head.check_names(&file, limits)?;
        let head = Table::from_contents(file.clone(), head);
        Ok(Self { head, columns, limits: *limits, bytes })
    }

    /// Returns the table without its rows: names, units and time axis of the columns.
    pub fn head(&self) -> &Table {
        &self.head
    }

    fn budget(&self) -> Budget {
        Budget::new(&self.limits, self.bytes)
    }

    /// Returns the memory, in bytes, that processing a record may use: [`Limits::memory`] for the
    /// size of the file.
    pub fn memory(&self) -> usize {
        self.limits.memory(self.bytes)
    }

    /// Returns the records that a column of texts or whole numbers identifies, in the order of
    /// their rows.
    ///
    /// # Errors
    /// [`IoError::MissingColumn`], [`IoError::RecordColumn`] if the column has another type or a
    /// missing value, [`IoError::RecordApart`] if the rows of a record are not consecutive,
    /// [`IoError::Parquet`].
    pub fn records(&self, column: &str) -> Result<Vec<RecordRows>, IoError> {
        let at = self.head.find(column)?;
        let (name_bytes, budget) = (self.limits.name_bytes, self.budget());
        let (records, known) = (Vec::new(), BTreeSet::new());
        let mut ids = Ids { records, known, rows: 0, refusal: None, name_bytes, budget };
        let trouble = guarded(|| {
            let whole = 0..self.columns.rows()?;
            let (groups, spans) = (self.columns.groups(), slice::from_ref(&whole));
            self.columns.visit(&groups, at, spans, &self.budget(), &mut |column, _, rows| {
                ids.read(column, rows)
            })
        });
        let file = || self.head.file().to_owned();
        match (ids.refusal, trouble) {
            (Some(Refusal::NoId), _) => {
                let what = match self.columns.description(at).physical_type() {
                    Type::INT32 | Type::INT64 | Type::BYTE_ARRAY => "nothing",
                    _ => "neither text nor a whole number",
                };
                let (column, row) = (self.head.label(at), ids.rows + 1);
                Err(IoError::RecordColumn { file: file(), column, row, what })
            }
            (Some(Refusal::Apart(id)), _) => {
                Err(IoError::RecordApart { file: file(), id, row: ids.rows + 1 })
            }
            (None, trouble) => {
                trouble.map_err(|trouble| trouble.error(self.head.file()))?;
                Ok(ids.records)
            }
        }
    }

    /// Reads consecutive records, each as a separate table; columns whose indices, counted from 0,
    /// are not in `wanted` have a name and no numbers (`None`: all are read).
    ///
    /// # Errors
    /// [`IoError::Parquet`] if the file is damaged, [`IoError::TooLarge`].
    pub fn tables(
        &self,
        wanted: Option<&[usize]>,
        records: &[RecordRows],
    ) -> Result<Vec<Table>, IoError> {
        let file = self.head.file();
        let spans: Vec<Range<usize>> = records.iter().map(|record| record.rows.clone()).collect();
        let contents = guarded(|| self.columns.contents(wanted, &spans, self.budget()));
        let contents = contents.map_err(|trouble| trouble.error(file))?.into_iter();
        let named = contents.zip(records).map(|(contents, record)| {
            let name = format!("{file} (record {})", escaped(&record.id));
            Ok(Table::from_contents(name, usable(file, contents)?))
        });
        named.collect()
    }
}

/// Identifiers read so far.
struct Ids {
    records: Vec<RecordRows>,
    known: BTreeSet<String>,
    rows: usize,
    refusal: Option<Refusal>,
    /// Maximum length of an identifier, in bytes.
    name_bytes: usize,
    /// Memory that the list of records may use.
    budget: Budget,
}

/// Reason why the rows cannot be divided into records; it applies to the row after the last row
/// that was read.
enum Refusal {
    NoId,
    /// The rows of this record are not consecutive.
    Apart(String),
}

impl Ids {
    /// Reads rows of the column; stops early at a row that cannot be used.
    fn read(&mut self, column: &mut ColumnReader, rows: usize) -> Result<(), Trouble> {
        match column {
            ColumnReader::Int32ColumnReader(column) => {
                self.read_ids(column, rows, |id| id.to_string())
            }
            ColumnReader::Int64ColumnReader(column) => {
                self.read_ids(column, rows, |id| id.to_string())
            }
            ColumnReader::ByteArrayColumnReader(column) => self
                .read_ids(column, rows, |id| String::from_utf8_lossy(id.as_bytes()).into_owned()),
            _ => self.refused(Refusal::NoId),
        }
    }

    fn read_ids<T: DataType>(
        &mut self,
        column: &mut ColumnReaderImpl<T>,
        rows: usize,
        text: impl Fn(&T::T) -> String,
    ) -> Result<(), Trouble> {
        let (mut levels, mut values) = (Vec::new(), Vec::new());
        let end = self.rows + rows;
        while self.rows < end {
            levels.clear();
            values.clear();
            let at_once = (end - self.rows).min(CHUNK_ROWS);
            let (read, ..) = column.read_records(at_once, Some(&mut levels), None, &mut values)?;
            if read == 0 {
                return Err(Trouble::Damaged("a column is shorter than its row group".into()));
            }
            let full = levels.iter().copied().max().unwrap_or_default();
            let complete = if values.len() == read {
                read
            } else {
                levels.iter().position(|level| *level < full).unwrap_or_default()
            };
            for run in values[..complete.min(values.len())].chunk_by(|a, b| a == b) {
                self.push(text(&run[0]), run.len())?;
            }
            if complete < read {
                return self.refused(Refusal::NoId);
            }
        }
        Ok(())
    }

    /// Appends `count` rows with the identifier `id`.
    fn push(&mut self, id: String, count: usize) -> Result<(), Trouble> {
        if id.len() > self.name_bytes {
            return Err(Trouble::TooLarge(self.rows, Limit::NameBytes(self.name_bytes)));
        }
        match self.records.last_mut().filter(|record| record.id == id) {
            Some(record) => record.rows.end += count,
            None if self.known.insert(id.clone()) => {
                let taken = self.budget.take_bytes(RECORD_BYTES + 2 * id.len());
                taken.map_err(|limit| Trouble::TooLarge(self.rows, limit))?;
                self.records.push(RecordRows { id, rows: self.rows..self.rows + count });
            }
            None => return self.refused(Refusal::Apart(id)),
        }
        self.rows += count;
        Ok(())
    }

    /// Stops the reading; [`ParquetFile::records`] reports the reason.
    fn refused(&mut self, refusal: Refusal) -> Result<(), Trouble> {
        self.refusal = Some(refusal);
        Err(Trouble::Damaged("its records cannot be distinguished".into()))
    }
}
