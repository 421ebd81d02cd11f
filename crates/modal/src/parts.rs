//! Comparison of the modes in two parts of the data.

use mechid_signal::Record;
use mechid_spectra::LineData;

use crate::ModalError;
use crate::ambient::{AmbientError, AmbientEstimate, AmbientMode};
use crate::compare::{ComparedMode, Difference, ModePair, PairingRule, compare, pair_modes};
use crate::estimate::ModalEstimate;
use crate::identify::{ModalSettings, refit_modes};
use crate::limits::DIFFERENCE_PROBABILITY;

/// Modes of an estimate, fitted again to two parts of its data.
#[derive(Debug, Clone)]
pub struct PartsComparison {
    /// Modes of both parts.
    pub parts: [Vec<ComparedMode>; 2],
    /// Pairs of modes of both parts with the tests of their differences.
    pub pairs: Vec<ModePair>,
    /// Factor for the standard errors of each mode of the whole data. It is 1 if the parts agree;
    /// otherwise it is the largest significant difference, in units of its standard error. `None`
    /// if one of the parts alone does not determine the mode.
    pub error_scales: Vec<Option<f64>>,
}

impl PartsComparison {
    /// Fits the modes of an estimate to two parts of its data, and tests the differences in natural
    /// frequency and damping ratio between the parts.
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
        // A force that a constraint names may be missing in a part of a test, so parts are fitted
        // without constraints.
        let settings = ModalSettings { constraints: Vec::new(), ..settings.clone() };
        let [first, second] = parts.map(|data| refit_modes(data, whole, &settings));
        let parts = [first?.compared_modes(), second?.compared_modes()];
        Ok(Self::from_modes(&whole.compared_modes(), parts))
    }

    /// Fits the modes of an ambient record to two parts of the record, and tests the differences in
    /// natural frequency and damping ratio between the parts. Modes without an interval in one of
    /// the parts are not compared.
    ///
    /// # Errors
    /// [`AmbientError`] if a part is too short for the spectrum of the whole.
    ///
    /// # Source
    /// As [`PartsComparison::new`].
    pub fn of_ambient(whole: &AmbientEstimate, parts: [&Record; 2]) -> Result<Self, AmbientError> {
        let [first, second] = parts.map(|record| whole.refitted(record));
        let known = |modes: Vec<AmbientMode>| {
            let modes = modes.iter().filter(|mode| mode.has_interval());
            modes.map(AmbientMode::compared).collect()
        };
        let whole: Vec<ComparedMode> = whole.modes.iter().map(AmbientMode::compared).collect();
        Ok(Self::from_modes(&whole, [known(first?), known(second?)]))
    }

    /// Compares the modes of two parts with each other and with the modes of the whole data. All
    /// modes have the same outputs.
    fn from_modes(whole: &[ComparedMode], parts: [Vec<ComparedMode>; 2]) -> Self {
        let [first, second] = &parts;
        let rule = PairingRule::default();
        let pairs = compare(first, second, rule).map_or(Vec::new(), |comparison| comparison.pairs);
        let mut error_scales = vec![None; whole.len()];
        for (mode, at) in pair_modes(whole, first, rule).unwrap_or_default() {
            let pair = pairs.iter().find(|pair| pair.first == at);
            error_scales[mode] = pair.map(excess);
        }
        Self { parts, pairs, error_scales }
    }

    /// Returns the mode that differs most between the parts: its estimates in the first and in the
    /// second part, and the comparison of these estimates. `None` if the parts have no common mode.
    pub fn largest_difference(&self) -> Option<([&ComparedMode; 2], &ModePair)> {
        let pair = self.pairs.iter().min_by(|a, b| p_value(a).total_cmp(&p_value(b)))?;
        let [first, second] = &self.parts;
        Some(([&first[pair.first], &second[pair.second]], pair))
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

/// Returns the largest significant difference of a mode, in units of the standard error of the
/// difference; 1 if no difference is significant.
fn excess(pair: &ModePair) -> f64 {
    let is_significant = |p_value: f64| p_value < DIFFERENCE_PROBABILITY;
    differences(pair)
        .filter(|difference| difference.adjusted_p_value.is_some_and(is_significant))
        .map(|difference| (difference.value / difference.standard_error).abs())
        .fold(1.0, f64::max)
}
