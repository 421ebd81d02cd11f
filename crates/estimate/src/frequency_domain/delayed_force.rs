//! Equations of motion of spectra with a delayed force.

use mechid_model::Matrix;
use mechid_spectra::FrequencyData;
use nalgebra::{Complex, DMatrix, DVectorView};

use super::equation_error::{delay_weight, motions, real_rows, weighted_rows};
use crate::Unknowns;
use crate::equation_of_motion::{Columns, equations_by_columns};
use crate::relations::Relations;

/// Fit of the equation of motion to spectral lines as a function of the delay of the force.
///
/// A delay changes only the forces, so the regressors (the motions that the unknown entries
/// multiply) are factored only once.
pub struct DelayedForce<'a> {
    data: &'a FrequencyData,
    /// Weight of each line.
    weight: Vec<f64>,
    /// Number of degrees of freedom on which a force acts.
    driven: usize,
    groups: Vec<Group>,
}

/// Equations with the same regressors, or all equations together if entries are related.
struct Group {
    equations: Vec<usize>,
    /// Orthonormal basis of the regressors; equations that are fitted together are stacked.
    q: DMatrix<f64>,
    q_transposed: DMatrix<f64>,
    /// Forces (N) that the known entries of M, C and K need for the measured motion, rows ×
    /// equations.
    known: DMatrix<f64>,
}

impl<'a> DelayedForce<'a> {
    /// Prepares the fit for forces on the degrees of freedom `driven`, counted from 0. `None` if
    /// the data do not determine an entry; this does not depend on the delay.
    pub fn new(data: &'a FrequencyData, unknowns: &Unknowns, driven: &[usize]) -> Option<Self> {
        Self::weighted(data, delay_weight(data), unknowns, driven)
    }

    /// Prepares the fit with given weights, a pure number for each line.
    ///
    /// # Source
    /// Ours.
    pub fn weighted(
        data: &'a FrequencyData,
        weight: Vec<f64>,
        unknowns: &Unknowns,
        driven: &[usize],
    ) -> Option<Self> {
        let undelayed = weighted_rows(data, 0.0, |row| weight[row]).ok()?.solve(unknowns).ok()?;
        if !undelayed.undetermined().is_empty() {
            return None;
        }
        let motions = motions(data, &weight);
        let groups = match Relations::linear(unknowns) {
            Some(relations) => vec![Group::together(&motions, unknowns, &relations)],
            None => {
                let shared = equations_by_columns(unknowns, &unknowns.free()).into_iter();
                let group = |(columns, mut equations): (Columns, Vec<usize>)| {
                    equations.retain(|equation| driven.contains(equation));
                    let q = || {
                        motions.select_columns(&column_indices(unknowns.dof(), &columns)).qr().q()
                    };
                    (!equations.is_empty()).then(|| Group::new(q(), &motions, unknowns, equations))
                };
                shared.filter_map(group).collect()
            }
        };
        Some(Self { data, weight, driven: driven.len(), groups })
    }

    /// Returns the normalised residual power (residual power divided by the power of the right-hand
    /// side), summed over the driven equations, for a force that is delayed by `delay` (s). For
    /// related equations, the ratio of all equations together is multiplied by the number of
    /// forces. `None` if the result is not finite.
    ///
    /// # Source
    /// Ours.
    pub fn residual_power(&self, delay: f64) -> Option<f64> {
        let late = |row: usize| Complex::cis(-self.data.omega()[row] * delay);
        let force = real_rows(self.data.force(), |row, f| f * late(row) * self.weight[row]);
        let powers = self.groups.iter().map(|group| group.residual_power(&force, self.driven));
        Some(powers.sum()).filter(|power: &f64| power.is_finite())
    }
}

/// Returns the indices of columns of the motions; each column is given by its matrix (M, C or K)
/// and its degree of freedom.
fn column_indices(dof: usize, columns: &Columns) -> Vec<usize> {
    columns.iter().map(|(matrix, column)| *matrix as usize * dof + column).collect()
}

