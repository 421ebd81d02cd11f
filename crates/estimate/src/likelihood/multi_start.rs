//! Searches from several initial estimates, and their minima.

use mechid_numerics::time_limit;
use mechid_signal::{Sampling, noise};
use statrs::distribution::{ContinuousCDF, Normal};

use super::LikelihoodError;
use super::limits::{MAX_EXCESS_COST, SAME_MINIMUM, SAME_PARAMETER, STEPS};
use super::search::{Bounds, Effort, LeastSquaresProblem, Minimum, minimise};

/// A minimum, and the number of searches that ended at it.
#[derive(Debug, Clone)]
pub(super) struct SearchEnd {
    pub(super) minimum: Minimum,
    pub(super) searches: usize,
    /// Points after the first steps of the searches that ended at this minimum; a search whose
    /// first steps did not converge has no point.
    near: Vec<Minimum>,
}

/// Minima of all searches, the lowest first.
#[derive(Debug, Clone)]
pub(super) struct Minima {
    pub(super) ends: Vec<SearchEnd>,
    /// Number of searches, including those that did not converge or were not continued.
    pub(super) searches: usize,
}

/// Returns the initial estimates of all searches: the given one, followed by random ones. In a
/// random estimate each value is multiplied by a log-normal factor and stays within its bounds. A
/// value with a negative lower and a positive upper bound is drawn uniformly between them.
pub(super) fn starts(
    given: &[f64],
    bounds: &Bounds,
    count: usize,
    spread: f64,
    seed: u64,
) -> Vec<Vec<f64>> {
    let mut starts = vec![given.to_vec()];
    let drawn = Sampling::new(1.0, count.max(2)).ok();
    let drawn = drawn.and_then(|rows| noise::white(rows, given.len().max(1), 1.0, seed).ok());
    for row in 1..count {
        let Some(drawn) = &drawn else { break };
        let factor = |at: usize| (spread.ln() * drawn.data()[(row, at)]).exp();
        let value = |at: usize| {
            let (min, max) = (bounds.min[at], bounds.max[at]);
            let has_either_sign = min < 0.0 && max > 0.0 && (max - min).is_finite();
            if has_either_sign {
                min + (max - min) * Normal::standard().cdf(drawn.data()[(row, at)])
            } else {
                (given[at] * factor(at)).clamp(min, max)
            }
        };
        starts.push((0..given.len()).map(value).collect());
    }
    starts
}

/// Searches from one initial estimate after another: first with weights relative to the response,
/// then with the weights of the noise. After the first steps, a search is compared with the earlier
/// searches after their first steps. The search ends if its sum of squares is far above that of the
/// search with the lowest minimum, or if its parameters are those of an earlier search. No further
/// search begins when enough searches have ended at the lowest minimum; `agreeing` returns the
/// required number of searches for a sum of squares. After the end of a time limit, the result is
/// the lowest sum of squares so far, which may not be a minimum.
///
/// # Errors
/// [`LikelihoodError::NotConverged`] if no search converges.
pub(super) fn search(
    rough: &impl LeastSquaresProblem,
    problem: &impl LeastSquaresProblem,
    bounds: &Bounds,
    starts: &[Vec<f64>],
    agreeing: impl Fn(f64) -> usize,
) -> Result<Minima, LikelihoodError> {
    let mut minima = Minima { ends: Vec::new(), searches: 0 };
    let is_result = |minimum: &Minimum| minimum.converged || time_limit::is_over();
    for start in starts {
        minima.searches += 1;
        let near = minimise(rough, bounds, start, Effort::ROUGH);
        let from = near.as_ref().map_or_else(|| start.clone(), |near| near.parameters.clone());
        let near = near.filter(|near| near.converged);
        let is_done =
            near.as_ref().is_some_and(|near| minima.is_hopeless(near) || minima.count_again(near));
        if !is_done {
            let minimum = minimise(problem, bounds, &from, Effort::ROUGH);
            if let Some(minimum) = minimum.filter(is_result) {
                log::debug!("search {} ended at {:.6e}", minima.searches, minimum.cost);
                minima.push(minimum, near);
            }
        }
        let agreed = |best: &SearchEnd| best.searches >= agreeing(best.minimum.cost);
        if minima.ends.first().is_some_and(agreed) || time_limit::is_over() {
            break;
        }
    }
    let Some(best) = minima.ends.first_mut() else {
        return Err(LikelihoodError::NotConverged { searches: minima.searches, steps: STEPS });
    };
    let refined = minimise(problem, bounds, &best.minimum.parameters, Effort::FINAL);
    match refined.filter(|minimum| minimum.converged) {
        Some(refined) => {
            let steps = best.minimum.steps + refined.steps;
            best.minimum = Minimum { steps, ..refined };
        }
        None => {
            log::debug!("the lowest minimum is accurate only to {:.0e}", Effort::ROUGH.tolerance)
        }
    }
    Ok(minima)
}

impl Minima {
    /// Counts a search whose first steps end at the same point as the first steps of an earlier
    /// search, because both would end at the same minimum. Returns `false` if there is no such
    /// search.
    fn count_again(&mut self, near: &Minimum) -> bool {
        let is_known =
            |end: &&mut SearchEnd| end.near.iter().any(|before| is_same_point(before, near));
        let known = self.ends.iter_mut().find(is_known);
        known.map(|end| end.searches += 1).is_some()
    }

    /// Returns whether, after the first steps, the sum of squares of a search is far above that of
    /// the search with the lowest minimum. Such a search is very unlikely to end lower. The limit
    /// [`MAX_EXCESS_COST`] is multiplied by the mean square of the residual of the search with the
    /// lowest minimum, in units of the noise, if this mean square is above 1.
    fn is_hopeless(&self, near: &Minimum) -> bool {
        let best = self.ends.first().and_then(|end| end.near.first());
        best.is_some_and(|best| {
            let misfit = (best.cost / best.numbers as f64).max(1.0);
            near.cost > best.cost + MAX_EXCESS_COST * misfit
        })
    }

    fn push(&mut self, minimum: Minimum, near: Option<Minimum>) {
        let is_same = |end: &&mut SearchEnd| is_same_minimum(minimum.cost, end.minimum.cost);
        if let Some(end) = self.ends.iter_mut().find(is_same) {
            end.searches += 1;
            end.near.extend(near);
            if minimum.cost < end.minimum.cost {
                end.minimum = minimum;
            }
            return;
        }
        let rank = self.ends.partition_point(|end| end.minimum.cost < minimum.cost);
        self.ends
            .insert(rank, SearchEnd { minimum, searches: 1, near: near.into_iter().collect() });
    }

    /// Returns the lowest minimum.
    pub(super) fn best(&self) -> &SearchEnd {
        &self.ends[0]
    }
}

/// Returns whether two sums of squares are those of the same minimum.
fn is_same_minimum(a: f64, b: f64) -> bool {
    (a - b).abs() <= SAME_MINIMUM * a.max(b) + f64::MIN_POSITIVE
}

/// Returns whether two searches ended at the same parameters.
fn is_same_point(a: &Minimum, b: &Minimum) -> bool {
    let is_near = |(a, b): (&f64, &f64)| (a - b).abs() <= SAME_PARAMETER * a.abs().max(b.abs());
    is_same_minimum(a.cost, b.cost) && a.parameters.iter().zip(&b.parameters).all(is_near)
}
