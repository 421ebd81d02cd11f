//! Linear systems M ẍ + C ẋ + K x = F.

use std::fmt;

use nalgebra::{DMatrix, DVector, Dyn, LU};

use crate::limits;
use crate::{ModelError, Parameter};
use mechid_numerics::linear_algebra::singular_values;

/// One of the three matrices of a [`SecondOrderSystem`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Matrix {
    /// Mass matrix M, in kg.
    Mass,
    /// Damping matrix C, in N·s/m.
    Damping,
    /// Stiffness matrix K, in N/m.
    Stiffness,
}

impl Matrix {
    /// Matrices M, C, K, in the order that covariances use.
    pub const ALL: [Self; 3] = [Self::Mass, Self::Damping, Self::Stiffness];

    /// Returns the letter of the entries of this matrix: `m`, `c` or `k`.
    pub fn letter(self) -> char {
        match self {
            Matrix::Mass => 'm',
            Matrix::Damping => 'c',
            Matrix::Stiffness => 'k',
        }
    }

    /// Returns the SI unit of the entries of this matrix (translational degrees of freedom).
    pub fn unit(self) -> &'static str {
        match self {
            Matrix::Mass => "kg",
            Matrix::Damping => "N·s/m",
            Matrix::Stiffness => "N/m",
        }
    }
}

impl fmt::Display for Matrix {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Matrix::Mass => "mass",
            Matrix::Damping => "damping",
            Matrix::Stiffness => "stiffness",
        })
    }
}

/// Linear system M ẍ + C ẋ + K x = F with n degrees of freedom; M invertible, C and K of any
/// symmetry.
///
/// ```text
/// ┌ m11 … m1n ┐ ┌ ẍ1 ┐   ┌ c11 … c1n ┐ ┌ ẋ1 ┐   ┌ k11 … k1n ┐ ┌ x1 ┐   ┌ F1 ┐
/// │  ⋮      ⋮ │ │ ⋮  │ + │  ⋮      ⋮ │ │ ⋮  │ + │  ⋮      ⋮ │ │ ⋮  │ = │ ⋮  │
/// └ mn1 … mnn ┘ └ ẍn ┘   └ cn1 … cnn ┘ └ ẋn ┘   └ kn1 … knn ┘ └ xn ┘   └ Fn ┘
/// ```
///
/// # Source
/// Dissertation eq. (3.2.1); Bathe (1982), eq. (9.1).
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(try_from = "crate::serde_forms::SystemForm", into = "crate::serde_forms::SystemForm")
)]
pub struct SecondOrderSystem {
    mass: DMatrix<f64>,
    damping: DMatrix<f64>,
    stiffness: DMatrix<f64>,
}

impl SecondOrderSystem {
    /// Creates a system from its n×n matrices M (kg), C (N·s/m) and K (N/m).
    ///
    /// # Errors
    /// [`ModelError::Shape`], [`ModelError::NotFinite`], [`ModelError::NoDof`], and
    /// [`ModelError::SingularMass`] if the singular values of M span more than 15 decades. For more
    /// than 64 degrees of freedom, the largest and the smallest singular value are estimated by
    /// iteration.
    pub fn new(
        mass: DMatrix<f64>,
        damping: DMatrix<f64>,
        stiffness: DMatrix<f64>,
    ) -> Result<Self, ModelError> {
        let dof = mass.nrows();
        if dof == 0 {
            return Err(ModelError::NoDof);
        }
        for (matrix, entries) in
            [(Matrix::Mass, &mass), (Matrix::Damping, &damping), (Matrix::Stiffness, &stiffness)]
        {
            check(matrix, entries, dof)?;
        }
        // Solvers use the LU decomposition of M. This check therefore also refuses an M whose
        // factor U is singular.
        let factored = mass.clone().lu();
        let reciprocal_condition = reciprocal_condition(&mass, &factored);
        let invertible = factored.is_invertible();
        if !invertible || reciprocal_condition.is_nan() || reciprocal_condition < 1e-15 {
            return Err(ModelError::SingularMass { reciprocal_condition });
        }
        Ok(Self { mass, damping, stiffness })
    }

    /// Number of degrees of freedom n.
    pub fn dof(&self) -> usize {
        self.mass.nrows()
    }

    /// Mass matrix M, n×n, in kg.
    pub fn mass(&self) -> &DMatrix<f64> {
        &self.mass
    }

    /// Damping matrix C, n×n, in N·s/m.
    pub fn damping(&self) -> &DMatrix<f64> {
        &self.damping
    }

    /// Stiffness matrix K, n×n, in N/m.
    pub fn stiffness(&self) -> &DMatrix<f64> {
        &self.stiffness
    }

    /// Returns the same system with one entry increased by `by` (kg, N·s/m or N/m).
    ///
    /// # Errors
    /// [`ModelError::NoSuchParameter`] if the entry belongs to a system of another size; otherwise
    /// the errors of [`SecondOrderSystem::new`].
    pub fn changed(&self, entry: Parameter, by: f64) -> Result<Self, ModelError> {
        if entry.dof() != self.dof() {
            let (name, dof) = (entry.to_string(), self.dof());
            return Err(ModelError::NoSuchParameter { name, dof });
        }
        let [m, c, k] = Matrix::ALL.map(|which| {
            let mut matrix = self.matrix(which).clone();
            if which == entry.matrix() {
                matrix[(entry.row(), entry.column())] += by;
            }
            matrix
        });
        Self::new(m, c, k)
    }

