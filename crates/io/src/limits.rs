//! Limits on what a file may ask of memory.

use std::fmt;

/// Options for reading a record file.
///
/// ```
/// use mechid_io::{Limits, ReadOptions, Table};
///
/// let options = ReadOptions { skip_lines: 1, ..ReadOptions::default() };
/// let table = Table::parse_with("a.csv", b"Rig 4\nt,f\n0,1\n1,2\n", &options)?;
/// assert_eq!(table.names(), ["t", "f"]);
/// let narrow = ReadOptions { limits: Limits { columns: 1, ..Limits::default() }, ..options };
/// assert!(Table::parse_with("a.csv", b"Rig 4\nt,f\n0,1\n1,2\n", &narrow).is_err());
/// # Ok::<(), mechid_io::IoError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ReadOptions {
    /// Number of header lines to skip above the table of a text.
    pub skip_lines: u64,
    /// Limits on the size of what is read.
    pub limits: Limits,
}

/// Limits that damaged and forged files exceed, and measured records do not.
///
/// A few hundred bytes can stand for gigabytes, in a compressed variable or behind a quote that is
/// never closed. Reading stops with [`IoError::TooLarge`](crate::IoError::TooLarge) before the
/// memory is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of a row of text, quoted line breaks included; 4 MiB by default.
    pub row_bytes: usize,
    /// Columns, in whatever format; 65,536 by default.
    pub columns: usize,
    /// Bytes of a compressed MATLAB variable, or of a MATLAB or universal file in gzip, when
    /// unpacked; 1 GiB by default.
    pub unpacked_bytes: usize,
    /// Numbers held in memory at a time, of all columns together; 2²⁸ (2 GiB) by default. A long
    /// text that is read in chunks ([`RecordFile`](crate::RecordFile)) may have any number of rows.
    pub numbers: usize,
}

impl Limits {
    /// The default limits.
    pub const DEFAULT: Self =
        Self { row_bytes: 4 << 20, columns: 1 << 16, unpacked_bytes: 1 << 30, numbers: 1 << 28 };

    /// Returns these limits, each `factor` times as large.
    #[must_use]
    pub fn times(self, factor: usize) -> Self {
        Self {
            row_bytes: self.row_bytes.saturating_mul(factor),
            columns: self.columns.saturating_mul(factor),
            unpacked_bytes: self.unpacked_bytes.saturating_mul(factor),
            numbers: self.numbers.saturating_mul(factor),
        }
    }
}

impl Default for Limits {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// A limit that a file exceeds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Limit {
    /// [`Limits::row_bytes`].
    RowBytes(usize),
    /// [`Limits::columns`].
    Columns(usize),
    /// [`Limits::unpacked_bytes`].
    UnpackedBytes(usize),
    /// [`Limits::numbers`].
    Numbers(usize),
}

impl fmt::Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::RowBytes(limit) => {
                write!(f, "the row is longer than {limit} bytes (is a quote not closed?)")
            }
            Self::Columns(limit) => write!(f, "there are more than {limit} columns"),
            Self::UnpackedBytes(limit) => {
                write!(f, "the compressed data are longer than {limit} bytes")
            }
            Self::Numbers(limit) => {
                write!(f, "there are more than {limit} numbers to hold in memory")
            }
        }
    }
}

/// Remainder of the [`Limits`] while a binary or universal file is read.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Budget {
    limits: Limits,
    columns: usize,
    numbers: usize,
}

impl Budget {
    pub fn new(limits: &Limits) -> Self {
        Self { limits: *limits, columns: limits.columns, numbers: limits.numbers }
    }

    pub fn unpacked_bytes(&self) -> usize {
        self.limits.unpacked_bytes
    }

    /// Takes room for a column.
    pub fn take_column(&mut self) -> Result<(), Limit> {
        self.columns = self.columns.checked_sub(1).ok_or(Limit::Columns(self.limits.columns))?;
        Ok(())
    }

    /// Takes room for numbers.
    pub fn take_numbers(&mut self, count: usize) -> Result<(), Limit> {
        self.numbers =
            self.numbers.checked_sub(count).ok_or(Limit::Numbers(self.limits.numbers))?;
        Ok(())
    }
}
