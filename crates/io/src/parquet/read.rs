//! Columns of numbers from Parquet files, row group by row group.

use std::cell::OnceCell;
use std::collections::BTreeMap;
use std::fmt;
use std::fs::File;
use std::ops::Range;
use std::path::Path;

use ::parquet::basic::{ConvertedType, LogicalType, TimeUnit, Type};
use ::parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use ::parquet::data_type::DataType;
use ::parquet::errors::ParquetError;
use ::parquet::file::metadata::{ColumnChunkMetaData, FileMetaData};
use ::parquet::file::reader::{ChunkReader, FileReader, RowGroupReader, SerializedFileReader};
use ::parquet::record::reader::RowIter;
use ::parquet::schema::types::ColumnDescriptor;
use bytes::Bytes;

use super::footer;
use super::pages::{bytes_of, largest_page};
use super::panic::caught;
use crate::IoError;
use crate::contents::{Column, Contents, Place};
use crate::limits::{Budget, Limit};
use crate::standard::input_name;
use crate::stated_rates::with_stated_rates;

/// Number of rows decoded at a time.
pub(super) const CHUNK_ROWS: usize = 1 << 16;

/// Key of the units of the columns: a JSON object such as `{"x": "mm"}`.
const UNITS: &str = "units";

/// Key under which pandas writes the attributes of a table, as JSON.
const PANDAS_ATTRIBUTES: &str = "PANDAS_ATTRS";

/// Reads the columns of a file.
pub(crate) fn read(file: &str, bytes: Vec<u8>, budget: Budget) -> Result<Contents, IoError> {
    let bytes = Bytes::from(bytes);
    let contents = guarded(|| {
        let columns = Columns::new(bytes.clone(), bytes)?;
        let whole = 0..columns.rows()?;
        let mut contents = columns.contents(None, std::slice::from_ref(&whole), budget)?;
        Ok(contents.swap_remove(0))
    });
    contents.map_err(|trouble| trouble.error(file)).and_then(|contents| usable(file, contents))
}

/// Adds the rate that a file states to its contents; returns an error if there is no column.
pub(super) fn usable(file: &str, contents: Contents) -> Result<Contents, IoError> {
    if contents.columns.is_empty() {
        return Err(IoError::Empty { file: file.into(), found: "there is no column" });
    }
    Ok(with_stated_rates(contents).with_usual_length())
}

/// Reads the keys and values in the metadata of a Parquet file, without its columns.
///
/// # Errors
/// [`IoError::Read`] if there is no such file, [`IoError::Parquet`] if it is damaged or of another
/// format.
pub fn read_parquet_metadata(path: impl AsRef<Path>) -> Result<Vec<(String, String)>, IoError> {
    let file = input_name(path.as_ref());
    let opened = File::open(path).map_err(|source| IoError::Read { file: file.clone(), source })?;
    guarded(|| Ok(pairs(reader(opened)?.metadata().file_metadata())))
        .map_err(|trouble| trouble.error(&file))
}

/// Reason why the reading stops.
pub(super) enum Trouble {
    /// The file contradicts itself.
    Damaged(String),
    /// Number of rows that were read before the reading stopped, and the limit that the file
    /// exceeds.
    TooLarge(usize, Limit),
}

impl From<ParquetError> for Trouble {
    fn from(error: ParquetError) -> Self {
        Self::Damaged(match error {
            ParquetError::General(what) | ParquetError::EOF(what) => what,
            other => other.to_string(),
        })
    }
}

impl Trouble {
    /// Returns the same reason, with the number of rows that were read before the reading stopped.
    fn after(self, rows: usize) -> Self {
        match self {
            Self::TooLarge(_, limit) => Self::TooLarge(rows, limit),
            other => other,
        }
    }

    /// Returns the reason as an error of the file.
    pub fn error(self, file: &str) -> IoError {
        let file = file.to_owned();
        match self {
            Self::Damaged(what) => IoError::Parquet { file, what },
            Self::TooLarge(rows, limit) => {
                IoError::TooLarge { file, at: Place::Sample(rows + 1), limit }
            }
        }
    }
}

