//! Direction of the power between force and system.

use std::fmt::{self, Formatter};

use mechid_estimate::EstimateError;
use mechid_model::ResponseQuantity;
use mechid_numerics::check_size;
use mechid_signal::{Record, Spectrum};

use super::finding::{Check, Finding, Names};
use super::limits::POWER_TAKEN_OUT;
use super::limits::{FORCE_FLOOR, STRONGEST_FRACTION, STRONGEST_LINES};
use super::{Subject, Verdict};

/// Finds forces (N) that extract power from the system, line by line and in the mean
/// ([`Finding::PowerFlow`]): such forces do not drive the system. Force and response have one
/// channel per degree of freedom. `None` if the forces supply power.
///
/// The power is Σ ½ Re(F V̄), the apparent power Σ ½ |F| |V|.
///
/// # Errors
/// [`EstimateError::Signal`] or [`NumericsError::Size`](mechid_numerics::NumericsError::Size) if
/// the records do not match.
///
/// # Source
/// Cremer, Heckl & Petersson, *Structure-Borne Sound*, 3rd ed. (2005), the section on mechanical
/// impedance and power; the limit is ours.
pub fn power(
    force: &Record,
    response: &Record,
    measured: ResponseQuantity,
) -> Result<Option<Finding>, EstimateError> {
    force.check_same_sampling(response)?;
    check_size("channels of the response", force.channels(), response.channels())?;
    let (forces, responses) = (Spectrum::from_record(force), Spectrum::from_record(response));
    let force_spectrum = &forces;
    let carried = |dof: usize| {
        let line = move |n: usize| force_spectrum.line(n, dof).norm();
        let strongest = (1..forces.len()).map(line).fold(0.0, f64::max);
        (1..forces.len()).filter(move |n| line(*n) > FORCE_FLOOR * strongest)
    };
    let (mut lines, mut apparent) = (Vec::new(), 0.0);
    for dof in 0..force.channels() {
        for n in carried(dof) {
            let omega = forces.omega(n);
            let to_velocity = ResponseQuantity::Velocity.per_displacement(omega)
                / measured.per_displacement(omega);
            let (f, v) = (forces.line(n, dof), to_velocity * responses.line(n, dof));
            lines.push((f * v.conj()).re);
            apparent += f.norm() * v.norm();
        }
    }
    let fraction = if apparent > 0.0 { lines.iter().sum::<f64>() / apparent } else { 0.0 };
    lines.sort_by(|a, b| b.abs().total_cmp(&a.abs()));
    lines.truncate(STRONGEST_LINES);
    let out = lines.iter().filter(|power| **power < 0.0).count() as f64;
    let driven = fraction >= -POWER_TAKEN_OUT || out < STRONGEST_FRACTION * lines.len() as f64;
    Ok((!driven).then_some(Finding::PowerFlow(PowerFlow { fraction })))
}

/// Forces that extract power from the system.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct PowerFlow {
    /// Mean power into the system relative to the apparent power (pure number); negative, because
    /// the forces extract power.
    pub fraction: f64,
}

impl Check for PowerFlow {
    fn subject(&self) -> Subject {
        Subject::Power
    }

    fn verdict(&self) -> Verdict {
        Verdict::Bad
    }

    fn value(&self) -> f64 {
        self.fraction
    }

    fn sentence(&self, _: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "the forces extract power from the machine ({:.1} % of the apparent power): force and response are \
             interchanged, one of the two has the wrong sign or a delay, or something else drives the machine",
            -100.0 * self.fraction
        )
    }
}
