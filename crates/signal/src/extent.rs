//! Open records and whole periods.

use std::fmt;

/// Extent of a sampled record: an open record or one whole period.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Extent {
    /// The record is open at both ends: N samples have N − 1 steps between them.
    Open,
    /// One whole period in steady state: the first sample follows the last again, N samples have N
    /// steps.
    #[cfg_attr(feature = "serde", serde(rename = "period"))]
    WholePeriod,
}

impl Extent {
    /// Returns the number of steps between the samples of a record of `samples` samples.
    pub fn steps(self, samples: usize) -> usize {
        match self {
            Extent::Open => samples.saturating_sub(1),
            Extent::WholePeriod => samples,
        }
    }
}

impl fmt::Display for Extent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Extent::Open => "open record",
            Extent::WholePeriod => "whole period",
        })
    }
}
