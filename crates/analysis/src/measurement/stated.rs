//! Columns that are not named, or that share their name: chosen by the quantities that they state.

use std::path::Path;

use mechid_io::{IoError, Quantity, StatedUnit, Table, is_directed_point};
use mechid_model::ResponseQuantity;

use super::channels::ABSENT;
use super::{Channels, Reading};
use crate::AnalysisError;

/// Returns the quantity whose unit a column states.
fn stated_quantity(table: &Table, column: usize) -> Option<Quantity> {
    let unit = table.stated_unit(column, None);
    unit.as_ref().and_then(StatedUnit::used).map(|unit| unit.quantity)
}

/// Returns a text that leads [`Table::find`] to a column: its name, or its number if other columns
/// have the same name; the name if neither is unique.
fn text_of(table: &Table, column: usize) -> String {
    let texts = [table.short_name(column), (column + 1).to_string()];
    let finds = |text: &&String| table.find(text).is_ok_and(|found| found == column);
    texts.iter().find(finds).unwrap_or(&texts[0]).clone()
}

/// Columns of a record by the quantities that they state, in the order of the file.
struct Stated {
    channels: Channels,
    /// Force at each response, if all columns are named after points.
    beside: Option<Vec<String>>,
}

impl Stated {
    fn new(path: &Path, reading: &Reading) -> Result<Self, AnalysisError> {
        let file = reading.open(path, 1)?;
        let table = file.head();
        let of_quantity = |wanted: Quantity| -> Vec<usize> {
            let columns = table.filled_columns();
            columns.filter(|column| stated_quantity(table, *column) == Some(wanted)).collect()
        };
        let texts = |columns: &[usize]| columns.iter().map(|c| text_of(table, *c)).collect();
        let points = |columns: &[usize]| -> Vec<String> {
            columns.iter().map(|column| table.short_name(*column)).collect()
        };
        let forces = of_quantity(Quantity::Force);
        let mut channels = Channels { force: texts(&forces), ..Channels::default() };
        let mut responses = Vec::new();
        for kind in ResponseQuantity::ALL {
            let columns = of_quantity(kind.into());
            *channels.response_mut(kind) = texts(&columns);
            if !columns.is_empty() {
                responses.push(points(&columns));
            }
        }
        let beside =
            responses.first().filter(|first| responses.iter().all(|other| other == *first));
        let beside = beside.and_then(|at| beside_responses(&points(&forces), &channels.force, at));
        Ok(Self { channels, beside })
    }
}

impl Channels {
    /// Returns the columns of a record by the quantities that they state, in the order of the file;
    /// empty if no column states the quantity of a force or of a response.
    ///
    /// # Errors
    /// Those of [`Reading::open`].
    pub fn stated(path: &Path, reading: &Reading) -> Result<Self, AnalysisError> {
        Ok(Stated::new(path, reading)?.channels)
    }

    /// Returns the same columns with the force at each degree of freedom that has a response: by
    /// points such as `12+Z`, after which a universal file names its columns, or if there is only
    /// one force and one response of each kind; otherwise empty.
    ///
    /// # Errors
    /// Those of [`Reading::open`].
    pub fn stated_pairs(path: &Path, reading: &Reading) -> Result<Self, AnalysisError> {
        let Stated { channels, beside } = Stated::new(path, reading)?;
        let is_one = ResponseQuantity::ALL.iter().all(|kind| channels.response(*kind).len() <= 1);
        Ok(match beside {
            Some(force) => Self { force, ..channels },
            None if is_one && channels.force.len() == 1 => channels,
            None => Self::default(),
        })
    }

    /// Returns these channels with the number of a column in place of a name that several columns
    /// have, if only one of them states the quantity.
    pub(super) fn distinguished(&self, table: &Table) -> Self {
        let one = |column: &String, quantity: Quantity| {
            let Err(IoError::AmbiguousColumn { columns, .. }) = table.find(column) else {
                return column.clone();
            };
            let mut alike =
                columns.into_iter().filter(|at| stated_quantity(table, *at) == Some(quantity));
            match (alike.next(), alike.next()) {
                (Some(only), None) => text_of(table, only),
                _ => column.clone(),
            }
        };
        let all = |columns: &[String], quantity: Quantity| -> Vec<String> {
            columns.iter().map(|column| one(column, quantity)).collect()
        };
        let mut distinguished = self.clone();
        distinguished.force = all(&self.force, Quantity::Force);
        for kind in ResponseQuantity::ALL {
            *distinguished.response_mut(kind) = all(self.response(kind), kind.into());
        }
        distinguished
    }
}

/// Returns the force at the point of each response; `None` unless all names are points, and each
/// force has one response at its point.
fn beside_responses(
    points: &[String],
    forces: &[String],
    responses: &[String],
) -> Option<Vec<String>> {
    let are_points = points.iter().chain(responses).all(|name| is_directed_point(name));
    let is_once = |point: &String| responses.iter().filter(|other| *other == point).count() == 1;
    (are_points && points.iter().all(is_once)).then_some(())?;
    let at = |point: &String| {
        let force = points.iter().position(|other| other == point);
        force.map_or_else(|| ABSENT.to_owned(), |at| forces[at].clone())
    };
    Some(responses.iter().map(at).collect())
}
