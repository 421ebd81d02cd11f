//! The force of an open record that is not held.

use std::ops::Range;

use mechid::force::{ForceError, IdentifiedForce, Measurement};
use mechid::signal::SignalError;

use super::machine::Machine;
use super::method::{Method, Request, equation};
use super::motion::{Recorded, complete};
use crate::commands::identify::measurement::STRETCH;
use crate::error::CliError;

/// Whether a method finds each sample of an open record from those beside it.
pub fn are_enough_for(method: Method, request: &Request) -> bool {
    !request.periodic && matches!(method, Method::Continuous | Method::Discretised)
}

/// What is done with a stretch, the force on it, and those of its samples that count.
pub type Take<'a> =
    dyn FnMut(&Measurement, &IdentifiedForce, Range<usize>) -> Result<(), CliError> + 'a;

/// Finds the force by such a method, one stretch after the other.
pub fn find(
    request: &Request,
    machine: &Machine,
    recorded: &Recorded,
    method: Method,
    take: &mut Take<'_>,
) -> Result<(), CliError> {
    let with_acceleration = method == Method::Continuous;
    if !complete(&recorded.channels, machine.system.dof(), with_acceleration) {
        return Err(CliError::ForceMotions { with_acceleration });
    }
    // From sample to sample the force at a sample is the mean of what the steps before and after
    // it say: at the ends of a stretch one of them is missing, unless the record ends there too.
    let beside = usize::from(!with_acceleration);
    let advance = STRETCH - 2 * beside;
    let (len, mut first) = (recorded.sampling.len(), 0);
    recorded.stretches(STRETCH, advance, &mut |stretch| {
        let found = equation(request, machine, stretch, method);
        let force = found.map_err(|error| of_the_window(error, first))?;
        let samples = force.record().len();
        let start = if first == 0 { 0 } else { beside };
        let end = if first + samples == len { samples } else { samples - beside };
        first += advance;
        take(stretch, &force, start..end)
    })
}

/// The error with the sample that it names counted from the beginning of the window, not from that
/// of the stretch beginning with sample `first`.
fn of_the_window(error: CliError, first: usize) -> CliError {
    match error {
        CliError::Force(ForceError::Signal(SignalError::NotFinite { sample, channel, value })) => {
            let sample = first + sample;
            ForceError::Signal(SignalError::NotFinite { sample, channel, value }).into()
        }
        other => other,
    }
}
