//! Files of frequency responses: reading and writing.

use std::path::Path;

use mechid_model::ResponseQuantity;
use mechid_signal::Window;
use nalgebra::Complex;

use crate::limits::{Limits, ReadOptions};
use crate::table::source::{Kind, Source};
use crate::units::{label_notes, name_without_brackets};
use crate::{
    IoError, Quantity, StatedUnit, Table, escaped, response_arrays, response_axis,
    response_columns, uff,
};

/// Frequency responses in a file, at common frequencies and in SI units.
///
/// A text has one row per frequency and a column `frequency_hz` (or `frequency`, `freq`, `f`, or
/// `omega`, `w` in rad/s; otherwise the first column), with its unit (`[kHz]`, `rad/s`, `rpm`) in
/// its name or in a line of units. The response of point i to a force at point j is `h_i_j_real`
/// with `h_i_j_imaginary`, or `h_i_j_magnitude` with `h_i_j_phase_deg` or `h_i_j_phase_rad`;
/// optional columns are `h_i_j_standard_error` and the coherence, `coherence_i` (of the response to
/// all forces) or `coherence_i_j`. A text with one response may omit `h_i_j_` and `_i`. `mechid frf
/// --output` writes this form.
///
/// Magnitudes may be in dB, and units may be in brackets (`real [g/N]`). If a name or a unit is
/// that of an apparent mass, an impedance or a dynamic stiffness, the response is its inverse.
///
/// Further columns have the same number in all rows: `time_derivative` gives the measured quantity
/// (0 displacement, 1 velocity, 2 acceleration), `added_decay` the decay that an exponential window
/// adds to every mode, in 1/s, and `segment_samples`, `segment_hop`, `segments`, `segment_window`
/// (0 whole periods, 1 Hann, 2 Hamming, 3 Blackman, 4 rectangular) and `sample_rate_hz` the
/// segments over which the responses were averaged.
///
/// A MATLAB or HDF5 file has a vector of frequencies with one of these names, and arrays of complex
/// numbers whose dimensions are points of the response, points of the force and frequencies, in any
/// order.
///
/// A universal file has a dataset 58 or 58b per response (function type 4) and coherence (6); its
/// points are nodes with a direction, such as `12+Z`. Units stated in dataset 164 are converted to
/// SI units.
///
/// ```
/// use mechid_io::FrequencyResponses;
///
/// let text = "frequency_hz,magnitude,phase_deg,coherence\n1,2e-3,-90,0.99\n2,1e-3,-120,0.98\n";
/// let responses = FrequencyResponses::parse("a.csv", text.as_bytes())?;
/// assert_eq!(responses.frequency_hz, [1.0, 2.0]);
/// assert!((responses.functions[0].values[0].im + 2e-3).abs() < 1e-18);
/// assert_eq!(responses.coherence[0].values, [0.99, 0.98]);
/// # Ok::<(), mechid_io::IoError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FrequencyResponses {
    /// Name of the file for messages.
    pub file: String,
    /// Frequencies in Hz, one per value of every function.
    pub frequency_hz: Vec<f64>,
    /// Frequency responses, in the order of the file.
    pub functions: Vec<ResponseFunction>,
    /// Coherences, in the order of the file.
    pub coherence: Vec<CoherenceFunction>,
    /// Decay, in 1/s, that an exponential window on force and response adds to every mode; `None`
    /// if there was no window, or if the file does not state it.
    pub added_decay: Option<f64>,
    /// Segments of a record over which the responses were averaged; `None` if the file does not
    /// state them.
    pub segments: Option<AveragedSegments>,
    /// Remarks on parts of the file that were left out or converted.
    pub remarks: Vec<String>,
    /// Columns whose headers have a text that may be a unit: number and name of the column, the
    /// text, and the quantity that its unit should have.
    pub doubts: Vec<(String, StatedUnit, Quantity)>,
    /// Memory, in bytes, that an analysis of the file may use ([`Limits::memory`]); `None` without
    /// a limit, as for responses that are not from a file.
    pub memory: Option<usize>,
}

/// Returns the coherence in a column of this name (`coherence_2_1`, `coherence [%]`); `None` for
/// another column.
fn coherence(
    table: &Table,
    column: usize,
    name: &str,
) -> Result<Option<CoherenceFunction>, IoError> {
    let bare = name_without_brackets(name);
    let is_coherence = bare.to_lowercase().starts_with("coherence");
    let Some(points) = bare.trim().get("coherence".len()..).filter(|_| is_coherence) else {
        return Ok(None);
    };
    let row = table.unit_text(column).trim().trim_matches(['[', ']', '(', ')']).to_owned();
    let is_percent = label_notes(name).into_iter().chain([row]).any(|unit| unit == "%");
    let unit = if is_percent { 0.01 } else { 1.0 };
    let mut points = points.split('_').skip(1).map(|point| point.trim().to_owned());
    let response = points.next().filter(|point| !point.is_empty());
    let response = response.unwrap_or_else(|| ALONE.into());
    let values = table.values(column)?.iter().map(|value| value * unit).collect();
    Ok(Some(CoherenceFunction { response, reference: points.next(), values }))
}

