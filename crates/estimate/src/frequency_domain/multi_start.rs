//! Global minimum from searches with several initial estimates.

use mechid_numerics::gauss_newton::{Minimum, minimise};
use mechid_numerics::time_limit;
use mechid_spectra::{FrequencyData, NoiseSpectrum, transient};
use nalgebra::DVector;

use super::initial_estimates::InitialEstimates;
use super::search::Restartable;
use crate::limits::{
    CONFIRMED_OTHERWISE, LINEAR_ROUNDS, MAX_RESTARTS, RESTART_ALIKE, RESTART_CONFIRMED,
    RESTART_EXACT, RESTART_RESTARTED, RESTART_RESTARTS, RESTART_SAME, RESTARTS_AMONG_MANY,
    SEARCH_STEPS, SEARCHES_CONTINUED, STEPS_MORE, STEPS_RESAMPLED, THIN_LINES, THIN_NEAR,
    THIN_STEP,
};
use crate::{EstimateError, Unknowns};

/// Range of sums of squares that the noise explains.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plausible {
    /// Expected value of the sum of squares of a correct model; `None` if the level of the noise is
    /// unknown.
    pub expected: Option<f64>,
    /// Largest ratio of a sum of squares to its expected value that chance alone explains.
    pub factor: f64,
}

/// Best minimum of several searches.
#[derive(Debug, Clone)]
pub(super) struct GlobalMinimum {
    pub minimum: Minimum,
    /// Number of searches.
    pub searches: usize,
    /// Number of searches that ended at this minimum.
    pub agreeing: usize,
}

/// Searches from one initial estimate after another; afterwards `problem` is at the best minimum.
///
/// The search ends when the first few initial estimates have led to the same minimum. Otherwise it
/// restarts from the best minima: a restart is a few steps with a random weight for every line,
/// followed by a search in the original data. The restarts end when several in succession have
/// found no better minimum. Local minima due to the noise change with the weights; the global one
/// hardly moves.
///
/// If `thin`, the same problem with fewer lines, is given, each search begins there. The first
/// search continues on all lines if it has converged on fewer lines. A later search continues on
/// all lines if its sum of squares is close to that of the best point so far, or below it, and if
/// this search or the search for the best point has converged. If no search has converged, the best
/// search is continued before any restart: in the tests of the project, only more steps then led to
/// a minimum.
///
/// After the end of a time limit, the result is the lowest sum of squares so far, which may not be
/// a minimum.
///
/// # Errors
/// [`EstimateError::NotConverged`] if no search ends at a minimum.
///
/// # Source
/// Wood (2001), Biometrics 57, 240–244 (bootstrap restarting); the weights vary more than those of
/// a bootstrap and escape from minima where a bootstrap does not.
pub(super) fn search<P: Restartable>(
    problem: &mut impl Restartable,
    mut thin: Option<&mut P>,
    starts: &InitialEstimates<'_>,
    plausible: Plausible,
) -> Result<GlobalMinimum, EstimateError> {
    let mut ends = Ends { plausible, searches: 0, distinct: Vec::new() };
    let ordered = match &mut thin {
        Some(thin) => in_order(*thin, starts.families()),
        None => in_order(problem, starts.families()),
    };
    for start in ordered {
        log::debug!("search {}", ends.searches + 1);
        let best = ends.distinct.first().map(|end| end.minimum.clone());
        let steps = if best.is_none() { SEARCH_STEPS } else { STEPS_MORE };
        let start = match (&mut thin, best) {
            (Some(thin), Some(best)) => linear_rounds(*thin, start, &plausible)
                .and_then(|start| search_thin(problem, *thin, start, &best)),
            (Some(thin), None) => first_on_fewer(problem, *thin, start, &plausible),
            _ => linear_rounds(problem, start, &plausible).map(Start::Near),
        };
        ends.push(start.and_then(|start| start.followed(problem, steps)));
        let needed = if ends.explained() { RESTART_CONFIRMED } else { CONFIRMED_OTHERWISE };
        if (ends.searches >= needed && !ends.is_ambiguous()) || time_limit::is_over() {
            break;
        }
    }
    if !ends.has_minimum() {
        follow_best(problem, &mut thin, &mut ends);
    }
    if ends.has_minimum() && !ends.all_agree() {
        restart(problem, thin, &mut ends);
        if let Some(unconverged) = ends.unconverged() {
            ends.push(minimise(problem, unconverged, SEARCH_STEPS));
        }
    }
    let failed = EstimateError::NotConverged { searches: ends.searches, steps: SEARCH_STEPS };
    let is_result = |end: &End| end.minimum.converged || time_limit::is_over();
    let best = ends.distinct.into_iter().find(is_result).ok_or(failed)?;
    problem.try_at(&best.minimum.parameters);
    problem.accept();
    Ok(GlobalMinimum { minimum: best.minimum, searches: ends.searches, agreeing: best.count })
}

