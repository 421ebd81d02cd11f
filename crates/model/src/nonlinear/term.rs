//! Nonlinear terms: a named coefficient, a force law, and its coordinate.

use std::collections::HashSet;
use std::fmt;
use std::sync::Arc;

use super::Law;
use crate::{ModelError, Parameter};

/// Displacement on which a force law depends, and the degrees of freedom of its force, counted from
/// 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Coordinate {
    /// x_i: between a degree of freedom and the ground.
    Dof(usize),
    /// x_i − x_j: between two degrees of freedom; the force is in equation i, its reaction in
    /// equation j.
    Difference(usize, usize),
}

impl Coordinate {
    /// Returns x_i, or x_i − x_j, from displacements or velocities with one entry per degree of
    /// freedom, in their unit.
    ///
    /// # Panics
    /// If there is no such degree of freedom.
    pub fn value(self, values: &[f64]) -> f64 {
        match self {
            Self::Dof(i) => values[i],
            Self::Difference(i, j) => values[i] - values[j],
        }
    }

    /// Returns the factor of the force in the equation of motion of a degree of freedom: 1, −1 or
    /// 0.
    pub fn sign(self, dof: usize) -> f64 {
        match self {
            Self::Dof(i) | Self::Difference(i, _) if i == dof => 1.0,
            Self::Difference(_, j) if j == dof => -1.0,
            _ => 0.0,
        }
    }

    /// Returns the degrees of freedom whose factor is not 0, with their factors.
    pub fn signs(self) -> impl Iterator<Item = (usize, f64)> {
        let (first, second) = match self {
            Self::Dof(i) => (i, None),
            Self::Difference(i, j) => (i, Some(j)),
        };
        std::iter::once((first, 1.0)).chain(second.map(|j| (j, -1.0)))
    }

    fn last_dof(self) -> usize {
        match self {
            Self::Dof(i) => i,
            Self::Difference(i, j) => i.max(j),
        }
    }

    /// Returns the names of the displacement and of the velocity in an expression.
    fn names(self) -> [String; 2] {
        ["x", "v"].map(|letter| match self {
            Self::Dof(i) => format!("{letter}{}", i + 1),
            Self::Difference(i, j) => format!("({letter}{}-{letter}{})", i + 1, j + 1),
        })
    }
}

/// Term θ f(q, q̇): a named coefficient θ, a [`Law`] f, and the [`Coordinate`] q.
///
/// Two terms are equal if their expressions are equal.
#[derive(Debug, Clone)]
pub struct Term {
    name: String,
    coordinate: Coordinate,
    law: Arc<dyn Law>,
}

impl Term {
    /// Creates a term from the name of its coefficient, its coordinate, and its law.
    ///
    /// # Errors
    /// [`ModelError::Term`] if the name does not begin with a letter, or contains a character other
    /// than letters, digits and `_`, or if the coordinate is the difference of a degree of freedom
    /// with itself.
    pub fn new(
        name: impl Into<String>,
        coordinate: Coordinate,
        law: impl Law + 'static,
    ) -> Result<Self, ModelError> {
        Self::from_parts(name.into(), coordinate, Arc::new(law))
    }

    pub(super) fn from_parts(
        name: String,
        coordinate: Coordinate,
        law: Arc<dyn Law>,
    ) -> Result<Self, ModelError> {
        let refused =
            |reason: &str| Err(ModelError::Term { text: name.clone(), reason: reason.to_owned() });
        let plain = |c: char| c.is_ascii_alphanumeric() || c == '_';
        if !name.starts_with(|c: char| c.is_ascii_alphabetic()) || !name.chars().all(plain) {
            return refused("a name begins with a letter and has letters, digits and _ only");
        }
        if let Coordinate::Difference(i, j) = coordinate
            && i == j
        {
            return refused("a difference must be of two different degrees of freedom");
        }
        Ok(Self { name, coordinate, law })
    }

    /// Name of the coefficient.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the coordinate of the force.
    pub fn coordinate(&self) -> Coordinate {
        self.coordinate
    }

    /// Returns the law of displacement and velocity.
    pub fn law(&self) -> &dyn Law {
        &*self.law
    }

    /// Returns the same term with other constants in its law, one for each of [`Law::constants`],
    /// in their units; `None` if a constant is out of range.
    pub fn with_constants(&self, values: &[f64]) -> Option<Self> {
        Some(Self { law: self.law.with_constants(values)?, ..self.clone() })
    }

    /// Returns f(q, q̇) for displacements (m) and velocities (m/s) with one entry per degree of
    /// freedom, in the unit of force (N) divided by the unit of the coefficient.
    pub fn value(&self, displacement: &[f64], velocity: &[f64]) -> f64 {
        self.law.value(self.coordinate.value(displacement), self.coordinate.value(velocity))
    }

