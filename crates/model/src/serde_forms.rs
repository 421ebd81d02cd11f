//! Serialised forms: matrices as rows of numbers, parameters by name.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use crate::{
    Matrix, ModelError, NonlinearSystem, Parameter, SecondOrderSystem, Terms, UncertainSystem,
};

/// M (kg), C (N·s/m) and K (N/m) as rows of numbers.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SystemForm {
    mass: Vec<Vec<f64>>,
    damping: Vec<Vec<f64>>,
    stiffness: Vec<Vec<f64>>,
}

/// A system with the names and the covariance of its uncertain entries.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct UncertainForm {
    system: SecondOrderSystem,
    parameters: Vec<String>,
    covariance: Vec<Vec<f64>>,
}

impl From<SecondOrderSystem> for SystemForm {
    fn from(system: SecondOrderSystem) -> Self {
        let [mass, damping, stiffness] = Matrix::ALL.map(|which| rows(system.matrix(which)));
        Self { mass, damping, stiffness }
    }
}

impl TryFrom<SystemForm> for SecondOrderSystem {
    type Error = ModelError;

    fn try_from(form: SystemForm) -> Result<Self, ModelError> {
        let dof = form.mass.len();
        let of = |which, rows: &[Vec<f64>]| {
            let wrong =
                |columns| ModelError::Shape { matrix: which, rows: rows.len(), columns, dof };
            matrix(rows, dof).map_err(wrong)
        };
        Self::new(
            of(Matrix::Mass, &form.mass)?,
            of(Matrix::Damping, &form.damping)?,
            of(Matrix::Stiffness, &form.stiffness)?,
        )
    }
}

impl From<UncertainSystem> for UncertainForm {
    fn from(uncertain: UncertainSystem) -> Self {
        Self {
            parameters: uncertain.parameters().iter().map(Parameter::to_string).collect(),
            covariance: rows(uncertain.covariance()),
            system: uncertain.system().clone(),
        }
    }
}

impl TryFrom<UncertainForm> for UncertainSystem {
    type Error = ModelError;

    fn try_from(form: UncertainForm) -> Result<Self, ModelError> {
        let (dof, parameters) = (form.system.dof(), form.parameters.len());
        let named = form.parameters.iter().map(|name| Parameter::named(name, dof));
        let named = named.collect::<Result<Vec<_>, _>>()?;
        let wrong = |columns| ModelError::CovarianceShape {
            rows: form.covariance.len(),
            columns,
            parameters,
        };
        let covariance = matrix(&form.covariance, parameters).map_err(wrong)?;
        Self::new(form.system, named, covariance)
    }
}

/// Linear system, its nonlinear terms as text, and their coefficients.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct NonlinearForm {
    system: SecondOrderSystem,
    terms: Terms,
    coefficients: Vec<f64>,
}

impl From<NonlinearSystem> for NonlinearForm {
    fn from(system: NonlinearSystem) -> Self {
        Self {
            terms: system.terms().clone(),
            coefficients: system.coefficients().to_vec(),
            system: system.linear().clone(),
        }
    }
}

impl TryFrom<NonlinearForm> for NonlinearSystem {
    type Error = ModelError;

    fn try_from(form: NonlinearForm) -> Result<Self, ModelError> {
        Self::new(form.system, form.terms, form.coefficients)
    }
}

fn rows(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
}

/// Creates a square matrix of this order from its rows; the error is the length of the first row
/// that does not fit.
fn matrix(rows: &[Vec<f64>], order: usize) -> Result<DMatrix<f64>, usize> {
    match rows.iter().find(|row| row.len() != order) {
        Some(row) => Err(row.len()),
        None if rows.len() != order => Err(order),
        None => Ok(DMatrix::from_fn(order, order, |row, column| rows[row][column])),
    }
}
