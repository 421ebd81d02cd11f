//! Standard errors of an output-error fit, and the test of its residual.

use mechid_estimate::{EstimateError, NAMED_PARAMETERS};
use mechid_model::NonlinearSystem;
use mechid_numerics::NumericsError;
use mechid_numerics::gauss_newton::Residuals;
use mechid_numerics::least_squares::LeastSquares;
use mechid_numerics::triangular::TriangularFactor;
use mechid_signal::correlation::whiteness;
use mechid_signal::{Record, Spectrum, message};
use nalgebra::{Complex, DMatrix, DVector};
use rayon::prelude::*;

use super::{Prepared, Problem};
use crate::covariance::{BlockScores, ByPeriods, InTime, Uncertainty, block_count};
use crate::equation_error::slowest_decay;
use crate::estimate::StandardErrors;
use crate::limits::{FEWEST, SIGNIFICANT, WHITE_LAGS};
use crate::propagation::Propagation;
use crate::scatter::{Line, PeriodScatter, Powers};
use crate::simulate::{Direction, Tangent};
use crate::whitening::{Filter, NoisePath, most_likely};

impl Problem<'_> {
    /// Returns (JᵀJ)⁻¹ of all parameters at the last evaluation of the residual.
    pub(super) fn inverse(&self, parameters: usize) -> Result<DMatrix<f64>, EstimateError> {
        let mut jacobian = DMatrix::zeros(self.len(), parameters);
        self.jacobian(&mut jacobian);
        let mut factor = TriangularFactor::new(parameters);
        if !factor.push(&[jacobian.as_view()]) {
            return Err(NumericsError::Overflow.into());
        }
        let mut rows = LeastSquares::new(parameters, 1);
        rows.push_rows(factor.r().as_view(), DMatrix::zeros(parameters, 1).as_view())?;
        let solution = rows.solve()?;
        if !solution.undetermined.is_empty() {
            let at = |at: usize| solution.undetermined.iter().any(|d| d.involved[at]);
            let open = self.free.iter().enumerate().filter(|(i, _)| at(*i)).map(|(_, p)| p);
            return Err(EstimateError::Undetermined {
                parameters: message::list(open, ", ", NAMED_PARAMETERS),
                directions: "they change the simulated response in the same way".to_owned(),
            });
        }
        Ok(solution.unscaled_covariance)
    }

    /// Returns the covariance of all parameters. It comes from the noise of the periods if the
    /// residual does not exceed this noise, otherwise from blocks of time. For a record too short
    /// for blocks, the covariance is the scatter increased to the size of the residual or, for a
    /// single period, the covariance for a white residual.
    pub(super) fn uncertainty(
        &self,
        theta: &DVector<f64>,
        system: &NonlinearSystem,
        inverse: &DMatrix<f64>,
    ) -> Uncertainty {
        let by_periods = self.by_periods(theta, system, inverse);
        Uncertainty::new(by_periods, self.shared.len(), || self.by_residual(theta, inverse))
    }

    /// Returns the scatter of the parameters due to the noise on force and response, and the test
    /// of the residual against this noise; `None` if a record has only one period.
    fn by_periods(
        &self,
        theta: &DVector<f64>,
        system: &NonlinearSystem,
        inverse: &DMatrix<f64>,
    ) -> Option<ByPeriods> {
        let (mut scatter, mut powers) = (PeriodScatter::new(theta.len()), Powers::default());
        let n = self.dof();
        let directions: Vec<Direction> = (0..2 * n).map(Direction::Initial).collect();
        let inverse_mass = system.linear().mass().clone().lu().solve(&DMatrix::identity(n, n))?;
        for (at, record) in self.records.iter().enumerate() {
            if record.deviations.is_empty() {
                return None;
            }
            let start = self.initial(theta, at)?;
            let transitions =
                Tangent::new(system, &directions).transitions(&record.force, &start)?;
            let dt = record.response.sampling().dt();
            let carried = Propagation::new(&transitions, &inverse_mass, dt, self.measured);
            scatter.count(record.deviations.len());
            self.scatter_of(at, &carried, theta.len(), inverse, &mut scatter)?;
            self.compare(at, &carried, &mut powers)?;
        }
        // The regressors are simulated and contain no noise of the response.
        let bias = DVector::zeros(theta.len());
        Some(ByPeriods { scatter, misfit: powers.misfit()?, bias })
    }

    /// Adds the lines of a record to the scatter of the parameters.
    fn scatter_of(
        &self,
        at: usize,
        carried: &Propagation<'_>,
        parameters: usize,
        inverse: &DMatrix<f64>,
        scatter: &mut PeriodScatter,
    ) -> Option<()> {
        let (record, course) = (&self.records[at], &self.courses[at]);
        let (n, first) = (self.dof(), self.measured.derivative_order() * self.dof());
        let spectra = |samples: DMatrix<f64>| lines_of(record, samples);
        let weights = course.derivatives.iter().map(|derivative| {
            let mut response_weights = derivative.columns(first, n).into_owned();
            for (mut column, level) in response_weights.column_iter_mut().zip(&self.levels) {
                column /= level * level;
            }
            let force_weights = -carried.adjoint(&response_weights);
            let mut channels = DMatrix::zeros(response_weights.nrows(), 2 * n);
            channels.columns_mut(0, n).copy_from(&response_weights);
            channels.columns_mut(n, n).copy_from(&force_weights);
            spectra(channels)
        });
        let weights: Vec<_> = weights.collect::<Option<_>>()?;
        let deviations: Vec<_> =
            record.deviations.iter().map(|d| spectra(d.clone())).collect::<Option<_>>()?;
        let len = record.response.len();
        for line in 0..deviations[0].nrows() {
            let mut sensitivities = DMatrix::zeros(2 * n, parameters);
            for (direction, weights) in weights.iter().enumerate() {
                let parameter_index = self.parameter_index(at, direction);
                sensitivities.column_mut(parameter_index).copy_from(&weights.row(line).transpose());
            }
            let deviation = |channel, period: usize| deviations[period][(line, channel)];
            let (weight, is_real) = product_weight(line, len);
            let deviations = DMatrix::from_fn(2 * n, deviations.len(), deviation);
            let line = Line { deviations: &deviations, weight, is_real };
            scatter.push(inverse, &sensitivities, &line);
        }
        Some(())
    }

    /// Compares the residual of a record with the noise from its periods.
    fn compare(&self, at: usize, carried: &Propagation<'_>, powers: &mut Powers) -> Option<()> {
        let (record, n) = (&self.records[at], self.dof());
        let noise = record.deviations.iter().map(|deviations| {
            let force_response = carried.response(&deviations.columns(n, n).into_owned());
            lines_of(record, deviations.columns(0, n) - force_response)
        });
        let noise: Vec<_> = noise.collect::<Option<_>>()?;
        let residuals: Vec<DVector<f64>> = (0..n).map(|dof| self.gap(at, record, dof)).collect();
        let residual = lines_of(record, DMatrix::from_columns(&residuals))?;
        let response = lines_of(record, record.response.data().clone())?;
        let (len, periods) = (record.response.len(), noise.len());
        for line in 0..residual.nrows() {
            let (weight, is_real) = product_weight(line, len);
            // Noise on a force reaches all channels, so their powers are added and count as one
            // observation.
            let power = |lines: &DMatrix<Complex<f64>>| {
                let of = |(dof, level): (usize, &f64)| (lines[(line, dof)] / *level).norm_sqr();
                weight * self.levels.iter().enumerate().map(of).sum::<f64>()
            };
            let scatter = noise.iter().map(power).sum::<f64>() / (periods * (periods - 1)) as f64;
            powers.push([power(&residual), scatter, power(&response)], periods, is_real);
        }
        Some(())
    }

    /// Returns the most likely noise of the records, relative to the simulated motion at these
    /// parameters; `None` if the noise is known from the periods, or if the search fails.
    pub(super) fn noise(&self, theta: &DVector<f64>) -> Option<Vec<(NoisePath, Filter)>> {
        if self.records.iter().all(|record| !record.deviations.is_empty()) {
            return None;
        }
        let (system, n) = (self.system(theta)?, self.dof());
        let inverse_mass = system.linear().mass().clone().lu().solve(&DMatrix::identity(n, n))?;
        let directions: Vec<Direction> = (0..2 * n).map(Direction::Initial).collect();
        let whitened = |(at, record): (usize, &Prepared)| {
            let start = self.initial(theta, at)?;
            let transitions =
                Tangent::new(&system, &directions).transitions(&record.force, &start)?;
            let dt = record.response.sampling().dt();
            let motion = Propagation::new(&transitions, &inverse_mass, dt, self.measured);
            let path = NoisePath::new(&motion);
            let varies = |force: &[f64]| force.iter().any(|value| *value != force[0]);
            let driven: Vec<bool> = (0..n).map(|dof| varies(record.plain.channel(dof))).collect();
            let variances = most_likely(&path, &self.residuals(at, record), &driven)?;
            let filter = path.filter(&variances)?;
            Some((path, filter))
        };
        self.records.par_iter().enumerate().map(whitened).collect()
    }

    /// Returns whether every channel of every weighted residual is consistent with white noise.
    pub(super) fn is_white(&self) -> bool {
        let level = SIGNIFICANT / (self.records.len() * self.dof()) as f64;
        self.records.iter().enumerate().all(|(at, record)| {
            let residual = self.weighted(at, self.residuals(at, record));
            let lags = WHITE_LAGS.min(residual.nrows() / 4);
            residual.column_iter().all(|column| {
                whiteness(column.as_slice(), lags).is_ok_and(|test| test.p_value >= level)
            })
        })
    }

    fn by_residual(
        &self,
        theta: &DVector<f64>,
        inverse: &DMatrix<f64>,
    ) -> (DMatrix<f64>, StandardErrors, usize) {
        let residuals: Vec<DMatrix<f64>> = (self.records.iter().enumerate())
            .map(|(at, record)| self.weighted(at, self.residuals(at, record)))
            .collect();
        let square: f64 = residuals.iter().map(DMatrix::norm_squared).sum();
        let freedom = self.len().saturating_sub(theta.len());
        let variance = if freedom > 0 { square / freedom as f64 } else { f64::INFINITY };
        if self.noise.is_some() {
            return (inverse * variance, StandardErrors::Noise, freedom);
        }
        let rate = slowest_decay(self.unknowns, &theta.as_slice()[..self.free.len()]);
        let blocks = |record: &Prepared| block_count(record.response.sampling().duration(), rate);
        if self.records.iter().map(blocks).sum::<usize>() >= FEWEST {
            let mut jacobian = DMatrix::zeros(self.len(), theta.len());
            self.jacobian(&mut jacobian);
            let mut scores = BlockScores::new(theta.len());
            let mut first = 0;
            for (at, (record, residual)) in self.records.iter().zip(&residuals).enumerate() {
                let part = |dof: usize| {
                    let rows = (first + dof * residual.nrows(), residual.nrows());
                    let regressors = (0..self.courses[at].derivatives.len()).map(|direction| {
                        let index = self.parameter_index(at, direction);
                        let column = jacobian.view((rows.0, index), (rows.1, 1));
                        (index, column.iter().map(|value| -value).collect())
                    });
                    let regressors = regressors.collect();
                    InTime { regressors, residual: residual.column(dof).as_slice().to_vec() }
                };
                scores.push(blocks(record), &(0..self.dof()).map(part).collect::<Vec<_>>());
                first += residual.len();
            }
            let count = scores.count();
            if let Some((covariance, freedom)) = scores.covariance(inverse, self.shared.len()) {
                return (covariance, StandardErrors::Blocks(count), freedom);
            }
        }
        (inverse * variance, StandardErrors::White, freedom)
    }
}

/// Returns the spectrum of samples on the time axis of a record, lines × channels; `None` if a
/// sample is not finite.
fn lines_of(record: &Prepared, samples: DMatrix<f64>) -> Option<DMatrix<Complex<f64>>> {
    let record = Record::new(record.response.sampling(), samples).ok()?;
    Some(Spectrum::from_record(&record).lines().clone())
}

/// Returns the weight of a line, and whether the line is real. With these weights a sum of products
/// over lines equals the sum over `samples` samples.
fn product_weight(line: usize, samples: usize) -> (f64, bool) {
    let is_real = line == 0 || 2 * line == samples;
    (samples as f64 * if is_real { 1.0 } else { 0.5 }, is_real)
}
