//! Reconstruction of the force of an open record in chunks.

use std::ops::Range;

use mechid_force::{ForceError, IdentifiedForce, Measurement};
use mechid_nonlinear::ChannelPhase;
use mechid_signal::SignalError;

use super::method::{Request, equation};
use super::motion::{Recorded, complete};
use super::options::Method;
use crate::AnalysisError;
use crate::machine::Machine;
use crate::measurement::CHUNK_SAMPLES;

/// Returns whether a method reconstructs each sample of an open record from neighbouring samples
/// only.
pub fn supports_chunks(method: Method, request: &Request, machine: &Machine) -> bool {
    // The correction of the channels' phase needs the whole record.
    let phase = machine.nonlinear.as_ref().is_some_and(|p| p.channels != ChannelPhase::default());
    let whole = request.periodic || request.band_hz.is_some();
    !phase && !whole && matches!(method, Method::Continuous | Method::Discretised)
}

/// Callback for a chunk of the record, the force that was reconstructed from this chunk, and the
/// range of samples of the chunk that are added to the result.
pub type Take<'a> =
    dyn FnMut(&Measurement, &IdentifiedForce, Range<usize>) -> Result<(), AnalysisError> + 'a;

/// Reconstructs the force of an open record, chunk by chunk, by a method that needs neighbouring
/// samples only.
pub fn find(
    request: &Request,
    machine: &Machine,
    recorded: &Recorded,
    method: Method,
    take: &mut Take<'_>,
) -> Result<(), AnalysisError> {
    let with_acceleration = method == Method::Continuous;
    if !complete(&recorded.channels, machine.system().dof(), with_acceleration) {
        return Err(AnalysisError::ForceMotions { with_acceleration });
    }
    // The force at a sample is the mean of the values from the step before and the step after. At
    // the ends of a chunk one of these steps is missing, so the chunks overlap.
    let overlap = usize::from(!with_acceleration);
    let advance = CHUNK_SAMPLES - 2 * overlap;
    let (len, mut first) = (recorded.sampling.len(), 0);
    recorded.chunks(CHUNK_SAMPLES, advance, &mut |chunk| {
        let solved = equation(request, machine, chunk, method);
        let force = solved.map_err(|error| in_window(error, first))?;
        let samples = force.record().len();
        let start = if first == 0 { 0 } else { overlap };
        let end = if first + samples == len { samples } else { samples - overlap };
        first += advance;
        take(chunk, &force, start..end)
    })
}

/// Returns the error with its sample counted from the beginning of the window rather than of the
/// chunk, whose first sample is `first`.
fn in_window(error: AnalysisError, first: usize) -> AnalysisError {
    match error {
        AnalysisError::Force(ForceError::Signal(SignalError::NotFinite {
            sample,
            channel,
            value,
        })) => {
            let sample = first + sample;
            ForceError::Signal(SignalError::NotFinite { sample, channel, value }).into()
        }
        other => other,
    }
}
