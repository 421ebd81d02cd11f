//! Limits on the memory that reading a file may use.

use std::fmt;

/// Memory for each number of a file while it is read, in bytes: a column that grows is copied, so
/// that each number is in memory twice.
pub(crate) const NUMBER_BYTES: usize = 16;

/// Memory for each number of a simulated record, in bytes: force, displacement, velocity and
/// acceleration, with and without noise, and the arrays of the scheme. The largest use that was
/// measured is 103 bytes.
pub(crate) const SIMULATED_BYTES: usize = 128;

/// Memory that the simulation of a description may use by default, in bytes.
pub(crate) const SIMULATION_MEMORY: usize = 1 << 30;

/// Number of bytes at the beginning of a record that are searched for its details: headers of
/// analysers are shorter.
pub(crate) const DETAILS_BYTES: u64 = 64 << 10;

/// Memory of each record in the lists of the records of a file, in bytes: two strings for its
/// identifier, its rows, and its share of a tree and of growing lists. The texts in the strings are
/// counted separately.
#[cfg(feature = "parquet")]
pub(crate) const RECORD_BYTES: usize = 256;

/// Size, in bytes, that the text in a gzip file may have even if the file is very small.
const TEXT_BYTES: usize = 64 << 20;

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
/// A compressed variable of a few hundred bytes can expand to gigabytes, and a quote that is never
/// closed makes all following text one row. Reading stops with
/// [`IoError::TooLarge`](crate::IoError::TooLarge) before the memory is allocated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Maximum number of bytes of a row of text, including quoted line breaks; 4 MiB by default.
    pub row_bytes: usize,
    /// Maximum number of columns, in any format; 65,536 by default.
    pub columns: usize,
    /// Maximum number of unpacked bytes of a compressed MATLAB variable, or of a MATLAB or
    /// universal file in gzip; 1 GiB by default.
    pub unpacked_bytes: usize,
    /// Maximum number of numbers in memory at one time, over all columns; 2²⁸ (2 GiB) by default. A
    /// long text that is read in chunks ([`RecordFile`](crate::RecordFile)) may have any number of
    /// rows.
    pub numbers: usize,
    /// Maximum number of bytes of a text in gzip for each byte of the compressed file, in addition
    /// to 64 MiB; 100 by default. Gzip reduces the printed numbers of a measured record to about a
    /// quarter.
    pub text_per_byte: usize,
    /// Maximum number of bytes of the name of a column, a unit or a record; 4 KiB by default.
    pub name_bytes: usize,
    /// Memory that a file may use in addition to `memory_per_byte` for each of its bytes, in bytes;
    /// 256 MiB by default.
    pub memory_bytes: usize,
    /// Additional memory for each byte of the file, in bytes; 512 by default. Each number of a
    /// measured record takes at least one byte of the file, so this memory is available for each
    /// number. A file with more numbers than bytes is not a measured record.
    pub memory_per_byte: usize,
    /// Maximum memory that a file may use, in bytes, even if `memory_per_byte` would allow more; 8
    /// GiB by default.
    pub most_memory_bytes: usize,
}

impl Limits {
    /// The default limits.
    pub const DEFAULT: Self = Self {
        row_bytes: 4 << 20,
        columns: 1 << 16,
        unpacked_bytes: 1 << 30,
        numbers: 1 << 28,
        text_per_byte: 100,
        name_bytes: 4 << 10,
        memory_bytes: 256 << 20,
        memory_per_byte: 512,
        most_memory_bytes: 8 << 30,
    };

    /// Returns these limits multiplied by `factor`.
    #[must_use]
    pub fn times(self, factor: usize) -> Self {
        let times = |limit: usize| limit.saturating_mul(factor);
        Self {
            row_bytes: times(self.row_bytes),
            columns: times(self.columns),
            unpacked_bytes: times(self.unpacked_bytes),
            numbers: times(self.numbers),
            text_per_byte: times(self.text_per_byte),
            name_bytes: times(self.name_bytes),
            memory_bytes: times(self.memory_bytes),
            memory_per_byte: self.memory_per_byte,
            most_memory_bytes: times(self.most_memory_bytes),
        }
    }

