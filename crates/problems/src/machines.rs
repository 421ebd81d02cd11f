//! Random machines from a seed, similar to those on test rigs, each with a steady multisine test.
//! The machines are chains of masses that are fixed, softly suspended or free, and driven at every
//! mass or at one mass.

use std::f64::consts::TAU;

use mechid_model::SecondOrderSystem;
use mechid_signal::{Record, Sampling, Spectrum};
use nalgebra::{Complex, DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::error::ProblemError;
use crate::random::random_stable;

/// Support of a chain of masses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Support {
    /// Springs at both ends, as stiff as the springs between the masses.
    Fixed,
    /// Springs at both ends, with 1/500 of the stiffness of the springs between the masses.
    Soft,
    /// No support: the chain has a rigid-body mode.
    Free,
}

/// Returns a chain of `dof` masses on springs and dampers, the same for the same seed.
///
/// The masses are 1 … 4 kg, the springs 5 … 20 kN/m. Damping is proportional to mass and stiffness,
/// and the fastest mode has about the damping ratio `damping`.
///
/// # Panics
/// If `dof` is 0.
///
/// # Source
/// Meirovitch, *Fundamentals of Vibrations* (2001), chapter 7 (chains of masses and springs).
pub fn chain(dof: usize, support: Support, damping: f64, seed: u64) -> SecondOrderSystem {
    let rng = &mut ChaCha8Rng::seed_from_u64(seed);
    let masses = DVector::from_fn(dof, |_, _| rng.random_range(1.0..4.0));
    let ends = match support {
        Support::Fixed => 1.0,
        Support::Soft => 2e-3,
        Support::Free => 0.0,
    };
    let mut stiffness = DMatrix::<f64>::zeros(dof, dof);
    for left in 0..=dof {
        let spring: f64 = rng.random_range(5e3..2e4);
        let spring = if left == 0 || left == dof { ends * spring } else { spring };
        // The spring connects mass `left` − 1 with mass `left`; an index without a mass is the
        // support.
        for (i, sign) in [(left.checked_sub(1), 1.0), (Some(left), -1.0)] {
            for (j, other) in [(left.checked_sub(1), 1.0), (Some(left), -1.0)] {
                if let (Some(i), Some(j)) = (i.filter(|i| *i < dof), j.filter(|j| *j < dof)) {
                    stiffness[(i, j)] += sign * other * spring;
                }
            }
        }
    }
    let local = (0..dof).map(|at| f64::sqrt(2.0 * stiffness[(at, at)] / masses[at]));
    let fastest = local.fold(1.0, f64::max);
    let mass = DMatrix::from_diagonal(&masses);
    let viscous = &stiffness * (2.0 * damping / fastest) + &mass * (0.02 * damping * fastest);
    SecondOrderSystem::new(mass, viscous, stiffness).expect("positive masses")
}

/// A machine, and one period of a steady multisine test of this machine, without noise.
#[derive(Debug, Clone)]
pub struct Test {
    /// Name of the machine and the excitation, in a few words.
    pub name: &'static str,
    /// M, C and K.
    pub system: SecondOrderSystem,
    /// True if M is known in the identification.
    pub mass_known: bool,
    /// Numbers of the driven lines. Above the highest driven line, the spectrum of the period has
    /// about the same number of lines without force.
    pub lines: Vec<usize>,
    /// Force (N), samples × dof, one period.
    pub force: Record,
    /// Displacement (m), samples × dof, one period.
    pub displacement: Record,
    /// Acceleration (m/s²), samples × dof, one period.
    pub acceleration: Record,
}

/// Returns machine number `index` of an endless series, with its test. The machines have 1 to 10
/// degrees of freedom and damping ratios of 0.3 to 5 %; five kinds of machine follow one another in
/// turn. The force has lines of 10 N up to 1.3 times the highest natural frequency, with random
/// phases, and at least twenty lines for each degree of freedom.
///
/// # Errors
/// [`ProblemError::Model`] if a line is an undamped resonance.
pub fn series(index: u64) -> Result<Test, ProblemError> {
    let rng = &mut ChaCha8Rng::seed_from_u64(1000 + index);
    let dof = 1 + (index % 10) as usize;
    let damping = 10f64.powf(rng.random_range(-2.5..-1.3));
    let (name, system, one_force) = match index / 10 % 5 {
        0 => ("held chain, all forced", chain(dof, Support::Fixed, damping, index), false),
        1 => ("soft chain, all forced", chain(dof, Support::Soft, damping, index), false),
        2 => ("free chain, all forced", chain(dof, Support::Free, damping, index), false),
        3 => ("held chain, one force", chain(dof, Support::Fixed, damping, index), true),
        _ => ("fully coupled", random_stable(dof, index), false),
    };
    steady_test(name, system, one_force, 60 + 20 * dof, index)
}

/// Returns a steady test of a machine: `count` lines of 10 N up to 1.3 times its highest natural
/// frequency, with random phases. With `one_force`, the force acts only at the first degree of
/// freedom, and M is known in the identification. Otherwise forces act at every degree of freedom,
/// and M is unknown.
///
/// # Errors
/// [`ProblemError::Model`] if the modes cannot be found or a line is an undamped resonance.
pub fn steady_test(
    name: &'static str,
    system: SecondOrderSystem,
    one_force: bool,
    count: usize,
    seed: u64,
) -> Result<Test, ProblemError> {
    let rng = &mut ChaCha8Rng::seed_from_u64(seed);
    let dof = system.dof();
    let fastest = system.modes()?.iter().map(|m| m.natural_frequency()).fold(1.0, f64::max);
    let samples = 4 * count;
    let spacing = 1.3 * fastest / count as f64;
    let sampling = Sampling::new(TAU / (spacing * samples as f64), samples)?;
    let [mut force, mut displacement, mut acceleration] =
        [(); 3].map(|()| DMatrix::<Complex<f64>>::zeros(sampling.lines(), dof));
    for line in 1..=count {
        let omega = line as f64 * sampling.omega0();
        for channel in 0..if one_force { 1 } else { dof } {
            force[(line, channel)] = Complex::from_polar(10.0, rng.random_range(0.0..TAU));
        }
        let x = (system.receptance(omega)? * force.row(line).transpose()).transpose();
        displacement.set_row(line, &x);
        acceleration.set_row(line, &(x * Complex::from(-omega * omega)));
    }
    let record = |lines| -> Result<Record, ProblemError> {
        Ok(Spectrum::from_lines(sampling, lines)?.to_record()?)
    };
    Ok(Test {
        name,
        system,
        mass_known: one_force,
        lines: (1..=count).collect(),
        force: record(force)?,
        displacement: record(displacement)?,
        acceleration: record(acceleration)?,
    })
}

/// Returns a record of one period repeated `count` times.
///
/// # Errors
/// [`ProblemError::Signal`] if the record gets too long.
pub fn repeated(period: &Record, count: usize) -> Result<Record, ProblemError> {
    let len = period.len();
    let samples =
        DMatrix::from_fn(len * count, period.channels(), |k, c| period.data()[(k % len, c)]);
    Ok(Record::new(period.sampling().with_len(len * count)?, samples)?)
}
