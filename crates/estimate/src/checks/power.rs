//! Whether the force drives the machine, or the machine the force.

use mechid_model::ResponseQuantity;
use mechid_signal::{Record, Spectrum};

use super::{Check, Subject, Verdict};
use crate::EstimateError;

/// Power taken out of a machine, as a part of the apparent power, that is neither noise nor leakage.
const TAKEN_OUT: f64 = 0.05;

/// Of so many lines with the most power so many parts take power out: no seven of them do by chance.
const STRONGEST: usize = 32;
const PARTS: f64 = 0.9;

/// Lines weaker than this part of the strongest carry no force.
const CARRIED: f64 = 1e-3;

/// Whether force (N) and motion, one channel each per degree of freedom, mean that the forces take
/// power out of the machine, line by line and in the mean: then they are not what drives it. Nothing
/// if they put power in.
///
/// The value is the mean power Σ ½ Re(F V̄) over the apparent power Σ ½ |F| |V|, a pure number.
///
/// # Errors
/// [`EstimateError::Signal`] or [`EstimateError::Size`] if the records do not belong together.
///
/// # Source
/// Cremer, Heckl & Petersson, *Structure-Borne Sound*, 3rd ed. (2005), the section on mechanical
/// impedance and power; the limit is ours.
pub fn power(
    force: &Record,
    motion: &Record,
    measured: ResponseQuantity,
) -> Result<Option<Check>, EstimateError> {
    force.check_same_sampling(motion)?;
    crate::least_squares::size("channels of the motion", force.channels(), motion.channels())?;
    let (forces, motions) = (Spectrum::of(force), Spectrum::of(motion));
    let all = &forces;
    let carried = |dof: usize| {
        let line = move |n: usize| all.line(n, dof).norm();
        let strongest = (1..forces.len()).map(line).fold(0.0, f64::max);
        (1..forces.len()).filter(move |n| line(*n) > CARRIED * strongest)
    };
    let (mut lines, mut apparent) = (Vec::new(), 0.0);
    for dof in 0..force.channels() {
        for n in carried(dof) {
            let omega = forces.omega(n);
            let per_motion = ResponseQuantity::Velocity.per_displacement(omega)
                / measured.per_displacement(omega);
            let (f, v) = (forces.line(n, dof), per_motion * motions.line(n, dof));
            lines.push((f * v.conj()).re);
            apparent += f.norm() * v.norm();
        }
    }
    let value = if apparent > 0.0 { lines.iter().sum::<f64>() / apparent } else { 0.0 };
    lines.sort_by(|a, b| b.abs().total_cmp(&a.abs()));
    lines.truncate(STRONGEST);
    let out = lines.iter().filter(|power| **power < 0.0).count() as f64;
    if value >= -TAKEN_OUT || out < PARTS * lines.len() as f64 {
        return Ok(None);
    }
    let text = format!(
        "the forces take power out of the machine, {:.1} % of the apparent power, instead of driving \
         it: force and motion are swapped, one of them has the wrong sign or comes late, or something \
         else drives the machine",
        -100.0 * value
    );
    let (subject, verdict) = (Subject::Power, Verdict::Bad);
    Ok(Some(Check { subject, verdict, value, text }))
}
