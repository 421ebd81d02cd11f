//! Coverage of the intervals of maximum likelihood, and ratio of the scatter to the Cramér–Rao
//! bound, in seeded experiments of 1, 2, 4 and 8 periods. The noise is white, autoregressive of the
//! first order (0.9), 1/f, white with a narrow disturbance, or the response to an unmeasured force.
//!
//! ```sh
//! cargo run --release -p mechid-estimate --example coloured_noise_study -- 500 auto
//! ```
//!
//! The arguments are the number of experiments, the noise model (`auto`, `white`, `smooth`,
//! `neighbours:N` or `per-line`) and, to run one noise only, the first letters of its name.

#![allow(clippy::print_stdout, reason = "the table is the result")]

use std::collections::BTreeMap;
use std::error::Error;
use std::f64::consts::TAU;

use mechid_estimate::frequency_domain::{OutputErrorFit, output_error, output_error_pooling};
use mechid_estimate::{Estimate, Unknowns};
use mechid_model::{ResponseQuantity, SecondOrderSystem};
use mechid_problems::exact_harmonic_periodic;
use mechid_problems::machines::{Support, Test, chain, repeated, steady_test};
use mechid_signal::{Multisine, Phases, Record, Sampling, noise};
use mechid_spectra::{Lines, NoiseModel, NoiseSpectrum, Pooling, RepeatedPeriods};
use nalgebra::{Complex, DMatrix};
use rayon::prelude::*;

/// Ratio of the RMS of the noise to that of the response.
const LEVEL: f64 = 0.05;
/// Ratio of the RMS of a narrow disturbance to that of the white noise.
const NARROW: f64 = 3.0;
/// Number of experiments from which the covariance of a noise is estimated.
const MANY: u64 = 4000;
/// Number of initial samples of a recursion that are discarded; after these samples the recursion
/// is stationary.
const BEFORE: usize = 2000;

/// Colour of a noise.
#[derive(Debug, Clone, Copy)]
enum Colour {
    White,
    /// Autoregressive noise of the first order: x_k = 0.9 x_{k−1} + e_k with white noise e_k.
    Autoregressive,
    /// Power that falls like 1/f over three decades: a sum of autoregressive noises.
    OneOverF,
    /// White noise plus a narrow disturbance: a resonance four lines wide, whose RMS is [`NARROW`]
    /// times that of the white noise.
    Narrow,
    /// Response of the machine to an autoregressive force of the first order (0.9) on its last
    /// mass, plus white noise with a tenth of the RMS of the response.
    UnmeasuredForce,
}

impl Colour {
    const ALL: [Self; 5] =
        [Self::White, Self::Autoregressive, Self::OneOverF, Self::Narrow, Self::UnmeasuredForce];

    fn name(self) -> &'static str {
        match self {
            Self::White => "white",
            Self::Autoregressive => "AR(0.9)",
            Self::OneOverF => "1/f",
            Self::Narrow => "narrow disturbance",
            Self::UnmeasuredForce => "unmeasured force",
        }
    }

    /// Returns a channel of `len` samples, stationary from the first one.
    fn samples(self, len: usize, seed: u64) -> Vec<f64> {
        let all = Sampling::new(1.0, len + BEFORE).expect("samples");
        let white = |stream: u64| {
            let drawn = noise::white(all, 1, 1.0, seed.wrapping_mul(1000) + stream);
            drawn.expect("a level").column(0).as_slice().to_vec()
        };
        let recursion = |stream: u64, a1: f64, a2: f64| {
            let mut x = white(stream);
            for k in 2..x.len() {
                x[k] += a1 * x[k - 1] + a2 * x[k - 2];
            }
            x
        };
        let add = |mut x: Vec<f64>, y: &[f64], by: f64| {
            x.iter_mut().zip(y).for_each(|(x, y)| *x += by * y);
            x
        };
        let x = match self {
            Self::White => white(0),
            Self::Autoregressive | Self::UnmeasuredForce => recursion(0, 0.9, 0.0),
            Self::OneOverF => (0..9).fold(vec![0.0; all.len()], |sum, octave| {
                let a = 1.0 - 0.8 * 0.5f64.powi(octave);
                add(sum, &recursion(octave as u64, a, 0.0), (1.0 - a * a).sqrt())
            }),
            Self::Narrow => {
                let (radius, turn) = (0.96f64, 1.1f64);
                let (r2, r4) = (radius.powi(2), radius.powi(4));
                let variance =
                    (1.0 + r2) / ((1.0 - r2) * (1.0 + r4 - 2.0 * r2 * (2.0 * turn).cos()));
                let peak = recursion(0, 2.0 * radius * turn.cos(), -radius * radius);
                add(white(1), &peak, NARROW / variance.sqrt())
            }
        };
        x[BEFORE..].to_vec()
    }

    /// Root mean square.
    fn size(self) -> f64 {
        let long = self.samples(1 << 18, 1 << 40);
        (long.iter().map(|x| x * x).sum::<f64>() / long.len() as f64).sqrt()
    }
}

