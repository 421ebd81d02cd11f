//! A machine of named elements as a model of line data.

mod banded;
mod candidates;
mod identify;
mod known;
mod model;
mod modes;
mod nominal;
mod parts;
mod state_loads;
mod system;
#[cfg(test)]
mod tests;

use nalgebra::{Complex, DMatrix};

use super::LikelihoodError;

pub use candidates::{Candidate, CandidateGain};
pub use identify::{MachineEstimate, MeasuredReceptance, identify_joined, identify_machine};
pub use known::FreedCoefficient;
pub use model::{MachineLine, MachineModel};
pub use modes::MachineMode;
pub use system::UncertainEntries;

/// A part of a machine that is known by its measured receptance instead of a model.
///
/// The errors of the receptance count as independent from line to line. If several records have the
/// same frequencies, the errors also count as independent from record to record.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredPart {
    /// Degrees of freedom to which the rows and columns of the receptance belong, as indices in the
    /// machine.
    pub dofs: Vec<usize>,
    /// Receptance, d × d, in m/N, one for each line of the data.
    pub receptance: Vec<DMatrix<Complex<f64>>>,
    /// Mean square error E|ΔH|² of each entry, in (m/N)²; `None` if it is unknown.
    pub variance: Option<Vec<DMatrix<f64>>>,
}
