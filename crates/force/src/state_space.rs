//! The system between unknown forces and measured channels, sample by sample.

use mechid_model::{ResponseQuantity, SecondOrderSystem, StateTransition};
use nalgebra::{DMatrix, DVector};

use crate::error::ForceError;
use crate::measurement::Measurement;

/// Returns the exact transition over one step; the input is q = Δt² M⁻¹ F.
pub(crate) fn exact_transition(
    system: &SecondOrderSystem,
    dt: f64,
) -> Result<StateTransition, ForceError> {
    let input = DMatrix::identity(system.dof(), system.dof());
    StateTransition::exact(system, dt, &input).map_err(|reason| match growth_rate(system) {
        Ok(rate) if rate * dt > 1.0 => ForceError::Unstable { rate, duration: dt },
        Ok(_) => ForceError::StepTooLong { dt, reciprocal_condition: 0.0 },
        Err(_) => reason.into(),
    })
}

/// Returns the growth rate of the free response: the largest real part of an eigenvalue, in 1/s.
pub(crate) fn growth_rate(system: &SecondOrderSystem) -> Result<f64, ForceError> {
    Ok(system.eigenvalues()?.iter().map(|l| l.re).fold(f64::NEG_INFINITY, f64::max))
}

/// System with the state z = (x, Δt·ẋ) and the outputs y = out·z + through·q, for a force that is
/// linear over a step.
pub(crate) struct Machine {
    pub transition: StateTransition,
    /// Output matrix, channels × 2n; each row is divided by the scale of its channel.
    pub out: DMatrix<f64>,
    /// Direct effect of the input on the outputs, channels × forces.
    pub through: DMatrix<f64>,
    /// Input q of a unit force, n × forces.
    pub input: DMatrix<f64>,
}

impl Machine {
    pub fn new(
        system: &SecondOrderSystem,
        measured: &Measurement,
        forced: &[usize],
        scale: &[f64],
    ) -> Result<Self, ForceError> {
        let (n, dt) = (system.dof(), measured.sampling().dt());
        let transition = exact_transition(system, dt)?;
        let unit =
            DMatrix::from_fn(n, forced.len(), |i, j| if i == forced[j] { dt * dt } else { 0.0 });
        let input = system.mass().clone().lu().solve(&unit).expect("M is invertible");
        let rate = StateTransition::rate(system, dt);
        let channels = measured.channels();
        let mut out = DMatrix::zeros(channels.len(), 2 * n);
        let mut through = DMatrix::zeros(channels.len(), forced.len());
        for (c, channel) in channels.iter().enumerate() {
            match channel.quantity {
                ResponseQuantity::Displacement => out[(c, channel.dof)] = 1.0 / scale[c],
                ResponseQuantity::Velocity => out[(c, n + channel.dof)] = 1.0 / (dt * scale[c]),
                ResponseQuantity::Acceleration => {
                    let unit = 1.0 / (dt * dt * scale[c]);
                    out.set_row(c, &(rate.row(n + channel.dof) * unit));
                    through.set_row(c, &(input.row(channel.dof) * unit));
                }
            }
        }
        Ok(Self { transition, out, through, input })
    }

    /// Returns the response, channels × samples, from rest, to a force given as forces × samples.
    pub fn response(&self, force: &DMatrix<f64>) -> DMatrix<f64> {
        let samples = force.ncols();
        let held_input = &self.transition.held * &self.input;
        let ramp = &self.transition.ramp * &self.input;
        let mut motion = &self.through * force;
        let mut state = DVector::zeros(self.transition.state.ncols());
        for k in 0..samples {
            let mut at = motion.column_mut(k);
            at += &self.out * &state;
            if k + 1 < samples {
                let (now, next) = (force.column(k), force.column(k + 1));
                state = &self.transition.state * state + &held_input * now + &ramp * (next - now);
            }
        }
        motion
    }

    /// Returns the responses to unit forces at each sample: rows ordered by channel, then by
    /// sample, columns by force.
    pub fn impulse_responses(&self, samples: usize) -> DMatrix<f64> {
        let (channels, forces) = self.through.shape();
        let ramp = &self.transition.ramp * &self.input;
        let fall = (&self.transition.held - &self.transition.ramp) * &self.input;
        // The force is linear between the samples, so an impulse is a triangle. If it is at sample
        // 0, its rising side is before the record.
        let (mut first, mut inner) = (fall.clone(), &self.transition.state * &ramp + &fall);
        let mut matrix = DMatrix::zeros(channels * samples, forces * samples);
        let mut set_block = |lag: usize, first: &DMatrix<f64>, inner: &DMatrix<f64>| {
            for c in 0..channels {
                for f in 0..forces {
                    matrix[(c * samples + lag, f * samples)] = first[(c, f)];
                    for k in 1..samples - lag {
                        matrix[(c * samples + k + lag, f * samples + k)] = inner[(c, f)];
                    }
                }
            }
        };
        set_block(0, &self.through, &(&self.out * &ramp + &self.through));
        for lag in 1..samples {
            set_block(lag, &(&self.out * &first), &(&self.out * &inner));
            first = &self.transition.state * first;
            inner = &self.transition.state * inner;
        }
        matrix
    }

    /// Returns the free responses: rows ordered by channel, then by sample, and one column per
    /// entry of the state at the first sample.
    pub fn free_responses(&self, samples: usize) -> DMatrix<f64> {
        let (channels, states) = self.out.shape();
        let mut matrix = DMatrix::zeros(channels * samples, states);
        let mut power = DMatrix::identity(states, states);
        for k in 0..samples {
            let row = &self.out * &power;
            for c in 0..channels {
                matrix.set_row(c * samples + k, &row.row(c));
            }
            power = &self.transition.state * power;
        }
        matrix
    }
}