/// Reads a part of a file; a panic of the decoder, which damaged files can cause, becomes an error.
pub(super) fn guarded<T>(read: impl FnOnce() -> Result<T, Trouble>) -> Result<T, Trouble> {
    caught(read)
        .unwrap_or_else(|| Err(Trouble::Damaged("its contents contradict each other".into())))
}

fn reader<R: ChunkReader + 'static>(source: R) -> Result<SerializedFileReader<R>, Trouble> {
    if !footer::is_possible(&source) {
        return Err(Trouble::Damaged("the footer contradicts the length of the file".into()));
    }
    Ok(SerializedFileReader::new(source)?)
}

/// The columns of an open file.
pub(super) struct Columns<R: ChunkReader + 'static> {
    source: R,
    reader: SerializedFileReader<R>,
}

impl<R: ChunkReader + 'static> fmt::Debug for Columns<R> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Columns").field("metadata", self.reader.metadata()).finish_non_exhaustive()
    }
}

impl<R: ChunkReader + 'static> Columns<R> {
    /// Reads the description of the columns; `source` and `same` are the same file.
    pub fn new(source: R, same: R) -> Result<Self, Trouble> {
        Ok(Self { source, reader: reader(same)? })
    }

    /// Returns the number of rows.
    pub fn rows(&self) -> Result<usize, Trouble> {
        let rows = self.group_rows().try_fold(0_usize, |sum, rows| sum.checked_add(rows?));
        rows.ok_or_else(|| Trouble::Damaged("the row groups have an impossible size".into()))
    }

    /// Returns the readers of the row groups, each created when it is first used.
    pub fn groups(&self) -> Groups<'_> {
        let count = self.reader.metadata().num_row_groups();
        Groups { reader: &self.reader, known: (0..count).map(|_| OnceCell::new()).collect() }
    }

    /// Returns the numbers of rows of the row groups; `None` for a negative one.
    fn group_rows(&self) -> impl Iterator<Item = Option<usize>> {
        self.reader
            .metadata()
            .row_groups()
            .iter()
            .map(|group| usize::try_from(group.num_rows()).ok())
    }

    /// Reads consecutive spans of rows, each as the contents of a separate file; columns whose
    /// indices are not in `wanted` get a name but no numbers.
    pub fn contents(
        &self,
        wanted: Option<&[usize]>,
        spans: &[Range<usize>],
        mut budget: Budget,
    ) -> Result<Vec<Contents>, Trouble> {
        let metadata = self.reader.metadata().file_metadata();
        let stated = Stated::from_metadata(metadata);
        let empty = || Contents {
            format: "Parquet".into(),
            scalars: stated.numbers.clone(),
            ..Contents::default()
        };
        let mut contents: Vec<Contents> = spans.iter().map(|_| empty()).collect();
        let groups = self.groups();
        for (at, description) in metadata.schema_descr().columns().iter().enumerate() {
            budget.take_column().map_err(|limit| Trouble::TooLarge(0, limit))?;
            let name = description.path().parts().join(".");
            let about = stated.units.get(&name).cloned().unwrap_or_default();
            let columns: Vec<Column> = match Kind::from_column(description) {
                Err(what) => {
                    let root = description.path().parts().first().cloned().unwrap_or_default();
                    // All columns inside a list have the name of the list.
                    let name = if description.max_rep_level() > 0 { root } else { name };
                    spans.iter().map(|_| Column::unusable(name.clone(), what)).collect()
                }
                Ok(_) if wanted.is_some_and(|wanted| !wanted.contains(&at)) => spans
                    .iter()
                    .map(|_| Column::unusable(name.clone(), "numbers not read"))
                    .collect(),
                Ok(kind) => {
                    let values = self.numbers(&groups, at, kind, spans, &mut budget)?.into_iter();
                    values.map(|values| Column::from_numbers(name.clone(), values)).collect()
                }
            };
            for (contents, column) in contents.iter_mut().zip(columns) {
                contents.columns.push(Column {
                    about: about.clone(),
                    unit: about.clone(),
                    ..column
                });
            }
        }
        Ok(contents)
    }

    /// Reads spans of rows of a column of numbers.
    fn numbers(
        &self,
        groups: &Groups<'_>,
        at: usize,
        kind: Kind,
        spans: &[Range<usize>],
        budget: &mut Budget,
    ) -> Result<Vec<Vec<f64>>, Trouble> {
        let mut values: Vec<Vec<f64>> = vec![Vec::new(); spans.len()];
        let mut first = vec![None; spans.len()];
        self.visit(groups, at, spans, &budget.clone(), &mut |column, span, rows| {
            budget
                .take_numbers(rows)
                .map_err(|limit| Trouble::TooLarge(values[span].len(), limit))?;
            kind.append(column, rows, &mut first[span], &mut values[span])
        })?;
        Ok(values)
    }

    /// Passes a column to `take` for every range of rows within one span and one row group. The
    /// other arguments of `take` are the index of the span and the number of rows; `take` must read
    /// these rows.
    pub fn visit(
        &self,
        groups: &Groups<'_>,
        at: usize,
        spans: &[Range<usize>],
        budget: &Budget,
        take: &mut dyn FnMut(&mut ColumnReader, usize, usize) -> Result<(), Trouble>,
    ) -> Result<(), Trouble> {
        let mut start = 0_usize;
        for (group, rows) in self.group_rows().enumerate() {
            let negative = || Trouble::Damaged("a row group has a negative number of rows".into());
            let end = rows.and_then(|rows| start.checked_add(rows)).ok_or_else(negative)?;
            let within = |span: &Range<usize>| span.start.max(start)..span.end.min(end);
            if spans.iter().any(|span| !within(span).is_empty()) {
                let described = self.reader.metadata().row_group(group).column(at);
                self.check_pages(described, budget).map_err(|trouble| trouble.after(start))?;
                let mut column = groups.get(group)?.get_column_reader(at)?;
                let mut position = start;
                for (index, span) in spans.iter().enumerate() {
                    let rows = within(span);
                    if !rows.is_empty() {
                        skip(&mut column, rows.start - position)?;
                        take(&mut column, index, rows.len())?;
                        position = rows.end;
                    }
                }
            }
            start = end;
        }
        Ok(())
    }

    /// Refuses a column whose pages are outside the file, or larger than the memory limit.
    fn check_pages(&self, column: &ColumnChunkMetaData, budget: &Budget) -> Result<(), Trouble> {
        let damaged = || Trouble::Damaged("the pages of a column contradict its size".into());
        let len = usize::try_from(self.source.len()).unwrap_or(usize::MAX);
        let pages = bytes_of(column, len).ok_or_else(damaged)?;
        let pages = self.source.get_bytes(pages.start as u64, pages.len())?;
        let (allowed, limit) = budget.unpacked_bytes();
        if largest_page(&pages).ok_or_else(damaged)? > allowed {
            return Err(Trouble::TooLarge(0, limit));
        }
        Ok(())
    }

    /// Refuses a file if any column has pages outside the file, or pages larger than the memory
    /// limit.
    pub fn check_all_pages(&self, budget: &mut Budget) -> Result<(), Trouble> {
        for group in self.reader.metadata().row_groups() {
            for column in group.columns() {
                let values = usize::try_from(column.num_values()).unwrap_or(usize::MAX);
                budget.take_numbers(values).map_err(|limit| Trouble::TooLarge(0, limit))?;
                self.check_pages(column, budget)?;
            }
        }
        Ok(())
    }

    /// Returns the rows, cell by cell.
    pub fn row_cells(&self) -> Result<RowIter<'_>, Trouble> {
        Ok(self.reader.get_row_iter(None)?)
    }

    /// Returns the description of a column.
    pub fn description(&self, at: usize) -> &ColumnDescriptor {
        &self.reader.metadata().file_metadata().schema_descr().columns()[at]
    }
}

