//! Search for the maximum of the likelihood by scoring with Levenberg's damping.

use mechid_numerics::time_limit;
use nalgebra::{Complex, DMatrix, DVector};

use super::information::information;
use super::likelihood::{cost, gradient};
use super::limits::{COARSE_POOLING, LARGEST_STEP, MIN_GAIN, POOLING};
use super::lines::{BandLines, PooledLines};
use super::parameters::{Parameters, Span};
use crate::decomposition::hermitian_eigen;

/// Damping of the first step, and the factors that multiply it after a refused and after a
/// successful step.
const FIRST_DAMPING: f64 = 1e-2;
const HARDER: f64 = 8.0;
const EASIER: f64 = 0.125;

/// Maximum number of trials of one step.
const TRIALS: usize = 12;

/// Minimum number of updates of the information after which it is computed again if a step is
/// refused; after fewer updates, only the damping of the step increases.
const TRUSTED_UPDATES: usize = 4;

/// Minimum curvature along a step after an update, relative to the curvature before the update. If
/// the gradients give a lower curvature, the update uses this minimum.
///
/// # Source
/// Powell (1978), Lecture Notes in Mathematics 630, 144–157.
const LEAST_CURVATURE: f64 = 0.2;

/// Number of successive slow steps that ends a search.
const SLOW_STEPS: usize = 2;

/// Minimum logarithms of a damping ratio and of a noise variance (relative to the variance in the
/// band): smaller values do not affect the lines.
const LEAST_LOG_DAMPING: f64 = -14.0;
const LEAST_LOG_NOISE: f64 = -28.0;

/// Minimum information of a parameter, relative to the largest information. It keeps the covariance
/// finite if the lines do not determine a phase.
const LEAST_INFORMATION: f64 = 1e-10;

/// Effort of a search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Effort {
    /// Largest number of steps.
    pub iterations: usize,
    /// Gain in log-likelihood below which a step is slow; two successive slow steps end the search.
    pub slow: f64,
    /// If true, frequencies and damping ratios stay as they are.
    pub holds_poles: bool,
    /// If true, lines are pooled only where the spectrum changes little relative to the noise.
    pub even_pools: bool,
}

impl Effort {
    /// Effort to compare quantities at initial estimates. The initial poles are more accurate than
    /// the initial amplitudes. With wrong amplitudes, a search with free poles would move a damping
    /// ratio to nearly zero, the value for a sinusoid, and no later search would increase it again.
    pub const FIXED_POLES: Self =
        Self { iterations: 20, slow: 0.5, holds_poles: true, even_pools: false };
    /// Effort to approach the maximum with coarsely pooled lines.
    pub const SHORT: Self =
        Self { iterations: 6, slow: 0.5, holds_poles: false, even_pools: false };
    /// Effort to test a mode: steps with a gain below `slow` are not needed, because the gain of a
    /// mode is compared with a penalty of several tens.
    pub const TEST: Self =
        Self { iterations: 40, slow: 0.5, holds_poles: false, even_pools: false };
    /// Effort of the final search: further steps would move parameters by less than a tenth of
    /// their standard errors.
    pub const FULL: Self =
        Self { iterations: 60, slow: 0.005, holds_poles: false, even_pools: true };
}

/// Maximum of the likelihood.
#[derive(Debug, Clone)]
pub(super) struct Fit {
    pub parameters: Parameters,
    /// −log L.
    pub cost: f64,
    /// Fisher information; after [`search`] it is approximate, because the steps update it from the
    /// gradients.
    pub information: DMatrix<f64>,
}

/// Lines of a search.
#[derive(Clone, Copy)]
pub(super) struct SearchLines<'a> {
    /// Lines of the likelihood.
    pub pooled: &'a [PooledLines],
    /// The same lines, pooled at least as coarsely as in `pooled`. They give the Fisher information
    /// of the steps, which affects the path of the search, not the maximum.
    pub coarse: &'a [PooledLines],
    pub span: Span,
}

