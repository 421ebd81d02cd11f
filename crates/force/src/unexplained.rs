//! Part of the measured response that a force does not explain.
//!
//! With fewer forces than channels there is a residual. A large residual indicates a further force,
//! a sensor without signal, two interchanged sensors, or a wrong system.

use mechid_model::{ResponseQuantity, SecondOrderSystem};
use mechid_signal::{Record, Spectrum};
use nalgebra::{Complex, DMatrix};

use crate::error::ForceError;
use crate::lines::noise_weight;
use crate::measurement::{Measurement, Start};
use crate::state_space::Machine;
use crate::transfer::{FrequencyResponse, Transfer};

/// Part of one measured channel that the identified force does not explain.
///
/// All values are root mean squares over the record; for a period, over the lines used.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unexplained {
    /// Measured response minus the response to the identified force, in the unit of the channel.
    pub residual: f64,
    /// The larger of the measured response and the response to the identified force, in the unit of
    /// the channel.
    pub motion: f64,
    /// Residual expected from noise alone, computed from the noise level on the lines used, in the
    /// unit of the channel. `None` if the level was neither stated nor measured separately from the
    /// fit.
    pub noise: Option<f64>,
    /// Residual expected from the uncertainty of the system, in the unit of the channel, from
    /// [`with_uncertain_system`](crate::with_uncertain_system); otherwise `None`.
    pub system: Option<f64>,
}

impl Unexplained {
    /// Ratio of residual to response, a pure number: 0 if the force explains the whole response, 1
    /// if it explains no part of it (2 if the predicted response has the opposite sign).
    ///
    /// The reference is the larger of the measured and the predicted response, because the measured
    /// response of a dead sensor is zero.
    pub fn share(&self) -> f64 {
        if self.motion > 0.0 { self.residual / self.motion } else { 0.0 }
    }
}

/// The residual of every channel, and its expected size.
#[derive(Debug, Clone)]
pub(crate) struct Residual {
    /// Measured minus predicted, samples × channels, in the units of the channels.
    residual: DMatrix<f64>,
    channels: Vec<Unexplained>,
}

impl Residual {
    fn new(measured: &DMatrix<f64>, residual: DMatrix<f64>, noise: Option<Vec<f64>>) -> Self {
        let channels = (0..residual.ncols())
            .map(|c| {
                let (column, seen) = (residual.column(c), measured.column(c));
                Unexplained {
                    residual: rms(column.norm_squared(), residual.nrows()),
                    motion: rms(
                        seen.norm_squared().max((seen - column).norm_squared()),
                        residual.nrows(),
                    ),
                    noise: noise.as_ref().map(|level| level[c]),
                    system: None,
                }
            })
            .collect();
        Self { residual, channels }
    }

    /// Computes the residual on lines of a period: the measured response minus the response to the
    /// force, line by line.
    ///
    /// White noise of standard deviation σ has the RMS value σ √(Σ w) on these lines, with w the
    /// variance of the real or the imaginary part of a line under noise of unit variance.
    pub fn from_lines(
        system: &dyn FrequencyResponse,
        measured: &Measurement,
        forced: &[usize],
        force: &Spectrum,
        lines: &[usize],
        level: Option<&[f64]>,
    ) -> Result<Self, ForceError> {
        let spectrum = Spectrum::from_record(measured.record());
        let channels = measured.channels();
        let scale = vec![1.0; channels.len()];
        let transfer = Transfer { system, channels, forced, scale: &scale };
        let zeros = || DMatrix::<Complex<f64>>::zeros(spectrum.len(), channels.len());
        let (mut seen, mut residual) = (zeros(), zeros());
        let mut weight = 0.0;
        for &n in lines {
            let response = transfer.scaled(n, spectrum.omega(n))?;
            for c in 0..channels.len() {
                let made = (forced.iter().enumerate())
                    .map(|(f, &dof)| response[(c, f)] * force.line(n, dof))
                    .sum::<Complex<f64>>();
                seen[(n, c)] = spectrum.line(n, c);
                residual[(n, c)] = spectrum.line(n, c) - made;
            }
            weight += noise_weight(measured.sampling().len(), n);
        }
        let in_time = |lines| Spectrum::from_lines(measured.sampling(), lines)?.to_record();
        let noise = level.map(|level| level.iter().map(|sigma| sigma * weight.sqrt()).collect());
        Ok(Self::new(in_time(seen)?.data(), in_time(residual)?.into_data(), noise))
    }