/// Readers of the row groups. Each reader is created only once, because its creation takes time for
/// each column.
pub(super) struct Groups<'a> {
    reader: &'a dyn FileReader,
    known: Vec<OnceCell<Box<dyn RowGroupReader + 'a>>>,
}

impl<'a> Groups<'a> {
    fn get(&self, group: usize) -> Result<&(dyn RowGroupReader + 'a), Trouble> {
        let known = &self.known[group];
        if known.get().is_none() {
            let _ = known.set(self.reader.get_row_group(group)?);
        }
        known.get().map(|reader| &**reader).ok_or_else(short)
    }
}

/// Skips rows of a column.
fn skip(column: &mut ColumnReader, rows: usize) -> Result<(), Trouble> {
    let skipped = match column {
        ColumnReader::BoolColumnReader(column) => column.skip_records(rows),
        ColumnReader::Int32ColumnReader(column) => column.skip_records(rows),
        ColumnReader::Int64ColumnReader(column) => column.skip_records(rows),
        ColumnReader::Int96ColumnReader(column) => column.skip_records(rows),
        ColumnReader::FloatColumnReader(column) => column.skip_records(rows),
        ColumnReader::DoubleColumnReader(column) => column.skip_records(rows),
        ColumnReader::ByteArrayColumnReader(column) => column.skip_records(rows),
        ColumnReader::FixedLenByteArrayColumnReader(column) => column.skip_records(rows),
    }?;
    if skipped == rows { Ok(()) } else { Err(short()) }
}

