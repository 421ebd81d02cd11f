//! Spectral lines as text.

use std::fmt;
use std::str::FromStr;

use mechid_signal::{Sampling, lines};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::IoError;

/// A choice of spectral lines: `all`, `odd`, `even`, or lists of numbers and ranges such as
/// `1:2:335` (first:step:last), `4:9` and `3`, separated by commas.
///
/// ```
/// use mechid_io::LineSpec;
/// use mechid_signal::Sampling;
///
/// let period = Sampling::new(0.01, 16)?;
/// assert_eq!("odd".parse::<LineSpec>()?.lines(period)?, [1, 3, 5, 7]);
/// assert_eq!("1:3:7,2".parse::<LineSpec>()?.lines(period)?, [1, 2, 4, 7]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LineSpec {
    text: String,
    choice: Choice,
}

#[derive(Debug, Clone, PartialEq, Eq)]
enum Choice {
    All,
    Odd,
    Even,
    Ranges(Vec<Range>),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Range {
    first: usize,
    step: usize,
    last: usize,
}

impl LineSpec {
    /// Returns the lines of a period, ascending, each once, all strictly between DC and Nyquist.
    ///
    /// # Errors
    /// [`IoError::LineOutside`] for DC and for lines at or above Nyquist.
    pub fn lines(&self, sampling: Sampling) -> Result<Vec<usize>, IoError> {
        let mut full = lines::full(sampling);
        match &self.choice {
            Choice::All => {}
            Choice::Odd => full.retain(|n| n % 2 == 1),
            Choice::Even => full.retain(|n| n % 2 == 0),
            Choice::Ranges(ranges) => {
                let highest = full.len();
                for Range { first, last, .. } in ranges {
                    for &line in [first, last] {
                        if !(1..=highest).contains(&line) {
                            let (lines, len) = (self.text.clone(), sampling.len());
                            return Err(IoError::LineOutside { lines, line, highest, len });
                        }
                    }
                }
                full.retain(|n| ranges.iter().any(|r| r.contains(*n)));
            }
        }
        Ok(full)
    }
}

impl Range {
    fn contains(&self, line: usize) -> bool {
        (self.first..=self.last).contains(&line) && (line - self.first).is_multiple_of(self.step)
    }

    fn parse(text: &str) -> Option<Self> {
        let numbers: Vec<usize> =
            text.split(':').map(|n| n.trim().parse().ok()).collect::<Option<_>>()?;
        let (first, step, last) = match numbers[..] {
            [line] => (line, 1, line),
            [first, last] => (first, 1, last),
            [first, step, last] => (first, step, last),
            _ => return None,
        };
        (step > 0 && first <= last).then_some(Self { first, step, last })
    }
}

impl FromStr for LineSpec {
    type Err = IoError;

    fn from_str(text: &str) -> Result<Self, IoError> {
        let choice = match text.trim() {
            "all" => Choice::All,
            "odd" => Choice::Odd,
            "even" => Choice::Even,
            list => Choice::Ranges(
                list.split(',')
                    .map(|part| Range::parse(part.trim()))
                    .collect::<Option<_>>()
                    .ok_or_else(|| IoError::LineSpec { lines: text.into() })?,
            ),
        };
        Ok(Self { text: text.into(), choice })
    }
}

impl fmt::Display for LineSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl<'de> Deserialize<'de> for LineSpec {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(serde::de::Error::custom)
    }
}

impl Serialize for LineSpec {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.text)
    }
}
