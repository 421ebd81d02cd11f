//! The covariance of identified parameters.

use std::path::Path;

use mechid_signal::message;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use crate::{IoError, json};

/// Covariance of identified parameters: the `covariance` of the report that `mechid identify
/// --json` prints, which [`read_covariance`] reads back.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ParameterCovariance {
    /// Names of the parameters, such as `k12`.
    pub parameters: Vec<String>,
    /// One row and one column per parameter, in products of their SI units.
    pub matrix: Vec<Vec<f64>>,
    /// Degrees of freedom of the variance estimate.
    pub degrees_of_freedom: usize,
}

impl ParameterCovariance {
    /// Creates a covariance from a square matrix, one row and column per parameter, in the products
    /// of their units.
    pub fn new(parameters: Vec<String>, matrix: &DMatrix<f64>, degrees_of_freedom: usize) -> Self {
        let matrix = matrix.row_iter().map(|row| row.iter().copied().collect()).collect();
        Self { parameters, matrix, degrees_of_freedom }
    }

    /// Returns the matrix, one row and column per parameter, in the products of their units (kg,
    /// N·s/m, N/m).
    ///
    /// # Panics
    /// If the number or the length of the rows differs from the number of parameters, which
    /// [`read_covariance`] excludes.
    pub fn matrix(&self) -> DMatrix<f64> {
        let n = self.parameters.len();
        DMatrix::from_fn(n, n, |row, column| self.matrix[row][column])
    }
}

/// Reads the covariance in a JSON report (`-`: standard input), if it has one.
///
/// # Errors
/// [`IoError::Read`], [`IoError::NotJson`], [`IoError::Json`], [`IoError::Undetermined`] if an
/// entry is null (JSON writes infinite numbers as null), and [`IoError::Description`] if the
/// covariance does not have one row and one column per parameter, or if it has a negative variance.
pub fn read_covariance(path: impl AsRef<Path>) -> Result<Option<ParameterCovariance>, IoError> {
    #[derive(Deserialize)]
    struct Described {
        covariance: Option<Written>,
    }
    #[derive(Deserialize)]
    struct Written {
        parameters: Vec<String>,
        matrix: Vec<Vec<Option<f64>>>,
        degrees_of_freedom: usize,
    }
    let (file, described) = json::read::<Described>(path.as_ref())?;
    let Some(covariance) = described.covariance else { return Ok(None) };
    let n = covariance.parameters.len();
    let wrong = |what: String| IoError::Description { file: file.clone(), what };
    if covariance.matrix.len() != n || covariance.matrix.iter().any(|row| row.len() != n) {
        return Err(wrong(format!(
            "the covariance of {} must be a {n}×{n} matrix",
            message::count(n, "parameter")
        )));
    }
    let Written { parameters, matrix, degrees_of_freedom } = covariance;
    let missing = |row: &usize| matrix[*row].iter().any(Option::is_none);
    // A parameter without a variance has no covariances either, so that the rows of all other
    // parameters have gaps, too. Only the parameters without a variance are then reported.
    let without_variance = |row: &usize| matrix[*row][*row].is_none();
    let rows = if (0..n).any(|row| without_variance(&row)) {
        (0..n).filter(without_variance).collect::<Vec<_>>()
    } else {
        (0..n).filter(missing).collect()
    };
    if !rows.is_empty() {
        let names: Vec<&str> = rows.iter().map(|row| parameters[*row].as_str()).collect();
        return Err(IoError::Undetermined { file, parameters: names.join(", ") });
    }
    let matrix: Vec<Vec<f64>> =
        matrix.into_iter().map(|row| row.into_iter().flatten().collect()).collect();
    for (row, name) in parameters.iter().enumerate() {
        let variance = matrix[row][row];
        if variance < 0.0 {
            return Err(wrong(format!(
                "the variance of {name} is {}, less than zero",
                message::number(variance)
            )));
        }
    }
    Ok(Some(ParameterCovariance { parameters, matrix, degrees_of_freedom }))
}
