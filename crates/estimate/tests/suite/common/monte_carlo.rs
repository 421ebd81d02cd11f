//! Repeated experiments with seeded noise, and the lower bound of the scatter of unbiased
//! estimators.

use mechid_estimate::frequency_domain::{equation_error, instrumental_variables, output_error};
use mechid_estimate::{Estimate, Unknowns};
use mechid_model::{ResponseQuantity, SecondOrderSystem};
use mechid_signal::{NoiseLevel, Record, noise};
use mechid_spectra::{Lines, Pooling, RepeatedPeriods};
use nalgebra::{Complex, DMatrix, DVector};
use rayon::prelude::*;

use super::{displacements, forces, sampling, synthesise};

/// Estimators that are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Estimator {
    LeastSquares,
    InstrumentalVariables,
    MaximumLikelihood,
}

/// A machine driven by a multisine on every line of 256 samples, with noise on its displacement.
pub struct Experiment {
    pub system: SecondOrderSystem,
    pub unknowns: Unknowns,
    pub periods: usize,
    /// Standard deviation of the noise as a fraction of the RMS of each displacement.
    pub noise: f64,
    lines: Lines,
    force: Record,
    motion: Record,
}

/// Results of an estimator over many experiments, per parameter.
pub struct Scatter {
    pub bias: DVector<f64>,
    pub deviation: DVector<f64>,
    /// Share of 95 % intervals that contain the true value.
    pub coverage: DVector<f64>,
}

impl Experiment {
    pub fn new(system: SecondOrderSystem, unknowns: Unknowns, periods: usize, noise: f64) -> Self {
        let (period, lines) = sampling(&system);
        let lines = Lines::new(period, lines).unwrap();
        let force = forces(lines.as_slice(), system.dof(), 50.0);
        let motion = displacements(&system, &lines.omega(), &force);
        let repeat = |amplitudes: &DMatrix<Complex<f64>>| {
            let one =
                synthesise(period, lines.as_slice(), amplitudes, ResponseQuantity::Displacement);
            let len = period.len();
            let all =
                DMatrix::from_fn(len * periods, system.dof(), |k, c| one.data()[(k % len, c)]);
            Record::new(period.with_len(len * periods).unwrap(), all).unwrap()
        };
        let (force, motion) = (repeat(&force), repeat(&motion));
        Self { system, unknowns, periods, noise, lines, force, motion }
    }

    /// Returns the noisy periods of the experiment with this seed.
    pub fn measure(&self, seed: u64) -> RepeatedPeriods {
        let level = NoiseLevel::FractionOfRms(self.noise);
        let motion = noise::add_white(&self.motion, level, seed).unwrap();
        RepeatedPeriods::new(&self.lines, &self.force, &motion, ResponseQuantity::Displacement)
            .unwrap()
    }

    pub fn estimate(&self, periods: &RepeatedPeriods, estimator: Estimator) -> Estimate {
        let unknowns = &self.unknowns;
        match estimator {
            Estimator::LeastSquares => equation_error(&periods.mean().unwrap(), unknowns),
            Estimator::InstrumentalVariables => {
                let (first, second) = periods.halves().unwrap();
                instrumental_variables(&first, &second, unknowns)
            }
            Estimator::MaximumLikelihood => {
                let data = periods.mean_with_noise(Pooling::AllLines).unwrap();
                output_error(&data, unknowns).map(|fit| fit.estimate)
            }
        }
        .unwrap()
    }

    /// The true values of the unknowns.
    pub fn truth(&self) -> DVector<f64> {
        let free = self.unknowns.free();
        let entry =
            |p: &mechid_model::Parameter| self.system.matrix(p.matrix())[(p.row(), p.column())];
        DVector::from_iterator(free.len(), free.iter().map(entry))
    }

    /// Runs `runs` experiments; the result does not depend on the number of threads.
    pub fn scatter(&self, estimators: &[Estimator], runs: u64) -> Vec<Scatter> {
        let found: Vec<Vec<Estimate>> = (0..runs)
            .into_par_iter()
            .map(|seed| {
                let periods = self.measure(seed);
                estimators.iter().map(|e| self.estimate(&periods, *e)).collect()
            })
            .collect();
        (0..estimators.len()).map(|e| self.summarise(&found, e)).collect()
    }

    fn summarise(&self, found: &[Vec<Estimate>], estimator: usize) -> Scatter {
        let (truth, runs) = (self.truth(), found.len() as f64);
        let zero = DVector::zeros(truth.len());
        let (mut bias, mut power, mut coverage) = (zero.clone(), zero.clone(), zero);
        for run in found {
            for (at, p) in run[estimator].parameters().enumerate() {
                let error = p.value - truth[at];
                bias[at] += error / runs;
                power[at] += error * error / runs;
                let [low, high] = p.interval(0.95).unwrap();
                coverage[at] += f64::from(low <= truth[at] && truth[at] <= high) / runs;
            }
        }
        let variance = (power - bias.component_mul(&bias)) * (runs / (runs - 1.0));
        Scatter { bias, deviation: variance.map(f64::sqrt), coverage }
    }

    /// Returns the smallest standard deviations of unbiased estimators, by the Cramér–Rao
    /// inequality.
    ///
    /// The bound does not depend on the estimators. It follows from the sensitivities of the
    /// closed-form displacement, by central differences, and from white noise. Noise with the
    /// standard deviation s has the power 4 s²/N on each line of N samples.
    pub fn bound(&self) -> DVector<f64> {
        let (truth, omega) = (self.truth(), self.lines.omega());
        let force = forces(self.lines.as_slice(), self.system.dof(), 50.0);
        let displacement = |theta: &DVector<f64>| {
            let [m, c, k] = self.unknowns.assemble(theta.as_slice());
            displacements(&SecondOrderSystem::new(m, c, k).unwrap(), &omega, &force)
        };
        let size = truth.amax();
        let sensitivities: Vec<_> = (0..truth.len())
            .map(|at| {
                // A parameter whose value is zero also needs a step that is not zero.
                let step = 1e-5 * truth[at].abs().max(1e-3 * size);
                let (mut up, mut down) = (truth.clone(), truth.clone());
                up[at] += step;
                down[at] -= step;
                (displacement(&up) - displacement(&down)) / Complex::from(2.0 * step)
            })
            .collect();
        let samples = self.lines.sampling().len() as f64 * self.periods as f64;
        let information = DMatrix::from_fn(truth.len(), truth.len(), |i, j| {
            (0..self.system.dof())
                .map(|c| {
                    let rms = self.motion.column(c).norm() / (self.motion.len() as f64).sqrt();
                    let variance = 4.0 * (self.noise * rms).powi(2) / samples;
                    let product = sensitivities[i].column(c).dotc(&sensitivities[j].column(c));
                    2.0 * product.re / variance
                })
                .sum::<f64>()
        });
        let scale = information.diagonal().map(|v| 1.0 / v.sqrt());
        let unit = DMatrix::from_diagonal(&scale);
        let inverse = (&unit * information * &unit).lu().solve(&unit).unwrap();
        (unit * inverse).diagonal().map(f64::sqrt)
    }
}
