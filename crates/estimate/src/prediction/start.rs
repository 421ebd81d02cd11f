//! Where a machine started, from how it moved.

use mechid_model::{InitialState, Response, SecondOrderSystem};
use mechid_signal::Record;
use nalgebra::{DMatrix, DVector};

use super::predict;
use crate::EstimateError;
use crate::frequency_domain::Motion;
use crate::least_squares::size;
use crate::time_domain::{Discretisation, Extent};

/// Relative singular value below which a direction of the start does not show in the motion.
const UNSEEN: f64 = 1e-10;

/// The displacement and velocity at the first sample with which [`predict`] comes closest to the
/// motions measured, each channel relative to its size: noise on the first sample does not matter,
/// and one kind of motion is enough.
///
/// What does not show in the motion (the place of a free body whose acceleration alone was measured)
/// is taken as 0.
///
/// # Errors
/// As [`predict`] for [`Extent::Open`]; [`EstimateError::Size`] or [`EstimateError::Signal`] if the
/// motions do not belong to the force.
///
/// # Source
/// Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), chapter 5 (least squares); the motion
/// is the one from rest and, linear in the start, the free one.
pub fn fitted_start(
    system: &SecondOrderSystem,
    force: &Record,
    discretisation: Discretisation,
    measured: &[(Motion, &Record)],
) -> Result<InitialState, EstimateError> {
    let n = system.dof();
    for (_, record) in measured {
        size("channels of the motion", n, record.channels())?;
        record.check_same_sampling(force)?;
    }
    let run = |force: &Record, start: &InitialState| {
        let response = predict(system, force, discretisation, Extent::Open, start)?;
        Ok::<_, EstimateError>(stacked(measured, |kind, _| channels(&response, kind)))
    };
    let still = Record::new(force.sampling(), DMatrix::zeros(force.len(), n))?;
    let mut free = Vec::new();
    for at in 0..2 * n {
        free.push(run(
            &still,
            &state(&DVector::from_fn(2 * n, |row, _| f64::from(row == at)), n)?,
        )?);
    }
    let mut free = DMatrix::from_columns(&free);
    let gap = stacked(measured, |_, record| record) - run(force, &InitialState::rest(n))?;
    let lengths: Vec<f64> = free
        .column_iter_mut()
        .map(|mut column| {
            let length = column.norm();
            if length > 0.0 {
                column.unscale_mut(length);
            }
            length
        })
        .collect();
    let svd = free.svd(true, true);
    let floor = UNSEEN * svd.singular_values.max();
    let mut found = svd.solve(&gap, floor).expect("both sides were computed");
    for (value, length) in found.iter_mut().zip(lengths) {
        *value = if length > 0.0 { *value / length } else { 0.0 };
    }
    state(&found, n)
}

fn state(values: &DVector<f64>, n: usize) -> Result<InitialState, EstimateError> {
    Ok(InitialState::new(values.rows(0, n).into_owned(), values.rows(n, n).into_owned())?)
}

fn channels(response: &Response, kind: Motion) -> &Record {
    match kind {
        Motion::Displacement => response.displacement(),
        Motion::Velocity => response.velocity(),
        Motion::Acceleration => response.acceleration(),
    }
}

/// All channels one below the other, each over the norm of its measurement.
fn stacked<'a>(
    measured: &[(Motion, &'a Record)],
    of: impl Fn(Motion, &'a Record) -> &'a Record,
) -> DVector<f64> {
    let mut all = Vec::new();
    for (kind, record) in measured {
        let from = of(*kind, record);
        for channel in 0..record.channels() {
            let norm = record.column(channel).norm();
            let scale = if norm > 0.0 { norm } else { 1.0 };
            all.extend(from.channel(channel).iter().map(|x| x / scale));
        }
    }
    DVector::from_vec(all)
}
