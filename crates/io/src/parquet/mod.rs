//! Apache Parquet: records are read as tables, and tables of results are written.
//!
//! The columns are read and written one by one, without Arrow: its crates would double the compile
//! time of this feature, and a record has only columns of numbers.

mod footer;
mod pages;
mod panic;
mod read;
mod record_writer;
mod records;
mod rows;
mod thrift;
mod write;

pub(crate) use self::read::read;
pub use self::read::read_parquet_metadata;
pub use self::record_writer::ParquetRecordWriter;
pub use self::records::{ParquetFile, RecordRows};
pub use self::rows::{ParquetCell, parse_parquet_rows, read_parquet_rows};
pub use self::write::{ParquetColumn, ParquetValues, parquet_bytes, write_parquet};
