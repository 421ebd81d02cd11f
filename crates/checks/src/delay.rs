//! Delay between force and response.

use std::cell::Cell;
use std::f64::consts::PI;
use std::fmt::{self, Formatter};

use mechid_estimate::frequency_domain::{
    ChangedRecords, DelayedForce, OutputErrorFit, output_error, output_error_pooling,
};
use mechid_estimate::time_domain::{TimeDomain, equation_of_motion};
use mechid_estimate::{Estimate, EstimateError, Unknowns};
use mechid_model::Response;
use mechid_numerics::time_limit;
use mechid_signal::{Extent, Record};
use mechid_spectra::{FrequencyData, Pooling};
use nalgebra::DMatrix;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::finding::{Check, Finding, Names};
use super::limits::{
    DELAY_NEAR, DELAY_PREFERRED, DELAY_REACH, DELAY_REDUCTIONS, DELAY_REFINED, DELAY_RESOLVED,
    HARDLY_FOLLOWS,
};
use super::limits::{DELAY_REMAINING, ROUNDING, SIGNIFICANCE};
use super::open_fit::{joined, minimum_near, residuals_of_fit};
use super::spectral_residual::{SpectralResidual, is_noise, is_uncorrelated};
use super::{MAX_SAMPLES, Subject, Verdict};

/// Maximum magnitude of a delay, in samples; the response may be late or early.
const MAX_DELAY: isize = 16;

/// Maximum delay, in samples, if a response hardly follows the force: then a longer delay is
/// likely.
const MAX_LONG_DELAY: isize = 64;

/// Number of steps of the search per sample, for spectra.
const STEPS_PER_SAMPLE: isize = 2;

/// Finds a delay, caused by filters, a scanning converter or a trigger, with which the equation of
/// motion fits the lines far better ([`Finding::Delay`]). `dt` is the sampling interval of the
/// record in s; lines are weighted by the noise if `data` states it. `None` if no delay of up to 16
/// samples (64 if the response hardly follows the force) reduces the residual power of least
/// squares to at most a quarter. If the noise is stated, the delay must also reduce the residual
/// power of maximum likelihood to at most a quarter, because noise at a resonance disturbs least
/// squares.
///
/// # Source
/// Ours: least squares on the equation of motion with the force times e^(−iωτ).
pub fn delay_of_lines(data: &FrequencyData, dt: f64, unknowns: &Unknowns) -> Option<Finding> {
    let driven = driven(&data.force().map(|f| f.norm()));
    let equations = DelayedForce::new(data, unknowns, &driven)?;
    let undelayed = equations.residual_power(0.0)?;
    let (delay, power) = delay_of_equations(&equations, dt, &driven)?;
    finding(delay, dt, [undelayed, power], 2 * data.len(), unknowns)
        .filter(|_| is_delayed(data, delay * dt, unknowns))
}

/// Returns the delay, in samples, with which the equations of motion fit best, and their residual
/// power with this delay.
fn delay_of_equations(
    equations: &DelayedForce<'_>,
    dt: f64,
    driven: &[usize],
) -> Option<(f64, f64)> {
    let power = |samples: f64| equations.residual_power(samples * dt);
    let undelayed = power(0.0)?;
    let samples = |step: isize| step as f64 / STEPS_PER_SAMPLE as f64;
    let longest = longest(undelayed, driven) * STEPS_PER_SAMPLE;
    let step = best_step(undelayed, longest, |step| power(samples(step)));
    let (mut low, mut high) = (samples(step - 1), samples(step + 1));
    for _ in 0..DELAY_REDUCTIONS {
        let third = (high - low) / 3.0;
        if power(low + third)? < power(high - third)? { high -= third } else { low += third }
    }
    let delay = 0.5 * (low + high);
    Some((delay, power(delay)?))
}