/// Chains of masses with a damping ratio of about 3 %, named after the position of their modes
/// among the lines.
enum Machine {
    /// One mass, whose mode is at line 12 of 100.
    LowMode,
    /// One mass, whose mode is at line 77 of 100.
    HighMode,
    /// Two masses, whose higher mode is at line 92 of 120.
    TwoModes,
}

impl Machine {
    const ALL: [Self; 3] = [Self::LowMode, Self::HighMode, Self::TwoModes];

    fn name(&self) -> &'static str {
        match self {
            Self::LowMode => "one mass, low mode",
            Self::HighMode => "one mass, high mode",
            Self::TwoModes => "two masses",
        }
    }

    fn dof(&self) -> usize {
        if let Self::TwoModes = self { 2 } else { 1 }
    }

    fn test(&self) -> Result<Test> {
        let system = chain(self.dof(), Support::Fixed, 0.03, 7);
        let lines = if let Self::TwoModes = self { 120 } else { 100 };
        let test = steady_test("", system, false, lines, 7)?;
        let Self::LowMode = self else { return Ok(test) };
        let (system, period) = (test.system.clone(), test.force.sampling());
        let mode = system.modes()?[0].natural_frequency();
        let period = Sampling::new(12.0 * TAU / (mode * period.len() as f64), period.len())?;
        let multisine = Multisine::flat(1..=lines, 10.0, Phases::Random { seed: 7 })?;
        let force = multisine.sample(period)?;
        let exact = exact_harmonic_periodic(&system, &force)?;
        let [displacement, acceleration] =
            [exact.displacement().clone(), exact.acceleration().clone()];
        Ok(Test { force, displacement, acceleration, ..test })
    }
}

/// A machine, its test in steady state, and the noise on its response.
struct Study {
    machine: &'static str,
    test: Test,
    lines: Lines,
    unknowns: Unknowns,
    colour: Colour,
    /// Ratio of the RMS of the noise on each channel to the RMS of the random samples.
    scale: Vec<f64>,
    force: Record,
    exact: Record,
    periods: usize,
}

type Result<T> = std::result::Result<T, Box<dyn Error>>;

impl Study {
    fn new(machine: &Machine, colour: Colour, periods: usize) -> Result<Self> {
        let (test, dof) = (machine.test()?, machine.dof());
        let period = test.force.sampling();
        let rms = |c| test.displacement.column(c).norm() / (period.len() as f64).sqrt();
        let sizes: Vec<f64> = match colour {
            Colour::UnmeasuredForce => {
                let long = response(&test.system, period.with_len(1 << 16)?, 1 << 40)?;
                vec![long.column(dof - 1).norm() / f64::from(1 << 8); dof]
            }
            other => vec![other.size(); dof],
        };
        Ok(Self {
            machine: machine.name(),
            lines: Lines::new(period, test.lines.iter().copied())?,
            unknowns: Unknowns::unknown_mass(dof)?,
            colour,
            scale: (0..dof).map(|c| LEVEL * rms(c) / sizes[c]).collect(),
            force: repeated(&test.force, periods)?,
            exact: repeated(&test.displacement, periods)?,
            periods,
            test,
        })
    }

