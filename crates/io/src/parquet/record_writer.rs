//! Writer of many records into one Parquet file.

use std::io::{self, Write};
use std::path::Path;
use std::sync::Arc;

use ::parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use ::parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType};
use ::parquet::errors::ParquetError;
use ::parquet::file::properties::WriterProperties;
use ::parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use ::parquet::schema::types::{Type, TypePtr};
use mechid_signal::Sampling;

use crate::standard::output_name;
use crate::{BegunFile, IoError};

/// Number of samples after which the records so far become a row group.
const ROW_GROUP_ROWS: usize = 1 << 17;

/// Name of the column of instants, in s.
const TIME: &str = "time";

/// Writer of consecutive records into one Parquet file: a column that names the record of each row,
/// one of the instants, and one for each channel. [`ParquetFile`](crate::ParquetFile) reads them.
///
/// ```
/// use mechid_io::{Limits, ParquetFile, ParquetRecordWriter, write_all};
/// use mechid_signal::Sampling;
///
/// let path = std::env::temp_dir().join("mechid-record-writer.parquet");
/// let sampling = Sampling::new(0.5, 2)?;
/// let mut file = ParquetRecordWriter::begin(&path, "run", &["force"])?;
/// file.append("1", sampling, &[&[1.0, 2.0]])?;
/// file.append("2", sampling, &[&[3.0, 4.0]])?;
/// write_all(vec![file.finish()?], &[])?;
/// let file = ParquetFile::open(&path, &Limits::default())?;
/// let records = file.records("run")?;
/// assert_eq!((records.len(), records[1].id.as_str()), (2, "2"));
/// assert_eq!(file.tables(None, &records)?[1].column("force")?, [3.0, 4.0]);
/// # std::fs::remove_file(path)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct ParquetRecordWriter {
    /// Name of the file in messages.
    file: String,
    writer: SerializedFileWriter<Stream>,
    /// Name of the record of each row that is not written yet.
    ids: Vec<ByteArray>,
    /// Instants and channels of the rows that are not written yet.
    columns: Vec<Vec<f64>>,
}

/// Stream through which the encoder writes into the file.
struct Stream(BegunFile);

impl Write for Stream {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.append(bytes).map_err(io::Error::other)?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl ParquetRecordWriter {
    /// Begins the file with destination `path`; `record_column` is the name of the column that
    /// identifies the record of each row, `channels` are the names of the channels.
    ///
    /// # Errors
    /// As [`BegunFile::begin`], and [`IoError::Write`] if two columns have one name.
    pub fn begin(
        path: impl AsRef<Path>,
        record_column: &str,
        channels: &[impl AsRef<str>],
    ) -> Result<Self, IoError> {
        let file = output_name(path.as_ref());
        let numbers: Vec<&str> =
            [TIME].into_iter().chain(channels.iter().map(AsRef::as_ref)).collect();
        for (place, name) in numbers.iter().enumerate() {
            if *name == record_column || numbers[..place].contains(name) {
                let twice = format!("two columns would be called \"{name}\"");
                return Err(failed(&file, ParquetError::General(twice)));
            }
        }
        let stream = Stream(BegunFile::begin(path)?);
        let begun = schema(record_column, &numbers).and_then(|schema| {
            let properties = WriterProperties::builder().set_compression(Compression::SNAPPY);
            SerializedFileWriter::new(stream, schema, Arc::new(properties.build()))
        });
        let writer = begun.map_err(|error| failed(&file, error))?;
        Ok(Self { file, writer, ids: Vec::new(), columns: vec![Vec::new(); numbers.len()] })
    }

    /// Appends a record: its name, its instants, and the samples of each channel in its own unit.
    ///
    /// # Errors
    /// [`IoError::Write`].
    ///
    /// # Panics
    /// If the number of channels differs from that of the names, or a channel is not as long as the
    /// sampling.
    pub fn append(
        &mut self,
        record: &str,
        sampling: Sampling,
        channels: &[&[f64]],
    ) -> Result<(), IoError> {
        assert_eq!(
            channels.len() + 1,
            self.columns.len(),
            "the number of channels must equal the number of names"
        );
        self.ids.resize(self.ids.len() + sampling.len(), ByteArray::from(record));
        let (instants, others) = self.columns.split_first_mut().expect("the instants are there");
        instants.extend(sampling.times());
        for (column, channel) in others.iter_mut().zip(channels) {
            assert_eq!(
                channel.len(),
                sampling.len(),
                "every channel must be as long as the time axis"
            );
            column.extend_from_slice(channel);
        }
        if self.ids.len() >= ROW_GROUP_ROWS { self.write_rows() } else { Ok(()) }
    }

    /// Returns the complete file, which gets its name in [`write_all`](crate::write_all).
    ///
    /// # Errors
    /// [`IoError::Write`].
    pub fn finish(mut self) -> Result<BegunFile, IoError> {
        if !self.ids.is_empty() {
            self.write_rows()?;
        }
        match self.writer.into_inner() {
            Ok(stream) => Ok(stream.0),
            Err(error) => Err(failed(&self.file, error)),
        }
    }

    /// Writes the rows that are buffered so far as a row group.
    fn write_rows(&mut self) -> Result<(), IoError> {
        let Self { file, writer, ids, columns } = self;
        let mut write = || {
            let mut group = writer.next_row_group()?;
            append_column::<ByteArrayType>(&mut group, ids)?;
            columns.iter().try_for_each(|c| append_column::<DoubleType>(&mut group, c))?;
            group.close()
        };
        write().map_err(|error| failed(file, error))?;
        ids.clear();
        columns.iter_mut().for_each(Vec::clear);
        Ok(())
    }
}

/// Writes the next column of a row group.
fn append_column<T: DataType>(
    group: &mut SerializedRowGroupWriter<'_, Stream>,
    values: &[T::T],
) -> Result<(), ParquetError> {
    let next = group.next_column()?;
    let mut column = next.ok_or_else(|| ParquetError::General("a column too many".into()))?;
    column.typed::<T>().write_batch(values, None, None)?;
    column.close()
}

/// Returns the schema: a column of text, then columns of numbers; none of them nullable.
fn schema(text: &str, numbers: &[&str]) -> Result<TypePtr, ParquetError> {
    let column = |name: &str, physical, logical| {
        let column = Type::primitive_type_builder(name, physical)
            .with_repetition(Repetition::REQUIRED)
            .with_logical_type(logical);
        column.build().map(Arc::new)
    };
    let text = column(text, Physical::BYTE_ARRAY, Some(LogicalType::String));
    let numbers = numbers.iter().map(|name| column(name, Physical::DOUBLE, None));
    let columns = [text].into_iter().chain(numbers).collect::<Result<_, _>>()?;
    Ok(Arc::new(Type::group_type_builder("records").with_fields(columns).build()?))
}

fn failed(file: &str, error: ParquetError) -> IoError {
    let source = match error {
        ParquetError::External(cause) => io::Error::other(cause),
        other => io::Error::other(other.to_string()),
    };
    IoError::Write { file: file.into(), source }
}