/// Finds a delay of the responses of open records ([`Finding::Delay`]) that explains the residual
/// of a maximum-likelihood `fit`: with the delay the residual is significantly smaller and
/// uncorrelated with the forces. If already the residuals `without_delay` are uncorrelated with the
/// forces, one more condition must hold: at most a quarter of the residual power remains with the
/// delay, or the tests of the residual warn without the delay and pass with it. If the residual has
/// another possible cause, `other` are the lines of all records after removal of this cause; the
/// power that remains with the delay must not be significantly above the power that remains with
/// these lines. `dt` is the sampling interval in s; sinusoidal disturbances have been subtracted
/// from the `records`. `None` if no delay of up to 16 samples (64 if the response hardly follows
/// the force) satisfies these conditions.
///
/// The transients are estimated again for each delay; otherwise they would contain a part of the
/// effect of the delay.
///
/// # Source
/// Ours: equations of motion, with and without Hann's window, with the force times e^(−iωτ), then
/// maximum likelihood.
pub fn delay_of_open_records(
    records: &[FrequencyData],
    dt: f64,
    unknowns: &Unknowns,
    fit: &OutputErrorFit,
    without_delay: &[SpectralResidual],
    other: Option<&FrequencyData>,
) -> Option<Finding> {
    let with_pulses = joined(records)?;
    let corrected = joined(&fit.without_pulse_errors(records).ok()?)?;
    let mut likelihood = ChangedRecords::from_fit(&with_pulses, unknowns, fit)?;
    let undelayed = likelihood.cost(&with_pulses)?;
    let freedom = likelihood.spare().checked_sub(1).filter(|freedom| *freedom > 0)? as f64;
    let distribution = FisherSnedecor::new(1.0, freedom).ok()?;
    let is_significant =
        |delayed: f64| distribution.sf((undelayed - delayed) * freedom / delayed) <= SIGNIFICANCE;
    let follows_force = !is_uncorrelated(without_delay);
    let mut near = delay_of_either_window(&corrected, dt, unknowns, &fit.estimate).unwrap_or(0.0);
    let late = |samples: f64| with_pulses.with_later_force(samples * dt);
    // With many lines, the search begins on a part of them.
    let reach = match on_fewer_lines(&likelihood, &with_pulses, dt, near, other) {
        OnFewer::Excluded => return None,
        OnFewer::Found(samples, fewer) => {
            likelihood.start_at(*fewer);
            near = samples;
            DELAY_REFINED
        }
        OnFewer::Unknown => {
            if near.abs() > DELAY_NEAR {
                likelihood.search(&late(near))?;
            }
            DELAY_REACH
        }
    };
    let cost = |samples: f64| likelihood.cost(&late(samples));
    let is_promising = |delayed: f64, _| follows_force || is_significant(delayed);
    let (samples, delayed) = minimum_near(near, [reach, DELAY_RESOLVED], cost, is_promising)?;
    let remaining = delayed / undelayed;
    if !is_significant(delayed) {
        return None;
    }
    let late = |record: &FrequencyData| record.with_later_force(samples * dt);
    let delayed_records: Vec<FrequencyData> = records.iter().map(late).collect();
    let with_delay = residuals_of_fit(&delayed_records, &likelihood)?;
    let becomes_noise = !is_noise(without_delay) && is_noise(&with_delay);
    let is_most = follows_force || remaining <= DELAY_REMAINING || becomes_noise;
    let delay = || Finding::Delay(Delay { samples, seconds: samples * dt, remaining });
    (is_most && is_uncorrelated(&with_delay)).then(delay)
}

/// Finds a delay of the responses of open records without which the maximum-likelihood search fails
/// ([`Finding::Delay`]): with the delay the search succeeds, its residual is uncorrelated with the
/// forces, and it is significantly smaller than without the delay. The finding states the remaining
/// fraction of the residual power of the equations of motion. `dt` is the sampling interval in s.
/// `None` if no delay of up to 16 samples (64 if the response hardly follows the force) satisfies
/// this.
///
/// # Source
/// As [`delay_of_open_records`].
pub fn delay_of_failed_search(
    records: &[FrequencyData],
    dt: f64,
    unknowns: &Unknowns,
    noise: Pooling,
) -> Option<Finding> {
    let data = joined(records)?;
    let driven = driven(&data.force().map(|f| f.norm()));
    let near = |data: &FrequencyData| {
        delay_of_equations(&DelayedForce::new(data, unknowns, &driven)?, dt, &driven)
    };
    let mut delays: Vec<(f64, f64)> =
        [data.under_hann_window(), data.clone()].iter().filter_map(near).collect();
    delays.sort_by(|a, b| a.1.total_cmp(&b.1));
    let equations = DelayedForce::new(&data, unknowns, &driven)?;
    delays.into_iter().find_map(|(near, _)| {
        let late = |samples: f64| data.with_later_force(samples * dt);
        let fit = output_error_pooling(&late(near), unknowns, noise).ok()?;
        let mut likelihood = ChangedRecords::from_fit(&late(near), unknowns, &fit)?;
        let cost = |samples: f64| likelihood.cost(&late(samples));
        let (samples, delayed) =
            minimum_near(near, [DELAY_REACH, DELAY_RESOLVED], cost, |_, _| true)?;
        // The search without a delay failed from its own initial values. It may succeed from the
        // estimate with the delay; then its cost is compared with the cost with the delay.
        let freedom = likelihood.spare().checked_sub(1).filter(|freedom| *freedom > 0)? as f64;
        let distribution = FisherSnedecor::new(1.0, freedom).ok()?;
        let undelayed = likelihood.clone().cost(&data);
        let is_significant = undelayed.is_none_or(|undelayed| {
            distribution.sf((undelayed - delayed) * freedom / delayed) <= SIGNIFICANCE
        });
        let late = |record: &FrequencyData| record.with_later_force(samples * dt);
        let delayed: Vec<FrequencyData> = records.iter().map(late).collect();
        let remaining = equations.residual_power(samples * dt)? / equations.residual_power(0.0)?;
        let is_delayed = is_significant && remaining < 1.0 && !time_limit::is_over();
        let delay = || Finding::Delay(Delay { samples, seconds: samples * dt, remaining });
        (is_delayed && is_uncorrelated(&residuals_of_fit(&delayed, &likelihood)?)).then(delay)
    })
}

