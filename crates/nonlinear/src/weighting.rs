//! Weights of the rows of the equation error.

use nalgebra::{Complex, DMatrix};

use super::equations::Equations;
use crate::limits::{HALF_WIDTH, WEIGHTING_FLOOR, WEIGHTING_GROUPS};

/// Assumed size of the equation error as a function of frequency.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "kebab-case")
)]
pub enum Weighting {
    /// Weighting with the highest likelihood of the residual, chosen from the other weightings by
    /// Akaike's criterion.
    #[default]
    Automatic,
    /// Equation error of the same size on all lines of an equation of motion, as from white noise
    /// on the force.
    WhiteForce,
    /// Equation error to which the linear part responds with the same size on all lines. Lines near
    /// a resonance then have the largest weights.
    Response,
    /// Smooth spectrum: the spectrum of the residual, averaged over neighbouring lines and all
    /// experiments.
    SmoothSpectrum,
}

/// Weights of rows (lines × degrees of freedom) and their kind.
pub(super) struct Weights {
    pub(super) of_rows: DMatrix<f64>,
    pub(super) kind: Weighting,
}

/// Returns the half-width, in lines, of the averages of a smooth spectrum; `None` if there are too
/// few lines.
fn half_width(lines: usize) -> Option<usize> {
    let half = HALF_WIDTH.max(lines / (2 * WEIGHTING_GROUPS));
    (lines >= 2 * (2 * half + 1)).then_some(half)
}

impl Weights {
    /// Returns the weights for white noise that is equal in all equations.
    pub(super) fn equal(equations: &Equations<'_>) -> Self {
        Self { of_rows: equations.unit.clone(), kind: Weighting::WhiteForce }
    }

    /// Returns the weights from the residuals of a fit (for each experiment rows × degrees of
    /// freedom).
    pub(super) fn from_residuals(
        equations: &Equations<'_>,
        residuals: &[DMatrix<Complex<f64>>],
        coefficients: &[f64],
        wanted: Weighting,
    ) -> Self {
        let (rows, n) = equations.unit.shape();
        let power = DMatrix::from_fn(rows, n, |row, dof| {
            let unit = equations.unit[(row, dof)];
            let sum: f64 = residuals.iter().map(|e| (e[(row, dof)] * unit).norm_sqr()).sum();
            sum / residuals.len() as f64
        });
        let first = usize::from(equations.rows.first() == Some(&0));
        let lines = rows - first;
        let flat = DMatrix::from_element(rows, n, 1.0);
        let mut best = (levelled(&power, &flat, first), Weighting::WhiteForce);
        let mut least = minus_log(&power, &best.0, first, residuals.len());
        let half = half_width(lines);
        for kind in [Weighting::Response, Weighting::SmoothSpectrum] {
            if wanted != kind && wanted != Weighting::Automatic {
                continue;
            }
            let (variance, extra) = match (kind, half) {
                (Weighting::Response, _) => {
                    let Some(variance) = variance_of_response(equations, coefficients) else {
                        continue;
                    };
                    (levelled(&power, &variance, first), 0.0)
                }
                (_, Some(half)) => {
                    let groups = lines as f64 / (2 * half + 1) as f64;
                    (smooth(&power, first, half), n as f64 * (groups - 1.0))
                }
                _ => continue,
            };
            let score = minus_log(&power, &variance, first, residuals.len()) + extra;
            if wanted == kind || score < least {
                (best, least) = ((variance, kind), score);
            }
        }
        let of_rows = equations.unit.zip_map(&best.0, |unit, v| unit / v.sqrt());
        Self { of_rows, kind: best.1 }
    }
}

/// Returns the variances, multiplied by one factor for each equation so that the ratio of power to
/// variance has the mean 1.
fn levelled(power: &DMatrix<f64>, variance: &DMatrix<f64>, first: usize) -> DMatrix<f64> {
    let lines = power.nrows() - first;
    let mut scaled = variance.clone();
    for (mut column, power) in scaled.column_iter_mut().zip(power.column_iter()) {
        let ratios = power.rows(first, lines).component_div(&column.rows(first, lines));
        column *= ratios.mean().max(f64::MIN_POSITIVE);
    }
    scaled
}

/// Returns row weights: a residual force times these weights has the size of the response of the
/// linear part to this force; `None` if the coefficients define no system.
pub(super) fn as_response(equations: &Equations<'_>, coefficients: &[f64]) -> Option<DMatrix<f64>> {
    let variance = variance_of_response(equations, coefficients)?;
    Some(equations.unit.zip_map(&variance, |unit, v| unit / v.sqrt()))
}

/// Returns, for each equation, the variance of a force whose response has the same size on all
/// rows; `None` if the coefficients define no system.
fn variance_of_response(equations: &Equations<'_>, coefficients: &[f64]) -> Option<DMatrix<f64>> {
    let [m, c, k] = equations.unknowns.assemble(&coefficients[..equations.free.len()]);
    let system = mechid_model::SecondOrderSystem::new(m, c, k).ok()?;
    let mut variance = DMatrix::zeros(equations.rows.len(), system.dof());
    for row in 0..equations.rows.len() {
        let receptance = system.receptance(equations.omega(row)).ok()?;
        for dof in 0..system.dof() {
            variance[(row, dof)] = receptance.column(dof).norm_squared().recip();
        }
    }
    Some(variance)
}

/// Returns moving averages over the lines; line 0, if it is used, has the average of the first
/// lines.
fn smooth(power: &DMatrix<f64>, first: usize, half: usize) -> DMatrix<f64> {
    let rows = power.nrows();
    let mut smooth = power.clone();
    for (column, mut to) in power.column_iter().zip(smooth.column_iter_mut()) {
        let mut sums = vec![0.0; rows + 1];
        for row in first..rows {
            sums[row + 1] = sums[row] + column[row];
        }
        let largest = column.rows(first, rows - first).max();
        let floor = (WEIGHTING_FLOOR * largest).max(f64::MIN_POSITIVE);
        for row in 0..rows {
            let (low, high) =
                (row.max(first).saturating_sub(half).max(first), (row + half + 1).min(rows));
            to[row] = ((sums[high] - sums[low]) / (high - low) as f64).max(floor);
        }
    }
    smooth
}

/// Returns minus the log-likelihood of the residuals of `experiments` for these variances. The
/// caller adds one for each free variance (half of Akaike's criterion).
///
/// # Source
/// Akaike (1974), IEEE Transactions on Automatic Control 19, 716–723, for circular Gaussian lines.
fn minus_log(
    power: &DMatrix<f64>,
    variance: &DMatrix<f64>,
    first: usize,
    experiments: usize,
) -> f64 {
    let lines = power.nrows() - first;
    let (power, variance) = (power.rows(first, lines), variance.rows(first, lines));
    let pairs = power.iter().zip(variance.iter());
    experiments as f64 * pairs.map(|(p, v)| v.ln() + p / v).sum::<f64>()
}
