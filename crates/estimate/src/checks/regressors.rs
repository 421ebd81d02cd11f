//! Whether noise on the measured motion biases least squares where its residual does not show it.

use mechid_model::{Matrix, Parameter, Response};
use mechid_signal::Record;
use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::after::{ROUNDING, SIGNIFICANT, p_told};
use super::correlation::whiteness;
use super::{Check, LOOKED_AT, Subject, Verdict, six_digits};
use crate::{Estimate, EstimateError, LeastSquares};

/// Lags up to which the residual must be white for the test to hold.
const LAGS: usize = 25;

/// Samples in a row of which one estimate takes as many as it has unknowns, and some to spare.
const SPARE: usize = 4;

/// Whether the motion one sample before and after explains what the equation of motion, fitted sample
/// by sample to displacement, velocity, acceleration and force (N), has left: white noise on the
/// motion makes it do so, noise on the force does not. Nothing if it does not, if no parameter is
/// moved by more than its standard error, if the residual is not white (then that is what to look at),
/// or if there is no noise. Of a long record the first 32768 samples are looked at.
///
/// The value is the probability that noise on the force alone would explain as much. The text names
/// the parameter that moves most, in standard errors of `estimate`, when those neighbours are taken
/// as instruments.
///
/// # Errors
/// [`EstimateError::Signal`] or [`EstimateError::Size`] if the records do not belong together, and
/// what [`LeastSquares::push_rows`] refuses.
///
/// # Source
/// Hausman (1978), Econometrica 46, 1251–1271, as a regression: Davidson & MacKinnon, *Estimation and
/// Inference in Econometrics* (1993), section 7.9; Söderström & Stoica, *System Identification*
/// (1989), chapter 8 (instruments).
pub fn noise_on_motion(
    response: &Response,
    force: &Record,
    estimate: &Estimate,
) -> Result<Option<Check>, EstimateError> {
    response.displacement().check_same_sampling(force)?;
    crate::least_squares::size("channels of the force", response.dof(), force.channels())?;
    let equations = estimate.unknowns().dof();
    let mut found: Option<Moved> = None;
    for dof in 0..equations {
        let free = estimate.unknowns().free();
        let own: Vec<Parameter> = free.into_iter().filter(|p| p.row() == dof).collect();
        let enough = LAGS.max(SPARE * own.len()) + 2 < force.len();
        if own.is_empty() || !enough {
            continue;
        }
        let equation = Equation::of(response, force, estimate, dof, &own);
        let moved = equation.moved(estimate, &own)?;
        found = match (found, moved) {
            (Some(a), Some(b)) => Some(if b.p_value < a.p_value { b } else { a }),
            (a, b) => a.or(b),
        };
    }
    // Each equation may be so by chance.
    let found = found.filter(|moved| moved.p_value * (equations as f64) < SIGNIFICANT);
    // A smaller bias than that is seen in a long record, but the interval still holds.
    let found = found.filter(|moved| moved.errors() > 1.0);
    Ok(found.map(|moved| moved.check(equations)))
}

/// One equation of motion at all samples but the first and the last.
struct Equation {
    regressors: DMatrix<f64>,
    /// The mean of what the regressors are one sample before and after.
    neighbours: DMatrix<f64>,
    target: DMatrix<f64>,
}

/// How far a parameter moves with the neighbours as instruments.
struct Moved {
    p_value: f64,
    parameter: Parameter,
    from: f64,
    to: f64,
    standard_error: f64,
}

impl Equation {
    fn of(
        response: &Response,
        force: &Record,
        estimate: &Estimate,
        dof: usize,
        own: &[Parameter],
    ) -> Self {
        let motions = [response.acceleration(), response.velocity(), response.displacement()];
        let motions = motions.map(Record::data);
        let rows = force.len().min(LOOKED_AT) - 2;
        let at = |p: &Parameter, k: usize| motions[p.matrix() as usize][(k, p.column())];
        let mut target = force.data().column(dof).rows(1, rows).into_owned();
        for matrix in Matrix::ALL {
            for column in 0..response.dof() {
                if let Some(value) = estimate.unknowns().fixed(matrix, dof, column) {
                    let motion = motions[matrix as usize].column(column);
                    target.axpy(-value, &motion.rows(1, rows), 1.0);
                }
            }
        }
        Self {
            regressors: DMatrix::from_fn(rows, own.len(), |k, p| at(&own[p], k + 1)),
            neighbours: DMatrix::from_fn(rows, own.len(), |k, p| {
                0.5 * (at(&own[p], k) + at(&own[p], k + 2))
            }),
            target: DMatrix::from_column_slice(rows, 1, target.as_slice()),
        }
    }

