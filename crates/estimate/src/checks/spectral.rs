//! Whether a record will do for a fit of its spectra.

use mechid_model::ResponseQuantity;
use mechid_signal::{Record, counted};

use super::before::{
    LINE_FLOOR, conditioning, fastest_mode, grade, periodicity, unknowns_of_an_equation,
};
use super::{Check, Subject, Verdict, claimed_period};
use crate::frequency_domain::{FrequencyData, Lines, RepeatedPeriods, equation_rows};
use crate::{Estimate, EstimateError, Frf, Unknowns};

/// Periods that differ from their mean by these shares of the motion are hardly, or not, periods of
/// one steady motion.
const DOUBTFUL_CHANGE: f64 = 0.1;
const BAD_CHANGE: f64 = 0.5;

/// Looks at excitation, conditioning, periodicity (of the motion, and by [`claimed_period`] of the
/// force) and step before the spectra of whole periods of force (N) and motion are fitted; `lines` belong to one period.
///
/// # Errors
/// As [`RepeatedPeriods::new`] and [`equation_error`](crate::frequency_domain::equation_error).
///
/// # Source
/// As [`before_fit`](super::before_fit).
pub fn before_spectral_fit(
    lines: &Lines,
    force: &Record,
    motion: &Record,
    measured: ResponseQuantity,
    unknowns: &Unknowns,
) -> Result<Vec<Check>, EstimateError> {
    let data = RepeatedPeriods::new(lines, force, motion, measured)?.mean()?;
    let excitation = excitation(&data, unknowns);
    let estimate = match equation_rows(&data)?.solve(unknowns) {
        // There is nothing to look at beyond that.
        Err(EstimateError::TooFewRows { .. }) => return Ok(vec![excitation]),
        solved => solved?,
    };
    let period = lines.sampling().len();
    let mut checks = vec![
        excitation,
        conditioning(estimate.condition(), estimate.undetermined().len()),
        repetition(motion, period)?,
    ];
    checks.extend(claimed_period(force, period));
    checks.extend(band(&estimate, lines)?);
    Ok(checks)
}

/// Shares of a motion's power that the force does not explain.
const DOUBTFUL_INCOHERENCE: f64 = 0.1;
const BAD_INCOHERENCE: f64 = 0.5;

/// Looks at excitation, conditioning and coherence before frequency responses are fitted; forces act
/// at the degrees of freedom `force_dof`, as for [`Frf::data`].
///
/// # Errors
/// As [`Frf::data`] and [`equation_error`](crate::frequency_domain::equation_error).
pub fn before_response_fit(
    frf: &Frf,
    force_dof: &[usize],
    unknowns: &Unknowns,
) -> Result<Vec<Check>, EstimateError> {
    let data = frf.data(force_dof)?;
    let mut checks = vec![excitation(&data, unknowns)];
    match equation_rows(&data)?.solve(unknowns) {
        Err(EstimateError::TooFewRows { .. }) => {}
        solved => {
            let found = solved?;
            checks.push(conditioning(found.condition(), found.undetermined().len()));
        }
    }
    let mut coherence: Vec<f64> = frf.coherence().iter().copied().collect();
    coherence.sort_by(f64::total_cmp);
    let (least, median) = (coherence[0], coherence[coherence.len() / 2]);
    let verdict = grade(1.0 - median, DOUBTFUL_INCOHERENCE, BAD_INCOHERENCE);
    let text = format!(
        "the coherence is {median:.4} in the median and {least:.4} at least, of {:.1} averages",
        frf.averages()
    );
    checks.push(Check { subject: Subject::Coherence, verdict, value: median, text });
    Ok(checks)
}

/// The lines that carry force, two real equations each, against the unknowns.
fn excitation(data: &FrequencyData, unknowns: &Unknowns) -> Check {
    let force = data.force();
    let floor: Vec<f64> =
        force.column_iter().map(|c| LINE_FLOOR * c.map(|f| f.norm()).max()).collect();
    let driven = |row: &usize| {
        force.row(*row).iter().zip(&floor).any(|(f, floor)| f.norm() > floor.max(0.0))
    };
    let count = (0..data.len()).filter(driven).count();
    let needed = unknowns_of_an_equation(unknowns);
    let text = format!(
        "{count} of the lines used {}, which makes {} equations for {} in each equation of motion",
        if count == 1 { "carries force" } else { "carry force" },
        2 * count,
        counted(needed, "unknown")
    );
    let (verdict, text) = match 2 * count {
        few if few < needed => (Verdict::Bad, text + ": excite more lines"),
        few if few == needed => (Verdict::Doubtful, text + ": none is left to show the noise"),
        _ => (Verdict::Good, text),
    };
    Check { subject: Subject::Excitation, verdict, value: count as f64, text }
}

/// How much the periods differ from their mean; of a single one, how it closes.
fn repetition(motion: &Record, period: usize) -> Result<Check, EstimateError> {
    if motion.len() < 2 * period {
        return Ok(periodicity(motion));
    }
    let mean = motion.period_mean(period)?;
    let around = mean.without_mean();
    let change = |channel: usize| {
        let (x, mean) = (motion.channel(channel), mean.channel(channel));
        let size = around.column(channel).norm();
        let deviation = |period: &[f64]| {
            period.iter().zip(mean).map(|(x, mean)| (x - mean).powi(2)).sum::<f64>().sqrt()
        };
        let largest = x.chunks_exact(period).map(deviation).fold(0.0, f64::max);
        if largest == 0.0 { 0.0 } else { largest / size }
    };
    let value = (0..motion.channels()).map(change).fold(0.0, f64::max);
    let verdict = grade(value, DOUBTFUL_CHANGE, BAD_CHANGE);
    let meaning = match verdict {
        Verdict::Good => "",
        Verdict::Doubtful => ": noise, a drift, or a transient that has not died out",
        Verdict::Bad => ": hardly a steady motion of this period",
    };
    let text = format!(
        "a period of the motion differs from the mean of all by {:.2} % at most{meaning}",
        100.0 * value
    );
    Ok(Check { subject: Subject::Periodicity, verdict, value, text })
}

/// The fastest mode that least squares sees, against the lines and half the sampling rate; nothing
/// where the data leave the machine open.
fn band(estimate: &Estimate, lines: &Lines) -> Result<Option<Check>, EstimateError> {
    let Ok(system) = estimate.system() else { return Ok(None) };
    let (hz, samples) = fastest_mode(&system, lines.sampling().dt())?;
    let last = lines.as_slice().iter().copied().max().unwrap_or(0);
    let last_hz = last as f64 * lines.sampling().line_spacing_hz();
    let (verdict, meaning) = match hz {
        _ if samples <= 2.0 => (Verdict::Bad, "above half the sampling rate: sample faster"),
        hz if hz > last_hz => (Verdict::Doubtful, "above the lines used: nothing there shows it"),
        _ => (Verdict::Good, "within reach of the lines used"),
    };
    let text = format!(
        "the fastest mode, near {hz:.4} Hz, has {samples:.1} samples per period and stands {meaning}"
    );
    Ok(Some(Check { subject: Subject::Step, verdict, value: samples, text }))
}
