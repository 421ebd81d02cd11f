//! Nonlinear constants of the model, estimated by variable projection.

use mechid_estimate::EstimateError;
use mechid_model::Terms;
use mechid_numerics::gauss_newton::{Residuals, minimise_residuals};
use nalgebra::{Complex, DMatrix, DVector};

use super::ChannelPhase;
use super::equations::Equations;
use super::experiments::Columns;
use super::limits::SEARCH_STEPS;
use crate::limits::{SHAPE_RADIAN, SHAPE_STEP};

/// Nonlinear constants to estimate in addition to the linear parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct ShapeConstants {
    /// Constants inside the laws of terms, such as b of a saturating damper; the search starts from
    /// the given values.
    pub laws: bool,
    /// Delay of the force.
    pub delay: bool,
    /// Phase that is common to both channels: p₃ and p₅ of [`ChannelPhase`].
    pub phase: bool,
}

/// Terms and channels with their constants, and the choice of the free constants.
#[derive(Clone)]
pub(super) struct Shape {
    terms: Terms,
    channels: ChannelPhase,
    free: ShapeConstants,
}

impl Shape {
    pub(super) fn new(terms: &Terms, free: ShapeConstants) -> Self {
        Self { terms: terms.clone(), channels: ChannelPhase::default(), free }
    }

    pub(super) fn terms(&self) -> &Terms {
        &self.terms
    }

    pub(super) fn channels(&self) -> ChannelPhase {
        self.channels
    }

    pub(super) fn count(&self) -> usize {
        self.values().count()
    }

    /// Returns the values of the free constants: those of the laws, followed by delay, p₃ and p₅.
    pub(super) fn values(&self) -> impl Iterator<Item = f64> + '_ {
        let laws = self.terms.iter().filter(|_| self.free.laws);
        let laws = laws.flat_map(|term| term.law().constants()).map(|constant| constant.value);
        let ChannelPhase { delay, cubic, quintic } = self.channels;
        let delay = self.free.delay.then_some(delay);
        let phase = if self.free.phase { vec![cubic, quintic] } else { Vec::new() };
        laws.chain(delay).chain(phase)
    }

    /// Returns names and units of the free constants.
    pub(super) fn names(&self) -> impl Iterator<Item = (String, String)> + '_ {
        let laws = self.terms.iter().filter(|_| self.free.laws).flat_map(|term| {
            let name = move |constant: mechid_model::Constant| {
                (format!("{}.{}", term.name(), constant.name), constant.unit.to_owned())
            };
            term.law().constants().into_iter().map(name)
        });
        let named = |name: &str, unit: &str| (name.to_owned(), unit.to_owned());
        let delay = self.free.delay.then(|| named("delay", "s"));
        let phase = self.free.phase.then(|| [named("p3", "rad"), named("p5", "rad")]);
        laws.chain(delay).chain(phase.into_iter().flatten())
    }

    /// Returns the shape with other values of the free constants; `None` if a law refuses a value.
    fn with(&self, values: &[f64]) -> Option<Self> {
        let mut remaining = values;
        let mut next = || {
            let (first, tail) = remaining.split_first()?;
            remaining = tail;
            Some(*first)
        };
        let mut terms = Vec::new();
        for term in &self.terms {
            let count = if self.free.laws { term.law().constants().len() } else { 0 };
            let constants: Vec<f64> = (0..count).map(|_| next()).collect::<Option<_>>()?;
            terms.push(if constants.is_empty() {
                term.clone()
            } else {
                term.with_constants(&constants)?
            });
        }
        let mut channels = self.channels;
        if self.free.delay {
            channels.delay = next()?;
        }
        if self.free.phase {
            (channels.cubic, channels.quintic) = (next()?, next()?);
        }
        Some(Self { terms: Terms::new(terms).ok()?, channels, free: self.free })
    }

    /// Returns the steps of the derivatives. Each step is in proportion to a scale: the value of a
    /// constant, the sampling interval for a delay, and one radian for a phase.
    fn steps(&self, dt: f64) -> Vec<f64> {
        let values: Vec<f64> = self.values().collect();
        let channels = usize::from(self.free.delay) + 2 * usize::from(self.free.phase);
        let laws = values.len() - channels;
        let step = |(at, value): (usize, &f64)| match at {
            at if at < laws => SHAPE_STEP * value.abs(),
            at if at == laws && self.free.delay => SHAPE_STEP * dt,
            _ => SHAPE_STEP * SHAPE_RADIAN,
        };
        values.iter().enumerate().map(step).collect()
    }

    /// Returns the derivatives of the force of the model with respect to each free constant: for
    /// each experiment and constant one matrix of rows × degrees of freedom. The derivatives of the
    /// residual have the opposite sign.
    pub(super) fn slopes(
        &self,
        equations: &Equations<'_>,
        coefficients: &[f64],
        residuals: &[DMatrix<Complex<f64>>],
    ) -> Result<Vec<Vec<DMatrix<Complex<f64>>>>, EstimateError> {
        let values: Vec<f64> = self.values().collect();
        let mut slopes = vec![Vec::new(); residuals.len()];
        for (at, step) in self.steps(equations.data.period().dt()).into_iter().enumerate() {
            let mut moved = values.clone();
            moved[at] += step;
            let shape =
                self.with(&moved).ok_or(EstimateError::NotConverged { searches: 1, steps: 0 })?;
            let columns = equations.columns(&shape.terms, &shape.channels);
            let changed = equations.residuals(&columns, coefficients);
            for ((slopes, before), after) in slopes.iter_mut().zip(residuals).zip(&changed) {
                slopes.push((before - after) / Complex::from(step));
            }
        }
        Ok(slopes)
    }
}

