//! Scatter of single periods of a response.

use std::fmt::{self, Formatter};

use mechid_estimate::EstimateError;
use mechid_signal::Record;

use super::finding::{Check, Finding, Names};
use super::limits::{PERIOD_SCATTER_BAD, PERIOD_SCATTER_DOUBTFUL};
use super::seam::periodicity;
use super::{Subject, Verdict};

/// Deviation of single periods of the response from their mean.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct PeriodScatter {
    /// Largest RMS deviation of a period, relative to the RMS of the response (pure number).
    pub fraction: f64,
}

/// Returns the deviation of the periods from their mean; for a single period, its seam.
pub(super) fn repetition(response: &Record, period: usize) -> Result<Finding, EstimateError> {
    if response.len() / 2 < period {
        return Ok(periodicity(response));
    }
    Ok(Finding::PeriodScatter(PeriodScatter { fraction: deviation_of_periods(response, period)? }))
}

/// Returns the largest RMS deviation of a period from the mean period, relative to the RMS of the
/// mean period without its constant part.
pub(super) fn deviation_of_periods(record: &Record, period: usize) -> Result<f64, EstimateError> {
    let mean = record.period_mean(period)?;
    let around = mean.without_mean();
    let change = |channel: usize| {
        let (x, mean) = (record.channel(channel), mean.channel(channel));
        let size = around.column(channel).norm();
        let deviation = |period: &[f64]| {
            period.iter().zip(mean).map(|(x, mean)| (x - mean).powi(2)).sum::<f64>().sqrt()
        };
        let largest = x.chunks_exact(period).map(deviation).fold(0.0, f64::max);
        if largest == 0.0 { 0.0 } else { largest / size }
    };
    Ok((0..record.channels()).map(change).fold(0.0, f64::max))
}

impl Check for PeriodScatter {
    fn subject(&self) -> Subject {
        Subject::Periodicity
    }

    fn verdict(&self) -> Verdict {
        Verdict::graded(self.fraction, PERIOD_SCATTER_DOUBTFUL, PERIOD_SCATTER_BAD)
    }

    fn value(&self) -> f64 {
        self.fraction
    }

    fn sentence(&self, _: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "single periods of the response differ from their mean by up to {:.2} %",
            100.0 * self.fraction
        )?;
        f.write_str(match self.verdict() {
            Verdict::Good => "",
            Verdict::Doubtful => {
                ": noise, drift, or a transient that has not decayed; leave out the beginning, or \
                 average more periods"
            }
            Verdict::Bad => ": probably not a steady response with this period; check `period`",
        })
    }
}
