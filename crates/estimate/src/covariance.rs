//! Covariance of estimated parameters, as a full matrix or as the factors of a product.

use nalgebra::{Complex, DMatrix, DVector};

/// Covariance of parameters θ.
#[derive(Debug, Clone, PartialEq)]
pub enum Covariance {
    /// Full matrix, parameters × parameters; each entry is in the product of the SI units of its
    /// two parameters.
    Full(DMatrix<f64>),
    /// Factors, for equations that were solved one by one: n equations with 3n unknowns each have
    /// (3n²)² covariances, but about (3n)² numbers determine them all.
    Product(Product),
}

/// Factors of Cov(θ_p, θ_q) = S_ij h_p·h_q: S is the residual covariance of the equations, i and j
/// are the equations of the two parameters, and h are rows of the pseudo-inverses. Equations with
/// the same regressors share the rows h.
#[derive(Debug, Clone, PartialEq)]
pub struct Product {
    /// Residual covariance S, equations × equations; each entry is in the product of the SI units
    /// of its two equations.
    pub residual: DMatrix<f64>,
    /// Distinct rows h, one below the other, in inverse SI units of the regressors.
    pub rows: DMatrix<f64>,
    /// Index of the equation and index of the row h, one pair for each parameter.
    pub places: Vec<(usize, usize)>,
    /// Flags of the parameters: `true` if the data do not determine the parameter.
    pub open: Vec<bool>,
}

impl From<DMatrix<f64>> for Covariance {
    fn from(entries: DMatrix<f64>) -> Self {
        Self::Full(entries)
    }
}

impl Covariance {
    /// Returns the variance of one parameter, in the square of its SI unit.
    pub fn variance_of(&self, at: usize) -> f64 {
        match self {
            Self::Product(product) if product.open[at] => f64::INFINITY,
            _ => self.between(at, at),
        }
    }

    /// Returns the covariance of two parameters, in the product of their SI units; NaN if the data
    /// do not determine one of them.
    pub fn between(&self, p: usize, q: usize) -> f64 {
        match self {
            Self::Full(all) => all[(p, q)],
            Self::Product(product) if product.open[p] || product.open[q] => f64::NAN,
            Self::Product(Product { residual, rows, places, .. }) => {
                let ((i, h), (j, k)) = (places[p], places[q]);
                residual[(i, j)] * rows.row(h).dot(&rows.row(k))
            }
        }
    }