/// Returns the shape with the smallest residual under given weights, with optimal linear
/// parameters.
///
/// # Errors
/// [`EstimateError::Undetermined`] if the search fails because the data do not determine a
/// constant, [`EstimateError::NotConverged`] if it fails for another reason.
pub(super) fn fit_shape(
    equations: &Equations<'_>,
    shape: Shape,
    weights: &DMatrix<f64>,
) -> Result<Shape, EstimateError> {
    let start = DVector::from_iterator(shape.count(), shape.values());
    let mut projected = Projected { equations, shape: &shape, weights, at: None };
    let minimum = minimise_residuals(&mut projected, start, SEARCH_STEPS)
        .ok_or(EstimateError::NotConverged { searches: 1, steps: 0 })?;
    let steps = minimum.steps;
    if let Some(fitted) = shape.with(minimum.parameters.as_slice()).filter(|_| minimum.converged) {
        return Ok(fitted);
    }
    let undetermined = undetermined(&mut projected, &shape);
    if undetermined.is_empty() {
        return Err(EstimateError::NotConverged { searches: 1, steps });
    }
    let parameters = undetermined.join(", ");
    let directions =
        format!("no value of {parameters} fits significantly better than other values");
    Err(EstimateError::Undetermined { parameters, directions })
}

/// Returns the names of the constants that the data do not determine, for example the phase of the
/// channels in a model without terms. The standard error of such a constant at the initial values
/// exceeds its scale.
fn undetermined(projected: &mut Projected<'_>, start: &Shape) -> Vec<String> {
    let (rows, theta) = (projected.len(), DVector::from_iterator(start.count(), start.values()));
    let (mut residual, mut jacobian) = (DVector::zeros(rows), DMatrix::zeros(rows, theta.len()));
    if !projected.residual(&theta, &mut residual) {
        return Vec::new();
    }
    projected.jacobian(&mut jacobian);
    let deviation = residual.norm() / (rows as f64).sqrt();
    let scales = start.steps(projected.equations.data.period().dt());
    let of = |((name, column), step): ((String, f64), f64)| {
        // This is a lower bound of the standard error, because all other constants count as known.
        (deviation > column * step / SHAPE_STEP).then_some(name)
    };
    let lengths = jacobian.column_iter().map(|column| column.norm());
    let names = start.names().map(|(name, _)| name);
    names.zip(lengths).zip(scales).filter_map(of).collect()
}

/// Weighted residual with optimal linear parameters, as a function of the shape constants.
struct Projected<'a> {
    equations: &'a Equations<'a>,
    shape: &'a Shape,
    weights: &'a DMatrix<f64>,
    at: Option<Point>,
}

/// Point at which the residual was last evaluated.
struct Point {
    shape: Shape,
    columns: Vec<Columns>,
    coefficients: Vec<f64>,
    residuals: Vec<DMatrix<Complex<f64>>>,
}

impl Projected<'_> {
    /// Writes weighted real and imaginary parts alternately.
    fn write(&self, parts: &[DMatrix<Complex<f64>>], to: &mut [f64]) {
        let values = parts.iter().flat_map(|part| part.iter().zip(self.weights.iter()));
        for ((value, weight), pair) in values.zip(to.chunks_exact_mut(2)) {
            (pair[0], pair[1]) = (value.re * weight, value.im * weight);
        }
    }
}

impl Residuals for Projected<'_> {
    fn len(&self) -> usize {
        2 * self.equations.data.count() * self.weights.len()
    }

    fn residual(&mut self, theta: &DVector<f64>, residual: &mut DVector<f64>) -> bool {
        let Some(shape) = self.shape.with(theta.as_slice()) else { return false };
        let columns = self.equations.columns(&shape.terms, &shape.channels);
        let Ok(solution) = self.equations.solve(&columns, self.weights, &[]) else { return false };
        let coefficients: Vec<f64> = solution.coefficients.column(0).iter().copied().collect();
        if coefficients.iter().any(|c| !c.is_finite()) {
            return false;
        }
        let residuals = self.equations.residuals(&columns, &coefficients);
        self.write(&residuals, residual.as_mut_slice());
        self.at = Some(Point { shape, columns, coefficients, residuals });
        true
    }

    /// Returns Kaufman's Jacobian: the derivatives at fixed linear parameters, projected onto the
    /// complement of the linear regressors.
    fn jacobian(&self, jacobian: &mut DMatrix<f64>) {
        jacobian.fill(f64::NAN);
        let Some(Point { shape, columns, coefficients, residuals }) = &self.at else { return };
        let Ok(slopes) = shape.slopes(self.equations, coefficients, residuals) else { return };
        let Ok(solution) = self.equations.solve(columns, self.weights, &slopes) else { return };
        let target = self.equations.residuals(columns, &vec![0.0; coefficients.len()]);
        for (at, mut column) in jacobian.column_iter_mut().enumerate() {
            let share: Vec<f64> = solution.coefficients.column(1 + at).iter().copied().collect();
            let model = self.equations.residuals(columns, &share);
            // The target minus the residual is the force of the model for these coefficients.
            let changes: Vec<_> = slopes
                .iter()
                .zip(target.iter().zip(&model))
                .map(|(slopes, (all, rest))| (all - rest) - &slopes[at])
                .collect();
            self.write(&changes, column.as_mut_slice());
        }
    }
}
