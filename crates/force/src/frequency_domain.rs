//! The dynamic stiffness, line by line.

use mechid_model::SecondOrderSystem;
use mechid_signal::{Record, Spectrum};
use nalgebra::{Complex, DMatrix};

use crate::measurement::first_repeated;
use crate::transfer::Transfer;
use crate::unexplained::Rest;
use crate::{ForceError, IdentifiedForce, Measurement};

/// What is known of the noise in the measured channels, taken as white.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Noise {
    /// Nothing: no standard error, and channels count by their size.
    Unknown,
    /// One standard deviation per channel, in the channel's unit.
    PerChannel(Vec<f64>),
    /// Measured on the lines that were not chosen (DC and Nyquist apart): there the force is
    /// taken as zero and what is seen is noise. Needs at least [`MIN_OUTSIDE_LINES`] of them.
    OutsideLines,
}

/// Fewest lines that [`Noise::OutsideLines`] measures a noise level on: each gives two
/// degrees of freedom, so the level is known to about 20 % or better.
pub const MIN_OUTSIDE_LINES: usize = 8;

/// F_n = (K − ω²M + iωC) X_n at the chosen lines of a whole period, zero at all others.
///
/// Velocity and acceleration lines are divided by iω and −ω². When fewer forces are sought than
/// channels were measured, or only some degrees of freedom were, each line is a weighted
/// least-squares problem X_n = H_n F_n. Choosing only the lines that were excited keeps the noise
/// of all others out. The Nyquist line of an even record holds no phase: leave it out.
///
/// The standard error, where the noise level is known, is that of measurement noise alone; it is
/// the same at every instant. No unbiased method does better at these lines (Cramér-Rao).
///
/// Cost: one transform per channel, one n×n solve and one small SVD per line.
///
/// # Errors
/// [`ForceError::NoLines`], [`ForceError::NoSuchLine`], [`ForceError::RepeatedLine`];
/// [`ForceError::NotTransmitted`] at a line that does not show the forces in the channels, as
/// DC does not in velocities; [`ForceError::MoreForcesThanMeasurements`],
/// [`ForceError::NoForcedDof`], [`ForceError::NoSuchDof`], [`ForceError::Resonance`],
/// [`ForceError::TooFewOutsideLines`], [`ForceError::NoNoise`], [`ForceError::NotPositive`].
///
/// # Source
/// Dissertation section 6.2 suggests it; eq. (4.6.9) is its real form for one degree of freedom.
pub fn frequency_domain(
    system: &SecondOrderSystem,
    measured: &Measurement,
    forced: &[usize],
    lines: &[usize],
    noise: &Noise,
) -> Result<IdentifiedForce, ForceError> {
    measured.check(system.dof(), forced)?;
    let spectrum = Spectrum::of(measured.record());
    check_lines(&spectrum, lines)?;
    let level = noise.resolve(measured, &spectrum, lines)?;
    let scale = level.clone().unwrap_or_else(|| sizes(measured.record()));
    let transfer = Transfer { system, channels: measured.channels(), forced, scale: &scale };

    let sampling = measured.sampling();
    let mut force = DMatrix::<Complex<f64>>::zeros(spectrum.len(), system.dof());
    let mut variance = vec![0.0; system.dof()];
    for &n in lines {
        let inverse = transfer.inverse(n, spectrum.omega(n))?;
        let found = &inverse * spectrum.lines().row(n).transpose();
        for (f, &dof) in forced.iter().enumerate() {
            force[(n, dof)] = found[f];
            variance[dof] += noise_weight(sampling.len(), n)
                * inverse.row(f).iter().zip(&scale).map(|(g, s)| g.norm_sqr() * s * s).sum::<f64>();
        }
    }
    let force = Spectrum::from_lines(sampling, force);
    let level = level.as_deref();
    let rest = measured
        .exceeds(forced)
        .then(|| Rest::of_lines(system, measured, forced, &force, lines, level));
    let standard_error = level.map(|_| {
        let constant =
            DMatrix::from_fn(sampling.len(), system.dof(), |_, dof| variance[dof].sqrt());
        Record::new(sampling, constant)
    });
    Ok(IdentifiedForce::of(force.to_record())
        .with_standard_error(standard_error.transpose()?)
        .with_rest(rest.transpose()?))
}

/// Every line of the record that holds a whole complex amplitude: 1 up to, not at, Nyquist.
pub fn inner_lines(measured: &Measurement) -> Vec<usize> {
    (1..measured.sampling().len().div_ceil(2)).collect()
}

/// Variance that white noise of unit variance has in each part of a line's amplitude.
pub(crate) fn noise_weight(len: usize, line: usize) -> f64 {
    if line == 0 || 2 * line == len { 1.0 / len as f64 } else { 2.0 / len as f64 }
}

impl Noise {
    /// Standard deviation per channel, if it is known.
    pub(crate) fn resolve(
        &self,
        measured: &Measurement,
        spectrum: &Spectrum,
        lines: &[usize],
    ) -> Result<Option<Vec<f64>>, ForceError> {
        match self {
            Noise::Unknown => Ok(None),
            Noise::PerChannel(level) => {
                if level.len() != measured.channels().len() {
                    return Err(ForceError::ChannelCount {
                        record: measured.channels().len(),
                        described: level.len(),
                    });
                }
                match level.iter().find(|value| !(**value > 0.0 && value.is_finite())) {
                    Some(&value) => Err(ForceError::NotPositive { what: "noise level", value }),
                    None => Ok(Some(level.clone())),
                }
            }
            Noise::OutsideLines => outside_level(measured, spectrum, lines).map(Some),
        }
    }
}

/// σ² = N/4 · mean |X_n|² over the lines that were not chosen.
fn outside_level(
    measured: &Measurement,
    spectrum: &Spectrum,
    lines: &[usize],
) -> Result<Vec<f64>, ForceError> {
    let chosen: std::collections::HashSet<usize> = lines.iter().copied().collect();
    let outside: Vec<usize> =
        inner_lines(measured).into_iter().filter(|n| !chosen.contains(n)).collect();
    if outside.len() < MIN_OUTSIDE_LINES {
        return Err(ForceError::TooFewOutsideLines {
            outside: outside.len(),
            needed: MIN_OUTSIDE_LINES,
        });
    }
    let per_line = measured.sampling().len() as f64 / (4.0 * outside.len() as f64);
    (0..spectrum.channels())
        .map(|c| {
            let power: f64 = outside.iter().map(|n| spectrum.line(*n, c).norm_sqr()).sum();
            let value = (per_line * power).sqrt();
            if value > 0.0 { Ok(value) } else { Err(ForceError::NoNoise { channel: c + 1 }) }
        })
        .collect()
}

/// Root mean square of each channel, 1 for a channel that is zero.
pub(crate) fn sizes(record: &Record) -> Vec<f64> {
    let rms = |norm: f64| norm / (record.len() as f64).sqrt();
    record
        .data()
        .column_iter()
        .map(|column| Some(rms(column.norm())).filter(|size| *size > 0.0).unwrap_or(1.0))
        .collect()
}

pub(crate) fn check_lines(spectrum: &Spectrum, lines: &[usize]) -> Result<(), ForceError> {
    if lines.is_empty() {
        return Err(ForceError::NoLines);
    }
    let last = spectrum.len() - 1;
    if let Some(&line) = lines.iter().find(|line| **line > last) {
        return Err(ForceError::NoSuchLine { line, last });
    }
    match first_repeated(lines) {
        Some(line) => Err(ForceError::RepeatedLine { line }),
        None => Ok(()),
    }
}
