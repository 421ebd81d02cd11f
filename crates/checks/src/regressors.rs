//! Noise on the response that biases least squares although the residual is white.

use mechid_estimate::{Estimate, EstimateError};
use mechid_model::{Matrix, Parameter, Response};
use mechid_numerics::least_squares::{LeastSquares, Solution};
use mechid_numerics::{NumericsError, check_size};
use mechid_signal::Record;
use mechid_signal::correlation::whiteness;
use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::MAX_SAMPLES;
use super::bias::{Bias, Reference};
use super::finding::Finding;
use super::limits::SAMPLES_PER_UNKNOWN;
use super::limits::{LAGS, ROUNDING, SIGNIFICANCE};
use super::p_value::PValue;

/// Tests whether the response at the previous and at the next sample explains the residual of the
/// equation of motion, fitted sample by sample to displacement, velocity, acceleration and force
/// (N) ([`Finding::Bias`]): white noise on the response has this effect, noise on the force does
/// not. `None` if the neighbours do not explain the residual, if no parameter changes by more than
/// its standard error with the neighbours as instruments, if the residual is not white (another
/// check reports this), or if there is no noise. Only the first 32,768 samples of a long record are
/// used.
///
/// The finding names the parameter with the largest change, in standard errors of `estimate`.
///
/// # Errors
/// [`EstimateError::Signal`] or [`NumericsError::Size`](mechid_numerics::NumericsError::Size) if
/// the records do not match, and the errors of [`LeastSquares::push_rows`].
///
/// # Source
/// Hausman (1978), Econometrica 46, 1251–1271, as a regression: Davidson & MacKinnon, *Estimation
/// and Inference in Econometrics* (1993), section 7.9; Söderström & Stoica, *System Identification*
/// (1989), chapter 8 (instruments).
pub fn noise_on_response(
    response: &Response,
    force: &Record,
    estimate: &Estimate,
) -> Result<Option<Finding>, EstimateError> {
    response.displacement().check_same_sampling(force)?;
    check_size("channels of the force", response.dof(), force.channels())?;
    let equations = estimate.unknowns().dof();
    let mut least: Option<Change> = None;
    for dof in 0..equations {
        let free = estimate.unknowns().free();
        let parameters: Vec<Parameter> = free.into_iter().filter(|p| p.row() == dof).collect();
        let enough = LAGS.max(SAMPLES_PER_UNKNOWN * parameters.len()) + 2 < force.len();
        if parameters.is_empty() || !enough {
            continue;
        }
        let equation = Equation::new(response, force, estimate, dof, &parameters);
        let change = equation.change(estimate, &parameters)?;
        least = match (least, change) {
            (Some(a), Some(b)) => Some(if b.p_value < a.p_value { b } else { a }),
            (a, b) => a.or(b),
        };
    }
    // Bonferroni's bound: the smallest p-value times the number of equations.
    let p_value = |change: &Change| (change.p_value * equations as f64).min(1.0);
    let significant = least.filter(|change| p_value(change) < SIGNIFICANCE);
    // In a long record a bias of less than one standard error may be significant, too, but it
    // hardly affects the interval.
    let relevant = significant.filter(|change| change.standard_errors() > 1.0);
    Ok(relevant.map(|change| {
        Finding::Bias(Bias {
            p_value: PValue::new(p_value(&change)),
            parameter: change.parameter,
            estimate: change.estimate,
            unbiased: change.instrumental,
            standard_error: change.standard_error,
            reference: Reference::NeighbouringSamples,
        })
    }))
}

/// One equation of motion at all samples except the first and the last.
struct Equation {
    regressors: DMatrix<f64>,
    /// Mean of the regressors at the previous sample and at the next sample.
    neighbours: DMatrix<f64>,
    target: DMatrix<f64>,
}

/// Change of a parameter from least squares to instrumental variables with the neighbouring samples
/// as instruments.
struct Change {
    p_value: f64,
    parameter: Parameter,
    estimate: f64,
    instrumental: f64,
    standard_error: f64,
}

