//! Steps and drifts of a quantity over many records, with p-values from ranks.

use rand::SeedableRng as _;
use rand::seq::SliceRandom as _;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

/// Minimum number of records on either side of a step, and in a drift; fewer changed records are
/// outliers.
const LEAST: usize = 4;

/// Maximum number of random permutations for a p-value; its inverse is about the smallest p-value.
const ORDERS: usize = 9999;

/// Number of permutations that have a change at least as large as the observed change. When the
/// test has found this number, it ends, and the p-value is about this number divided by the number
/// of permutations made.
///
/// # Source
/// J. Besag and P. Clifford, "Sequential Monte Carlo p-values", Biometrika 78 (1991).
const EXCEEDED: usize = 20;

/// Maximum number of records that a test permutes one by one; with more records, it permutes means
/// of neighbouring records.
const SHUFFLED: usize = 2000;

/// Maximum p-value, adjusted for the number of quantities, of a reported change.
pub const SIGNIFICANT: f64 = 0.01;

/// Maximum number of records that form the pairs for a slope; from a longer list, only every n-th
/// record is used.
const SLOPES: usize = 400;

/// Kind of a change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ChangeKind {
    /// Change from one level to another, between two records.
    Step,
    /// Change by the same amount from record to record, beginning at one record.
    Drift,
}

impl ChangeKind {
    /// Returns the name of the kind of change: `step` or `drift`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Step => "step",
            Self::Drift => "drift",
        }
    }
}

/// A change within a list of values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Change {
    pub kind: ChangeKind,
    /// Index of the first value after a step, or of the last value before a drift.
    pub begins: usize,
    pub p_value: f64,
    /// `true` if no random permutation of the values had a change at least as large as this one.
    /// The p-value is then an upper bound.
    pub is_bound: bool,
    /// Difference of the levels of a step, or of the first and the last value of a drift.
    pub size: f64,
}

/// Detects the changes in a list of values: the largest one, then the changes before and after it.
/// `tests` is the number of tested lists, for the adjustment of p-values.
pub(super) fn find(values: &[f64], tests: usize) -> Vec<Change> {
    let mut changes = Vec::new();
    let mut parts = vec![(0, values.len())];
    while let Some((start, end)) = parts.pop() {
        let part = &values[start..end];
        let Some(mut change) = largest(part) else { continue };
        change.p_value = (change.p_value * tests as f64).min(1.0);
        if change.p_value >= SIGNIFICANT {
            continue;
        }
        change.begins += start;
        parts.push((start, change.begins));
        if change.kind == ChangeKind::Step {
            parts.push((change.begins, end));
        }
        changes.push(change);
    }
    changes.sort_by_key(|change| change.begins);
    changes
}

/// Returns the level of each value without noise: the medians between steps, and the line of a
/// drift.
pub(super) fn baseline(values: &[f64], changes: &[Change]) -> Vec<f64> {
    let mut levels = Vec::with_capacity(values.len());
    let mut start = 0;
    let ends = changes.iter().map(|change| (change.begins, Some(change)));
    for (end, change) in ends.chain([(values.len(), None)]) {
        let level = super::trends::median(values[start..end].to_vec());
        levels.extend((start..end).map(|_| level));
        start = end;
        if let Some(change) = change.filter(|change| change.kind == ChangeKind::Drift) {
            let slope = change.size / (values.len() - 1 - change.begins) as f64;
            let level = if level.is_finite() { level } else { values[start] };
            levels.extend((start..values.len()).map(|k| level + slope * (k - start) as f64));
            break;
        }
    }
    levels
}

