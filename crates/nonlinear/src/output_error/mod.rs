//! Output error: a fit of the simulated response to the measured response.

mod further;
mod open;
mod record;
mod starts;
mod uncertainty;

use mechid_estimate::EstimateParts;
use mechid_estimate::{Estimate, EstimateError, Unknowns};
use mechid_model::{InitialState, NonlinearSystem, Parameter, ResponseQuantity, Term, Terms};
use mechid_numerics::gauss_newton::{Residuals, minimise_residuals};
use mechid_numerics::{NumericsError, Uncertain, check_size, time_limit};
use mechid_signal::Record;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

pub use self::further::{FurtherFit, further_output_error};
pub use self::open::output_error_of_open_records;
pub use self::record::SteppedRecord;
pub use self::starts::best_output_error;
use super::covariance::Uncertainty;
use super::equation_error::slowest_decay;
use super::estimate::{NamedParameter, NonlinearEstimate};
use super::limits::{SAMPLE_OPERATIONS, SEARCH_STEPS};
use super::predict::{fitted_start, initial};
use super::simulate::{Course, Direction, FineForce, Tangent};
use super::whitening::{Filter, NoisePath};
use crate::limits::OUTPUT_FORGOTTEN;

/// Result of an output-error fit: a [`NonlinearEstimate`], the initial states and the residuals.
#[derive(Debug, Clone, PartialEq)]
pub struct NonlinearFit {
    /// System with the covariance of its parameters.
    pub estimate: NonlinearEstimate,
    /// State of each record at its first sample.
    pub starts: Vec<InitialState>,
    /// RMS of the residual of each channel over all records, in the unit of the response.
    pub rmse: Vec<f64>,
    /// Residual of each record, in the unit of the response. If a record has one period, the
    /// residual is whitened with the most likely noise on force and response.
    pub residuals: Vec<Record>,
    /// Number of Gauss–Newton steps.
    pub steps: usize,
}

/// Estimates free entries of M, C and K, the coefficients of the terms, the constants inside their
/// laws and the initial state of each record by least squares on the measured minus the simulated
/// response.
///
/// Noise of any spectrum on the response does not bias the estimate. Noise on the force acts, to
/// first order, as noise on the response; its effect on the derivatives is of second order.
/// Gauss–Newton steps (damped if needed) begin at `start`, which usually comes from
/// [`equation_error`](super::equation_error). The delay and the phase of the channels in `start` do
/// not change. Channels are weighted by the size of their residuals.
///
/// The standard errors follow from the noise of force and response in several periods
/// ([`Periods`](super::StandardErrors::Periods)), propagated through the system, if the residual
/// does not exceed this noise ([`NonlinearEstimate::misfit`]). For single periods and open records,
/// the variances of white noise on force and response are estimated from the residual; the fit is
/// the most likely one under this noise ([`Noise`](super::StandardErrors::Noise)), if the residual
/// is consistent with the noise. Otherwise the standard errors include the effect of the spectrum
/// of the residual ([`Blocks`](super::StandardErrors::Blocks)): if the damping of a resonance is
/// slightly wrong, the formula for a white residual gives errors several times too small.
///
/// # Errors
/// [`NumericsError::Size`] or [`EstimateError::Signal`] if the records do not match the system,
/// [`NumericsError::TooFewRows`] without a record, [`EstimateError::TooStiff`],
/// [`EstimateError::Diverged`] if the response of `start` diverges,
/// [`EstimateError::NotConverged`], and [`EstimateError::Undetermined`] if the records do not
/// determine a parameter.
///
/// # Source
/// Schoukens & Ljung (2019), IEEE Control Systems 39(6), 28–99 (simulation error and its
/// derivatives); Hairer, Nørsett & Wanner, *Solving Ordinary Differential Equations I*, section
/// I.14.
pub fn output_error(
    records: &[SteppedRecord],
    measured: ResponseQuantity,
    start: &NonlinearEstimate,
) -> Result<NonlinearFit, EstimateError> {
    search(records, measured, start, Weights::Noise)
}

/// Weights of the samples after a first search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Weights {
    /// One weight for each channel, from the size of the residual of the channel.
    Levels,
    /// Inverse of the covariance of the most likely noise on force and response. It is used if a
    /// record has one period and the residual is consistent with this noise.
    Noise,
    /// Inverse of the covariance of the most likely noise on force and response, even if the
    /// residual is not consistent with this noise.
    AnyNoise,
}

