//! Entries of M, C and K, by index and by name.

use std::fmt;

use crate::{Matrix, ModelError};

/// One entry of M, C or K of a system of n degrees of freedom; rows and columns are counted from 0,
/// names from 1.
///
/// ```
/// use mechid_model::{Matrix, Parameter};
///
/// let k12 = Parameter::new(Matrix::Stiffness, 0, 1, 2)?;
/// assert_eq!(k12.to_string(), "k12");
/// assert_eq!(Parameter::named("k12", 2)?, k12);
/// # Ok::<(), mechid_model::ModelError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Parameter {
    matrix: Matrix,
    row: usize,
    column: usize,
    dof: usize,
}

impl Parameter {
    /// Creates the parameter of entry (`row`, `column`), counted from 0, of a matrix of order
    /// `dof`.
    ///
    /// # Errors
    /// [`ModelError::NoSuchEntry`] if the entry is outside the matrix.
    pub fn new(matrix: Matrix, row: usize, column: usize, dof: usize) -> Result<Self, ModelError> {
        if row >= dof || column >= dof {
            let (row, column) = (row.saturating_add(1), column.saturating_add(1));
            return Err(ModelError::NoSuchEntry { matrix, row, column, dof });
        }
        Ok(Self { matrix, row, column, dof })
    }

    /// Returns all entries for `dof` degrees of freedom, in the order that covariances use: M, C,
    /// K, each row by row.
    pub fn all(dof: usize) -> impl Iterator<Item = Self> {
        Matrix::ALL.into_iter().flat_map(move |matrix| {
            let entry = move |at| Self { matrix, row: at / dof, column: at % dof, dof };
            (0..dof * dof).map(entry)
        })
    }

    /// Returns the entry of this name, such as `k12`, for `dof` degrees of freedom.
    ///
    /// # Errors
    /// [`ModelError::NoSuchParameter`] if the system has no parameter of this name.
    pub fn named(name: &str, dof: usize) -> Result<Self, ModelError> {
        Self::read(name, dof)
            .filter(|parameter| parameter.to_string() == name)
            .ok_or_else(|| ModelError::NoSuchParameter { name: name.to_owned(), dof })
    }

    /// Returns the entry with a name such as `k12`, or `k1,12` for ten or more degrees of freedom.
    fn read(name: &str, dof: usize) -> Option<Self> {
        let matrix = Matrix::ALL.into_iter().find(|matrix| name.starts_with(matrix.letter()))?;
        let numbers = &name[matrix.letter().len_utf8()..];
        let (row, column) = match dof {
            1 => ("1", "1"),
            2..=9 => numbers.split_at_checked(1)?,
            _ => numbers.split_once(',')?,
        };
        let index = |text: &str| text.parse::<usize>().ok()?.checked_sub(1);
        Self::new(matrix, index(row)?, index(column)?, dof).ok()
    }

    /// Returns the matrix of the entry.
    pub fn matrix(&self) -> Matrix {
        self.matrix
    }

    /// Returns the row, counted from 0: the degree of freedom of the equation of motion.
    pub fn row(&self) -> usize {
        self.row
    }

    /// Returns the column, counted from 0: the degree of freedom of the response.
    pub fn column(&self) -> usize {
        self.column
    }

    /// Degrees of freedom of the system, n.
    pub fn dof(&self) -> usize {
        self.dof
    }
}

impl fmt::Display for Parameter {
    /// Writes `k12`; with one degree of freedom `k`; with ten or more `k1,12`.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_count_from_one_and_are_read_back() {
        for (dof, at, name) in [(1, 2, "k"), (2, 5, "c12"), (2, 10, "k21"), (12, 11, "m1,12")] {
            let parameter = Parameter::all(dof).nth(at).unwrap();
            assert_eq!(parameter.to_string(), name);
            assert_eq!(Parameter::named(name, dof), Ok(parameter));
        }
        assert_eq!(Parameter::all(3).count(), 27);
    }

    #[test]
    fn names_of_large_systems_are_read_without_a_search() {
        let dof = 1 << 40;
        let last = Parameter::new(Matrix::Stiffness, 0, dof - 1, dof).unwrap();
        assert_eq!(Parameter::named(&last.to_string(), dof), Ok(last));
        for name in ["k1", "k01,2", "k+1,2", "k0,1", "k1,2,3", "x1,2", "κ1,2", ""] {
            let error = Parameter::named(name, dof).unwrap_err().to_string();
            assert!(error.ends_with("m1,1 … k1099511627776,1099511627776"), "{error}");
        }
    }

    #[test]
    fn entries_that_do_not_exist_are_refused() {
        assert_eq!(
            Parameter::new(Matrix::Damping, 2, 0, 2).unwrap_err().to_string(),
            "damping has no entry (3, 1): the system has 2 degrees of freedom"
        );
        assert_eq!(
            Parameter::named("k33", 2).unwrap_err().to_string(),
            "a system of 2 degrees of freedom has no parameter `k33`: its parameters are m11 … k22"
        );
        assert!(Parameter::named("k11", 1).is_err());
    }
}