/// Returns the step or drift with the largest share of the variance, and its p-value by a
/// permutation test of the ranks. Step and drift have the same number of parameters, so their
/// shares can be compared.
fn largest(values: &[f64]) -> Option<Change> {
    if values.len() < 2 * LEAST {
        return None;
    }
    // Ranks show whether there is a change, but distort its position; running medians, which remove
    // single outliers, show the position.
    let (kind, begins, _) = best(&running_medians(values), LEAST)?;
    let ranks = ranks(values);
    let mut shuffled = means_of_neighbours(&ranks);
    let least = (LEAST * shuffled.len()).div_ceil(values.len()).max(1);
    let (_, _, explained) = best(&shuffled, least)?;
    // A fixed seed makes the result reproducible.
    let mut random = ChaCha8Rng::seed_from_u64(48);
    let (mut orders, mut exceeded) = (0, 0);
    while orders < ORDERS && exceeded < EXCEEDED {
        orders += 1;
        shuffled.shuffle(&mut random);
        exceeded +=
            usize::from(best(&shuffled, least).is_some_and(|(.., share)| share >= explained));
    }
    let p_value = (exceeded + 1) as f64 / (orders + 1) as f64;
    let size = match kind {
        ChangeKind::Step => {
            let [before, after] = [&values[..begins], &values[begins..]]
                .map(|part| super::trends::median(part.to_vec()));
            after - before
        }
        ChangeKind::Drift => slope(&values[begins..]) * (values.len() - 1 - begins) as f64,
    };
    Some(Change { kind, begins, p_value, is_bound: exceeded == 0, size })
}

/// Returns ranks minus their mean; equal values have their mean rank.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let mut ranks = vec![0.0; values.len()];
    let mut below = 0;
    let middle = (values.len() as f64 - 1.0) / 2.0;
    for tied in order.chunk_by(|a, b| values[*a] == values[*b]) {
        let rank = below as f64 + (tied.len() as f64 - 1.0) / 2.0 - middle;
        tied.iter().for_each(|k| ranks[*k] = rank);
        below += tied.len();
    }
    ranks
}

/// Returns, for each value, the median of five neighbours, minus the mean of all these medians. The
/// medians keep the position of a step and remove one or two outliers.
fn running_medians(values: &[f64]) -> Vec<f64> {
    let last = values.len() - 1;
    let of_five =
        |k: usize| super::trends::median(values[k.saturating_sub(2)..=(k + 2).min(last)].to_vec());
    let medians: Vec<f64> = (0..=last).map(of_five).collect();
    let middle = medians.iter().sum::<f64>() / medians.len() as f64;
    medians.into_iter().map(|value| value - middle).collect()
}

fn means_of_neighbours(ranks: &[f64]) -> Vec<f64> {
    let width = ranks.len().div_ceil(SHUFFLED);
    let mean = |some: &[f64]| some.iter().sum::<f64>() / some.len() as f64;
    let means: Vec<f64> = ranks.chunks(width).map(mean).collect();
    let middle = mean(&means);
    means.into_iter().map(|value| value - middle).collect()
}

/// Returns the kind, the beginning and the share of the change that explains the largest share of
/// the variance of `values`. The sum of the values must be zero.
fn best(values: &[f64], least: usize) -> Option<(ChangeKind, usize, f64)> {
    let len = values.len();
    let total: f64 = values.iter().map(|value| value * value).sum();
    if total <= 0.0 || len < 2 * least {
        return None;
    }
    let mut best = (ChangeKind::Step, 0, 0.0);
    let n = len as f64;
    // Sum of the values after k, and sum of these values times their distances from k.
    let (mut behind, mut moment) = (0.0, 0.0);
    for k in (0..len).rev() {
        moment += behind;
        let (m, after) = ((len - 1 - k) as f64, len - 1 - k);
        if after >= least {
            let spread = m * (m + 1.0) * (2.0 * m + 1.0) / 6.0 - (m * (m + 1.0) / 2.0).powi(2) / n;
            let share = moment * moment / (spread * total);
            if share > best.2 {
                best = (ChangeKind::Drift, k, share);
            }
        }
        behind += values[k];
        if k >= least && len - k >= least {
            let (before, after) = (k as f64, (len - k) as f64);
            let share = behind * behind * n / (before * after * total);
            if share > best.2 {
                best = (ChangeKind::Step, k, share);
            }
        }
    }
    (best.2 > 0.0).then_some(best)
}

