//! Least squares on the equation of motion with nonlinear regressors.

mod uncertainty;

use mechid_estimate::EstimateParts;
use mechid_estimate::{Estimate, EstimateError, Unknowns};
use mechid_estimate::{NAMED_DIRECTIONS, NAMED_PARAMETERS};
use mechid_model::{Term, Terms};
use mechid_numerics::Uncertain;
use mechid_numerics::least_squares::{Direction, LeastSquares};
use mechid_signal::message;
use nalgebra::{Complex, DMatrix, DVector};

use super::SteadyExperiments;
use super::covariance::Uncertainty;
use super::equations::Equations;
use super::estimate::{NamedParameter, NonlinearEstimate};
use super::experiments::Columns;
use super::shape::{Shape, ShapeConstants, fit_shape};
use super::weighting::{Weighting, Weights};
use crate::limits::{WEIGHTING_ROUNDS, WEIGHTING_SETTLED};

/// Settings of [`equation_error`]: weighting of the rows, and constants to search for.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct EquationErrorOptions {
    /// Weighting of the rows.
    pub weighting: Weighting,
    /// Nonlinear constants, none by default.
    pub shape: ShapeConstants,
}

/// Estimates a nonlinear system by least squares on −ω²M X + iωC X + K X + Σ θ F{f(q, q̇)} = F over
/// the lines of steady periods.
///
/// The terms are evaluated on a grid four times finer than the samples, to avoid aliasing, and
/// transformed to regressors. Lines without force are used, too: on these lines the nonlinear
/// forces balance the forces of the linear part. The rows are weighted by the estimated spectrum of
/// the equation error ([`Weighting`]); the standard errors follow from the scatter of the periods
/// or of the scores ([`StandardErrors`](super::StandardErrors)).
///
/// Shape constants are estimated by Gauss–Newton steps on the residual with optimal linear
/// parameters (variable projection). The covariance is that of all parameters together.
///
/// Line 0 is used if a term is a constant force (`x1^0`).
///
/// Noise on the response biases the parameters, as in the linear
/// [`equation_error`](mechid_estimate::frequency_domain::equation_error). Use this estimator for
/// the mean of several periods, or as the initial estimate of
/// [`output_error`](super::output_error).
///
/// # Errors
/// [`NumericsError::Size`](mechid_numerics::NumericsError::Size) or [`EstimateError::Model`] if
/// unknowns or terms do not match the data,
/// [`NumericsError::NothingUnknown`](mechid_numerics::NumericsError::NothingUnknown),
/// [`NumericsError::TooFewRows`](mechid_numerics::NumericsError::TooFewRows),
/// [`EstimateError::OnlyRatios`] for an equation with neither force nor known entry,
/// [`EstimateError::Undetermined`] if the data do not determine a parameter, and
/// [`EstimateError::NotConverged`] if the search for the constants fails.
///
/// # Source
/// Schoukens & Ljung (2019), IEEE Control Systems 39(6), 28–99 (nonlinear regressors of periodic
/// data); Golub & Pereyra (1973), SIAM Journal on Numerical Analysis 10, 413–432, and Kaufman
/// (1975), BIT 15, 49–57 (variable projection).
pub fn equation_error(
    data: &SteadyExperiments,
    unknowns: &Unknowns,
    terms: &Terms,
    options: &EquationErrorOptions,
) -> Result<NonlinearEstimate, EstimateError> {
    let equations = Equations::new(data, unknowns, terms)?;
    let mut shape = Shape::new(terms, options.shape);
    let mut fit = weighted(&equations, &shape, options.weighting, None)?;
    if shape.count() > 0 {
        for _ in 0..WEIGHTING_ROUNDS {
            let before = fit.weights.of_rows.clone();
            shape = fit_shape(&equations, shape, &fit.weights.of_rows)?;
            fit = weighted(&equations, &shape, options.weighting, Some(fit.weights))?;
            if settled(&before, &fit.weights.of_rows, 10.0 * WEIGHTING_SETTLED) {
                break;
            }
        }
    }
    fit.finish(&equations, &shape)
}

/// Coefficients of a fit, with weights that follow from its residuals.
pub(super) struct Fit {
    pub(super) columns: Vec<Columns>,
    pub(super) coefficients: Vec<f64>,
    pub(super) weights: Weights,
    nrmse: Vec<f64>,
    condition: f64,
}

