//! Initial state of a machine, from its response.

use mechid_model::{Discretisation, InitialState, Response, ResponseQuantity, SecondOrderSystem};
use mechid_numerics::linear_algebra::svd;
use mechid_numerics::triangular::TriangularFactor;
use mechid_numerics::{NumericsError, check_size};
use mechid_signal::{Extent, Record};
use nalgebra::{DMatrix, DVector};

use super::predict;
use crate::EstimateError;
use crate::limits::INITIAL_UNSEEN;

/// Estimates the displacement and velocity at the first sample so that [`predict`] fits the
/// measured motions best; the error of each channel is divided by the size of the channel. All
/// samples are used, so noise on the first sample has little effect, and one measured quantity is
/// enough.
///
/// An unobservable part of the state (such as the position of a free body with a measured
/// acceleration only) is set to 0.
///
/// # Errors
/// As [`predict`] for [`Extent::Open`]; [`NumericsError::Size`] or [`EstimateError::Signal`] if the
/// motions do not belong to the force.
///
/// # Source
/// Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), chapter 5 (least squares): the motion
/// is the response from rest plus the free response, which is linear in the initial state.
pub fn fitted_start(
    system: &SecondOrderSystem,
    force: &Record,
    discretisation: Discretisation,
    measured: &[(ResponseQuantity, &Record)],
) -> Result<InitialState, EstimateError> {
    let mut fit = StartFit::new(system, discretisation)?;
    fit.push(force, measured)?;
    fit.start()
}

/// Estimate of the initial state of a record that is given in segments. The result is that of
/// [`fitted_start`], but the memory does not grow with the length of the record.
///
/// # Source
/// As [`fitted_start`]; also chapter 6 of the same book (a triangular factor updated by rows).
#[derive(Debug, Clone)]
pub struct StartFit {
    system: SecondOrderSystem,
    discretisation: Discretisation,
    /// States, at the last sample so far, of the superposed motions: the free response to each unit
    /// initial state, and the response from rest to the force.
    runs: Vec<InitialState>,
    /// Triangular factor of the columns \[free responses | measured motion minus response from
    /// rest\], for each measured channel.
    channels: Vec<TriangularFactor>,
    /// Sum of squares of each measured channel.
    sizes: Vec<f64>,
}

impl StartFit {
    /// Creates a fit that contains no sample yet.
    ///
    /// # Errors
    /// [`EstimateError::Model`] if the machine has no degree of freedom.
    pub fn new(
        system: &SecondOrderSystem,
        discretisation: Discretisation,
    ) -> Result<Self, EstimateError> {
        let n = system.dof();
        let unit = |at: usize| state(&DVector::from_fn(2 * n, |k, _| f64::from(k == at)), n);
        let mut runs = (0..2 * n).map(unit).collect::<Result<Vec<_>, _>>()?;
        runs.push(InitialState::rest(n));
        let (channels, sizes) = (Vec::new(), Vec::new());
        Ok(Self { system: system.clone(), discretisation, runs, channels, sizes })
    }

    /// Adds the next segment, which begins with the last sample of the preceding segment. A segment
    /// has the force (N) and the measured motions (samples × degrees of freedom); all segments have
    /// the same quantities.
    ///
    /// # Errors
    /// As [`predict`] for [`Extent::Open`]; [`NumericsError::Size`] or [`EstimateError::Signal`] if
    /// the motions do not belong to the force, [`NumericsError::Overflow`].
    pub fn push(
        &mut self,
        force: &Record,
        measured: &[(ResponseQuantity, &Record)],
    ) -> Result<(), EstimateError> {
        let (n, len) = (self.system.dof(), force.len());
        for (_, record) in measured {
            check_size("channels of the motion", n, record.channels())?;
            record.check_same_sampling(force)?;
        }
        let no_force = Record::new(force.sampling(), DMatrix::zeros(len, n))?;
        let mut responses = Vec::new();
        for (at, run) in self.runs.iter_mut().enumerate() {
            let force = if at < 2 * n { &no_force } else { force };
            let response = predict(&self.system, force, self.discretisation, Extent::Open, run)?;
            *run = last(&response)?;
            responses.push(response);
        }
        // A later segment begins with the last sample of the preceding one, which is already in the
        // sums.
        let first = usize::from(!self.channels.is_empty());
        if first == 0 {
            let channels = n * measured.len();
            self.channels = vec![TriangularFactor::new(2 * n + 1); channels];
            self.sizes = vec![0.0; channels];
        }
        let channels =
            measured.iter().flat_map(|(kind, record)| (0..n).map(move |c| (*kind, record, c)));
        for ((kind, record, c), (factor, size)) in
            channels.zip(self.channels.iter_mut().zip(&mut self.sizes))
        {
            let measured = record.channel(c);
            let column = |at: usize| responses[at].quantity(kind).channel(c);
            let rows = DMatrix::from_fn(len - first, 2 * n + 1, |k, at| match at {
                gap if gap == 2 * n => measured[first + k] - column(gap)[first + k],
                free => column(free)[first + k],
            });
            if !factor.push(&[rows.as_view()]) {
                return Err(NumericsError::Overflow.into());
            }
            *size += measured[first..].iter().map(|x| x * x).sum::<f64>();
        }
        Ok(())
    }

    /// Returns the initial state that fits all segments so far.
    ///
    /// # Errors
    /// [`NumericsError::TooFewRows`] without a segment.
    pub fn start(&self) -> Result<InitialState, EstimateError> {
        let n = self.system.dof();
        if self.channels.iter().all(|factor| factor.rows() == 0) {
            return Err(NumericsError::TooFewRows { rows: 0, unknowns: 2 * n }.into());
        }
        let width = 2 * n + 1;
        let mut rows = DMatrix::zeros(self.channels.len() * width, width);
        for (at, (factor, size)) in self.channels.iter().zip(&self.sizes).enumerate() {
            // A segment that was rejected can leave channels without rows.
            if factor.rows() > 0 {
                let scale = if *size > 0.0 { size.sqrt() } else { 1.0 };
                rows.rows_mut(at * width, width).copy_from(&factor.r().unscale(scale));
            }
        }
        let gap = rows.column(2 * n).into_owned();
        let mut free = rows.remove_column(2 * n);
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
        let svd = svd(free)?;
        let floor = INITIAL_UNSEEN * svd.singular_values.max();
        let mut start = svd.solve(&gap, floor).expect("both sides were computed");
        for (value, length) in start.iter_mut().zip(lengths) {
            *value = if length > 0.0 { *value / length } else { 0.0 };
        }
        state(&start, n)
    }
}

/// Returns the state at the last sample; if the squares of all its values underflow, the returned
/// state is zero.
fn last(response: &Response) -> Result<InitialState, EstimateError> {
    let last_sample = |record: &Record| record.data().row(record.len() - 1).transpose();
    let (x, v) = (last_sample(response.displacement()), last_sample(response.velocity()));
    if x.amax().max(v.amax()) < f64::MIN_POSITIVE.sqrt() {
        return Ok(InitialState::rest(x.len()));
    }
    Ok(InitialState::new(x, v)?)
}

fn state(values: &DVector<f64>, n: usize) -> Result<InitialState, EstimateError> {
    Ok(InitialState::new(values.rows(0, n).into_owned(), values.rows(n, n).into_owned())?)
}