    /// Returns these limits with a memory of `bytes` bytes for a file of any size. The limits of
    /// numbers and of unpacked bytes are raised to what fits into this memory.
    #[must_use]
    pub fn with_memory(self, bytes: usize) -> Self {
        Self {
            unpacked_bytes: self.unpacked_bytes.max(bytes),
            numbers: self.numbers.max(bytes / NUMBER_BYTES),
            memory_bytes: bytes,
            most_memory_bytes: bytes,
            ..self
        }
    }

    /// Returns the largest unpacked size of a text in gzip whose file has `file_bytes` bytes.
    pub(crate) fn text_bytes(&self, file_bytes: usize) -> usize {
        TEXT_BYTES.saturating_add(self.text_per_byte.saturating_mul(file_bytes))
    }

    /// Returns the memory, in bytes, that a file of `file_bytes` bytes may use.
    ///
    /// ```
    /// use mechid_io::Limits;
    ///
    /// assert_eq!(Limits::DEFAULT.memory(0), 256 << 20);
    /// assert_eq!(Limits::DEFAULT.memory(1 << 20), (256 << 20) + (512 << 20));
    /// assert_eq!(Limits::DEFAULT.memory(1 << 40), 8 << 30);
    /// ```
    pub fn memory(&self, file_bytes: usize) -> usize {
        let of_file = self.memory_per_byte.saturating_mul(file_bytes);
        self.memory_bytes.saturating_add(of_file).min(self.most_memory_bytes)
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
    /// [`Limits::name_bytes`].
    NameBytes(usize),
    /// [`Limits::memory`] of the file, in bytes.
    Memory(usize),
}

impl Limit {
    /// Returns whether [`Limits::with_memory`] raises this limit.
    pub fn is_memory(self) -> bool {
        matches!(self, Self::Memory(_) | Self::Numbers(_) | Self::UnpackedBytes(_))
    }
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
                write!(f, "there are more than {limit} numbers, which is the limit for one file")
            }
            Self::NameBytes(limit) => write!(f, "the name is longer than {limit} bytes"),
            Self::Memory(limit) => {
                let mebibytes = limit >> 20;
                write!(
                    f,
                    "reading it takes more than {mebibytes} MiB of memory, which is the limit for a file \
                     of this size"
                )
            }
        }
    }
}

/// Remaining [`Limits`] while a binary or universal file is read.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Budget {
    limits: Limits,
    columns: usize,
    numbers: usize,
    /// Memory limit for the whole file, in bytes.
    memory: usize,
    /// Remaining memory, in bytes.
    memory_left: usize,
}

impl Budget {
    /// Creates the budget for a file of `file_bytes` bytes.
    pub fn new(limits: &Limits, file_bytes: usize) -> Self {
        let memory = limits.memory(file_bytes);
        let (columns, numbers) = (limits.columns, limits.numbers);
        Self { limits: *limits, columns, numbers, memory, memory_left: memory }
    }

    /// Returns the maximum number of bytes to unpack at once, and the limit that determines it.
    /// Only half of the remaining memory may be used: a growing buffer is copied and then needs
    /// twice its size.
    pub fn unpacked_bytes(&self) -> (usize, Limit) {
        let (unpacked, memory) = (self.limits.unpacked_bytes, self.memory_left / 2);
        if unpacked <= memory {
            (unpacked, Limit::UnpackedBytes(unpacked))
        } else {
            (memory, Limit::Memory(self.memory))
        }
    }

    /// Subtracts a column from the budget.
    pub fn take_column(&mut self) -> Result<(), Limit> {
        self.columns = self.columns.checked_sub(1).ok_or(Limit::Columns(self.limits.columns))?;
        Ok(())
    }

    /// Subtracts the memory of numbers from the budget.
    pub fn take_numbers(&mut self, count: usize) -> Result<(), Limit> {
        self.numbers =
            self.numbers.checked_sub(count).ok_or(Limit::Numbers(self.limits.numbers))?;
        self.take_bytes(count.saturating_mul(NUMBER_BYTES))
    }

    /// Subtracts bytes from the budget.
    pub fn take_bytes(&mut self, count: usize) -> Result<(), Limit> {
        self.memory_left = self.memory_left.checked_sub(count).ok_or(Limit::Memory(self.memory))?;
        Ok(())
    }

    /// Returns bytes to the budget that [`Budget::take_bytes`] subtracted.
    pub fn give_bytes(&mut self, count: usize) {
        self.memory_left += count;
    }
}
