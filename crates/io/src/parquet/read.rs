//! Columns of numbers from Parquet files, row group by row group.

use std::fs::File;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use ::parquet::basic::{ConvertedType, LogicalType, TimeUnit, Type};
use ::parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use ::parquet::data_type::DataType;
use ::parquet::errors::ParquetError;
use ::parquet::file::metadata::FileMetaData;
use ::parquet::file::reader::{ChunkReader, FileReader as _, SerializedFileReader};
use ::parquet::schema::types::ColumnDescriptor;
use bytes::Bytes;

use crate::IoError;
use crate::contents::{Column, Contents, Place};
use crate::limits::{Budget, Limit, Limits};
use crate::standard::input_name;
use crate::stated_rates::with_stated_rates;

/// Number of rows decoded at a time.
const CHUNK_ROWS: usize = 1 << 16;

/// Key of the units of the columns, a JSON object such as `{"x": "mm"}`.
const UNITS: &str = "units";

/// Key under which pandas writes the attributes of a table, as JSON.
const PANDAS_ATTRIBUTES: &str = "PANDAS_ATTRS";

/// Reads the columns of a file.
pub(crate) fn read(file: &str, bytes: Vec<u8>, limits: &Limits) -> Result<Contents, IoError> {
    let contents = guarded(|| contents(Bytes::from(bytes), Budget::new(limits)))
        .map_err(|trouble| trouble.error(file))?;
    let contents = with_stated_rates(contents);
    if contents.columns.is_empty() {
        return Err(IoError::Empty { file: file.into(), found: "it has no column" });
    }
    Ok(contents.with_usual_length())
}

/// Reads the keys and values that stand in a Parquet file beside its columns, without the columns.
///
/// # Errors
/// [`IoError::Read`] if there is no such file, [`IoError::Parquet`] if it is damaged or none.
pub fn read_parquet_metadata(path: impl AsRef<Path>) -> Result<Vec<(String, String)>, IoError> {
    let file = input_name(path.as_ref());
    let opened = File::open(path).map_err(|source| IoError::Read { file: file.clone(), source })?;
    guarded(|| Ok(pairs(reader(opened)?.metadata().file_metadata())))
        .map_err(|trouble| trouble.error(&file))
}

/// What stops the reading.
enum Trouble {
    Damaged(String),
    /// The limit, and the number of rows read before.
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
    fn error(self, file: &str) -> IoError {
        let file = file.to_owned();
        match self {
            Self::Damaged(what) => IoError::Parquet { file, what },
            Self::TooLarge(rows, limit) => {
                IoError::TooLarge { file, at: Place::Sample(rows + 1), limit }
            }
        }
    }
}

/// Reads something of a file; a panic of the decoder, which damaged files can cause, is an error.
fn guarded<T>(read: impl FnOnce() -> Result<T, Trouble>) -> Result<T, Trouble> {
    catch_unwind(AssertUnwindSafe(read))
        .unwrap_or_else(|_| Err(Trouble::Damaged("its contents contradict each other".into())))
}

fn reader<R: ChunkReader + 'static>(source: R) -> Result<SerializedFileReader<R>, ParquetError> {
    SerializedFileReader::new(source)
}

fn contents(bytes: Bytes, mut budget: Budget) -> Result<Contents, Trouble> {
    let reader = reader(bytes)?;
    let metadata = reader.metadata();
    let stated = Stated::of(metadata.file_metadata());
    let mut contents =
        Contents { format: "Parquet".into(), scalars: stated.numbers, ..Contents::default() };
    let descriptions = metadata.file_metadata().schema_descr_ptr();
    for (at, description) in descriptions.columns().iter().enumerate() {
        budget.take_column().map_err(|limit| Trouble::TooLarge(0, limit))?;
        let name = description.path().parts().join(".");
        let about = stated.units.iter().find(|(column, _)| *column == name);
        let about = about.map(|(_, unit)| unit.clone()).unwrap_or_default();
        let kind = match Kind::of(description) {
            Ok(kind) => kind,
            Err(what) => {
                let root = description.path().parts().first().cloned().unwrap_or_default();
                // The leaves of a list are called after it.
                let name = if description.max_rep_level() > 0 { root } else { name };
                contents.columns.push(Column { about, ..Column::unusable(name, what) });
                continue;
            }
        };
        let mut values = Vec::new();
        let mut first = None;
        for (group, described) in metadata.row_groups().iter().enumerate() {
            let rows = usize::try_from(described.num_rows())
                .map_err(|_| Trouble::Damaged("a row group has less than no rows".into()))?;
            budget.take_numbers(rows).map_err(|limit| Trouble::TooLarge(values.len(), limit))?;
            let column = reader.get_row_group(group)?.get_column_reader(at)?;
            kind.append(column, rows, &mut first, &mut values)?;
        }
        contents.columns.push(Column { about, ..Column::of_numbers(name, values) });
    }
    Ok(contents)
}

/// Meaning of the numbers of a column.
#[derive(Clone, Copy)]
enum Kind {
    /// Numbers as they stand.
    Plain,
    /// Integers without a sign.
    Unsigned,
    /// Instants in integer units, so many in a second; read as seconds from the first one on, because
    /// the seconds since 1970 leave a float too few digits for a sampling step.
    Instants(f64),
}

impl Kind {
    /// The kind of a column, or what it holds instead of real numbers.
    fn of(column: &ColumnDescriptor) -> Result<Self, &'static str> {
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
            Type::INT96 => Err("instants of an old kind (write them as timestamps)"),
            Type::BYTE_ARRAY => Err("text"),
            Type::FIXED_LEN_BYTE_ARRAY => Err("bytes"),
        }
    }

    /// Appends the rows of a row group; `first` is the first instant of the column.
    fn append(
        self,
        column: ColumnReader,
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
            _ => Err(Trouble::Damaged("a column is of another type than the file says".into())),
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

/// Appends so many rows as numbers, NaN where there is none.
fn append<T: DataType>(
    mut column: ColumnReaderImpl<T>,
    rows: usize,
    mut number: impl FnMut(&T::T) -> f64,
    into: &mut Vec<f64>,
) -> Result<(), Trouble> {
    let (mut levels, mut values) = (Vec::new(), Vec::new());
    let mut left = rows;
    while left > 0 {
        levels.clear();
        values.clear();
        let at_once = left.min(CHUNK_ROWS);
        let (read, ..) = column.read_records(at_once, Some(&mut levels), None, &mut values)?;
        if read == 0 {
            return Err(Trouble::Damaged("a column is shorter than its row group".into()));
        }
        if values.len() == read {
            into.extend(values.iter().map(&mut number));
        } else {
            let full = levels.iter().copied().max().unwrap_or_default();
            let mut present = values.iter();
            into.extend(levels.iter().map(|level| match *level == full {
                true => present.next().map_or(f64::NAN, &mut number),
                false => f64::NAN,
            }));
        }
        left -= read.min(left);
    }
    Ok(())
}

/// What a file says beside its columns.
struct Stated {
    numbers: Vec<(String, f64)>,
    /// Columns and their units.
    units: Vec<(String, String)>,
}

impl Stated {
    fn of(metadata: &FileMetaData) -> Self {
        let mut stated = Self { numbers: Vec::new(), units: Vec::new() };
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

/// Keys and values of a file.
fn pairs(metadata: &FileMetaData) -> Vec<(String, String)> {
    let all = metadata.key_value_metadata().into_iter().flatten();
    all.filter_map(|pair| Some((pair.key.clone(), pair.value.clone()?))).collect()
}
