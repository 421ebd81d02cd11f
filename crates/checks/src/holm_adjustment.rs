//! Error rates of all tests on a fit.

use super::bias::{Bias, Reference};
use super::finding::Finding;
use super::p_value::PValue;

/// Adjusts the p-values of all tests of one fit for their number. The comparison of the parameters
/// with maximum likelihood, and the test for growth, form groups separate from the tests of data
/// and residual.
///
/// If the model is right and only noise disturbs the fit, the probability of at least one warning
/// in a group is at most [`SIGNIFICANCE`](super::limits::SIGNIFICANCE). For all groups together it
/// is at most three times as large. Both limits hold for any dependence between the tests.
///
/// # Source
/// Holm (1979), Scandinavian Journal of Statistics 6, 65–70.
pub fn adjust_p_values<'a>(findings: impl IntoIterator<Item = &'a mut Finding>) {
    let of_parameters = |finding: &&mut Finding| {
        matches!(finding, Finding::Bias(Bias { reference: Reference::MaximumLikelihood, .. }))
    };
    let (bias, remaining): (Vec<&mut Finding>, Vec<&mut Finding>) =
        findings.into_iter().partition(of_parameters);
    // The test for growth is made only if a mode of the estimate grows. Its p-value already covers
    // all modes and is not adjusted here.
    let remaining =
        remaining.into_iter().filter(|f| !matches!(f, Finding::Instability(_))).collect::<Vec<_>>();
    for group in [bias, remaining] {
        adjust_together(group.into_iter().filter_map(Finding::p_value_mut).collect());
    }
}

fn adjust_together(mut family: Vec<&mut PValue>) {
    family.sort_by(|a, b| a.raw.total_cmp(&b.raw));
    let (count, mut least) = (family.len(), 0.0_f64);
    for (rank, p_value) in family.into_iter().enumerate() {
        least = least.max((count - rank) as f64 * p_value.raw).min(1.0);
        p_value.adjusted = least;
    }
}

#[cfg(test)]
mod tests {
    use mechid_model::{Matrix, Parameter};

    use super::*;
    use crate::misfit::{Misfit, NoiseSource};
    use crate::seam::Seam;

    fn misfit(raw: f64) -> Finding {
        let (p_value, source) = (PValue::new(raw), NoiseSource::Periods);
        Finding::Misfit(Misfit { ratio: 1.0, p_value, source, concentration: None })
    }

    /// The adjusted p-values equal those of R: `p.adjust(c(0.01, 0.04, 0.03, 0.005), "holm")` gives
    /// 0.03, 0.06, 0.06, 0.02.
    #[test]
    fn p_values_are_adjusted_step_by_step_down() {
        let mut findings = [0.01, 0.04, 0.03, 0.005].map(misfit);
        adjust_p_values(&mut findings);
        let adjusted = findings.map(|finding| finding.p_value().unwrap().adjusted);
        for (got, expected) in adjusted.into_iter().zip([0.03, 0.06, 0.06, 0.02]) {
            assert!((got - expected).abs() < 1e-12, "{got} {expected}");
        }
    }

    #[test]
    fn findings_that_are_no_tests_do_not_count_and_no_p_value_exceeds_one() {
        let seam = Finding::Seam(Seam { ratio: 30.0 });
        let mut findings = [misfit(0.7), seam.clone(), misfit(0.009)];
        adjust_p_values(&mut findings);
        assert_eq!(findings[0].p_value(), Some(PValue { raw: 0.7, adjusted: 0.7 }));
        assert_eq!(findings[1], seam);
        assert_eq!(findings[2].p_value(), Some(PValue { raw: 0.009, adjusted: 0.018 }));
        let mut findings = [0.9, 0.8].map(misfit);
        adjust_p_values(&mut findings);
        assert!(findings.iter().all(|finding| finding.p_value().unwrap().adjusted == 1.0));
    }

    #[test]
    fn a_bias_is_no_matter_of_the_residual() {
        let bias = Finding::Bias(Bias {
            p_value: PValue::new(0.02),
            parameter: Parameter::new(Matrix::Mass, 0, 0, 1).unwrap(),
            estimate: 1.0,
            unbiased: 1.1,
            standard_error: 0.03,
            reference: Reference::MaximumLikelihood,
        });
        let mut findings = [misfit(0.01), bias, misfit(0.5)];
        adjust_p_values(&mut findings);
        let adjusted = findings.map(|finding| finding.p_value().unwrap().adjusted);
        assert_eq!(adjusted, [0.02, 0.02, 0.5]);
    }
}
