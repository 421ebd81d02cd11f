//! Forces that act during a part of a record: the noise comes from the part without force, and a
//! state of rest at the beginning is detected.

use mechid_model::SecondOrderSystem;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use crate::augmented::{Augmented, Tuned};
use crate::error::ForceError;
use crate::force_model::LowPass;
use crate::limits::{INTERMITTENT_BLOCKS, INTERMITTENT_LEVEL, QUIET_BLOCKS, REST_SAMPLES};
use crate::measurement::{Measurement, Start};
use crate::noise::channel_sizes;

/// Returns the range of samples in which the innovations under a stationary force model are
/// smallest; `None` if they may be this small by chance.
///
/// A stationary model has the same spectrum in the whole record. If the force is a pulse, whose
/// spectrum falls with frequency, the fit therefore mistakes noise in the quiet part for force.
///
/// # Source
/// Goldfeld & Quandt (1965), Journal of the American Statistical Association 60, 539–547 (the ratio
/// of the variances of two parts), with Bonferroni's bound for the number of ranges.
pub(crate) fn quiet(augmented: &Augmented, tuned: &Tuned) -> Option<std::ops::Range<usize>> {
    let energies = augmented.energies(tuned)?;
    let block = energies.len() / INTERMITTENT_BLOCKS;
    if block == 0 {
        return None;
    }
    let sums: Vec<f64> = energies
        .chunks_exact(block)
        .take(INTERMITTENT_BLOCKS)
        .map(|part| part.iter().sum::<f64>())
        .collect();
    let total: f64 = sums.iter().sum();
    let ranges = (0..INTERMITTENT_BLOCKS)
        .flat_map(|from| (from + QUIET_BLOCKS..=INTERMITTENT_BLOCKS).map(move |to| from..to))
        .filter(|range| range.len() < INTERMITTENT_BLOCKS);
    let mut count = 0.0;
    let mut best: Option<(f64, std::ops::Range<usize>)> = None;
    for range in ranges {
        count += 1.0;
        let inside: f64 = sums[range.clone()].iter().sum();
        let channels = augmented.channels();
        let [of_inside, of_outside] = [range.len(), INTERMITTENT_BLOCKS - range.len()]
            .map(|blocks| (blocks * block * channels) as f64);
        let ratio = ((total - inside) / of_outside) / (inside / of_inside);
        let p_value = FisherSnedecor::new(of_outside, of_inside).ok()?.sf(ratio);
        // If ranges have the same p-value, the longest one determines the noise best.
        if best.as_ref().is_none_or(|(least, longest)| {
            p_value < *least || (p_value == *least && range.len() > longest.len())
        }) {
            best = Some((p_value, range));
        }
    }
    let (p_value, range) = best?;
    (p_value * count < INTERMITTENT_LEVEL).then(|| range.start * block..range.end * block)
}

/// Returns whether the system is at rest at the first sample; `noise_std` has the standard
/// deviation of each channel in its unit (m, m/s or m/s²), if they are known.
///
/// The Bayesian information criterion decides whether the first samples of the record need an
/// initial displacement and velocity of every degree of freedom. The force model is the most likely
/// one for a start from rest.
///
/// # Errors
/// Those of [`kalman`](crate::kalman()).
///
/// # Source
/// Schwarz (1978), Annals of Statistics 6, 461–464.
pub fn starts_at_rest(
    system: &SecondOrderSystem,
    measured: &Measurement,
    forced: &[usize],
    noise_std: Option<&[f64]>,
) -> Result<bool, ForceError> {
    measured.check(system.dof(), forced)?;
    let samples = measured.sampling().len().min(REST_SAMPLES);
    let part = measured.part(0..samples)?;
    if part.record().data().iter().all(|y| *y == 0.0) {
        return Ok(true);
    }
    let scale = noise_std.map_or_else(|| channel_sizes(part.record()), <[f64]>::to_vec);
    let resting = Augmented::new(system, &part, forced, Start::FromRest, &scale)?;
    let tuned = resting.most_likely(noise_std.map(|_| 1.0))?;
    let process = LowPass::new(tuned.model.order)?;
    let at_rest = resting.likelihood(&tuned, &process)?;
    let moving = Augmented::new(system, &part, forced, Start::InMotion, &scale)?;
    let in_motion = moving.likelihood(&tuned, &process);
    let penalty = system.dof() as f64 * (samples as f64).ln();
    Ok(!in_motion.is_ok_and(|in_motion| in_motion - at_rest > penalty))
}