impl Equation {
    fn new(
        response: &Response,
        force: &Record,
        estimate: &Estimate,
        dof: usize,
        parameters: &[Parameter],
    ) -> Self {
        let quantities = [response.acceleration(), response.velocity(), response.displacement()];
        let quantities = quantities.map(Record::data);
        let rows = force.len().min(MAX_SAMPLES) - 2;
        let at = |p: &Parameter, k: usize| quantities[p.matrix() as usize][(k, p.column())];
        let mut target = force.data().column(dof).rows(1, rows).into_owned();
        for matrix in Matrix::ALL {
            for column in 0..response.dof() {
                if let Some(value) = estimate.unknowns().fixed(matrix, dof, column) {
                    let known = quantities[matrix as usize].column(column);
                    target.axpy(-value, &known.rows(1, rows), 1.0);
                }
            }
        }
        Self {
            regressors: DMatrix::from_fn(rows, parameters.len(), |k, p| at(&parameters[p], k + 1)),
            neighbours: DMatrix::from_fn(rows, parameters.len(), |k, p| {
                0.5 * (at(&parameters[p], k) + at(&parameters[p], k + 2))
            }),
            target: DMatrix::from_column_slice(rows, 1, target.as_slice()),
        }
    }

    fn change(
        &self,
        estimate: &Estimate,
        parameters: &[Parameter],
    ) -> Result<Option<Change>, EstimateError> {
        let count = parameters.len();
        let alone = fit(&self.regressors, &self.target)?;
        if alone.residual_nrmse[0] <= ROUNDING || !alone.undetermined.is_empty() {
            return Ok(None);
        }
        let residual = &self.target - &self.regressors * &alone.coefficients;
        if whiteness(residual.as_slice(), LAGS)?.p_value < SIGNIFICANCE {
            return Ok(None);
        }
        let mut side_by_side = self.regressors.clone().resize_horizontally(2 * count, 0.0);
        side_by_side.columns_mut(count, count).copy_from(&self.neighbours);
        let both = fit(&side_by_side, &self.target)?;
        let added = alone.degrees_of_freedom - both.degrees_of_freedom;
        if added < count {
            return Ok(None);
        }
        let [variance, reduced] =
            [&alone, &both].map(|solution| solution.residual_covariance[(0, 0)]);
        let (freedom, total_freedom) =
            (both.degrees_of_freedom as f64, alone.degrees_of_freedom as f64);
        let explained = (variance * total_freedom - reduced * freedom).max(0.0) / added as f64;
        let distribution = FisherSnedecor::new(added as f64, freedom).expect("positive numbers");
        let p_value = distribution.sf(explained / reduced);
        // The right-hand side is y = Φa + Zb, with the regressors Φ and the neighbours Z, and Φ =
        // ZΠ + noise. With the instruments Z the parameters are a + Π⁻¹b.
        let projection = fit(&self.neighbours, &self.regressors)?;
        let b = both.coefficients.rows(count, count).column(0).into_owned();
        let Some(indirect) = self.scaled_solve(projection.coefficients, b) else {
            return Ok(None);
        };
        let values = both.coefficients.rows(0, count).column(0) + indirect;
        Ok(largest_change(estimate, parameters, &values, p_value))
    }

    /// Returns Π⁻¹b, where Π is `projection`. The equations are scaled by the norms of the
    /// regressors before they are solved.
    fn scaled_solve(
        &self,
        mut projection: DMatrix<f64>,
        mut b: DVector<f64>,
    ) -> Option<DVector<f64>> {
        let sizes: Vec<f64> = self.regressors.column_iter().map(|c| c.norm()).collect();
        for (j, size) in sizes.iter().enumerate() {
            projection.row_mut(j).scale_mut(*size);
            projection.column_mut(j).unscale_mut(*size);
            b[j] *= size;
        }
        let mut solved = projection.lu().solve(&b)?;
        solved.iter_mut().zip(&sizes).for_each(|(value, size)| *value /= size);
        Some(solved)
    }
}

fn fit(regressors: &DMatrix<f64>, targets: &DMatrix<f64>) -> Result<Solution, NumericsError> {
    let mut rows = LeastSquares::new(regressors.ncols(), targets.ncols());
    rows.push_rows(regressors.as_view(), targets.as_view())?;
    rows.solve()
}

/// Returns the change that is largest relative to the standard error of its parameter.
fn largest_change(
    estimate: &Estimate,
    parameters: &[Parameter],
    values: &DVector<f64>,
    p_value: f64,
) -> Option<Change> {
    let one = |(parameter, instrumental): (&Parameter, &f64)| {
        let fitted = estimate.parameters().find(|fitted| fitted.parameter == *parameter)?;
        Some(Change {
            p_value,
            parameter: *parameter,
            estimate: fitted.value,
            instrumental: *instrumental,
            standard_error: fitted.standard_error,
        })
    };
    let changes = parameters.iter().zip(values.iter()).filter_map(one);
    changes.max_by(|a, b| a.standard_errors().total_cmp(&b.standard_errors()))
}

impl Change {
    fn standard_errors(&self) -> f64 {
        (self.instrumental - self.estimate).abs() / self.standard_error
    }
}