/// Searches from `start`; `None` if the likelihood is not defined at `start`.
///
/// The information costs much more than a gradient. Each step therefore updates the information
/// from the gradients before and after the step. The information is computed again if the steps
/// become slow or are refused.
pub(super) fn search(start: Parameters, lines: SearchLines<'_>, effort: Effort) -> Option<Fit> {
    let information = information(&start, lines.coarse, lines.span)?;
    search_with_information(start, information, 0, lines, effort)
}

/// Searches from `start`. The matrix `information` was computed at `start` (no `updates`) or near
/// `start`.
fn search_with_information(
    start: Parameters,
    information: DMatrix<f64>,
    updates: usize,
    lines: SearchLines<'_>,
    effort: Effort,
) -> Option<Fit> {
    let cost = cost(&start, lines.pooled, lines.span);
    if !cost.is_finite() {
        return None;
    }
    let slope = gradient(&start, lines.pooled, lines.span)?;
    let mut fit = Fit { parameters: start, cost, information };
    let first_free = if effort.holds_poles { 2 * fit.parameters.layout.modes } else { 0 };
    let mut path = Path { lines, first_free, slope, damping: FIRST_DAMPING, updates };
    let mut slow = 0;
    for _ in 0..effort.iterations {
        if time_limit::is_over() {
            break;
        }
        let gain = path.step(&mut fit)?;
        if gain >= effort.slow {
            slow = 0;
            continue;
        }
        slow += 1;
        if slow >= SLOW_STEPS || (gain < MIN_GAIN && path.updates == 0) {
            break;
        }
        path.renew(&mut fit)?;
    }
    log::debug!(
        "{} lines, {} unknowns: cost {:.4}",
        lines.pooled.len(),
        fit.parameters.layout.len(),
        fit.cost
    );
    Some(fit)
}

/// State of a search between two steps.
struct Path<'a> {
    lines: SearchLines<'a>,
    /// Index of the first parameter that may change; the poles come before all other parameters.
    first_free: usize,
    /// Gradient at the parameters of the fit.
    slope: DVector<f64>,
    damping: f64,
    /// Number of updates of the information since it was computed.
    updates: usize,
}

impl Path<'_> {
    /// Makes one step and returns its gain in log-likelihood; 0 if no step succeeds.
    fn step(&mut self, fit: &mut Fit) -> Option<f64> {
        for _ in 0..TRIALS {
            if let Some(step) = self.proposed(&fit.information) {
                let candidate = moved(&fit.parameters, &step);
                let next = cost(&candidate, self.lines.pooled, self.lines.span);
                if next < fit.cost {
                    let gain = fit.cost - next;
                    let slope = gradient(&candidate, self.lines.pooled, self.lines.span)?;
                    let distance = &candidate.values - &fit.parameters.values;
                    update(&mut fit.information, &distance, &(&slope - &self.slope));
                    (fit.parameters, fit.cost, self.slope) = (candidate, next, slope);
                    self.damping *= EASIER;
                    self.updates += 1;
                    return Some(gain);
                }
                if -0.5 * step.dot(&self.slope) < MIN_GAIN {
                    break;
                }
            }
            if self.updates >= TRUSTED_UPDATES {
                self.renew(fit)?;
            } else {
                self.damping *= HARDER;
            }
        }
        Some(0.0)
    }

    /// Returns the next step; it is zero for the parameters that may not change.
    fn proposed(&self, information: &DMatrix<f64>) -> Option<DVector<f64>> {
        let (first, free) = (self.first_free, self.slope.len() - self.first_free);
        let information = information.view((first, first), (free, free)).into_owned();
        let slope = self.slope.rows(first, free).into_owned();
        let moves = damped_step(&information, &slope, self.damping)?;
        let mut step = DVector::zeros(self.slope.len());
        step.rows_mut(first, free).copy_from(&moves);
        Some(step)
    }

    /// Computes the information again, at the parameters of the fit, if steps have updated it since
    /// the last computation.
    fn renew(&mut self, fit: &mut Fit) -> Option<()> {
        if self.updates > 0 {
            fit.information = information(&fit.parameters, self.lines.coarse, self.lines.span)?;
            self.updates = 0;
            // Steps that were refused with the approximate, updated information may succeed with
            // the newly computed information.
            self.damping = self.damping.min(FIRST_DAMPING);
        }
        Some(())
    }
}

