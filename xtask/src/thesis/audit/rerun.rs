//! Simulations and estimates without a printed table.

use mechid::estimate::Unknowns;
use mechid::estimate::frequency_domain::equation_error;
use mechid::force::{continuous, discretised, discretised_by_taylor, spectrum_ratio};
use mechid::model::{Discretisation, ResponseQuantity, SecondOrderSystem};
use mechid::signal::{Extent, Spectrum};
use mechid::spectra::FrequencyData;
use nalgebra::DMatrix;

use super::super::case::{Case, Machine};
use super::super::estimates;
use super::super::published::Method;
use super::super::simulate::{self, Sequences};
use super::evidence::Source;
use super::markdown::number;

/// Returns one period of motion and force, with the slips or without.
///
/// # Errors
/// The message of the integrator.
pub fn sequences(source: Source, case: Case, method: Method) -> Result<Sequences, String> {
    match source {
        Source::Printed => simulate::slipped(case, method),
        Source::Corrected => simulate::correct(case, method),
    }
}

/// Time or frequency domain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Domain {
    /// Eqs. (4.5.12), (4.5.28).
    Time,
    /// Eqs. (4.6.12), (4.6.31).
    Frequency,
}

/// Estimates in the order of `Machine::parameters`.
///
/// # Errors
/// The message of the integrator or the estimator.
pub fn identified(
    source: Source,
    case: Case,
    method: Method,
    domain: Domain,
) -> Result<Vec<f64>, String> {
    let sequences = sequences(source, case, method)?;
    let single = matches!(case.machine, Machine::SingleDof { .. });
    let free_force = single && matches!(method, Method::Rk4 | Method::CentralDifference);
    match (domain, source) {
        (Domain::Time, _) => estimates::time(&sequences),
        (Domain::Frequency, Source::Corrected) => estimates::frequency(&sequences),
        (Domain::Frequency, Source::Printed) if free_force => {
            estimates::frequency_offset_free_force(&sequences)
        }
        (Domain::Frequency, Source::Printed) => estimates::frequency_offset(&sequences),
    }
}

/// Errors, in per cent, of the estimates that [`identified`] returns.
///
/// # Errors
/// The errors of [`identified`].
pub fn errors(
    source: Source,
    case: Case,
    method: Method,
    domain: Domain,
) -> Result<Vec<f64>, String> {
    Ok(percent(&identified(source, case, method, domain)?, case.machine))
}

/// Errors, in per cent, of the least-squares estimates from the spectral lines 1 … `last` of a
/// motion that is simulated without slips.
///
/// # Errors
/// The message of the estimator.
pub fn frequency_up_to(sequences: &Sequences, last: usize) -> Result<Vec<f64>, String> {
    let machine = sequences.machine;
    let displacement = sequences.response.displacement();
    let lines = 1..last + 1;
    let data = FrequencyData::from_records(
        &sequences.force,
        displacement,
        ResponseQuantity::Displacement,
        lines,
    )
    .map_err(|error| error.to_string())?;
    let unknowns =
        Unknowns::known_mass(machine.system().mass()).map_err(|error| error.to_string())?;
    let estimate = equation_error(&data, &unknowns).map_err(|error| error.to_string())?;
    Ok(percent(&machine.listed(&estimate.stiffness(), &estimate.damping()), machine))
}

/// |estimate − truth| in per cent of the truth.
pub fn percent(estimates: &[f64], machine: Machine) -> Vec<f64> {
    let pairs = estimates.iter().zip(machine.truth());
    pairs.map(|(e, t)| 100.0 * ((e - t) / t).abs()).collect()
}

/// Returns the machine with the parameters of an estimate.
fn system(listed: &[f64], machine: Machine) -> Result<SecondOrderSystem, String> {
    let mass = machine.system().mass().clone();
    let n = mass.nrows();
    let mut listed = listed.to_vec();
    if let Machine::Bearing { kyx } = machine {
        listed[2] *= kyx.factor();
    }
    let (stiffness, damping) = listed.split_at(n * n);
    let matrix = |values: &[f64]| DMatrix::from_row_slice(n, n, values);
    SecondOrderSystem::new(mass, matrix(damping), matrix(stiffness)).map_err(|e| e.to_string())
}

/// Machine whose parameters are used to identify a force.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Parameters {
    /// The true machine.
    Exact,
    /// The machine identified from the same data.
    From(Domain),
}

