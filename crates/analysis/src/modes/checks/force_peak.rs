//! Check for a peak of the unmeasured forces of an ambient record.

use mechid_signal::message;

use crate::limits::CROWDED_MODES;
use crate::modes::summary::{ModalCheck, ModalModeRow};
use crate::text::significant;

/// Returns a failed check if several modes lie within the half-width of one mode, and this mode
/// lies within their half-widths. Forces with a spectral peak cause such modes, one for each
/// independent force.
pub(in crate::modes) fn force_peak_check(modes: &[ModalModeRow]) -> Option<ModalCheck> {
    let hz = |row: &ModalModeRow| row.mode.row.natural_frequency_hz.value;
    let half_width = |row: &ModalModeRow| row.mode.row.damping_ratio.value * hz(row);
    let crowd = |one: &ModalModeRow| -> Vec<f64> {
        let is_near = |other: &&ModalModeRow| {
            (hz(other) - hz(one)).abs() <= half_width(one).min(half_width(other))
        };
        modes.iter().filter(is_near).map(hz).collect()
    };
    let largest = modes.iter().map(crowd).max_by_key(Vec::len)?;
    if largest.len() < CROWDED_MODES {
        return None;
    }
    let listed = message::list(largest.iter().map(|hz| significant(*hz, 4)), ", ", largest.len());
    Some(ModalCheck {
        code: "force_peak",
        passed: false,
        value: largest.len() as f64,
        text: format!(
            "{} modes at {listed} Hz lie within one half-width ζf: few structures have modes this \
             close, but the spectrum of unmeasured forces may have a peak there; the damping ratios of \
             nearby modes may be too high",
            largest.len()
        ),
    })
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::identify::rows::Uncertain;
    use crate::modal::ShapedMode;

    fn row((hz, zeta): (f64, f64)) -> ModalModeRow {
        let exact = |value| Uncertain { value, standard_error: None, interval: None };
        let pole = [-zeta * TAU * hz, TAU * hz];
        ModalModeRow {
            mode: ShapedMode::from_pole(pole, [exact(hz), exact(hz), exact(zeta)], Vec::new()),
            participation: Vec::new(),
            phase_collinearity: 1.0,
            phase_collinearity_standard_error: None,
            driven_share: None,
            modal_mass: None,
            modal_mass_standard_error: None,
            mass_normalised_shape: Vec::new(),
            mass_normalised_shape_at_forces: Vec::new(),
            decay_times: None,
        }
    }

    #[test]
    fn three_modes_within_a_half_width_are_suspected_and_a_pair_is_not() {
        let check = |modes: &[(f64, f64)]| {
            force_peak_check(&modes.iter().copied().map(row).collect::<Vec<_>>())
        };
        let hump = [(1.6, 0.01), (2.97, 0.042), (2.99, 0.032), (3.0, 0.042), (3.68, 0.021)];
        let suspected = check(&hump).unwrap();
        assert!(!suspected.passed && suspected.value == 3.0);
        assert!(suspected.text.contains("2.970, 2.990, 3.000 Hz"), "{}", suspected.text);
        assert!(check(&[]).is_none());
        assert!(check(&[(3.0, 0.01), (3.01, 0.01), (3.2, 0.01), (9.0, 0.2)]).is_none());
        // Two lightly damped modes are within the half-width of a heavily damped mode, but this
        // mode is not within their half-widths: no peak of the forces is suspected.
        assert!(check(&[(2.7, 0.01), (3.0, 0.2), (3.2, 0.01)]).is_none());
    }
}