fn short() -> Trouble {
    Trouble::Damaged("a column is shorter than its row group".into())
}

/// Meaning of the numbers of a column.
#[derive(Clone, Copy)]
enum Kind {
    /// Numbers without conversion.
    Plain,
    /// Unsigned integers.
    Unsigned,
    /// Instants in integer units, with the number of units per second. They are read as seconds
    /// after the first instant, because an f64 has too few digits for seconds since 1970 with the
    /// resolution of a sampling step.
    Instants(f64),
}

impl Kind {
    /// Returns the kind of a column, or as an error a description of its contents if they are not
    /// real numbers.
    fn from_column(column: &ColumnDescriptor) -> Result<Self, &'static str> {
        if column.max_rep_level() > 0 {
            return Err("lists");
        }
        let kind = match (column.logical_type_ref(), column.converted_type()) {
            (Some(LogicalType::Timestamp(stamp)), _) => Self::Instants(per_second(&stamp.unit)),
            (Some(LogicalType::Time(time)), _) => Self::Instants(per_second(&time.unit)),
            (_, ConvertedType::TIMESTAMP_MILLIS | ConvertedType::TIME_MILLIS) => {
                Self::Instants(1e3)
            }
            (_, ConvertedType::TIMESTAMP_MICROS | ConvertedType::TIME_MICROS) => {
                Self::Instants(1e6)
            }
            (Some(LogicalType::Decimal(_)), _) | (_, ConvertedType::DECIMAL) => {
                return Err("decimal numbers (write them as float64)");
            }
            (Some(LogicalType::Date), _) | (_, ConvertedType::DATE) => return Err("dates"),
            (Some(LogicalType::Integer(integer)), _) if !integer.is_signed => Self::Unsigned,
            (
                _,
                ConvertedType::UINT_8
                | ConvertedType::UINT_16
                | ConvertedType::UINT_32
                | ConvertedType::UINT_64,
            ) => Self::Unsigned,
            _ => Self::Plain,
        };
        match column.physical_type() {
            Type::INT32 | Type::INT64 | Type::FLOAT | Type::DOUBLE => Ok(kind),
            Type::BOOLEAN => Err("truth values"),
            Type::INT96 => Err("times in an old format (write them as timestamps)"),
            Type::BYTE_ARRAY => Err("text"),
            Type::FIXED_LEN_BYTE_ARRAY => Err("bytes"),
        }
    }

    /// Appends the rows of a row group; `first` is the first instant of the column.
    fn append(
        self,
        column: &mut ColumnReader,
        rows: usize,
        first: &mut Option<i64>,
        into: &mut Vec<f64>,
    ) -> Result<(), Trouble> {
        let mut integer = |value: i64, unsigned: f64| match self {
            Self::Plain => value as f64,
            Self::Unsigned => unsigned,
            Self::Instants(per_second) => {
                let from = i128::from(*first.get_or_insert(value));
                (i128::from(value) - from) as f64 / per_second
            }
        };
        match column {
            ColumnReader::DoubleColumnReader(column) => append(column, rows, |v| *v, into),
            ColumnReader::FloatColumnReader(column) => {
                append(column, rows, |v| f64::from(*v), into)
            }
            ColumnReader::Int32ColumnReader(column) => {
                let value = |v: &i32| integer(i64::from(*v), f64::from(v.cast_unsigned()));
                append(column, rows, value, into)
            }
            ColumnReader::Int64ColumnReader(column) => {
                append(column, rows, |v| integer(*v, v.cast_unsigned() as f64), into)
            }
            _ => Err(Trouble::Damaged(
                "a column does not have the type that the file states for it".into(),
            )),
        }
    }
}

