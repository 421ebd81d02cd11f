//! Known form of M, C and K.

use std::fmt;
use std::str::FromStr;

use mechid_estimate::Unknowns;
use mechid_model::{Matrix, Parameter};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::AnalysisError;

/// Statements on the form of M, C and K, which reduce the number of unknowns; none by default.
///
/// ```
/// use mechid_analysis::identify::Structure;
///
/// let chain: Structure = "chain proportional-damping".parse()?;
/// let unknowns = chain.apply(mechid_estimate::Unknowns::unknown_mass(3)?)?;
/// // Three masses, five entries of the stiffness, two factors of the damping.
/// assert_eq!(unknowns.independent(), 10);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Structure {
    /// Statements on the form of M, C and K, in any order.
    pub forms: Vec<Form>,
}

/// One statement on the form of M, C and K.
#[derive(Debug, Clone, PartialEq)]
pub enum Form {
    /// M, C and K are symmetric.
    Symmetric,
    /// Masses in a row, each joined by springs and dampers to its neighbours and to the ground: M
    /// is diagonal, C and K are symmetric and tridiagonal.
    Chain,
    /// M is diagonal.
    DiagonalMass,
    /// C = αM + βK.
    ProportionalDamping,
    /// An entry is known.
    Entry {
        /// Name, such as `k12`.
        name: String,
        /// Value, in its SI unit.
        value: f64,
    },
}

/// Forms without a number, as they are written.
const WORDS: [(&str, Form); 4] = [
    ("symmetric", Form::Symmetric),
    ("chain", Form::Chain),
    ("diagonal-mass", Form::DiagonalMass),
    ("proportional-damping", Form::ProportionalDamping),
];

impl FromStr for Form {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if let Some((_, form)) = WORDS.into_iter().find(|(word, _)| *word == text) {
            return Ok(form);
        }
        let Some((name, value)) = text.split_once('=') else {
            let words = WORDS.map(|(word, _)| word).join(", ");
            return Err(format!("\"{text}\" is neither one of {words} nor an entry such as k13=0"));
        };
        match value.trim().parse::<f64>() {
            Ok(value) if value.is_finite() => {
                Ok(Self::Entry { name: name.trim().to_owned(), value })
            }
            _ => Err(format!("\"{value}\" is not a value of {name}")),
        }
    }
}

impl fmt::Display for Form {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Entry { name, value } => write!(f, "{name}={value}"),
            other => {
                let word = WORDS.iter().find(|(_, form)| form == other);
                f.write_str(word.map_or("", |(word, _)| word))
            }
        }
    }
}

impl Serialize for Form {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Form {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(serde::de::Error::custom)
    }
}

impl FromStr for Structure {
    type Err = String;

    /// Reads statements that are separated by spaces.
    fn from_str(text: &str) -> Result<Self, String> {
        Ok(Self { forms: text.split_whitespace().map(str::parse).collect::<Result<_, _>>()? })
    }
}

impl Structure {
    /// Returns true if the structure contains no statement.
    pub fn is_empty(&self) -> bool {
        self.forms.is_empty()
    }

    /// Returns the unknowns that remain after all statements are applied.
    ///
    /// # Errors
    /// [`AnalysisError::Estimate`] if a stated entry does not exist, and this error or
    /// [`AnalysisError::Setting`] if statements or known masses contradict each other.
    pub fn apply(&self, mut unknowns: Unknowns) -> Result<Unknowns, AnalysisError> {
        let has = |form: Form| self.forms.contains(&form);
        let (chain, proportional) = (has(Form::Chain), has(Form::ProportionalDamping));
        let dof = unknowns.dof();
        for p in Parameter::all(dof) {
            let distance = p.row().abs_diff(p.column());
            let zero = match p.matrix() {
                Matrix::Mass => distance > 0 && (chain || has(Form::DiagonalMass)),
                Matrix::Damping => distance > 1 && chain && !proportional,
                Matrix::Stiffness => distance > 1 && chain,
            };
            if zero && unknowns.fixed(p.matrix(), p.row(), p.column()).is_none() {
                unknowns = unknowns.fix(p.matrix(), p.row(), p.column(), 0.0)?;
            }
        }
        for matrix in Matrix::ALL {
            let of_chain = chain && matrix != Matrix::Mass;
            if has(Form::Symmetric) || of_chain {
                unknowns = unknowns.symmetric(matrix)?;
            }
        }
        for form in &self.forms {
            if let Form::Entry { name, value } = form {
                let p =
                    Parameter::named(name, dof).map_err(mechid_estimate::EstimateError::from)?;
                let before = unknowns.fixed(p.matrix(), p.row(), p.column());
                if let Some(before) = before.filter(|before| before != value) {
                    let why = format!(
                        "{name}={value}: this entry is already fixed at {before}, by a known value or another structure"
                    );
                    return Err(AnalysisError::Setting { setting: "structure", why });
                }
                unknowns = unknowns.fix(p.matrix(), p.row(), p.column(), *value)?;
            }
        }
        Ok(if proportional { unknowns.proportional_damping()? } else { unknowns })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unknowns(text: &str, dof: usize) -> Result<Unknowns, AnalysisError> {
        text.parse::<Structure>().unwrap().apply(Unknowns::unknown_mass(dof).unwrap())
    }

    #[test]
    fn statements_leave_fewer_unknowns() {
        for (text, independent) in [
            ("", 27),
            ("symmetric", 18),
            ("diagonal-mass", 21),
            ("diagonal-mass symmetric", 15),
            ("chain", 13),
            ("chain proportional-damping", 10),
            ("symmetric proportional-damping", 14),
            ("symmetric k13=0", 17),
            ("m11=2.5 c12=-1e3", 25),
        ] {
            assert_eq!(unknowns(text, 3).unwrap().independent(), independent, "{text}");
        }
        let known = unknowns("symmetric k13=-2", 3).unwrap();
        assert_eq!(known.fixed(Matrix::Stiffness, 2, 0), Some(-2.0));
    }

    #[test]
    fn statements_survive_json() {
        let all = "symmetric chain diagonal-mass proportional-damping k13=-2.5";
        let structure: Structure = all.parse().unwrap();
        let saved = serde_json::to_value(&structure).unwrap();
        assert_eq!(saved[4], "k13=-2.5");
        assert_eq!(serde_json::from_value::<Structure>(saved).unwrap(), structure);
    }

    #[test]
    fn entries_that_are_something_else_already_are_refused() {
        for text in ["chain k13=2", "k12=5 k12=6", "symmetric k12=5 k21=6", "diagonal-mass m12=1"] {
            let refused = unknowns(text, 3).unwrap_err().to_string();
            assert!(refused.contains("already"), "{text}: {refused}");
        }
        for text in ["chain k13=0", "symmetric k12=5 k21=5", "k12=5 k21=6"] {
            assert!(unknowns(text, 3).is_ok(), "{text}");
        }
    }

    #[test]
    fn what_makes_no_sense_is_refused() {
        for (text, message) in [
            (
                "chains",
                "\"chains\" is neither one of symmetric, chain, diagonal-mass, proportional-damping nor an entry \
                 such as k13=0",
            ),
            ("k13=soft", "\"soft\" is not a value of k13"),
            ("k13=inf", "\"inf\" is not a value of k13"),
        ] {
            assert_eq!(text.parse::<Structure>().unwrap_err(), message);
        }
        assert!(unknowns("k14=0", 3).is_err());
        assert!(unknowns("proportional-damping c12=0", 3).is_err());
    }
}
