//! Whether a record will do for a time-domain fit.

use mechid_signal::Extent;
use std::f64::consts::TAU;

use mechid_model::{Discretisation, Response, SecondOrderSystem};
use mechid_signal::measures::persistent_excitation_order;
use mechid_signal::{Record, Spectrum, counted};

use super::{Check, Subject, Verdict, claimed_period};
use crate::time_domain::{TimeDomain, Transitions, equation_of_motion};
use crate::{EstimateError, Unknowns};

/// Lines weaker than this share of the strongest do not count as excitation.
pub(super) const LINE_FLOOR: f64 = 1e-4;

/// Condition number beyond which a noise of 1 % leaves nothing of some combination of parameters.
const DOUBTFUL_CONDITION: f64 = 1e4;

/// A step across the seam this many times the usual one is no rounding and hardly chance.
const DOUBTFUL_SEAM: f64 = 5.0;
const BAD_SEAM: f64 = 20.0;

/// Looks at excitation, conditioning, periodicity (if claimed) and step before a time-domain fit
/// of displacement (m), velocity (m/s) and force (N).
///
/// # Errors
/// As [`Transitions::push`], and [`EstimateError::TooFewRows`].
///
/// # Source
/// Ljung, *System Identification: Theory for the User*, 2nd ed. (1999), chapter 13 (persistence of
/// excitation); Belsley, Kuh & Welsch, *Regression Diagnostics* (1980), chapter 3 (conditioning);
/// the limits are ours.
pub fn before_fit(
    method: TimeDomain,
    displacement: &Record,
    velocity: &Record,
    force: &Record,
) -> Result<Vec<Check>, EstimateError> {
    let dof = displacement.channels();
    let mut rows = Transitions::new(dof, displacement.sampling().dt())?;
    rows.push(displacement, velocity, force, method.extent())?;
    let next = usize::from(method.discretisation() == Discretisation::FirstOrderHold);
    let mut checks = excitation(force, 2 * dof + 1 + next);
    let (condition, lost) = rows.condition(method.discretisation())?;
    checks.push(conditioning(condition, lost));
    if method.extent() == Extent::WholePeriod {
        checks.push(periodicity(displacement));
        checks.extend(claimed_period(force, force.len()));
    }
    checks.push(step(&rows, method.discretisation())?);
    Ok(checks)
}

/// Looks at excitation, conditioning, periodicity (if claimed) and step before the equation of motion
/// is fitted sample by sample to a response (x, ẋ, ẍ) and a force (N).
///
/// # Errors
/// As [`crate::EquationOfMotion::push_rows`] and [`crate::EquationOfMotion::solve`].
pub fn before_equation_of_motion(
    response: &Response,
    force: &Record,
    unknowns: &Unknowns,
    extent: Extent,
) -> Result<Vec<Check>, EstimateError> {
    let estimate = equation_of_motion(response, force, unknowns)?;
    let mut checks = excitation(force, unknowns_of_an_equation(unknowns));
    checks.push(conditioning(estimate.condition(), estimate.undetermined().len()));
    if extent == Extent::WholePeriod {
        checks.push(periodicity(response.displacement()));
        checks.extend(claimed_period(force, force.len()));
    }
    if let Ok(system) = estimate.system() {
        let (hz, samples) = fastest_mode(&system, force.sampling().dt())?;
        let verdict = grade(1.0 / samples, 0.4, 0.5);
        let meaning = match verdict {
            Verdict::Good => "; the equation holds at each sample, whatever the step",
            _ => "; at two or fewer it cannot be told from a slower one",
        };
        let text = format!(
            "the fastest mode, near {hz:.4} Hz, has {samples:.1} samples per period{meaning}"
        );
        checks.push(Check { subject: Subject::Step, verdict, value: samples, text });
    }
    Ok(checks)
}

/// Unknowns of the equation of motion that has most of them.
pub(super) fn unknowns_of_an_equation(unknowns: &Unknowns) -> usize {
    let free = unknowns.free();
    let of = |equation| free.iter().filter(|p| p.row() == equation).count();
    (0..unknowns.dof()).map(of).max().unwrap_or(0)
}

/// Natural frequency (Hz) of the fastest mode, and samples in its period.
pub(super) fn fastest_mode(
    system: &SecondOrderSystem,
    dt: f64,
) -> Result<(f64, f64), EstimateError> {
    let modes = system.modes()?;
    let fastest = modes.iter().map(|mode| mode.natural_frequency()).fold(0.0, f64::max);
    Ok((fastest / TAU, TAU / (fastest * dt)))
}

/// The order of persistent excitation of each force against the states and inputs, or the
/// unknowns, it must tell apart.
fn excitation(force: &Record, needed: usize) -> Vec<Check> {
    let spectrum = Spectrum::of(force);
    let one = |channel: usize| {
        let number = channel + 1;
        let order = persistent_excitation_order(&spectrum, channel, LINE_FLOOR).unwrap_or(0);
        let (verdict, text) = match order {
            0 => (
                Verdict::Doubtful,
                format!("force {number} is zero: it is left out, and no mass follows from it"),
            ),
            _ if order < needed => (
                Verdict::Bad,
                format!(
                    "force {number} is persistently exciting of order {order} only, {needed} are \
                     needed: excite more lines"
                ),
            ),
            _ => (
                Verdict::Good,
                format!(
                    "force {number} is persistently exciting of order {order}, {needed} needed"
                ),
            ),
        };
        Check { subject: Subject::Excitation, verdict, value: order as f64, text }
    };
    (0..force.channels()).map(one).collect()
}