impl Group {
    fn new(
        q: DMatrix<f64>,
        motions: &DMatrix<f64>,
        unknowns: &Unknowns,
        equations: Vec<usize>,
    ) -> Self {
        let dof = unknowns.dof();
        let entries =
            || Matrix::ALL.into_iter().flat_map(|matrix| (0..dof).map(move |j| (matrix, j)));
        let mut known = DMatrix::zeros(motions.nrows(), equations.len());
        for (mut sum, equation) in known.column_iter_mut().zip(&equations) {
            for (index, (matrix, column)) in entries().enumerate() {
                let value = unknowns.fixed(matrix, *equation, column).unwrap_or(0.0);
                if value != 0.0 {
                    sum.axpy(value, &motions.column(index), 1.0);
                }
            }
        }
        Self { equations, q_transposed: q.transpose(), q, known }
    }

    /// Stacks all equations; entries that are the same unknown share a column.
    fn together(motions: &DMatrix<f64>, unknowns: &Unknowns, relations: &Relations) -> Self {
        let (dof, rows) = (unknowns.dof(), motions.nrows());
        let mut regressors = DMatrix::zeros(rows * dof, relations.count());
        for (entry, p) in unknowns.free().iter().enumerate() {
            let motion = motions.column(p.matrix() as usize * dof + p.column());
            let mut column = regressors.column_mut(relations.shared(entry));
            column.rows_mut(rows * p.row(), rows).axpy(1.0, &motion, 1.0);
        }
        Self::new(regressors.qr().q(), motions, unknowns, (0..dof).collect())
    }

    fn residual_power(&self, force: &DMatrix<f64>, driven: usize) -> f64 {
        let mut targets = force.select_columns(&self.equations) - &self.known;
        let together = self.q.nrows() > targets.nrows();
        if together {
            targets = DMatrix::from_column_slice(targets.len(), 1, targets.as_slice());
        }
        let residuals = &targets - &self.q * (&self.q_transposed * &targets);
        let both = residuals.column_iter().zip(targets.column_iter());
        let power = |(e, b): (DVectorView<'_, f64>, DVectorView<'_, f64>)| {
            if e.norm() == 0.0 { 0.0 } else { (e.norm() / b.norm()).powi(2) }
        };
        both.map(power).sum::<f64>() * if together { driven as f64 } else { 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use mechid_model::{Matrix, ResponseQuantity};

    use super::*;

    /// The residual power agrees with that of a least-squares solution of the delayed equations,
    /// for all sets of known entries and all delays.
    #[test]
    fn the_power_is_that_of_a_fit_with_the_delay() {
        let lines = 12;
        let number = |scale: f64, row: usize, column: usize| {
            let phase = (7 * row + 3 * column + 1) as f64;
            Complex::new((scale * phase).sin(), (1.7 * scale * phase).cos())
        };
        let omega: Vec<f64> = (1..=lines).map(|line| 2.0 * line as f64).collect();
        let force = DMatrix::from_fn(lines, 2, |row, column| number(1.3, row, column));
        let motion = DMatrix::from_fn(lines, 2, |row, column| number(0.9, row, column));
        let quantity = ResponseQuantity::Displacement;
        let data = FrequencyData::from_amplitudes(omega, force, motion, quantity).unwrap();
        let free = Unknowns::unknown_mass(2).unwrap();
        let some = free.clone().fix(Matrix::Damping, 0, 1, 0.7).unwrap();
        let known = Unknowns::known_mass(&DMatrix::from_diagonal_element(2, 2, 3.0)).unwrap();
        for unknowns in [free, some, known] {
            let late = DelayedForce::new(&data, &unknowns, &[0, 1]).unwrap();
            for delay in [0.0, 0.03, -0.2] {
                let rows = weighted_rows(&data, delay, |_| 1.0).unwrap();
                let fit = rows.solve(&unknowns).unwrap();
                let power: f64 = fit.residual_nrmse().iter().map(|ratio| ratio * ratio).sum();
                let found = late.residual_power(delay).unwrap();
                assert!((found - power).abs() < 1e-12 * power, "{found} {power}");
            }
        }
    }
}
