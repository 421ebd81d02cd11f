//! Transients of open records and errors of pulses: linear unknowns, eliminated record by record.

use std::ops::Range;

use mechid_numerics::products::transposed_product;
use mechid_spectra::noise::pulse::PulseErrors;
use mechid_spectra::{LineData, Transient};
use nalgebra::{Complex, DMatrix, DVector, Dyn, PermutationSequence, QR};
use rayon::prelude::*;

use super::limits::{TRANSIENT_ORDER, TRANSIENT_RANK};

/// Number of powers of s in M (s Δx + Δv) + C Δx, the loads due to the difference between the
/// initial and the final state.
const STATE_ORDERS: usize = 2;

/// Returns the number of unknowns of the transient of a record with `outputs` outputs and `states`
/// state loads.
pub(super) fn len(transient: Transient, outputs: usize, states: usize) -> usize {
    match transient {
        Transient::None => 0,
        Transient::Open { .. } => STATE_ORDERS * states + (TRANSIENT_ORDER + 1) * outputs,
    }
}

/// Linear unknowns of a record: the unknowns of its transient and the amplitudes of its pulse
/// errors.
pub(super) struct RecordUnknowns<'a> {
    /// Number of unknowns of the transient.
    pub(super) transient: usize,
    /// Reference frequency of the powers of s: the highest frequency of the record, so that the
    /// powers are at most 1.
    reference: f64,
    pulses: Vec<&'a PulseErrors>,
    /// Number of amplitudes of all pulses.
    pub(super) amplitudes: usize,
}

impl<'a> RecordUnknowns<'a> {
    /// Creates the linear unknowns of the record with these rows; `transient` is the number of
    /// unknowns of its transient.
    pub(super) fn new(data: &'a LineData, rows: &Range<usize>, transient: usize) -> Self {
        let omega = &data.omega()[rows.clone()];
        let reference = omega.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        let is_of_record = |pulse: &&PulseErrors| pulse.rows() == *rows;
        let pulses: Vec<_> = data.pulse_errors().iter().filter(is_of_record).collect();
        let amplitudes = pulses.iter().map(|pulse| pulse.count()).sum();
        Self { transient, reference, pulses, amplitudes }
    }

    /// Returns, for each amplitude, the index of the input and the error of this input on a line at
    /// `omega` (rad/s), per unit of the amplitude.
    fn input_errors(&self, omega: f64) -> Vec<(usize, Complex<f64>)> {
        let mut errors = Vec::with_capacity(self.amplitudes);
        for pulse in &self.pulses {
            errors.extend(pulse.at(omega).iter().map(|error| (pulse.input(), *error)));
        }
        errors
    }

    /// Subtracts the errors of the pulses from the measured `input` at a line at `omega` (rad/s).
    pub(super) fn correct(
        &self,
        omega: f64,
        amplitudes: &DMatrix<f64>,
        input: &mut DVector<Complex<f64>>,
    ) {
        for ((at, error), amplitude) in self.input_errors(omega).into_iter().zip(amplitudes) {
            input[at] -= error * *amplitude;
        }
    }

    /// Returns the amplitudes of the state loads at a line at `omega` (rad/s), given the unknowns
    /// of the transient.
    pub(super) fn state_loads(
        &self,
        omega: f64,
        states: usize,
        unknowns: &DVector<f64>,
    ) -> DVector<Complex<f64>> {
        let s = Complex::new(0.0, omega / self.reference);
        DVector::from_fn(states, |at, _| {
            (0..STATE_ORDERS)
                .map(|order| s.powu(order as u32) * unknowns[order * states + at])
                .sum()
        })
    }
}

/// Weighted responses, at one line, to the linear unknowns of its record.
pub(super) struct LineColumns {
    /// L⁻¹ times the response to the state loads, p × states.
    pub(super) states: Option<DMatrix<Complex<f64>>>,
    /// L⁻¹, p × p: column j is the weighted response to the constant term of the polynomial of
    /// output j.
    pub(super) outputs: DMatrix<Complex<f64>>,
    /// L⁻¹ G, p × q: the weighted receptance; `None` without pulses.
    pub(super) inputs: Option<DMatrix<Complex<f64>>>,
}

impl LineColumns {
    /// Passes the weighted columns of the transient (p entries each) and their indices to `write`.
    /// The first columns are the response to the state loads in powers of s/ω₀. A polynomial in
    /// s/ω₀ for every output follows; it describes aliasing.
    pub(super) fn for_each_of_transient(
        &self,
        omega: f64,
        unknowns: &RecordUnknowns<'_>,
        mut write: impl FnMut(usize, &mut dyn Iterator<Item = Complex<f64>>),
    ) {
        let s = Complex::new(0.0, omega / unknowns.reference);
        let states = self.states.iter().flat_map(DMatrix::column_iter);
        let orders = (0..STATE_ORDERS).flat_map(|order| states.clone().map(move |c| (order, c)));
        let outputs = (0..=TRANSIENT_ORDER)
            .flat_map(|order| self.outputs.column_iter().map(move |column| (order, column)));
        for (at, (order, column)) in orders.chain(outputs).enumerate() {
            let power = s.powu(order as u32);
            write(at, &mut column.iter().map(|z| z * power));
        }
    }

