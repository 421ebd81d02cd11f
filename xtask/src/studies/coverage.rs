//! Coverage of the intervals in seeded experiments on a known oscillator. Thousands of these
//! experiments take only seconds.

use mechid::analysis::identify::{Method, Source};
use mechid::analysis::{Identified, Identify, Measurement, identify};
use mechid::model::{Sdof, SecondOrderSystem};
use mechid::signal::{Multisine, NoiseLevel, Phases, Record, Sampling, noise};
use mechid::{Acceleration, Displacement, ResponseQuantity, Velocity};
use mechid_problems::exact_harmonic_periodic;
use rayon::prelude::*;

use super::binomial::STATED;

/// Number of samples per period.
const PERIOD: usize = 128;
/// Highest line of the force.
const LAST: usize = 40;
/// Line of the resonance.
const RESONANCE: f64 = 12.0;
/// Ratio of the RMS of the noise to the RMS of its channel.
const LEVEL: f64 = 0.02;

/// A kind of experiment.
#[derive(Debug, Clone, Copy)]
pub struct Kind {
    /// Name.
    pub name: &'static str,
    settings: fn() -> Identify,
    periods: usize,
    /// True for noise on the force, false for noise on the responses.
    noisy_force: bool,
    responses: &'static [ResponseQuantity],
    /// True for the kinds of the short form, which runs for every change; the others take too long.
    pub is_short: bool,
}

/// All kinds of experiments.
pub const KINDS: [Kind; 4] = [
    Kind {
        name: "least squares, noise on the force",
        settings: || Identify::spectra(Method::LeastSquares),
        periods: 4,
        noisy_force: true,
        responses: &[Displacement],
        is_short: true,
    },
    Kind {
        name: "maximum likelihood, noise on the response",
        settings: || Identify::spectra(Method::MaximumLikelihood),
        periods: 4,
        noisy_force: false,
        responses: &[Displacement],
        is_short: true,
    },
    Kind {
        name: "equation of motion at the samples, noise on the force",
        settings: Identify::samples,
        periods: 4,
        noisy_force: true,
        responses: &[Displacement, Velocity, Acceleration],
        is_short: true,
    },
    Kind {
        name: "averaged frequency responses, noise on the response",
        settings: || Identify::responses(Default::default(), Default::default()),
        periods: 8,
        noisy_force: false,
        responses: &[Displacement],
        is_short: false,
    },
];

/// An interval of one experiment.
#[derive(Debug, Clone, PartialEq)]
pub struct Interval {
    /// Seed of the experiment.
    pub seed: u64,
    /// Letter of the parameter: m, c or k.
    pub parameter: &'static str,
    /// True value of the parameter, in SI units.
    pub truth: f64,
    /// Estimate with its 95 % interval, in SI units; `None` if the identification failed.
    pub estimate: Option<[f64; 3]>,
}

impl Interval {
    /// Returns true if the interval contains the true value.
    pub fn holds(&self) -> bool {
        self.estimate.is_some_and(|[_, low, high]| (low..=high).contains(&self.truth))
    }
}

fn sampling() -> Result<Sampling, String> {
    Sampling::new(0.02, PERIOD).map_err(words)
}

fn words(error: impl std::fmt::Display) -> String {
    error.to_string()
}

/// Returns mass, damping and stiffness with their letters. The resonance is on a spectral line, and
/// the damping ratio is 5 %.
fn parameters() -> Result<[(&'static str, f64); 3], String> {
    let (mass, omega) = (10.0, RESONANCE * sampling()?.omega0());
    Ok([("m", mass), ("c", 2.0 * 0.05 * mass * omega), ("k", mass * omega * omega)])
}

fn machine() -> Result<SecondOrderSystem, String> {
    let [m, c, k] = parameters()?.map(|(_, value)| value);
    Ok(Sdof::new(m, c, k).map_err(words)?.system())
}

impl Kind {
    /// Runs the experiments of these seeds, on all processors.
    ///
    /// # Errors
    /// The message of a generator that fails; an identification that fails has no interval.
    pub fn run(&self, seeds: std::ops::Range<u64>) -> Result<Vec<Interval>, String> {
        let (machine, truth) = (machine()?, parameters()?);
        let each: Vec<Result<Vec<Interval>, String>> = seeds
            .into_par_iter()
            .map(|seed| {
                let identified = self.experiment(&machine, seed)?;
                let interval = |(name, truth): (&'static str, f64)| Interval {
                    seed,
                    parameter: name,
                    truth,
                    estimate: identified.as_ref().and_then(|all| estimate(all, name)),
                };
                Ok(truth.map(interval).to_vec())
            })
            .collect();
        let all = each.into_iter().collect::<Result<Vec<_>, _>>()?;
        Ok(all.into_iter().flatten().collect())
    }

    fn experiment(
        &self,
        machine: &SecondOrderSystem,
        seed: u64,
    ) -> Result<Option<Identified>, String> {
        let phases = Phases::Random { seed: 1000 * seed };
        let force = Multisine::flat(1..=LAST, 10.0, phases).map_err(words)?;
        let force = force.sample(sampling()?).map_err(words)?;
        let exact = exact_harmonic_periodic(machine, &force).map_err(words)?;
        let measured = |period: &Record, is_noisy: bool, stream: u64| -> Result<Record, String> {
            let record = period.repeated(self.periods).map_err(words)?;
            let level = NoiseLevel::FractionOfRms(LEVEL);
            let seed = 1000 * seed + 1 + stream;
            if is_noisy {
                noise::add_white(&record, level, seed).map_err(words)
            } else {
                Ok(record)
            }
        };
        let force = measured(&force, self.noisy_force, 0)?;
        let of = |quantity: &ResponseQuantity| {
            let exact = match quantity {
                Displacement => exact.displacement(),
                Velocity => exact.velocity(),
                Acceleration => exact.acceleration(),
            };
            let stream = 1 + quantity.derivative_order() as u64;
            Ok((*quantity, measured(exact, !self.noisy_force, stream)?))
        };
        let responses = self.responses.iter().map(of).collect::<Result<Vec<_>, String>>()?;
        let responses: Vec<_> = responses.iter().map(|(kind, record)| (*kind, record)).collect();
        let settings = (self.settings)();
        let mut test = Measurement::from_records(&force, &responses).map_err(words)?;
        if !matches!(settings.source, Source::Samples(_)) {
            test = test.period(PERIOD).map_err(words)?;
        }
        Ok(identify(&[test], &settings).ok())
    }
}

fn estimate(identified: &Identified, name: &str) -> Option<[f64; 3]> {
    let parameter = identified.estimate().parameter(name).ok()?;
    let [low, high] = parameter.interval(STATED).ok()?;
    Some([parameter.value, low, high])
}