    /// Returns one of the three matrices, n×n, in kg, N·s/m or N/m.
    pub fn matrix(&self, which: Matrix) -> &DMatrix<f64> {
        match which {
            Matrix::Mass => &self.mass,
            Matrix::Damping => &self.damping,
            Matrix::Stiffness => &self.stiffness,
        }
    }
}

/// Returns the ratio of the smallest to the largest singular value of M.
fn reciprocal_condition(mass: &DMatrix<f64>, factored: &LU<f64, Dyn, Dyn>) -> f64 {
    let n = mass.nrows();
    if n <= limits::SINGULAR_VALUES_DOF {
        let Ok(values) = singular_values(mass.clone()) else { return 0.0 };
        return if values.max() > 0.0 { values.min() / values.max() } else { 0.0 };
    }
    if !factored.is_invertible() {
        return 0.0;
    }
    let (lower, upper) = (factored.l(), factored.u());
    let mut large = DVector::from_fn(n, |i, _| 1.0 + 0.37 * (i % 5) as f64);
    let mut small = large.clone();
    // A few iterations are enough for the order of magnitude of the singular values.
    for _ in 0..6 {
        large = mass.tr_mul(&(mass * large.normalize()));
        small.normalize_mut();
        // The transposed matrix of M = Pᵀ L U is Uᵀ Lᵀ P.
        let solved = upper.tr_solve_upper_triangular_mut(&mut small)
            && lower.tr_solve_lower_triangular_mut(&mut small);
        if !solved {
            return 0.0;
        }
        factored.p().inv_permute_rows(&mut small);
        factored.solve_mut(&mut small);
    }
    (large.norm() * small.norm()).sqrt().recip()
}

fn check(matrix: Matrix, entries: &DMatrix<f64>, dof: usize) -> Result<(), ModelError> {
    let (rows, columns) = entries.shape();
    if (rows, columns) != (dof, dof) {
        return Err(ModelError::Shape { matrix, rows, columns, dof });
    }
    match entries.iter().position(|v| !v.is_finite()) {
        None => Ok(()),
        Some(at) => Err(ModelError::NotFinite {
            matrix,
            row: at % dof + 1,
            column: at / dof + 1,
            value: entries[at],
        }),
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::dmatrix;

    use super::*;

    /// Returns a mass matrix whose singular values are 1, except one that is `least`: a diagonal
    /// matrix transformed by a reflection.
    fn spread(n: usize, least: f64) -> DMatrix<f64> {
        let v = DVector::from_fn(n, |i, _| (1.0 + i as f64).sin()).normalize();
        let turn = DMatrix::identity(n, n) - 2.0 * &v * v.transpose();
        let values = DVector::from_fn(n, |i, _| if i == 3 { least } else { 1.0 });
        &turn * DMatrix::from_diagonal(&values) * &turn
    }

    #[test]
    fn the_condition_of_large_matrices_is_estimated() {
        for (n, least) in [(40, 1e-5), (65, 1e-5), (90, 1e-12), (80, 1.0)] {
            let mass = spread(n, least);
            let found = reciprocal_condition(&mass, &mass.clone().lu());
            assert!((0.3..3.0).contains(&(found / least)), "{n} {least}: {found}");
        }
        let zero = || DMatrix::zeros(80, 80);
        let refused = SecondOrderSystem::new(spread(80, 1e-17), zero(), zero());
        assert!(matches!(refused, Err(ModelError::SingularMass { .. })), "{refused:?}");
        assert!(SecondOrderSystem::new(spread(80, 1e-12), zero(), zero()).is_ok());
    }

    #[test]
    fn bad_matrices_are_refused_with_their_numbers() {
        let (m, c, k) = (dmatrix![2.0], dmatrix![0.1], dmatrix![8.0]);
        assert!(SecondOrderSystem::new(m.clone(), c.clone(), k.clone()).is_ok());
        assert_eq!(
            SecondOrderSystem::new(m.clone(), DMatrix::zeros(1, 2), k.clone()),
            Err(ModelError::Shape { matrix: Matrix::Damping, rows: 1, columns: 2, dof: 1 })
        );
        assert!(matches!(
            SecondOrderSystem::new(m, c, dmatrix![f64::NAN]),
            Err(ModelError::NotFinite { matrix: Matrix::Stiffness, row: 1, column: 1, .. })
        ));
        let z = DMatrix::zeros(2, 2);
        assert_eq!(
            SecondOrderSystem::new(dmatrix![1.0, 1.0; 1.0, 1.0], z.clone(), z)
                .map(|_| ())
                .unwrap_err()
                .to_string()
                .split(" (")
                .next(),
            Some("the mass matrix is singular")
        );
        let e = DMatrix::zeros(0, 0);
        assert_eq!(SecondOrderSystem::new(e.clone(), e.clone(), e), Err(ModelError::NoDof));
    }
}
