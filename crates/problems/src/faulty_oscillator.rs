//! An oscillator with a nonlinear spring, friction, a changing stiffness or a hidden mass. This
//! module has a separate Runge–Kutta rule for its motion.

use std::f64::consts::TAU;

use mechid_signal::{Record, Sampling, Spectrum, noise};
use nalgebra::Complex;

use crate::error::ProblemError;

/// An oscillator under a force of many lines. The force is computed at eight times the sampling
/// rate, and the classical Runge–Kutta rule integrates the motion in four steps per sample of the
/// record. With all faults zero the oscillator is linear.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FaultyOscillator {
    /// Mass, in kg.
    pub mass: f64,
    /// Damping, in N·s/m.
    pub damping: f64,
    /// Stiffness, in N/m.
    pub stiffness: f64,
    /// Relative change of the stiffness from the start of the motion to the last sample (pure
    /// number).
    pub drift: f64,
    /// Cubic stiffness of the spring, in N per cubed displacement in m.
    pub cubic: f64,
    /// Coulomb friction, in N.
    pub friction: f64,
    /// Unmeasured mass, in kg, on a separate spring.
    pub hidden_mass: f64,
    /// Natural frequency of the unmeasured mass on its spring, in Hz.
    pub hidden_hz: f64,
}

impl FaultyOscillator {
    /// Number of computed samples of the force per sample of the record.
    const FINER: usize = 8;
    /// Damping ratio of the hidden mass.
    const HIDDEN_DAMPING: f64 = 0.01;
    /// Velocity at which friction has about three quarters of its full magnitude, in m/s.
    const SLIP: f64 = 1e-3;

    /// An oscillator of 10 kg at 25 Hz with a damping ratio of 0.02 and without faults.
    pub fn linear() -> Self {
        let (mass, omega) = (10.0, 25.0 * TAU);
        Self {
            mass,
            damping: 0.04 * mass * omega,
            stiffness: mass * omega * omega,
            drift: 0.0,
            cubic: 0.0,
            friction: 0.0,
            hidden_mass: 0.0,
            hidden_hz: 60.0,
        }
    }

    /// Returns force (N) and displacement (m) of one window. The force repeats every `period`
    /// samples; its lines reach up to the fraction `band` of the sampling rate, and its standard
    /// deviation is some tens of N. The motion starts from rest, `skipped` samples before the
    /// window begins.
    ///
    /// # Errors
    /// [`ProblemError::Signal`] if the record does not fit in memory.
    ///
    /// # Source
    /// Hairer, Nørsett & Wanner, *Solving Ordinary Differential Equations I*, section II.1 (the
    /// classical rule).
    pub fn measure(
        &self,
        window: Sampling,
        period: usize,
        skipped: usize,
        band: f64,
        seed: u64,
    ) -> Result<[Record; 2], ProblemError> {
        let dt = window.dt() / Self::FINER as f64;
        let fine = Sampling::new(dt, period * Self::FINER)?;
        let mut lines = Spectrum::from_record(&noise::white(fine, 1, 300.0, seed)?).lines().clone();
        let last = (band * period as f64) as usize;
        lines.row_mut(0).fill(Complex::ZERO);
        lines.rows_mut(last, lines.nrows() - last).fill(Complex::ZERO);
        let one = Spectrum::from_lines(fine, lines)?.to_record()?;
        let total = (skipped + window.len()) * Self::FINER;
        let force: Vec<f64> = one.channel(0).iter().copied().cycle().take(total).collect();
        let displacement = self.motion(&force, dt);
        let of_window = |values: Vec<f64>| Record::from_channel(window, values[skipped..].to_vec());
        let sampled = force.iter().copied().step_by(Self::FINER).collect();
        Ok([of_window(sampled)?, of_window(displacement)?])
    }

    /// Returns the displacement at every sample of the record under a force with the finer step
    /// `dt` (s).
    fn motion(&self, force: &[f64], dt: f64) -> Vec<f64> {
        let h = 2.0 * dt;
        let moved = |z: [f64; 4], d: [f64; 4], by: f64| std::array::from_fn(|i| z[i] + by * d[i]);
        let (mut state, mut all) = ([0.0; 4], Vec::new());
        for at in (0..force.len()).step_by(2) {
            if at % Self::FINER == 0 {
                all.push(state[0]);
            }
            let rate = |offset: usize, state: [f64; 4]| {
                let at = (at + offset).min(force.len() - 1);
                self.rate(force[at], at as f64 / force.len() as f64 - 0.5, state)
            };
            let a = rate(0, state);
            let b = rate(1, moved(state, a, 0.5 * h));
            let c = rate(1, moved(state, b, 0.5 * h));
            let d = rate(2, moved(state, c, h));
            state = std::array::from_fn(|i| {
                state[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i])
            });
        }
        all
    }

    /// Returns the time derivatives of displacement and velocity, first of the main mass, then of
    /// the hidden mass; `elapsed` rises from −½ at the start of the motion to ½ at its end.
    fn rate(&self, force: f64, elapsed: f64, [x, v, y, w]: [f64; 4]) -> [f64; 4] {
        let omega = TAU * self.hidden_hz;
        let (spring, damper) = (omega * omega, 2.0 * Self::HIDDEN_DAMPING * omega);
        let of_hidden = spring * (x - y) + damper * (v - w);
        let spring = self.stiffness * (1.0 + self.drift * elapsed) * x + self.cubic * x.powi(3);
        let friction = self.friction * (v / Self::SLIP).tanh();
        let internal_force = self.damping * v + spring + friction + self.hidden_mass * of_hidden;
        [v, (force - internal_force) / self.mass, w, of_hidden]
    }
}
