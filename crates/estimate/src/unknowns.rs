//! Which entries of M, C and K are to be found, and which are known.

use std::fmt;

use mechid_model::Matrix;
use nalgebra::DMatrix;

use crate::EstimateError;

/// One entry of M, C or K; rows and columns are counted from 0, names from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Parameter {
    matrix: Matrix,
    row: usize,
    column: usize,
    dof: usize,
}

impl Parameter {
    /// The matrix it is an entry of.
    pub fn matrix(&self) -> Matrix {
        self.matrix
    }

    /// Row, counted from 0: the degree of freedom whose equation of motion it stands in.
    pub fn row(&self) -> usize {
        self.row
    }

    /// Column, counted from 0: the degree of freedom whose motion it multiplies.
    pub fn column(&self) -> usize {
        self.column
    }
}

impl fmt::Display for Parameter {
    /// `k12`; with one degree of freedom `k`; with ten or more `k1,12`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (letter, row, column) = (self.matrix.letter(), self.row + 1, self.column + 1);
        let name = match self.dof {
            1 => letter.to_string(),
            2..=9 => format!("{letter}{row}{column}"),
            _ => format!("{letter}{row},{column}"),
        };
        f.pad(&name)
    }
}

/// The three matrices, in the order of the parameters.
pub(crate) const MATRICES: [Matrix; 3] = [Matrix::Mass, Matrix::Damping, Matrix::Stiffness];

/// Which entries of M, C and K are free, and the values of those that are not.
///
/// ```
/// use mechid_estimate::Unknowns;
/// use mechid_model::Matrix;
/// use nalgebra::dmatrix;
///
/// // The rotor's mass is known, and the film does not couple the velocities.
/// let unknowns = Unknowns::known_mass(&dmatrix![14.8, 0.0; 0.0, 14.8])?
///     .fix(Matrix::Damping, 0, 1, 0.0)?
///     .fix(Matrix::Damping, 1, 0, 0.0)?;
/// let names: Vec<String> = unknowns.free().iter().map(|p| p.to_string()).collect();
/// assert_eq!(names, ["c11", "c22", "k11", "k12", "k21", "k22"]);
/// # Ok::<(), mechid_estimate::EstimateError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Unknowns {
    dof: usize,
    /// M, C, K: `None` where the entry is free.
    fixed: [DMatrix<Option<f64>>; 3],
}

impl Unknowns {
    /// Every entry of C and K is free, M (n×n, kg) is known.
    ///
    /// # Errors
    /// [`EstimateError::NoDof`], [`EstimateError::Shape`], [`EstimateError::FixedValue`].
    pub fn known_mass(mass: &DMatrix<f64>) -> Result<Self, EstimateError> {
        let (dof, columns) = mass.shape();
        if dof != columns {
            let matrix = Matrix::Mass;
            return Err(EstimateError::Shape { matrix, rows: dof, columns, dof });
        }
        let mut unknowns = Self::unknown_mass(dof)?;
        for row in 0..dof {
            for column in 0..dof {
                unknowns = unknowns.fix(Matrix::Mass, row, column, mass[(row, column)])?;
            }
        }
        Ok(unknowns)
    }

    /// Every entry of M, C and K is free.
    ///
    /// # Errors
    /// [`EstimateError::NoDof`] if `dof` is 0.
    pub fn unknown_mass(dof: usize) -> Result<Self, EstimateError> {
        if dof == 0 {
            return Err(EstimateError::NoDof);
        }
        let free = DMatrix::from_element(dof, dof, None);
        Ok(Self { dof, fixed: [free.clone(), free.clone(), free] })
    }

    /// The same, with one entry (counted from 0) known: kg, N·s/m or N/m.
    ///
    /// # Errors
    /// [`EstimateError::NoSuchEntry`], [`EstimateError::FixedValue`] unless `value` is finite.
    pub fn fix(
        mut self,
        matrix: Matrix,
        row: usize,
        column: usize,
        value: f64,
    ) -> Result<Self, EstimateError> {
        let parameter = self.entry(matrix, row, column)?;
        if !value.is_finite() {
            return Err(EstimateError::FixedValue { parameter: parameter.to_string(), value });
        }
        self.fixed[matrix as usize][(row, column)] = Some(value);
        Ok(self)
    }

    /// The same, with one entry (counted from 0) to be found.
    ///
    /// # Errors
    /// [`EstimateError::NoSuchEntry`].
    pub fn release(
        mut self,
        matrix: Matrix,
        row: usize,
        column: usize,
    ) -> Result<Self, EstimateError> {
        self.entry(matrix, row, column)?;
        self.fixed[matrix as usize][(row, column)] = None;
        Ok(self)
    }

