//! Checks that are tests of hypotheses, with p-values adjusted for their number.

use super::super::summary::ModalCheck;
use crate::limits::MODAL_SIGNIFICANCE;
use crate::text::significant;

/// Test of a property of the modes: one that every structure with constant M, C and K has, or one
/// that the settings impose.
pub struct Tested {
    /// Name of the check, in snake case.
    pub code: &'static str,
    /// Probability that the errors of the modes alone cause a larger statistic.
    pub p_value: f64,
    /// The finding if the test passes, in a sentence.
    pub passes: String,
    /// The finding if the test fails, in a sentence.
    pub fails: String,
}

/// Converts tests to checks, with p-values adjusted for the number of tests.
///
/// # Source
/// Holm (1979), Scandinavian Journal of Statistics 6, 65–70.
pub fn adjusted(mut tests: Vec<Tested>) -> Vec<ModalCheck> {
    let mut order: Vec<usize> = (0..tests.len()).collect();
    order.sort_by(|a, b| tests[*a].p_value.total_cmp(&tests[*b].p_value));
    let mut least = 0.0_f64;
    for (rank, at) in order.iter().enumerate() {
        least = least.max((tests.len() - rank) as f64 * tests[*at].p_value).min(1.0);
        tests[*at].p_value = least;
    }
    let row = |Tested { code, p_value, passes, fails }: Tested| {
        let passed = p_value >= MODAL_SIGNIFICANCE;
        let text = if passed { passes } else { fails };
        let text = format!("{text} (p = {})", significant(p_value, 2));
        ModalCheck { code, passed, value: p_value, text }
    };
    tests.into_iter().map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The adjusted p-values are equal to those of R: `p.adjust(c(0.01, 0.04, 0.03, 0.005),
    /// "holm")` returns 0.03, 0.06, 0.06, 0.02.
    #[test]
    fn p_values_are_those_of_holm() {
        let test = |p_value| Tested { code: "a", p_value, passes: "b".into(), fails: "c".into() };
        let checks = adjusted([0.01, 0.04, 0.03, 0.005].map(test).into());
        for (check, expected) in checks.iter().zip([0.03, 0.06, 0.06, 0.02]) {
            assert!((check.value - expected).abs() < 1e-12, "{} {expected}", check.value);
            assert!(check.passed && check.text.starts_with("b "));
        }
        let [check] = adjusted(vec![test(0.001)]).try_into().unwrap();
        assert!(!check.passed && check.text.starts_with("c "));
    }
}
