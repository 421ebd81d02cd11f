//! Periods with different forces and, consequently, different responses.

use std::fmt::{self, Formatter};

use mechid_estimate::EstimateError;
use mechid_model::ResponseQuantity;
use mechid_signal::Record;
use mechid_signal::Spectrum;
use mechid_signal::lines;
use mechid_spectra::Lines;
use mechid_spectra::frf::FrfAverage;
use mechid_spectra::frf::Segments;
use nalgebra::DMatrix;

use super::finding::{Check, Finding, Names};
use super::limits::{PERIOD_SCATTER_DOUBTFUL, STRONG_LINE};
use super::period_scatter::deviation_of_periods;
use super::{Subject, Verdict};

/// Force that differs from period to period, with a response that follows.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct UnequalPeriods {
    /// Largest RMS deviation of a period, relative to the RMS of the force (pure number).
    pub fraction: f64,
}

/// Tests whether the force differs from period to period by more than the noise of its channel. The
/// noise of the channel causes no response.
pub(super) fn unequal_periods(
    force: &Record,
    response: &Record,
    period: usize,
) -> Result<Option<Finding>, EstimateError> {
    let fraction = deviation_of_periods(force, period)?;
    if fraction < PERIOD_SCATTER_DOUBTFUL {
        return Ok(None);
    }
    let mean = force.period_mean(period)?;
    let spectrum = Spectrum::from_record(&mean);
    let lines = lines::full(mean.sampling());
    let amplitude = |line: usize, channel: usize| -> f64 { spectrum.line(line, channel).norm() };
    let strongest =
        |channel: usize| lines.iter().map(|line| amplitude(*line, channel)).fold(0.0, f64::max);
    let channels: Vec<(usize, f64)> =
        (0..force.channels()).map(|c| (c, strongest(c))).filter(|(_, s)| *s > 0.0).collect();
    let is_strong = |line: &usize| {
        channels.iter().any(|(c, strongest)| amplitude(*line, *c) > STRONG_LINE * strongest)
    };
    let chosen = Lines::new(mean.sampling(), lines.iter().copied().filter(is_strong))?;
    let acting: Vec<usize> = channels.iter().map(|(channel, _)| *channel).collect();
    let deviations = |record: &Record, channels: &[usize]| -> Result<Record, EstimateError> {
        let mean = record.period_mean(period)?;
        let data = DMatrix::from_fn(record.len(), channels.len(), |k, at| {
            record.data()[(k, channels[at])] - mean.data()[(k % period, channels[at])]
        });
        Ok(Record::new(record.sampling(), data)?)
    };
    let responses: Vec<usize> = (0..response.channels()).collect();
    // Any quantity gives the same result: a share of power has no unit.
    let quantity = ResponseQuantity::Displacement;
    let mut average = FrfAverage::new(
        chosen,
        [acting.len(), responses.len()],
        quantity,
        Segments::Periods(period),
    )?;
    average.push(&deviations(force, &acting)?, &deviations(response, &responses)?)?;
    // The subtraction of the mean removes one independent period.
    let independent = average.pieces().saturating_sub(1);
    let follows = average.response_follows(independent as f64);
    Ok(follows.then_some(Finding::UnequalPeriods(UnequalPeriods { fraction })))
}

impl Check for UnequalPeriods {
    fn subject(&self) -> Subject {
        Subject::Periodicity
    }

    fn verdict(&self) -> Verdict {
        Verdict::Bad
    }

    fn value(&self) -> f64 {
        self.fraction
    }

    fn sentence(&self, _: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "single periods of the force differ from their mean by up to {:.2} %, and the response \
             follows these differences: the test is not periodic, and the differences are not noise. Average frequency \
             responses over the periods (`from_frf`), or fit the strokes of a hammer as `hits`",
            100.0 * self.fraction
        )
    }
}
