//! Nonlinearity in whole periods.

use mechid_estimate::{EstimateError, Unknowns};
use mechid_model::ResponseQuantity;
use mechid_nonlinear::{Level, distortion};
use mechid_signal::Record;
use mechid_spectra::Lines;

use super::finding::{Finding, PValue};
use super::thresholds::DISTORTION_EXPLAINED;

/// Looks for the nonlinear term that explains most of what a linear model leaves of whole periods of force (N) and
/// response of one or several experiments on the lines of a band ([`Finding::Distortion`]); `None` unless it explains
/// half of that, and noise does not.
///
/// # Errors
/// The errors of [`distortion`].
///
/// # Source
/// The source of [`distortion`].
pub fn distortion_of_periods(
    band: &Lines,
    experiments: &[[&Record; 2]],
    measured: ResponseQuantity,
    unknowns: &Unknowns,
) -> Result<Option<Finding>, EstimateError> {
    let found = distortion(band, experiments, measured, unknowns)?;
    let [even_db, odd_db] = [found.even, found.odd]
        .map(|level: Option<Level>| level.map(|level| level.db).filter(|db| db.is_finite()));
    let kind = found.kind().filter(|kind| kind.explained >= DISTORTION_EXPLAINED);
    Ok(kind.map(|kind| Finding::Distortion {
        term: kind.to_string(),
        explained: kind.explained,
        even_db,
        odd_db,
        p_value: PValue::of(kind.p_value),
    }))
}
