//! Errors of an identified force relative to a reference.

use mechid_signal::{Record, Spectrum};

use crate::error::ForceError;

/// Relative error ‖F̂ − F‖ / ‖F‖ over all samples and channels, a pure number.
///
/// # Errors
/// [`ForceError::Compared`], [`ForceError::Signal`] if the records do not match,
/// [`ForceError::NoForce`] if F is zero.
pub fn relative_error(estimate: &Record, truth: &Record) -> Result<f64, ForceError> {
    check_records(estimate, truth)?;
    let norm = truth.data().norm();
    if norm == 0.0 {
        return Err(ForceError::NoForce);
    }
    Ok((estimate.data() - truth.data()).norm() / norm)
}

/// Relative error ‖F̂ − F‖ / ‖F‖ of each channel, a pure number; `None` for channels without a
/// force.
///
/// # Errors
/// The errors of [`relative_error`], except [`ForceError::NoForce`].
pub fn channel_errors(estimate: &Record, truth: &Record) -> Result<Vec<Option<f64>>, ForceError> {
    check_records(estimate, truth)?;
    let channels = estimate.data().column_iter().zip(truth.data().column_iter());
    Ok(channels
        .map(|(e, t)| Some(t.norm()).filter(|norm| *norm > 0.0).map(|norm| (e - t).norm() / norm))
        .collect())
}

/// Relative error |F̂_n − F_n| / |F_n| at each of the lines, for one channel, a pure number.
///
/// # Errors
/// [`ForceError::NoForceAtLine`] if F_n is zero; [`ForceError::NoSuchLine`],
/// [`ForceError::NoSuchDof`], [`ForceError::Compared`].
pub fn line_errors(
    estimate: &Spectrum,
    truth: &Spectrum,
    channel: usize,
    lines: &[usize],
) -> Result<Vec<f64>, ForceError> {
    ratios(estimate, truth, channel, channel, lines, |e, t| (e - t).norm())
}

/// The ratio |F̂_n| / |F_n| at each of the lines, for one channel: 1 is perfect.
///
/// # Errors
/// The errors of [`line_errors`].
pub fn spectrum_ratio(
    estimate: &Spectrum,
    truth: &Spectrum,
    channel: usize,
    lines: &[usize],
) -> Result<Vec<f64>, ForceError> {
    ratios(estimate, truth, channel, channel, lines, |e, _| e.norm())
}

/// Ratio of |F̂_n| on a channel without a force to |F_n| on one with a force, at each of the lines:
/// 0 is perfect.
///
/// # Errors
/// The errors of [`line_errors`].
pub fn spurious_ratio(
    estimate: &Spectrum,
    truth: &Spectrum,
    unforced: usize,
    forced: usize,
    lines: &[usize],
) -> Result<Vec<f64>, ForceError> {
    ratios(estimate, truth, unforced, forced, lines, |e, _| e.norm())
}

type Line = nalgebra::Complex<f64>;

fn ratios(
    estimate: &Spectrum,
    truth: &Spectrum,
    channel: usize,
    reference: usize,
    lines: &[usize],
    numerator: impl Fn(Line, Line) -> f64,
) -> Result<Vec<f64>, ForceError> {
    if estimate.channels() != truth.channels() {
        return Err(ForceError::Compared {
            estimate: estimate.channels(),
            truth: truth.channels(),
        });
    }
    let dofs = truth.channels();
    if let Some(dof) = [channel, reference].into_iter().find(|c| *c >= dofs) {
        return Err(ForceError::NoSuchDof { dof, dofs });
    }
    let last = estimate.len().min(truth.len()) - 1;
    lines
        .iter()
        .map(|&line| {
            if line > last {
                return Err(ForceError::NoSuchLine { line, last });
            }
            let norm = truth.line(line, reference).norm();
            if norm == 0.0 {
                return Err(ForceError::NoForceAtLine { line });
            }
            Ok(numerator(estimate.line(line, channel), truth.line(line, reference)) / norm)
        })
        .collect()
}

fn check_records(estimate: &Record, truth: &Record) -> Result<(), ForceError> {
    if estimate.channels() != truth.channels() {
        return Err(ForceError::Compared {
            estimate: estimate.channels(),
            truth: truth.channels(),
        });
    }
    Ok(estimate.check_same_sampling(truth)?)
}
