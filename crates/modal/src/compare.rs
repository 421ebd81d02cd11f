//! Comparison of two sets of modes: a structure before and after a change, or a test and a
//! finite-element model.

use statrs::distribution::{ChiSquared, ContinuousCDF, Normal, StudentsT};

use nalgebra::{DMatrix, DVector};

use crate::indicators::{Indicator, IndicatorError, ShapeWithCovariance, mac, mac_with_error};

/// Largest ratio of the frequencies of two modes that may represent the same mode. Before model
/// updating, the frequencies of a finite-element model may differ from the measured ones by up to a
/// fifth.
const MAX_FREQUENCY_RATIO: f64 = 1.25;

/// Smallest MAC of two modes that may represent the same mode; below it the shapes have little in
/// common.
const MIN_MAC: f64 = 0.3;

/// Ratio of an eigenvalue of the covariance of a shape difference to the largest eigenvalue. At or
/// below this ratio, the test omits the direction of the eigenvalue.
const COVARIANCE_RANK: f64 = 1e-12;

/// Value with its standard error. The standard error is 0 for an exact value, such as that of a
/// finite-element model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// Value.
    pub value: f64,
    /// Standard error, in the unit of the value.
    pub standard_error: f64,
    /// Degrees of freedom of the variance that the standard error comes from; infinite if the
    /// standard error is exact.
    pub degrees_of_freedom: f64,
}

impl Measured {
    /// Creates a value with an exact standard error.
    pub fn new(value: f64, standard_error: f64) -> Self {
        Self { value, standard_error, degrees_of_freedom: f64::INFINITY }
    }
}

/// Mode to be compared.
#[derive(Debug, Clone, PartialEq)]
pub struct ComparedMode {
    /// Natural frequency, in Hz.
    pub natural_frequency_hz: Measured,
    /// Damping ratio; `None` for a model without damping.
    pub damping_ratio: Option<Measured>,
    /// Shape. Entries with the same index in both sets must belong to the same point and direction.
    pub shape: ShapeWithCovariance,
}

/// Limits of frequency and shape within which two modes form a pair.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairingRule {
    /// Largest ratio of the two frequencies of a pair, above 1.
    pub max_frequency_ratio: f64,
    /// Smallest MAC of a pair.
    pub min_mac: f64,
}

impl Default for PairingRule {
    fn default() -> Self {
        Self { max_frequency_ratio: MAX_FREQUENCY_RATIO, min_mac: MIN_MAC }
    }
}

/// Difference second − first with its test against zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Difference {
    /// Difference, in the unit of the values.
    pub value: f64,
    /// Standard error of the difference, in the unit of the values.
    pub standard_error: f64,
    /// Probability that the errors alone cause a difference at least as large; `None` if both
    /// values are exact.
    pub p_value: Option<f64>,
    /// P-value after Holm's adjustment for the number of tests of the comparison.
    pub adjusted_p_value: Option<f64>,
}

/// Test of the difference of two shapes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShapeTest {
    /// Squared difference of the normalised shapes in units of its covariance.
    pub statistic: f64,
    /// Degrees of freedom of the statistic.
    pub degrees_of_freedom: usize,
    /// Probability that the errors alone cause a statistic at least as large.
    pub p_value: f64,
    /// P-value after Holm's adjustment for the number of tests of the comparison.
    pub adjusted_p_value: f64,
}

/// Pair of modes, one from each set, that represent the same mode of the structure.
#[derive(Debug, Clone, PartialEq)]
pub struct ModePair {
    /// Index in the first set.
    pub first: usize,
    /// Index in the second set.
    pub second: usize,
    /// MAC of the two shapes.
    pub mac: Indicator,
    /// Difference of the natural frequencies, in Hz.
    pub natural_frequency_hz: Difference,
    /// Difference of the damping ratios; `None` if one of the modes has no damping ratio.
    pub damping_ratio: Option<Difference>,
    /// Test of the shapes; `None` if both shapes are exact, or with a single output.
    pub shape: Option<ShapeTest>,
}

