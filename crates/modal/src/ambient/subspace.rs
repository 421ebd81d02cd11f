//! Covariance-driven stochastic subspace identification (SSI-cov): poles and shapes of models of
//! rising order, from the covariances of the outputs. The poles and shapes are the initial
//! estimates for the search for the maximum of the likelihood.

use nalgebra::{Complex, DMatrix};
use rayon::prelude::*;

use crate::decomposition;
use crate::stabilisation::{Pole, Stabilisation};

/// Returns the poles and shapes of models of all `orders` (rising) from zero-mean data, samples ×
/// outputs.
///
/// `block_rows` is the number of block rows of the Hankel matrix of the covariances; the largest
/// lag, in samples, is nearly twice `block_rows`. `None` if there are fewer samples than lags, or a
/// decomposition fails.
///
/// # Source
/// Peeters & De Roeck (1999), Mechanical Systems and Signal Processing 13, 855–878; Van Overschee &
/// De Moor, *Subspace Identification for Linear Systems* (1996).
pub fn ssi_cov(
    samples: &DMatrix<f64>,
    sample_interval: f64,
    block_rows: usize,
    orders: &[usize],
) -> Option<Stabilisation> {
    let (len, outputs) = samples.shape();
    let highest = *orders.last()?;
    if len < 4 * block_rows || (block_rows - 1) * outputs < highest {
        return None;
    }
    let covariances: Vec<DMatrix<f64>> = (1..2 * block_rows)
        .into_par_iter()
        .map(|lag| {
            let later = samples.rows(lag, len - lag);
            later.tr_mul(&samples.rows(0, len - lag)) / (len - lag) as f64
        })
        .collect();
    let (rows, columns) = (block_rows * outputs, block_rows * outputs);
    let hankel = DMatrix::from_fn(rows, columns, |i, j| {
        covariances[i / outputs + j / outputs][(i % outputs, j % outputs)]
    });
    let observability = decomposition::svd(hankel)?.u?.columns(0, highest).into_owned();
    let upper = observability.rows(0, rows - outputs).into_owned();
    let lower = observability.rows(outputs, rows - outputs);
    let (q, r) = upper.qr().unpack();
    // The leading parts of the matrices belong to lower orders, so one factorisation is enough for
    // all orders.
    let projected = q.tr_mul(&lower);
    let output = observability.rows(0, outputs);
    let models: Option<Vec<_>> = orders
        .par_iter()
        .map(|&order| {
            let right = projected.view((0, 0), (order, order)).into_owned();
            let triangle = r.view((0, 0), (order, order)).into_owned();
            let transition = triangle.solve_upper_triangular(&right)?;
            let output = output.columns(0, order).into_owned();
            Some((order, poles(&transition, &output, sample_interval)?))
        })
        .collect();
    Some(Stabilisation::new(models?))
}

/// Returns the decaying oscillations of a discrete transition matrix with their shapes.
fn poles(transition: &DMatrix<f64>, output: &DMatrix<f64>, dt: f64) -> Option<Vec<Pole>> {
    let output = output.map(Complex::from);
    let mut poles = Vec::new();
    for eigenvalue in decomposition::eigenvalues(transition)? {
        let pole = eigenvalue.ln() / dt;
        if !(pole.im > 0.0 && pole.re < 0.0 && eigenvalue.norm() > 0.0) {
            continue;
        }
        if let Some(state) = decomposition::eigenvector(transition, eigenvalue) {
            let shape = &output * state;
            let norm = shape.norm();
            if norm > 0.0 {
                poles.push(Pole { pole, vector: shape / Complex::from(norm) });
            }
        }
    }
    Some(poles)
}
