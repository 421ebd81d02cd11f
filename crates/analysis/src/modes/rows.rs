//! Rows of modes and candidates of a test with forces, and notes on them.

use mechid_io::derivative;
use mechid_modal::{
    DrivingPoint, DropReason, DroppedCandidate, IdentifiedMode, MassNormalised, ModalEstimate,
    OutputDelay,
    indicators::{self, Indicator},
};
use nalgebra::{Complex, DMatrix, DVector};

use super::sources::Output;
use super::summary::{DroppedRow, ModalModeRow};
use crate::identify::rows::Uncertain;
use crate::limits::{LISTED_DELAYS, NOTED_UNMEASURED};
use crate::modal::{ShapeEntry, ShapedMode};
use crate::text::{compact, significant};

/// Modal mass of a mode, in kg, and its mass-normalised shape; the shape does not exist if the mass
/// is not positive.
pub(super) struct Scaling {
    mass: mechid_modal::Uncertain,
    shape: Option<MassNormalised>,
}

/// Returns the row of a mode with its modal mass.
pub(super) fn row(
    mode: &IdentifiedMode,
    collinearity: Option<Indicator>,
    scaling: Option<Scaling>,
) -> ModalModeRow {
    let part = |z: &Complex<f64>| [z.re, z.im];
    let entries = |values: &[Complex<f64>], errors: &[Complex<f64>], scale: Complex<f64>| {
        let entry = |(value, error): (&Complex<f64>, &Complex<f64>)| ShapeEntry {
            value: part(&(value / scale)),
            standard_error: Some(part(&(error / scale.norm()))),
        };
        values.iter().zip(errors).map(entry).collect::<Vec<_>>()
    };
    let (mass, normalised) = scaling.map(|one| (one.mass, one.shape)).unzip();
    let [at_responses, at_forces] = normalised.flatten().map_or_else(Default::default, |shape| {
        let entry =
            |(value, error)| ShapeEntry { value: part(&value), standard_error: Some(part(&error)) };
        [shape.outputs, shape.inputs].map(|entries| entries.into_iter().map(entry).collect())
    });
    let largest = mode.participation.iter().copied().max_by(|a, b| a.norm().total_cmp(&b.norm()));
    let scale = largest.filter(|z| z.norm() > 0.0).unwrap_or(Complex::from(1.0));
    let values = [
        uncertain(&mode.natural_frequency_hz),
        damped_frequency(mode),
        uncertain(&mode.damping_ratio),
    ];
    let shape = entries(&mode.shape, &mode.shape_standard_error, Complex::from(1.0));
    ModalModeRow {
        mode: ShapedMode::from_pole([mode.pole.re, mode.pole.im], values, shape),
        participation: entries(&mode.participation, &mode.participation_standard_error, scale),
        phase_collinearity: indicators::mpc(&vector(&mode.shape)),
        phase_collinearity_standard_error: collinearity.map(|mpc| mpc.standard_error),
        driven_share: mode.driven_share,
        modal_mass: mass.map(|mass| mass.value),
        modal_mass_standard_error: mass.map(|mass| mass.standard_error),
        mass_normalised_shape: at_responses,
        mass_normalised_shape_at_forces: at_forces,
        decay_times: None,
    }
}

/// Returns the modal mass of a mode by the driving point that determines it best, and the shape
/// that this mass normalises; `None` if the entries of its shape have several units.
pub(super) fn scaling(
    estimate: &ModalEstimate,
    mode: usize,
    outputs: &[Output],
    points: &[DrivingPoint],
) -> Option<Scaling> {
    (!has_several_quantities(outputs)).then_some(())?;
    let mass = |point: &DrivingPoint| {
        let derivative = derivative(outputs[point.output].quantity?) as i32;
        Some((estimate.modal_mass(mode, *point, derivative)?, *point, derivative))
    };
    let relative_error = |mass: &mechid_modal::Uncertain| mass.standard_error / mass.value.abs();
    let masses = points.iter().filter_map(mass);
    let (mass, point, derivative) =
        masses.min_by(|a, b| relative_error(&a.0).total_cmp(&relative_error(&b.0)))?;
    let shape = estimate.mass_normalised_shape(mode, point, derivative);
    Some(Scaling { mass, shape })
}

fn has_several_quantities(outputs: &[Output]) -> bool {
    outputs.windows(2).any(|pair| pair[0].quantity != pair[1].quantity)
}

/// Returns f√(1 − ζ²), with its standard error to first order.
fn damped_frequency(mode: &IdentifiedMode) -> Uncertain {
    let (f, zeta) = (&mode.natural_frequency_hz, &mode.damping_ratio);
    let root = (1.0 - zeta.value * zeta.value).sqrt();
    let slope = -f.value * zeta.value / root;
    let variance = (root * f.standard_error).powi(2)
        + (slope * zeta.standard_error).powi(2)
        + 2.0 * root * slope * mode.frequency_damping_covariance;
    normal(root * f.value, variance.max(0.0).sqrt())
}

/// Returns a value with the interval of the normal distribution instead of Student's: the noise
/// level is averaged over many lines, so its uncertainty is negligible.
fn uncertain(value: &mechid_modal::Uncertain) -> Uncertain {
    normal(value.value, value.standard_error)
}

fn normal(value: f64, standard_error: f64) -> Uncertain {
    Uncertain::new(value, standard_error, normal_interval(value, standard_error))
}

