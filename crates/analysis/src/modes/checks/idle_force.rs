//! Test of unexcited inputs: a shaker that is off, or a force channel with noise alone.

use mechid_modal::IdentifiedMode;
use nalgebra::Complex;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::super::summary::ModalCheck;
use crate::limits::MODAL_SIGNIFICANCE;
use crate::text::significant;

/// Returns, for each of several forces, the check that it excites some mode, by a test of zero
/// participations in all modes.
///
/// # Source
/// Wald's test of the participations, with two degrees of freedom for each mode.
pub(super) fn checks(modes: &[IdentifiedMode], inputs: &[String]) -> Vec<ModalCheck> {
    if inputs.len() < 2 {
        return Vec::new();
    }
    let check = |(input, name): (usize, &String)| {
        let squares = |mode: &IdentifiedMode| {
            let value = mode.participation[input];
            let error: Complex<f64> = mode.participation_standard_error[input];
            (value.re / error.re).powi(2) + (value.im / error.im).powi(2)
        };
        let statistic: f64 = modes.iter().map(squares).sum();
        let distribution = ChiSquared::new(2.0 * modes.len() as f64).ok()?;
        let p_value = distribution.sf(statistic.min(f64::MAX));
        Some(ModalCheck {
            code: "idle_force",
            passed: p_value < MODAL_SIGNIFICANCE,
            value: p_value,
            text: format!(
                "force {name} drives no mode beyond its errors (p = {}): is its shaker on and \
                 connected? If no force acts there, leave it out of `force`",
                significant(p_value, 2)
            ),
        })
    };
    inputs.iter().enumerate().filter_map(check).collect()
}
