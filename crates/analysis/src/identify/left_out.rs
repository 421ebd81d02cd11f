//! Spectral lines that an identification excludes.

use std::str::FromStr;

use mechid_io::LineSpec;
use mechid_signal::{Record, Sampling, driven_lines, lines};
use serde::{Deserialize, Serialize};

use super::lines::{LineChoice, choose_lines};
use crate::AnalysisError;
use crate::measurement::Block;

/// Lines with contributions other than the response to the force, such as run-out or mains hum.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LeftOut {
    /// Numbers of lines.
    pub lines: Option<LineSpec>,
    /// Frequencies whose lines are excluded.
    pub frequencies: Vec<Disturbance>,
}

/// A frequency at which a disturbance acts, written `50`, `50:0.5` with half the width of the band
/// around it, `24.5:multiples` or `24.5:0.3:multiples`, in Hz.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Disturbance {
    /// Frequency, in Hz.
    pub frequency_hz: f64,
    /// Half the width of the band around the frequency, in Hz; `None` for the nearest lines only:
    /// one if the frequency is on a line, two if it is between lines.
    #[serde(default)]
    pub half_width_hz: Option<f64>,
    /// `true` if the multiples of the frequency are disturbed, too.
    #[serde(default)]
    pub multiples: bool,
}

impl Disturbance {
    /// Returns a disturbance at the frequency of a rotation (Hz) and at the multiples of this
    /// frequency.
    pub fn rotation(frequency_hz: f64) -> Self {
        Self { frequency_hz, half_width_hz: None, multiples: true }
    }

    fn read(text: &str) -> Option<Self> {
        let positive =
            |text: &str| text.parse().ok().filter(|hz: &f64| *hz > 0.0 && hz.is_finite());
        let parts: Vec<&str> = text.split(':').map(str::trim).collect();
        let (numbers, multiples) = match parts.as_slice() {
            [numbers @ .., "multiples"] => (numbers, true),
            numbers => (numbers, false),
        };
        let (frequency_hz, half_width_hz) = match *numbers {
            [hz] => (positive(hz)?, None),
            [hz, half_width] => (positive(hz)?, Some(positive(half_width)?)),
            _ => return None,
        };
        Some(Self { frequency_hz, half_width_hz, multiples })
    }

    /// Returns whether the disturbance affects a line at this frequency (Hz) of a spectrum with
    /// lines `spacing_hz` apart.
    pub fn reaches(&self, line_hz: f64, spacing_hz: f64) -> bool {
        let multiple =
            if self.multiples { (line_hz / self.frequency_hz).round().max(1.0) } else { 1.0 };
        let apart = (line_hz - multiple * self.frequency_hz).abs();
        match self.half_width_hz {
            // A frequency between two lines affects both.
            None => apart < spacing_hz * (1.0 - 1e-6),
            Some(half_width_hz) => apart <= half_width_hz + 1e-6 * spacing_hz,
        }
    }
}

impl FromStr for Disturbance {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::read(text).ok_or_else(|| {
            format!(
                "a frequency to leave out is written as 50, 50:0.5 (Hz to either side), 24.5:multiples or \
                 24.5:0.3:multiples, not `{text}`"
            )
        })
    }
}

/// Lines to identify from: a choice without the excluded lines.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LineRule<'a> {
    pub choice: &'a LineChoice,
    pub without: &'a LeftOut,
}

impl LineRule<'_> {
    /// Returns the lines of a period of the force.
    ///
    /// # Errors
    /// The errors of [`choose_lines`]; [`AnalysisError::Setting`] if all lines are excluded, and if
    /// an excluded line does not exist.
    pub fn lines(&self, force: &Record, period: usize) -> Result<Vec<usize>, AnalysisError> {
        let chosen = choose_lines(force, period, self.choice)?;
        self.without.keep(chosen, force.sampling().with_len(period)?)
    }
}

impl LeftOut {
    /// Returns the lines of a period that are not excluded.
    pub(crate) fn keep(
        &self,
        mut lines: Vec<usize>,
        period: Sampling,
    ) -> Result<Vec<usize>, AnalysisError> {
        let count = lines.len();
        if let Some(without) = &self.lines {
            let without = without.lines(period)?;
            lines.retain(|line| without.binary_search(line).is_err());
        }
        let spacing_hz = period.line_spacing_hz();
        let reached = |line: &usize| {
            let hz = *line as f64 * spacing_hz;
            self.frequencies.iter().any(|disturbance| disturbance.reaches(hz, spacing_hz))
        };
        lines.retain(|line| !reached(line));
        if lines.is_empty() && count > 0 {
            let why = format!("all lines are excluded: {count} of {count}");
            return Err(AnalysisError::Setting { setting: "without", why });
        }
        Ok(lines)
    }
}

/// Returns the lines of a fit with nonlinear terms. Lines without force are included: on these
/// lines the nonlinear forces must balance the forces of mass, damping and stiffness.
pub(super) fn all_lines(held: &Block, rule: LineRule<'_>) -> Result<Vec<usize>, AnalysisError> {
    let sampling = held.force.sampling().with_len(held.period)?;
    let driven = rule.lines(&held.force, held.period)?;
    let lines = match rule.choice {
        LineChoice::Lines(_) => driven,
        LineChoice::Band(band) => lines::band(sampling, band.low_hz, band.high_hz),
        LineChoice::Driven => {
            let last = driven_lines(&held.force, held.period)?.last().copied().unwrap_or(1);
            (1..=last).collect()
        }
    };
    rule.without.keep(lines, sampling)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns which of the lines 1 to 12 of a record of 1 s are kept; the lines are 1 Hz apart.
    fn kept(lines: Option<&str>, frequencies: &[&str]) -> Result<Vec<usize>, AnalysisError> {
        let lines = lines.map(|text| text.parse().unwrap());
        let frequencies = frequencies.iter().map(|text| text.parse().unwrap()).collect();
        let period = Sampling::from_rate_hz(100.0, 100).unwrap();
        LeftOut { lines, frequencies }.keep((1..=12).collect(), period)
    }

    #[test]
    fn lines_and_frequencies_are_left_out() {
        assert_eq!(kept(None, &[]).unwrap().len(), 12);
        assert_eq!(kept(Some("1:9,11"), &[]).unwrap(), [10, 12]);
        assert_eq!(kept(None, &["5"]).unwrap(), [1, 2, 3, 4, 6, 7, 8, 9, 10, 11, 12]);
        // A frequency between two lines affects both.
        assert_eq!(kept(None, &["5.3"]).unwrap(), [1, 2, 3, 4, 7, 8, 9, 10, 11, 12]);
        assert_eq!(kept(None, &["5:2"]).unwrap(), [1, 2, 8, 9, 10, 11, 12]);
        assert_eq!(kept(None, &["4:multiples"]).unwrap(), [1, 2, 3, 5, 6, 7, 9, 10, 11]);
        assert_eq!(kept(None, &["4:1:multiples", "2"]).unwrap(), [1, 6, 10]);
        let error = kept(None, &["1:multiples"]).unwrap_err().to_string();
        assert!(error.contains("all lines are excluded: 12 of 12"), "{error}");
        assert!(kept(Some("60"), &[]).is_err());
    }

    #[test]
    fn frequencies_are_written_in_one_way() {
        for text in
            ["", "0", "-5", "NaN", "inf", "5:", "5:0", "5:multiples:1", "5:1:2", "5:multiple"]
        {
            assert!(text.parse::<Disturbance>().is_err(), "{text}");
        }
    }
}
