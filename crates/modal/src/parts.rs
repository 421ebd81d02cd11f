//! Comparison of the modes in two parts of the data.

use mechid_spectra::LineData;

use crate::compare::{Difference, ModePair, PairingRule, pair_modes};
use crate::estimate::ModalEstimate;
use crate::identify::{ModalSettings, refit_modes};
use crate::limits::DIFFERENCE_PROBABILITY;
use crate::{IdentifiedMode, ModalError};

/// Modes of an estimate that were fitted to two parts of its data.
#[derive(Debug, Clone)]
pub struct PartsComparison {
    /// Estimates from both parts.
    pub parts: [ModalEstimate; 2],
    /// Pairs of modes of both parts with the tests of their differences.
    pub pairs: Vec<ModePair>,
    /// Factor on the standard errors of each mode of the whole: 1 if the parts agree, otherwise the
    /// largest significant difference in units of its standard error; `None` for a mode that one of
    /// the parts alone does not determine.
    pub error_scales: Vec<Option<f64>>,
}

impl PartsComparison {
    /// Fits the modes of an estimate to two parts of its data and tests the differences of their
    /// natural frequencies and damping ratios.
    ///
    /// A linear structure that does not change has the same modes in both parts.
    ///
    /// # Errors
    /// [`ModalError`] if a part does not determine any mode.
    ///
    /// # Source
    /// Chow (1960), Econometrica 28, 591–605 (two parts of the data); Holm (1979), Scandinavian
    /// Journal of Statistics 6, 65–70 (number of tests); Birge (1932), Physical Review 40, 207–227
    /// (factor on the errors).
    pub fn new(
        whole: &ModalEstimate,
        parts: [&LineData; 2],
        settings: &ModalSettings,
    ) -> Result<Self, ModalError> {
        let [first, second] = parts.map(|data| refit_modes(data, whole, settings));
        let (first, second) = (first?, second?);
        // The parts have the outputs of the whole, so that shapes can be compared.
        let pairs = first.changes_to(&second).map_or(Vec::new(), |comparison| comparison.pairs);
        let of_whole =
            pair_modes(&whole.compared_modes(), &first.compared_modes(), PairingRule::default());
        let mut error_scales = vec![None; whole.modes().len()];
        for (mode, at) in of_whole.unwrap_or_default() {
            let pair = pairs.iter().find(|pair| pair.first == at);
            error_scales[mode] = pair.map(excess);
        }
        Ok(Self { parts: [first, second], pairs, error_scales })
    }

    /// Returns the mode that differs most, in both parts, with its pair; `None` if the parts have
    /// no common mode.
    pub fn largest_difference(&self) -> Option<([&IdentifiedMode; 2], &ModePair)> {
        let pair = self.pairs.iter().min_by(|a, b| p_value(a).total_cmp(&p_value(b)))?;
        let [first, second] = &self.parts;
        Some(([&first.modes()[pair.first], &second.modes()[pair.second]], pair))
    }

    /// Returns whether a mode differs between the parts by more than its errors allow.
    pub fn differ(&self) -> bool {
        self.p_value() < DIFFERENCE_PROBABILITY
    }

    /// Returns the smallest p-value of all differences, adjusted for the number of tests.
    pub fn p_value(&self) -> f64 {
        self.pairs.iter().map(p_value).fold(1.0, f64::min)
    }
}

/// Returns the differences of frequency and damping ratio.
fn differences(pair: &ModePair) -> impl Iterator<Item = &Difference> {
    std::iter::once(&pair.natural_frequency_hz).chain(&pair.damping_ratio)
}

/// Returns the smallest p-value of the differences of a mode, adjusted for the number of tests.
fn p_value(pair: &ModePair) -> f64 {
    differences(pair).filter_map(|difference| difference.adjusted_p_value).fold(1.0, f64::min)
}

/// Returns the largest significant difference of a mode in units of its standard error, or 1
/// without any.
fn excess(pair: &ModePair) -> f64 {
    let is_significant = |p_value: f64| p_value < DIFFERENCE_PROBABILITY;
    differences(pair)
        .filter(|difference| difference.adjusted_p_value.is_some_and(is_significant))
        .map(|difference| (difference.value / difference.standard_error).abs())
        .fold(1.0, f64::max)
}