/// Start of a search on all lines.
enum Start {
    Near(DVector<f64>),
    /// End of a search on fewer lines, if no search on all lines follows. The sum of squares is
    /// that of all lines. If it is far above the sum of squares of the best point, it is not
    /// computed on all lines, but scaled from the fewer lines.
    Far(Minimum),
}

/// Searches on fewer lines while no search has converged yet. If this search converges, it
/// continues on all lines; if it stops without convergence, it does not continue; if it fails, it
/// is repeated on all lines.
fn first_on_fewer(
    problem: &mut impl Restartable,
    thin: &mut impl Restartable,
    start: DVector<f64>,
    plausible: &Plausible,
) -> Option<Start> {
    let end = linear_rounds(thin, start.clone(), plausible)
        .and_then(|start| minimise(thin, start, SEARCH_STEPS));
    match end {
        None => Some(Start::Near(start)),
        Some(end) if end.converged => Some(Start::Near(end.parameters)),
        Some(end) => {
            let cost = problem.try_at(&end.parameters)?;
            Some(Start::Far(Minimum { cost, ..end }))
        }
    }
}

/// Continues the best search in several rounds if no search has converged. A round begins on fewer
/// lines and goes on to all lines if it converges; the last round uses all lines from its
/// beginning.
fn follow_best<P: Restartable>(
    problem: &mut impl Restartable,
    thin: &mut Option<&mut P>,
    ends: &mut Ends,
) {
    for round in 1..=SEARCHES_CONTINUED {
        let Some(from) = ends.unconverged().filter(|_| !time_limit::is_over()) else { return };
        let start = match thin {
            Some(thin) if round < SEARCHES_CONTINUED => {
                first_on_fewer(problem, *thin, from, &ends.plausible)
            }
            _ => Some(Start::Near(from)),
        };
        ends.push(start.and_then(|start| start.followed(problem, SEARCH_STEPS)));
        if ends.has_minimum() {
            return;
        }
    }
}

impl Start {
    /// Returns the point at which a search on all lines ends.
    fn followed(self, problem: &mut impl Restartable, steps: usize) -> Option<Minimum> {
        match self {
            Self::Near(start) => minimise(problem, start, steps),
            Self::Far(end) => Some(end),
        }
    }
}

/// Searches on fewer lines. The search continues on all lines if its sum of squares is close to
/// that of the best point so far, or below it, and if its end or the best point is a minimum.
fn search_thin(
    problem: &mut impl Restartable,
    thin: &mut impl Restartable,
    start: DVector<f64>,
    best: &Minimum,
) -> Option<Start> {
    let of_best = thin.try_at(&best.parameters)?;
    let end = minimise(thin, start, STEPS_MORE)?;
    let is_near = end.cost <= THIN_NEAR * of_best;
    Some(if is_near && (end.converged || best.converged) {
        Start::Near(end.parameters)
    } else {
        let cost =
            if is_near { problem.try_at(&end.parameters)? } else { end.cost * best.cost / of_best };
        Start::Far(Minimum { cost, converged: false, ..end })
    })
}

/// Returns the data and the noise on fewer lines, for the beginning of searches; `None` if the data
/// have few lines.
pub(super) fn thinned(
    data: &FrequencyData,
    unknowns: &Unknowns,
    noise: &NoiseSpectrum,
) -> Option<(FrequencyData, NoiseSpectrum)> {
    let step = thin_step(data, unknowns);
    (step > 1).then(|| data.thinned(step).zip(noise.thinned(step))).flatten()
}

