//! Whether force and motion are apart in time.

use mechid_model::Response;
use mechid_signal::{Extent, Record};
use nalgebra::DMatrix;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::after::{ROUNDING, SIGNIFICANT};
use super::{Check, LOOKED_AT, Subject, Verdict};
use crate::frequency_domain::{FrequencyData, late_rows};
use crate::time_domain::{TimeDomain, equation_of_motion};
use crate::{Estimate, EstimateError, Unknowns};

/// Samples that the motion is moved by, at most, to either side.
const REACH: isize = 16;

/// Steps of the search in one sample, of spectra.
const FINE: isize = 2;

/// Halvings of the interval around the best of them.
const HALVINGS: usize = 24;

/// A delay that leaves more of the residual's power than this is not what is wrong.
const LEFT: f64 = 0.25;

/// Another of the same quality must leave less than this part to be preferred to a smaller one.
const PREFERRED: f64 = 0.99;

/// Whether the equation of motion fits the lines far better if the motion is taken earlier or later:
/// a delay between the channels, by filters, a scanning converter, or a trigger. `dt` is the step of
/// the record in s; lines are weighted by the noise where `data` state it. Nothing if no delay of up
/// to 16 samples leaves less than a quarter of the residual's power.
///
/// The value is the delay of the motion, in samples.
///
/// # Source
/// Ours: least squares on the equation of motion with the force turned by e^(−iωτ).
pub fn delay_of_lines(data: &FrequencyData, dt: f64, unknowns: &Unknowns) -> Option<Check> {
    let driven = driven(&data.force().map(|f| f.norm()));
    let left = |samples: f64| {
        let found = late_rows(data, samples * dt).ok()?.solve(unknowns).ok()?;
        left_of(&found, &driven)
    };
    let now = left(0.0)?;
    let coarse = smallest(now, REACH * FINE, |step| left(step as f64 / FINE as f64));
    let (mut low, mut high) =
        ((coarse - 1) as f64 / FINE as f64, (coarse + 1) as f64 / FINE as f64);
    for _ in 0..HALVINGS {
        let third = (high - low) / 3.0;
        if left(low + third)? < left(high - third)? { high -= third } else { low += third }
    }
    let delay = 0.5 * (low + high);
    judged(delay, dt, now, left(delay)?, 2 * data.len(), unknowns)
}

/// As [`delay_of_lines`], of a response fitted sample by sample to the equation of motion and a force
/// (N); to whole samples, of a long record in the first 32768.
///
/// # Source
/// Ours.
pub fn delay_at_samples(response: &Response, force: &Record, unknowns: &Unknowns) -> Option<Check> {
    let [x, v, a] = [response.displacement(), response.velocity(), response.acceleration()];
    delay_of_samples(force, unknowns, |motion, force| {
        let [x, v, a] = [motion(x)?, motion(v)?, motion(a)?];
        equation_of_motion(&Response::new(x, v, a)?, &force, unknowns)
    })
}

/// As [`delay_at_samples`], of displacement (m), velocity (m/s) and force (N) fitted from sample to
/// sample.
///
/// # Source
/// Ours.
pub fn delay_between_samples(
    method: TimeDomain,
    displacement: &Record,
    velocity: &Record,
    force: &Record,
    unknowns: &Unknowns,
) -> Option<Check> {
    let open = TimeDomain::new(method.discretisation(), Extent::Open);
    delay_of_samples(force, unknowns, |motion, force| {
        let fit = open.fit(&motion(displacement)?, &motion(velocity)?, &force, unknowns)?;
        Ok(fit.into_estimate())
    })
}

/// The same stretch of a motion, moved.
type Moved<'a> = dyn Fn(&Record) -> Result<Record, EstimateError> + 'a;

fn delay_of_samples(
    force: &Record,
    unknowns: &Unknowns,
    fit: impl Fn(&Moved<'_>, Record) -> Result<Estimate, EstimateError>,
) -> Option<Check> {
    let reach = REACH as usize;
    let len = force.len().min(LOOKED_AT).checked_sub(2 * reach)?;
    let driven = driven(force.data());
    let left = |samples: isize| {
        let start = reach.checked_add_signed(samples)?;
        let motion = |record: &Record| Ok(record.window(start, len)?);
        left_of(&fit(&motion, force.window(reach, len).ok()?).ok()?, &driven)
    };
    let now = left(0)?;
    let delay = smallest(now, REACH, left);
    judged(delay as f64, force.sampling().dt(), now, left(delay)?, len, unknowns)
}

/// Degrees of freedom on which a force acts.
fn driven(force: &DMatrix<f64>) -> Vec<usize> {
    (0..force.ncols()).filter(|dof| force.column(*dof).amax() > 0.0).collect()
}

/// Power of the residual of the equations with a force, each over that of its right-hand side.
fn left_of(found: &Estimate, driven: &[usize]) -> Option<f64> {
    let left = driven.iter().map(|dof| found.residual_nrmse()[*dof].powi(2)).sum::<f64>();
    (found.undetermined().is_empty() && left.is_finite()).then_some(left)
}

/// The step of the least power, the smaller of two that are alike.
fn smallest(now: f64, reach: isize, left: impl Fn(isize) -> Option<f64>) -> isize {
    let mut best = (0, now);
    for step in (1..=reach).flat_map(|size| [size, -size]) {
        match left(step) {
            Some(power) if power < PREFERRED * best.1 => best = (step, power),
            _ => {}
        }
    }
    best.0
}

/// What to say of a delay of so many samples that leaves `then` of what was `now`.
fn judged(
    delay: f64,
    dt: f64,
    now: f64,
    then: f64,
    rows: usize,
    unknowns: &Unknowns,
) -> Option<Check> {
    let spare = rows.checked_sub(super::before::unknowns_of_an_equation(unknowns) + 1)?;
    if now <= ROUNDING * ROUNDING || then > LEFT * now || delay == 0.0 || spare == 0 {
        return None;
    }
    let distribution = FisherSnedecor::new(1.0, spare as f64).expect("positive numbers");
    if distribution.sf((now - then) * spare as f64 / then) > SIGNIFICANT {
        return None;
    }
    let (way, size) = if delay > 0.0 { ("earlier", delay) } else { ("later", -delay) };
    let share = 100.0 * then / now;
    let share = if share < 0.01 { "less than 0.01".into() } else { format!("{share:.2}") };
    let text = format!(
        "taken {} samples ({:.3e} s) {way}, the motion leaves {share} % of the residual's power: force \
         and motion are apart in time, by a filter, a scanning converter or a trigger; shift one of \
         them",
        told_samples(size),
        size * dt,
    );
    Some(Check { subject: Subject::Delay, verdict: Verdict::Bad, value: delay, text })
}

fn told_samples(samples: f64) -> String {
    if samples.fract() == 0.0 { format!("{samples}") } else { format!("{samples:.2}") }
}
