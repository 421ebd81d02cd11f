//! Rows of a table of results, read from a file.

use std::fs::File;
use std::path::Path;

use ::parquet::file::reader::ChunkReader;
use ::parquet::record::Field;
use bytes::Bytes;

use super::read::{Columns, Trouble, guarded};
use crate::IoError;
use crate::limits::{Budget, Limits};
use crate::standard::input_name;

/// Cell of a table that [`write_parquet`](super::write_parquet) writes.
#[derive(Debug, Clone, PartialEq)]
pub enum ParquetCell {
    /// Null, or a value that is not text, a whole number, a number or a list.
    Null,
    /// Text.
    Text(String),
    /// Whole number.
    Count(i64),
    /// Number, in the unit of the column.
    Number(f64),
    /// List of cells.
    List(Vec<ParquetCell>),
}

impl ParquetCell {
    fn from_field(field: Field) -> Self {
        match field {
            Field::Str(text) => Self::Text(text),
            Field::Long(count) => Self::Count(count),
            Field::Double(number) => Self::Number(number),
            Field::ListInternal(list) => {
                Self::List(list.elements().iter().cloned().map(Self::from_field).collect())
            }
            _ => Self::Null,
        }
    }
}

/// Cells of a row, with the names of their columns.
type Cells = Vec<(String, ParquetCell)>;

/// Reads all rows of a table of results; each has its cells with the names of their columns.
///
/// # Errors
/// [`IoError::Read`] if there is no such file, [`IoError::Parquet`] if it is damaged or of another
/// format, [`IoError::TooLarge`].
pub fn read_parquet_rows(
    path: impl AsRef<Path>,
    limits: &Limits,
) -> Result<Vec<Vec<(String, ParquetCell)>>, IoError> {
    let file = input_name(path.as_ref());
    let open = || File::open(&path).map_err(|source| IoError::Read { file: file.clone(), source });
    let (source, same) = (open()?, open()?);
    guarded(|| rows(source, same, limits)).map_err(|trouble| trouble.error(&file))
}

/// Reads the rows of a table of results in the bytes of a file; `file` is its name in messages.
///
/// # Errors
/// [`IoError::Parquet`] if it is damaged or of another format, [`IoError::TooLarge`].
pub fn parse_parquet_rows(
    file: &str,
    bytes: Vec<u8>,
    limits: &Limits,
) -> Result<Vec<Vec<(String, ParquetCell)>>, IoError> {
    let bytes = Bytes::from(bytes);
    guarded(|| rows(bytes.clone(), bytes, limits)).map_err(|trouble| trouble.error(file))
}

/// Reads the rows of a file; `source` and `same` are the same file.
fn rows<R: ChunkReader + 'static>(
    source: R,
    same: R,
    limits: &Limits,
) -> Result<Vec<Cells>, Trouble> {
    let len = usize::try_from(source.len()).unwrap_or(usize::MAX);
    let columns = Columns::new(source, same)?;
    columns.check_all_pages(&mut Budget::new(limits, len))?;
    let rows = columns.row_cells()?.map(|row| {
        let cells = row?.into_columns().into_iter();
        Ok(cells.map(|(name, field)| (name, ParquetCell::from_field(field))).collect())
    });
    rows.collect()
}