    /// Passes the weighted effects of the amplitudes of the pulse errors on y − G u (p entries
    /// each) and their indices to `write`. The effects have a negative sign, because the measured
    /// inputs u contain the errors.
    pub(super) fn for_each_of_pulses(
        &self,
        omega: f64,
        unknowns: &RecordUnknowns<'_>,
        mut write: impl FnMut(usize, &mut dyn Iterator<Item = Complex<f64>>),
    ) {
        let Some(inputs) = &self.inputs else { return };
        for (at, (input, error)) in unknowns.input_errors(omega).into_iter().enumerate() {
            write(at, &mut inputs.column(input).iter().map(|z| -z * error));
        }
    }
}

/// Orthonormal basis Q of the weighted columns A of a transient, stored in blocks of rows: A P = Q
/// R with a permutation P, where the columns of A are scaled to unit length.
pub(super) struct TransientBasis {
    /// Rows of Q.
    pub(super) blocks: Vec<DMatrix<f64>>,
    /// Triangular factor R of the linearly independent columns.
    triangle: DMatrix<f64>,
    permutation: PermutationSequence<Dyn>,
    /// Lengths of the columns of A.
    lengths: Vec<f64>,
}

impl TransientBasis {
    /// Combines the factors of the blocks of rows of A; `None` if a factor is not finite or if
    /// there is no block.
    ///
    /// # Source
    /// Demmel, Grigori, Hoemmen & Langou (2012), SIAM J. Scientific Computing 34, A206–A239 (QR
    /// factorisation of blocks of rows).
    pub(super) fn new(factors: Vec<QR<f64, Dyn, Dyn>>) -> Option<Self> {
        let triangles: Vec<DMatrix<f64>> = factors.iter().map(QR::r).collect();
        let rows = triangles.iter().map(DMatrix::nrows).sum();
        let mut stacked = DMatrix::zeros(rows, triangles.first()?.ncols());
        let mut firsts = Vec::with_capacity(triangles.len());
        let mut first = 0;
        for triangle in &triangles {
            stacked.rows_mut(first, triangle.nrows()).copy_from(triangle);
            firsts.push(first);
            first += triangle.nrows();
        }
        let lengths: Vec<f64> = stacked.column_iter().map(|column| column.norm()).collect();
        for (mut column, length) in stacked.column_iter_mut().zip(&lengths) {
            if *length > 0.0 {
                column.unscale_mut(*length);
            }
        }
        if stacked.iter().any(|value| !value.is_finite()) {
            return None;
        }
        let top = stacked.col_piv_qr();
        let triangle = top.r();
        let rank = triangle.diagonal().iter().take_while(|d| d.abs() > TRANSIENT_RANK).count();
        let q = top.q().columns(0, rank).into_owned();
        let block = |(factors, first): (&QR<f64, Dyn, Dyn>, &usize)| {
            let of_block = factors.q();
            &of_block * q.rows(*first, of_block.ncols())
        };
        let blocks = factors.par_iter().zip(&firsts).map(block).collect();
        let triangle = triangle.view((0, 0), (rank, rank)).into_owned();
        Some(Self { blocks, triangle, permutation: top.p().clone(), lengths })
    }

    /// Removes the components in the space of the basis from vectors that are given in blocks of
    /// rows, and returns these components, one column per vector.
    ///
    /// # Source
    /// Golub & Pereyra (1973), SIAM J. Numerical Analysis 10, 413–432 (variable projection).
    pub(super) fn remove_from(&self, parts: &mut [&mut DMatrix<f64>]) -> DMatrix<f64> {
        let rank = self.triangle.ncols();
        let vectors = parts.first().map_or(0, |part| part.ncols());
        let pairs = self.blocks.par_iter().zip(parts.par_iter());
        let products: Vec<_> = pairs
            .map(|(basis, part)| transposed_product(basis.as_view(), part.as_view()))
            .collect();
        let components =
            products.iter().fold(DMatrix::zeros(rank, vectors), |sum, of_block| sum + of_block);
        let pairs = self.blocks.par_iter().zip(parts.par_iter_mut());
        pairs.for_each(|(basis, part)| part.gemm(-1.0, basis, &components, 1.0));
        components
    }

    /// Returns the unknowns of the transient from the components of a residual; the coefficients of
    /// linearly dependent columns are 0. `None` if R is singular.
    pub(super) fn unknowns(&self, components: &DMatrix<f64>) -> Option<DVector<f64>> {
        let mut leading = components.column(0).into_owned();
        self.triangle.solve_upper_triangular_mut(&mut leading).then_some(())?;
        let mut unknowns = leading.resize_vertically(self.lengths.len(), 0.0);
        self.permutation.inv_permute_rows(&mut unknowns);
        for (value, length) in unknowns.iter_mut().zip(&self.lengths) {
            if *length > 0.0 {
                *value /= length;
            }
        }
        Some(unknowns)
    }
}
