//! Spectral lines that an identification uses.

use std::str::FromStr;

use mechid_io::LineSpec;
use mechid_signal::message::count;
use mechid_signal::{Record, driven_lines, lines};
use serde::{Deserialize, Serialize};

use crate::AnalysisError;
use crate::measurement::Windowed;

/// Spectral lines to identify from.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LineChoice {
    /// Every line at which the force exceeds its noise.
    #[default]
    Driven,
    /// Driven lines within a frequency band.
    Band(Band),
    /// Lines that the settings give by number, including lines that the force does not drive.
    Lines(LineSpec),
}

impl FromStr for LineChoice {
    type Err = String;

    /// Reads the numbers of spectral lines, written as for [`LineSpec`].
    fn from_str(text: &str) -> Result<Self, String> {
        text.parse().map(Self::Lines).map_err(|error: mechid_io::IoError| error.to_string())
    }
}

/// A frequency band, written `low:high`, in Hz.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Band {
    /// Lower end, in Hz.
    pub low_hz: f64,
    /// Upper end, in Hz.
    pub high_hz: f64,
}

impl FromStr for Band {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parsed = text.split_once(':').and_then(|(low, high)| {
            Some(Self { low_hz: low.trim().parse().ok()?, high_hz: high.trim().parse().ok()? })
        });
        parsed
            .filter(|b| b.low_hz >= 0.0 && b.low_hz < b.high_hz && b.high_hz.is_finite())
            .ok_or_else(|| "a band is written low:high, in Hz, such as 40:120".into())
    }
}

/// Returns the lines of one period of the force (`period` samples) to identify from.
///
/// # Errors
/// [`AnalysisError::StillForce`] if there is no driven line, [`AnalysisError::NoExcitedLine`] and
/// [`AnalysisError::EmptyBand`] if no chosen line is driven.
pub fn choose_lines(
    force: &Record,
    period: usize,
    choice: &LineChoice,
) -> Result<Vec<usize>, AnalysisError> {
    let sampling = force.sampling().with_len(period)?;
    let excited = driven_lines(force, period)?;
    let (Some(&first), Some(&last)) = (excited.first(), excited.last()) else {
        return Err(AnalysisError::StillForce { period });
    };
    if let LineChoice::Lines(spec) = choice {
        let chosen = spec.lines(sampling)?;
        if !chosen.iter().any(|n| excited.binary_search(n).is_ok()) {
            return Err(AnalysisError::NoExcitedLine { lines: spec.to_string(), first, last });
        }
        return Ok(chosen);
    }
    let &LineChoice::Band(Band { low_hz, high_hz }) = choice else {
        return Ok(excited);
    };
    let inside = lines::band(sampling, low_hz, high_hz);
    let chosen: Vec<usize> =
        excited.into_iter().filter(|n| inside.binary_search(n).is_ok()).collect();
    if chosen.is_empty() {
        let hz = |line: usize| line as f64 * sampling.line_spacing_hz();
        let (first_hz, last_hz) = (hz(first), hz(last));
        return Err(AnalysisError::EmptyBand { low_hz, high_hz, first_hz, last_hz });
    }
    Ok(chosen)
}

/// Returns a warning if the forces do not drive all lines of the records, with advice; `None` if
/// the settings choose the lines, or if the forces drive all lines.
pub(super) fn few(records: &[Windowed], choice: &LineChoice) -> Option<String> {
    if *choice != LineChoice::Driven {
        return None;
    }
    let (mut driven, mut all) = (0, 0);
    for record in records {
        let period = record.held.period;
        driven += driven_lines(&record.held.force, period).ok()?.len();
        all += period.div_ceil(2).saturating_sub(1);
    }
    (driven < all).then(|| {
        format!(
            "the forces excite only {driven} of {}: excite more lines (multisine, sweep or noise), or \
             use all lines (`lines` all)",
            count(all, "line")
        )
    })
}

#[cfg(test)]
mod tests {
    use mechid_signal::{Multisine, Phases, Sampling};

    use super::*;

    #[test]
    fn excited_lines_are_found_and_bands_cut_them() {
        let sampling = Sampling::new(1.0 / 64.0, 64).unwrap();
        let force = Multisine::flat([3, 5, 7], 2.0, Phases::Schroeder).unwrap();
        let force = force.sample(sampling).unwrap();
        let choose = |spec: Option<&str>, band: Option<&str>| {
            let choice = match (spec, band) {
                (Some(spec), _) => spec.parse().unwrap(),
                (None, Some(band)) => LineChoice::Band(band.parse().unwrap()),
                (None, None) => LineChoice::Driven,
            };
            choose_lines(&force, 64, &choice)
        };
        assert_eq!(choose(None, None).unwrap(), [3, 5, 7]);
        // Given lines are used as they are, including the lines that the force does not drive.
        assert_eq!(choose(Some("1:6"), None).unwrap(), [1, 2, 3, 4, 5, 6]);
        assert_eq!(choose(None, Some("4:7")).unwrap(), [5, 7]);
        assert_eq!(
            choose(None, Some("8:20")).unwrap_err().to_string(),
            "no excited line between 8 and 20 Hz: the excited lines are between 3.000000 and 7.000000 Hz"
        );
        assert_eq!(
            choose(Some("even"), None).unwrap_err().to_string(),
            "no excited line among even: the excited lines are between 3 and 7"
        );
    }

    #[test]
    fn bands_are_low_then_high() {
        for text in ["", "3", "9:3", "3:3", "a:b", "-1:3", "1:inf", "NaN:3"] {
            assert!(text.parse::<Band>().is_err(), "{text}");
        }
    }
}
