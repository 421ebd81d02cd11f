//! Remarks common to several kinds of fit.

use mechid_spectra::NoiseModel;

use crate::measurement::Block;

/// Returns the remark on weights from the scatter of `periods` periods; `shows` states whether the
/// scatter shows the noise.
pub(super) fn noise_remark(periods: usize, shows: bool, models: &[NoiseModel]) -> String {
    let mut distinct: Vec<String> = models.iter().map(NoiseModel::to_string).collect();
    distinct.dedup();
    let model = distinct.join("; ");
    match (periods, shows) {
        (0 | 1, _) => format!(
            "noise cannot be measured from one period: the noise was estimated from the residual, as noise on the \
             response alone; noise spectrum: {model}"
        ),
        (_, false) => format!(
            "the periods differ by rounding only: the noise was estimated from the residual, as noise on the \
             response alone; noise spectrum: {model}"
        ),
        (periods, true) => format!("noise spectrum, from {periods} periods: {model}"),
    }
}

/// Returns the remark on kinds of response that are not used.
pub fn one_motion_of(measured: &Block) -> Vec<String> {
    let unused = measured.responses().len() > 1;
    let kind = measured.response().1;
    Vec::from_iter(unused.then(|| format!("of the measured motions, only the {kind} was used")))
}