    fn moved(
        &self,
        estimate: &Estimate,
        own: &[Parameter],
    ) -> Result<Option<Moved>, EstimateError> {
        let count = own.len();
        let alone = fit(&self.regressors, &self.target)?;
        if alone.residual_nrmse[0] <= ROUNDING || !alone.undetermined.is_empty() {
            return Ok(None);
        }
        let left = &self.target - &self.regressors * &alone.coefficients;
        if whiteness(left.as_slice(), LAGS)?.p_value < SIGNIFICANT {
            return Ok(None);
        }
        let mut side_by_side = self.regressors.clone().resize_horizontally(2 * count, 0.0);
        side_by_side.columns_mut(count, count).copy_from(&self.neighbours);
        let both = fit(&side_by_side, &self.target)?;
        let more = alone.degrees_of_freedom - both.degrees_of_freedom;
        if more < count {
            return Ok(None);
        }
        let [before, after] = [&alone, &both].map(|solution| solution.residual_covariance[(0, 0)]);
        let (spare, all) = (both.degrees_of_freedom as f64, alone.degrees_of_freedom as f64);
        let gained = (before * all - after * spare).max(0.0) / more as f64;
        let distribution = FisherSnedecor::new(more as f64, spare).expect("positive numbers");
        let p_value = distribution.sf(gained / after);
        // y = Φa + Zb and Φ = ZΠ + noise: what Z moves by Φ has the coefficients a + Π⁻¹b.
        let first = fit(&self.neighbours, &self.regressors)?;
        let b = both.coefficients.rows(count, count).column(0).into_owned();
        let Some(through) = self.scaled_solve(first.coefficients, b) else { return Ok(None) };
        let values = both.coefficients.rows(0, count).column(0) + through;
        Ok(farthest(estimate, own, &values, p_value))
    }

    /// Π⁻¹b, with both in units of the regressors.
    fn scaled_solve(&self, mut first: DMatrix<f64>, mut b: DVector<f64>) -> Option<DVector<f64>> {
        let sizes: Vec<f64> = self.regressors.column_iter().map(|c| c.norm()).collect();
        for (j, size) in sizes.iter().enumerate() {
            first.row_mut(j).scale_mut(*size);
            first.column_mut(j).unscale_mut(*size);
            b[j] *= size;
        }
        let mut solved = first.lu().solve(&b)?;
        solved.iter_mut().zip(&sizes).for_each(|(value, size)| *value /= size);
        Some(solved)
    }
}

fn fit(
    regressors: &DMatrix<f64>,
    targets: &DMatrix<f64>,
) -> Result<crate::Solution, EstimateError> {
    let mut rows = LeastSquares::new(regressors.ncols(), targets.ncols());
    rows.push_rows(regressors.as_view(), targets.as_view())?;
    rows.solve()
}

/// The parameter that moves most in its standard errors.
fn farthest(
    estimate: &Estimate,
    own: &[Parameter],
    values: &DVector<f64>,
    p_value: f64,
) -> Option<Moved> {
    let one = |(parameter, to): (&Parameter, &f64)| {
        let now = estimate.parameters().find(|found| found.parameter == *parameter)?;
        let (from, standard_error) = (now.value, now.standard_error);
        Some(Moved { p_value, parameter: *parameter, from, to: *to, standard_error })
    };
    let all = own.iter().zip(values.iter()).filter_map(one);
    all.max_by(|a, b| a.errors().total_cmp(&b.errors()))
}

impl Moved {
    fn errors(&self) -> f64 {
        (self.to - self.from).abs() / self.standard_error
    }

    fn check(&self, equations: usize) -> Check {
        let value = (self.p_value * equations as f64).min(1.0);
        let text = format!(
            "the motion one sample before and after explains part of the residual, {}, as noise on \
             the measured motion makes it do, which least squares takes as exact: the parameters are \
             biased by it, more than their standard errors show. With those neighbours as \
             instruments {} is {} instead of {}, {:.1} standard errors away",
            p_told(value),
            self.parameter,
            six_digits(self.to),
            six_digits(self.from),
            self.errors()
        );
        Check { subject: Subject::NoiseOnMotion, verdict: Verdict::Doubtful, value, text }
    }
}
