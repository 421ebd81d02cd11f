//! Apache Parquet: records read as tables, tables of results written.
//!
//! The columns are read and written one by one, without Arrow: its crates would double what the
//! feature costs to compile, and a record is nothing but columns of numbers.

mod read;
mod write;

pub(crate) use self::read::read;
pub use self::read::read_parquet_metadata;
pub use self::write::{ParquetColumn, ParquetValues, write_parquet};
