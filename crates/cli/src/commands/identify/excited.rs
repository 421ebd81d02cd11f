//! The spectral lines an identification uses.

use std::str::FromStr;

use mechid::io::LineSpec;
use mechid::signal::{Record, driven_lines, lines};

use crate::error::CliError;

/// A frequency band, `low:high`, in Hz.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Band {
    low_hz: f64,
    high_hz: f64,
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

/// The lines of one period of the force, of `period` samples, to identify from: the choice as it
/// stands; without one, all lines that are driven (of the band).
///
/// # Errors
/// [`CliError::StillForce`] if there is no driven line at all, [`CliError::NoExcitedLine`] and
/// [`CliError::EmptyBand`] if no chosen line is driven.
pub fn choose_lines(
    force: &Record,
    period: usize,
    spec: Option<&LineSpec>,
    band: Option<Band>,
) -> Result<Vec<usize>, CliError> {
    let sampling = force.sampling().with_len(period)?;
    let excited = driven_lines(force, period)?;
    let (Some(&first), Some(&last)) = (excited.first(), excited.last()) else {
        return Err(CliError::StillForce { period });
    };
    if let Some(spec) = spec {
        let chosen = spec.lines(sampling)?;
        if !chosen.iter().any(|n| excited.binary_search(n).is_ok()) {
            return Err(CliError::NoExcitedLine { lines: spec.to_string(), first, last });
        }
        return Ok(chosen);
    }
    let Some(Band { low_hz, high_hz }) = band else {
        return Ok(excited);
    };
    let inside = lines::band(sampling, low_hz, high_hz);
    let chosen: Vec<usize> =
        excited.into_iter().filter(|n| inside.binary_search(n).is_ok()).collect();
    if chosen.is_empty() {
        let hz = |line: usize| line as f64 * sampling.line_spacing_hz();
        let (first_hz, last_hz) = (hz(first), hz(last));
        return Err(CliError::EmptyBand { low_hz, high_hz, first_hz, last_hz });
    }
    Ok(chosen)
}

#[cfg(test)]
mod tests {
    use mechid::signal::{Multisine, Phases, Sampling};

    use super::*;

    #[test]
    fn excited_lines_are_found_and_bands_cut_them() {
        let sampling = Sampling::new(1.0 / 64.0, 64).unwrap();
        let force = Multisine::flat([3, 5, 7], 2.0, Phases::Schroeder).unwrap();
        let force = force.sample(sampling).unwrap();
        let choose = |spec: Option<&str>, band: Option<&str>| {
            let spec = spec.map(|s| s.parse::<LineSpec>().unwrap());
            choose_lines(&force, 64, spec.as_ref(), band.map(|b| b.parse().unwrap()))
        };
        assert_eq!(choose(None, None).unwrap(), [3, 5, 7]);
        // The choice stands as it is, undriven lines and all.
        assert_eq!(choose(Some("1:6"), None).unwrap(), [1, 2, 3, 4, 5, 6]);
        assert_eq!(choose(None, Some("4:7")).unwrap(), [5, 7]);
        assert_eq!(
            choose(None, Some("8:20")).unwrap_err().to_string(),
            "no excited line between 8 and 20 Hz: the force has its lines between 3.000000 and 7.000000 Hz"
        );
        assert_eq!(
            choose(Some("even"), None).unwrap_err().to_string(),
            "no excited line among even: the force has its lines between 3 and 7"
        );
    }

    #[test]
    fn bands_are_low_then_high() {
        for text in ["", "3", "9:3", "3:3", "a:b", "-1:3", "1:inf", "NaN:3"] {
            assert!(text.parse::<Band>().is_err(), "{text}");
        }
    }
}