/// Updates the information by the change of the gradient over a step; the information stays
/// positive definite.
///
/// # Source
/// Nocedal & Wright (2006), *Numerical Optimization*, 2nd ed., procedure 18.2 (damped BFGS).
fn update(information: &mut DMatrix<f64>, step: &DVector<f64>, change: &DVector<f64>) {
    let predicted = &*information * step;
    let curvature = step.dot(&predicted);
    if !(curvature > 0.0 && curvature.is_finite()) {
        return;
    }
    let along = step.dot(change);
    let share = if along >= LEAST_CURVATURE * curvature {
        1.0
    } else {
        (1.0 - LEAST_CURVATURE) * curvature / (curvature - along)
    };
    let change = change * share + &predicted * (1.0 - share);
    information.ger(1.0 / step.dot(&change), &change, &change, 1.0);
    information.ger(-1.0 / curvature, &predicted, &predicted, 1.0);
}

/// Searches from `start` with lines that are pooled around the poles of `start`, and again with
/// lines that are pooled around the resulting poles.
pub(super) fn search_pooled(start: Parameters, band: &BandLines, effort: Effort) -> Option<Fit> {
    let (terms, span) = (start.layout.noise_terms, band.span);
    let around = |parameters: &Parameters| {
        let poles = parameters.poles();
        let pooled = if effort.even_pools {
            band.pooled_evenly(parameters, POOLING)
        } else {
            band.pooled(&poles, POOLING, terms)
        };
        [pooled, band.pooled(&poles, COARSE_POOLING, terms)]
    };
    let [pooled, coarse] = around(&start);
    let first = search(start, SearchLines { pooled: &pooled, coarse: &coarse, span }, effort)?;
    let [pooled, coarse] = around(&first.parameters);
    let lines = SearchLines { pooled: &pooled, coarse: &coarse, span };
    let Fit { parameters, information: nearby, .. } = first;
    // This information was computed for nearby parameters, so it is computed again if a step is
    // refused.
    let mut fit = search_with_information(parameters, nearby, TRUSTED_UPDATES, lines, effort)?;
    fit.information = information(&fit.parameters, &pooled, span)?;
    // The cost is computed on all lines, so that fits with different pooling can be compared.
    fit.cost = cost(&fit.parameters, &band.pooled(&[], 0.0, terms), span);
    Some(fit)
}

/// Returns the step to the maximum of a quadratic likelihood; `None` if the information is not
/// positive definite.
pub(super) fn full_step(
    information: &DMatrix<f64>,
    gradient: &DVector<f64>,
) -> Option<DVector<f64>> {
    damped_step(information, gradient, LEAST_INFORMATION)
}

fn damped_step(
    information: &DMatrix<f64>,
    gradient: &DVector<f64>,
    damping: f64,
) -> Option<DVector<f64>> {
    let (scaled, scale) = scaled(information, damping);
    let step = scaled.cholesky()?.solve(&gradient.component_mul(&scale));
    let step = -step.component_mul(&scale);
    step.iter().all(|v| v.is_finite()).then_some(step)
}