/// Two sets of modes side by side.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// Pairs, by rising frequency of the first set.
    pub pairs: Vec<ModePair>,
    /// Indices of modes of the first set without a partner.
    pub only_first: Vec<usize>,
    /// Indices of modes of the second set without a partner.
    pub only_second: Vec<usize>,
}

/// Pairs modes by frequency and shape. Returns the pairs (index in the first set, index in the
/// second set), sorted by the first index.
///
/// The MAC of each pair is reduced according to the distance in frequency. The pair with the
/// largest reduced MAC is accepted first; the next pair of modes without a partner follows, and so
/// on.
///
/// # Errors
/// [`IndicatorError::Size`] if shapes differ in length.
pub fn pair_modes(
    first: &[ComparedMode],
    second: &[ComparedMode],
    rule: PairingRule,
) -> Result<Vec<(usize, usize)>, IndicatorError> {
    let max_distance = rule.max_frequency_ratio.ln();
    let mut candidates = Vec::new();
    for (i, one) in first.iter().enumerate() {
        for (j, two) in second.iter().enumerate() {
            let (expected, got) = (one.shape.shape().len(), two.shape.shape().len());
            if expected != got {
                let what = "entries of a shape of the second set";
                return Err(IndicatorError::Size { what, expected, got });
            }
            let ratio = two.natural_frequency_hz.value / one.natural_frequency_hz.value;
            let (distance, mac) = (ratio.ln().abs(), mac(one.shape.shape(), two.shape.shape()));
            if distance <= max_distance && mac >= rule.min_mac {
                candidates.push((mac * (1.0 - 0.5 * distance / max_distance), i, j));
            }
        }
    }
    candidates.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut pairs: Vec<(usize, usize)> = Vec::new();
    for (_, i, j) in candidates {
        if pairs.iter().all(|pair| pair.0 != i && pair.1 != j) {
            pairs.push((i, j));
        }
    }
    pairs.sort_unstable();
    Ok(pairs)
}

/// Compares two sets of modes: pairs with tests of their differences, and modes without a partner.
///
/// The errors of the two sets are independent. Holm's method adjusts the p-values of all
/// frequencies, damping ratios and shapes together for the number of tests; a small adjusted
/// p-value means that the mode has changed.
///
/// # Errors
/// [`IndicatorError::Size`] if shapes differ in length.
///
/// # Source
/// Holm (1979), Scandinavian Journal of Statistics 6, 65–70.
pub fn compare(
    first: &[ComparedMode],
    second: &[ComparedMode],
    rule: PairingRule,
) -> Result<Comparison, IndicatorError> {
    let indices = pair_modes(first, second, rule)?;
    let mut pairs = Vec::with_capacity(indices.len());
    for &(i, j) in &indices {
        let (one, two) = (&first[i], &second[j]);
        let dampings = one.damping_ratio.zip(two.damping_ratio);
        pairs.push(ModePair {
            first: i,
            second: j,
            mac: mac_with_error(&one.shape, &two.shape)?,
            natural_frequency_hz: difference(one.natural_frequency_hz, two.natural_frequency_hz),
            damping_ratio: dampings.map(|(one, two)| difference(one, two)),
            shape: shape_test(&one.shape, &two.shape),
        });
    }
    adjust(&mut pairs);
    let unpaired = |count: usize, paired: &dyn Fn(usize) -> bool| {
        (0..count).filter(|index| !paired(*index)).collect()
    };
    Ok(Comparison {
        only_first: unpaired(first.len(), &|i| indices.iter().any(|pair| pair.0 == i)),
        only_second: unpaired(second.len(), &|j| indices.iter().any(|pair| pair.1 == j)),
        pairs,
    })
}

/// Returns the difference of two values with its two-sided test.
///
/// # Source
/// Welch (1947), Biometrika 34, 28–35, with the degrees of freedom of Satterthwaite.
fn difference(first: Measured, second: Measured) -> Difference {
    let value = second.value - first.value;
    let standard_error = first.standard_error.hypot(second.standard_error);
    let tested = standard_error > 0.0 && standard_error.is_finite();
    let part =
        |one: Measured| (one.standard_error / standard_error).powi(4) / one.degrees_of_freedom;
    let freedom = 1.0 / (part(first) + part(second));
    let tail = |size: f64| match StudentsT::new(0.0, 1.0, freedom) {
        Ok(student) if freedom.is_finite() => student.sf(size),
        _ => Normal::standard().sf(size),
    };
    let p_value = tested.then(|| 2.0 * tail((value / standard_error).abs()));
    Difference { value, standard_error, p_value, adjusted_p_value: p_value }
}