    /// Returns the covariance times `factor`, a pure number.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        match self {
            Self::Full(all) => Self::Full(all * factor),
            Self::Product(product) => {
                Self::Product(Product { residual: &product.residual * factor, ..product.clone() })
            }
        }
    }

    /// Marks a parameter that the data do not determine: its variance is infinite, its covariances
    /// are NaN.
    pub fn leave_open(&mut self, at: usize) {
        match self {
            Self::Full(all) => {
                all.row_mut(at).fill(f64::NAN);
                all.column_mut(at).fill(f64::NAN);
                all[(at, at)] = f64::INFINITY;
            }
            Self::Product(product) => product.open[at] = true,
        }
    }

    /// Returns all entries, parameters × parameters; each is in the product of the SI units of its
    /// two parameters.
    pub fn full(&self) -> DMatrix<f64> {
        match self {
            Self::Full(all) => all.clone(),
            Self::Product(Product { residual, rows, places, open }) => {
                let count = rows.nrows();
                let across = DMatrix::from_fn(count, count, |h, k| rows.row(h).dot(&rows.row(k)));
                DMatrix::from_fn(places.len(), places.len(), |p, q| {
                    let ((i, h), (j, k)) = (places[p], places[q]);
                    if !open[p] && !open[q] {
                        residual[(i, j)] * across[(h, k)]
                    } else if p == q {
                        f64::INFINITY
                    } else {
                        f64::NAN
                    }
                })
            }
        }
    }

    /// Returns the covariance of the sums f_i = Σ w_p θ_p over the parameters p of equation i:
    /// 2n×2n, real parts first. `weights` has one complex weight for each parameter, in any unit.
    ///
    /// # Source
    /// The law of propagation of uncertainty.
    pub fn covariance_of_sums(
        &self,
        weights: &[Complex<f64>],
        equations: &[usize],
        n: usize,
    ) -> DMatrix<f64> {
        let parts = || weights.iter().map(|w| [w.re, w.im]).zip(equations).enumerate();
        match self {
            Self::Full(all) => {
                let mut columns = DMatrix::zeros(all.nrows(), 2 * n);
                for (p, (weight, equation)) in parts() {
                    for (a, weight) in weight.into_iter().enumerate() {
                        columns.column_mut(a * n + equation).axpy(weight, &all.column(p), 1.0);
                    }
                }
                let mut sums = DMatrix::zeros(2 * n, 2 * n);
                let by_parameter = columns.transpose();
                for (p, (weight, equation)) in parts() {
                    for (a, weight) in weight.into_iter().enumerate() {
                        let column = by_parameter.column(p);
                        sums.column_mut(a * n + equation).axpy(weight, &column, 1.0);
                    }
                }
                sums
            }
            Self::Product(Product { residual, rows, places, .. }) => {
                let by_row = rows.transpose();
                let mut sums = DMatrix::zeros(by_row.nrows(), 2 * n);
                for ((_, (weight, i)), (_, h)) in parts().zip(places) {
                    for (a, weight) in weight.into_iter().enumerate() {
                        sums.column_mut(a * n + i).axpy(weight, &by_row.column(*h), 1.0);
                    }
                }
                let mut sums = sums.tr_mul(&sums);
                for (i, j) in (0..2 * n).flat_map(|i| (0..2 * n).map(move |j| (i, j))) {
                    sums[(i, j)] *= residual[(i % n, j % n)];
                }
                sums
            }
        }
    }

    /// Returns the variance gᵀ Σ g of a linear combination gᵀθ.
    /// The gradient has one entry per parameter, in inverse SI units.
    pub fn variance(&self, gradient: &DVector<f64>) -> f64 {
        match self {
            Self::Full(all) => gradient.dot(&(all * gradient)),
            Self::Product(Product { residual, rows, places, .. }) => {
                // Σ_ij S_ij y_i·y_j, where y_i is the sum of the rows of the parameters of equation
                // i.
                let by_row = rows.transpose();
                let mut sums = DMatrix::zeros(rows.ncols(), residual.nrows());
                for (weight, (i, h)) in gradient.iter().zip(places) {
                    sums.column_mut(*i).axpy(*weight, &by_row.column(*h), 1.0);
                }
                sums.tr_mul(&sums).dot(residual)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_product_is_the_sum_of_its_entries() {
        let number = |i: usize, j: usize| ((3 * i + 5 * j + 1) as f64).sin();
        let root = DMatrix::from_fn(3, 3, number);
        let mut product = Covariance::Product(Product {
            residual: &root * root.transpose(),
            rows: DMatrix::from_fn(4, 6, number),
            places: vec![(0, 0), (0, 1), (1, 0), (1, 1), (2, 2), (2, 3)],
            open: vec![false; 6],
        });
        let full = product.full();
        assert!((&full - full.transpose()).amax() < 1e-15);
        for (p, q) in (0..6).flat_map(|p| (0..6).map(move |q| (p, q))) {
            assert!((product.between(p, q) - full[(p, q)]).abs() < 1e-15);
        }
        let gradient = DVector::from_fn(6, |at, _| number(at, 2));
        let expected = gradient.dot(&(&full * &gradient));
        let weight = |at: usize| Complex::new(number(at, 1), number(at, 7));
        let weights: Vec<_> = (0..6).map(weight).collect();
        let equations = [0, 0, 1, 1, 2, 2];
        let sums = DMatrix::from_fn(6, 6, |row, at| match equations[at] {
            equation if equation != row % 3 => 0.0,
            _ if row < 3 => weights[at].re,
            _ => weights[at].im,
        });
        let expected_sums = &sums * &full * sums.transpose();
        let mut full = Covariance::Full(full);
        for covariance in [&product, &full] {
            let sums = covariance.covariance_of_sums(&weights, &equations, 3);
            assert!((sums - &expected_sums).amax() < 1e-13 * expected_sums.amax());
        }
        for covariance in [&mut product, &mut full] {
            assert!((covariance.variance(&gradient) / expected - 1.0).abs() < 1e-13);
            covariance.leave_open(3);
            assert_eq!(covariance.variance_of(3), f64::INFINITY);
        }
        let (product, full) = (product.full(), full.full());
        for (p, q) in product.iter().zip(&full) {
            assert!(p == q || p.is_nan() && q.is_nan());
        }
    }
}