/// Returns the median of the slopes between pairs of values.
///
/// # Source
/// P. K. Sen, "Estimates of the regression coefficient based on Kendall's tau", JASA 63 (1968).
fn slope(values: &[f64]) -> f64 {
    let every = values.len().div_ceil(SLOPES).max(1);
    let some: Vec<(usize, f64)> = values.iter().copied().enumerate().step_by(every).collect();
    let pairs = some
        .iter()
        .enumerate()
        .flat_map(|(at, (i, a))| some[at + 1..].iter().map(move |(j, b)| (b - a) / (j - i) as f64));
    super::trends::median(pairs.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns noise of standard deviation 1: each value is the sum of twelve uniform random
    /// numbers, minus six.
    fn noise(len: usize, seed: u64) -> Vec<f64> {
        let mut random = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15);
        let mut uniform = || {
            random = random
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (random >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..len).map(|_| (0..12).map(|_| uniform()).sum::<f64>() - 6.0).collect()
    }

    #[test]
    fn a_step_behind_an_outlier_is_found_where_it_is() {
        let mut values = noise(60, 3);
        values[20..].iter_mut().for_each(|value| *value += 3.0);
        values[10] = 1e6;
        let changes = find(&values, 10);
        let [step] = changes[..] else { panic!("{changes:?}") };
        assert_eq!(
            (step.kind, step.begins.abs_diff(20) <= 1),
            (ChangeKind::Step, true),
            "{step:?}"
        );
        assert!(step.p_value < SIGNIFICANT && (step.size - 3.0).abs() < 1.0, "{step:?}");
        // No random order has such a step. The p-value of each test is therefore at most 1/10,000;
        // the adjustment for ten tests multiplies it by ten.
        assert!(step.is_bound && (step.p_value - 1e-3).abs() < 1e-9, "{step:?}");
        let levels = baseline(&values, &changes);
        assert!((levels[0]).abs() < 0.6 && (levels[59] - 3.0).abs() < 0.6);
    }

    #[test]
    fn a_drift_is_found_with_its_beginning_and_its_rise() {
        let mut values = noise(120, 5);
        for (k, value) in values.iter_mut().enumerate().skip(50) {
            *value += 0.15 * (k - 50) as f64;
        }
        let changes = find(&values, 10);
        let drift = changes.last().unwrap();
        assert_eq!(drift.kind, ChangeKind::Drift, "{changes:?}");
        // The drift rises by only 0.15 standard deviations of the noise per record. The noise hides
        // its beginning, so the test tolerates an error of some records.
        assert!(drift.begins.abs_diff(50) <= 12, "{drift:?}");
        assert!((drift.size - 0.15 * (119 - drift.begins) as f64).abs() < 2.0, "{drift:?}");
        let levels = baseline(&values, &changes);
        assert_eq!(levels.len(), 120);
        assert!((levels[119] - 0.15 * 69.0).abs() < 1.5, "{}", levels[119]);
    }

    /// The p-values of noise have a uniform distribution: the share below a limit equals the limit.
    #[test]
    fn p_values_of_noise_are_even() {
        let below =
            (0..400).filter(|seed| largest(&noise(40, seed + 1)).unwrap().p_value < 0.1).count();
        // The expected number is 40, with a standard deviation of 6; the limits are four standard
        // deviations from it.
        assert!((16..=64).contains(&below), "{below} of 400");
    }

    #[test]
    fn a_few_values_and_equal_ones_do_not_change() {
        assert!(find(&[1.0, 2.0, 9.0], 1).is_empty());
        assert!(find(&[2.0; 50], 1).is_empty());
    }
}
