//! Tests of channels without a share in any mode: a shaker that is off, a sensor that is not
//! connected.

use mechid_modal::IdentifiedMode;
use nalgebra::Complex;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::super::summary::{ModalCheck, ModalModeRow};
use crate::limits::MODAL_SIGNIFICANCE;
use crate::text::significant;

/// Returns, for each of several forces, the check that this force excites at least one mode. The
/// null hypothesis is that the participations of the force in all modes are zero.
///
/// # Source
/// Wald's test of the participations, with two degrees of freedom for each mode.
pub(super) fn force_checks(modes: &[IdentifiedMode], inputs: &[String]) -> Vec<ModalCheck> {
    let check = |(input, name): (usize, &String)| {
        let squares = |mode: &IdentifiedMode| {
            let value = mode.participation[input];
            let error: Complex<f64> = mode.participation_standard_error[input];
            (value.re / error.re).powi(2) + (value.im / error.im).powi(2)
        };
        let p_value = zero_p_value(modes.iter().map(squares))?;
        let words = [
            format!("force {name} drives a mode"),
            format!(
                "force {name} drives no mode significantly (p = {}): is its shaker on, and does the shaker have \
                 its own signal? If no independent force acts there, leave it out of `force`",
                significant(p_value, 2)
            ),
        ];
        Some(row("idle_force", p_value, words))
    };
    several(inputs).filter_map(check).collect()
}

/// Returns, for each of several responses, the check that this response moves in at least one mode.
/// The null hypothesis is that its entries in all mode shapes with standard errors are zero.
///
/// # Source
/// Wald's test of the shapes, with two degrees of freedom for each mode.
pub(in crate::modes) fn response_checks(
    modes: &[ModalModeRow],
    outputs: &[String],
) -> Vec<ModalCheck> {
    let check = |(output, name): (usize, &String)| {
        let squares = modes.iter().filter_map(|mode| {
            let entry = mode.mode.shape.get(output)?;
            let pairs = entry.value.iter().zip(entry.standard_error?);
            Some(pairs.map(|(value, error)| (value / error).powi(2)).sum())
        });
        let p_value = zero_p_value(squares)?;
        let words = [
            format!("{name} moves in a mode"),
            format!(
                "{name} does not move significantly in any mode (p = {}): is the sensor connected? If the sensor \
                 measures no motion, leave its column out",
                significant(p_value, 2)
            ),
        ];
        Some(row("idle_response", p_value, words))
    };
    several(outputs).filter_map(check).collect()
}

/// Returns the indices and names of the channels if there are several; empty for a single channel,
/// because the significance tests of the modes already show whether this channel takes part in a
/// mode.
fn several(names: &[String]) -> impl Iterator<Item = (usize, &String)> {
    names.iter().enumerate().filter(|_| names.len() > 1)
}

/// Returns the probability that errors alone give a total at least as large as that of `squares`.
/// Each value of `squares` belongs to one mode: the sum of two squares, of the real and of the
/// imaginary part of a number, each part divided by its standard error. `None` without a mode.
fn zero_p_value(squares: impl Iterator<Item = f64>) -> Option<f64> {
    let (modes, sum) = squares.fold((0, 0.0), |(count, sum), square| (count + 1, sum + square));
    let law = ChiSquared::new(2.0 * f64::from(modes)).ok()?;
    // The entry to which the shape is scaled is 1, with standard error 0: the sum is then infinite
    // (1/0) or NaN (0/0 of its imaginary part), and the p-value is 0.
    Some(if sum.is_nan() { 0.0 } else { law.sf(sum.min(f64::MAX)) })
}

fn row(code: &'static str, p_value: f64, [acts, is_idle]: [String; 2]) -> ModalCheck {
    let passed = p_value < MODAL_SIGNIFICANCE;
    ModalCheck { code, passed, value: p_value, text: if passed { acts } else { is_idle } }
}