/// Returns the ratio of the number of all lines to the number of lines on which searches begin. A
/// comparison of explanations of a residual uses the same ratio.
///
/// # Source
/// Ours.
pub fn thin_step(data: &FrequencyData, unknowns: &Unknowns) -> usize {
    let parameters = unknowns.independent() + transient::len(data);
    (data.len() * data.dof() / (THIN_LINES * parameters).max(1)).min(THIN_STEP)
}

/// Restarts the search from the best minima so far, moved by a few steps in resampled data. With
/// `thin`, these steps and the search use fewer lines, and the search continues on all lines only
/// if it ends near the best minimum.
fn restart<P: Restartable>(
    problem: &mut impl Restartable,
    mut thin: Option<&mut P>,
    ends: &mut Ends,
) {
    let mut without_gain = 0;
    for seed in 0..MAX_RESTARTS {
        if time_limit::is_over() {
            return;
        }
        let Some(from) = ends.restart_point(seed as usize) else { return };
        log::debug!("search {}", ends.searches + 1);
        let best = ends.distinct.first().map(|end| end.minimum.clone());
        let start = match (&mut thin, best) {
            (Some(thin), Some(best)) => {
                moved(*thin, from, seed).and_then(|start| search_thin(problem, *thin, start, &best))
            }
            _ => moved(problem, from, seed).map(Start::Near),
        };
        let gained = ends.push(start.and_then(|start| start.followed(problem, STEPS_MORE)));
        without_gain = if gained { 0 } else { without_gain + 1 };
        let enough = if ends.is_ambiguous() { RESTARTS_AMONG_MANY } else { RESTART_RESTARTS };
        if without_gain >= enough {
            return;
        }
    }
}

/// Returns the parameters after a few steps in resampled data.
fn moved(problem: &mut impl Restartable, from: DVector<f64>, seed: u64) -> Option<DVector<f64>> {
    problem.resample(Some(seed));
    let moved = minimise(problem, from, STEPS_RESAMPLED);
    problem.resample(None);
    moved.map(|moved| moved.parameters)
}

/// Returns the best result of some rounds of linear least squares, each with the weights of the
/// round before. These rounds cross wide regions in which a search would need many small steps.
/// There are no rounds if the noise explains the data before the first one; `None` if the sum of
/// squares does not exist.
///
/// # Source
/// Sanathanan & Koerner (1963), IEEE Transactions on Automatic Control 8, 56–58.
fn linear_rounds(
    problem: &mut impl Restartable,
    start: DVector<f64>,
    plausible: &Plausible,
) -> Option<DVector<f64>> {
    let mut cost = problem.try_at(&start)?;
    let (mut best, mut theta) = (start.clone(), start);
    for _ in 0..LINEAR_ROUNDS {
        if plausible.explains(cost) {
            break;
        }
        problem.accept();
        let Some(step) = problem.linear_step() else { break };
        theta += step;
        let Some(now) = problem.try_at(&theta) else { break };
        if now < cost {
            (best, cost) = (theta.clone(), now);
        }
    }
    Some(best)
}

impl Plausible {
    fn explains(&self, cost: f64) -> bool {
        self.expected.is_some_and(|expected| cost <= expected * self.factor)
    }
}

/// Points at which the searches ended.
struct Ends {
    plausible: Plausible,
    searches: usize,
    /// Points with different sums of squares, the smallest first. They include the points at which
    /// a search ended without convergence.
    distinct: Vec<End>,
}

/// Point at which one or more searches ended.
struct End {
    minimum: Minimum,
    count: usize,
}

