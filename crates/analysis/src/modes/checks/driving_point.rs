//! Driving points: a force and a response at one place, where every modal mass is positive.

use mechid_io::derivative;
use mechid_modal::IdentifiedMode;
use nalgebra::Complex;
use statrs::distribution::{ContinuousCDF, Normal};

use super::super::sources::Output;
use super::tested::Tested;

/// Returns, for each driving point, the test that the modal masses there are positive: the residue
/// of a displacement times 2jω_d has a positive real part.
///
/// The probability is that of the mode that contradicts most, times the number of modes.
///
/// # Source
/// Ewins, *Modal Testing*, 2nd ed. (2000), sections 3.6 and 4.2 (residues at a driving point have
/// one sign).
pub(super) fn tests(
    modes: &[IdentifiedMode],
    inputs: &[String],
    outputs: &[Output],
    driving_points: &[(usize, usize)],
) -> Vec<Tested> {
    let test = |&(input, output): &(usize, usize)| {
        let power = derivative(outputs[output].quantity?) as i32;
        let worst = (1..).zip(modes).map(|(number, mode)| {
            let turned = receptance_residue(mode, output, input, power)
                * Complex::new(0.0, 2.0 * mode.pole.im);
            let deviation = relative_error(mode, output, input) * turned.norm() / 2f64.sqrt();
            (number, turned.re / deviation)
        });
        let (number, ratio) = worst.min_by(|a, b| a.1.total_cmp(&b.1))?;
        let p_value = (modes.len() as f64 * Normal::standard().cdf(ratio)).min(1.0);
        let hz = modes[number - 1usize].natural_frequency_hz.value;
        Some(Tested {
            code: "driving_point",
            p_value,
            text: format!(
                "mode {number} ({hz:.4} Hz) has a negative modal mass at {} under force {}: one of the \
                 two channels has the wrong sign, or they are not at one place",
                outputs[output].name, inputs[input]
            ),
        })
    };
    driving_points.iter().filter_map(test).collect()
}

/// Residue of the displacement where the output measures its `power`-th derivative.
pub(super) fn receptance_residue(
    mode: &IdentifiedMode,
    output: usize,
    input: usize,
    power: i32,
) -> Complex<f64> {
    mode.residue(output, input) / mode.pole.powi(power)
}

/// Relative standard error of a residue, with errors of shape and participation taken as
/// independent.
pub(super) fn relative_error(mode: &IdentifiedMode, output: usize, input: usize) -> f64 {
    let of = |value: Complex<f64>, error: Complex<f64>| error.norm() / value.norm();
    of(mode.shape[output], mode.shape_standard_error[output])
        .hypot(of(mode.participation[input], mode.participation_standard_error[input]))
}
