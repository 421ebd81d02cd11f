//! Tables as Parquet files.

use std::path::Path;
use std::sync::Arc;

use ::parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use ::parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use ::parquet::errors::ParquetError;
use ::parquet::file::metadata::KeyValue;
use ::parquet::file::properties::WriterProperties;
use ::parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use ::parquet::schema::types::{Type, TypePtr};

use crate::IoError;
use crate::output::{OutputFile, write_all};
use crate::standard::output_name;

/// A column of a table to be written.
#[derive(Debug, Clone, PartialEq)]
pub struct ParquetColumn {
    /// Name.
    pub name: &'static str,
    /// Values of the column, one per row.
    pub values: ParquetValues,
}

/// Values of a [`ParquetColumn`], one per row, in the unit that its name states; `None` is null.
#[derive(Debug, Clone, PartialEq)]
pub enum ParquetValues {
    /// Text.
    Text(Vec<Option<String>>),
    /// Whole numbers.
    Count(Vec<Option<i64>>),
    /// Numbers, one per row, in the unit of the column.
    Number(Vec<Option<f64>>),
    /// Lists of texts.
    Texts(Vec<Vec<String>>),
    /// Lists of numbers, one list per row, in the unit of the column.
    Numbers(Vec<Vec<Option<f64>>>),
}

/// Writes a table of one row group with keys and values as metadata, completely or not at all. The
/// bytes depend only on the arguments and the version of this crate.
///
/// # Errors
/// [`IoError::Write`] if the file cannot be written, [`IoError::Parquet`] if the columns have
/// different numbers of rows.
pub fn write_parquet(
    path: impl AsRef<Path>,
    columns: &[ParquetColumn],
    metadata: &[(&str, String)],
) -> Result<(), IoError> {
    let path = path.as_ref();
    let content = encoded(columns, metadata)
        .map_err(|error| IoError::Parquet { file: output_name(path), what: error.to_string() })?;
    write_all(Vec::new(), &[OutputFile { path: path.to_owned(), content }])
}

/// Returns a table of one row group, as [`write_parquet`] writes it.
///
/// # Errors
/// [`IoError::Parquet`] if the columns have different numbers of rows.
pub fn parquet_bytes(columns: &[ParquetColumn]) -> Result<Vec<u8>, IoError> {
    encoded(columns, &[])
        .map_err(|error| IoError::Parquet { file: "the table".into(), what: error.to_string() })
}

fn encoded(
    columns: &[ParquetColumn],
    metadata: &[(&str, String)],
) -> Result<Vec<u8>, ParquetError> {
    let fields = columns.iter().map(ParquetColumn::field).collect::<Result<_, _>>()?;
    let schema = Type::group_type_builder("table").with_fields(fields).build()?;
    let pairs = metadata.iter().map(|(key, value)| KeyValue::new((*key).into(), value.clone()));
    let properties = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .set_key_value_metadata(Some(pairs.collect()))
        .build();
    let mut file = SerializedFileWriter::new(Vec::new(), Arc::new(schema), Arc::new(properties))?;
    let mut rows = file.next_row_group()?;
    for column in columns {
        let Some(writer) = rows.next_column()? else { break };
        column.values.write(writer)?;
    }
    rows.close()?;
    file.into_inner()
}

impl ParquetColumn {
    fn field(&self) -> Result<TypePtr, ParquetError> {
        let leaf = |name: &str, physical, text: bool, optional: bool| {
            let repetition = if optional { Repetition::OPTIONAL } else { Repetition::REQUIRED };
            Type::primitive_type_builder(name, physical)
                .with_repetition(repetition)
                .with_logical_type(text.then_some(LogicalType::String))
                .build()
                .map(Arc::new)
        };
        let list = |element: TypePtr| {
            let entries = Type::group_type_builder("list")
                .with_repetition(Repetition::REPEATED)
                .with_fields(vec![element])
                .build()?;
            Type::group_type_builder(self.name)
                .with_repetition(Repetition::REQUIRED)
                .with_logical_type(Some(LogicalType::List))
                .with_fields(vec![Arc::new(entries)])
                .build()
                .map(Arc::new)
        };
        match &self.values {
            ParquetValues::Text(_) => leaf(self.name, Physical::BYTE_ARRAY, true, true),
            ParquetValues::Count(_) => leaf(self.name, Physical::INT64, false, true),
            ParquetValues::Number(_) => leaf(self.name, Physical::DOUBLE, false, true),
            ParquetValues::Texts(_) => list(leaf("element", Physical::BYTE_ARRAY, true, false)?),
            ParquetValues::Numbers(_) => list(leaf("element", Physical::DOUBLE, false, true)?),
        }
    }
}

impl ParquetValues {
    fn write(&self, writer: SerializedColumnWriter<'_>) -> Result<(), ParquetError> {
        let bytes = |text: &String| ByteArray::from(text.as_str());
        match self {
            Self::Text(rows) => single::<ByteArrayType, _>(writer, rows, bytes),
            Self::Count(rows) => single::<Int64Type, _>(writer, rows, |value| *value),
            Self::Number(rows) => single::<DoubleType, _>(writer, rows, |value| *value),
            Self::Texts(rows) => {
                let entries = rows.iter().map(|row| row.iter().map(|text| Some(bytes(text))));
                lists::<ByteArrayType>(writer, entries, 0)
            }
            Self::Numbers(rows) => {
                lists::<DoubleType>(writer, rows.iter().map(|row| row.iter().copied()), 1)
            }
        }
    }
}

/// Writes one value, or null, per row.
fn single<T: DataType, V>(
    mut writer: SerializedColumnWriter<'_>,
    rows: &[Option<V>],
    value: impl Fn(&V) -> T::T,
) -> Result<(), ParquetError> {
    let levels: Vec<i16> = rows.iter().map(|row| i16::from(row.is_some())).collect();
    let values: Vec<T::T> = rows.iter().flatten().map(value).collect();
    writer.typed::<T>().write_batch(&values, Some(&levels), None)?;
    writer.close()
}

/// Writes one list per row; `optional` is 1 if the entries of the lists may be null.
fn lists<T: DataType>(
    mut writer: SerializedColumnWriter<'_>,
    rows: impl Iterator<Item = impl Iterator<Item = Option<T::T>>>,
    optional: i16,
) -> Result<(), ParquetError> {
    let (mut values, mut defined, mut repeated) = (Vec::new(), Vec::new(), Vec::new());
    for row in rows {
        let before = defined.len();
        for entry in row {
            repeated.push(i16::from(defined.len() > before));
            // The definition level of a null entry is 1.
            defined.push(if entry.is_some() { 1 + optional } else { 1 });
            values.extend(entry);
        }
        if defined.len() == before {
            repeated.push(0);
            defined.push(0);
        }
    }
    writer.typed::<T>().write_batch(&values, Some(&defined), Some(&repeated))?;
    writer.close()
}
