//! Linearisation by QR decomposition.

use nalgebra::{DMatrix, DVector};

use super::Linearisation;
use crate::triangular::TriangularFactor;

/// Triangle \[R q\] of \[J r\], with the columns of J scaled to unit length: one QR decomposition,
/// which is used for every damping.
///
/// # Source
/// Nocedal & Wright, *Numerical Optimization*, section 10.3; scaling after Moré (1978).
#[derive(Debug, Clone)]
pub struct Triangle {
    r: DMatrix<f64>,
    q: DVector<f64>,
    gradient: DVector<f64>,
    /// Lengths of the columns of the Jacobian.
    scale: DVector<f64>,
}

/// Triangle R of JᵀJ + λI = RᵀR, and the step R⁻¹q, with λ the damping.
#[derive(Debug, Clone)]
pub struct DampedTriangle {
    r: DMatrix<f64>,
    step: DVector<f64>,
}

impl Triangle {
    /// Creates the linearisation from the Jacobian (residuals × parameters) and the residual; if
    /// one of them is not finite, the linearisation has no step.
    pub fn new(jacobian: &DMatrix<f64>, residual: &DVector<f64>) -> Self {
        let columns = jacobian.ncols();
        let mut factor = TriangularFactor::new(columns + 1);
        let is_finite = factor.push(&[jacobian.as_view(), residual.as_view()]);
        // If a value is not finite, the factor has no rows; a matrix of NaN is then used as its
        // triangle.
        let none = || DMatrix::from_element(columns + 1, columns + 1, f64::NAN);
        let mut upper = if is_finite { factor.r().clone() } else { none() };
        let mut scale = DVector::from_element(columns, 1.0);
        for (length, mut column) in scale.iter_mut().zip(upper.column_iter_mut()) {
            // The columns of R have the same lengths as the columns of J.
            if column.norm() > 0.0 {
                *length = column.norm();
                column /= *length;
            }
        }
        let r = upper.view((0, 0), (columns, columns)).into_owned();
        let q = upper.view((0, columns), (columns, 1)).column(0).into_owned();
        Self { gradient: r.tr_mul(&q), r, q, scale }
    }

    /// Returns the triangle of \[R q; √λ I 0\], with λ the damping.
    fn damped(&self, damping: f64) -> (DMatrix<f64>, DVector<f64>) {
        let columns = self.r.ncols();
        let mut stacked = DMatrix::zeros(2 * columns, columns + 1);
        stacked.view_mut((0, 0), (columns, columns)).copy_from(&self.r);
        stacked.view_mut((0, columns), (columns, 1)).copy_from(&self.q);
        for j in 0..columns {
            stacked[(columns + j, j)] = damping.sqrt();
        }
        let upper = stacked.qr().unpack_r();
        let right = upper.view((0, columns), (columns, 1)).column(0).into_owned();
        (upper.view((0, 0), (columns, columns)).into_owned(), right)
    }
}

impl Linearisation for Triangle {
    type Factor = DampedTriangle;

    fn gradient(&self) -> &DVector<f64> {
        &self.gradient
    }

    fn factor(&self, damping: f64) -> Option<DampedTriangle> {
        let (r, right) =
            if damping > 0.0 { self.damped(damping) } else { (self.r.clone(), self.q.clone()) };
        let step = r.solve_upper_triangular(&right)?;
        step.iter().all(|value| value.is_finite()).then_some(DampedTriangle { r, step })
    }

    fn solve(&self, factor: &DampedTriangle, right: &DVector<f64>) -> DVector<f64> {
        let mut solution = right.clone();
        // The factor exists, because its diagonal has no zero.
        let solved = factor.r.tr_solve_upper_triangular_mut(&mut solution)
            && factor.r.solve_upper_triangular_mut(&mut solution);
        debug_assert!(solved, "a factor has a regular triangle");
        solution
    }

    fn step(&self, factor: &DampedTriangle) -> DVector<f64> {
        factor.step.clone()
    }

    fn decrease(&self, v: &DVector<f64>) -> f64 {
        -(2.0 * self.gradient.dot(v) + (&self.r * v).norm_squared())
    }

    fn coordinates(&self, parameters: &DVector<f64>) -> DVector<f64> {
        parameters.component_mul(&self.scale)
    }

    fn parameters(&self, coordinates: &DVector<f64>) -> DVector<f64> {
        coordinates.component_div(&self.scale)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A search may reach parameters at which the response overflows. The linearisation at these
    /// parameters must have no step, for any number of rows.
    #[test]
    fn a_jacobian_that_is_not_finite_has_no_step() {
        for rows in [1, 100, 40_000] {
            let mut jacobian = DMatrix::from_fn(rows, 2, |i, j| (i + j) as f64);
            jacobian[(rows - 1, 1)] = f64::INFINITY;
            let triangle = Triangle::new(&jacobian, &DVector::zeros(rows));
            for damping in [0.0, 1e-3] {
                assert!(triangle.factor(damping).is_none(), "{rows} rows, damping {damping}");
            }
        }
    }
}
