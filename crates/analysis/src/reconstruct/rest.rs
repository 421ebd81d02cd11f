//! Test whether an open record begins and ends at rest.

use std::f64::consts::TAU;

use mechid_force::Measurement;
use mechid_numerics::least_squares::LeastSquares;
use mechid_signal::measures;
use nalgebra::DMatrix;

use crate::limits::{REST_DIGITS, REST_PERIODS, REST_SAMPLES};
use crate::modes::{ModalSystem, free_motion_basis};

/// Returns whether a record begins and ends at rest: noise explains the responses at both ends at
/// least as well as free motion of the modes does. `false` also for a record that is too short to
/// decide.
///
/// The Bayesian information criterion decides, with one variance for all channels, each divided by
/// its RMS about its mean.
///
/// # Source
/// Schwarz (1978), Annals of Statistics 6, 461–464.
pub(super) fn begins_and_ends_at_rest(system: &ModalSystem, motion: &Measurement) -> bool {
    let (len, dt) = (motion.sampling().len(), motion.sampling().dt());
    let modes = system.model.terms.len();
    let size = |term: &mechid_modal::ModalTerm| term.pole[0].hypot(term.pole[1]);
    let slowest = system.model.terms.iter().map(size).fold(f64::INFINITY, f64::min);
    let periods = (REST_PERIODS * TAU / slowest / dt).ceil().min(REST_SAMPLES as f64) as usize;
    let enough = (8 * modes).div_ceil(motion.channels().len());
    let samples = periods.max(enough);
    if 4 * samples > len {
        return false;
    }
    [0, len - samples].iter().all(|first| rests(system, motion, *first, samples).unwrap_or(false))
}

/// Returns whether the given samples show no free motion of the modes; `None` if they are not
/// sufficient to decide.
fn rests(system: &ModalSystem, motion: &Measurement, first: usize, samples: usize) -> Option<bool> {
    let unknowns = 2 * system.model.terms.len();
    let mut equations = LeastSquares::new(unknowns, 1);
    let mut count = 0;
    for (at, channel) in motion.channels().iter().enumerate() {
        let whole = motion.record().channel(at);
        let part = centred(DMatrix::from_column_slice(samples, 1, &whole[first..first + samples]));
        let deviation = measures::rms(part.as_slice());
        let peak = whole.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
        if deviation <= REST_DIGITS * peak {
            continue;
        }
        let mut basis = DMatrix::zeros(samples, unknowns);
        for k in 0..samples {
            let row = free_motion_basis(system, channel.dof, k as f64 * motion.sampling().dt());
            basis.row_mut(k).copy_from_slice(&row);
        }
        let (rows, targets) = (centred(basis) / deviation, part / deviation);
        equations.push_rows(rows.as_view(), targets.as_view()).ok()?;
        count += samples;
    }
    if count == 0 {
        return Some(true);
    }
    let unexplained = equations.solve().ok()?.residual_nrmse[0].powi(2);
    let gain = -(count as f64) * unexplained.max(f64::MIN_POSITIVE).ln();
    Some(gain <= unknowns as f64 * (count as f64).ln())
}

/// Returns a matrix whose columns have a mean of zero.
fn centred(mut matrix: DMatrix<f64>) -> DMatrix<f64> {
    for mut column in matrix.column_iter_mut() {
        let mean = column.mean();
        column.add_scalar_mut(-mean);
    }
    matrix
}
