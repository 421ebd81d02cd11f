//! Agreement of the modes in the two halves of a test.

use mechid_modal::compare::{Difference, ModePair, PairingRule, pair_modes};
use mechid_modal::{ModalEstimate, ModalSettings, refit_modes};
use mechid_numerics::Uncertain;

use super::sources::Recorded;
use super::summary::ModalCheck;
use crate::limits::MODAL_SIGNIFICANCE;
use crate::text::significant;

/// Comparison of the modes of the two halves of a test.
pub(super) struct Halves {
    /// Check of the agreement.
    pub check: ModalCheck,
    /// Factor on the standard errors of each mode: 1 if the halves agree.
    pub error_scales: Vec<f64>,
}

impl Halves {
    /// Fits the modes of an estimate to both halves and tests their differences; `None` if a half
    /// does not determine them.
    ///
    /// A linear structure that does not change has the same modes in both halves. Where they differ
    /// by more than their errors, the errors are multiplied by this excess.
    ///
    /// # Source
    /// Chow (1960), Econometrica 28, 591–605 (two parts of the data); Holm (1979), Scandinavian
    /// Journal of Statistics 6, 65–70; Birge (1932), Physical Review 40, 207–227.
    pub(super) fn new(
        recorded: &Recorded,
        band_hz: [f64; 2],
        estimate: &ModalEstimate,
        settings: &ModalSettings,
    ) -> Option<Self> {
        let [first, second] = recorded.halves().ok()?;
        let fitted =
            |half: &Recorded| refit_modes(&half.lines(band_hz).ok()?, estimate, settings).ok();
        let (first, second) = (fitted(&first)?, fitted(&second)?);
        let pairs = first.changes_to(&second).ok()?.pairs;
        let of_first =
            pair_modes(&estimate.compared_modes(), &first.compared_modes(), PairingRule::default())
                .ok()?;
        let mut error_scales = vec![1.0; estimate.modes().len()];
        for pair in &pairs {
            if let Some((mode, _)) = of_first.iter().find(|(_, at)| *at == pair.first) {
                error_scales[*mode] = excess(pair);
            }
        }
        let worst = pairs.iter().min_by(|a, b| p_value(a).total_cmp(&p_value(b)))?;
        let what = if recorded.parts.len() == 1 { "the record" } else { "the records" };
        let check = ModalCheck {
            code: "halves",
            passed: p_value(worst) >= MODAL_SIGNIFICANCE,
            value: p_value(worst),
            text: match p_value(worst) {
                p if p >= MODAL_SIGNIFICANCE => format!(
                    "the modes of the first and the second half of {what} agree (p = {})",
                    significant(p, 2)
                ),
                _ => difference(what, &first, &second, worst, &error_scales),
            },
        };
        Some(Self { check, error_scales })
    }
}

/// Returns the differences of frequency and damping ratio.
fn differences(pair: &ModePair) -> impl Iterator<Item = &Difference> {
    std::iter::once(&pair.natural_frequency_hz).chain(&pair.damping_ratio)
}

/// Returns the smallest p-value of the differences of a mode, adjusted for the number of tests.
fn p_value(pair: &ModePair) -> f64 {
    let of_values = differences(pair).filter_map(|difference| difference.adjusted_p_value);
    of_values.chain(pair.shape.map(|shape| shape.adjusted_p_value)).fold(1.0, f64::min)
}

/// Returns the largest significant difference of a mode in units of its standard error, or 1
/// without any.
fn excess(pair: &ModePair) -> f64 {
    let is_significant = |p_value: f64| p_value < MODAL_SIGNIFICANCE;
    let of_values = differences(pair)
        .filter(|difference| difference.adjusted_p_value.is_some_and(is_significant))
        .map(|difference| (difference.value / difference.standard_error).abs());
    let of_shape = pair
        .shape
        .filter(|shape| is_significant(shape.adjusted_p_value))
        .map(|shape| (shape.statistic / shape.degrees_of_freedom as f64).sqrt());
    of_values.chain(of_shape).fold(1.0, f64::max)
}

/// Returns the largest difference of a mode in words.
fn difference(
    what: &str,
    first: &ModalEstimate,
    second: &ModalEstimate,
    worst: &ModePair,
    error_scales: &[f64],
) -> String {
    let (one, two) = (&first.modes()[worst.first], &second.modes()[worst.second]);
    let uncertain = |value: Uncertain, factor: f64| {
        let [value, error] = [value.value, value.standard_error].map(|value| factor * value);
        format!("{} ± {}", significant(value, 6), significant(error, 2))
    };
    let differing = error_scales.iter().filter(|scale| **scale > 1.0).count();
    let scaled = match error_scales.iter().copied().fold(1.0, f64::max) {
        1.0 => String::new(),
        largest => format!(
            "; the standard errors of {differing} of {} modes are multiplied by up to {}",
            error_scales.len(),
            significant(largest, 3)
        ),
    };
    format!(
        "the first and the second half of {what} differ most in one mode: {} and {} Hz, damping \
         {} and {} %, MAC {} (p = {}): the structure changed or is nonlinear, or the model lacks \
         something{scaled}",
        uncertain(one.natural_frequency_hz, 1.0),
        uncertain(two.natural_frequency_hz, 1.0),
        uncertain(one.damping_ratio, 100.0),
        uncertain(two.damping_ratio, 100.0),
        significant(worst.mac.value, 4),
        significant(p_value(worst), 2)
    )
}