pub(super) fn weighted(
    equations: &Equations<'_>,
    shape: &Shape,
    weighting: Weighting,
    start: Option<Weights>,
) -> Result<Fit, EstimateError> {
    let columns = equations.columns(shape.terms(), &shape.channels());
    equations.check_forces(&columns)?;
    let mut weights = start.unwrap_or_else(|| Weights::equal(equations));
    for round in 1.. {
        let solution = equations.solve(&columns, &weights.of_rows, &[])?;
        check_determined(&names(equations, shape), &solution.undetermined)?;
        let coefficients: Vec<f64> = solution.coefficients.column(0).iter().copied().collect();
        let residuals = equations.residuals(&columns, &coefficients);
        let next = Weights::from_residuals(equations, &residuals, &coefficients, weighting);
        if round == WEIGHTING_ROUNDS || settled(&weights.of_rows, &next.of_rows, WEIGHTING_SETTLED)
        {
            let nrmse = nrmse(equations, &columns, &residuals);
            let condition = solution.condition;
            return Ok(Fit { columns, coefficients, weights: next, nrmse, condition });
        }
        weights = next;
    }
    unreachable!("the last round returns")
}

/// Returns whether two sets of weights are nearly equal, apart from a common factor of each
/// equation.
fn settled(before: &DMatrix<f64>, after: &DMatrix<f64>, tolerance: f64) -> bool {
    before.column_iter().zip(after.column_iter()).all(|(before, after)| {
        let scale = after.norm() / before.norm();
        let change = (after - before * scale).norm();
        change <= tolerance * after.norm() || !scale.is_finite()
    })
}

/// Returns an error that names the undetermined parameters, if there are any.
fn check_determined(names: &[String], open: &[Direction]) -> Result<(), EstimateError> {
    if open.is_empty() {
        return Ok(());
    }
    let names_of = |involved: &dyn Fn(usize) -> bool| {
        let names = names.iter().enumerate().filter(|(at, _)| involved(*at));
        message::list(names.map(|(_, name)| name), ", ", NAMED_PARAMETERS)
    };
    let direction = |d: &Direction| {
        format!("only a combination of {} is determined", names_of(&|at| d.involved[at]))
    };
    Err(EstimateError::Undetermined {
        parameters: names_of(&|at| open.iter().any(|direction| direction.involved[at])),
        directions: message::list(open.iter().map(direction), "; ", NAMED_DIRECTIONS),
    })
}

/// Returns √(Σ|e|² / Σ|b|²) of each equation of motion, with the residuals e and the forces b.
fn nrmse(
    equations: &Equations<'_>,
    columns: &[Columns],
    residuals: &[DMatrix<Complex<f64>>],
) -> Vec<f64> {
    let of = |dof: usize| {
        let (mut unexplained, mut total) = (0.0, 0.0);
        for (columns, residual) in columns.iter().zip(residuals) {
            for row in 0..equations.rows.len() {
                let unit = equations.unit[(row, dof)];
                unexplained += (residual[(row, dof)] * unit).norm_sqr();
                total += (columns.force[(row, dof)] * unit).norm_sqr();
            }
        }
        if total > 0.0 { (unexplained / total).sqrt() } else { 0.0 }
    };
    (0..equations.data.dof()).map(of).collect()
}

impl Fit {
    fn finish(
        self,
        equations: &Equations<'_>,
        shape: &Shape,
    ) -> Result<NonlinearEstimate, EstimateError> {
        let residuals = equations.residuals(&self.columns, &self.coefficients);
        let slopes = shape.slopes(equations, &self.coefficients, &residuals)?;
        let (inverse, condition) = self.inverse(equations, shape, &slopes)?;
        let Uncertainty { covariance, standard_errors, freedom, misfit, bias } =
            self.uncertainty(equations, shape, &residuals, &slopes, &inverse);
        let free = equations.free.len();
        let linear = Estimate::new(EstimateParts {
            unknowns: equations.unknowns.clone(),
            values: self.coefficients[..free].to_vec(),
            covariance: covariance.view((0, 0), (free, free)).into_owned().into(),
            degrees_of_freedom: freedom,
            residual_nrmse: self.nrmse.clone(),
            condition: condition.max(self.condition),
            undetermined: Vec::new(),
        })?;
        let unexplained = unexplained(equations, &linear, &self.columns, &residuals);
        let coefficients = self.coefficients[free..].to_vec();
        let values = self.coefficients.iter().copied().chain(shape.values());
        let parameters = named(equations, shape)
            .zip(values)
            .enumerate()
            .map(|(at, ((name, unit), value))| {
                let standard_error = covariance[(at, at)].sqrt();
                let estimate = Uncertain { value, standard_error, degrees_of_freedom: freedom };
                NamedParameter { name, unit, estimate }
            })
            .collect();
        Ok(NonlinearEstimate {
            linear,
            coefficients,
            parameters,
            covariance,
            channels: shape.channels(),
            weighting: self.weights.kind,
            standard_errors,
            misfit,
            bias,
            unexplained,
            ranges: equations.data.ranges(shape.terms(), &shape.channels()),
            terms: shape.terms().clone(),
            equations: equations.equations(),
        })
    }

