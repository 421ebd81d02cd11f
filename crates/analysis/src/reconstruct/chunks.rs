//! The force of an open record that is not held.

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

/// Returns whether a method finds each sample of an open record from those beside it.
pub fn are_enough_for(method: Method, request: &Request, machine: &Machine) -> bool {
    // The phase that channels add is that of the whole record.
    let phase = machine.nonlinear.as_ref().is_some_and(|p| p.channels != ChannelPhase::default());
    let whole = request.periodic || request.band_hz.is_some();
    !phase && !whole && matches!(method, Method::Continuous | Method::Discretised)
}

/// Callback for a chunk, the force on it, and the range of its samples that count.
pub type Take<'a> =
    dyn FnMut(&Measurement, &IdentifiedForce, Range<usize>) -> Result<(), AnalysisError> + 'a;

/// Finds the force by such a method, one chunk after the other.
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
    // From sample to sample the force at a sample is the mean of what the steps before and after
    // it say: at the ends of a chunk one of them is missing, unless the record ends there too.
    let beside = usize::from(!with_acceleration);
    let advance = CHUNK_SAMPLES - 2 * beside;
    let (len, mut first) = (recorded.sampling.len(), 0);
    recorded.chunks(CHUNK_SAMPLES, advance, &mut |chunk| {
        let solved = equation(request, machine, chunk, method);
        let force = solved.map_err(|error| of_the_window(error, first))?;
        let samples = force.record().len();
        let start = if first == 0 { 0 } else { beside };
        let end = if first + samples == len { samples } else { samples - beside };
        first += advance;
        take(chunk, &force, start..end)
    })
}

/// The error with the sample that it names counted from the beginning of the window, not from that
/// of the chunk beginning with sample `first`.
fn of_the_window(error: AnalysisError, first: usize) -> AnalysisError {
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
