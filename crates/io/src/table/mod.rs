//! Table of the columns of a record file.

mod aligned;
mod batch;
mod blocks;
mod comments;
mod definitions;
mod delimiter;
mod dialect;
mod fields;
mod heading;
mod instant;
mod inventory;
mod lvm;
mod preamble;
mod printed;
mod record_file;
mod rows;
pub(crate) mod source;
mod text;
mod time_axis;
mod time_unit;

pub(crate) use self::time_unit::is_time;

use std::ops::ControlFlow;
use std::path::Path;

use mechid_signal::{Record, Sampling, SignalError, message};
use nalgebra::DMatrix;

pub use self::inventory::{Inventory, Tally};
pub use self::record_file::{RecordFile, Survey};
use self::source::{Kind, Source, Stored};
use self::text::{TextReader, Wanted};
pub use self::time_axis::TimeAxis;
use crate::contents::{Axis, Column, ComplexArray, Contents, DecimalSign, Override, Place};
use crate::limits::ReadOptions;
use crate::units::{
    Evidence, Quantity, StatedUnit, Unit, names_without_unit, stated, without_unit,
};
use crate::{IoError, escaped, mat, uff};

/// Maximum number of columns that a message lists.
const MOST_LISTED: usize = 50;

/// Columns of a record file of any format.
///
/// | Format | Recognised by | Columns |
/// |---|---|---|
/// | delimited text | none of the others | fields of a row |
/// | MATLAB level 5, versions 5 to 7.2 | its first words | vectors, matrix columns, struct fields |
/// | MATLAB 7.3, HDF5 | its first bytes | data sets by path, matrix columns, struct fields |
/// | Parquet | its first bytes | columns, fields of structs |
/// | universal file, datasets 58, 58b | `    -1` in its first line | functions of time, by node |
/// | gzip around any of them | its first two bytes | |
///
/// In text:
///
/// - The delimiter (comma, semicolon, tab, blanks) and the decimal sign are detected; a decimal
///   comma needs another delimiter.
/// - The first row names the columns if any of its fields is not a number; otherwise columns have
///   numbers only. A second row without any number gives their units.
/// - Comment lines (`#`, `%`, `!`, `;`), which may name columns, and empty lines are skipped; so
///   are header lines above the table, by [`ReadOptions::skip_lines`].
/// - UTF-16 is read if the file begins with a byte order mark.
///
/// A column is chosen by its name, or by its number counted from 1; a column that is not used may
/// have any contents. Only the numbers are kept in memory, not the text.
#[derive(Debug)]
pub struct Table {
    file: String,
    gzip: bool,
    utf16: bool,
    names: Vec<String>,
    contents: Contents,
}

/// First rows of a file.
struct FirstRows {
    table: Table,
    /// `true` if the file has no further rows.
    is_whole: bool,
    decimal: Option<DecimalSign>,
    /// Number of stored bytes of the file that were read.
    stored: Stored,
}

impl Table {
    /// Reads the table in a file, or on standard input as `-`.
    ///
    /// # Errors
    /// [`IoError::Read`] if it cannot be read, otherwise as [`Table::parse`].
    pub fn read(path: impl AsRef<Path>) -> Result<Self, IoError> {
        Self::read_with(path, &ReadOptions::default())
    }

