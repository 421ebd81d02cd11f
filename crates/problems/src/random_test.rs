//! A random test with a response in closed form.

use mechid_model::{ResponseQuantity, SecondOrderSystem};
use mechid_signal::{Record, Sampling, Spectrum, noise};
use nalgebra::Complex;

use crate::error::ProblemError;
use crate::exact::exact_harmonic_periodic;

/// A window of the steady state under a Gaussian random force; the period of the force is four
/// times the length of the window.
///
/// The lines of the force reach up to the fraction [`RandomTest::BAND`] of the sampling rate, as
/// behind an anti-aliasing filter, and the response is exact at each of them. The window begins and
/// ends during the motion.
#[derive(Debug, Clone, PartialEq)]
pub struct RandomTest {
    /// The machine, driven at every degree of freedom by an independent force.
    pub system: SecondOrderSystem,
    /// Time axis of the window.
    pub sampling: Sampling,
    /// Quantity of the response.
    pub quantity: ResponseQuantity,
    /// Standard deviation of each force before band limitation, in N.
    pub force: f64,
}

impl RandomTest {
    /// Highest frequency of the force, as a fraction of the sampling rate.
    pub const BAND: f64 = 0.35;
    /// Ratio of the period to the length of the window.
    const LONGER: usize = 4;

    /// Returns the forces (N) and the responses in one window, samples × degrees of freedom; each
    /// seed gives different records.
    ///
    /// # Errors
    /// [`ProblemError`] if the system has no receptance at a line.
    ///
    /// # Source
    /// Ours.
    pub fn measure(&self, seed: u64) -> Result<[Record; 2], ProblemError> {
        let samples = self.sampling.len();
        let [force, response] = self.period(seed)?;
        // The window does not contain the end of the period, where the record repeats.
        let first = samples / 2 + 1;
        Ok([force.window(first, samples)?, response.window(first, samples)?])
    }

    /// Returns the forces and the responses over the whole period.
    ///
    /// # Errors
    /// The errors of [`RandomTest::measure`].
    ///
    /// # Source
    /// Ours: the response is that of [`exact_harmonic_periodic`].
    pub fn period(&self, seed: u64) -> Result<[Record; 2], ProblemError> {
        let period = self.sampling.with_len(Self::LONGER * self.sampling.len())?;
        let white = noise::white(period, self.system.dof(), self.force, seed)?;
        let mut lines = Spectrum::from_record(&white).lines().clone();
        let last = (Self::BAND * period.len() as f64) as usize;
        lines.row_mut(0).fill(Complex::from(0.0));
        lines.rows_mut(last, lines.nrows() - last).fill(Complex::from(0.0));
        let force = Spectrum::from_lines(period, lines)?.to_record()?;
        let steady = exact_harmonic_periodic(&self.system, &force)?;
        let response = match self.quantity {
            ResponseQuantity::Displacement => steady.displacement(),
            ResponseQuantity::Velocity => steady.velocity(),
            ResponseQuantity::Acceleration => steady.acceleration(),
        };
        Ok([force, response.clone()])
    }
}
