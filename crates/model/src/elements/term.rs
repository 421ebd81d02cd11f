//! Terms of the dynamic stiffness K + iωC − ω²M of a machine.

use nalgebra::{Complex, DMatrix};

/// Frequency factor of a term of the dynamic stiffness.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Power {
    /// Factor 1.
    Stiffness,
    /// Factor i.
    Hysteresis,
    /// Factor iω.
    Damping,
    /// Factor iωΩ, with the rotor speed Ω.
    Gyroscopic,
    /// Factor −ω².
    Mass,
}

impl Power {
    /// Returns the frequency factor of a term at `omega` and the rotor speed `speed`, both in
    /// rad/s.
    pub fn factor(self, omega: f64, speed: f64) -> Complex<f64> {
        match self {
            Self::Stiffness => Complex::new(1.0, 0.0),
            Self::Hysteresis => Complex::new(0.0, 1.0),
            Self::Damping => Complex::new(0.0, omega),
            Self::Gyroscopic => Complex::new(0.0, omega * speed),
            Self::Mass => Complex::new(-omega * omega, 0.0),
        }
    }

    /// Returns the frequency factor of a term at an eigenvalue `s` and the rotor speed `speed`,
    /// both in rad/s.
    pub fn at_eigenvalue(self, s: Complex<f64>, speed: f64) -> Complex<f64> {
        match self {
            Self::Stiffness => Complex::new(1.0, 0.0),
            Self::Hysteresis => Complex::new(0.0, s.im.signum()),
            Self::Damping => s,
            Self::Gyroscopic => s * speed,
            Self::Mass => s * s,
        }
    }
}

/// Entries of the dynamic stiffness to which a term contributes. Index n, the number of degrees of
/// freedom, is the support, whose motion is prescribed.
#[derive(Debug, Clone, PartialEq)]
pub enum Pattern {
    /// Matrix a bᵀ, given by the non-zero entries of a and b.
    Dyad {
        /// Non-zero entries of the vector `a`, pure numbers, each with its index.
        left: Vec<(usize, f64)>,
        /// Non-zero entries of the vector `b`, pure numbers, each with its index.
        right: Vec<(usize, f64)>,
    },
    /// A d × d matrix over some degrees of freedom.
    Block {
        /// Degrees of freedom of the rows and columns.
        dofs: Vec<usize>,
        /// Entries of the matrix, row by row.
        matrix: DMatrix<f64>,
        /// Matrix column that belongs to the motion of the support, d entries.
        support: Vec<f64>,
    },
}

/// Part of the dynamic stiffness: pattern × frequency factor × scale × product of parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Term {
    /// Entries of the dynamic stiffness to which the term contributes.
    pub pattern: Pattern,
    /// Frequency factor.
    pub power: Power,
    /// Known factor.
    pub scale: f64,
    /// Parameters whose product is the unknown factor; empty for a known term.
    pub parameters: Vec<usize>,
}

impl Term {
    /// Returns scale × product of parameters; each parameter is in its own unit.
    pub fn value(&self, parameters: &[f64]) -> f64 {
        self.parameters.iter().fold(self.scale, |product, at| product * parameters[*at])
    }

    /// Returns each parameter with the derivative of [`Term::value`] with respect to it, in the
    /// unit of the value divided by the unit of the parameter.
    pub fn derivatives<'a>(
        &'a self,
        parameters: &'a [f64],
    ) -> impl Iterator<Item = (usize, f64)> + 'a {
        self.parameters.iter().enumerate().map(move |(place, at)| {
            let other_factors =
                self.parameters.iter().enumerate().filter(move |(other, _)| *other != place);
            (
                *at,
                other_factors.fold(self.scale, |product, (_, other)| product * parameters[*other]),
            )
        })
    }

    /// Returns whether the term has no parameter.
    pub fn is_known(&self) -> bool {
        self.parameters.is_empty()
    }

    /// Calls `add` with every entry (row, column, value) of the pattern. Column `dof`, the number
    /// of degrees of freedom, belongs to the support. Rows of the support are omitted, because the
    /// motion of the support is prescribed.
    pub fn for_each_entry(&self, dof: usize, mut add: impl FnMut(usize, usize, f64)) {
        match &self.pattern {
            Pattern::Dyad { left, right } => {
                for (row, a) in left.iter().filter(|(row, _)| *row < dof) {
                    right.iter().for_each(|(column, b)| add(*row, *column, a * b));
                }
            }
            Pattern::Block { dofs, matrix, support } => {
                for (i, row) in dofs.iter().enumerate() {
                    for (j, column) in dofs.iter().enumerate() {
                        if matrix[(i, j)] != 0.0 {
                            add(*row, *column, matrix[(i, j)]);
                        }
                    }
                    if support[i] != 0.0 {
                        add(*row, dof, support[i]);
                    }
                }
            }
        }
    }
}
