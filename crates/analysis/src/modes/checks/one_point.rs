//! Check that the force acts at the same point in all records.

use mechid_modal::{ModalEstimate, ModalSettings, refit_modes};
use mechid_spectra::LineData;

use crate::modes::summary::ModalCheck;
use crate::text::significant;

/// Returns the check that the force acts at one point in all records. It fails if a separate force
/// in the first record explains the records far better. `apart` contains the lines of all records
/// with the force of the first record as a separate force. `None` if the fit to these lines fails.
///
/// # Source
/// Schwarz (1978), Annals of Statistics 6, 461–464 (Bayesian information criterion).
pub(in crate::modes) fn one_point_check(
    apart: &LineData,
    estimate: &ModalEstimate,
    settings: &ModalSettings,
) -> Option<ModalCheck> {
    let second = refit_modes(apart, estimate, settings).ok()?;
    let gain = 2.0 * (second.log_likelihood() - estimate.log_likelihood());
    let unknowns = 2 * estimate.modes().len()
        + apart.outputs().ncols() * estimate.residual_powers().forces.len();
    let required = unknowns as f64 * (2.0 * apart.len() as f64).ln();
    let passed = gain <= required;
    let text = if passed {
        "the force acts at the same point in all records".to_owned()
    } else {
        format!(
            "the records are explained far better if the force in the first record acts at another point than in \
             the other records (−2 log L falls by {}, and {} is needed): for a roving hammer, state the points \
             (`force_at`, one for each record)",
            significant(gain, 3),
            significant(required, 3)
        )
    };
    Some(ModalCheck { code: "one_point", passed, value: gain, text })
}
