//! Force from the dynamic stiffness, line by line.

use mechid_signal::{Record, Spectrum};
use nalgebra::{Complex, DMatrix};

use crate::band::{empty_band, is_within};
use crate::error::ForceError;
use crate::identified::IdentifiedForce;
use crate::lines::{check_lines, noise_weight};
use crate::measurement::Measurement;
use crate::noise::{Noise, channel_sizes};
use crate::transfer::{FrequencyResponse, Transfer};
use crate::unexplained::Residual;

/// Computes F_n = (K − ω²M + iωC) X_n at the chosen lines of a whole period, zero at all others.
///
/// Velocity and acceleration lines are divided by iω and −ω². With fewer forces than channels, or
/// if only some degrees of freedom are measured, each line is a weighted least-squares problem X_n
/// = H_n F_n. If only the excited lines are chosen, the noise of all other lines has no effect. The
/// Nyquist line of an even record has no phase: leave it out.
///
/// The standard error covers measurement noise, if its level is known, and the uncertainty of a
/// system that states it ([`FrequencyResponse::response_covariance`]); it is the same at every
/// instant. No unbiased method has a smaller standard error at these lines (Cramér-Rao).
///
/// Cost: one transform per channel, one n×n solve and one small SVD per line.
///
/// # Errors
/// [`ForceError::NoLines`], [`ForceError::NoSuchLine`], [`ForceError::RepeatedLine`];
/// [`ForceError::NotTransmitted`] at a line where the channels do not show the forces (for example
/// velocities at DC); [`ForceError::MoreForcesThanMeasurements`], [`ForceError::NoForcedDof`],
/// [`ForceError::NoSuchDof`], [`ForceError::Resonance`], [`ForceError::TooFewOutsideLines`],
/// [`ForceError::NoNoise`], [`ForceError::NotPositive`]; [`ForceError::EmptyBand`] if no line is in
/// the band of the measurement.
///
/// # Source
/// Dissertation section 6.2 suggests it; eq. (4.6.9) is its real form for one degree of freedom.
pub fn frequency_domain(
    system: &dyn FrequencyResponse,
    measured: &Measurement,
    forced: &[usize],
    lines: &[usize],
    noise: &Noise,
) -> Result<IdentifiedForce, ForceError> {
    let places = system.inputs();
    measured.check(system.sensors().max(places), forced)?;
    if let Some(&dof) = forced.iter().find(|dof| **dof >= places) {
        return Err(ForceError::NoSuchDof { dof, dofs: places });
    }
    let spectrum = Spectrum::from_record(measured.record());
    check_lines(&spectrum, lines)?;
    let level = noise.resolve(measured, &spectrum, lines)?;
    let lines = &within(measured, lines)?;
    let scale = level.clone().unwrap_or_else(|| channel_sizes(measured.record()));
    let transfer = Transfer { system, channels: measured.channels(), forced, scale: &scale };

    let sampling = measured.sampling();
    let mut force = DMatrix::<Complex<f64>>::zeros(spectrum.len(), places);
    let mut variance = Variance::new(measured.channels().len(), places);
    for &n in lines {
        let inverse = transfer.inverse(n, spectrum.omega(n))?;
        let forces = &inverse * spectrum.lines().row(n).transpose();
        let weight = noise_weight(sampling.len(), n);
        for (f, &dof) in forced.iter().enumerate() {
            force[(n, dof)] = forces[f];
            let noise = |channel: usize| (inverse[(f, channel)].norm() * scale[channel]).powi(2);
            variance.noise[dof] += weight * (0..scale.len()).map(noise).sum::<f64>();
        }
        variance.add_system(&transfer, n, spectrum.omega(n), &inverse, forces.as_slice())?;
    }
    let force = Spectrum::from_lines(sampling, force)?;
    let level = level.as_deref();
    let residual = measured
        .exceeds(forced)
        .then(|| Residual::from_lines(system, measured, forced, &force, lines, level));
    let residual = residual.transpose()?.map(|residual| {
        if variance.is_known { residual.with_system_variance(&variance.residual) } else { residual }
    });
    let standard_error = (level.is_some() || variance.is_known).then(|| {
        let noise = |dof: usize| if level.is_some() { variance.noise[dof] } else { 0.0 };
        let error = |_, dof: usize| (noise(dof) + variance.system[dof]).sqrt();
        Record::new(sampling, DMatrix::from_fn(sampling.len(), places, error))
    });
    let force = IdentifiedForce::from_record(force.to_record()?)
        .with_standard_error(standard_error.transpose()?)
        .with_residual(residual);
    Ok(match measured.band_hz() {
        Some(band_hz) => force.with_band(band_hz),
        None => force,
    })
}

/// Mean squares, over a period, of the errors of the forces and of the residual.
struct Variance {
    /// Contribution of the channel noise, whose standard deviation is `scale`, to the mean square
    /// error of each force, in N².
    noise: Vec<f64>,
    /// Contribution of the uncertainty of the system to the mean square error of each force, in N².
    system: Vec<f64>,
    /// Contribution of the uncertainty of the system to the residual of each channel,
    /// `1 × channels`.
    residual: DMatrix<f64>,
    /// `true` if the system states its uncertainty.
    is_known: bool,
}

impl Variance {
    fn new(channels: usize, places: usize) -> Self {
        let zeros = || vec![0.0; places];
        let residual = DMatrix::zeros(1, channels);
        Self { noise: zeros(), system: zeros(), residual, is_known: false }
    }

    /// Adds the effect of the uncertainty of the system on a line. To first order, the force
    /// changes by δF = −G δH F and the residual by −(I − H G) δH F, where G is the inverse of H.
    fn add_system(
        &mut self,
        transfer: &Transfer<'_>,
        line: usize,
        omega: f64,
        inverse: &DMatrix<Complex<f64>>,
        forces: &[Complex<f64>],
    ) -> Result<(), ForceError> {
        let Transfer { system, channels, forced, scale } = transfer;
        let Some(covariance) = system.response_covariance(channels, forced, omega, forces) else {
            return Ok(());
        };
        self.is_known = true;
        // The mean square of an oscillation is half the square of its amplitude.
        let half = if line == 0 { 1.0 } else { 0.5 };
        let of_forces = inverse * &covariance * inverse.adjoint();
        for (f, &dof) in forced.iter().enumerate() {
            self.system[dof] += half * of_forces[(f, f)].re.max(0.0);
        }
        let mut response = transfer.scaled(line, omega)?;
        for (mut row, scale) in response.row_iter_mut().zip(*scale) {
            row *= Complex::from(*scale);
        }
        let channels = channels.len();
        let unexplained = DMatrix::identity(channels, channels) - response * inverse;
        let of_residual = &unexplained * covariance * unexplained.adjoint();
        for (channel, sum) in self.residual.iter_mut().enumerate() {
            *sum += half * of_residual[(channel, channel)].re.max(0.0);
        }
        Ok(())
    }
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