pub(super) fn conditioning(condition: f64, lost: usize) -> Check {
    let told = match condition {
        short if short < 1e4 => format!("{short:.1}"),
        long => format!("{long:.1e}"),
    };
    let (verdict, text) = if lost > 0 {
        let text = format!(
            "{} of displacements, velocities and forces {} not vary in the data: some parameters \
             will stay undetermined",
            counted(lost, "combination"),
            if lost == 1 { "does" } else { "do" }
        );
        (Verdict::Bad, text)
    } else if condition > DOUBTFUL_CONDITION {
        let text = format!(
            "the regressors have the condition number {told}: relative noise is amplified \
             up to that much in the worst combination of parameters"
        );
        (Verdict::Doubtful, text)
    } else {
        (Verdict::Good, format!("the regressors have the condition number {told}"))
    };
    Check { subject: Subject::Conditioning, verdict, value: condition, text }
}

/// Whether a record is one whole period of a steady motion, of any kind: the curvature across the
/// seam, where the last sample is followed by the first, against the usual curvature. A period has
/// nothing special there.
///
/// The value is the ratio of the two for the channel where it is largest; up to 5 is good, beyond
/// 20 bad.
///
/// # Source
/// Ours.
pub fn periodicity(motion: &Record) -> Check {
    periodicity_across(motion, motion)
}

/// As [`periodicity`], of a period too long to be held: what is usual is taken from its `beginning`;
/// `end` is its last two samples, or more (samples × channels, the same quantity and channels).
///
/// # Panics
/// If `end` has fewer channels.
///
/// # Source
/// Ours.
pub fn periodicity_across(beginning: &Record, end: &Record) -> Check {
    let ratio = |channel: usize| {
        let (x, end) = (beginning.channel(channel), end.channel(channel));
        let [last_but_one, last] = [2, 1].map(|back| end[(2 * end.len() - back) % end.len()]);
        let curvature = |x: [f64; 3]| x[0] - 2.0 * x[1] + x[2];
        let inside: f64 = x.windows(3).map(|x| curvature([x[0], x[1], x[2]]).powi(2)).sum();
        let usual = (inside / x.len().saturating_sub(2).max(1) as f64).sqrt();
        let after = curvature([last, x[0], x[1 % x.len()]]);
        let seam = after.abs().max(curvature([last_but_one, last, x[0]]).abs());
        if seam == 0.0 { 0.0 } else { seam / usual }
    };
    let value = (0..beginning.channels()).map(ratio).fold(0.0, f64::max);
    let (verdict, meaning) = match value {
        v if v < DOUBTFUL_SEAM => (Verdict::Good, "as a whole period should"),
        v if v < BAD_SEAM => (Verdict::Doubtful, "hardly a steady state over one whole period"),
        _ => (Verdict::Bad, "this is no period: fit it as an open record"),
    };
    let text = format!(
        "from the last sample back to the first the motion bends {value:.1} times as much as \
         usual: {meaning}"
    );
    Check { subject: Subject::Periodicity, verdict, value, text }
}

/// The eigenvalues the data suggest (force held between samples), against the step.
fn step(rows: &Transitions, discretisation: Discretisation) -> Result<Check, EstimateError> {
    let subject = Subject::Step;
    let exact = match rows.state_matrix(Discretisation::ZeroOrderHold) {
        Ok(matrix) => matrix,
        Err(reason @ EstimateError::NoLogarithm { .. }) => {
            let (verdict, text) = (Verdict::Bad, format!("the step does not suit: {reason}"));
            return Ok(Check { subject, verdict, value: f64::INFINITY, text });
        }
        Err(other) => return Err(other),
    };
    let eigenvalues = exact.complex_eigenvalues();
    let fastest = eigenvalues.iter().map(|l| l.norm()).fold(0.0, f64::max);
    let turn = fastest * rows.dt();
    let (samples, hz) = (TAU / turn, fastest / TAU);
    let mode = format!("the fastest mode, near {hz:.4} Hz, has {samples:.1} samples per period");
    if discretisation == Discretisation::Euler {
        let n = rows.dof();
        let euler = rows.state_matrix(Discretisation::Euler)?;
        let bias = (euler.rows(n, n) - exact.rows(n, n)).norm() / exact.rows(n, n).norm();
        let verdict = grade(bias, 0.01, 0.1);
        let text = format!("{mode}; Euler's first-order bias here is about {:.1} %", 100.0 * bias);
        return Ok(Check { subject, verdict, value: bias, text });
    }
    let verdict = grade(turn, 1.0, 2.5);
    let meaning = match verdict {
        Verdict::Good => "",
        Verdict::Doubtful => "; few, so what the force does between samples matters",
        Verdict::Bad => "; at two or fewer it cannot be told from a slower one",
    };
    Ok(Check { subject, verdict, value: samples, text: mode + meaning })
}

pub(super) fn grade(value: f64, doubtful: f64, bad: f64) -> Verdict {
    match value {
        v if v < doubtful => Verdict::Good,
        v if v < bad => Verdict::Doubtful,
        _ => Verdict::Bad,
    }
}
