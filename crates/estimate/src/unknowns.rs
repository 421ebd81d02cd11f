//! Free and known entries of M, C and K.

use mechid_model::{Matrix, Parameter};
use mechid_signal::message;
use nalgebra::DMatrix;

use crate::EstimateError;
use crate::error::NAMED_PARAMETERS;
use crate::relations::Relations;

/// Free entries of M, C and K, and the values of the known entries.
///
/// ```
/// use mechid_estimate::Unknowns;
/// use mechid_model::Matrix;
/// use nalgebra::dmatrix;
///
/// // The mass of the rotor is known, and the film does not couple the velocities.
/// let unknowns = Unknowns::known_mass(&dmatrix![14.8, 0.0; 0.0, 14.8])?
///     .fix(Matrix::Damping, 0, 1, 0.0)?
///     .fix(Matrix::Damping, 1, 0, 0.0)?;
/// let names: Vec<String> = unknowns.free().iter().map(|p| p.to_string()).collect();
/// assert_eq!(names, ["c11", "c22", "k11", "k12", "k21", "k22"]);
/// # Ok::<(), mechid_estimate::EstimateError>(())
/// ```
///
/// Entries may be related: [`Unknowns::symmetric`] makes the entries (i, j) and (j, i) one unknown,
/// and [`Unknowns::proportional_damping`] replaces the whole damping matrix by two unknowns.
/// Machines with many masses need such relations: without them the test must excite every entry
/// separately.
///
/// The feature `serde` writes three matrices, with `null` for a free entry, and the relations.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "form::UnknownsForm", into = "form::UnknownsForm"))]
pub struct Unknowns {
    dof: usize,
    /// Known entries of M, C and K; `None` for a free entry.
    fixed: [DMatrix<Option<f64>>; 3],
    /// True for each of M, C and K whose entries (i, j) and (j, i) are one unknown.
    symmetric: [bool; 3],
    /// True for C = αM + βK.
    proportional: bool,
}

impl Unknowns {
    /// Creates unknowns with every entry of C and K free and M (n×n, kg) known.
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

    /// Creates unknowns with every entry of M, C and K free.
    ///
    /// # Errors
    /// [`EstimateError::NoDof`] if `dof` is 0.
    pub fn unknown_mass(dof: usize) -> Result<Self, EstimateError> {
        if dof == 0 {
            return Err(EstimateError::NoDof);
        }
        let free = DMatrix::from_element(dof, dof, None);
        let fixed = [free.clone(), free.clone(), free];
        Ok(Self { dof, fixed, symmetric: [false; 3], proportional: false })
    }

    /// Returns the same unknowns with one entry known; `row` and `column` are counted from 0, and
    /// `value` is in kg, N·s/m or N/m.
    ///
    /// # Errors
    /// [`EstimateError::Model`] if there is no such entry, [`EstimateError::FixedValue`] unless
    /// `value` is finite, [`EstimateError::RelatedDamping`] for an entry of proportional damping.
    pub fn fix(
        mut self,
        matrix: Matrix,
        row: usize,
        column: usize,
        value: f64,
    ) -> Result<Self, EstimateError> {
        let parameter = Parameter::new(matrix, row, column, self.dof)?;
        if !value.is_finite() {
            return Err(EstimateError::FixedValue { parameter: parameter.to_string(), value });
        }
        if self.proportional && matrix == Matrix::Damping {
            return Err(EstimateError::RelatedDamping { parameter: parameter.to_string() });
        }
        self.set(matrix, row, column, Some(value));
        Ok(self)
    }

    /// Returns the same unknowns with one entry (counted from 0) free.
    ///
    /// # Errors
    /// [`EstimateError::Model`] if there is no such entry.
    pub fn release(
        mut self,
        matrix: Matrix,
        row: usize,
        column: usize,
    ) -> Result<Self, EstimateError> {
        Parameter::new(matrix, row, column, self.dof)?;
        self.set(matrix, row, column, None);
        Ok(self)
    }

    fn set(&mut self, matrix: Matrix, row: usize, column: usize, value: Option<f64>) {
        self.fixed[matrix as usize][(row, column)] = value;
        if self.symmetric[matrix as usize] {
            self.fixed[matrix as usize][(column, row)] = value;
        }
    }

