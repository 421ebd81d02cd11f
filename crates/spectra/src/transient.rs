//! Transient of an open record, written as a load. It is the effect that the difference between the
//! final and initial states of the record has on the lines.

use mechid_model::Matrix;
use nalgebra::{Complex, DMatrix};

use crate::frequency_data::FrequencyData;

/// Unknown loads τ of the transients of open records, sorted by three indices: first the column of
/// [`FrequencyData::transient`], second the power of s in the order of the matrices, third the
/// degree of freedom.
///
/// # Source
/// Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed. (2012),
/// section 6.3.
pub struct TransientLoad<'a> {
    data: &'a FrequencyData,
    tau: &'a [f64],
}

impl<'a> TransientLoad<'a> {
    /// Creates the loads `tau` of the open records of `data`, in N times powers of seconds.
    ///
    /// # Panics
    /// If the number of loads differs from [`len`].
    pub fn new(data: &'a FrequencyData, tau: &'a [f64]) -> Self {
        assert_eq!(
            tau.len(),
            len(data),
            "there must be one load for each combination of transient column, power of s and degree of freedom"
        );
        Self { data, tau }
    }

    /// Subtracts the transient (τ₀ + τ₁ s + …) Z of every row from forces, degrees of freedom ×
    /// rows, in N. Z is the entry of [`FrequencyData::transient`].
    ///
    /// # Panics
    /// If the forces do not have one column for every row of the data.
    pub fn subtract_from(&self, forces: &mut DMatrix<Complex<f64>>) {
        let n = self.data.dof();
        assert_eq!(forces.shape(), (n, self.data.len()), "forces of every row");
        for (column, transient) in self.data.transient().column_iter().enumerate() {
            for ((z, omega), mut force) in
                transient.iter().zip(self.data.omega()).zip(forces.column_iter_mut())
            {
                // The transient of a record is zero on the lines of all other records.
                if *z == Complex::ZERO {
                    continue;
                }
                let powers = powers(*omega);
                for matrix in Matrix::ALL {
                    let z = z * powers[matrix as usize];
                    for (dof, force) in force.iter_mut().enumerate() {
                        *force -= z * self.tau[index(n, column, matrix, dof)];
                    }
                }
            }
        }
    }
}

/// Returns the number of unknown loads τ of all open records.
pub fn len(data: &FrequencyData) -> usize {
    Matrix::ALL.len() * data.dof() * data.transient().ncols()
}

/// Returns the index of the load that belongs to a column of the transient, to the power of s that
/// multiplies `matrix`, and to one of `n` degrees of freedom.
pub fn index(n: usize, column: usize, matrix: Matrix, dof: usize) -> usize {
    (Matrix::ALL.len() * column + matrix as usize) * n + dof
}

/// Returns s², s and 1, the factors of M, C and K in the dynamic stiffness, with s = iω (rad/s).
pub fn powers(omega: f64) -> [Complex<f64>; 3] {
    let mut powers = [Complex::from(1.0); 3];
    powers[Matrix::Mass as usize] = Complex::from(-omega * omega);
    powers[Matrix::Damping as usize] = Complex::new(0.0, omega);
    powers
}

impl FrequencyData {
    /// Returns the lines as if all records were whole periods: the transients of open records, with
    /// the loads `tau` in the order of [`TransientLoad`], are subtracted from the force (N).
    ///
    /// # Panics
    /// If the number of loads differs from [`len`].
    #[must_use]
    pub fn without_transient(&self, tau: &[f64]) -> Self {
        let transient = TransientLoad::new(self, tau);
        let mut forces = self.force().transpose();
        transient.subtract_from(&mut forces);
        self.with_closed_force(forces.transpose())
    }
}
