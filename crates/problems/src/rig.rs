//! A test rig for journal bearings with imperfections: baseline, crosstalk, run-out and noise.

use std::f64::consts::TAU;

use mechid_signal::{Record, Sampling, Spectrum, noise};
use nalgebra::{Complex, DMatrix, Matrix2, Vector2};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use crate::error::ProblemError;

/// A housing on the oil film of a shaft in rigid supports, with shakers in x and y.
///
/// The housing, of mass M_s, obeys −ω² M_s x + (H_film + H_baseline) x = f. The shaft does not
/// move; its run-out appears only in the signals of the probes.
#[derive(Debug, Clone, PartialEq)]
pub struct BearingRig {
    /// K (N/m), C (N·s/m) and M (kg) of the film, 2×2 each.
    pub film: [Matrix2<f64>; 3],
    /// K (N/m), C (N·s/m) and M (kg) of stingers, hoses and seals, 2×2 each.
    pub baseline: [Matrix2<f64>; 3],
    /// Mass of the housing, in kg.
    pub stator_mass: f64,
    /// Crosstalk of each sensor: the sensor adds the signal of the other direction, multiplied by
    /// this ratio.
    pub crosstalk: f64,
    /// Speed of rotation, in Hz.
    pub rotation_hz: f64,
    /// Amplitudes of the run-out, in m, one for the rotation and each of its multiples.
    pub run_out: Vec<f64>,
    /// Standard deviation of white noise on a force sensor, in N.
    pub force_noise: f64,
    /// Standard deviation of white noise on an accelerometer, in m/s².
    pub acceleration_noise: f64,
    /// Standard deviation of white noise on a displacement probe, in m.
    pub displacement_noise: f64,
}

/// Shakers in operation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shakers {
    /// Shaker in x.
    X,
    /// Shaker in y.
    Y,
    /// Shakers in x and y, on alternate lines.
    Interleaved,
}

/// Records of a rig, x before y.
#[derive(Debug, Clone, PartialEq)]
pub struct RigTest {
    /// Forces of the shakers, in N.
    pub force: Record,
    /// Accelerations of the housing, in m/s².
    pub acceleration: Record,
    /// Displacements of the housing relative to the shaft, in m.
    pub displacement: Record,
}

impl BearingRig {
    /// Returns a rig with the given film: a housing of 20 kg, rotation at 50 Hz, typical noise of
    /// the sensors, and no other imperfection.
    pub fn new(film: [Matrix2<f64>; 3]) -> Self {
        Self {
            film,
            baseline: [Matrix2::zeros(); 3],
            stator_mass: 20.0,
            crosstalk: 0.0,
            rotation_hz: 50.0,
            run_out: Vec::new(),
            force_noise: 0.5,
            acceleration_noise: 0.02,
            displacement_noise: 2e-8,
        }
    }

    /// Returns the rig without the film and with the shaft at rest, for a baseline test.
    #[must_use]
    pub fn dry(&self) -> Self {
        Self { film: [Matrix2::zeros(); 3], run_out: Vec::new(), ..self.clone() }
    }

    /// Returns the dynamic stiffness H of film and baseline, 2×2, in N/m, at `omega` (rad/s).
    ///
    /// # Source
    /// Childs and Hale (1994), Journal of Tribology 116, 337–344.
    pub fn dynamic_stiffness(&self, omega: f64) -> Matrix2<Complex<f64>> {
        let [k, c, m] = std::array::from_fn(|at| self.film[at] + self.baseline[at]);
        k.zip_zip_map(&c, &m, |k, c, m| Complex::new(k - omega * omega * m, omega * c))
    }

    /// Returns one period without noise: `amplitude` (N) at each of the lines, with phases drawn
    /// from `seed`.
    ///
    /// # Source
    /// The source of [`BearingRig::dynamic_stiffness`].
    ///
    /// # Errors
    /// [`ProblemError::Signal`] for a line beyond the Nyquist frequency.
    ///
    /// # Panics
    /// If the housing has an undamped resonance on a line.
    pub fn period(
        &self,
        sampling: Sampling,
        lines: &[usize],
        amplitude: f64,
        shakers: Shakers,
        seed: u64,
    ) -> Result<RigTest, ProblemError> {
        let rng = &mut ChaCha8Rng::seed_from_u64(seed);
        let [mut force, mut acceleration, mut displacement] =
            [(); 3].map(|()| DMatrix::<Complex<f64>>::zeros(sampling.lines(), 2));
        let cross = Matrix2::new(1.0, self.crosstalk, self.crosstalk, 1.0).map(Complex::from);
        for (at, line) in lines.iter().enumerate() {
            let omega = *line as f64 * sampling.omega0();
            let direction = match shakers {
                Shakers::X => 0,
                Shakers::Y => 1,
                Shakers::Interleaved => at % 2,
            };
            let mut f = Vector2::zeros();
            f[direction] = Complex::from_polar(amplitude, rng.random_range(0.0..TAU));
            let inertia =
                Matrix2::from_diagonal_element(Complex::from(-omega * omega * self.stator_mass));
            let x = (self.dynamic_stiffness(omega) + inertia).lu().solve(&f).expect("no resonance");
            force.row_mut(*line).copy_from(&(cross * f).transpose());
            displacement.row_mut(*line).copy_from(&(cross * x).transpose());
            let a = cross * x * Complex::from(-omega * omega);
            acceleration.row_mut(*line).copy_from(&a.transpose());
        }
        for (multiple, run_out) in (1..).zip(&self.run_out) {
            let line = f64::from(multiple) * self.rotation_hz / sampling.line_spacing_hz();
            let phasor = Complex::from_polar(*run_out, rng.random_range(0.0..TAU));
            // The probes are perpendicular: y lags x by a quarter of a revolution.
            displacement[(line.round() as usize, 0)] += phasor;
            displacement[(line.round() as usize, 1)] += phasor * Complex::new(0.0, -1.0);
        }
        let record = |lines| -> Result<Record, ProblemError> {
            Ok(Spectrum::from_lines(sampling, lines)?.to_record()?)
        };
        Ok(RigTest {
            force: record(force)?,
            acceleration: record(acceleration)?,
            displacement: record(displacement)?,
        })
    }

    /// Returns some periods of a test, with noise on every sensor.
    ///
    /// # Errors
    /// [`ProblemError::Signal`] if the record gets too long.
    pub fn measured(
        &self,
        period: &RigTest,
        periods: usize,
        seed: u64,
    ) -> Result<RigTest, ProblemError> {
        let noisy =
            |record: &Record, deviation: f64, stream: u64| -> Result<Record, ProblemError> {
                let clean = record.repeated(periods)?;
                let drawn = noise::white(clean.sampling(), 2, deviation, 3 * seed + stream)?;
                Ok(Record::new(clean.sampling(), clean.data() + drawn.data())?)
            };
        Ok(RigTest {
            force: noisy(&period.force, self.force_noise, 0)?,
            acceleration: noisy(&period.acceleration, self.acceleration_noise, 1)?,
            displacement: noisy(&period.displacement, self.displacement_noise, 2)?,
        })
    }
}