    /// Returns (AᵀA)⁻¹ of the weighted regressors of all parameters, and their condition number.
    fn inverse(
        &self,
        equations: &Equations<'_>,
        shape: &Shape,
        slopes: &[Vec<DMatrix<Complex<f64>>>],
    ) -> Result<(DMatrix<f64>, f64), EstimateError> {
        let (linear, more) = (equations.count(), slopes[0].len());
        let mut rows = LeastSquares::new(linear, 1 + more);
        for (columns, slopes) in self.columns.iter().zip(slopes) {
            equations.push(&mut rows, columns, &self.weights.of_rows, slopes)?;
        }
        // The triangular factor of [A | b | D] contains that of [A | D].
        let r = rows.triangle();
        let columns: Vec<usize> = (0..linear).chain(linear + 1..linear + 1 + more).collect();
        let mut both = LeastSquares::new(columns.len(), 1);
        let none = DMatrix::zeros(r.nrows(), 1);
        both.push_rows(r.select_columns(&columns).as_view(), none.as_view())?;
        let solution = both.solve()?;
        check_determined(&names(equations, shape), &solution.undetermined)?;
        Ok((solution.unscaled_covariance, solution.condition))
    }

    /// Returns the decay rate (1/s) of the slowest mode of the linear part; 0 if there is no linear
    /// part.
    fn slowest_decay(&self, equations: &Equations<'_>) -> f64 {
        slowest_decay(equations.unknowns, &self.coefficients[..equations.free.len()])
    }
}

/// Returns the decay rate (1/s) of the slowest mode of these matrices; 0 if a mode does not decay
/// or the matrices define no system.
pub(super) fn slowest_decay(unknowns: &Unknowns, free: &[f64]) -> f64 {
    let [m, c, k] = unknowns.assemble(free);
    let modes = mechid_model::SecondOrderSystem::new(m, c, k).and_then(|system| system.modes());
    modes.map_or(0.0, |modes| {
        modes.iter().map(|mode| -mode.eigenvalue().re).fold(f64::INFINITY, f64::min).max(0.0)
    })
}

fn names(equations: &Equations<'_>, shape: &Shape) -> Vec<String> {
    named(equations, shape).map(|(name, _)| name).collect()
}

/// Returns the names and units of all parameters.
fn named<'a>(
    equations: &'a Equations<'a>,
    shape: &'a Shape,
) -> impl Iterator<Item = (String, String)> + 'a {
    let entries = equations.free.iter().map(|p| (p.to_string(), p.matrix().unit().to_owned()));
    let terms = shape.terms().iter().map(|term: &Term| (term.name().to_owned(), term.unit()));
    entries.chain(terms).chain(shape.names())
}

/// Returns, for the lines of the fit, the displacement of the linear part under the residual force,
/// relative to the measured displacement (RMS).
fn unexplained(
    equations: &Equations<'_>,
    linear: &Estimate,
    columns: &[Columns],
    residuals: &[DMatrix<Complex<f64>>],
) -> Vec<f64> {
    let n = equations.data.dof();
    let (mut unexplained, mut total) = (DVector::<f64>::zeros(n), DVector::<f64>::zeros(n));
    let system = linear.system();
    for row in (0..equations.rows.len()).filter(|row| equations.rows[*row] > 0) {
        let receptance = system.as_ref().ok().and_then(|s| s.receptance(equations.omega(row)).ok());
        let Some(receptance) = receptance else { return vec![f64::NAN; n] };
        for (columns, residual) in columns.iter().zip(residuals) {
            let made = &receptance * residual.row(row).transpose();
            unexplained += made.map(|z| z.norm_sqr());
            total += columns.displacement.row(row).transpose().map(|z| z.norm_sqr());
        }
    }
    unexplained
        .iter()
        .zip(total.iter())
        .map(|(e, x)| if *x > 0.0 { (e / x).sqrt() } else { 0.0 })
        .collect()
}
