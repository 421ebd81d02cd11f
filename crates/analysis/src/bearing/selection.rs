//! Intervals of coefficients after a test has chosen the model.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Number of bisections for a limit of an interval; they reduce the error of the limit to rounding.
const HALVINGS: usize = 80;

/// Half the width of the search range for a limit of an interval, in standard errors. A selection
/// of the model by a test of four coefficients at 5 % moves the limit by much less.
const REACH: f64 = 60.0;

/// Returns the range [low, high] of the estimate `at` in which the test would have chosen the model
/// without the coefficients `tested`; `None` if its choice does not depend on this estimate.
///
/// The test chooses the larger model if mᵀS⁻¹m exceeds `critical`, with the `tested` estimates m
/// and their covariance S. m is the sum of two components: one is proportional to the estimate
/// `at`, and the other is independent of it. With the independent component fixed, this condition
/// is a quadratic inequality in the estimate `at`.
///
/// # Source
/// Lee, Sun, Sun & Taylor (2016), Annals of Statistics 44, 907–927 (the polyhedral lemma, here for
/// a quadric).
pub(super) fn gap(
    values: &DVector<f64>,
    covariance: &DMatrix<f64>,
    at: usize,
    tested: std::ops::Range<usize>,
    critical: f64,
) -> Option<[f64; 2]> {
    let (first, count) = (tested.start, tested.len());
    let variance = covariance[(at, at)];
    let scale = DVector::from_fn(count, |row, _| covariance[(first + row, first + row)].sqrt());
    if !(variance > 0.0 && scale.iter().all(|s| *s > 0.0)) {
        return None;
    }
    let correlation = DMatrix::from_fn(count, count, |i, j| {
        covariance[(first + i, first + j)] / (scale[i] * scale[j])
    });
    // The tested estimates in units of their standard errors.
    let tested = DVector::from_fn(count, |row, _| values[first + row] / scale[row]);
    let slope = DVector::from_fn(count, |row, _| {
        covariance[(first + row, at)] / (variance.sqrt() * scale[row])
    });
    let value = values[at] / variance.sqrt();
    let independent = &tested - &slope * value;
    let lu = correlation.lu();
    let (of_slope, of_rest) = (lu.solve(&slope)?, lu.solve(&independent)?);
    let (square, half) = (slope.dot(&of_slope), independent.dot(&of_slope));
    // The limit ensures that the present estimates are outside the gap despite rounding.
    let critical = critical.min(tested.dot(&lu.solve(&tested)?));
    let root = half * half - square * (independent.dot(&of_rest) - critical);
    if !(square > 0.0 && root > 0.0) {
        return None;
    }
    let ends = [-1.0, 1.0].map(|sign| (-half + sign * root.sqrt()) / square);
    Some(ends.map(|end| end * variance.sqrt()))
}

/// Returns the confidence interval, at `level`, of a coefficient with the estimate `value` and the
/// `standard_error`, given that the estimate cannot be inside `gap`.
///
/// # Source
/// As [`gap`].
pub(super) fn conditional_interval(
    [value, standard_error]: [f64; 2],
    degrees_of_freedom: usize,
    gap: [f64; 2],
    level: f64,
) -> Option<[f64; 2]> {
    let student = StudentsT::new(0.0, 1.0, degrees_of_freedom as f64).ok()?;
    let [low, high] = gap.map(|end| end / standard_error);
    let estimate = value / standard_error;
    // Probability, for this true value, that an estimate outside the gap is larger than the present
    // one. This probability rises with the true value.
    let above = |truth: f64| {
        let (below_gap, above_gap) = (student.cdf(low - truth), student.sf(high - truth));
        let outside_gap = below_gap + above_gap;
        if estimate > 0.5 * (low + high) {
            student.sf(estimate.max(high) - truth) / outside_gap
        } else {
            1.0 - student.cdf(estimate.min(low) - truth) / outside_gap
        }
    };
    let end = |probability: f64| {
        let (mut lower, mut upper) = (estimate - REACH, estimate + REACH);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (lower + upper);
            if above(middle) < probability { lower = middle } else { upper = middle }
        }
        0.5 * (lower + upper) * standard_error
    };
    let tail = 0.5 * (1.0 - level);
    Some([end(tail), end(1.0 - tail)])
}

#[cfg(test)]
mod tests {
    use mechid_numerics::student_interval;
    use rand::SeedableRng as _;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution as _, StandardNormal};

    use super::*;

    #[test]
    fn without_a_gap_it_is_students_interval() {
        let far = [-50.0, -49.0];
        let [low, high] = conditional_interval([3.0, 0.5], 12, far, 0.95).unwrap();
        let expected = student_interval(3.0, 0.5, 12, 0.95).unwrap();
        assert!((low - expected[0]).abs() < 1e-9 && (high - expected[1]).abs() < 1e-9);
    }

    /// If a test at 5 % chooses the model, usual intervals contain the true value in less than 95 %
    /// of the cases. The conditional intervals contain it in 95 %.
    #[test]
    fn intervals_after_a_choice_hold() {
        let rng = &mut ChaCha8Rng::seed_from_u64(7);
        // This matrix correlates coefficient 0 and the four tested coefficients.
        let mix = DMatrix::from_fn(5, 5, |i, j| if i == j { 1.0 } else { 0.2 * (i as f64 - 1.0) });
        let covariance = &mix * mix.transpose();
        for size in [0.0, 1.0, 3.0] {
            let truth = DVector::from_fn(5, |row, _| if row == 0 { 5.0 } else { size });
            let (mut chosen, mut inside, mut usual) = (0, [0; 5], [0; 5]);
            while chosen < 1500 {
                let noise = DVector::from_fn(5, |_, _| StandardNormal.sample(rng));
                let values = &truth + &mix * noise;
                let tested = values.rows(1, 4).into_owned();
                let block = covariance.view((1, 1), (4, 4)).into_owned();
                // The limit is the 95 % quantile of chi-squared with four degrees of freedom.
                if tested.dot(&block.lu().solve(&tested).unwrap()) < 9.4877 {
                    continue;
                }
                chosen += 1;
                for at in 0..5 {
                    let error = covariance[(at, at)].sqrt();
                    let plain = [values[at] - 1.96 * error, values[at] + 1.96 * error];
                    let [low, high] = match gap(&values, &covariance, at, 1..5, 9.4877) {
                        Some(gap) => {
                            conditional_interval([values[at], error], 1_000_000, gap, 0.95).unwrap()
                        }
                        None => plain,
                    };
                    inside[at] += usize::from((low..=high).contains(&truth[at]));
                    usual[at] += usize::from((plain[0]..=plain[1]).contains(&truth[at]));
                }
            }
            for count in inside {
                // The tolerance is three standard errors of a fraction of 95 %, estimated from
                // 1,500 trials.
                assert!((0.933..=0.967).contains(&(count as f64 / 1500.0)), "{size}: {inside:?}");
            }
            assert!(size > 0.0 || usual[1..].iter().any(|count| *count < 1275), "{usual:?}");
        }
    }
}