    /// Degrees of freedom n.
    pub fn dof(&self) -> usize {
        self.dof
    }

    /// The known value of an entry (counted from 0) in kg, N·s/m or N/m; `None` if it is free.
    ///
    /// # Panics
    /// If there is no such entry.
    pub fn fixed(&self, matrix: Matrix, row: usize, column: usize) -> Option<f64> {
        self.fixed[matrix as usize][(row, column)]
    }

    /// The free entries in the order of every covariance: M, C, K, each row by row.
    pub fn free(&self) -> Vec<Parameter> {
        let n = self.dof;
        let entries = MATRICES.into_iter().flat_map(|matrix| {
            (0..n * n).map(move |at| Parameter { matrix, row: at / n, column: at % n, dof: n })
        });
        entries.filter(|p| self.fixed(p.matrix, p.row, p.column).is_none()).collect()
    }

    /// The three matrices with the known values in place and `values` (in the order of
    /// [`Unknowns::free`]) in the free entries: M (kg), C (N·s/m) and K (N/m), n×n each.
    ///
    /// # Panics
    /// If there are not as many values as free entries.
    pub fn assemble(&self, values: &[f64]) -> [DMatrix<f64>; 3] {
        let mut matrices = MATRICES.map(|m| self.fixed[m as usize].map(|v| v.unwrap_or(0.0)));
        let free = self.free();
        assert_eq!(free.len(), values.len(), "one value per free entry");
        for (parameter, value) in free.iter().zip(values) {
            matrices[parameter.matrix as usize][(parameter.row, parameter.column)] = *value;
        }
        matrices
    }

    /// M, n×n, in kg, if all of it is known.
    pub fn mass(&self) -> Option<DMatrix<f64>> {
        let known = &self.fixed[Matrix::Mass as usize];
        let values: Option<Vec<f64>> = known.iter().copied().collect();
        values.map(|values| DMatrix::from_vec(self.dof, self.dof, values))
    }

    fn entry(&self, matrix: Matrix, row: usize, column: usize) -> Result<Parameter, EstimateError> {
        let dof = self.dof;
        if row >= dof || column >= dof {
            let (row, column) = (row + 1, column + 1);
            return Err(EstimateError::NoSuchEntry { matrix, row, column, dof });
        }
        Ok(Parameter { matrix, row, column, dof })
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::dmatrix;

    use super::*;

    fn names(unknowns: &Unknowns) -> Vec<String> {
        unknowns.free().iter().map(Parameter::to_string).collect()
    }

    #[test]
    fn names_count_from_one_and_are_bare_letters_for_one_degree_of_freedom() {
        assert_eq!(names(&Unknowns::unknown_mass(1).unwrap()), ["m", "c", "k"]);
        let two = Unknowns::known_mass(&DMatrix::identity(2, 2)).unwrap();
        assert_eq!(names(&two), ["c11", "c12", "c21", "c22", "k11", "k12", "k21", "k22"]);
        assert_eq!(names(&Unknowns::unknown_mass(12).unwrap())[11], "m1,12");
    }

    #[test]
    fn matrices_are_assembled_from_known_and_found_values() {
        let unknowns = Unknowns::known_mass(&dmatrix![3.0, 0.0; 0.0, 4.0]).unwrap();
        let unknowns = unknowns.fix(Matrix::Stiffness, 1, 0, 7.0).unwrap();
        assert_eq!(unknowns.mass(), Some(dmatrix![3.0, 0.0; 0.0, 4.0]));
        let [_, c, k] = unknowns.assemble(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0]);
        assert_eq!((c, k), (dmatrix![1.0, 2.0; 3.0, 4.0], dmatrix![5.0, 6.0; 7.0, 8.0]));
        assert_eq!(unknowns.release(Matrix::Mass, 0, 0).unwrap().mass(), None);
    }

    #[test]
    fn bad_knowledge_is_refused() {
        assert_eq!(Unknowns::unknown_mass(0), Err(EstimateError::NoDof));
        assert!(matches!(
            Unknowns::known_mass(&DMatrix::zeros(2, 3)),
            Err(EstimateError::Shape { rows: 2, columns: 3, .. })
        ));
        assert!(matches!(
            Unknowns::known_mass(&dmatrix![f64::NAN]),
            Err(EstimateError::FixedValue { .. })
        ));
        let two = Unknowns::unknown_mass(2).unwrap();
        assert_eq!(
            two.fix(Matrix::Damping, 2, 0, 0.0).unwrap_err().to_string(),
            "damping has no entry (3, 1): the problem has 2 degrees of freedom"
        );
    }
}
