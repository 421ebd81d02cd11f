//! Reciprocity between driving points: the response at one point to a force at another point is the
//! same if the two points are exchanged.

use mechid_io::derivative;
use mechid_modal::{DrivingPoint, IdentifiedMode};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::super::sources::Output;
use super::driving_point::{receptance_residue, relative_error};
use super::tested::Tested;

/// Returns, for each pair of driving points, the test of reciprocity. In every mode, the residue of
/// the response at the first point to the force at the second point must be equal to the residue in
/// the opposite direction.
///
/// The test assumes that all errors of shapes and participations are independent. The errors of a
/// common scale are not independent; this makes the test conservative.
///
/// # Source
/// Ewins, *Modal Testing*, 2nd ed. (2000), section 2.7 (Maxwell's reciprocity of receptances).
pub(super) fn tests(
    modes: &[IdentifiedMode],
    inputs: &[String],
    outputs: &[Output],
    driving_points: &[DrivingPoint],
) -> Vec<Tested> {
    let mut tests = Vec::new();
    for (at, one) in driving_points.iter().enumerate() {
        for two in &driving_points[at + 1..] {
            tests.extend(test(modes, inputs, outputs, [one, two]));
        }
    }
    tests
}

fn test(
    modes: &[IdentifiedMode],
    inputs: &[String],
    outputs: &[Output],
    points: [&DrivingPoint; 2],
) -> Option<Tested> {
    let [(force, point), (other_force, other_point)] = points.map(|p| (p.input, p.output));
    let [sign, other_sign] = points.map(DrivingPoint::sign);
    let power = |output: usize| Some(derivative(outputs[output].quantity?) as i32);
    let (first_power, second_power) = (power(point)?, power(other_point)?);
    let (mut statistic, mut worst) = (0.0, (0.0, 0.0, 0.0));
    for mode in modes {
        let first = receptance_residue(mode, point, other_force, first_power) * sign;
        let second = receptance_residue(mode, other_point, force, second_power) * other_sign;
        let variance = (first.norm() * relative_error(mode, point, other_force)).powi(2)
            + (second.norm() * relative_error(mode, other_point, force)).powi(2);
        let square = 2.0 * (first - second).norm_sqr() / variance;
        statistic += square;
        if square > worst.0 {
            let ratio = (first - second).norm() / first.norm().max(second.norm());
            worst = (square, mode.natural_frequency_hz.value, ratio);
        }
    }
    let distribution = ChiSquared::new(2.0 * modes.len() as f64).ok()?;
    let (_, hz, ratio) = worst;
    Some(Tested {
        code: "reciprocity",
        p_value: distribution.sf(statistic.min(f64::MAX)),
        passes: format!(
            "{} per {} and {} per {} agree",
            outputs[point].name, inputs[other_force], outputs[other_point].name, inputs[force]
        ),
        fails: format!(
            "{} per {} and {} per {} differ, most in the mode at {hz:.4} Hz, by {:.2} %; possible causes: \
             a wrong calibration or place, other forces than the measured ones, or a structure that \
             is not reciprocal",
            outputs[point].name,
            inputs[other_force],
            outputs[other_point].name,
            inputs[force],
            100.0 * ratio
        ),
    })
}
