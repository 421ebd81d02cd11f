//! Equations of motion that the data determine only up to factors, although they determine the
//! modes.

use std::fmt;

use mechid_estimate::{EstimateError, Unknowns};
use mechid_model::Matrix;
use serde::Serialize;

use crate::AnalysisError;

/// Equations of motion whose entries of M, C and K the data do not determine, although they
/// determine the modes.
///
/// If no force acts on a degree of freedom and no entry of its equation is known, this equation may
/// be multiplied by any number. It may also be added to any other equation, if the entry of M that
/// couples that equation to this degree of freedom is unknown. Neither changes the responses to the
/// forces, the poles or the mode shapes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Unscaled {
    /// Degrees of freedom without force and without known entry in their equation, counted from 1.
    pub degrees_of_freedom: Vec<usize>,
    /// Equations, rows of M, C and K, whose entries are not reported, counted from 1.
    pub equations: Vec<usize>,
}

impl Unscaled {
    /// Calls `fit`. If `fit` refuses equations without scale, calls it again with unknowns that
    /// give these equations a scale and keep the modes. The forces act on the degrees of freedom
    /// `driven`, counted from 0.
    ///
    /// # Errors
    /// The errors of `fit`.
    pub(super) fn or_fitted<T>(
        unknowns: &Unknowns,
        driven: &[usize],
        fit: impl Fn(&Unknowns) -> Result<T, AnalysisError>,
    ) -> Result<(T, Option<Self>), AnalysisError> {
        let mut free = without_force(unknowns, driven);
        let (mut normalised, mut unscaled) = (unknowns.clone(), None);
        loop {
            match fit(&normalised) {
                // Sometimes only the fit shows that a force channel contains only noise, so that an
                // equation has no scale. A symmetric matrix or proportional damping relates the
                // equations. They then have a common scale, and the error is final.
                Err(AnalysisError::Estimate(EstimateError::OnlyRatios { dof, .. }))
                    if !unknowns.is_related()
                        && (unscaled.is_none() || !free.contains(&(dof - 1))) =>
                {
                    if !free.contains(&(dof - 1)) {
                        free.push(dof - 1);
                        free.sort_unstable();
                    }
                    let without_scale;
                    (without_scale, normalised) = Self::normalised(unknowns, &free)?;
                    unscaled = Some(without_scale);
                }
                fitted => return Ok((fitted?, unscaled)),
            }
        }
    }

    /// Returns the equations without scale, and the unknowns of a system that has the same modes as
    /// the machine. In this system the degrees of freedom `free`, counted from 0, have unit masses,
    /// and no mass couples another equation to them.
    fn normalised(unknowns: &Unknowns, free: &[usize]) -> Result<(Self, Unknowns), AnalysisError> {
        let (mut normalised, mut equations) = (unknowns.clone(), Vec::new());
        for row in 0..unknowns.dof() {
            for &column in free {
                if unknowns.fixed(Matrix::Mass, row, column).is_none() {
                    let value = if row == column { 1.0 } else { 0.0 };
                    normalised = normalised.fix(Matrix::Mass, row, column, value)?;
                    equations.push(row + 1);
                }
            }
        }
        equations.dedup();
        let degrees_of_freedom = free.iter().map(|dof| dof + 1).collect();
        Ok((Self { degrees_of_freedom, equations }, normalised))
    }

    /// Returns whether the entries of an equation, counted from 0, are not reported.
    pub(super) fn hides(&self, equation: usize) -> bool {
        self.equations.contains(&(equation + 1))
    }

    /// Refuses a system without scale.
    pub(super) fn check(unscaled: Option<&Self>) -> Result<(), AnalysisError> {
        match unscaled {
            Some(unscaled) => Err(AnalysisError::Unscaled { unscaled: unscaled.clone() }),
            None => Ok(()),
        }
    }

    /// Refuses forces on degrees of freedom (`driven`, counted from 0) whose equations have no
    /// scale, because the responses to these forces are unknown.
    pub(super) fn check_forces(&self, driven: &[usize]) -> Result<(), AnalysisError> {
        let is_unknown = |dof: &usize| self.degrees_of_freedom.contains(&(dof + 1));
        Self::check(driven.iter().any(is_unknown).then_some(self))
    }
}

/// Returns the degrees of freedom, counted from 0, without force and without known entry in their
/// equation.
fn without_force(unknowns: &Unknowns, driven: &[usize]) -> Vec<usize> {
    let dofs = unknowns.dof();
    let entries = || Matrix::ALL.into_iter().flat_map(|matrix| (0..dofs).map(move |j| (matrix, j)));
    let is_free = |row: &usize| {
        let known = |(matrix, column)| unknowns.fixed(matrix, *row, column);
        !driven.contains(row) && entries().filter_map(known).all(|value| value == 0.0)
    };
    (0..dofs).filter(is_free).collect()
}

impl fmt::Display for Unscaled {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let numbers = |all: &[usize], one: &str, several: &str| {
            let listed: Vec<String> = all.iter().map(usize::to_string).collect();
            match &listed[..] {
                [number] => format!("{one} {number}"),
                [first @ .., last] => format!("{several} {} and {last}", first.join(", ")),
                [] => String::new(),
            }
        };
        let (dofs, equations) = (&self.degrees_of_freedom, &self.equations);
        let forced = numbers(dofs, "degree of freedom", "degrees of freedom");
        let (their, there) = match dofs.len() {
            1 => ("its mass is not known", "there"),
            _ => ("their masses are not known", "on each of them"),
        };
        let rows = numbers(equations, "row", "rows");
        let (have, they) =
            if equations.len() == 1 { ("has", "it is") } else { ("have", "they are") };
        write!(
            f,
            "no force acts on {forced}, and {their}: the modes do not depend on this, but {rows} of M, C and K \
             {have} an unknown scale, so {they} not reported; state masses (`mass`), or apply a force {there}"
        )
    }
}