    /// Reads the table in a file as [`Table::read`] does, with options.
    ///
    /// # Errors
    /// As [`Table::read`], and [`IoError::NothingToSkip`] if lines are to be skipped but the file
    /// is not a text.
    pub fn read_with(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Self, IoError> {
        Self::from_source(Source::open(path.as_ref())?, options)
    }

    /// Reads the table in the bytes of a file; `file` is its name in messages.
    ///
    /// # Errors
    /// [`IoError::Empty`] without data, [`IoError::Ragged`] if the number of fields changes,
    /// [`IoError::AboveTable`] if it changes because of text above the table,
    /// [`IoError::JsonRecord`], [`IoError::Gzip`], [`IoError::Malformed`] for a binary or universal
    /// file that breaks its format, [`IoError::Parquet`], [`IoError::Hdf5`],
    /// [`IoError::UnknownFormat`], [`IoError::TooLarge`] beyond the [`Limits`](crate::Limits).
    pub fn parse(file: impl Into<String>, bytes: &[u8]) -> Result<Self, IoError> {
        Self::parse_with(file, bytes, &ReadOptions::default())
    }

    /// Reads the table in the bytes of a file as [`Table::parse`] does, with options.
    ///
    /// # Errors
    /// As [`Table::parse`], and [`IoError::NothingToSkip`].
    pub fn parse_with(
        file: impl Into<String>,
        bytes: &[u8],
        options: &ReadOptions,
    ) -> Result<Self, IoError> {
        Self::from_source(Source::new(file.into(), bytes)?, options)
    }

    /// Reads the table of a source.
    pub(crate) fn from_source(source: Source<'_>, options: &ReadOptions) -> Result<Self, IoError> {
        Ok(Self::first_rows(source, options, usize::MAX)?.table)
    }

    /// Reads a table; from a text, it reads at most `limit` + 1 rows.
    fn first_rows(
        mut source: Source<'_>,
        options: &ReadOptions,
        limit: usize,
    ) -> Result<FirstRows, IoError> {
        let (file, gzip, utf16) = (source.file.clone(), source.gzip, source.utf16);
        let stored = source.stored.clone();
        let (mut is_whole, mut decimal) = (true, None);
        let contents = match source.kind() {
            Kind::Text => {
                let mut text = TextReader::open(source, options, Wanted::default())?;
                let has_ended = text.read(&mut |rows| {
                    rows.check_numbers()?;
                    is_whole = rows.samples() <= limit;
                    rows.truncate(limit.saturating_add(1));
                    let flow = [ControlFlow::Break(()), ControlFlow::Continue(())];
                    Ok::<_, IoError>(flow[usize::from(is_whole)])
                })?;
                decimal = text.rows().decimal();
                let end = text.end().filter(|_| has_ended && is_whole);
                text.finish(end.unwrap_or_default())?
            }
            Kind::Json => return Err(IoError::JsonRecord { file }),
            Kind::Mat5 | Kind::Uff | Kind::Parquet | Kind::Hdf5 if options.skip_lines > 0 => {
                return Err(IoError::NothingToSkip { file });
            }
            Kind::Mat5 => {
                let bytes = source.bytes(&options.limits)?;
                mat::read(&file, &bytes, source.budget(&options.limits))?
            }
            Kind::Uff => {
                let bytes = source.bytes(&options.limits)?;
                uff::read(&file, &bytes, source.budget(&options.limits))?
            }
            #[cfg(feature = "parquet")]
            Kind::Parquet => {
                let bytes = source.bytes(&options.limits)?;
                crate::parquet::read(&file, bytes, source.budget(&options.limits))?
            }
            #[cfg(not(feature = "parquet"))]
            Kind::Parquet => return Err(IoError::UnknownFormat { file }),
            #[cfg(feature = "hdf5")]
            Kind::Hdf5 => {
                crate::hdf5::read(&file, source.bytes(&options.limits)?, &options.limits)?
            }
            #[cfg(not(feature = "hdf5"))]
            Kind::Hdf5 => return Err(IoError::Hdf5 { file }),
            Kind::Unknown => return Err(IoError::UnknownFormat { file }),
        };
        contents.check_names(&file, &options.limits)?;
        let table = Self { gzip, utf16, ..Self::from_contents(file, contents) };
        Ok(FirstRows { table, is_whole, decimal, stored })
    }

    /// Creates a table from named columns in memory; `name` is the name of the table in messages.
    /// The name of a column may have a unit, as in a file; a column with infinite numbers or NaN is
    /// refused when it is used.
    pub fn from_columns(
        name: impl Into<String>,
        columns: impl IntoIterator<Item = (String, Vec<f64>)>,
    ) -> Self {
        let columns = columns.into_iter().map(|(name, values)| Column::from_numbers(name, values));
        let contents = Contents {
            format: "columns in memory".into(),
            columns: columns.collect(),
            ..Contents::default()
        };
        Self::from_contents(name.into(), contents.with_usual_length())
    }

    /// Creates a table from the contents of a file.
    pub(crate) fn from_contents(file: String, contents: Contents) -> Self {
        let names = contents.columns.iter().map(|column| column.name.clone()).collect();
        Self { file, gzip: false, utf16: false, names, contents }
    }

    /// Returns the name of the file in messages.
    pub fn file(&self) -> &str {
        &self.file
    }

    /// Returns the name of the format, for messages.
    pub fn format(&self) -> String {
        let encoding = if self.utf16 { ", in UTF-16" } else { "" };
        let around = if self.gzip { ", in gzip" } else { "" };
        format!("{}{encoding}{around}", self.contents.format)
    }

    /// Returns the arrays of complex numbers, which are not columns.
    pub(crate) fn complex(&self) -> &[ComplexArray] {
        &self.contents.complex
    }

    /// Returns the number of columns, including those without a name.
    pub fn width(&self) -> usize {
        self.names.len()
    }

    /// Returns the most frequent number of samples of a column; in a text, all columns have the
    /// same number.
    pub fn len(&self) -> usize {
        self.contents.samples
    }

    /// Returns whether no column is usable, as in a universal file of spectra.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the names of the columns, empty for columns without a name.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Returns the description of the column with index `column` (from 0): the text that the file
    /// gives in addition to the name of the column, or an empty text.
    ///
    /// # Panics
    /// If there is no such column.
    pub fn about(&self, column: usize) -> &str {
        &self.contents.columns[column].about
    }

    /// Returns the text for the unit of the column with index `column`, from a line of units, a
    /// label or an attribute; empty if there is no such text.
    pub(crate) fn unit_text(&self, column: usize) -> &str {
        &self.contents.columns[column].unit
    }

    /// Returns the unit of the numbers of a column, by its index counted from 0: the name states it
    /// in brackets (`Force [kN]`, `[mm] x`), after a slash (`F / kN`) or as a word (`force_lbf`),
    /// or the line of units does. [`Table::to_si`] returns the factor.
    ///
    /// # Panics
    /// If there is no such column.
    pub fn unit(&self, column: usize) -> Option<Unit> {
        self.stated_unit(column, None)?.used().cloned()
    }

    /// Returns what the column with index `column` (from 0) states about its unit: the unit, or a
    /// text that may be a unit but is not understood. `wanted` is the quantity that the column
    /// should have.
    ///
    /// # Panics
    /// If there is no such column.
    pub fn stated_unit(&self, column: usize, wanted: Option<Quantity>) -> Option<StatedUnit> {
        let column = &self.contents.columns[column];
        let evidence = Evidence::Stated;
        match &column.overriding {
            Some(Override::Unit(unit)) => {
                let text = unit.name.clone();
                Some(StatedUnit { text, unit: Some(unit.clone()), evidence })
            }
            Some(Override::Scale(factor)) => {
                let name = format!("units of {}", message::number(*factor));
                let unit = wanted.map(|quantity| Unit { name, quantity, in_si: *factor });
                unit.map(|unit| StatedUnit { text: unit.name.clone(), unit: Some(unit), evidence })
            }
            None => stated(&column.name, &column.unit, wanted),
        }
    }

    /// Sets the unit of a column and ignores the unit in its name; the column is chosen as in
    /// [`Table::find`].
    ///
    /// # Errors
    /// [`IoError::NoUnit`] if the text is not a unit of a force, a response or a time,
    /// [`IoError::TwoUnits`] if the column already has a unit or a scale that was set, and those of
    /// [`Table::find`].
    pub fn set_unit(&mut self, column: &str, unit: &str) -> Result<(), IoError> {
        let at = self.find(column)?;
        let unit = Unit::parse(unit).ok_or_else(|| IoError::NoUnit { text: unit.into() })?;
        self.override_unit(at, Override::Unit(unit))
    }

    /// Sets the factor that converts a column to SI units, in SI units per unit of the column; the
    /// column is chosen as in [`Table::find`].
    ///
    /// # Errors
    /// [`IoError::NoScale`] unless the factor is finite and not 0, [`IoError::TwoUnits`] if the
    /// column already has a unit or a scale that was set, and those of [`Table::find`].
    pub fn set_scale(&mut self, column: &str, factor: f64) -> Result<(), IoError> {
        let at = self.find(column)?;
        if !factor.is_normal() {
            return Err(IoError::NoScale { factor });
        }
        self.override_unit(at, Override::Scale(factor))
    }

    fn override_unit(&mut self, at: usize, overriding: Override) -> Result<(), IoError> {
        if self.contents.columns[at].overriding.is_some() {
            return Err(IoError::TwoUnits { column: self.label(at) });
        }
        self.contents.columns[at].overriding = Some(overriding);
        Ok(())
    }

    /// Returns the factor that converts a column, by its index counted from 0, to the SI unit of
    /// `wanted` (N, m, m/s, m/s²): 1 if the column states no unit.
    ///
    /// # Errors
    /// [`IoError::OtherQuantity`] if its unit is one of another quantity.
    ///
    /// # Panics
    /// If there is no such column.
    pub fn to_si(&self, column: usize, wanted: Quantity) -> Result<f64, IoError> {
        match self.stated_unit(column, Some(wanted)).as_ref().and_then(StatedUnit::used) {
            None => Ok(1.0),
            Some(unit) if unit.quantity == wanted => Ok(unit.in_si),
            Some(unit) => Err(IoError::OtherQuantity {
                file: self.file.clone(),
                column: self.label(column),
                unit: unit.name.clone(),
                quantity: unit.quantity,
                wanted,
            }),
        }
    }

    /// Returns the single numbers that the file has in addition to its columns.
    pub fn scalars(&self) -> &[(String, f64)] {
        &self.contents.scalars
    }

    /// Returns notes about the file, such as its units or what was left out.
    pub fn remarks(&self) -> &[String] {
        &self.contents.remarks
    }

    /// Returns whether columns have a time axis in the file, [`TimeAxis::OfFile`]: that of a
    /// universal file, or the rate that a named number in a MATLAB file states (`Fs`, `dt`) if no
    /// column is called time.
    pub fn has_time_axis(&self) -> bool {
        self.contents.columns.iter().any(|column| match column.axis {
            Axis::Unknown => false,
            Axis::Stated { .. } | Axis::Contradiction { .. } => self.time_column().is_none(),
            Axis::Even { .. } | Axis::Column(_) => true,
        })
    }

    /// Returns name and value of the number (`Fs`, `dt`) that states the sampling rate, if
    /// [`TimeAxis::OfFile`] comes from such a number.
    pub fn stated_rate(&self) -> Option<&(String, f64)> {
        let stated = self.contents.columns.iter().find_map(|column| match column.axis {
            Axis::Stated { scalar, .. } => Some(scalar),
            _ => None,
        });
        stated.filter(|_| self.time_column().is_none()).map(|at| &self.contents.scalars[at])
    }

    /// Returns the first column named `time` or `t`, in upper or lower case, with a unit
    /// (`time_ms`, `Time [s]`) or without.
    pub fn time_column(&self) -> Option<&str> {
        let is_time = |at: &usize| {
            let column = &self.contents.columns[*at];
            let stated = column.overriding.is_some() && time_unit::is_called_time(&column.name);
            stated || time_unit::is_time(&column.name)
        };
        (0..self.width()).find(is_time).map(|at| self.names[at].as_str())
    }

    /// Returns whether the time column with index `column` (from 0) states its unit, in its name or
    /// in the line of units. Without a unit, it is read in seconds.
    ///
    /// # Panics
    /// If there is no such column.
    pub fn says_unit_of_time(&self, column: usize) -> bool {
        let column = &self.contents.columns[column];
        column.has_instants || time_unit::unit_of(column).is_some()
    }

    /// Returns what the time column with index `column` (from 0) states about its unit, if the
    /// statement is doubtful: a text that is not understood, a factor, or a unit of another
    /// quantity.
    ///
    /// # Panics
    /// If there is no such column.
    pub fn doubtful_time_unit(&self, column: usize) -> Option<StatedUnit> {
        time_unit::doubtful(&self.contents.columns[column])
    }

    /// Returns the first column that is called time but states a text that cannot be read as a unit
    /// of time, with this text.
    pub fn unclear_time(&self) -> Option<(usize, String)> {
        (0..self.width()).find_map(|at| {
            let column = &self.contents.columns[at];
            let is_time = time_unit::is_called_time(&column.name);
            time_unit::unclear(column).filter(|_| is_time).map(|text| (at, text))
        })
    }

    /// Returns the indices, counted from 0, of the columns that have a name or a first value; a
    /// column that a trailing delimiter creates has neither.
    pub fn filled_columns(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.width()).filter(|c| self.contents.columns[*c].filled)
    }

