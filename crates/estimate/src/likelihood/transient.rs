//! Transients of open records: linear unknowns, eliminated record by record.

use mechid_spectra::{LineData, Transient};
use nalgebra::{Complex, DMatrix, DVector};

use super::limits::{TRANSIENT_ORDER, TRANSIENT_RANK};

/// Number of powers of s in the loads M (s Δx + Δv) + C Δx from a difference of states.
const STATE_ORDERS: usize = 2;

/// Returns the number of unknowns of the transient of a record with `outputs` outputs and `states`
/// state loads.
pub(super) fn len(transient: Transient, outputs: usize, states: usize) -> usize {
    match transient {
        Transient::None => 0,
        Transient::Open { .. } => STATE_ORDERS * states + (TRANSIENT_ORDER + 1) * outputs,
    }
}

/// Returns the reference frequency of the powers of s, the highest of the record, so that they are
/// at most 1.
pub(super) fn reference(data: &LineData, rows: std::ops::Range<usize>) -> f64 {
    data.omega()[rows].iter().copied().fold(f64::MIN_POSITIVE, f64::max)
}

/// Returns the columns of the transient at a line, p × unknowns: the response to the state loads in
/// powers of s/ω₀, then a polynomial in s/ω₀ for every output, which describes aliasing.
pub(super) fn columns(
    omega: f64,
    reference: f64,
    outputs: usize,
    state_response: Option<&DMatrix<Complex<f64>>>,
) -> DMatrix<Complex<f64>> {
    let s = Complex::new(0.0, omega / reference);
    let states = state_response.map_or(0, DMatrix::ncols);
    let count = STATE_ORDERS * states + (TRANSIENT_ORDER + 1) * outputs;
    let mut columns = DMatrix::zeros(outputs, count);
    if let Some(response) = state_response {
        for order in 0..STATE_ORDERS {
            let weighted = response * s.powu(order as u32);
            columns.columns_mut(order * states, states).copy_from(&weighted);
        }
    }
    for order in 0..=TRANSIENT_ORDER {
        for output in 0..outputs {
            let at = STATE_ORDERS * states + order * outputs + output;
            columns[(output, at)] = s.powu(order as u32);
        }
    }
    columns
}

/// Returns the amplitudes of the state loads at a line from the unknowns of a transient.
pub(super) fn state_loads(
    omega: f64,
    reference: f64,
    states: usize,
    unknowns: &DVector<f64>,
) -> DVector<Complex<f64>> {
    let s = Complex::new(0.0, omega / reference);
    DVector::from_fn(states, |at, _| {
        (0..STATE_ORDERS).map(|order| s.powu(order as u32) * unknowns[order * states + at]).sum()
    })
}

/// Orthonormal basis of the weighted columns of a transient, and its fit to a residual.
pub(super) struct Eliminated {
    pub(super) basis: DMatrix<f64>,
    /// Unknowns of the transient that fit the residual.
    pub(super) unknowns: DVector<f64>,
}

impl Eliminated {
    /// Fits weighted columns to a weighted residual; the coefficients of linearly dependent columns
    /// are 0.
    ///
    /// # Source
    /// Golub & Pereyra (1973), SIAM J. Numerical Analysis 10, 413–432 (variable projection).
    pub(super) fn new(mut columns: DMatrix<f64>, residual: &DVector<f64>) -> Option<Self> {
        let scale: Vec<f64> = columns
            .column_iter_mut()
            .map(|mut column| {
                let length = column.norm();
                if length > 0.0 {
                    column.unscale_mut(length);
                    length
                } else {
                    1.0
                }
            })
            .collect();
        if columns.iter().any(|value| !value.is_finite()) {
            return None;
        }
        let count = columns.ncols();
        let factors = columns.col_piv_qr();
        let r = factors.r();
        let rank = r.diagonal().iter().take_while(|d| d.abs() > TRANSIENT_RANK).count();
        let basis = factors.q().columns(0, rank).into_owned();
        let mut leading = basis.tr_mul(residual);
        r.view((0, 0), (rank, rank)).solve_upper_triangular_mut(&mut leading).then_some(())?;
        let mut unknowns = leading.resize_vertically(count, 0.0);
        factors.p().inv_permute_rows(&mut unknowns);
        unknowns.iter_mut().zip(scale).for_each(|(value, scale)| *value /= scale);
        Some(Self { basis, unknowns })
    }
}