/// Result of the search for a delay on a part of the lines.
enum OnFewer<'a> {
    /// The records have few lines, or the search failed.
    Unknown,
    /// Another cause of the residual leaves significantly less residual power than a delay.
    Excluded,
    /// Delay, in samples, and the estimate with this delay.
    Found(f64, Box<ChangedRecords<'a>>),
}

/// Searches for a delay, in samples, on a part of the lines, from the initial value `near`. If the
/// residual has another possible cause, `other` are the lines after removal of this cause. The
/// search ends if the smallest residual power with a delay is significantly above the residual
/// power of `other`.
fn on_fewer_lines<'a>(
    likelihood: &ChangedRecords<'a>,
    lines: &FrequencyData,
    dt: f64,
    near: f64,
    other: Option<&FrequencyData>,
) -> OnFewer<'a> {
    let is_excluded = Cell::new(false);
    let searched = likelihood.on_fewer_lines(lines).and_then(|(lines, mut fewer)| {
        let without_other = other.and_then(|other| {
            let (other, mut fewer) = likelihood.on_fewer_lines(other)?;
            fewer.cost(&other)
        });
        let without_other = without_other.unwrap_or(f64::INFINITY);
        let late = |samples: f64| lines.with_later_force(samples * dt);
        if near.abs() > DELAY_NEAR {
            fewer.search(&late(near))?;
        }
        let freedom = fewer.spare() as f64;
        let cost = |samples: f64| fewer.cost(&late(samples));
        let is_promising = |delayed: f64, decrease: Option<f64>| {
            // Each step of the search decreases the power by less than the step before. If a
            // repetition of the last decrease would not reach the power `without_other`, the later
            // steps do not reach this power.
            let is_out_of_reach =
                decrease.is_some_and(|decrease| delayed - decrease > without_other);
            let equal_powers = FisherSnedecor::new(freedom, freedom);
            let is_above =
                equal_powers.is_ok_and(|powers| powers.sf(delayed / without_other) <= SIGNIFICANCE);
            is_excluded.set(is_out_of_reach && is_above);
            !is_excluded.get()
        };
        let (samples, _) = minimum_near(near, [DELAY_REACH, DELAY_RESOLVED], cost, is_promising)?;
        Some(OnFewer::Found(samples, Box::new(fewer)))
    });
    match searched {
        Some(found) => found,
        None if is_excluded.get() => OnFewer::Excluded,
        None => OnFewer::Unknown,
    }
}

/// Returns the delay, in samples, that fits the equations of motion best. Two fits are made, and
/// the better one is used: with Hann's window, which reduces the leakage of a lasting force, and
/// without a window, because a window would weight a hit differently from its response. On each
/// line, the residual force is divided by the magnitude of the dynamic stiffness of the estimate
/// without a delay.
fn delay_of_either_window(
    data: &FrequencyData,
    dt: f64,
    unknowns: &Unknowns,
    estimate: &Estimate,
) -> Option<f64> {
    let best = |data: &FrequencyData| delay_weighted(data, dt, unknowns, estimate);
    let candidates = best(&data.under_hann_window()).into_iter().chain(best(data));
    candidates.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(delay, _)| delay)
}