    fn truth(&self) -> Vec<f64> {
        let entry = |p: &mechid_model::Parameter| {
            self.test.system.matrix(p.matrix())[(p.row(), p.column())]
        };
        self.unknowns.free().iter().map(entry).collect()
    }

    /// Returns the periods of the experiment with this seed.
    fn measure(&self, seed: u64) -> Result<RepeatedPeriods> {
        let (len, dof) = (self.exact.len(), self.scale.len());
        let mut motion = self.exact.data().clone();
        if let Colour::UnmeasuredForce = self.colour {
            // One force moves all channels, so the same factor scales the noise of all channels.
            let by = self.scale[dof - 1];
            let all = self.exact.sampling().with_len(4 * len)?;
            motion += by * response(&self.test.system, all, seed)?.rows(len, len);
            let white = noise::white(self.exact.sampling(), dof, 1.0, !seed)?;
            let own = |c: usize| 0.1 * LEVEL * self.exact.column(c).norm() / (len as f64).sqrt();
            for channel in 0..dof {
                motion.column_mut(channel).axpy(own(channel), &white.column(channel), 1.0);
            }
            return self.periods(motion);
        }
        for (channel, mut column) in motion.column_iter_mut().enumerate() {
            let drawn = self.colour.samples(len, seed * dof as u64 + channel as u64);
            column.iter_mut().zip(drawn).for_each(|(x, e)| *x += self.scale[channel] * e);
        }
        self.periods(motion)
    }

    fn periods(&self, motion: DMatrix<f64>) -> Result<RepeatedPeriods> {
        let motion = Record::new(self.exact.sampling(), motion)?;
        let kind = ResponseQuantity::Displacement;
        Ok(RepeatedPeriods::new(&self.lines, &self.force, &motion, kind)?)
    }

    fn fit(&self, seed: u64, pooling: Pooling) -> Result<OutputErrorFit> {
        let periods = self.measure(seed)?;
        Ok(match self.periods {
            1 => output_error_pooling(&periods.mean()?, &self.unknowns, pooling)?,
            _ => {
                let fit = output_error(&periods.mean_with_noise(pooling)?, &self.unknowns)?;
                let is_free = matches!(pooling, Pooling::Automatic | Pooling::Smooth);
                if !is_free || fit.noise == [NoiseModel::White] {
                    return Ok(fit);
                }
                // The command `identify` estimates the noise in the same way.
                let noise = periods.noise_with_system(pooling, &fit.estimate.system()?)?;
                match noise.models() {
                    [NoiseModel::UnmeasuredForce { .. }] => {
                        output_error(&periods.mean()?.with_noise(noise)?, &self.unknowns)?
                    }
                    _ => fit,
                }
            }
        })
    }

    /// Returns the standard errors of maximum likelihood with a known noise covariance.
    fn bound(&self) -> Result<Vec<f64>> {
        let dof = self.scale.len();
        let exact = {
            let kind = ResponseQuantity::Displacement;
            RepeatedPeriods::new(&self.lines, &self.force, &self.exact, kind)?.mean()?
        };
        let means: Vec<DMatrix<Complex<f64>>> = (0..MANY)
            .into_par_iter()
            .map(|seed| {
                let mean = self.measure((1 << 30) + seed).and_then(|p| Ok(p.mean()?));
                mean.expect("as the others").displacement() - exact.displacement()
            })
            .collect();
        let covariance = (0..exact.len()).map(|line| {
            let power = |c: usize| means.iter().map(|e| e[(line, c)].norm_sqr()).sum::<f64>();
            DMatrix::from_fn(2 * dof, 2 * dof, |i, j| {
                let own = i == j && i < dof;
                Complex::from(if own { power(i) / MANY as f64 } else { 0.0 })
            })
        });
        let noise = NoiseSpectrum::new(self.lines.omega(), covariance.collect())?;
        let found = output_error(&exact.with_noise(noise)?, &self.unknowns)?.estimate;
        Ok(found.parameters().map(|p| p.standard_error).collect())
    }
}

