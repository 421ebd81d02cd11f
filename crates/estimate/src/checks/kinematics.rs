//! Whether displacement, velocity and acceleration are those of one motion.

use mechid_model::ResponseQuantity;
use mechid_signal::Record;

use super::{Check, Subject, Verdict, six_digits};
use crate::EstimateError;

/// A gain beyond this factor of 1 is no error of sensors, nor of the rule between two samples, which
/// reaches it at four tenths of the sampling rate.
const FACTOR: f64 = 3.0;

/// And one farther from 1 than so many of its standard errors no noise.
const ERRORS: f64 = 4.0;

/// Every channel of which one motion does not change as another says: by units (mm/s for m/s), swapped
/// columns or a sign. Each pair of displacement (m), velocity (m/s) and acceleration (m/s²) that is
/// measured is looked at, in that order; the value is the change of the one over what the other makes
/// of it, 1 if they belong together.
///
/// # Errors
/// [`EstimateError::Signal`] or [`EstimateError::Size`] if the records do not belong together.
///
/// # Source
/// Ours: regression of x(k+1) − x(k) on the trapezoidal rule for ẋ, and of x(k+1) − 2x(k) + x(k−1) on
/// ẍ(k)Δt².
pub fn kinematics(motions: &[(ResponseQuantity, &Record)]) -> Result<Vec<Check>, EstimateError> {
    let of = |kind: ResponseQuantity| {
        motions.iter().find(|motion| motion.0 == kind).map(|motion| motion.1)
    };
    let kinds = [
        ResponseQuantity::Displacement,
        ResponseQuantity::Velocity,
        ResponseQuantity::Acceleration,
    ];
    let [x, v, a] = kinds.map(of);
    let pairs = match (x, v, a) {
        (Some(x), None, Some(a)) => vec![(kinds[0], x, kinds[2], a)],
        _ => {
            let own = |from: usize, low: Option<_>, high: Option<_>| {
                low.zip(high).map(|(low, high)| (kinds[from], low, kinds[from + 1], high))
            };
            own(0, x, v).into_iter().chain(own(1, v, a)).collect()
        }
    };
    let mut checks = Vec::new();
    for (kind, low, other, high) in pairs {
        low.check_same_sampling(high)?;
        crate::least_squares::size("channels of the motion", low.channels(), high.channels())?;
        let twice =
            other == ResponseQuantity::Acceleration && kind == ResponseQuantity::Displacement;
        for channel in 0..low.channels() {
            let [low, high] = [low, high].map(|record| record.channel(channel));
            let gain = gain(low, high, motions[0].1.sampling().dt(), twice);
            checks.extend(gain.and_then(|gain| gain.check(kind, other, channel + 1)));
        }
    }
    Ok(checks)
}

/// What a motion changes by over what another says.
struct Gain {
    value: f64,
    standard_error: f64,
}

/// Nothing of channels that are still, or too short.
fn gain(low: &[f64], high: &[f64], dt: f64, twice: bool) -> Option<Gain> {
    let pairs: Vec<[f64; 2]> = match twice {
        false => {
            let steps = low.windows(2).zip(high.windows(2));
            steps.map(|(x, v)| [x[1] - x[0], 0.5 * dt * (v[0] + v[1])]).collect()
        }
        true => {
            let steps = low.windows(3).zip(high.iter().skip(1));
            steps.map(|(x, a)| [x[2] - 2.0 * x[1] + x[0], dt * dt * a]).collect()
        }
    };
    let count = pairs.len() as f64;
    let mean = |at: usize| pairs.iter().map(|pair| pair[at]).sum::<f64>() / count;
    let means = [mean(0), mean(1)];
    let centred = pairs.iter().map(|pair| [pair[0] - means[0], pair[1] - means[1]]);
    let (mut own, mut both, mut said) = (0.0, 0.0, 0.0);
    for [change, by] in centred {
        own += change * change;
        both += change * by;
        said += by * by;
    }
    if count < 3.0 || said == 0.0 || own == 0.0 {
        return None;
    }
    let value = both / said;
    let left = (own - value * both).max(0.0) / (count - 2.0);
    Some(Gain { value, standard_error: (left / said).sqrt() })
}

impl Gain {
    fn check(
        self,
        kind: ResponseQuantity,
        other: ResponseQuantity,
        channel: usize,
    ) -> Option<Check> {
        let near = (1.0 / FACTOR..=FACTOR).contains(&self.value);
        if near || (self.value - 1.0).abs() <= ERRORS * self.standard_error {
            return None;
        }
        let text = format!(
            "{kind} {channel} changes by {} times what {other} {channel} says: their units, columns or \
             signs do not belong together",
            six_digits(self.value)
        );
        let (subject, verdict) = (Subject::Kinematics, Verdict::Bad);
        Some(Check { subject, verdict, value: self.value, text })
    }
}
