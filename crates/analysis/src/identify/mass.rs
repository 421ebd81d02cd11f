//! Known masses.

use std::str::FromStr;

use mechid_estimate::Unknowns;
use mechid_model::Matrix;
use serde::{Deserialize, Serialize};

use crate::AnalysisError;

/// Known masses, in kg: one per degree of freedom, or all n × n entries row by row, `None` for an
/// unknown mass; empty if all masses are unknown.
///
/// Written as numbers and `unknown`, separated by commas.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct KnownMass {
    /// Masses of the diagonal, or all n × n entries row by row, in kg.
    pub values: Vec<Option<f64>>,
}

/// Text of an unknown mass.
const UNKNOWN: &str = "unknown";

impl FromStr for KnownMass {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == UNKNOWN {
            return Ok(Self { values: Vec::new() });
        }
        let entry = |t: &str| match t.trim() {
            UNKNOWN => Ok(None),
            number => match number.parse::<f64>() {
                Ok(value) if value.is_finite() => Ok(Some(value)),
                Ok(value) => Err(format!("a mass must be finite, got {value} kg")),
                Err(_) => Err(format!("\"{t}\" is neither a number nor {UNKNOWN}")),
            },
        };
        Ok(Self { values: text.split(',').map(entry).collect::<Result<_, _>>()? })
    }
}

impl KnownMass {
    /// Returns the unknowns of a machine of `dof` degrees of freedom: damping, stiffness and the
    /// masses that are not known. If a diagonal is given, the other entries are zero.
    ///
    /// # Errors
    /// [`AnalysisError::Mass`], [`AnalysisError::MassCount`].
    pub fn unknowns(&self, dof: usize) -> Result<Unknowns, AnalysisError> {
        let mut unknowns = Unknowns::unknown_mass(dof)?;
        let got = self.values.len();
        let entry = |row: usize, column: usize| match got {
            _ if got == dof * dof => self.values[row * dof + column],
            _ if row == column => self.values[row],
            _ => Some(0.0),
        };
        match got {
            0 => return Ok(unknowns),
            _ if got == dof || got == dof * dof => {}
            _ => return Err(AnalysisError::MassCount { got, dof }),
        }
        for row in 0..dof {
            for column in 0..dof {
                let Some(value) = entry(row, column) else { continue };
                if row == column && !(value > 0.0 && value.is_finite()) {
                    return Err(AnalysisError::Mass { value });
                }
                unknowns = unknowns.fix(Matrix::Mass, row, column, value)?;
            }
        }
        Ok(unknowns)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;

    #[test]
    fn masses_are_a_diagonal_or_a_matrix() {
        let mass = |text: &str, dof| text.parse::<KnownMass>().unwrap().unknowns(dof);
        assert_eq!(mass("unknown", 2).unwrap().mass(), None);
        let two = DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 0.0, 2.0]);
        assert_eq!(mass("1,2", 2).unwrap().mass(), Some(two));
        let coupled = DMatrix::from_row_slice(2, 2, &[1.0, -0.5, -0.25, 2.0]);
        assert_eq!(mass("1,-0.5,-0.25,2", 2).unwrap().mass(), Some(coupled));
        let partly = mass("12.5,unknown", 2).unwrap();
        let fixed = |row, column| partly.fixed(Matrix::Mass, row, column);
        assert_eq!((fixed(0, 0), fixed(0, 1), fixed(1, 1)), (Some(12.5), Some(0.0), None));
        let partly = mass("1,unknown,0,2", 2).unwrap();
        let fixed = |row, column| partly.fixed(Matrix::Mass, row, column);
        assert_eq!((fixed(0, 1), fixed(1, 0), fixed(1, 1)), (None, Some(0.0), Some(2.0)));
        for (text, message) in [
            ("-3", "a mass must be positive and finite, got -3 kg"),
            ("0", "a mass must be positive and finite, got 0 kg"),
        ] {
            assert_eq!(mass(text, 1).unwrap_err().to_string(), message);
        }
        assert!(matches!(mass("1,2,3", 2), Err(AnalysisError::MassCount { got: 3, dof: 2 })));
        assert!("3 kg".parse::<KnownMass>().is_err());
        assert_eq!("inf".parse::<KnownMass>().unwrap_err(), "a mass must be finite, got inf kg");
    }
}
