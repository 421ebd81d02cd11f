//! Checks of a record before a fit of its spectra or frequency responses.

use mechid_estimate::frequency_domain::equation_rows;
use mechid_estimate::{Estimate, EstimateError, Unknowns};
use mechid_model::ResponseQuantity;
use mechid_numerics::NumericsError;
use mechid_signal::{Record, Spectrum, lines};
use mechid_spectra::frf::{Frf, FrfAverage, Segments};
use mechid_spectra::{FrequencyData, Lines};
use nalgebra::DMatrix;

use super::before::{conditioning, highest_mode, periodicity, unknowns_of_an_equation};
use super::claimed_period;
use super::finding::{Finding, ModeLimit};
use super::thresholds::{EXCITED_LINE, PERIOD_SCATTER_DOUBTFUL};

/// Amplitude of a line over that of the strongest of its force, above which the response to it shows.
const STRONG_LINE: f64 = 0.01;

/// Checks excitation and conditioning before spectra or frequency responses are fitted: of all
/// experiments that are fitted together, since one shaker at a time excites one degree of freedom each.
///
/// # Errors
/// As [`equation_error`](crate::frequency_domain::equation_error).
///
/// # Source
/// As [`before_fit`](super::before_fit).
pub fn before_spectral_fit(
    data: &FrequencyData,
    unknowns: &Unknowns,
) -> Result<Vec<Finding>, EstimateError> {
    let mut findings = vec![excitation(data, unknowns)];
    match equation_rows(data)?.solve(unknowns) {
        // Nothing else can be checked then.
        Err(EstimateError::Numerics(NumericsError::TooFewRows { .. })) => {}
        solved => findings.push(conditioning(&solved?)),
    }
    Ok(findings)
}

/// Checks whether force (N) and response of one record, in any quantity, consist of periods of `period`
/// samples: the deviation of the periods from their mean or the seam of a single one, and by
/// [`claimed_period`] the force.
///
/// # Errors
/// [`EstimateError::Signal`] if the records are no whole number of periods.
///
/// # Source
/// Ours.
pub fn steady_periods(
    force: &Record,
    response: &Record,
    period: usize,
) -> Result<Vec<Finding>, EstimateError> {
    let mut findings = vec![repetition(response, period)?];
    match claimed_period(force, period) {
        Some(other_period) => findings.push(other_period),
        None => findings.extend(unequal_periods(force, response, period)?),
    }
    Ok(findings)
}

/// Whether the force differs from period to period by more than noise of its channel, which no response
/// would follow.
fn unequal_periods(
    force: &Record,
    response: &Record,
    period: usize,
) -> Result<Option<Finding>, EstimateError> {
    let fraction = deviation_of_periods(force, period)?;
    if fraction < PERIOD_SCATTER_DOUBTFUL {
        return Ok(None);
    }
    let mean = force.period_mean(period)?;
    let spectrum = Spectrum::of(&mean);
    let lines = lines::full(mean.sampling());
    let amplitude = |line: usize, channel: usize| -> f64 { spectrum.line(line, channel).norm() };
    let strongest =
        |channel: usize| lines.iter().map(|line| amplitude(*line, channel)).fold(0.0, f64::max);
    let of_channels: Vec<(usize, f64)> =
        (0..force.channels()).map(|c| (c, strongest(c))).filter(|(_, s)| *s > 0.0).collect();
    let is_strong = |line: &usize| {
        of_channels.iter().any(|(c, strongest)| amplitude(*line, *c) > STRONG_LINE * strongest)
    };
    let chosen = Lines::new(mean.sampling(), lines.iter().copied().filter(is_strong))?;
    let acting: Vec<usize> = of_channels.iter().map(|(channel, _)| *channel).collect();
    let apart = |record: &Record, channels: &[usize]| -> Result<Record, EstimateError> {
        let mean = record.period_mean(period)?;
        let data = DMatrix::from_fn(record.len(), channels.len(), |k, at| {
            record.data()[(k, channels[at])] - mean.data()[(k % period, channels[at])]
        });
        Ok(Record::new(record.sampling(), data)?)
    };
    let all: Vec<usize> = (0..response.channels()).collect();
    // Whatever was measured: a share of power has no unit.
    let quantity = ResponseQuantity::Displacement;
    let mut average =
        FrfAverage::new(chosen, [acting.len(), all.len()], quantity, Segments::Periods(period))?;
    average.push(&apart(force, &acting)?, &apart(response, &all)?)?;
    // The mean was taken off.
    let independent = average.pieces().saturating_sub(1);
    let follows = average.response_follows(independent as f64);
    Ok(follows.then_some(Finding::UnequalPeriods { fraction }))
}