    /// Returns the position in the file of a sample, counted from 0.
    pub fn position(&self, sample: usize) -> Place {
        self.contents.lines.position(sample)
    }

    /// Returns a list of the columns, for a message: `1 "time", 2 "force"`; only the first columns
    /// if there are very many.
    pub fn available(&self) -> String {
        self.list(self.filled_columns())
    }

    /// Returns a list of columns by their indices; only the first columns if there are very many.
    fn list(&self, mut columns: impl Iterator<Item = usize>) -> String {
        let mut list: Vec<String> =
            columns.by_ref().take(MOST_LISTED).map(|c| self.label(c)).collect();
        let unlisted = columns.count();
        if unlisted > 0 {
            list.push(format!("… ({unlisted} more)"));
        }
        list.join(", ")
    }

    /// Returns the index, counted from 0, of a column. The first match is used: the name of the
    /// column, its name without the unit (`Fx` for `Fx [N]`), its name in another case, and finally
    /// its number, counted from 1.
    ///
    /// # Errors
    /// [`IoError::MissingColumn`], [`IoError::AmbiguousColumn`].
    pub fn find(&self, wanted: &str) -> Result<usize, IoError> {
        let wanted = wanted.trim();
        let width = self.width();
        let number = || wanted.parse().ok().filter(|n| (1..=width).contains(n)).map(|n| n - 1);
        let missing = || IoError::MissingColumn {
            file: self.file.clone(),
            wanted: wanted.into(),
            available: self.available(),
        };
        if wanted.is_empty() {
            return Err(missing());
        }
        let only = |is_named: &dyn Fn(&str) -> bool| {
            let mut named = (0..width).filter(|c| is_named(&self.names[*c]));
            let Some(first) = named.next() else { return Ok(None) };
            match named.next() {
                None => Ok(Some(first)),
                Some(second) => {
                    let columns: Vec<usize> = [first, second].into_iter().chain(named).collect();
                    Err(IoError::AmbiguousColumn {
                        file: self.file.clone(),
                        wanted: wanted.into(),
                        candidates: self.list(columns.iter().copied()),
                        columns,
                    })
                }
            }
        };
        let mut named = only(&|name| name.trim() == wanted)?;
        if named.is_none() {
            named = only(&|name| names_without_unit(name).iter().any(|bare| bare == wanted))?;
        }
        if named.is_none() {
            let lower = wanted.to_lowercase();
            let is_alike = |name: &str| name.to_lowercase() == lower;
            named = only(&|name| {
                is_alike(name.trim()) || names_without_unit(name).iter().any(|bare| is_alike(bare))
            })?;
        }
        named.or_else(number).ok_or_else(missing)
    }

