//! Check whether the modes of an ambient record describe its spectrum.

use mechid_checks::PValue;
use mechid_modal::ambient::SpectrumMisfit;

use crate::modes::summary::ModalCheck;
use crate::text::significant;

/// Returns the check of the power of the record relative to the fitted spectrum, and the factor on
/// the standard errors: 1 unless the misfit is significant.
pub(in crate::modes) fn spectrum_check(misfit: &SpectrumMisfit) -> (ModalCheck, f64) {
    let p_value = PValue::new(misfit.p_value);
    let passed = !p_value.is_significant();
    let scale = if passed { 1.0 } else { misfit.error_scale() };
    let text = if passed {
        format!("the spectrum of modes and noise describes the record ({p_value})")
    } else {
        let [low, high] = misfit.worst_hz.map(|hz| significant(hz, 4));
        format!(
            "from {low} to {high} Hz the record has {} × the power of the spectrum of modes and noise \
             ({p_value}): a mode is missing, or the spectrum of the unmeasured forces is not flat; choose a band \
             around the modes (`band_hz`). Standard errors are multiplied by {}",
            significant(misfit.worst_ratio, 2),
            significant(scale, 3)
        )
    };
    (ModalCheck { code: "spectrum", passed, value: misfit.p_value, text }, scale)
}