    /// Returns the same unknowns with a symmetric matrix: its entries (i, j) and (j, i) are one
    /// unknown; if one of these two entries is known, both are known.
    ///
    /// # Errors
    /// [`EstimateError::Asymmetric`] if two such entries are known and differ.
    pub fn symmetric(mut self, matrix: Matrix) -> Result<Self, EstimateError> {
        let known = &mut self.fixed[matrix as usize];
        for row in 0..self.dof {
            for column in 0..row {
                let pair = [(row, column), (column, row)].map(|at| known[at]);
                if let [Some(lower), Some(upper)] = pair
                    && lower != upper
                {
                    return Err(EstimateError::Asymmetric {
                        lower: Parameter::new(matrix, row, column, self.dof)?.to_string(),
                        lower_value: lower,
                        upper: Parameter::new(matrix, column, row, self.dof)?.to_string(),
                        upper_value: upper,
                    });
                }
                let both = pair[0].or(pair[1]);
                (known[(row, column)], known[(column, row)]) = (both, both);
            }
        }
        self.symmetric[matrix as usize] = true;
        Ok(self)
    }

    /// Returns the same unknowns with proportional damping C = αM + βK: α (1/s) and β (s) are the
    /// only unknowns of the damping.
    ///
    /// # Errors
    /// [`EstimateError::RelatedDamping`] if an entry of the damping is known.
    ///
    /// # Source
    /// Rayleigh, *The Theory of Sound*, vol. 1 (1877), article 97.
    pub fn proportional_damping(mut self) -> Result<Self, EstimateError> {
        let damping = Parameter::all(self.dof).filter(|p| p.matrix() == Matrix::Damping);
        for p in damping {
            if self.fixed[Matrix::Damping as usize][(p.row(), p.column())].is_some() {
                return Err(EstimateError::RelatedDamping { parameter: p.to_string() });
            }
        }
        self.proportional = true;
        Ok(self)
    }

    /// Degrees of freedom n.
    pub fn dof(&self) -> usize {
        self.dof
    }

    /// Returns the known value of an entry (counted from 0) in kg, N·s/m or N/m; `None` if it is
    /// free.
    ///
    /// # Panics
    /// If there is no such entry.
    pub fn fixed(&self, matrix: Matrix, row: usize, column: usize) -> Option<f64> {
        if self.proportional && matrix == Matrix::Damping {
            let zero = |matrix: Matrix| self.fixed[matrix as usize][(row, column)] == Some(0.0);
            return (zero(Matrix::Mass) && zero(Matrix::Stiffness)).then_some(0.0);
        }
        self.fixed[matrix as usize][(row, column)]
    }

    /// Returns whether entries (i, j) and (j, i) of a matrix are one unknown. Proportional damping
    /// is symmetric if mass and stiffness are.
    pub fn is_symmetric(&self, matrix: Matrix) -> bool {
        let [mass, damping, stiffness] = self.symmetric;
        match matrix {
            Matrix::Damping => damping || self.proportional && mass && stiffness,
            Matrix::Mass | Matrix::Stiffness => self.symmetric[matrix as usize],
        }
    }

    /// Returns whether the damping is proportional to mass and stiffness.
    pub fn has_proportional_damping(&self) -> bool {
        self.proportional
    }

    /// Returns whether entries are related, by a symmetric matrix or proportional damping.
    pub fn is_related(&self) -> bool {
        self.proportional || self.symmetric.contains(&true)
    }

    /// Number of independent unknowns; without relations it is the number of entries of
    /// [`Unknowns::free`].
    pub fn independent(&self) -> usize {
        Relations::from_unknowns(self)
            .map_or_else(|| self.free().len(), |relations| relations.count())
    }

    /// Returns an error if entries are related, for an estimator that does not support relations.
    ///
    /// # Errors
    /// [`EstimateError::Related`], which names `estimator`.
    pub fn check_unrelated(&self, estimator: &'static str) -> Result<(), EstimateError> {
        if self.is_related() { Err(EstimateError::Related { estimator }) } else { Ok(()) }
    }

    /// Returns the free entries in the order of every covariance: M, C, K, each row by row.
    pub fn free(&self) -> Vec<Parameter> {
        let is_free = |p: &Parameter| self.fixed(p.matrix(), p.row(), p.column()).is_none();
        Parameter::all(self.dof).filter(is_free).collect()
    }

    /// Returns M (kg), C (N·s/m) and K (N/m), n×n each. The known entries have their values; the
    /// free entries have `values`, in the order of [`Unknowns::free`].
    ///
    /// # Panics
    /// If there are not as many values as free entries.
    pub fn assemble(&self, values: &[f64]) -> [DMatrix<f64>; 3] {
        let mut matrices = Matrix::ALL.map(|m| self.fixed[m as usize].map(|v| v.unwrap_or(0.0)));
        let free = self.free();
        assert_eq!(free.len(), values.len(), "one value per free entry");
        for (parameter, value) in free.iter().zip(values) {
            matrices[parameter.matrix() as usize][(parameter.row(), parameter.column())] = *value;
        }
        matrices
    }