    /// Returns the numbers of the column `wanted`, chosen as in [`Table::find`].
    ///
    /// # Errors
    /// [`IoError::NotANumber`], [`IoError::EmptyField`] and [`IoError::NotFinite`] with the
    /// position of the first wrong field, [`IoError::NoNumbers`], and the errors of
    /// [`Table::find`].
    pub fn column(&self, wanted: &str) -> Result<&[f64], IoError> {
        self.values(self.find(wanted)?)
    }

    /// Returns the time axis of the columns `wanted`; if none is named, of the columns with the
    /// most frequent number of samples.
    ///
    /// # Errors
    /// [`IoError::NonUniformTime`], [`IoError::SingleSample`], [`IoError::SampleRate`];
    /// [`IoError::Lengths`] if the columns are not equally long; [`IoError::NoTimeAxis`],
    /// [`IoError::TimeAxes`] and [`IoError::RateContradicts`] if columns have time axes of their
    /// own; and the errors of [`Table::column`].
    pub fn sampling(
        &self,
        time: &TimeAxis<'_>,
        wanted: &[impl AsRef<str>],
    ) -> Result<Sampling, IoError> {
        let mut columns: Vec<usize> =
            wanted.iter().map(|w| self.find(w.as_ref())).collect::<Result<_, _>>()?;
        if columns.is_empty() {
            let usual = |c: &usize| self.values(*c).is_ok_and(|v| v.len() == self.len());
            columns = (0..self.width()).filter(usual).collect();
        }
        time.sampling(self, &columns)
    }

