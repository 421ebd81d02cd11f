//! The load that the ends of an open record put on its lines.

use mechid_model::Matrix;
use nalgebra::{Complex, DVector};

use super::FrequencyData;
use super::misfit::powers;

/// Unknown loads τ of the ends of open records: column by column of [`FrequencyData::ends`], power by
/// power in the order of the matrices, one of each degree of freedom.
pub(super) struct Ends<'a> {
    data: &'a FrequencyData,
    tau: &'a [f64],
}

impl<'a> Ends<'a> {
    /// # Panics
    /// If there are not as many loads as [`count`] says.
    pub(super) fn new(data: &'a FrequencyData, tau: &'a [f64]) -> Self {
        assert_eq!(tau.len(), count(data), "one load of every record, power and degree of freedom");
        Self { data, tau }
    }

    /// Subtracts (τ₀ + τ₁ s + …) Z of a row from forces, in N.
    pub(super) fn take_off(&self, row: usize, force: &mut [Complex<f64>]) {
        let n = self.data.dof();
        let powers = powers(self.data.omega()[row]);
        for (column, z) in self.data.ends().row(row).iter().enumerate() {
            for matrix in Matrix::ALL {
                let z = z * powers[matrix as usize];
                for (dof, force) in force.iter_mut().enumerate() {
                    *force -= z * self.tau[place(n, column, matrix, dof)];
                }
            }
        }
    }

    /// The same loads by themselves, in N.
    pub(super) fn load(&self, row: usize) -> DVector<Complex<f64>> {
        let mut force = DVector::zeros(self.data.dof());
        self.take_off(row, force.as_mut_slice());
        -force
    }
}

/// Number of unknown loads.
pub(super) fn count(data: &FrequencyData) -> usize {
    Matrix::ALL.len() * data.dof() * data.ends().ncols()
}

/// Place of a load among all.
pub(super) fn place(n: usize, column: usize, matrix: Matrix, dof: usize) -> usize {
    (Matrix::ALL.len() * column + matrix as usize) * n + dof
}
