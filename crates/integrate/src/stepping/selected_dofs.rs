//! Selected degrees of freedom.

use crate::error::IntegrateError;

/// Degrees of freedom, counted from 0, of the forces and of the responses returned.
///
/// An integration with selected degrees of freedom needs no memory that grows with degrees of
/// freedom times samples.
#[derive(Debug, Clone, Copy)]
pub struct SelectedDofs<'a> {
    /// Degree of freedom of each channel of the force, without repetition; no force acts on the
    /// other degrees of freedom.
    pub forced: &'a [usize],
    /// Degree of freedom of each channel of the response.
    pub observed: &'a [usize],
}

impl SelectedDofs<'_> {
    pub(crate) fn check(&self, dof: usize) -> Result<(), IntegrateError> {
        let mut forced = vec![false; dof];
        for &at in self.forced {
            match forced.get_mut(at) {
                None => return Err(IntegrateError::DofOutside { index: at, dof }),
                Some(forced) if *forced => return Err(IntegrateError::ForcedTwice { index: at }),
                Some(forced) => *forced = true,
            }
        }
        match self.observed.iter().find(|at| **at >= dof) {
            Some(&at) => Err(IntegrateError::DofOutside { index: at, dof }),
            None => Ok(()),
        }
    }
}
