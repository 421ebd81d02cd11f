//! M, C and K of an identified machine with the covariance of their entries.

use std::collections::BTreeMap;

use mechid_model::elements::{Power, Speed};
use mechid_model::{Matrix, Parameter, SecondOrderSystem};
use mechid_numerics::linear_algebra::svd;
use nalgebra::{DMatrix, DVector};

use super::MachineEstimate;
use crate::likelihood::LikelihoodError;
use crate::likelihood::estimate::Combination;
use crate::likelihood::limits::UNDETERMINED_PART;

/// Entries of M, C and K that depend on unknowns, with their covariance.
#[derive(Debug, Clone, PartialEq)]
pub struct UncertainEntries {
    /// Entries.
    pub entries: Vec<Parameter>,
    /// Covariance, one row and one column per entry, in the products of their units (kg, N·s/m,
    /// N/m); the variance of an entry that the data do not determine is infinite.
    pub covariance: DMatrix<f64>,
}

/// Returns the speed Ω for the matrices M, C + Ω G and K, in rad/s. The speed is 0 without
/// rotation, and also if it differs from line to line.
pub(super) fn constant_speed(speed: Speed) -> f64 {
    match speed {
        Speed::Constant(speed) => speed,
        Speed::None | Speed::Synchronous => 0.0,
    }
}

impl MachineEstimate {
    /// Returns M, C + Ω G and K with the identified parameters, at the constant speed of the
    /// instruments.
    ///
    /// # Errors
    /// As [`Assembly::system`](mechid_model::elements::Assembly::system): a degree of freedom
    /// without mass.
    pub fn system(&self) -> Result<SecondOrderSystem, LikelihoodError> {
        let speed = constant_speed(self.assembly.speed());
        let system = self.assembly.system(&self.likelihood.values(), speed);
        system.map_err(|error| LikelihoodError::Machine(error.into()))
    }

    /// Returns the covariance of the entries of [`MachineEstimate::system`] that depend on
    /// unknowns, to first order; `None` if there are more than `most` such entries.
    ///
    /// # Errors
    /// [`LikelihoodError::Machine`] for an entry that does not exist.
    ///
    /// # Source
    /// JCGM 100:2008 (GUM), section 5.2 (propagation of uncertainty).
    pub fn uncertain_entries(
        &self,
        most: usize,
    ) -> Result<Option<UncertainEntries>, LikelihoodError> {
        let (n, values) = (self.assembly.dof(), self.likelihood.values());
        let gradients = self.gradients(&values);
        if gradients.len() > most {
            return Ok(None);
        }
        let entries = gradients.keys().map(|(matrix, row, column)| {
            let which = Matrix::ALL[*matrix];
            Parameter::new(which, *row, *column, n)
                .map_err(|error| LikelihoodError::Machine(error.into()))
        });
        let entries = entries.collect::<Result<Vec<_>, _>>()?;
        let rows: Vec<_> = gradients.values().map(DVector::transpose).collect();
        if rows.is_empty() {
            let covariance = DMatrix::zeros(0, 0);
            return Ok(Some(UncertainEntries { entries, covariance }));
        }
        let gradient = DMatrix::from_rows(&rows);
        let mut covariance = &gradient * &self.likelihood.covariance * gradient.transpose();
        for (at, row) in gradients.values().enumerate() {
            if !self.is_determined(row, &values) {
                covariance.row_mut(at).fill(0.0);
                covariance.column_mut(at).fill(0.0);
                covariance[(at, at)] = f64::INFINITY;
            }
        }
        Ok(Some(UncertainEntries { entries, covariance }))
    }

    /// Returns the derivatives of the entries of M, C and K with respect to the parameters, by
    /// matrix, row and column.
    fn gradients(&self, values: &[f64]) -> BTreeMap<(usize, usize, usize), DVector<f64>> {
        let (n, speed) = (self.assembly.dof(), constant_speed(self.assembly.speed()));
        let mut gradients = BTreeMap::new();
        for term in self.assembly.terms().iter().filter(|term| !term.is_known()) {
            let (matrix, factor) = match term.power {
                Power::Stiffness => (Matrix::Stiffness, 1.0),
                Power::Damping => (Matrix::Damping, 1.0),
                Power::Gyroscopic => (Matrix::Damping, speed),
                Power::Mass => (Matrix::Mass, 1.0),
                Power::Hysteresis => continue,
            };
            let slopes: Vec<(usize, f64)> = term.derivatives(values).collect();
            term.for_each_entry(n, |row, column, value| {
                if column >= n {
                    return;
                }
                let gradient = gradients
                    .entry((matrix as usize, row, column))
                    .or_insert_with(|| DVector::zeros(values.len()));
                for (parameter, slope) in &slopes {
                    gradient[*parameter] += factor * value * slope;
                }
            });
        }
        gradients
    }

    /// Returns whether the data determine a quantity with this gradient.
    fn is_determined(&self, gradient: &DVector<f64>, values: &[f64]) -> bool {
        self.likelihood.combinations.iter().all(|combination| {
            let parameters = &self.likelihood.parameters;
            let index = |name: &String| parameters.iter().position(|p| p.name == *name);
            let members: Vec<usize> = combination.parameters.iter().filter_map(index).collect();
            let scale = |at: &usize| if values[*at] == 0.0 { 1.0 } else { values[*at].abs() };
            let scaled = members.iter().map(|at| gradient[*at] * scale(at));
            let scaled = DVector::from_iterator(members.len(), scaled);
            let scales: Vec<f64> = members.iter().map(scale).collect();
            outside(combination, &scales, &scaled) <= UNDETERMINED_PART * scaled.norm()
        })
    }
}

/// Returns the length of the component of a gradient outside the span of the determined
/// combinations.
fn outside(combination: &Combination, scales: &[f64], gradient: &DVector<f64>) -> f64 {
    let determined = &combination.determined;
    if determined.is_empty() {
        return gradient.norm();
    }
    let rows = DMatrix::from_fn(determined.len(), scales.len(), |row, column| {
        determined[row][column] * scales[column]
    });
    let Some(right) = svd(rows).ok().and_then(|parts| parts.v_t) else { return gradient.norm() };
    (gradient - right.transpose() * (&right * gradient)).norm()
}