/// Returns the information scaled to a unit diagonal, with `damping` added to the diagonal, and the
/// scale factors of rows and columns.
pub(super) fn scaled(information: &DMatrix<f64>, damping: f64) -> (DMatrix<f64>, DVector<f64>) {
    let largest = information.diagonal().amax().max(f64::MIN_POSITIVE);
    let floor = LEAST_INFORMATION.powi(2) * largest;
    let scale = information.diagonal().map(|d| 1.0 / d.max(floor).sqrt());
    let mut scaled = scaled_symmetrically(information, &scale);
    for i in 0..scale.len() {
        scaled[(i, i)] += damping;
    }
    (scaled, scale)
}

/// Returns a matrix with each row and each column multiplied by its scale.
fn scaled_symmetrically(matrix: &DMatrix<f64>, scale: &DVector<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(scale.len(), scale.len(), |i, j| scale[i] * matrix[(i, j)] * scale[j])
}

/// Returns the inverse of a scaled information matrix. Apart from rounding, its eigenvalues must be
/// at least [`LEAST_INFORMATION`]. `None` if the inverse is not finite.
fn inverse_of_determined(scaled: DMatrix<f64>) -> Option<DMatrix<f64>> {
    let mut root = hermitian_eigen(scaled)?;
    for (mut column, information) in root.eigenvectors.column_iter_mut().zip(&root.eigenvalues) {
        column.unscale_mut(information.max(LEAST_INFORMATION).sqrt());
    }
    Some(&root.eigenvectors * root.eigenvectors.transpose())
}

/// Returns the parameters after a step. The step is limited for parameters in which the likelihood
/// is far from quadratic.
fn moved(parameters: &Parameters, step: &DVector<f64>) -> Parameters {
    let layout = &parameters.layout;
    let mut next = parameters.clone();
    for index in 0..layout.len() {
        let shape = (layout.shape(0)..layout.shape(layout.modes)).contains(&index);
        let limit = if index < layout.modes {
            (3.0 * parameters.zeta(index)).max(0.002)
        } else if shape {
            f64::INFINITY
        } else {
            LARGEST_STEP
        };
        next.values[index] += step[index].clamp(-limit, limit);
    }
    for mode in 0..layout.modes {
        let index = layout.damping(mode);
        next.values[index] = next.values[index].clamp(LEAST_LOG_DAMPING, -0.05);
    }
    for output in 0..layout.outputs {
        let index = layout.noise(0, output);
        next.values[index] = next.values[index].max(LEAST_LOG_NOISE);
    }
    next
}

impl Fit {
    /// Returns the covariance of the parameters, the inverse of the information; `None` if the
    /// information is not finite. A combination that the lines do not determine has a large
    /// variance, for example the correlations if one force drives all modes.
    pub fn covariance(&self) -> Option<DMatrix<f64>> {
        let (scaled, scale) = scaled(&self.information, LEAST_INFORMATION);
        let inverse = match scaled.clone().cholesky() {
            Some(factor) => factor.inverse(),
            None => inverse_of_determined(scaled)?,
        };
        Some(scaled_symmetrically(&inverse, &scale))
    }

    pub fn poles(&self) -> Vec<Complex<f64>> {
        self.parameters.poles()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_undetermined_combination_does_not_change_other_variances() {
        // The likelihood depends only on the sum of the second and the third parameter; rounding
        // makes an eigenvalue of the information negative.
        let information = nalgebra::dmatrix![
            1.0, 0.3, 0.3;
            0.3, 1.0, 1.0 + 1e-9;
            0.3, 1.0 + 1e-9, 1.0
        ];
        assert!(information.clone().cholesky().is_none());
        let inverse = inverse_of_determined(information).unwrap();
        let exact = 1.0 / (1.0 - 0.09);
        assert!((inverse[(0, 0)] - exact).abs() < 1e-6, "{inverse}");
        assert!(inverse[(1, 1)] > 1e8 && inverse[(2, 2)] > 1e8, "{inverse}");
        assert!(inverse_of_determined(DMatrix::from_element(2, 2, f64::NAN)).is_none());
    }
}
