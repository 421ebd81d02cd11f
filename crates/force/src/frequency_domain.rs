//! The dynamic stiffness, line by line.

use mechid_model::SecondOrderSystem;
use mechid_signal::{Record, Spectrum};
use nalgebra::{Complex, DMatrix};

use crate::band::{empty_band, is_within};
use crate::error::ForceError;
use crate::identified::IdentifiedForce;
use crate::lines::{check_lines, noise_weight};
use crate::measurement::Measurement;
use crate::noise::{Noise, channel_sizes};
use crate::transfer::Transfer;
use crate::unexplained::Residual;

/// F_n = (K − ω²M + iωC) X_n at the chosen lines of a whole period, zero at all others.
///
/// Velocity and acceleration lines are divided by iω and −ω². With fewer forces than channels, or
/// some degrees of freedom only, each line is a weighted least-squares problem X_n = H_n F_n. The
/// choice of only the excited lines excludes the noise of all others. The Nyquist line of an even
/// record has no phase: leave it out.
///
/// The standard error, if the noise level is known, covers measurement noise only; it is the same
/// at every instant. No unbiased method does better at these lines (Cramér-Rao).
///
/// Cost: one transform per channel, one n×n solve and one small SVD per line.
///
/// # Errors
/// [`ForceError::NoLines`], [`ForceError::NoSuchLine`], [`ForceError::RepeatedLine`];
/// [`ForceError::NotTransmitted`] at a line where the channels do not show the forces, as
/// velocities at DC; [`ForceError::MoreForcesThanMeasurements`], [`ForceError::NoForcedDof`],
/// [`ForceError::NoSuchDof`], [`ForceError::Resonance`], [`ForceError::TooFewOutsideLines`],
/// [`ForceError::NoNoise`], [`ForceError::NotPositive`]; [`ForceError::EmptyBand`] if no line is in
/// the band of the measurement.
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
    let lines = &within(measured, lines)?;
    let scale = level.clone().unwrap_or_else(|| channel_sizes(measured.record()));
    let transfer = Transfer { system, channels: measured.channels(), forced, scale: &scale };

    let sampling = measured.sampling();
    let mut force = DMatrix::<Complex<f64>>::zeros(spectrum.len(), system.dof());
    let mut variance = vec![0.0; system.dof()];
    for &n in lines {
        let inverse = transfer.inverse(n, spectrum.omega(n))?;
        let forces = &inverse * spectrum.lines().row(n).transpose();
        for (f, &dof) in forced.iter().enumerate() {
            force[(n, dof)] = forces[f];
            variance[dof] += noise_weight(sampling.len(), n)
                * inverse.row(f).iter().zip(&scale).map(|(g, s)| g.norm_sqr() * s * s).sum::<f64>();
        }
    }
    let force = Spectrum::from_lines(sampling, force)?;
    let level = level.as_deref();
    let residual = measured
        .exceeds(forced)
        .then(|| Residual::from_lines(system, measured, forced, &force, lines, level));
    let standard_error = level.map(|_| {
        let constant =
            DMatrix::from_fn(sampling.len(), system.dof(), |_, dof| variance[dof].sqrt());
        Record::new(sampling, constant)
    });
    let force = IdentifiedForce::from_record(force.to_record()?)
        .with_standard_error(standard_error.transpose()?)
        .with_residual(residual.transpose()?);
    Ok(match measured.band_hz() {
        Some(band_hz) => force.with_band(band_hz),
        None => force,
    })
}

/// Returns the lines within the band of the measurement.
fn within(measured: &Measurement, lines: &[usize]) -> Result<Vec<usize>, ForceError> {
    let (sampling, Some(band_hz)) = (measured.sampling(), measured.band_hz()) else {
        return Ok(lines.to_vec());
    };
    let spacing = sampling.line_spacing_hz();
    let inside = |n: &&usize| is_within(band_hz, **n as f64 * spacing, spacing);
    let in_band: Vec<usize> = lines.iter().filter(inside).copied().collect();
    if in_band.is_empty() { Err(empty_band(band_hz, sampling)) } else { Ok(in_band) }
}