/// Returns the delay, in samples, that fits the equations of motion best, and the residual power
/// with this delay. On each line, the residual force is divided by the magnitude of the dynamic
/// stiffness of the estimate without a delay; this gives a residual of the response.
fn delay_weighted(
    data: &FrequencyData,
    dt: f64,
    unknowns: &Unknowns,
    estimate: &Estimate,
) -> Option<(f64, f64)> {
    let system = estimate.system().ok()?;
    let weight = |omega: &f64| {
        let unit = data.measured().per_displacement(*omega).norm();
        unit / system.dynamic_stiffness(*omega).norm()
    };
    let driven = driven(&data.force().map(|f| f.norm()));
    let weights = data.omega().iter().map(weight).collect();
    let equations = DelayedForce::weighted(data, weights, unknowns, &driven)?;
    delay_of_equations(&equations, dt, &driven)
}

/// Returns the delay, in s, with which the equations of motion of frequency responses fit best;
/// `None` if the data do not determine a parameter. On each line, the residual force is divided by
/// the magnitude of the dynamic stiffness of an `estimate`.
///
/// # Source
/// As [`delay_of_lines`].
pub fn delay_of_responses(
    data: &FrequencyData,
    unknowns: &Unknowns,
    estimate: &Estimate,
) -> Option<f64> {
    // Frequency responses have no sampling interval, but the search counts the delay in samples. It
    // uses the sampling interval whose Nyquist frequency is the highest line.
    let dt = PI / data.omega().iter().copied().fold(0.0, f64::max);
    Some(dt * delay_weighted(data, dt, unknowns, estimate)?.0)
}

/// Returns whether maximum likelihood, too, fits far better with the delay (s). Returns true if no
/// noise is stated, or if the fits fail.
fn is_delayed(data: &FrequencyData, delay: f64, unknowns: &Unknowns) -> bool {
    let misfit = |data: &FrequencyData| Some(output_error(data, unknowns).ok()?.misfit_ratio);
    let both = || Some([misfit(data)?, misfit(&data.with_later_force(delay))?]);
    let [undelayed, delayed] = match data.noise() {
        None => return true,
        Some(_) => both().unwrap_or([f64::INFINITY, 0.0]),
    };
    delayed <= DELAY_REMAINING * undelayed
}

/// Finds a delay as [`delay_of_lines`] does, but for a fit of the equation of motion, sample by
/// sample, to a response and a force (N). The delay is a whole number of samples; only the first
/// 32,768 samples of a long record are used.
///
/// # Source
/// Ours.
pub fn delay_at_samples(
    response: &Response,
    force: &Record,
    unknowns: &Unknowns,
) -> Option<Finding> {
    let [x, v, a] = [response.displacement(), response.velocity(), response.acceleration()];
    delay_of_samples(force, unknowns, |shifted, force| {
        let [x, v, a] = [shifted(x)?, shifted(v)?, shifted(a)?];
        equation_of_motion(&Response::new(x, v, a)?, &force, unknowns)
    })
}

/// Finds a delay as [`delay_at_samples`] does, but for a fit of the transition from sample to
/// sample to displacement (m), velocity (m/s) and force (N).
///
/// # Source
/// Ours.
pub fn delay_between_samples(
    method: TimeDomain,
    displacement: &Record,
    velocity: &Record,
    force: &Record,
    unknowns: &Unknowns,
) -> Option<Finding> {
    let open = TimeDomain::new(method.discretisation(), Extent::Open);
    delay_of_samples(force, unknowns, |shifted, force| {
        let fit = open.fit(&shifted(displacement)?, &shifted(velocity)?, &force, unknowns)?;
        Ok(fit.into_estimate())
    })
}

/// Function that returns the window of a response record, shifted relative to the window of the
/// force.
type Shifted<'a> = dyn Fn(&Record) -> Result<Record, EstimateError> + 'a;