/// Returns the fit of [`output_error`] with these weights.
fn search(
    records: &[SteppedRecord],
    measured: ResponseQuantity,
    start: &NonlinearEstimate,
    weights: Weights,
) -> Result<NonlinearFit, EstimateError> {
    let system = start.system()?;
    let n = system.dof();
    for record in records {
        check_size("channels of the force", n, record.force.channels())?;
        check_size("channels of the response", n, record.response.channels())?;
    }
    let mut problem = Problem::new(records, measured, start, &system)?;
    let theta = problem.start(&system)?;
    if !problem.residual(&theta, &mut DVector::zeros(problem.len())) {
        let len = problem.records.iter().map(|record| record.response.len()).max().unwrap_or(0);
        return Err(EstimateError::Diverged { len });
    }
    // The weights need the residuals of a first search.
    let (first, mut steps) = problem.minimum(theta)?;
    problem.levels = problem.residual_rms();
    problem.noise = match weights {
        Weights::Noise | Weights::AnyNoise => problem.noise(&first),
        Weights::Levels => None,
    };
    if problem.noise.is_some() {
        match problem.minimum(first.clone()) {
            Ok((theta, more)) if weights == Weights::AnyNoise || problem.is_white() => {
                return problem.finish(&theta, start, steps + more);
            }
            // If this noise does not describe the residual, the fit with the smallest residual is
            // the best.
            _ => problem.noise = None,
        }
    }
    if n > 1 {
        let (theta, more) = problem.minimum(first)?;
        steps += more;
        return problem.finish(&theta, start, steps);
    }
    problem.residual(&first, &mut DVector::zeros(problem.len()));
    problem.finish(&first, start, steps)
}

/// Record with its interpolated force, and the deviations of the periods from the mean period.
struct Prepared {
    response: Record,
    force: FineForce,
    /// Force at the samples.
    plain: Record,
    /// Deviations of the periods from the mean period, samples × channels; the channels of the
    /// response come before those of the force.
    deviations: Vec<DMatrix<f64>>,
}

struct Problem<'a> {
    records: Vec<Prepared>,
    measured: ResponseQuantity,
    unknowns: &'a Unknowns,
    terms: &'a Terms,
    free: Vec<Parameter>,
    /// Free entries, terms and constants, without initial states.
    shared: Vec<Direction>,
    /// RMS of the residual of each channel.
    levels: Vec<f64>,
    courses: Vec<Course>,
    /// Filters that make the residuals of the records white; `None` for weights by `levels`.
    noise: Option<Vec<(NoisePath, Filter)>>,
}

impl<'a> Problem<'a> {
    fn new(
        records: &[SteppedRecord],
        measured: ResponseQuantity,
        start: &'a NonlinearEstimate,
        system: &NonlinearSystem,
    ) -> Result<Self, EstimateError> {
        let at_rest = InitialState::rest(system.dof());
        let unknowns = start.linear().unknowns();
        let free = unknowns.free();
        let entries = free.iter().map(|entry| Direction::Entry(*entry));
        let terms = (0..start.terms().len()).map(Direction::Term);
        let constants = start.terms().iter().enumerate().flat_map(|(term, law)| {
            (0..law.law().constants().len()).map(move |at| Direction::Constant(term, at))
        });
        let shared = entries.chain(terms).chain(constants).collect();
        let prepared = records.iter().map(|record| {
            let (plain, response, deviations) = record.prepared(start.channels())?;
            let force = FineForce::sufficient(&plain, system, record.extent, &at_rest)?;
            Ok(Prepared { response, force, plain, deviations })
        });
        let records = prepared.collect::<Result<Vec<_>, EstimateError>>()?;
        if records.is_empty() {
            return Err(NumericsError::TooFewRows { rows: 0, unknowns: free.len() }.into());
        }
        let mut problem = Self {
            records,
            measured,
            unknowns,
            terms: start.terms(),
            free,
            shared,
            levels: vec![1.0; system.dof()],
            courses: Vec::new(),
            noise: None,
        };
        let measured = |dof| problem.rms(|_, record| record.response.column(dof).into_owned());
        problem.levels = (0..system.dof()).map(measured).collect();
        Ok(problem)
    }