    /// Computes the residual in an open record: the measured response minus the response to a force
    /// with these samples, linear between them, and to an initial state. The initial state is
    /// estimated by least squares; the channels are divided by `scale`.
    pub fn from_open_record(
        system: &SecondOrderSystem,
        measured: &Measurement,
        forced: &[usize],
        force: &Record,
        start: Start,
        scale: &[f64],
        level: Option<&[f64]>,
    ) -> Result<Self, ForceError> {
        let machine = Machine::new(system, measured, forced, scale)?;
        let (samples, channels) = (measured.sampling().len(), scale.len());
        let force = DMatrix::from_fn(forced.len(), samples, |f, k| force.channel(forced[f])[k]);
        let made = machine.response(&force);
        let mut residual = DMatrix::from_fn(samples, channels, |k, c| {
            measured.record().data()[(k, c)] / scale[c] - made[(c, k)]
        });
        if start == Start::InMotion {
            let free = machine.free_responses(samples).qr().q();
            let vector =
                residual.reshape_generic(nalgebra::Dyn(samples * channels), nalgebra::Const::<1>);
            let vector = &vector - &free * free.tr_mul(&vector);
            residual = vector.reshape_generic(nalgebra::Dyn(samples), nalgebra::Dyn(channels));
        }
        for (mut column, scale) in residual.column_iter_mut().zip(scale) {
            column *= *scale;
        }
        Ok(Self::new(measured.record().data(), residual, level.map(<[f64]>::to_vec)))
    }

    /// Computes the residual of a method that identifies displacement, velocity and force of every
    /// degree of freedom together.
    pub fn from_motion(
        system: &SecondOrderSystem,
        measured: &Measurement,
        [displacement, velocity, force]: [&Record; 3],
        level: Option<&[f64]>,
    ) -> Self {
        let response = measured.record().data();
        let mut residual = response.clone();
        let accelerated = measured
            .channels()
            .iter()
            .any(|channel| channel.quantity == ResponseQuantity::Acceleration);
        let acceleration = accelerated.then(|| {
            let mut balance = force.data().transpose();
            balance.gemm(-1.0, system.damping(), &velocity.data().transpose(), 1.0);
            balance.gemm(-1.0, system.stiffness(), &displacement.data().transpose(), 1.0);
            system.mass().clone().lu().solve(&balance).expect("M is invertible").transpose()
        });
        for (mut column, channel) in residual.column_iter_mut().zip(measured.channels()) {
            let made = match (channel.quantity, &acceleration) {
                (ResponseQuantity::Acceleration, Some(acceleration)) => {
                    acceleration.column(channel.dof)
                }
                (ResponseQuantity::Velocity, _) => velocity.data().column(channel.dof),
                _ => displacement.data().column(channel.dof),
            };
            column -= made;
        }
        Self::new(response, residual, level.map(<[f64]>::to_vec))
    }

    pub fn matrix(&self) -> &DMatrix<f64> {
        &self.residual
    }

    pub fn channels(&self) -> &[Unexplained] {
        &self.channels
    }

    /// Returns the same residual, with the variance of each entry due to the uncertainty of the
    /// system.
    pub fn with_system_variance(mut self, variance: &DMatrix<f64>) -> Self {
        for (channel, variance) in self.channels.iter_mut().zip(variance.column_iter()) {
            channel.system = Some(rms(variance.sum(), variance.len()));
        }
        self
    }
}

fn rms(squares: f64, samples: usize) -> f64 {
    (squares / samples as f64).sqrt()
}
