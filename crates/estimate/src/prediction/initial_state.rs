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

/// The displacement and velocity at the first sample with which [`predict`] comes closest to the
/// motions measured, each channel relative to its size: noise on the first sample does not matter,
/// and one kind of motion is enough.
///
/// What does not show in the motion (the place of a free body whose acceleration alone was measured)
/// is taken as 0.
///
/// # Errors
/// As [`predict`] for [`Extent::Open`]; [`NumericsError::Size`] or [`EstimateError::Signal`] if the
/// motions do not belong to the force.
///
/// # Source
/// Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), chapter 5 (least squares); the motion
/// is the one from rest and, linear in the start, the free one.
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

/// The start of a record that comes in stretches, as [`fitted_start`] finds it: memory does not grow
/// with the record.
///
/// # Source
/// That of [`fitted_start`]; chapter 6 there (a triangle brought up to date by rows).
#[derive(Debug, Clone)]
pub struct StartFit {
    system: SecondOrderSystem,
    discretisation: Discretisation,
    /// Present states of the motions that are superposed: free ones from each unit start, and the
    /// one from rest under the force.
    runs: Vec<InitialState>,
    /// Factor for each measured channel of the columns \[free motions | what the forced one leaves\].
    channels: Vec<TriangularFactor>,
    /// Sum of squares of each measured channel.
    sizes: Vec<f64>,
}

impl StartFit {
    /// Creates sums without a sample.
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

    /// Takes the next stretch, which begins with the last sample of the one before: force (N) and the
    /// motions measured, the same kinds each time (samples × degrees of freedom).
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
        let still = Record::new(force.sampling(), DMatrix::zeros(len, n))?;
        let mut responses = Vec::new();
        for (at, run) in self.runs.iter_mut().enumerate() {
            let force = if at < 2 * n { &still } else { force };
            let response = predict(&self.system, force, self.discretisation, Extent::Open, run)?;
            *run = last(&response)?;
            responses.push(response);
        }
        let seen = usize::from(!self.channels.is_empty());
        if seen == 0 {
            let channels = n * measured.len();
            self.channels = vec![TriangularFactor::new(2 * n + 1); channels];
            self.sizes = vec![0.0; channels];
        }
        let all =
            measured.iter().flat_map(|(kind, record)| (0..n).map(move |c| (*kind, record, c)));
        for ((kind, record, c), (factor, size)) in
            all.zip(self.channels.iter_mut().zip(&mut self.sizes))
        {
            let measured = record.channel(c);
            let column = |at: usize| responses[at].quantity(kind).channel(c);
            let rows = DMatrix::from_fn(len - seen, 2 * n + 1, |k, at| match at {
                gap if gap == 2 * n => measured[seen + k] - column(gap)[seen + k],
                free => column(free)[seen + k],
            });
            if !factor.push(&[rows.as_view()]) {
                return Err(NumericsError::Overflow.into());
            }
            *size += measured[seen..].iter().map(|x| x * x).sum::<f64>();
        }
        Ok(())
    }

    /// The start that fits all stretches so far.
    ///
    /// # Errors
    /// [`NumericsError::TooFewRows`] if there was none.
    pub fn start(&self) -> Result<InitialState, EstimateError> {
        let n = self.system.dof();
        if self.channels.iter().all(|factor| factor.rows() == 0) {
            return Err(NumericsError::TooFewRows { rows: 0, unknowns: 2 * n }.into());
        }
        let width = 2 * n + 1;
        let mut rows = DMatrix::zeros(self.channels.len() * width, width);
        for (at, (factor, size)) in self.channels.iter().zip(&self.sizes).enumerate() {
            // A stretch that was refused leaves channels without rows.
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

/// The state at the last sample; rest, where its squares are too small to be told from 0.
fn last(response: &Response) -> Result<InitialState, EstimateError> {
    let of = |record: &Record| record.data().row(record.len() - 1).transpose();
    let (x, v) = (of(response.displacement()), of(response.velocity()));
    if x.amax().max(v.amax()) < f64::MIN_POSITIVE.sqrt() {
        return Ok(InitialState::rest(x.len()));
    }
    Ok(InitialState::new(x, v)?)
}

fn state(values: &DVector<f64>, n: usize) -> Result<InitialState, EstimateError> {
    Ok(InitialState::new(values.rows(0, n).into_owned(), values.rows(n, n).into_owned())?)
}
