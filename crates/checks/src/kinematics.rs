//! Consistency of displacement, velocity and acceleration.

use std::fmt::{self, Formatter};

use mechid_estimate::EstimateError;
use mechid_model::ResponseQuantity;
use mechid_numerics::check_size;
use mechid_signal::Record;

use super::digits::six_digits;
use super::finding::{Check, Finding, Names};
use super::limits::KINEMATIC_GAIN;
use super::limits::STANDARD_ERRORS;
use super::{Subject, Verdict};

/// Finds the channels in which one response quantity does not change as another quantity predicts
/// ([`Finding::Kinematics`]): a wrong unit (mm/s for m/s), interchanged columns or a wrong sign.
/// Checks each pair of displacement (m), velocity (m/s) and acceleration (m/s²) that is measured,
/// in that order.
///
/// # Errors
/// [`EstimateError::Signal`] or [`NumericsError::Size`](mechid_numerics::NumericsError::Size) if
/// the records do not match.
///
/// # Source
/// Ours: regression of x(k+1) − x(k) on the trapezoidal rule for ẋ, and of x(k+1) − 2x(k) + x(k−1)
/// on ẍ(k)Δt².
pub fn kinematics(
    responses: &[(ResponseQuantity, &Record)],
) -> Result<Vec<Finding>, EstimateError> {
    let of = |kind: ResponseQuantity| {
        responses.iter().find(|response| response.0 == kind).map(|response| response.1)
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
            let pair = |from: usize, low: Option<_>, high: Option<_>| {
                low.zip(high).map(|(low, high)| (kinds[from], low, kinds[from + 1], high))
            };
            pair(0, x, v).into_iter().chain(pair(1, v, a)).collect()
        }
    };
    let mut findings = Vec::new();
    for (quantity, low, derivative, high) in pairs {
        low.check_same_sampling(high)?;
        check_size("channels of the response", low.channels(), high.channels())?;
        let twice = derivative == ResponseQuantity::Acceleration
            && quantity == ResponseQuantity::Displacement;
        for dof in 0..low.channels() {
            let [low, high] = [low, high].map(|record| record.channel(dof));
            let gain = gain(low, high, responses[0].1.sampling().dt(), twice);
            findings.extend(gain.filter(Gain::is_wrong).map(|gain| {
                Finding::Kinematics(Kinematics { dof, quantity, derivative, gain: gain.value })
            }));
        }
    }
    Ok(findings)
}

/// Ratio of the change of a quantity to the change that another quantity predicts.
struct Gain {
    value: f64,
    standard_error: f64,
}

/// Returns the gain of a channel; `None` if one of the two channels is constant, or if they are too
/// short.
fn gain(low: &[f64], high: &[f64], dt: f64, twice: bool) -> Option<Gain> {
    let pairs: Vec<[f64; 2]> = if twice {
        let steps = low.windows(3).zip(high.iter().skip(1));
        steps.map(|(x, a)| [x[2] - 2.0 * x[1] + x[0], dt * dt * a]).collect()
    } else {
        let steps = low.windows(2).zip(high.windows(2));
        steps.map(|(x, v)| [x[1] - x[0], 0.5 * dt * (v[0] + v[1])]).collect()
    };
    let count = pairs.len() as f64;
    let mean = |at: usize| pairs.iter().map(|pair| pair[at]).sum::<f64>() / count;
    let means = [mean(0), mean(1)];
    let centred = pairs.iter().map(|pair| [pair[0] - means[0], pair[1] - means[1]]);
    let (mut changes, mut products, mut predictions) = (0.0, 0.0, 0.0);
    for [change, predicted] in centred {
        changes += change * change;
        products += change * predicted;
        predictions += predicted * predicted;
    }
    if count < 3.0 || predictions == 0.0 || changes == 0.0 {
        return None;
    }
    let value = products / predictions;
    let residual = (changes - value * products).max(0.0) / (count - 2.0);
    Some(Gain { value, standard_error: (residual / predictions).sqrt() })
}

impl Gain {
    fn is_wrong(&self) -> bool {
        let near = (1.0 / KINEMATIC_GAIN..=KINEMATIC_GAIN).contains(&self.value);
        !near && (self.value - 1.0).abs() > STANDARD_ERRORS * self.standard_error
    }
}

/// Two measured response quantities of one degree of freedom that are not derivatives of each
/// other.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Kinematics {
    /// Degree of freedom.
    #[cfg_attr(feature = "serde", serde(serialize_with = "crate::serialised::from_one"))]
    pub dof: usize,
    /// Measured quantity with fewer time derivatives: displacement or velocity.
    pub quantity: ResponseQuantity,
    /// Measured quantity that is the first or second time derivative of `quantity`.
    pub derivative: ResponseQuantity,
    /// Ratio of the change of `quantity` to the change that `derivative` predicts; 1 if they agree
    /// (pure number).
    pub gain: f64,
}

impl Check for Kinematics {
    fn subject(&self) -> Subject {
        Subject::Kinematics
    }

    fn verdict(&self) -> Verdict {
        Verdict::Bad
    }

    fn value(&self) -> f64 {
        self.gain
    }

    fn sentence(&self, names: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} changes {} times as much as {} predicts: check the units, columns and signs of both channels",
            names.response(self.quantity, self.dof),
            six_digits(self.gain),
            names.response(self.derivative, self.dof)
        )
    }
}