    fn dof(&self) -> usize {
        self.unknowns.dof()
    }

    /// Returns the RMS value of a column over all records, or 1 if this value is zero.
    fn rms(&self, column: impl Fn(usize, &Prepared) -> DVector<f64>) -> f64 {
        let (mut square, mut samples) = (0.0, 0);
        for (at, record) in self.records.iter().enumerate() {
            let column = column(at, record);
            square += column.norm_squared();
            samples += column.len();
        }
        let rms = (square / samples as f64).sqrt();
        if rms > 0.0 { rms } else { 1.0 }
    }

    /// Returns the RMS of each channel's residual at the last evaluation.
    fn residual_rms(&self) -> Vec<f64> {
        let rms = |dof: usize| self.rms(|at, record| self.gap(at, record, dof));
        (0..self.dof()).map(rms).collect()
    }

    fn gap(&self, at: usize, record: &Prepared, dof: usize) -> DVector<f64> {
        let column = self.measured.derivative_order() * self.dof() + dof;
        record.response.column(dof) - self.courses[at].state.column(column)
    }

    /// Returns the free entries, the coefficients and the constants of a system.
    fn shared_parameters(&self, system: &NonlinearSystem) -> Vec<f64> {
        let linear = system.linear();
        let entries = self.free.iter().map(|p| linear.matrix(p.matrix())[(p.row(), p.column())]);
        let constants = self.terms.iter().flat_map(|term| term.law().constants());
        entries
            .chain(system.coefficients().iter().copied())
            .chain(constants.map(|constant| constant.value))
            .collect()
    }

    /// Returns the parameters of a system together with the initial states of a fit.
    fn parameters_at(&self, fit: &NonlinearFit, system: &NonlinearSystem) -> DVector<f64> {
        let mut theta = self.shared_parameters(system);
        for state in &fit.starts {
            theta.extend(state.displacement().iter().chain(state.velocity().iter()));
        }
        theta.into()
    }

    /// Returns the residuals of a record, samples × channels.
    fn residuals(&self, at: usize, record: &Prepared) -> DMatrix<f64> {
        let residuals: Vec<_> = (0..self.dof()).map(|dof| self.gap(at, record, dof)).collect();
        DMatrix::from_columns(&residuals)
    }

    /// Returns `values` after weighting; `values` are the residuals of a record, or derivatives of
    /// these residuals.
    fn weighted(&self, at: usize, mut values: DMatrix<f64>) -> DMatrix<f64> {
        match &self.noise {
            Some(noise) => noise[at].0.whiten(&noise[at].1, &mut values),
            None => values
                .column_iter_mut()
                .zip(&self.levels)
                .for_each(|(mut column, level)| column /= *level),
        }
        values
    }

    /// Searches for the minimum of the weighted residual from some parameters, and evaluates the
    /// residual at the minimum; also returns the number of steps.
    fn minimum(&mut self, start: DVector<f64>) -> Result<(DVector<f64>, usize), EstimateError> {
        let lost = |steps| EstimateError::NotConverged { searches: 1, steps };
        let minimum = minimise_residuals(self, start, SEARCH_STEPS).ok_or(lost(0))?;
        if !minimum.converged && !time_limit::is_over() {
            return Err(lost(minimum.steps));
        }
        let mut residual = DVector::zeros(self.len());
        self.residual(&minimum.parameters, &mut residual);
        Ok((minimum.parameters, minimum.steps))
    }

    /// Computes the weighted residuals of all records at the last evaluation.
    fn weigh(&self, residual: &mut DVector<f64>) {
        let mut at = 0;
        for (number, record) in self.records.iter().enumerate() {
            let residuals = self.weighted(number, self.residuals(number, record));
            residual.rows_mut(at, residuals.len()).copy_from_slice(residuals.as_slice());
            at += residuals.len();
        }
    }

    /// Returns the initial parameters, which include the initial states that fit the records best.
    fn start(&self, system: &NonlinearSystem) -> Result<DVector<f64>, EstimateError> {
        let mut theta = self.shared_parameters(system);
        let rate = slowest_decay(self.unknowns, &theta[..self.free.len()]);
        let state = |record: &Prepared| {
            let samples = OUTPUT_FORGOTTEN / (rate * record.response.sampling().dt());
            let len = (samples.min(1e9) as usize).clamp(16, record.response.len().max(16));
            let len = len.min(record.response.len());
            let (force, response) = (record.plain.window(0, len)?, record.response.window(0, len)?);
            fitted_start(system, &force, &[(self.measured, &response)])
        };
        let states: Vec<_> = self.records.par_iter().map(state).collect::<Result<_, _>>()?;
        for state in states {
            theta.extend(state.displacement().iter().chain(state.velocity().iter()));
        }
        Ok(theta.into())
    }

