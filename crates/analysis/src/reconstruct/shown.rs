//! The band in which responses without a displacement show a force.

use mechid_force::Channel;
use mechid_model::ResponseQuantity;

use super::method::{How, Request};
use crate::reconstruct::options::Method;
use crate::text::significant;

/// Returns a remark on the frequencies at which the response to a force is smaller than the noise.
///
/// A displacement shows even a constant force, so with a displacement there is no remark. The
/// method of dynamic stiffness cannot decide at which frequencies noise prevails. If lines or a
/// band are requested, the user has already chosen the frequencies.
pub fn remark(channels: &[Channel], request: &Request, how: &How) -> Option<String> {
    if channels.iter().any(|channel| channel.quantity == ResponseQuantity::Displacement) {
        return None;
    }
    let accelerated = channels.iter().all(|c| c.quantity == ResponseQuantity::Acceleration);
    let responses = if accelerated { "accelerations" } else { "velocities and accelerations" };
    if request.method == Method::FrequencyDomain
        && request.lines.is_none()
        && request.band_hz.is_none()
    {
        return Some(format!(
            "the {responses} are insensitive to slow forces: with this method their noise at low frequencies appears as a large force; state the `lines` or the `band_hz` of the force, use \
             `method` shrinkage, which finds where the noise dominates, or measure a displacement as well"
        ));
    }
    let hz = |value| significant(value, 4);
    match (how.seen_from_hz?, how.band_hz?, request.band_hz) {
        (seen, [low, high], None) if seen > 0.0 => Some(format!(
            "the {responses} are insensitive to slow forces, and below {} Hz their noise exceeds the \
             response to the force: force and standard error cover only {} to {} Hz; for the slower part \
             of the force measure a displacement as well",
            hz(seen),
            hz(low),
            hz(high)
        )),
        (seen, [low, _], Some(_)) if low < seen => Some(format!(
            "below {0} Hz the noise of the {responses} exceeds the response to the force, but the requested band begins at {1} Hz: the standard error treats the force below {0} Hz as unknown; begin the band at {0} \
             Hz, or measure a displacement as well",
            hz(seen),
            hz(low)
        )),
        _ => None,
    }
}
