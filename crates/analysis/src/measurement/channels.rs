//! Columns of a record that hold the forces and responses of a machine.

use mechid_io::Quantity;
use mechid_model::ResponseQuantity;
use mechid_signal::message;
use serde::{Deserialize, Serialize};

use super::units::Role;
use crate::AnalysisError;

/// Column name for a force that does not act, or for a response that was not measured.
pub const ABSENT: &str = "0";

/// Columns of force and response, one per degree of freedom, in the same order everywhere.
///
/// A column is identified by its name in the file, or by its number counted from 1; `"0"` means
/// that the force does not act.
///
/// ```
/// use mechid_analysis::{Channels, ResponseQuantity};
///
/// let one = Channels::new("force", ResponseQuantity::Displacement, "x");
/// let two = Channels::new("fx,fy", ResponseQuantity::Displacement, "x,y");
/// let two = two.and(ResponseQuantity::Velocity, "vx,vy");
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
    /// Creates the channels of forces and one kind of response; several degrees of freedom are
    /// separated by commas.
    pub fn new(force: &str, response: ResponseQuantity, columns: &str) -> Self {
        Self { force: split(force), ..Self::default() }.and(response, columns)
    }

    /// Creates the channels of responses without forces, for the reconstruction of an unknown
    /// force.
    pub fn from_responses(response: ResponseQuantity, columns: &str) -> Self {
        Self::default().and(response, columns)
    }

    /// Adds (or replaces) the columns of one kind of response.
    #[must_use]
    pub fn and(mut self, response: ResponseQuantity, columns: &str) -> Self {
        *self.response_mut(response) = split(columns);
        self
    }

    pub(super) fn response_mut(&mut self, kind: ResponseQuantity) -> &mut Vec<String> {
        match kind {
            ResponseQuantity::Displacement => &mut self.displacement,
            ResponseQuantity::Velocity => &mut self.velocity,
            ResponseQuantity::Acceleration => &mut self.acceleration,
        }
    }

    /// Returns true if no column is named.
    pub fn is_empty(&self) -> bool {
        self.force.is_empty() && self.first_response().is_none()
    }

    /// Returns the columns of one kind of response.
    pub fn response(&self, kind: ResponseQuantity) -> &[String] {
        match kind {
            ResponseQuantity::Displacement => &self.displacement,
            ResponseQuantity::Velocity => &self.velocity,
            ResponseQuantity::Acceleration => &self.acceleration,
        }
    }

    /// Returns the same channels with other names.
    pub(crate) fn renamed(&self, mut name: impl FnMut(&String) -> String) -> Self {
        let mut renamed = |columns: &[String]| -> Vec<String> {
            let of = |column: &String| match column.as_str() {
                ABSENT => ABSENT.into(),
                _ => name(column),
            };
            columns.iter().map(of).collect()
        };
        Self {
            force: renamed(&self.force),
            displacement: renamed(&self.displacement),
            velocity: renamed(&self.velocity),
            acceleration: renamed(&self.acceleration),
        }
    }

    /// Returns the name of the force on a degree of freedom, counted from 0; `force 2` if it has no
    /// column.
    pub fn force_name(&self, dof: usize) -> String {
        named(&self.force, "force", dof)
    }

    /// Returns the name of a response of a degree of freedom, counted from 0; `velocity 2` if it
    /// has no column.
    pub fn response_name(&self, kind: ResponseQuantity, dof: usize) -> String {
        named(self.response(kind), &kind.to_string(), dof)
    }

    /// Returns the first kind of response with columns, in the order displacement, velocity,
    /// acceleration.
    pub fn first_response(&self) -> Option<ResponseQuantity> {
        ResponseQuantity::ALL.into_iter().find(|kind| !self.response(*kind).is_empty())
    }

    /// Returns common names for several records of the same machine. A force has the name from the
    /// first record in which it acts; a force that acts at several points in turn, such as that of
    /// a roving hammer, is also named after the point: `force at a1`.
    pub(crate) fn together(records: &[&Self]) -> Self {
        let mut common = records.first().map(|first| Self::clone(first)).unwrap_or_default();
        for (dof, name) in common.force.iter_mut().enumerate() {
            let mut acting = records.iter().filter_map(|record| record.force.get(dof));
            if let Some(found) = acting.find(|name| *name != ABSENT) {
                name.clone_from(found);
            }
        }
        let Some(kind) = common.first_response() else { return common };
        let force = (0..common.force.len()).map(|dof| {
            let name = &common.force[dof];
            let roves = common.force.iter().filter(|other| *other == name).count() > 1;
            if roves && name != ABSENT {
                format!("{name} at {}", common.response_name(kind, dof))
            } else {
                name.clone()
            }
        });
        Self { force: force.collect(), ..common.clone() }
    }

    /// Returns the columns of records with a roving force, one set per record; `dofs` are the
    /// degrees of freedom of the force, one per record, counted from 1.
    ///
    /// # Errors
    /// [`AnalysisError::Setting`] unless there is one force column, and one degree of freedom with
    /// a response for each record.
    pub fn struck(&self, dofs: &[usize], records: usize) -> Result<Vec<Self>, AnalysisError> {
        let wrong = |why: String| AnalysisError::Setting { setting: "struck", why };
        let [force] = &self.force[..] else {
            return Err(wrong(format!("give one force column, not {}", self.force.len())));
        };
        if dofs.len() != records {
            let given = message::count(dofs.len(), "degree of freedom");
            return Err(wrong(format!("{given} for {}", message::count(records, "record"))));
        }
        let count = ResponseQuantity::ALL.iter().map(|kind| self.response(*kind).len()).max();
        let count = count.unwrap_or(0);
        if let Some(dof) = dofs.iter().find(|dof| !(1..=count).contains(*dof)) {
            let responses = message::count(count, "response");
            return Err(wrong(format!(
                "there is no degree of freedom {dof}: the record has {responses}"
            )));
        }
        let column = |dof: usize, at: usize| if at + 1 == dof { force.as_str() } else { ABSENT };
        let of = |dof: &usize| Self {
            force: (0..count).map(|at| column(*dof, at).to_owned()).collect(),
            ..self.clone()
        };
        Ok(dofs.iter().map(of).collect())
    }

    /// Returns the columns to read and their quantities, forces first.
    pub(crate) fn roles(&self) -> Vec<Role<'_>> {
        let groups = [
            (&self.force, Quantity::Force, "force"),
            (&self.displacement, ResponseQuantity::Displacement.into(), "displacement"),
            (&self.velocity, ResponseQuantity::Velocity.into(), "velocity"),
            (&self.acceleration, ResponseQuantity::Acceleration.into(), "acceleration"),
        ];
        let groups = groups.into_iter().flat_map(|(columns, quantity, setting)| {
            columns.iter().map(move |column| Role { column, quantity, setting })
        });
        groups.filter(|role| role.column != ABSENT).collect()
    }

    /// Returns the columns to read, forces first.
    pub(crate) fn used(&self) -> Vec<&String> {
        self.roles().into_iter().map(|role| role.column).collect()
    }

    /// Checks that there is at least one force and one response.
    ///
    /// # Errors
    /// [`AnalysisError::NoForce`], [`AnalysisError::NoMotion`].
    pub fn check_some(&self) -> Result<(), AnalysisError> {
        if self.force.is_empty() {
            return Err(AnalysisError::NoForce);
        }
        let has_response =
            ResponseQuantity::ALL.iter().any(|kind| !self.response(*kind).is_empty());
        if has_response { Ok(()) } else { Err(AnalysisError::NoMotion) }
    }

    /// Checks that every degree of freedom has a force and a response, as identification requires.
    ///
    /// # Errors
    /// [`AnalysisError::NoForce`], [`AnalysisError::NoMotion`], [`AnalysisError::ColumnCount`].
    pub fn check_pairs(&self) -> Result<(), AnalysisError> {
        self.check_some()?;
        let forces = self.force.len();
        for kind in ResponseQuantity::ALL {
            let got = self.response(kind).len();
            if got != 0 && got != forces {
                return Err(AnalysisError::ColumnCount { response: kind, got, forces });
            }
        }
        Ok(())
    }
}

fn named(columns: &[String], quantity: &str, dof: usize) -> String {
    let column = columns.get(dof).filter(|column| *column != ABSENT);
    column.map_or_else(|| format!("{quantity} {}", dof + 1), Clone::clone)
}

fn split(columns: &str) -> Vec<String> {
    columns.split(',').map(|column| column.trim().to_owned()).collect()
}