    /// Returns M, n×n, in kg, if all its entries are known.
    pub fn mass(&self) -> Option<DMatrix<f64>> {
        let known = &self.fixed[Matrix::Mass as usize];
        let values: Option<Vec<f64>> = known.iter().copied().collect();
        values.map(|values| DMatrix::from_vec(self.dof, self.dof, values))
    }
}

#[cfg(feature = "serde")]
mod form {
    use std::ops::Not;

    use super::{EstimateError, Matrix, Unknowns};

    type Rows = Vec<Vec<Option<f64>>>;

    #[derive(serde::Serialize, serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    pub(super) struct UnknownsForm {
        mass: Rows,
        damping: Rows,
        stiffness: Rows,
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        symmetric: Vec<Matrix>,
        #[serde(default, skip_serializing_if = "Not::not")]
        proportional_damping: bool,
    }

    impl From<Unknowns> for UnknownsForm {
        fn from(unknowns: Unknowns) -> Self {
            let [mass, damping, stiffness] = unknowns
                .fixed
                .map(|m| m.row_iter().map(|row| row.iter().copied().collect()).collect());
            let symmetric = Matrix::ALL.into_iter().filter(|m| unknowns.symmetric[*m as usize]);
            Self {
                mass,
                damping,
                stiffness,
                symmetric: symmetric.collect(),
                proportional_damping: unknowns.proportional,
            }
        }
    }

    impl TryFrom<UnknownsForm> for Unknowns {
        type Error = EstimateError;

        fn try_from(form: UnknownsForm) -> Result<Self, EstimateError> {
            let dof = form.mass.len();
            let mut unknowns = Self::unknown_mass(dof)?;
            let matrices = [form.mass, form.damping, form.stiffness];
            for (matrix, entries) in Matrix::ALL.into_iter().zip(matrices) {
                let rows = entries.len();
                let wrong = entries.iter().map(Vec::len).find(|columns| *columns != dof);
                if rows != dof || wrong.is_some() {
                    let columns = wrong.unwrap_or(dof);
                    return Err(EstimateError::Shape { matrix, rows, columns, dof });
                }
                for (row, values) in entries.iter().enumerate() {
                    for (column, value) in values.iter().enumerate() {
                        if let Some(value) = value {
                            unknowns = unknowns.fix(matrix, row, column, *value)?;
                        }
                    }
                }
            }
            for matrix in form.symmetric {
                unknowns = unknowns.symmetric(matrix)?;
            }
            if form.proportional_damping { unknowns.proportional_damping() } else { Ok(unknowns) }
        }
    }
}

/// Returns the error for an equation of motion (counted from 0) that has neither a force nor a
/// known entry.
pub fn only_ratios(unknowns: &Unknowns, equation: usize) -> EstimateError {
    let of_equation = unknowns.free().into_iter().filter(|p| p.row() == equation);
    let parameters = message::list(of_equation, ", ", NAMED_PARAMETERS);
    EstimateError::OnlyRatios { dof: equation + 1, parameters }
}

#[cfg(test)]
mod tests {
    use nalgebra::dmatrix;

    use super::*;

    #[test]
    fn matrices_are_assembled_from_known_and_found_values() {
        let unknowns = Unknowns::known_mass(&dmatrix![3.0, 0.0; 0.0, 4.0]).unwrap();
        let unknowns = unknowns.fix(Matrix::Stiffness, 1, 0, 7.0).unwrap();
        assert_eq!(unknowns.mass(), Some(dmatrix![3.0, 0.0; 0.0, 4.0]));
        let [_, c, k] = unknowns.assemble(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0]);
        assert_eq!((c, k), (dmatrix![1.0, 2.0; 3.0, 4.0], dmatrix![5.0, 6.0; 7.0, 8.0]));
        assert_eq!(unknowns.release(Matrix::Mass, 0, 0).unwrap().mass(), None);
    }

    #[cfg(feature = "serde")]
    #[test]
    fn unknowns_are_written_as_matrices_and_read_back() {
        let mass = dmatrix![3.0, 0.0; 0.0, 4.0];
        let unknowns = Unknowns::known_mass(&mass).unwrap().fix(Matrix::Stiffness, 1, 0, 7.0);
        let unknowns = unknowns.unwrap();
        let mut written = serde_json::to_value(&unknowns).unwrap();
        assert_eq!(written["stiffness"], serde_json::json!([[null, null], [7.0, null]]));
        assert_eq!(serde_json::from_value::<Unknowns>(written.clone()).unwrap(), unknowns);
        written["damping"] = serde_json::json!([[null, null]]);
        let error = serde_json::from_value::<Unknowns>(written).unwrap_err();
        assert_eq!(error.to_string(), "the known damping matrix is 1×2, expected 2×2");
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
            "damping has no entry (3, 1): the system has 2 degrees of freedom"
        );
    }
}