/// Segments of a record over which frequency responses were averaged.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AveragedSegments {
    /// Number of samples in a segment.
    pub samples: usize,
    /// Number of samples from the start of one segment to the start of the next.
    pub hop: usize,
    /// Number of segments.
    pub count: usize,
    /// Window that weights the samples; `None` for whole periods.
    pub window: Option<Window>,
    /// Sampling rate, in Hz.
    pub sample_rate_hz: f64,
}

impl AveragedSegments {
    /// Names of the columns of the numbers that [`AveragedSegments::numbers`] returns, in the same
    /// order.
    pub const COLUMNS: [&str; 5] =
        ["segment_samples", "segment_hop", "segments", "segment_window", "sample_rate_hz"];

    /// Returns the numbers for the columns: samples, hop, count, code of the window, and rate in
    /// Hz.
    pub fn numbers(&self) -> [f64; 5] {
        let code = self.window.and_then(|window| Window::ALL.iter().position(|one| *one == window));
        let code = code.map_or(0, |at| at + 1);
        let [samples, hop, count, window] =
            [self.samples, self.hop, self.count, code].map(|number| number as f64);
        [samples, hop, count, window, self.sample_rate_hz]
    }

    /// Creates the description from the numbers of [`AveragedSegments::numbers`] (pure numbers and
    /// a rate in Hz); `None` if they are impossible.
    pub fn from_numbers(numbers: [f64; 5]) -> Option<Self> {
        let [samples, hop, count, window, sample_rate_hz] = numbers;
        let whole = |value: f64, least: f64| {
            let is_whole = value.fract() == 0.0 && (least..=MOST_SAMPLES).contains(&value);
            is_whole.then_some(value as usize)
        };
        let window = match whole(window, 0.0)? {
            0 => None,
            code => Some(*Window::ALL.get(code - 1)?),
        };
        let (samples, hop, count) = (whole(samples, 2.0)?, whole(hop, 1.0)?, whole(count, 1.0)?);
        let possible = hop <= samples && sample_rate_hz.is_finite() && sample_rate_hz > 0.0;
        possible.then_some(Self { samples, hop, count, window, sample_rate_hz })
    }
}

/// Maximum number of samples; a larger number in a file is an error.
const MOST_SAMPLES: f64 = (1_u64 << 26) as f64;

/// Response at one point per unit force at another point, frequency by frequency.
#[derive(Debug, Clone, PartialEq)]
pub struct ResponseFunction {
    /// Point and direction of the response.
    pub response: String,
    /// Point and direction of the force.
    pub reference: String,
    /// Measured quantity; `None` if the file does not state it.
    pub quantity: Option<ResponseQuantity>,
    /// Values, one per frequency, in m/N, m/(s·N) or m/(s²·N).
    pub values: Vec<Complex<f64>>,
    /// Standard error of the real part and of the imaginary part, one per frequency, in the unit of
    /// the values; `None` if the file has none.
    pub standard_error: Option<Vec<f64>>,
}

/// Fraction of the power of a response that depends linearly on the force.
#[derive(Debug, Clone, PartialEq)]
pub struct CoherenceFunction {
    /// Point and direction of the response.
    pub response: String,
    /// Point and direction of the force; `None` for the multiple coherence with all forces.
    pub reference: Option<String>,
    /// Values, one per frequency, each a ratio from 0 to 1.
    pub values: Vec<f64>,
}

impl FrequencyResponses {
    /// Reads the frequency responses in a file, or on standard input as `-`.
    ///
    /// # Errors
    /// As [`FrequencyResponses::parse`], and [`IoError::Read`].
    pub fn read(path: impl AsRef<Path>) -> Result<Self, IoError> {
        Self::read_with(path, &Limits::DEFAULT)
    }

    /// Reads as [`FrequencyResponses::read`], with other limits on the file and on the memory of
    /// its analysis.
    ///
    /// # Errors
    /// As [`FrequencyResponses::read`].
    pub fn read_with(path: impl AsRef<Path>, limits: &Limits) -> Result<Self, IoError> {
        let source = Source::open(path.as_ref())?;
        let stored = source.stored.clone();
        let responses = Self::from_source(source, limits)?;
        Ok(Self { memory: Some(limits.memory(stored.bytes())), ..responses })
    }

    /// Reads the frequency responses in the bytes of a file; `file` is its name in messages.
    ///
    /// # Errors
    /// [`IoError::Responses`] if the columns of a text are not those of frequency responses,
    /// [`IoError::Empty`] for a universal file without frequency responses, and the errors of
    /// [`Table::parse`] and [`Table::column`].
    pub fn parse(file: impl Into<String>, bytes: &[u8]) -> Result<Self, IoError> {
        Self::from_source(Source::new(file.into(), bytes)?, &Limits::DEFAULT)
    }