/// Checks the coherence of frequency responses, whose median is judged; `None` without a response.
///
/// # Source
/// Bendat & Piersol, *Random Data*, 4th ed. (2010), chapter 6; the limits are ours.
pub fn coherence(frf: &Frf) -> Option<Finding> {
    let mut coherence: Vec<f64> = frf.coherence().iter().copied().collect();
    coherence.sort_by(f64::total_cmp);
    let (minimum, median) = (*coherence.first()?, coherence[coherence.len() / 2]);
    Some(Finding::Coherence { median, minimum, averages: frf.averages() })
}

/// Number of lines that carry force, against the unknowns.
fn excitation(data: &FrequencyData, unknowns: &Unknowns) -> Finding {
    let force = data.force();
    let floor: Vec<f64> =
        force.column_iter().map(|c| EXCITED_LINE * c.map(|f| f.norm()).max()).collect();
    let excited = |row: &usize| {
        force.row(*row).iter().zip(&floor).any(|(f, floor)| f.norm() > floor.max(0.0))
    };
    let lines = (0..data.len()).filter(excited).count();
    Finding::ExcitedLines { lines, unknowns: unknowns_of_an_equation(unknowns) }
}

/// Deviation of the periods from their mean; of a single period, its seam.
fn repetition(response: &Record, period: usize) -> Result<Finding, EstimateError> {
    if response.len() / 2 < period {
        return Ok(periodicity(response));
    }
    Ok(Finding::PeriodScatter { fraction: deviation_of_periods(response, period)? })
}

/// Largest RMS deviation of a period from the mean of all, over the RMS of that without its constant part.
fn deviation_of_periods(record: &Record, period: usize) -> Result<f64, EstimateError> {
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

/// Checks the highest mode of an estimate against the step from sample to sample
/// ([`Finding::HighestMode`]), in s.
///
/// # Errors
/// [`EstimateError::Undetermined`] or [`EstimateError::Model`] if there are no modes.
///
/// # Source
/// Ours.
pub fn fitted_step(estimate: &Estimate, dt: f64) -> Result<Finding, EstimateError> {
    let [frequency_hz, samples_per_period] = highest_mode(&estimate.system()?, dt)?;
    Ok(Finding::HighestMode { frequency_hz, samples_per_period, limit: ModeLimit::BetweenSamples })
}

/// Checks the highest mode of an estimate against the lines that were fitted and the Nyquist frequency
/// ([`Finding::HighestMode`]); `None` where the data do not determine a machine.
///
/// # Errors
/// [`EstimateError::Model`] if the modes cannot be found.
///
/// # Source
/// Ours.
pub fn fitted_band(estimate: &Estimate, lines: &Lines) -> Result<Option<Finding>, EstimateError> {
    let Ok(system) = estimate.system() else { return Ok(None) };
    let [frequency_hz, samples_per_period] = highest_mode(&system, lines.sampling().dt())?;
    let last = lines.as_slice().iter().copied().max().unwrap_or(0);
    let limit = ModeLimit::Lines { last_hz: last as f64 * lines.sampling().line_spacing_hz() };
    Ok(Some(Finding::HighestMode { frequency_hz, samples_per_period, limit }))
}
