//! Linear equations solved in a Krylov space.

use nalgebra::{DMatrix, DVector};

use crate::error::NumericsError;
use crate::krylov::arnoldi::Arnoldi;
use crate::linear_algebra::singular_values;

/// Solution of (I − Φ) y = b in a Krylov space.
#[derive(Debug, Clone)]
pub struct Solution {
    /// The solution y, n entries, in the unit of b.
    pub vector: DVector<f64>,
    /// ‖b − (I − Φ) y‖ / ‖b‖, a pure number.
    pub residual: f64,
    /// Number of products with Φ.
    pub products: usize,
    /// Smallest singular value of I − Φ in the space relative to the largest, a pure number.
    pub reciprocal_condition: f64,
}

/// Solves (I − Φ) y = b for `right` = b (n entries) to a relative residual of `tolerance` (a pure
/// number), in a space of at most `most` dimensions (GMRES); `apply` writes Φ v into its second
/// argument.
///
/// # Errors
/// The error of `apply`, and [`NumericsError`] if a decomposition fails.
///
/// # Source
/// Saad & Schultz, "GMRES: a generalized minimal residual algorithm", *SIAM J. Sci. Stat. Comput.*
/// 7 (1986).
pub fn solve<E: From<NumericsError>>(
    right: &DVector<f64>,
    tolerance: f64,
    most: usize,
    mut apply: impl FnMut(&[f64], &mut [f64]) -> Result<(), E>,
) -> Result<Solution, E> {
    let norm = right.norm();
    let most = most.min(right.len());
    let nothing = DVector::zeros(right.len());
    if norm == 0.0 {
        return Ok(Solution {
            vector: nothing,
            residual: 0.0,
            products: 0,
            reciprocal_condition: 1.0,
        });
    }
    let mut space = Arnoldi::new(right.clone(), most);
    let mut triangle = Triangle::new(norm, most);
    loop {
        let j = space.size();
        let more = space.extend(&mut apply)?;
        let entry = |i: usize| f64::from(u8::from(i == j)) - space.hessenberg[(i, j)];
        triangle.append((0..j + 2).map(entry).collect());
        let residual = triangle.residual() / norm;
        if more && residual > tolerance {
            continue;
        }
        let (coordinates, reciprocal_condition) = triangle.solve()?;
        let residual = if coordinates.is_some() { residual } else { 1.0 };
        let vector = coordinates.map_or(nothing, |y| space.combined(y.as_slice()));
        return Ok(Solution { vector, residual, products: j + 1, reciprocal_condition });
    }
}

/// Least squares with I − H, which has one more row than columns; rotations of neighbouring rows
/// make it triangular. H is the matrix of Φ in the Krylov space.
struct Triangle {
    entries: DMatrix<f64>,
    /// Cosine and sine of each rotation.
    rotations: Vec<[f64; 2]>,
    /// The rotated right-hand side.
    right: Vec<f64>,
}

impl Triangle {
    fn new(norm: f64, most: usize) -> Self {
        let entries = DMatrix::zeros(most, most);
        Self { entries, rotations: Vec::with_capacity(most), right: vec![norm] }
    }

    /// Appends a column; the last entry of the column is below the diagonal.
    fn append(&mut self, mut column: Vec<f64>) {
        let j = self.rotations.len();
        for (i, [cos, sin]) in self.rotations.iter().enumerate() {
            let [upper, lower] = [column[i], column[i + 1]];
            column[i] = cos * upper + sin * lower;
            column[i + 1] = cos * lower - sin * upper;
        }
        let length = column[j].hypot(column[j + 1]);
        let [cos, sin] =
            if length > 0.0 { [column[j] / length, column[j + 1] / length] } else { [1.0, 0.0] };
        column[j] = length;
        self.entries.view_mut((0, j), (j + 1, 1)).copy_from_slice(&column[..=j]);
        self.rotations.push([cos, sin]);
        self.right.push(-sin * self.right[j]);
        self.right[j] *= cos;
    }

    /// Returns the norm of the least-squares residual.
    fn residual(&self) -> f64 {
        self.right[self.rotations.len()].abs()
    }

    /// Returns the solution, if it is finite, and the reciprocal of the condition number of the
    /// triangle.
    fn solve(&self) -> Result<(Option<DVector<f64>>, f64), NumericsError> {
        let len = self.rotations.len();
        let triangle = self.entries.view((0, 0), (len, len));
        let sizes = singular_values(triangle.into_owned())?;
        let right = DVector::from_column_slice(&self.right[..len]);
        let solution = triangle.solve_upper_triangular(&right);
        let solution = solution.filter(|y| y.iter().all(|value| value.is_finite()));
        let reciprocal_condition = if solution.is_some() { sizes.min() / sizes.max() } else { 0.0 };
        Ok((solution, reciprocal_condition))
    }
}
