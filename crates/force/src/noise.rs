//! Noise in the measured channels.

use mechid_signal::{Record, Spectrum};

use crate::error::ForceError;
use crate::lines::inner_lines;
use crate::measurement::Measurement;

/// Knowledge of the noise in the measured channels, which is assumed white.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Noise {
    /// Unknown noise: no standard error, and channels are weighted by their size.
    Unknown,
    /// One standard deviation per channel, in the channel's unit.
    PerChannel(Vec<f64>),
    /// Noise measured on the lines that the caller did not choose (without DC and Nyquist). The
    /// force is assumed zero on these lines, so the response is noise. At least
    /// [`MIN_OUTSIDE_LINES`] such lines are needed.
    OutsideLines,
}

/// Minimum number of lines for a noise level by [`Noise::OutsideLines`]: each line gives two
/// degrees of freedom, so that the level is known to about 20 % or better.
pub const MIN_OUTSIDE_LINES: usize = 8;

impl Noise {
    /// Returns the standard deviation of the noise per channel, if it is known.
    pub(crate) fn resolve(
        &self,
        measured: &Measurement,
        spectrum: &Spectrum,
        lines: &[usize],
    ) -> Result<Option<Vec<f64>>, ForceError> {
        match self {
            Noise::Unknown => Ok(None),
            Noise::PerChannel(level) => {
                if level.len() != measured.channels().len() {
                    return Err(ForceError::ChannelCount {
                        record: measured.channels().len(),
                        described: level.len(),
                    });
                }
                match level.iter().find(|value| !(**value > 0.0 && value.is_finite())) {
                    Some(&value) => Err(ForceError::NotPositive { what: "noise level", value }),
                    None => Ok(Some(level.clone())),
                }
            }
            Noise::OutsideLines => outside_level(measured, spectrum, lines).map(Some),
        }
    }
}

/// Returns σ of each channel, from σ² = N/4 · mean |X_n|² over the lines that are not in `lines`.
fn outside_level(
    measured: &Measurement,
    spectrum: &Spectrum,
    lines: &[usize],
) -> Result<Vec<f64>, ForceError> {
    let chosen: std::collections::HashSet<usize> = lines.iter().copied().collect();
    let outside: Vec<usize> =
        inner_lines(measured).into_iter().filter(|n| !chosen.contains(n)).collect();
    if outside.len() < MIN_OUTSIDE_LINES {
        return Err(ForceError::TooFewOutsideLines {
            outside: outside.len(),
            needed: MIN_OUTSIDE_LINES,
        });
    }
    let per_line = measured.sampling().len() as f64 / (4.0 * outside.len() as f64);
    (0..spectrum.channels())
        .map(|c| {
            let power: f64 = outside.iter().map(|n| spectrum.line(*n, c).norm_sqr()).sum();
            let value = (per_line * power).sqrt();
            if value > 0.0 { Ok(value) } else { Err(ForceError::NoNoise { channel: c + 1 }) }
        })
        .collect()
}

/// Root mean square of each channel, or 1 for a channel of zeros.
pub(crate) fn channel_sizes(record: &Record) -> Vec<f64> {
    let rms = |norm: f64| norm / (record.len() as f64).sqrt();
    record
        .data()
        .column_iter()
        .map(|column| Some(rms(column.norm())).filter(|size| *size > 0.0).unwrap_or(1.0))
        .collect()
}
