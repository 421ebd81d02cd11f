//! Test of driving points: for force and response at one point, every modal mass is positive.

use mechid_io::derivative;
use mechid_modal::{DrivingPoint, IdentifiedMode};
use nalgebra::Complex;
use statrs::distribution::{ContinuousCDF, Normal};

use super::super::sources::Output;
use super::tested::Tested;

/// Returns, for each driving point, the test of positive modal masses: 2jω_d times the residue of
/// the displacement in the direction of the force has a positive real part.
///
/// The p-value is the smallest one of all modes, multiplied by the number of modes (Bonferroni).
///
/// # Source
/// Ewins, *Modal Testing*, 2nd ed. (2000), sections 3.6 and 4.2 (residues at a driving point have
/// one sign).
pub(super) fn tests(
    modes: &[IdentifiedMode],
    inputs: &[String],
    outputs: &[Output],
    driving_points: &[DrivingPoint],
) -> Vec<Tested> {
    let test = |point: &DrivingPoint| {
        let DrivingPoint { output, input, .. } = *point;
        let power = derivative(outputs[output].quantity?) as i32;
        let worst = (1..).zip(modes).map(|(number, mode)| {
            let turned = turned_residue(mode, output, input, power);
            let deviation = relative_error(mode, output, input) * turned.norm() / 2f64.sqrt();
            (number, point.sign() * turned.re / deviation)
        });
        let (number, ratio) = worst.min_by(|a, b| a.1.total_cmp(&b.1))?;
        let p_value = (modes.len() as f64 * Normal::standard().cdf(ratio)).min(1.0);
        let hz = modes[number - 1usize].natural_frequency_hz.value;
        Some(Tested {
            code: "driving_point",
            p_value,
            passes: format!(
                "no modal mass at {} under force {} is negative",
                outputs[output].name, inputs[input]
            ),
            fails: format!(
                "mode {number} ({hz:.4} Hz) has a negative modal mass at {} under force {}: one of the \
                 two channels has the wrong sign, or the two are not at the same point",
                outputs[output].name, inputs[input]
            ),
        })
    };
    driving_points.iter().filter_map(test).collect()
}

/// Returns the product of 2jω_d and the residue of the displacement. It is real and positive at a
/// driving point if the damping is proportional.
pub(super) fn turned_residue(
    mode: &IdentifiedMode,
    output: usize,
    input: usize,
    power: i32,
) -> Complex<f64> {
    receptance_residue(mode, output, input, power) * Complex::new(0.0, 2.0 * mode.pole.im)
}

/// Returns the residue of the displacement if the output measures its `power`-th derivative.
pub(super) fn receptance_residue(
    mode: &IdentifiedMode,
    output: usize,
    input: usize,
    power: i32,
) -> Complex<f64> {
    mode.residue(output, input) / mode.pole.powi(power)
}

/// Returns the relative standard error of a residue for independent errors of shape and
/// participation.
pub(super) fn relative_error(mode: &IdentifiedMode, output: usize, input: usize) -> f64 {
    let relative = |value: Complex<f64>, error: Complex<f64>| error.norm() / value.norm();
    relative(mode.shape[output], mode.shape_standard_error[output])
        .hypot(relative(mode.participation[input], mode.participation_standard_error[input]))
}