/// Tests the difference of two shapes by χ². Both shapes are normalised to the same entry, which is
/// large in each of them.
fn shape_test(first: &ShapeWithCovariance, second: &ShapeWithCovariance) -> Option<ShapeTest> {
    let outputs = first.shape().len();
    let size = |i: &usize| (first.shape()[*i] * second.shape()[*i]).norm();
    let reference = (0..outputs).max_by(|a, b| size(a).total_cmp(&size(b)))?;
    let (one, two) = (first.normalised_to(reference)?, second.normalised_to(reference)?);
    let rows: Vec<usize> = (0..2 * outputs).filter(|row| row % outputs != reference).collect();
    let difference = two.shape() - one.shape();
    let part =
        |row: usize| if row < outputs { difference[row].re } else { difference[row - outputs].im };
    let difference = DVector::from_iterator(rows.len(), rows.iter().map(|row| part(*row)));
    let total = one.covariance() + two.covariance();
    let covariance = DMatrix::from_fn(rows.len(), rows.len(), |i, j| total[(rows[i], rows[j])]);
    let eigen = crate::decomposition::hermitian_eigen(covariance)?;
    let floor = COVARIANCE_RANK * eigen.eigenvalues.amax();
    let determined = |i: &usize| eigen.eigenvalues[*i] > floor;
    let terms = (0..rows.len())
        .filter(determined)
        .map(|i| eigen.eigenvectors.column(i).dot(&difference).powi(2) / eigen.eigenvalues[i]);
    let terms: Vec<f64> = terms.collect();
    let degrees_of_freedom = terms.len();
    let statistic = terms.iter().sum();
    let p_value = ChiSquared::new(degrees_of_freedom as f64).ok()?.sf(statistic);
    Some(ShapeTest { statistic, degrees_of_freedom, p_value, adjusted_p_value: p_value })
}