/// Equation for the identification of a force.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Equation {
    /// Sample by sample, eq. (4.8.1).
    Continuous,
    /// Step by step, by eqs. (4.7.1)–(4.7.3) or by a better discretisation.
    Discretised(Discretisation),
    /// Step by step, with the Taylor series cut after the term of this order.
    Taylor(usize),
}

/// The dissertation's discretised equation.
pub const EULER: Equation = Equation::Discretised(Discretisation::Euler);

/// |F̂_n|/|F_n| of the driven degree of freedom at every excited line: 1 is perfect.
#[derive(Debug, Clone)]
pub struct Ratios {
    omega0: f64,
    ratios: Vec<f64>,
}

impl Ratios {
    /// Computes the errors of the force identified from given sequences.
    ///
    /// # Errors
    /// The message of the force equation.
    pub fn new(
        sequences: &Sequences,
        machine: &SecondOrderSystem,
        equation: Equation,
    ) -> Result<Self, String> {
        let force = match equation {
            Equation::Continuous => continuous(machine, &sequences.response),
            Equation::Taylor(order) => {
                discretised_by_taylor(machine, &sequences.response, order, Extent::WholePeriod)
            }
            Equation::Discretised(d) => {
                discretised(machine, &sequences.response, d, Extent::WholePeriod)
            }
        }
        .map_err(|e| e.to_string())?;
        let sampling = sequences.force.sampling();
        let lines: Vec<usize> = (1..sampling.len().div_ceil(2)).collect();
        let driven = machine.dof() - 1;
        let truth = Spectrum::from_record(&sequences.force);
        let ratios =
            spectrum_ratio(force.spectrum(), &truth, driven, &lines).map_err(|e| e.to_string())?;
        Ok(Self { omega0: sampling.omega0(), ratios })
    }

    /// Returns the smallest and the largest ratio |F̂_n|/|F_n|.
    pub fn range(&self) -> [f64; 2] {
        let pick = |f: fn(f64, f64) -> f64, from| self.ratios.iter().copied().fold(from, f);
        [pick(f64::min, f64::INFINITY), pick(f64::max, f64::NEG_INFINITY)]
    }

    /// Returns the difference between the largest and the smallest ratio |F̂_n|/|F_n|.
    pub fn spread(&self) -> f64 {
        let [low, high] = self.range();
        high - low
    }

    /// Returns the root mean square of the differences between the ratios |F̂_n|/|F_n| and 1.
    pub fn rms(&self) -> f64 {
        let squares: f64 = self.ratios.iter().map(|r| (r - 1.0).powi(2)).sum();
        (squares / self.ratios.len() as f64).sqrt()
    }

    /// Returns the largest difference between a ratio |F̂_n|/|F_n| and 1, over the lines above
    /// `omega` (rad/s).
    pub fn worst_above(&self, omega: f64) -> f64 {
        let lines = self.ratios.iter().enumerate();
        lines
            .filter(|(at, _)| (at + 1) as f64 * self.omega0 > omega)
            .map(|(_, r)| (r - 1.0).abs())
            .fold(0.0, f64::max)
    }

    /// Returns the range of the ratios |F̂_n|/|F_n| as text.
    pub fn words(&self) -> String {
        let [low, high] = self.range();
        format!("{}–{}", number(low), number(high))
    }

    /// Returns the root mean square of the differences between these ratios |F̂_n|/|F_n| and those
    /// of `other`.
    pub fn distance(&self, other: &Self) -> f64 {
        let pairs = self.ratios.iter().zip(&other.ratios);
        let squares: f64 = pairs.map(|(a, b)| (a - b).powi(2)).sum();
        (squares / self.ratios.len() as f64).sqrt()
    }
}

/// The force of one case, identified with one machine and one equation.
///
/// # Errors
/// The message of the integrator, the estimator or the force equation.
pub fn force(
    source: Source,
    case: Case,
    method: Method,
    parameters: Parameters,
    equation: Equation,
) -> Result<Ratios, String> {
    let sequences = sequences(source, case, method)?;
    let machine = match parameters {
        Parameters::Exact => sequences.machine.system(),
        Parameters::From(domain) => {
            system(&identified(source, case, method, domain)?, sequences.machine)?
        }
    };
    Ratios::new(&sequences, &machine, equation)
}

/// The single degree of freedom, with 256 samples per period.
pub fn sdof(npi: f64) -> Case {
    Case { machine: Machine::SDOF, nt: 256, npi }
}

/// The bearing.
pub fn bearing(nt: usize, npi: f64) -> Case {
    Case { machine: Machine::Bearing { kyx: mechid::model::KyxSign::Minus }, nt, npi }
}