    /// Returns the SI unit of the coefficient, such as `N/m³`.
    pub fn unit(&self) -> String {
        let [metre, second] = self.law.dimension();
        let power = |letter: &str, exponent: i32| match exponent {
            0 => String::new(),
            1 => letter.to_owned(),
            _ => format!("{letter}{}", superscript(exponent)),
        };
        let parts = [(metre, "m"), (second, "s")];
        let above: String = parts
            .iter()
            .filter(|(exponent, _)| *exponent < 0)
            .map(|(exponent, letter)| format!("·{}", power(letter, -exponent)))
            .collect();
        let below: Vec<String> = parts
            .iter()
            .filter(|(exponent, _)| *exponent > 0)
            .map(|(exponent, letter)| power(letter, *exponent))
            .collect();
        if below.is_empty() { format!("N{above}") } else { format!("N{above}/{}", below.join("/")) }
    }
}

impl fmt::Display for Term {
    /// Writes the term in the syntax of the parser, such as `k3: x1^3`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [q, v] = self.coordinate.names();
        write!(f, "{}: {}", self.name, self.law.expression(&q, &v))
    }
}

impl PartialEq for Term {
    fn eq(&self, other: &Self) -> bool {
        self.to_string() == other.to_string()
    }
}

/// A list of nonlinear terms with different names.
///
/// ```
/// use mechid_model::Terms;
///
/// let terms: Terms = "k3: x1^3, c2: |v1| v1, k12: (x1-x2)^3, f1: x1^0".parse()?;
/// let units: Vec<String> = terms.iter().map(|term| term.unit()).collect();
/// assert_eq!(units, ["N/m³", "N·s²/m²", "N/m³", "N"]);
/// // 2 m against 1 m: the cube of the difference.
/// assert_eq!(terms.iter().nth(2).unwrap().value(&[2.0, 1.0], &[0.0, 0.0]), 1.0);
/// # Ok::<(), mechid_model::ModelError>(())
/// ```
///
/// A term is written `name: expression`, terms are separated by commas. An expression is a product
/// of powers of `x1` and `v1` (displacement and velocity of degree of freedom 1; `x` and `v` mean
/// the same) or of `(x1-x2)` and `(v1-v2)`; `|v1| v1`; or, with numbers for a and b,
/// `v1^3/(1 + (v1/b)^2)`, a stop `gap(x1, a)` with the clearance a on either side, or friction
/// `tanh(v1/b)`.
#[derive(Debug, Clone, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "String", into = "String"))]
pub struct Terms(Vec<Term>);

impl Terms {
    /// Creates a list of terms.
    ///
    /// # Errors
    /// [`ModelError::RepeatedTerm`] if two terms have the same name.
    pub fn new(terms: Vec<Term>) -> Result<Self, ModelError> {
        let mut names = HashSet::with_capacity(terms.len());
        if let Some(repeated) = terms.iter().find(|term| !names.insert(term.name.as_str())) {
            return Err(ModelError::RepeatedTerm { name: repeated.name.clone() });
        }
        Ok(Self(terms))
    }

    /// Returns an empty list: a linear system.
    pub fn none() -> Self {
        Self::default()
    }

    /// Returns the terms in their order.
    pub fn iter(&self) -> std::slice::Iter<'_, Term> {
        self.0.iter()
    }

    /// Number of terms.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Returns whether there are no terms.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Returns the list with one more term.
    ///
    /// # Errors
    /// [`ModelError::RepeatedTerm`] if the list already has a term of this name.
    pub fn and(&self, term: Term) -> Result<Self, ModelError> {
        let mut terms = self.0.clone();
        terms.push(term);
        Self::new(terms)
    }

    /// Checks that the terms belong to a system of `dof` degrees of freedom.
    ///
    /// # Errors
    /// [`ModelError::Term`] if a term has a degree of freedom that the system does not have, or if
    /// its name is the name of an entry of M, C or K.
    pub fn check_dof(&self, dof: usize) -> Result<(), ModelError> {
        for term in &self.0 {
            let refused = |reason: String| Err(ModelError::Term { text: term.to_string(), reason });
            if term.coordinate.last_dof() >= dof {
                return refused(format!("the system has {dof} degrees of freedom"));
            }
            if Parameter::named(&term.name, dof).is_ok() {
                return refused(format!("{} is the name of an entry of M, C or K", term.name));
            }
        }
        Ok(())
    }

    /// Checks that there is one finite coefficient for each term, in its unit.
    ///
    /// # Errors
    /// [`ModelError::Coefficients`].
    pub fn check_coefficients(&self, coefficients: &[f64]) -> Result<(), ModelError> {
        if coefficients.len() == self.len() && coefficients.iter().all(|c| c.is_finite()) {
            return Ok(());
        }
        Err(ModelError::Coefficients { got: coefficients.len(), terms: self.len() })
    }
}

impl<'a> IntoIterator for &'a Terms {
    type Item = &'a Term;
    type IntoIter = std::slice::Iter<'a, Term>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

impl fmt::Display for Terms {
    /// Writes the terms in the syntax of the parser.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let terms: Vec<String> = self.0.iter().map(Term::to_string).collect();
        f.write_str(&terms.join(", "))
    }
}

impl From<Terms> for String {
    fn from(terms: Terms) -> Self {
        terms.to_string()
    }
}

fn superscript(number: i32) -> String {
    let digit = |c: char| match c {
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        c => char::from_u32('⁰' as u32 + c as u32 - '0' as u32).unwrap_or(c),
    };
    number.to_string().chars().map(digit).collect()
}
