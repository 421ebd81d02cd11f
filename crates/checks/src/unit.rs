//! Units in the headers of columns.

use std::fmt::{self, Formatter};

use mechid_signal::message;

use super::digits::up_to_six_digits;
use super::finding::{Check, Names};
use super::{Subject, Verdict};

/// Text in the header of a column that may be a unit.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Unit {
    /// Description of the column.
    pub column: String,
    /// Text in the header.
    pub text: String,
    /// Factor from the unit of the column to the SI unit if the text is read as a unit; `None` if
    /// it is not understood.
    pub factor: Option<f64>,
    /// `true` if the numbers are multiplied by the factor.
    pub used: bool,
    /// SI unit in which the numbers are needed.
    pub si: &'static str,
}

/// Returns whether a text states decibels.
fn is_level(text: &str) -> bool {
    text.get(..2).is_some_and(|start| start.eq_ignore_ascii_case("db"))
}

impl Check for Unit {
    fn subject(&self) -> Subject {
        Subject::Unit
    }

    fn verdict(&self) -> Verdict {
        Verdict::Doubtful
    }

    fn value(&self) -> f64 {
        self.factor.unwrap_or(1.0)
    }

    fn sentence(&self, _: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { column, text, si, .. } = self;
        write!(f, "\"{text}\" in the header of column {column} ")?;
        match (self.factor.map(message::number), self.used) {
            (Some(factor), true) => write!(
                f,
                "is read as a unit: the numbers are multiplied by {factor} to get {si}; if this is \
                 wrong, state the unit (`unit`) or the factor (`scale`)"
            ),
            (Some(factor), false) => write!(
                f,
                "may be a unit with the factor {factor}, which was not applied; the numbers are read as \
                 {si}: state the unit (`unit`) or the factor (`scale`)"
            ),
            (None, _) if is_level(text) => write!(
                f,
                "states decibels: a magnitude in a table of responses is read with a reference of 1 in \
                 SI units unless the header has another one (\"dB re 1 g/N\"); the samples of a record \
                 are read as {si}"
            ),
            (None, _) => write!(
                f,
                "is not a unit that can be converted to {si}, and the numbers are read as {si}: state \
                 the unit (`unit`) or the factor (`scale`)"
            ),
        }
    }
}

/// Time column without a unit, whose numbers are probably not in seconds.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct TimeUnit {
    /// Description of the column.
    pub column: String,
    /// Sampling rate if the instants are in seconds, in Hz.
    pub rate_hz: f64,
    /// Duration of the record if the instants are in seconds, in s.
    pub duration_s: f64,
    /// Unit that may be meant.
    pub unit: &'static str,
    /// Size of `unit`, in s.
    pub factor: f64,
}

impl Check for TimeUnit {
    fn subject(&self) -> Subject {
        Subject::Unit
    }

    fn verdict(&self) -> Verdict {
        Verdict::Doubtful
    }

    fn value(&self) -> f64 {
        self.rate_hz
    }

    fn sentence(&self, _: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { column, rate_hz, duration_s, unit, factor } = self;
        write!(
            f,
            "the time in column {column} has no unit and is taken as seconds: the sampling rate is {} Hz and the \
             duration {} s; in {unit} the rate would be {} Hz: state the unit (`unit`) or `sample_rate`",
            up_to_six_digits(*rate_hz),
            up_to_six_digits(*duration_s),
            up_to_six_digits(rate_hz / factor),
        )
    }
}
