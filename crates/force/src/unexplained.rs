//! Part of the measured response that a force does not explain.
//!
//! Where fewer forces are sought than channels were measured, the channels contradict one another
//! if another force acts, if a sensor is dead or two are exchanged, or if the machine is another.

use mechid_model::{ResponseQuantity, SecondOrderSystem};
use mechid_signal::{Record, Spectrum};
use nalgebra::{Complex, DMatrix};

use crate::lines::noise_weight;
use crate::state_space::Machine;
use crate::transfer::Transfer;
use crate::{ForceError, Measurement, Start};

/// Part of one measured channel that the reconstructed force leaves unexplained.
///
/// All are root mean squares over the record; where it is a period, of the lines used.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unexplained {
    /// Measured motion less that which the force found makes, in the unit of the channel.
    pub rest: f64,
    /// Measured motion, or that which the force found makes, whichever is larger, in the unit of
    /// the channel.
    pub motion: f64,
    /// Part that noise alone may leave, its level on the lines used, in the unit of the channel. `None`
    /// where the level was neither stated nor measured apart from the fit.
    pub noise: Option<f64>,
    /// Part that the uncertainty of the machine leaves, in the unit of the channel, as
    /// [`with_uncertain_system`](crate::with_uncertain_system) counts it; `None` without that.
    pub machine: Option<f64>,
}

impl Unexplained {
    /// Rest over motion, a pure number: 0 where all is explained, up to 1 where nothing is (2
    /// where the motion is the opposite).
    ///
    /// Not measured against the measured motion alone: of a dead sensor there is none.
    pub fn share(&self) -> f64 {
        if self.motion > 0.0 { self.rest / self.motion } else { 0.0 }
    }
}

/// The rest of every channel, and what it is judged by.
#[derive(Debug, Clone)]
pub(crate) struct Rest {
    /// Measured less predicted, samples × channels, in the units of the channels.
    residual: DMatrix<f64>,
    channels: Vec<Unexplained>,
}

impl Rest {
    fn of(measured: &DMatrix<f64>, residual: DMatrix<f64>, noise: Option<Vec<f64>>) -> Self {
        let channels = (0..residual.ncols())
            .map(|c| {
                let (rest, seen) = (residual.column(c), measured.column(c));
                Unexplained {
                    rest: rms(rest.norm_squared(), residual.nrows()),
                    motion: rms(
                        seen.norm_squared().max((seen - rest).norm_squared()),
                        residual.nrows(),
                    ),
                    noise: noise.as_ref().map(|level| level[c]),
                    machine: None,
                }
            })
            .collect();
        Self { residual, channels }
    }

    /// Measures on lines of a period: Y_n − S H_n F_n of each.
    ///
    /// White noise of standard deviation σ has the RMS value σ √(Σ w) on them, w the variance that
    /// noise of unit variance has in each part of a line.
    pub fn of_lines(
        system: &SecondOrderSystem,
        measured: &Measurement,
        forced: &[usize],
        force: &Spectrum,
        lines: &[usize],
        level: Option<&[f64]>,
    ) -> Result<Self, ForceError> {
        let spectrum = Spectrum::of(measured.record());
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
        Ok(Self::of(in_time(seen)?.data(), in_time(residual)?.into_data(), noise))
    }

    /// Measures in an open record what no force of these samples, linear between them, and no motion at the
    /// first sample explain; the latter in least squares of channels divided by `scale`.
    pub fn of_open(
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
            let rest =
                residual.reshape_generic(nalgebra::Dyn(samples * channels), nalgebra::Const::<1>);
            let rest = &rest - &free * free.tr_mul(&rest);
            residual = rest.reshape_generic(nalgebra::Dyn(samples), nalgebra::Dyn(channels));
        }
        for (mut column, scale) in residual.column_iter_mut().zip(scale) {
            column *= *scale;
        }
        Ok(Self::of(measured.record().data(), residual, level.map(<[f64]>::to_vec)))
    }

    /// Measures where displacement, velocity and force of every degree of freedom were found together.
    pub fn of_motion(
        system: &SecondOrderSystem,
        measured: &Measurement,
        [displacement, velocity, force]: [&Record; 3],
        level: Option<&[f64]>,
    ) -> Self {
        let seen = measured.record().data();
        let mut residual = seen.clone();
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
        Self::of(seen, residual, level.map(<[f64]>::to_vec))
    }

    pub fn residual(&self) -> &DMatrix<f64> {
        &self.residual
    }

    pub fn channels(&self) -> &[Unexplained] {
        &self.channels
    }

    /// The same, with the variance of each entry that the machine's uncertainty leads to.
    pub fn with_machine(mut self, variance: &DMatrix<f64>) -> Self {
        for (channel, variance) in self.channels.iter_mut().zip(variance.column_iter()) {
            channel.machine = Some(rms(variance.sum(), variance.len()));
        }
        self
    }
}

fn rms(squares: f64, samples: usize) -> f64 {
    (squares / samples as f64).sqrt()
}