fn per_second(unit: &TimeUnit) -> f64 {
    match unit {
        TimeUnit::MILLIS => 1e3,
        TimeUnit::MICROS => 1e6,
        TimeUnit::NANOS => 1e9,
    }
}

/// Appends rows as numbers, with NaN for missing values.
fn append<T: DataType>(
    column: &mut ColumnReaderImpl<T>,
    rows: usize,
    mut number: impl FnMut(&T::T) -> f64,
    into: &mut Vec<f64>,
) -> Result<(), Trouble> {
    let (mut levels, mut values) = (Vec::new(), Vec::new());
    let mut remaining = rows;
    while remaining > 0 {
        levels.clear();
        values.clear();
        let at_once = remaining.min(CHUNK_ROWS);
        let (read, ..) = column.read_records(at_once, Some(&mut levels), None, &mut values)?;
        if read == 0 {
            return Err(short());
        }
        if values.len() == read {
            into.extend(values.iter().map(&mut number));
        } else {
            let full = levels.iter().copied().max().unwrap_or_default();
            let mut present = values.iter();
            into.extend(levels.iter().map(|level| {
                if *level == full { present.next().map_or(f64::NAN, &mut number) } else { f64::NAN }
            }));
        }
        remaining -= read.min(remaining);
    }
    Ok(())
}

/// Key-value metadata of a file.
struct Stated {
    numbers: Vec<(String, f64)>,
    /// Unit of each column, by the name of the column.
    units: BTreeMap<String, String>,
}

impl Stated {
    fn from_metadata(metadata: &FileMetaData) -> Self {
        let mut stated = Self { numbers: Vec::new(), units: BTreeMap::new() };
        for (key, value) in pairs(metadata) {
            let json = serde_json::from_str(&value);
            match (key.as_str(), json) {
                (PANDAS_ATTRIBUTES, Ok(serde_json::Value::Object(attributes))) => {
                    attributes.into_iter().for_each(|(key, value)| stated.add(key, value));
                }
                (_, Ok(value)) => stated.add(key, value),
                (_, Err(_)) => {}
            }
        }
        stated
    }

    fn add(&mut self, key: String, value: serde_json::Value) {
        match value {
            serde_json::Value::Number(number) => {
                self.numbers.extend(number.as_f64().map(|number| (key, number)));
            }
            serde_json::Value::Object(units) if key == UNITS => {
                let text = |(column, unit): (String, serde_json::Value)| {
                    Some((column, unit.as_str()?.to_owned()))
                };
                self.units.extend(units.into_iter().filter_map(text));
            }
            _ => {}
        }
    }
}

/// Returns the keys and values of a file.
fn pairs(metadata: &FileMetaData) -> Vec<(String, String)> {
    let key_values = metadata.key_value_metadata().into_iter().flatten();
    key_values.filter_map(|pair| Some((pair.key.clone(), pair.value.clone()?))).collect()
}