/// Returns the stationary displacements under an autoregressive force of the first order on the
/// last mass.
fn response(system: &SecondOrderSystem, sampling: Sampling, seed: u64) -> Result<DMatrix<f64>> {
    let mut force = DMatrix::zeros(sampling.len(), system.dof());
    let drawn = Colour::UnmeasuredForce.samples(sampling.len(), seed);
    force.column_mut(system.dof() - 1).copy_from_slice(&drawn);
    let exact = exact_harmonic_periodic(system, &Record::new(sampling, force)?)?;
    Ok(exact.displacement().data().clone())
}

fn kind(model: &NoiseModel) -> &'static str {
    match model {
        NoiseModel::White => "white",
        NoiseModel::Smooth { bands_hz, .. } if bands_hz.is_empty() => "smooth",
        NoiseModel::Smooth { order: 0, .. } => "bands",
        NoiseModel::Smooth { .. } => "smooth with bands",
        NoiseModel::UnmeasuredForce { .. } => "unmeasured force",
        NoiseModel::Proportional { .. } => "proportional",
        NoiseModel::Neighbours { .. } => "neighbours",
        NoiseModel::PerLine => "per line",
    }
}

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let runs: u64 = arguments.next().map_or(Ok(500), |a| a.parse())?;
    let pooling: Pooling = arguments.next().map_or(Ok(Pooling::Automatic), |a| a.parse())?;
    let only = arguments.next().unwrap_or_default();
    println!(
        "| Machine | Noise | Periods | Over bound, least | most | Held, least | most | Mean \
         | Chosen, % |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for machine in &Machine::ALL {
        for colour in Colour::ALL.into_iter().filter(|c| c.name().starts_with(&only)) {
            for periods in [1, 2, 4, 8] {
                row(&Study::new(machine, colour, periods)?, runs, pooling)?;
            }
        }
    }
    Ok(())
}

fn row(study: &Study, runs: u64, pooling: Pooling) -> Result<()> {
    let (truth, bound) = (study.truth(), study.bound()?);
    let fits: Vec<Option<OutputErrorFit>> =
        (0..runs).into_par_iter().map(|seed| study.fit(seed, pooling).ok()).collect();
    let found: Vec<&OutputErrorFit> = fits.iter().flatten().collect();
    let count = found.len() as f64;
    let estimates = || found.iter().map(|fit| &fit.estimate);
    let (mut over, mut held) = (Vec::new(), Vec::new());
    for (at, (truth, bound)) in truth.iter().zip(&bound).enumerate() {
        let own = |e: &Estimate| e.parameters().nth(at).expect("a parameter each");
        let square: f64 = estimates().map(|e| (own(e).value - truth).powi(2)).sum();
        over.push((square / count).sqrt() / bound);
        let holds = |e: &&Estimate| {
            let [low, high] = own(e).interval(0.95).expect("a level");
            (low..=high).contains(truth)
        };
        held.push(100.0 * estimates().filter(holds).count() as f64 / count);
    }
    let mut chosen = BTreeMap::new();
    for fit in &found {
        *chosen.entry(fit.noise.first().map_or("", kind)).or_insert(0u64) += 1;
    }
    let chosen: Vec<String> =
        chosen.iter().map(|(name, n)| format!("{name} {:.0}", 100.0 * *n as f64 / count)).collect();
    let least = |v: &[f64]| v.iter().copied().fold(f64::INFINITY, f64::min);
    let most = |v: &[f64]| v.iter().copied().fold(0.0, f64::max);
    println!(
        "| {} | {} | {} | {:.2} | {:.2} | {:.1} | {:.1} | {:.1} | {}{} |",
        study.machine,
        study.colour.name(),
        study.periods,
        least(&over),
        most(&over),
        least(&held),
        most(&held),
        held.iter().sum::<f64>() / held.len() as f64,
        chosen.join(", "),
        match runs as usize - found.len() {
            0 => String::new(),
            failed => format!("; failed {failed}"),
        },
    );
    Ok(())
}
