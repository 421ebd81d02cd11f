//! What is known of the mass.

use std::str::FromStr;

use mechid::estimate::Unknowns;
use nalgebra::{DMatrix, DVector};

use crate::error::CliError;

/// The masses given on the command line; empty if they are to be found.
#[derive(Debug, Clone, PartialEq)]
pub struct KnownMass {
    values: Vec<f64>,
}

impl FromStr for KnownMass {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "unknown" {
            return Ok(Self { values: Vec::new() });
        }
        let number = |t: &str| t.trim().parse().map_err(|_| format!("\"{t}\" is not a number"));
        Ok(Self { values: text.split(',').map(number).collect::<Result<_, _>>()? })
    }
}

impl KnownMass {
    /// Damping and stiffness free, and the mass unless it is given: its diagonal, or all entries
    /// row by row.
    ///
    /// # Errors
    /// [`CliError::Mass`], [`CliError::MassCount`].
    pub fn unknowns(&self, dof: usize) -> Result<Unknowns, CliError> {
        let got = self.values.len();
        let mass = match got {
            0 => return Ok(Unknowns::unknown_mass(dof)?),
            _ if got == dof => DMatrix::from_diagonal(&DVector::from_column_slice(&self.values)),
            _ if got == dof * dof => DMatrix::from_row_slice(dof, dof, &self.values),
            _ => return Err(CliError::MassCount { got, dof }),
        };
        let bad = |m: &&f64| !(**m > 0.0 && m.is_finite());
        if let Some(&value) = mass.diagonal().iter().find(bad) {
            return Err(CliError::Mass { value });
        }
        Ok(Unknowns::known_mass(&mass)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masses_are_a_diagonal_or_a_matrix() {
        let mass = |text: &str, dof| text.parse::<KnownMass>().unwrap().unknowns(dof);
        assert_eq!(mass("unknown", 2).unwrap().mass(), None);
        let two = DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 0.0, 2.0]);
        assert_eq!(mass("1,2", 2).unwrap().mass(), Some(two));
        let coupled = DMatrix::from_row_slice(2, 2, &[1.0, -0.5, -0.25, 2.0]);
        assert_eq!(mass("1,-0.5,-0.25,2", 2).unwrap().mass(), Some(coupled));
        for (text, message) in [
            ("-3", "a mass must be positive and finite, got -3 kg"),
            ("0", "a mass must be positive and finite, got 0 kg"),
            ("inf", "a mass must be positive and finite, got inf kg"),
        ] {
            assert_eq!(mass(text, 1).unwrap_err().to_string(), message);
        }
        assert!(matches!(mass("1,2,3", 2), Err(CliError::MassCount { got: 3, dof: 2 })));
        assert!("3 kg".parse::<KnownMass>().is_err());
    }
}