/// Applies Holm's adjustment to all p-values of a comparison.
fn adjust(pairs: &mut [ModePair]) {
    let mut tests: Vec<&mut f64> = Vec::new();
    for pair in pairs {
        tests.extend(pair.natural_frequency_hz.adjusted_p_value.as_mut());
        tests.extend(pair.damping_ratio.as_mut().and_then(|d| d.adjusted_p_value.as_mut()));
        tests.extend(pair.shape.as_mut().map(|test| &mut test.adjusted_p_value));
    }
    tests.sort_by(|a, b| a.total_cmp(b));
    let count = tests.len();
    let mut largest: f64 = 0.0;
    for (rank, p_value) in tests.into_iter().enumerate() {
        largest = largest.max((*p_value * (count - rank) as f64).min(1.0));
        *p_value = largest;
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Complex;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    fn mode(f: f64, zeta: f64, shape: &[f64], error: f64) -> ComparedMode {
        let entries = DVector::from_iterator(shape.len(), shape.iter().map(|v| (*v).into()));
        let measured = |value: f64| Measured::new(value, error * value);
        ComparedMode {
            natural_frequency_hz: measured(f),
            damping_ratio: Some(measured(zeta)),
            shape: ShapeWithCovariance::from_standard_errors(entries, &vec![error; shape.len()])
                .unwrap(),
        }
    }

    #[test]
    fn modes_swap_places_but_keep_their_partners() {
        let first = [
            mode(10.0, 0.01, &[1.0, 0.9, 0.1], 1e-3),
            mode(10.5, 0.01, &[-0.1, 0.2, 1.0], 1e-3),
            mode(30.0, 0.01, &[1.0, -1.0, 0.3], 1e-3),
        ];
        let second = [
            mode(10.2, 0.01, &[-0.1, 0.2, 1.0], 1e-3),
            mode(10.6, 0.01, &[1.0, 0.9, 0.1], 1e-3),
            mode(55.0, 0.01, &[1.0, -1.0, 0.3], 1e-3),
        ];
        let comparison = compare(&first, &second, PairingRule::default()).unwrap();
        let indices: Vec<_> =
            comparison.pairs.iter().map(|outputs| (outputs.first, outputs.second)).collect();
        assert_eq!(indices, [(0, 1), (1, 0)]);
        assert_eq!((comparison.only_first, comparison.only_second), (vec![2], vec![2]));
        // The difference of 0.6 Hz is many times its standard error √(0.01² + 0.0106²) Hz.
        let difference = comparison.pairs[0].natural_frequency_hz;
        assert!((difference.value - 0.6).abs() < 1e-12);
        assert!(difference.adjusted_p_value.unwrap() < 1e-10);
        let equal = comparison.pairs[0].damping_ratio.unwrap();
        assert_eq!((equal.value, equal.adjusted_p_value), (0.0, Some(1.0)));
    }

    /// Reference: for two tests of the same structure, the smallest adjusted p-value is below 5 %
    /// in 5 % of the comparisons.
    #[test]
    fn equal_structures_are_called_different_at_the_stated_rate() {
        let mut random = ChaCha8Rng::seed_from_u64(2);
        let mut draw = |truth: &[(f64, [f64; 3])]| -> Vec<ComparedMode> {
            let error = 0.01;
            let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
            let mut mode = |f: f64, shape: &[f64; 3]| {
                let entries = shape.map(|v| Complex::new(v + error * normal(), error * normal()));
                let shape = DVector::from_row_slice(&entries);
                let measured = |value: f64, noise: f64| {
                    Measured::new(value * (1.0 + error * noise), error * value)
                };
                ComparedMode {
                    natural_frequency_hz: measured(f, normal()),
                    damping_ratio: Some(measured(0.02, normal())),
                    shape: ShapeWithCovariance::from_standard_errors(shape, &[error; 3])
                        .unwrap()
                        .normalised(),
                }
            };
            truth.iter().map(|(f, shape)| mode(*f, shape)).collect()
        };
        let truth = [(10.0, [1.0, 0.95, 0.3]), (25.0, [0.9, -1.0, 0.2])];
        let (runs, mut alarms) = (2000, 0);
        for _ in 0..runs {
            let (first, second) = (draw(&truth), draw(&truth));
            let comparison = compare(&first, &second, PairingRule::default()).unwrap();
            let p_values = comparison.pairs.iter().flat_map(|pair| {
                let damping = pair.damping_ratio.unwrap().adjusted_p_value;
                let shape = pair.shape.unwrap();
                assert_eq!(shape.degrees_of_freedom, 4);
                [pair.natural_frequency_hz.adjusted_p_value, damping, Some(shape.adjusted_p_value)]
            });
            let least = p_values.flatten().fold(1.0, f64::min);
            alarms += usize::from(least < 0.05);
        }
        let share = alarms as f64 / runs as f64;
        // The limits are 5 % ± 4 standard deviations for 2,000 runs.
        assert!((0.03..0.07).contains(&share), "{share}");
    }

    #[test]
    fn a_model_without_errors_is_compared_with_a_test() {
        let test = [mode(10.0, 0.01, &[1.0, 0.5], 0.02)];
        let mut model = mode(10.3, 0.0, &[1.0, 0.52], 0.0);
        model.damping_ratio = None;
        let comparison = compare(&test, &[model.clone()], PairingRule::default()).unwrap();
        let pair = &comparison.pairs[0];
        assert_eq!(pair.damping_ratio, None);
        assert!(pair.natural_frequency_hz.adjusted_p_value.unwrap() > 0.1);
        assert!(pair.shape.unwrap().p_value > 0.1 && pair.mac.value > 0.999);
        let unpaired = compare(&[model.clone()], &[model], PairingRule::default()).unwrap();
        assert_eq!(unpaired.pairs[0].natural_frequency_hz.p_value, None);
        assert_eq!(unpaired.pairs[0].shape, None);
        let longer = [mode(10.0, 0.01, &[1.0, 0.5, 0.1], 0.02)];
        assert!(compare(&test, &longer, PairingRule::default()).is_err());
    }
}