/// Returns the 95 % interval of a normally distributed value, in its unit.
pub(crate) fn normal_interval(value: f64, standard_error: f64) -> [f64; 2] {
    let half = NORMAL_95 * standard_error;
    [value - half, value + half]
}

/// Half width of the 95 % interval of a normal distribution, in standard deviations.
const NORMAL_95: f64 = 1.959_963_984_540_054;

pub(super) fn mac(modes: &[IdentifiedMode]) -> Vec<Vec<f64>> {
    let shapes: Vec<_> = modes.iter().map(|mode| vector(&mode.shape)).collect();
    let row = |a| shapes.iter().map(|b| indicators::mac(a, b)).collect();
    shapes.iter().map(row).collect()
}

/// Returns the rows of a matrix.
pub(super) fn rows_of(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
}

fn vector(shape: &[Complex<f64>]) -> DVector<Complex<f64>> {
    DVector::from_column_slice(shape)
}

/// Returns the reason to drop a candidate that improves the fit by `gain` in −2 log L, if
/// `required` is necessary.
pub(super) fn small_gain(gain: f64, required: f64) -> String {
    let required = significant(required, 3);
    if gain > 0.0 {
        let gain = significant(gain, 3);
        format!("it improves the fit by {gain} (−2 log L), but {required} is needed")
    } else {
        format!("no fit with it is better; an improvement by {required} (−2 log L) is needed")
    }
}

pub(super) fn dropped(candidate: &DroppedCandidate) -> DroppedRow {
    let reason = match candidate.reason {
        DropReason::Insignificant { gain, required } => small_gain(gain, required),
        DropReason::UndeterminedDamping { standard_error } => format!(
            "its damping ratio is not significantly above zero (standard error {} %), like that of a sinusoid: the \
             candidate stays in the model",
            significant(100.0 * standard_error, 2)
        ),
        DropReason::Undetermined => {
            "the data do not determine its parameters separately from those of the other modes"
                .into()
        }
        DropReason::TooDamped => {
            "its damping is too high for a mode: it represents modes outside of the band".into()
        }
        DropReason::OutsideBand => "its frequency left the band".into(),
        DropReason::Twin { other_hz } => format!(
            "its shape is that of the mode at {} Hz, and its frequency is within the width of that mode",
            significant(other_hz, 5)
        ),
        DropReason::Undriven { ratio } => format!(
            "unmeasured forces drive it {} times as strongly as the measured ones",
            significant(ratio, 2)
        ),
        DropReason::NotRequested => {
            "it is part of the model, but `modes` or `near_hz` asks for other modes".into()
        }
        _ => "it is not a mode of the record".into(),
    };
    let DroppedCandidate { frequency_hz, damping_ratio, .. } = *candidate;
    DroppedRow { frequency_hz, damping_ratio, reason }
}

/// Returns the note on delays that are part of the model: a list or, if there are many, their
/// range.
fn delay_note(delays: &[OutputDelay], outputs: &[Output]) -> Option<String> {
    let words = |delay: &OutputDelay| {
        let direction = if delay.seconds > 0.0 { "late" } else { "early" };
        let value = significant(1e3 * delay.seconds.abs(), 3);
        format!("{value} ± {} ms {direction}", significant(1e3 * delay.standard_error, 2))
    };
    let by_size = |a: &&OutputDelay, b: &&OutputDelay| a.seconds.total_cmp(&b.seconds);
    let least = delays.iter().min_by(by_size)?;
    let most = delays.iter().max_by(by_size)?;
    let list = if delays.len() > LISTED_DELAYS {
        format!("from {} to {}", words(least), words(most))
    } else {
        let named = delays.iter().zip(outputs);
        let one =
            |(delay, output): (&OutputDelay, &Output)| format!("{} {}", output.name, words(delay));
        named.map(one).collect::<Vec<_>>().join(", ")
    };
    Some(format!(
        "delays between forces and responses are part of the model (filters, or a scanning \
         converter): {list}; ± is one standard error"
    ))
}

pub(super) fn notes(estimate: &ModalEstimate, outputs: &[Output]) -> Vec<String> {
    let mut notes: Vec<String> = delay_note(estimate.delays(), outputs).into_iter().collect();
    if has_several_quantities(outputs) {
        notes.push(
            "the responses have different quantities: each entry of a shape is in the unit of its response, and \
             modal masses are left out"
                .into(),
        );
    }
    for (number, mode) in (1..).zip(estimate.modes()) {
        let hz = significant(mode.natural_frequency_hz.value, 4);
        if mode.near_edge {
            notes.push(format!(
                "mode {number} ({hz} Hz) is at an edge of the band: if the forces also excite frequencies \
                 beyond this edge, choose a wider band (`band_hz`)"
            ));
        }
        if mode.gain < estimate.required_gain() {
            notes.push(format!(
                "mode {number} ({hz} Hz) is not significant, and may be noise: it improves the fit by \
                 {} (−2 log L), but {} is needed; it is listed because it was asked for (`modes`, `near_hz`)",
                significant(mode.gain, 3),
                significant(estimate.required_gain(), 3)
            ));
        }
        if let Some(share) = mode.driven_share.filter(|share| 1.0 - share > NOTED_UNMEASURED) {
            notes.push(format!(
                "{} % of the motion of mode {number} ({hz} Hz) is caused by forces that were not \
                 measured; its intervals include this effect",
                compact(100.0 * (1.0 - share), 2)
            ));
        }
    }
    notes
}
