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
/// Errors of the table count as independent from line to line; where several records have the same
/// frequencies, they count as independent from record to record, too.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredPart {
    /// Degrees of freedom of rows and columns, by their index in the machine.
    pub dofs: Vec<usize>,
    /// Receptance, d × d, in m/N, one for each line of the data.
    pub receptance: Vec<DMatrix<Complex<f64>>>,
    /// Mean square error E|ΔH|² of each entry, in (m/N)²; `None` if it is unknown.
    pub variance: Option<Vec<DMatrix<f64>>>,
}
