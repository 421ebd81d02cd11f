//! Searches from several initial estimates, and their minima.

use mechid_signal::{Sampling, noise};
use statrs::distribution::{ContinuousCDF, Normal};

use super::LikelihoodError;
use super::limits::{FIRST_STEPS, SAME_MINIMUM, STEPS};
use super::search::{Bounds, LeastSquaresProblem, Minimum, minimise};

/// A minimum with the number of searches that ended there.
#[derive(Debug, Clone)]
pub(super) struct SearchEnd {
    pub(super) minimum: Minimum,
    pub(super) searches: usize,
}

/// Minima of all searches, the lowest first.
#[derive(Debug, Clone)]
pub(super) struct Minima {
    pub(super) ends: Vec<SearchEnd>,
    /// Number of searches, including those that did not converge.
    pub(super) searches: usize,
}

/// Returns the initial estimates of all searches: the given one, then random ones, where each value
/// is multiplied by a log-normal factor within its bounds. A value with a negative lower and a
/// positive upper bound is drawn uniformly between them.
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

/// Searches from one initial estimate after another, first with weights relative to the response,
/// then with the weights of the noise. It stops when enough searches have ended at the lowest
/// minimum; `agreeing` returns this number for a sum of squares.
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
    for start in starts {
        minima.searches += 1;
        let near = minimise(rough, bounds, start, FIRST_STEPS);
        let from = near.map_or_else(|| start.clone(), |near| near.parameters);
        if let Some(minimum) = minimise(problem, bounds, &from, STEPS).filter(|m| m.converged) {
            log::debug!("search {} ended at {:.6e}", minima.searches, minimum.cost);
            minima.push(minimum);
        }
        let agreed = |best: &SearchEnd| best.searches >= agreeing(best.minimum.cost);
        if minima.ends.first().is_some_and(agreed) {
            break;
        }
    }
    if minima.ends.is_empty() {
        return Err(LikelihoodError::NotConverged { searches: minima.searches, steps: STEPS });
    }
    Ok(minima)
}

impl Minima {
    fn push(&mut self, minimum: Minimum) {
        let same = |end: &&mut SearchEnd| {
            let (a, b) = (minimum.cost, end.minimum.cost);
            (a - b).abs() <= SAME_MINIMUM * a.max(b) + f64::MIN_POSITIVE
        };
        if let Some(end) = self.ends.iter_mut().find(same) {
            end.searches += 1;
            if minimum.cost < end.minimum.cost {
                end.minimum = minimum;
            }
            return;
        }
        let rank = self.ends.partition_point(|end| end.minimum.cost < minimum.cost);
        self.ends.insert(rank, SearchEnd { minimum, searches: 1 });
    }

    /// Returns the lowest minimum.
    pub(super) fn best(&self) -> &SearchEnd {
        &self.ends[0]
    }
}