    /// Returns a record of the columns `wanted`, one channel each, on the given time axis. The
    /// numbers are those of the file, in the units that the columns of the file state:
    /// [`Table::to_si`] returns the factors.
    ///
    /// # Errors
    /// [`IoError::DuplicateColumn`] if a column is used twice (the time column included), and those
    /// of [`Table::sampling`] and [`Table::column`].
    pub fn record(
        &self,
        time: &TimeAxis<'_>,
        wanted: &[impl AsRef<str>],
    ) -> Result<Record, IoError> {
        let columns = self.record_columns(time, wanted)?;
        let channels: Vec<&[f64]> =
            columns.iter().map(|c| self.values(*c)).collect::<Result<_, _>>()?;
        let sampling = self.sampling(time, wanted)?;
        let mut data = DMatrix::zeros(sampling.len(), channels.len());
        for (mut into, channel) in data.column_iter_mut().zip(channels) {
            into.copy_from_slice(channel);
        }
        self.signal(Record::new(sampling, data))
    }

    /// Returns the indices of the columns `wanted`; an error if a column is wanted twice, or is
    /// also the time column.
    fn record_columns(
        &self,
        time: &TimeAxis<'_>,
        wanted: &[impl AsRef<str>],
    ) -> Result<Vec<usize>, IoError> {
        let mut used: Vec<&str> = Vec::new();
        if let TimeAxis::Column(column) = time {
            used.push(column);
        }
        used.extend(wanted.iter().map(AsRef::as_ref));
        Ok(self.distinct(&used)?.split_off(used.len() - wanted.len()))
    }

