//! Columns that are not named, or that share their name: chosen by the quantities that they state.

use std::collections::HashMap;
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

/// Returns a text with which [`Table::find`] finds a column: the name of the column, or its number
/// if other columns have the same name. If the number does not find the column either, the name is
/// returned.
fn text_of(table: &Table, column: usize) -> String {
    let texts = [table.short_name(column), (column + 1).to_string()];
    let finds = |text: &&String| table.find(text).is_ok_and(|found| found == column);
    texts.iter().find(finds).unwrap_or(&texts[0]).clone()
}

impl Channels {
    /// Returns the columns of a record by the quantities that they state, in the order of the file.
    /// Every column except that of time must state a unit, and exactly one kind of response must be
    /// measured. Otherwise the result is empty, because only the user knows which columns belong to
    /// the test.
    ///
    /// # Errors
    /// Those of [`Reading::open`].
    pub fn stated(path: &Path, reading: &Reading) -> Result<Self, AnalysisError> {
        let file = reading.open(path, 1)?;
        let table = file.head();
        let time = reading.time.as_deref().or_else(|| table.time_column());
        let time = time.and_then(|column| table.find(column).ok());
        let columns: Vec<usize> = table.filled_columns().filter(|c| Some(*c) != time).collect();
        let quantities: Option<Vec<Quantity>> =
            columns.iter().map(|column| stated_quantity(table, *column)).collect();
        let Some(quantities) = quantities else { return Ok(Self::default()) };
        let of_quantity = |wanted: Quantity| -> Vec<String> {
            let pairs = columns.iter().zip(&quantities);
            let alike = pairs.filter(|(_, quantity)| **quantity == wanted).map(|(at, _)| *at);
            let names: Vec<(usize, String)> = alike.map(|at| (at, table.short_name(at))).collect();
            let mut uses: HashMap<&str, usize> = HashMap::new();
            names.iter().for_each(|(_, name)| *uses.entry(name).or_default() += 1);
            let text = |(at, name): &(usize, String)| {
                if uses[name.as_str()] == 1 { name.clone() } else { (at + 1).to_string() }
            };
            names.iter().map(text).collect()
        };
        let mut channels = Self { force: of_quantity(Quantity::Force), ..Self::default() };
        for kind in ResponseQuantity::ALL {
            *channels.response_mut(kind) = of_quantity(kind.into());
        }
        let kinds =
            ResponseQuantity::ALL.iter().filter(|kind| !channels.response(**kind).is_empty());
        Ok(if kinds.count() == 1 { channels } else { Self::default() })
    }

    /// Returns the same columns, with a force column for each degree of freedom that has a
    /// response. A force and a response are a pair if they have the same point, such as `12+Z`; a
    /// universal file names its columns after points. One force and one response without points are
    /// also a pair. If the columns cannot be paired, the result is empty.
    #[must_use]
    pub fn paired_by_point(self) -> Self {
        let Some(kind) = self.first_response() else { return Self::default() };
        let responses = self.response(kind);
        if self.force.iter().chain(responses).any(|name| !is_directed_point(name)) {
            let is_pair = (self.force.len(), responses.len()) == (1, 1);
            return if is_pair { self } else { Self::default() };
        }
        let is_once =
            |point: &String| responses.iter().filter(|other| *other == point).count() == 1;
        if self.force.is_empty() || !self.force.iter().all(is_once) {
            return Self::default();
        }
        let force = responses.iter().map(|point| {
            if self.force.contains(point) { point.clone() } else { ABSENT.to_owned() }
        });
        Self { force: force.collect(), ..self }
    }

    /// Returns these channels without ambiguous names: if several columns have a name and only one
    /// of them states the quantity, the number of that column replaces the name.
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
