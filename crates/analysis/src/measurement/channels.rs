//! Which columns of a record hold the forces and responses of a machine.

use mechid_estimate::frequency_domain::Motion;
use mechid_io::Quantity;
use serde::{Deserialize, Serialize};

use super::units::Role;
use crate::AnalysisError;

/// Column that stands for a force that does not act, or for a response that was not measured.
pub const ABSENT: &str = "0";

/// Columns of force and response, one per degree of freedom, in the same order everywhere.
///
/// A column is named as in the file, or by its number counted from 1; `"0"` stands for a force that
/// does not act.
///
/// ```
/// use mechid_analysis::{Channels, Motion};
///
/// let one = Channels::new("force", Motion::Displacement, "x");
/// let two = Channels::new("fx,fy", Motion::Displacement, "x,y").and(Motion::Velocity, "vx,vy");
/// assert_eq!((one.force.len(), two.velocity.len()), (1, 2));
/// ```
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Channels {
    /// Force columns, in N unless the column says another unit.
    pub force: Vec<String>,
    /// Displacement columns, in m.
    pub displacement: Vec<String>,
    /// Velocity columns, in m/s.
    pub velocity: Vec<String>,
    /// Acceleration columns, in m/s².
    pub acceleration: Vec<String>,
}

impl Channels {
    /// Returns the channels of one kind of response under forces; several degrees of freedom are
    /// separated by commas.
    pub fn new(force: &str, response: Motion, columns: &str) -> Self {
        Self { force: split(force), ..Self::default() }.and(response, columns)
    }

    /// Returns the channels of responses alone, for the reconstruction of an unknown force.
    pub fn of_responses(response: Motion, columns: &str) -> Self {
        Self::default().and(response, columns)
    }

    /// Adds (or replaces) the columns of one kind of response.
    #[must_use]
    pub fn and(mut self, response: Motion, columns: &str) -> Self {
        *match response {
            Motion::Displacement => &mut self.displacement,
            Motion::Velocity => &mut self.velocity,
            Motion::Acceleration => &mut self.acceleration,
        } = split(columns);
        self
    }

    /// Returns the columns of one kind of response.
    pub fn response(&self, kind: Motion) -> &[String] {
        match kind {
            Motion::Displacement => &self.displacement,
            Motion::Velocity => &self.velocity,
            Motion::Acceleration => &self.acceleration,
        }
    }

    /// Returns the columns that are read and what each is to hold, forces first.
    pub(crate) fn roles(&self) -> Vec<Role<'_>> {
        let groups = [
            (&self.force, Quantity::Force, "force"),
            (&self.displacement, Quantity::Displacement, "displacement"),
            (&self.velocity, Quantity::Velocity, "velocity"),
            (&self.acceleration, Quantity::Acceleration, "acceleration"),
        ];
        let groups = groups.into_iter().flat_map(|(columns, quantity, setting)| {
            columns.iter().map(move |column| Role { column, quantity, setting })
        });
        groups.filter(|role| role.column != ABSENT).collect()
    }

    /// Returns the columns that are read, forces first.
    pub(crate) fn used(&self) -> Vec<&String> {
        self.roles().into_iter().map(|role| role.column).collect()
    }

    /// Checks that there are a force and a response for every degree of freedom, as an identification
    /// needs them.
    ///
    /// # Errors
    /// [`AnalysisError::NoForce`], [`AnalysisError::NoMotion`], [`AnalysisError::ColumnCount`].
    pub fn check_pairs(&self) -> Result<(), AnalysisError> {
        if self.force.is_empty() {
            return Err(AnalysisError::NoForce);
        }
        if KINDS.iter().all(|kind| self.response(*kind).is_empty()) {
            return Err(AnalysisError::NoMotion);
        }
        let forces = self.force.len();
        for kind in KINDS {
            let got = self.response(kind).len();
            if got != 0 && got != forces {
                return Err(AnalysisError::ColumnCount { response: kind, got, forces });
            }
        }
        Ok(())
    }
}

/// The kinds of response in the order of their columns.
pub(crate) const KINDS: [Motion; 3] =
    [Motion::Displacement, Motion::Velocity, Motion::Acceleration];

fn split(columns: &str) -> Vec<String> {
    columns.split(',').map(|column| column.trim().to_owned()).collect()
}
