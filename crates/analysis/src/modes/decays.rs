//! Common modes of several free decays.

use mechid_modal::free_decay::FreeDecayError;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::forced::Test;
use super::settings::ModesSettings;
use super::sources::{Recorded, all_responses};
use super::summary::RecordRow;
use super::{Modes, checks};
use crate::AnalysisError;
use crate::decay::{self, DecaySettings, decaying_part};
use crate::limits::MODAL_SIGNIFICANCE;
use crate::measurement::{Block, Measurement, check_distinct};

/// Identifies the modes of free decays, one in each record, from `from_s` to `to_s`, in s from the
/// first sample of the window; `None`: as for [`DecaySettings`].
pub(super) fn modes(
    measurements: &[Measurement],
    settings: &ModesSettings,
    [from_s, to_s]: [Option<f64>; 2],
) -> Result<Modes, AnalysisError> {
    let refused = ["force_at", "validate_percent", "real_shapes", "reciprocal"];
    settings.refuse("free decays", &refused)?;
    check_distinct(measurements)?;
    let how = DecaySettings { from_s, to_s, ..DecaySettings::default() };
    let cut = measurements.iter().map(|measurement| decaying_part(measurement, &how));
    let cut = cut.collect::<Result<Vec<_>, _>>()?;
    let first = cut.first().ok_or(AnalysisError::NoRecord)?;
    settings.check_channels(first.channels())?;
    let blocks: Vec<Block> = cut.iter().map(Measurement::whole_block).collect::<Result<_, _>>()?;
    if let Some(block) = blocks.iter().find(|block| grows(block)) {
        return Err(AnalysisError::NoDecay { file: block.file.clone() });
    }
    let recorded = Recorded::from_decays(&blocks, &first.source().names)?;
    settings.places.response_places(&recorded.outputs)?;
    let nyquist_hz = 0.5 / first.sampling().dt();
    let band_hz = settings.band_hz.unwrap_or([0.0, nyquist_hz]);
    let records = blocks.iter().map(RecordRow::from_block).collect();
    let checks = checks::channel_checks(&cut)?;
    let mut modes =
        Test { recorded, struck_apart: None, band_hz }.modes(records, checks, settings)?;
    for measurement in measurements {
        modes.summary.notes.extend(deviations(measurement, &how));
    }
    Ok(modes)
}

/// Returns a note if the analysis of a single decay shows that this decay is not a sum of decaying
/// oscillations; `None` if the decay cannot be analysed alone, for example because it is too short.
fn deviations(measurement: &Measurement, how: &DecaySettings) -> Option<String> {
    let remarks = match decay::fitted(measurement, how) {
        Ok(modes) => modes.summary().model_remarks(),
        Err(AnalysisError::FreeDecay(
            error @ (FreeDecayError::NoOscillation { .. }
            | FreeDecayError::ExcitedAgain { .. }
            | FreeDecayError::Grows { .. }),
        )) => vec![error.to_string()],
        Err(_) => Vec::new(),
    };
    (!remarks.is_empty()).then(|| {
        let file = measurement.name();
        format!("{file}, analysed alone (`decay`): {}", remarks.join("; "))
    })
}

/// Returns whether the responses have significantly more power in the second half of the record
/// than in the first half: more than noise of constant power explains. The powers of a channel in
/// both halves are divided by the power of this channel in the whole record.
///
/// # Source
/// Draper & Smith, *Applied Regression Analysis*, 3rd ed. (1998), chapter 1 (F test).
fn grows(block: &Block) -> bool {
    let Ok(responses) = all_responses(block) else { return false };
    let half = responses.len() / 2;
    let power = |channel: usize, first: usize| {
        let part = &responses.channel(channel)[first..first + half];
        part.iter().map(|x| x * x).sum::<f64>() / responses.column(channel).norm_squared()
    };
    let channels = 0..responses.channels();
    let [first, second] =
        [0, half].map(|first| channels.clone().map(|channel| power(channel, first)).sum::<f64>());
    let freedom = (half * responses.channels()) as f64;
    let law = FisherSnedecor::new(freedom, freedom);
    law.is_ok_and(|law| law.sf(second / first) < MODAL_SIGNIFICANCE)
}