    /// Returns the system with these parameters; `None` if they are not valid.
    fn system(&self, theta: &DVector<f64>) -> Option<NonlinearSystem> {
        let (entries, remaining) = theta.as_slice().split_at(self.free.len());
        let (coefficients, mut remaining) = remaining.split_at(self.terms.len());
        let [m, c, k] = self.unknowns.assemble(entries);
        let linear = mechid_model::SecondOrderSystem::new(m, c, k).ok()?;
        let mut terms = Vec::new();
        for term in self.terms {
            let (constants, tail) = remaining.split_at(term.law().constants().len());
            terms.push(if constants.is_empty() {
                term.clone()
            } else {
                term.with_constants(constants)?
            });
            remaining = tail;
        }
        NonlinearSystem::new(linear, Terms::new(terms).ok()?, coefficients.to_vec()).ok()
    }

    /// Returns the parameters of a record: the shared parameters, followed by the initial state of
    /// the record.
    fn directions(&self) -> Vec<Direction> {
        let starts = (0..2 * self.dof()).map(Direction::Initial);
        self.shared.iter().copied().chain(starts).collect()
    }

    /// Returns the index of a record's direction among all parameters.
    fn parameter_index(&self, record: usize, direction: usize) -> usize {
        if direction < self.shared.len() { direction } else { direction + record * 2 * self.dof() }
    }

    fn initial(&self, theta: &DVector<f64>, record: usize) -> Option<InitialState> {
        let (first, len) = (self.parameter_index(record, self.shared.len()), 2 * self.dof());
        initial(&theta.rows(first, len).into_owned()).ok()
    }

    /// Returns the largest |q| (m) and |q̇| (m/s) of the coordinate of each term in the simulated
    /// responses.
    fn ranges(&self, system: &NonlinearSystem) -> Vec<[f64; 2]> {
        system.terms().iter().map(|term| self.range_of(term)).collect()
    }

    /// Returns the largest |q| (m) and |q̇| (m/s) of the coordinate of a term.
    fn range_of(&self, term: &Term) -> [f64; 2] {
        let n = self.dof();
        let signs = DVector::from_fn(n, |dof, _| term.coordinate().sign(dof));
        let amplitude = |part: usize| {
            let of_course = |course: &Course| (course.state.columns(part * n, n) * &signs).amax();
            self.courses.iter().map(of_course).fold(0.0, f64::max)
        };
        [0, 1].map(amplitude)
    }

    /// Returns the shared parameters with their names, units and standard errors.
    fn named_parameters(
        &self,
        theta: &DVector<f64>,
        system: &NonlinearSystem,
        covariance: &DMatrix<f64>,
        freedom: usize,
    ) -> Vec<NamedParameter> {
        let entries = self.free.iter().map(|p| (p.to_string(), p.matrix().unit().to_owned()));
        let terms = system.terms().iter().map(|term| (term.name().to_owned(), term.unit()));
        let constants = system.terms().iter().flat_map(|term| {
            let named = |c: mechid_model::Constant| {
                (format!("{}.{}", term.name(), c.name), c.unit.to_owned())
            };
            term.law().constants().into_iter().map(named)
        });
        let names = entries.chain(terms).chain(constants).enumerate();
        let parameters = names.map(|(at, named)| {
            let (name, unit) = named;
            let (value, standard_error) = (theta[at], covariance[(at, at)].sqrt());
            let estimate = Uncertain { value, standard_error, degrees_of_freedom: freedom };
            NamedParameter { name, unit, estimate }
        });
        parameters.collect()
    }