fn delay_of_samples(
    force: &Record,
    unknowns: &Unknowns,
    fit: impl Fn(&Shifted<'_>, Record) -> Result<Estimate, EstimateError>,
) -> Option<Finding> {
    let driven = driven(force.data());
    let power = |samples: isize, longest: isize| {
        let margin = longest as usize;
        let len = force.len().min(MAX_SAMPLES).checked_sub(2 * margin)?;
        let start = margin.checked_add_signed(samples)?;
        let shifted = |record: &Record| Ok(record.window(start, len)?);
        residual_power(&fit(&shifted, force.window(margin, len).ok()?).ok()?, &driven)
    };
    let longest = longest(power(0, MAX_DELAY)?, &driven);
    // If the record is too short for the longer search, the search ends at `MAX_DELAY`.
    let longest = if power(0, longest).is_some() { longest } else { MAX_DELAY };
    let undelayed = power(0, longest)?;
    let delay = best_step(undelayed, longest, |samples| power(samples, longest));
    let rows = force.len().min(MAX_SAMPLES).checked_sub(2 * longest as usize)?;
    finding(
        delay as f64,
        force.sampling().dt(),
        [undelayed, power(delay, longest)?],
        rows,
        unknowns,
    )
}

/// Returns the maximum delay of the search, in samples; it is larger if the residual power without
/// a delay is large.
fn longest(undelayed: f64, driven: &[usize]) -> isize {
    let hardly_follows = undelayed > HARDLY_FOLLOWS * driven.len() as f64;
    if hardly_follows { MAX_LONG_DELAY } else { MAX_DELAY }
}

/// Returns the degrees of freedom on which a force acts.
fn driven(force: &DMatrix<f64>) -> Vec<usize> {
    (0..force.ncols()).filter(|dof| force.column(*dof).amax() > 0.0).collect()
}

/// Returns the ratio of the residual power of an equation to the power of its right-hand side,
/// summed over the equations with a force.
fn residual_power(estimate: &Estimate, driven: &[usize]) -> Option<f64> {
    let power = driven.iter().map(|dof| estimate.residual_nrmse()[*dof].powi(2)).sum::<f64>();
    (estimate.undetermined().is_empty() && power.is_finite()).then_some(power)
}

/// Returns the delay, in steps of the search, with the smallest residual power; of two delays with
/// nearly equal power, the shorter.
fn best_step(undelayed: f64, max: isize, power: impl Fn(isize) -> Option<f64>) -> isize {
    let mut best = (0, undelayed);
    for step in (1..=max).flat_map(|size| [size, -size]) {
        match power(step) {
            Some(power) if power < DELAY_PREFERRED * best.1 => best = (step, power),
            _ => {}
        }
    }
    best.0
}

/// Returns the delay if it explains the residual of `rows` equations.
fn finding(
    samples: f64,
    dt: f64,
    [undelayed, delayed]: [f64; 2],
    rows: usize,
    unknowns: &Unknowns,
) -> Option<Finding> {
    let freedom =
        rows.checked_sub(super::excited_lines::unknowns_of_an_equation(unknowns) + 1)? as f64;
    let explained = samples != 0.0 && delayed <= DELAY_REMAINING * undelayed;
    if undelayed <= ROUNDING * ROUNDING || !explained || freedom == 0.0 {
        return None;
    }
    let distribution = FisherSnedecor::new(1.0, freedom).expect("positive numbers");
    if distribution.sf((undelayed - delayed) * freedom / delayed) > SIGNIFICANCE {
        return None;
    }
    Some(Finding::Delay(Delay { samples, seconds: samples * dt, remaining: delayed / undelayed }))
}

/// Delay between force and response.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Delay {
    /// Delay of the response, in samples (pure number).
    pub samples: f64,
    /// Delay of the response, in s.
    pub seconds: f64,
    /// Fraction of the residual power that remains after removal of the delay.
    pub remaining: f64,
}

impl Check for Delay {
    fn subject(&self) -> Subject {
        Subject::Delay
    }

    fn verdict(&self) -> Verdict {
        Verdict::Bad
    }

    fn value(&self) -> f64 {
        self.samples
    }

    fn sentence(&self, _: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { samples, seconds, remaining } = *self;
        let (direction, size) = if samples > 0.0 { ("late", samples) } else { ("early", -samples) };
        let seconds = seconds.abs();
        let size = if size.fract() == 0.0 { format!("{size}") } else { format!("{size:.2}") };
        let percent = 100.0 * remaining;
        let percent =
            if percent < 0.01 { "less than 0.01".into() } else { format!("{percent:.2}") };
        write!(
            f,
            "the response is {size} samples ({seconds:.3e} s) {direction}: without that delay {percent} % \
             of the residual power remains. Possible causes: a filter, a scanning converter, a trigger; \
             shift one of the channels"
        )
    }
}