impl Ends {
    /// Counts a search and stores the point at which it ended, if there is one. Returns whether
    /// this point is new and the best so far.
    fn push(&mut self, ended: Option<Minimum>) -> bool {
        self.searches += 1;
        let Some(minimum) = ended else { return false };
        let same = |end: &&mut End| {
            let (a, b) = (minimum.cost, end.minimum.cost);
            (a - b).abs() <= RESTART_SAME * a.max(b) + RESTART_EXACT
        };
        if let Some(end) = self.distinct.iter_mut().find(same) {
            end.count += 1;
            if (minimum.converged, -minimum.cost) > (end.minimum.converged, -end.minimum.cost) {
                end.minimum = minimum;
            }
            return false;
        }
        let rank = self.distinct.partition_point(|end| end.minimum.cost < minimum.cost);
        self.distinct.insert(rank, End { minimum, count: 1 });
        rank == 0
    }

    /// Returns whether the noise explains the smallest sum of squares.
    fn explained(&self) -> bool {
        self.distinct.first().is_some_and(|end| self.plausible.explains(end.minimum.cost))
    }

    /// Returns whether a search has converged.
    fn has_minimum(&self) -> bool {
        self.distinct.iter().any(|end| end.minimum.converged)
    }

    /// Returns whether every search has led to the same minimum.
    fn all_agree(&self) -> bool {
        matches!(&self.distinct[..], [end] if end.count == self.searches && end.minimum.converged)
    }

    /// Returns whether the noise explains the difference between the two smallest sums of squares,
    /// or the best search has not converged.
    fn is_ambiguous(&self) -> bool {
        let Some(best) = self.distinct.first() else { return true };
        let bound = best.minimum.cost * self.plausible.factor;
        let close = self.distinct.get(1).is_some_and(|next| next.minimum.cost <= bound);
        close || !best.minimum.converged
    }

    /// Returns the best point if its search has not converged.
    fn unconverged(&self) -> Option<DVector<f64>> {
        let best = &self.distinct.first()?.minimum;
        (!best.converged).then(|| best.parameters.clone())
    }

    /// Returns the point at which restart number `at` begins: the best points in turn if the best
    /// minimum is ambiguous, otherwise the best point.
    fn restart_point(&self, at: usize) -> Option<DVector<f64>> {
        let count =
            if self.is_ambiguous() { RESTART_RESTARTED.min(self.distinct.len()) } else { 1 };
        let end = self.distinct.get(at.checked_rem(count)?)?;
        Some(end.minimum.parameters.clone())
    }
}

impl GlobalMinimum {
    /// Returns the minimum of a search in `problem` that starts at this minimum. `problem` has the
    /// same residuals with other weights.
    ///
    /// # Errors
    /// [`EstimateError::NotConverged`].
    pub(super) fn followed(self, problem: &mut impl Restartable) -> Result<Self, EstimateError> {
        let Self { minimum: before, searches, agreeing } = self;
        let minimum = minimise(problem, before.parameters, SEARCH_STEPS)
            .filter(|minimum| minimum.converged || time_limit::is_over());
        let mut minimum =
            minimum.ok_or(EstimateError::NotConverged { searches, steps: SEARCH_STEPS })?;
        minimum.steps += before.steps;
        Ok(Self { minimum, searches, agreeing })
    }
}

/// Returns the best initial estimate of each family of initial estimates. That of the first family
/// comes first, the others follow by rising sum of squares. An estimate comes last if its sum of
/// squares is about the same as that of a better estimate.
fn in_order(problem: &mut impl Restartable, families: Vec<Vec<DVector<f64>>>) -> Vec<DVector<f64>> {
    let mut best: Vec<(usize, f64, DVector<f64>)> = Vec::new();
    for (family, members) in families.into_iter().enumerate() {
        let costs =
            members.into_iter().filter_map(|start| Some((family, problem.try_at(&start)?, start)));
        best.extend(costs.min_by(|a, b| a.1.total_cmp(&b.1)));
    }
    best.sort_by(|a, b| a.1.total_cmp(&b.1));
    let (mut first, mut last): (Vec<_>, Vec<_>) = (Vec::new(), Vec::new());
    let mut before = f64::NEG_INFINITY;
    for (family, cost, start) in best {
        if family == 0 {
            first.insert(0, start);
        } else if cost <= before * (1.0 + RESTART_ALIKE) {
            last.push(start);
            continue;
        } else {
            first.push(start);
        }
        before = cost;
    }
    first.append(&mut last);
    first
}
