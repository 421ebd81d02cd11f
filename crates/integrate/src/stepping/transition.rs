//! The linear map of one step; its matrices are obtained by running the stepping code with unit
//! states and unit loads.

use nalgebra::linalg::balancing::balance_parlett_reinsch;
use nalgebra::{DMatrix, DVector};

use crate::stepping::stepper::{Instant, Loads, Stepper};

/// Map z(t+Δt) = z(t) + D z(t) + Σ B_i F(t_i) of one step; t_i are the instants at which the scheme
/// reads the force.
///
/// The amplification matrix is A = I + D. Near Δt = 0, D has the digits that A loses.
#[derive(Debug, Clone, PartialEq)]
pub struct Transition {
    /// D, state × state, in the units of the state.
    pub change: DMatrix<f64>,
    /// For each instant, the state × n matrix that multiplies the force at that instant (N).
    pub loads: Vec<(Instant, DMatrix<f64>)>,
}

impl Transition {
    /// Creates the map of `stepper`, prepared for a linear system. A state with entry j equal to 1
    /// and all others 0 gives column j of D; a force of 1 N gives a column of B.
    pub fn from_stepper(stepper: &mut dyn Stepper) -> Self {
        Self::read(stepper, || ())
    }

    /// Creates the map as [`from_stepper`](Self::from_stepper) does, and calls `after` after each
    /// unit state, then after each unit load, in the order of the columns.
    pub(crate) fn read(stepper: &mut dyn Stepper, mut after: impl FnMut()) -> Self {
        let (n, len) = (stepper.dof(), stepper.state_len());
        let (instants, zeros) = (stepper.instants(), vec![0.0; n]);
        let no_load = Loads::none(&zeros);
        // A step of a linear system does not fail.
        let mut change_of = |state: &[f64], loads: &Loads<'_>, change: &mut [f64]| {
            let _ = stepper.change(state, loads, change);
            after();
        };
        let mut state = vec![0.0; len];
        let mut change = DMatrix::zeros(len, len);
        for j in 0..len {
            state[j] = 1.0;
            let column = &mut change.as_mut_slice()[j * len..(j + 1) * len];
            change_of(&state, &no_load, column);
            state[j] = 0.0;
        }
        let mut unit = vec![0.0; n];
        let mut loads = Vec::new();
        for &instant in instants {
            let mut matrix = DMatrix::zeros(len, n);
            for j in 0..n {
                unit[j] = 1.0;
                let mut one = no_load;
                *match instant {
                    Instant::Now => &mut one.now,
                    Instant::Middle => &mut one.middle,
                    Instant::Next => &mut one.next,
                    Instant::Beyond => &mut one.beyond,
                } = &unit;
                change_of(&state, &one, &mut matrix.as_mut_slice()[j * len..(j + 1) * len]);
                unit[j] = 0.0;
            }
            loads.push((instant, matrix));
        }
        Self { change, loads }
    }

    /// Returns an entry of the matrix \[D B₁ B₂ …\]: D and the matrices of the loads side by side.
    pub(crate) fn entry(&self, row: usize, column: usize) -> f64 {
        match column.checked_sub(self.change.ncols()) {
            None => self.change[(row, column)],
            Some(load) => {
                let (_, first) = &self.loads[0];
                self.loads[load / first.ncols()].1[(row, load % first.ncols())]
            }
        }
    }

    /// Scales `matrix`, the D or the amplification matrix A of a step, to comparable rows and
    /// columns by powers of two, and returns the scales s of z = s ∘ (balanced z). `None` if
    /// entries are too large for their squares to be finite, because balancing would then not end.
    pub(crate) fn balance(matrix: &mut DMatrix<f64>) -> Option<DVector<f64>> {
        let representable = matrix.iter().all(|v| v.abs() < 1e150);
        representable.then(|| balance_parlett_reinsch(matrix))
    }

    /// The amplification matrix A = I + D, state × state, in the units of the state.
    pub fn amplification(&self) -> DMatrix<f64> {
        &self.change + DMatrix::identity(self.change.nrows(), self.change.nrows())
    }
}
