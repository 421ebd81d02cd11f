//! NumPy arrays: inputs are copied, outputs are owned by Python.

use mechid::io::ParameterCovariance;
use mechid::model::ResponseQuantity;
use mechid::signal::Record;
use nalgebra::DMatrix;
use numpy::{Element, IntoPyArray as _, PyArray1, PyArray2, PyArrayMethods as _, PyReadonlyArray2};
use pyo3::prelude::*;

/// Returns a new array of rows × columns.
pub fn matrix<'py, T: Element + nalgebra::Scalar>(
    py: Python<'py>,
    matrix: DMatrix<T>,
) -> PyResult<Bound<'py, PyArray2<T>>> {
    let (rows, columns) = matrix.shape();
    let values: Vec<T> = matrix.data.into();
    // The storage order of nalgebra is column-major.
    let transposed = values.into_pyarray(py).reshape([columns, rows])?;
    transposed.transpose()
}

/// Copies an array with any memory layout.
pub fn copied(given: &PyReadonlyArray2<'_, f64>) -> DMatrix<f64> {
    let given = given.as_array();
    // The storage order of nalgebra is column-major.
    DMatrix::from_iterator(given.nrows(), given.ncols(), given.t().iter().copied())
}

/// Returns a new array of samples × channels.
pub fn record(py: Python<'_>, record: Record) -> PyResult<Bound<'_, PyArray2<f64>>> {
    matrix(py, record.into_data())
}

/// Returns a new vector.
pub fn vector<T: Element>(py: Python<'_>, values: Vec<T>) -> Bound<'_, PyArray1<T>> {
    values.into_pyarray(py)
}

/// Name of a kind of response, and the values of the response, samples × degrees of freedom.
pub type Named<'py> = (String, Bound<'py, PyArray2<f64>>);

/// Returns records with their names.
pub fn responses(
    py: Python<'_>,
    records: Vec<(ResponseQuantity, Record)>,
) -> PyResult<Vec<Named<'_>>> {
    let named = records.into_iter();
    named.map(|(kind, values)| Ok((kind.to_string(), record(py, values)?))).collect()
}

/// Names of parameters, and their covariance: parameters × parameters.
pub type Covariance<'py> = (Vec<String>, Bound<'py, PyArray2<f64>>);

/// Returns a covariance with the names of its parameters.
pub fn covariance<'py>(py: Python<'py>, found: &ParameterCovariance) -> PyResult<Covariance<'py>> {
    Ok((found.parameters.clone(), matrix(py, found.matrix())?))
}
