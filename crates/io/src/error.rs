//! Errors of reading and writing files.

use mechid_model::ModelError;
use mechid_signal::{SignalError, message};

use crate::escape::Message;
use crate::{DecimalSign, Limit, Place, Quantity};

/// Error of a file that cannot be read or written; every message names the file and the position in
/// it.
///
/// Lines and columns are counted from 1; lines are those of a text editor.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum IoError {
    /// The file cannot be read.
    #[error("{}", Message(format_args!("cannot read {file}: {source}")))]
    Read {
        /// The file.
        file: String,
        /// Cause.
        source: std::io::Error,
    },
    /// The file cannot be written; no partial file remains.
    #[error("{}", Message(format_args!("cannot write {file}: {source}")))]
    Write {
        /// The file.
        file: String,
        /// Cause.
        source: std::io::Error,
    },
    /// An output would replace an input.
    #[error("{}", Message(format_args!("{output} is the input {input}, which would be lost: write to another file")))]
    OutputIsInput {
        /// The output.
        output: String,
        /// The input.
        input: String,
    },
    /// The gzip data of the file are damaged.
    #[error("{}", Message(format_args!("{file} is damaged or cut short (gzip: {source})")))]
    Gzip {
        /// The file.
        file: String,
        /// Cause.
        source: std::io::Error,
    },
    /// The file is HDF5, but the feature `hdf5`, which reads it, is not enabled.
    #[error("{}", Message(format_args!("{file} is an HDF5 file, as MATLAB files of version 7.3 are, but \
        this program was compiled without HDF5: in MATLAB, save it with -v7")))]
    Hdf5 {
        /// The file.
        file: String,
    },
    /// The file is binary and of an unknown format.
    #[error("{}", Message(format_args!("{file} is neither text nor in a known format: MATLAB level 5 \
         (save with -v7) or 7.3, HDF5, universal file with datasets 58, Parquet, or one of these \
         compressed with gzip")))]
    UnknownFormat {
        /// The file.
        file: String,
    },
    /// The Parquet file is damaged or uses a part of the format that is not supported.
    #[error("{}", Message(format_args!("{file} is damaged, or a Parquet file of a kind that cannot be read: {what}")))]
    Parquet {
        /// The file.
        file: String,
        /// Cause.
        what: String,
    },
    /// A value in the column that identifies the record of each row is missing or of a wrong type.
    #[error("{}", Message(format_args!("{file}: column {column} should name the record of each row, by text or a whole number; \
        in row {row} (counted from 1) it holds {what}")))]
    RecordColumn {
        /// The file.
        file: String,
        /// The column.
        column: String,
        /// The row, counted from 1.
        row: usize,
        /// Description of the value that the column has in this row.
        what: &'static str,
    },
    /// The rows of one record are not consecutive.
    #[error("{}", Message(format_args!("{file}: record {id} continues in row {row} (counted from 1) after rows of other records: sort the \
        rows by record and time")))]
    RecordApart {
        /// The file.
        file: String,
        /// The record.
        id: String,
        /// The row, counted from 1.
        row: usize,
    },
    /// The file breaks its format.
    #[error("{}", Message(format_args!("{file}, {at}: {what}")))]
    Malformed {
        /// The file.
        file: String,
        /// Place in the file.
        at: Place,
        /// Cause.
        what: String,
    },
    /// The file is larger than a limit that guards against damaged and forged files.
    #[error("{}", Message(format_args!("{file}, {at}: {limit}; if the record is correct, raise the limit")))]
    TooLarge {
        /// The file.
        file: String,
        /// Place in the file.
        at: Place,
        /// The limit, see [`Limits`](crate::Limits).
        limit: Limit,
    },
    /// The simulation of a description needs more memory than its limit.
    #[error("{}", Message(format_args!("{file}: {numbers} numbers (samples × periods × degrees of freedom) take about {needed_gb:.1} GB \
        of memory, and {allowed_gb:.1} GB is the limit; if the memory is available, set `memory_gb`: {}", needed_gb.ceil())))]
    SimulationMemory {
        /// The description.
        file: String,
        /// Number of samples per period, times the number of periods, times the larger of the
        /// numbers of forced and of recorded degrees of freedom.
        numbers: usize,
        /// Estimate of the required memory, in units of GB.
        needed_gb: f64,
        /// The limit, in units of GB.
        allowed_gb: f64,
    },
    /// The file is JSON, which contains descriptions and reports but no record.
    #[error("{}", Message(format_args!("{file} is JSON, not a table of samples; simulate, sweep and stability \
         read the description of an experiment; modes, predict and force (as `system`) read a machine or a \
         saved result")))]
    JsonRecord {
        /// The file.
        file: String,
    },
    /// Text precedes the table.
    #[error("{}", Message(format_args!("{file}: the table seems to begin on line {line}, with {}; if so, skip the lines \
         above it with `skip_lines` {}",
        message::count(*fields, "field"),
        line - 1)))]
    AboveTable {
        /// The file.
        file: String,
        /// Line number of the header or of the first row of numbers.
        line: u64,
        /// Number of fields on the first line of the table.
        fields: usize,
    },
    /// Header lines are to be skipped in a file that is not text.
    #[error("{}", Message(format_args!("{file} is not text, so it has no lines to skip")))]
    NothingToSkip {
        /// The file.
        file: String,
    },
    /// The file has no line of numbers.
    #[error("{}", Message(format_args!("{file} holds no data: {found}")))]
    Empty {
        /// The file.
        file: String,
        /// Statement of what the file lacks.
        found: &'static str,
    },
    /// A line has more or fewer fields than the first line.
    #[error("{}", Message(format_args!("{file}, line {line}: this line has {}, but the first line has \
        {expected}", message::count(*got, "field"))))]
    Ragged {
        /// The file.
        file: String,
        /// Line of the file.
        line: u64,
        /// Number of fields on the line.
        got: usize,
        /// Number of fields on the first line.
        expected: usize,
    },
    /// The file has no column of this name or number.
    #[error("{}", Message(format_args!("{file} has no column \"{wanted}\"; its columns are {available}")))]
    MissingColumn {
        /// The file.
        file: String,
        /// Requested name or number.
        wanted: String,
        /// Numbers and names of the columns of the file.
        available: String,
    },
    /// Several columns have the requested name.
    #[error("{}", Message(format_args!("{file} has several columns \"{wanted}\"; choose one by its number: {candidates}")))]
    AmbiguousColumn {
        /// The file.
        file: String,
        /// Requested name or number.
        wanted: String,
        /// Numbers and names of the columns of that name.
        candidates: String,
        /// Indices of these columns, counted from 0.
        columns: Vec<usize>,
    },
    /// One column was requested twice.
    #[error("{}", Message(format_args!("column {column} of {file} is used twice, as \"{first}\" and as \"{second}\"; its columns are {available}")))]
    DuplicateColumn {
        /// The file.
        file: String,
        /// Number of the column.
        column: usize,
        /// Name of the column in the first request.
        first: String,
        /// Name of the column in the second request.
        second: String,
        /// Numbers and names of the columns of the file.
        available: String,
    },
    /// A field has text where a number is needed.
    #[error("{}", Message(format_args!("{file}, line {line}, column {column}: \"{text}\" is not a number")))]
    NotANumber {
        /// The file.
        file: String,
        /// Line of the file.
        line: u64,
        /// Number and name of the column.
        column: String,
        /// Content of the field.
        text: String,
    },
    /// A field is empty where a number is needed.
    #[error("{}", Message(format_args!("{file}, line {line}, column {column}: the field is empty, a number is needed")))]
    EmptyField {
        /// The file.
        file: String,
        /// Line of the file.
        line: u64,
        /// Number and name of the column.
        column: String,
    },
    /// A number has another decimal sign than the numbers before it.
    #[error("{}", Message(format_args!("{file}, line {line}, column {column}: \"{text}\" does not have \
         the decimal {sign} that the other numbers of the file have: use one decimal sign, and no separator \
         between thousands")))]
    MixedDecimalSigns {
        /// The file.
        file: String,
        /// Line of the file.
        line: u64,
        /// Number and name of the column.
        column: String,
        /// Content of the field.
        text: String,
        /// The decimal sign of the other numbers.
        sign: DecimalSign,
    },
    /// The contents of a column are not real numbers.
    #[error("{}", Message(format_args!("{file}, column {column}: it holds {what}, but a channel needs real numbers over time")))]
    NoNumbers {
        /// The file.
        file: String,
        /// Number and name of the column.
        column: String,
        /// Description of the content of the column.
        what: String,
    },
    /// A column is in a unit of another quantity.
    #[error("{}", Message(format_args!(
        "{file}, column {column}: its unit {unit} is a unit of {quantity}, but a unit of {wanted} is needed"
    )))]
    OtherQuantity {
        /// The file.
        file: String,
        /// Number and name of the column.
        column: String,
        /// Unit of the column.
        unit: String,
        /// Quantity of the unit.
        quantity: Quantity,
        /// Quantity needed.
        wanted: Quantity,
    },
    /// A text that should be a unit is not one.
    #[error("{}", Message(format_args!("\"{text}\" is not a known unit of force, response or time: examples of units are kN, lbf, \
        mm, in, m/s^2, g, ms")))]
    NoUnit {
        /// The text.
        text: String,
    },
    /// The factor of a column is zero or not finite.
    #[error("{}", Message(format_args!("the scale of a column must be a finite number other than 0, got {factor}",
        factor = message::number(*factor))))]
    NoScale {
        /// The factor given.
        factor: f64,
    },
    /// Two units, two factors, or a unit and a factor were set for one column.
    #[error("{}", Message(format_args!("two units or scales were set for column {column}: set only one, a `unit` or a \
        `scale` (the factor to SI units)")))]
    TwoUnits {
        /// Number and name of the column.
        column: String,
    },
    /// A sample is NaN or infinite.
    #[error("{}", Message(format_args!("{file}, {at}, column {column}: {value} is not a finite number", value = message::number(*value))))]
    NotFinite {
        /// The file.
        file: String,
        /// Line of the file, or sample of the column.
        at: Place,
        /// Number and name of the column.
        column: String,
        /// The value, in the unit of the column.
        value: f64,
    },
    /// The instants of the time column are not equally spaced.
    #[error("{}", Message(format_args!("{file}: the time steps are not uniform: the step up to {at} is {} s, \
         but the usual step is {} s ({})",
        message::number(six_digits(*step)),
        message::number(six_digits(*usual)),
        remedy(*step, *usual))))]
    NonUniformTime {
        /// The file.
        file: String,
        /// Sample at the end of the step that differs most from the median step.
        at: Place,
        /// The step that differs most from the median, in seconds.
        step: f64,
        /// The median step, in seconds.
        usual: f64,
    },
    /// A record of one sample has no time step.
    #[error("{}", Message(format_args!("{file} holds a single sample: the time step of a time column needs at least two")))]
    SingleSample {
        /// The file.
        file: String,
    },
    /// Columns of one record have different lengths.
    #[error("{}", Message(format_args!("{file}: the columns of a record need the same number of samples; column {lengths}")))]
    Lengths {
        /// The file.
        file: String,
        /// The columns and their lengths.
        lengths: String,
    },
    /// The file states no sampling instants for a column.
    #[error("{}", Message(format_args!("{file} does not say when column {column} was sampled: give a time column or a rate")))]
    NoTimeAxis {
        /// The file.
        file: String,
        /// Number and name of the column.
        column: String,
    },
    /// Columns of one record were sampled at different instants.
    #[error("{}", Message(format_args!("{file}: the columns of a record need the same time axis; column {first} \
         begins at {first_start} s with steps of {first_step} s, column {second} at {second_start} s with steps \
         of {second_step} s",
        first_start = message::number(*first_start),
        first_step = message::number(*first_step),
        second_start = message::number(*second_start),
        second_step = message::number(*second_step))))]
    TimeAxes {
        /// The file.
        file: String,
        /// Number and name of one column.
        first: String,
        /// First instant of the first column, in seconds.
        first_start: f64,
        /// Step of the first column, in seconds.
        first_step: f64,
        /// Number and name of the other column.
        second: String,
        /// First instant of the second column, in seconds.
        second_start: f64,
        /// Step of the second column, in seconds.
        second_step: f64,
    },
    /// The given rate contradicts the rate in the file.
    #[error("{}", Message(format_args!("the sample rate {rate_hz} Hz contradicts {file}: column {column} has {own_hz} Hz (leave \
         the rate out)",
        own_hz = message::number(*own_hz), rate_hz = message::number(*rate_hz))))]
    RateContradicts {
        /// The file.
        file: String,
        /// Number and name of the column.
        column: String,
        /// Rate in the file, in Hz.
        own_hz: f64,
        /// Given rate, in Hz.
        rate_hz: f64,
    },
    /// Two numbers in a file state different sampling rates.
    #[error("{}", Message(format_args!("{file} states two sample rates: {first} = {first_value}, which is {first_hz} Hz, and {second} = {second_value}, which is {second_hz} Hz; give the right one as `sample_rate`",
        first_value = message::number(*first_value), second_value = message::number(*second_value),
        first_hz = message::number(*first_hz), second_hz = message::number(*second_hz))))]
    StatedRates {
        /// The file.
        file: String,
        /// Name of the first number.
        first: String,
        /// Value of the first number, in Hz or s.
        first_value: f64,
        /// Sampling rate that the first number states, in Hz.
        first_hz: f64,
        /// Name of the second number.
        second: String,
        /// Value of the second number, in Hz or s.
        second_value: f64,
        /// Sampling rate that the second number states, in Hz.
        second_hz: f64,
    },
    /// The sampling rate is not positive and finite.
    #[error("{}", Message(format_args!("the sample rate must be a positive finite number of Hz, got {rate_hz}",
        rate_hz = message::number(*rate_hz))))]
    SampleRate {
        /// Given rate, in Hz.
        rate_hz: f64,
    },
    /// The numbers do not form a valid record.
    #[error("{}", Message(format_args!("{file}: {source}")))]
    Signal {
        /// The file.
        file: String,
        /// Cause.
        source: SignalError,
    },
    /// The file is not JSON.
    #[error("{}", Message(format_args!("{file} is not JSON: an experiment, a machine or a saved result is an object \
        in braces, {{ … }}")))]
    NotJson {
        /// The file.
        file: String,
    },
    /// The text is not a valid description of an experiment.
    #[error("{}", Message(format_args!("{file}: {field}{source}")))]
    Json {
        /// The file.
        file: String,
        /// Path of the field, followed by a colon; empty if the error concerns the whole text.
        field: String,
        /// Cause, with line and column.
        source: serde_json::Error,
    },
    /// The description of an experiment contradicts itself.
    #[error("{}", Message(format_args!("{file}: {what}")))]
    Description {
        /// The file.
        file: String,
        /// Cause.
        what: String,
    },
    /// An entry of the covariance in the report is null, because the record did not determine it.
    #[error("{}", Message(format_args!("{file}: the covariance of {parameters} is not known (null), \
         because the record of the identification did not determine {parameters}. Identify the machine \
         again from a record with more excitation, or delete \"covariance\" from the file; the machine \
         then counts as exactly known")))]
    Undetermined {
        /// The file.
        file: String,
        /// Names of the parameters.
        parameters: String,
    },
    /// The matrices do not form a valid system.
    #[error("{}", Message(format_args!("{file}: {source}")))]
    Model {
        /// The file.
        file: String,
        /// Cause.
        source: ModelError,
    },
    /// A text is not a valid choice of spectral lines.
    #[error("{}", Message(format_args!("\"{lines}\" is not a choice of lines: write all, odd, even, or numbers and ranges such as \
         1:2:335 (first:step:last) separated by commas")))]
    LineSpec {
        /// Selection of lines, as the user wrote it.
        lines: String,
    },
    /// A text has no columns of frequency responses.
    #[error("{}", Message(format_args!("{file} has no frequency response: name columns h_1_1_real and h_1_1_imaginary, or \
         h_1_1_magnitude and h_1_1_phase_deg (response, then force); its columns are {available}")))]
    Responses {
        /// The file.
        file: String,
        /// Numbers and names of the columns of the file.
        available: String,
    },
    /// A point does not have the form of node and direction that universal files use.
    #[error("{}", Message(format_args!("\"{point}\" is not a point of a universal file: write a node and a direction such as 12+Z \
         (X, Y, Z, RX, RY or RZ)")))]
    Point {
        /// The point.
        point: String,
    },
    /// A chosen spectral line does not exist in the spectrum of a period.
    #[error("{}", Message(format_args!("lines {lines}: line {line} is not between 1 and {highest}, the last line below the Nyquist \
         frequency of a period of {}", message::count(*len, "sample"))))]
    LineOutside {
        /// Selection of lines, as the user wrote it.
        lines: String,
        /// Line that does not exist.
        line: usize,
        /// Highest line of the period.
        highest: usize,
        /// Number of samples in the period.
        len: usize,
    },
}

/// Rounds a number to six digits, which removes the digits that come from rounding errors.
fn six_digits(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value)
}

/// Returns the remedy for a time step that differs from the usual one, both in s.
fn remedy(step: f64, usual: f64) -> &'static str {
    if usual > 0.0 && step < 0.0 {
        "the time goes back, as if a second record had been appended: keep each record in a separate file"
    } else {
        "resample the record, or give the sample rate instead of the time column if the times are \
         only rounded"
    }
}