    /// Returns the weighted residuals of each record, scaled so that the channels have the RMS
    /// values `rmse`.
    fn white_residuals(&self, rmse: &[f64]) -> Result<Vec<Record>, EstimateError> {
        let residuals = self.records.iter().enumerate().map(|(at, record)| {
            let mut residuals = self.weighted(at, self.residuals(at, record));
            for (mut column, rmse) in residuals.column_iter_mut().zip(rmse) {
                let size = (column.norm_squared() / column.len() as f64).sqrt();
                column *= if size > 0.0 { rmse / size } else { 0.0 };
            }
            Ok(Record::new(record.response.sampling(), residuals)?)
        });
        residuals.collect()
    }

    fn finish(
        self,
        theta: &DVector<f64>,
        start: &NonlinearEstimate,
        steps: usize,
    ) -> Result<NonlinearFit, EstimateError> {
        let wrong = EstimateError::NotConverged { searches: 1, steps };
        let system = self.system(theta).ok_or(wrong.clone())?;
        let (n, shared, free) = (self.dof(), self.shared.len(), self.free.len());
        let inverse = self.inverse(theta.len())?;
        let Uncertainty { covariance, standard_errors, freedom, misfit, bias } =
            self.uncertainty(theta, &system, &inverse);
        let covariance = covariance.view((0, 0), (shared, shared)).into_owned();
        let rmse = self.residual_rms();
        let around_mean = |dof: usize| {
            self.rms(|_, record| {
                let column = record.response.column(dof);
                column.add_scalar(-column.mean())
            })
        };
        let unexplained: Vec<f64> = (0..n).map(|dof| rmse[dof] / around_mean(dof)).collect();
        let linear = Estimate::new(EstimateParts {
            unknowns: self.unknowns.clone(),
            values: theta.as_slice()[..free].to_vec(),
            covariance: covariance.view((0, 0), (free, free)).into_owned().into(),
            degrees_of_freedom: freedom,
            residual_nrmse: unexplained.clone(),
            condition: start.linear().condition(),
            undetermined: Vec::new(),
        })?;
        let parameters = self.named_parameters(theta, &system, &covariance, freedom);
        let starts = (0..self.records.len()).map(|at| self.initial(theta, at).ok_or(wrong.clone()));
        Ok(NonlinearFit {
            starts: starts.collect::<Result<_, _>>()?,
            residuals: self.white_residuals(&rmse)?,
            rmse,
            steps,
            estimate: NonlinearEstimate {
                linear,
                coefficients: system.coefficients().to_vec(),
                parameters,
                covariance,
                channels: start.channels(),
                weighting: start.weighting(),
                standard_errors,
                misfit,
                bias,
                unexplained,
                ranges: match start.ranges() {
                    [] => self.ranges(&system),
                    measured => measured.to_vec(),
                },
                terms: system.terms().clone(),
                equations: self.len(),
            },
        })
    }
}

impl Residuals for Problem<'_> {
    fn len(&self) -> usize {
        self.dof() * self.records.iter().map(|record| record.response.len()).sum::<usize>()
    }

    fn residual(&mut self, theta: &DVector<f64>, residual: &mut DVector<f64>) -> bool {
        let Some(system) = self.system(theta) else { return false };
        let directions = self.directions();
        let n = self.dof() as f64;
        let of_number = SAMPLE_OPERATIONS * n * (1.0 + directions.len() as f64);
        time_limit::spend(self.len() as f64 * of_number);
        let run = |(at, record): (usize, &Prepared)| {
            let start = self.initial(theta, at)?;
            Tangent::new(&system, &directions).simulate(&record.force, &start)
        };
        let courses: Option<Vec<Course>> = self.records.par_iter().enumerate().map(run).collect();
        let Some(courses) = courses else { return false };
        self.courses = courses;
        self.weigh(residual);
        true
    }

    fn jacobian(&self, jacobian: &mut DMatrix<f64>) {
        jacobian.fill(0.0);
        let (n, order) = (self.dof(), self.measured.derivative_order());
        let mut at = 0;
        for (number, course) in self.courses.iter().enumerate() {
            let len = n * course.state.nrows();
            let weighted = |derivative: &DMatrix<f64>| {
                self.weighted(number, -derivative.columns(order * n, n))
            };
            let sensitivities: Vec<_> = course.derivatives.par_iter().map(weighted).collect();
            for (d, sensitivity) in sensitivities.iter().enumerate() {
                let column = self.parameter_index(number, d);
                let mut to = jacobian.view_mut((at, column), (len, 1));
                to.copy_from_slice(sensitivity.as_slice());
            }
            at += len;
        }
    }
}