    fn from_source(mut source: Source<'_>, limits: &Limits) -> Result<Self, IoError> {
        let options = ReadOptions { skip_lines: 0, limits: *limits };
        let file = source.file.clone();
        let mut responses = match source.kind() {
            Kind::Uff => {
                let bytes = source.bytes(&options.limits)?;
                uff::read_responses(&file, &bytes, source.budget(&options.limits))?
            }
            _ => Self::from_table(&Table::from_source(source, &options)?)?,
        };
        // Names of points are shown in results and messages, so unprintable characters are escaped.
        let shown = |point: &mut String| *point = escaped(point).into_owned();
        for function in &mut responses.functions {
            [&mut function.response, &mut function.reference].into_iter().for_each(shown);
        }
        for coherence in &mut responses.coherence {
            shown(&mut coherence.response);
            coherence.reference.as_mut().map(shown);
        }
        Ok(responses)
    }

    fn from_table(table: &Table) -> Result<Self, IoError> {
        let mut responses = Self { file: table.file().into(), ..Self::default() };
        responses.frequency_hz = response_axis::frequencies(table, &mut responses.doubts)?;
        match table.complex() {
            [] => response_columns::add_functions(table, &mut responses)?,
            arrays => response_arrays::add_functions(table, arrays, &mut responses)?,
        }
        for (column, name) in table.names().iter().enumerate() {
            responses.coherence.extend(coherence(table, column, name.trim())?);
        }
        if responses.functions.is_empty() {
            let (file, available) = (responses.file, table.available());
            return Err(IoError::Responses { file, available });
        }
        response_axis::sort(&mut responses)?;
        let quantity = constant(table, DERIVATIVE)?.and_then(|order| {
            let of = |quantity: &ResponseQuantity| derivative(*quantity) == order;
            ResponseQuantity::ALL.into_iter().find(of)
        });
        if quantity.is_some() {
            responses.functions.iter_mut().for_each(|function| function.quantity = quantity);
        }
        responses.added_decay = constant(table, ADDED_DECAY)?.filter(|rate| *rate > 0.0);
        let mut numbers = [f64::NAN; 5];
        for (number, name) in numbers.iter_mut().zip(AveragedSegments::COLUMNS) {
            *number = constant(table, name)?.unwrap_or(f64::NAN);
        }
        responses.segments = AveragedSegments::from_numbers(numbers);
        let any = AveragedSegments::COLUMNS[..4].iter().any(|name| table.find(name).is_ok());
        if any && responses.segments.is_none() {
            responses.remarks.push(format!(
                "the bias of the window was not corrected, because the columns {} are incomplete, differ from row \
                 to row, or describe impossible segments",
                AveragedSegments::COLUMNS.join(", ")
            ));
        }
        Ok(responses)
    }

    /// Returns the text of a universal file: datasets 151 and 164, and a dataset 58 for each
    /// response and coherence. A point is a node with a direction (`12+Z`), or a node alone.
    ///
    /// # Errors
    /// [`IoError::Point`] for a point of another form, [`IoError::Responses`] if there are no
    /// frequencies.
    ///
    /// # Source
    /// University of Cincinnati, SDRL, *Universal File Formats for Modal Analysis Testing*,
    /// datasets 58, 151 and 164.
    pub fn to_universal_file(&self) -> Result<String, IoError> {
        if self.frequency_hz.is_empty() {
            let file = self.file.clone();
            return Err(IoError::Responses { file, available: "none".into() });
        }
        uff::write_responses(self).map_err(|point| IoError::Point { point })
    }
}

/// Name of the column that gives the measured quantity, as the order of the time derivative of the
/// displacement.
pub const DERIVATIVE: &str = "time_derivative";

/// Name of the column with the decay that an exponential window adds to every mode, in 1/s.
pub const ADDED_DECAY: &str = "added_decay";

/// Returns the order of the time derivative of the displacement that gives this quantity, a pure
/// number: 0 for the displacement, 1 for the velocity, 2 for the acceleration.
pub fn derivative(quantity: ResponseQuantity) -> f64 {
    match quantity {
        ResponseQuantity::Displacement => 0.0,
        ResponseQuantity::Velocity => 1.0,
        ResponseQuantity::Acceleration => 2.0,
    }
}

/// Returns the number that is the same in all rows of a column; `None` if there is no such column,
/// or if the numbers differ.
fn constant(table: &Table, name: &str) -> Result<Option<f64>, IoError> {
    if table.find(name).is_err() {
        return Ok(None);
    }
    let values = table.column(name)?;
    Ok(values.first().copied().filter(|first| values.iter().all(|value| value == first)))
}

/// Name of the point in a table with a single response.
const ALONE: &str = "1";