    fn signal<T>(&self, made: Result<T, SignalError>) -> Result<T, IoError> {
        made.map_err(|source| IoError::Signal { file: self.file.clone(), source })
    }

    /// Returns the indices of columns; an error if a column is used twice.
    fn distinct(&self, wanted: &[&str]) -> Result<Vec<usize>, IoError> {
        let columns: Vec<usize> = wanted.iter().map(|w| self.find(w)).collect::<Result<_, _>>()?;
        for (second, column) in columns.iter().enumerate() {
            if let Some(first) = columns[..second].iter().position(|c| c == column) {
                return Err(IoError::DuplicateColumn {
                    file: self.file.clone(),
                    column: column + 1,
                    first: wanted[first].into(),
                    second: wanted[second].into(),
                    available: self.available(),
                });
            }
        }
        Ok(columns)
    }

    /// Returns the common number of samples of the columns `wanted`.
    ///
    /// # Errors
    /// [`IoError::Lengths`] if they differ, and the errors of [`Table::column`].
    pub fn common_length(&self, wanted: &[impl AsRef<str>]) -> Result<usize, IoError> {
        let columns: Vec<usize> =
            wanted.iter().map(|w| self.find(w.as_ref())).collect::<Result<_, _>>()?;
        time_axis::common_length(self, &columns)
    }

    /// Returns the numbers of a column, by its index counted from 0.
    ///
    /// # Errors
    /// As [`Table::column`].
    ///
    /// # Panics
    /// If there is no such column.
    pub fn values(&self, column: usize) -> Result<&[f64], IoError> {
        match &self.contents.columns[column].values {
            Ok(values) => Ok(values),
            Err(why) => Err(why.error(&self.file, self.label(column))),
        }
    }

    /// Returns the time axis of a column in the file, by its index.
    pub(crate) fn axis(&self, column: usize) -> Axis {
        self.contents.columns[column].axis
    }

    /// Returns the name of a column for results, by its index counted from 0: without its unit,
    /// with control characters escaped; `column 2` if the column has no name.
    ///
    /// # Panics
    /// If there is no such column.
    pub fn short_name(&self, column: usize) -> String {
        match without_unit(&self.names[column]).as_str() {
            "" => format!("column {}", column + 1),
            name => escaped(name).to_string(),
        }
    }

    /// Returns number and name of a column for a message, by its index counted from 0: `2 "force"`.
    ///
    /// # Panics
    /// If there is no such column.
    pub fn label(&self, column: usize) -> String {
        match self.names[column].as_str() {
            "" => format!("{}", column + 1),
            name => format!("{} \"{}\"", column + 1, escaped(name)),
        }
    }
}
