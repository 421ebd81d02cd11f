//! Timetables among the objects of MATLAB 7.3.
//!
//! A variable of a class holds only the number of its object. All variables share the cell array
//! `#subsystem#/MCOS`. Its first cell is a table of integers that lists the properties of the
//! objects; later cells are the values of these properties.
//!
//! # Source
//! The format is not published; after the description and the writer of the package `mat-io` 1.0.

use hdf5_pure::{Dataset, Group, Object};
use nalgebra::Complex;

use super::values::{self, Content, Trouble};
use super::{Attributes, Reader, take_numbers};
use crate::contents::{Axis, Column, Fault};
use crate::limits::Budget;

/// First word of a variable that refers to an object.
const REFERENCE: u32 = 0xdd00_0000;

/// Maximum number of words of a variable that refers to an object: a single object needs six.
const MAX_WORDS: u64 = 16;

/// Number of words of an object in the table: class, two unknown words, two kinds of properties,
/// dependencies.
const OBJECT_WORDS: usize = 6;

/// Number of words of a class in the table; the second word is its name.
const CLASS_WORDS: usize = 4;

/// Number of words of a property: name, kind, value.
const PROPERTY_WORDS: usize = 3;

/// Kind of a property whose value is in a cell.
const IN_CELL: u32 = 1;

/// Number of cells of `MCOS` before the cells with the values of properties.
const FIRST_VALUE: usize = 2;

/// Offset of the names in the table, in bytes: a version, the number of names and eight offsets
/// come before them.
const NAMES: usize = 40;

/// Property of a timetable that contains all other properties.
const ALL_PROPERTIES: &str = "any";

/// Milliseconds in a second.
const MILLISECONDS: f64 = 1e3;

/// Objects of a file.
pub(super) struct Objects {
    cells: Vec<Object>,
    names: Vec<String>,
    classes: Vec<u32>,
    /// Properties of objects whose class has its own save function.
    saved_properties: Vec<u32>,
    objects: Vec<u32>,
    properties: Vec<u32>,
}

impl Objects {
    /// Reads the table of objects of a file; `None` if it has none, or a damaged one.
    pub fn read(root: &Group, len: u64, budget: &mut Budget) -> Result<Option<Self>, Fault> {
        let Some(table) = root.group("#subsystem#").and_then(|of| of.dataset("MCOS")).ok() else {
            return Ok(None);
        };
        let cells = match values::references(&table, len, budget) {
            Ok(Content::References(cells)) => cells,
            Ok(_) | Err(Trouble::Unusable(_)) => return Ok(None),
            Err(Trouble::Fault(fault)) => return Err(fault),
        };
        let Some(Object::Dataset(table)) = cells.first() else { return Ok(None) };
        take_numbers(count(table).unwrap_or(u64::MAX), 1, len, budget)?;
        let bytes = table.read_u8().unwrap_or_default();
        Ok(Self::parse(&bytes).map(|objects| Self { cells, ..objects }))
    }

    fn parse(bytes: &[u8]) -> Option<Self> {
        let offsets: Vec<usize> =
            words(bytes.get(8..NAMES)?).iter().map(|offset| *offset as usize).collect();
        let region = |at: usize| bytes.get(offsets[at]..offsets[at + 1]).map(words);
        let names = bytes.get(NAMES..offsets[0])?.split(|byte| *byte == 0);
        let names = names.filter(|name| !name.is_empty());
        Some(Self {
            cells: Vec::new(),
            names: names.map(|name| String::from_utf8_lossy(name).into_owned()).collect(),
            classes: region(0)?,
            saved_properties: region(1)?,
            objects: region(2)?,
            properties: region(3)?,
        })
    }

    /// Returns a name by its number, counted from 1.
    fn name(&self, number: u32) -> Option<&str> {
        let at = (number as usize).checked_sub(1)?;
        self.names.get(at).map(String::as_str)
    }

    fn object(&self, number: u32) -> Option<&[u32]> {
        self.objects.chunks_exact(OBJECT_WORDS).nth(number as usize)
    }

    /// Returns the name of the class of an object.
    fn class(&self, object: u32) -> Option<&str> {
        let class = *self.object(object)?.first()?;
        let words = self.classes.chunks_exact(CLASS_WORDS).nth(class as usize)?;
        self.name(words[1])
    }

    /// Returns the value of a property of an object.
    fn value(&self, object: u32, property: &str) -> Option<&Object> {
        let words = self.object(object)?;
        let properties = match words[3] {
            0 => record(&self.properties, words[4]),
            number => record(&self.saved_properties, number),
        };
        let is_wanted =
            |words: &&[u32]| self.name(words[0]) == Some(property) && words[1] == IN_CELL;
        let words = properties?.chunks_exact(PROPERTY_WORDS).find(is_wanted)?;
        self.cells.get((words[2] as usize).checked_add(FIRST_VALUE)?)
    }
}

/// Returns the properties of the record with this number. Each record has the number of its
/// properties, then the properties, and ends at an even number of words.
fn record(region: &[u32], number: u32) -> Option<&[u32]> {
    let mut at = 0_usize;
    let len = |at: usize| Some(PROPERTY_WORDS.saturating_mul(*region.get(at)? as usize));
    for _ in 0..number {
        at = at.saturating_add(1).saturating_add(len(at)?);
        at = at.saturating_add(at % 2);
    }
    let start = at.saturating_add(1);
    region.get(start..start.saturating_add(len(at)?))
}

fn words(bytes: &[u8]) -> Vec<u32> {
    bytes.as_chunks::<4>().0.iter().map(|word| u32::from_le_bytes(*word)).collect()
}

/// Returns the number of elements of a data set.
fn count(dataset: &Dataset) -> Option<u64> {
    dataset.shape().ok()?.iter().try_fold(1_u64, |count, len| count.checked_mul(*len))
}

/// Returns the number of the object to which a variable refers.
fn referred(dataset: &Dataset) -> Option<u32> {
    if count(dataset)? > MAX_WORDS {
        return None;
    }
    let words = dataset.read_u32().ok()?;
    let [REFERENCE, dimensions, rest @ ..] = &words[..] else { return None };
    rest.get(*dimensions as usize).copied()
}

/// Instants of the rows of a timetable.
enum RowTimes {
    /// Instants, in s after the first one.
    Instants(Vec<f64>),
    /// A time step, in s.
    Step(f64),
    /// No instants and no step: the times are calendar durations, or damaged.
    Unknown,
}

impl Reader {
    /// Adds the variables of a timetable as columns, with their units and instants; returns whether
    /// the data set refers to a timetable.
    pub(super) fn add_timetable(
        &mut self,
        dataset: &Dataset,
        path: &str,
        depth: usize,
    ) -> Result<bool, Fault> {
        let Some(objects) = self.objects.take() else { return Ok(false) };
        let added = self.add_timetable_of(&objects, dataset, path, depth);
        self.objects = Some(objects);
        added
    }

    fn add_timetable_of(
        &mut self,
        objects: &Objects,
        dataset: &Dataset,
        path: &str,
        depth: usize,
    ) -> Result<bool, Fault> {
        let object = referred(dataset).filter(|at| objects.class(*at) == Some("timetable"));
        let value = object.and_then(|object| objects.value(object, ALL_PROPERTIES));
        let Some(Object::Group(table)) = value else { return Ok(false) };
        let (names, units) = (self.texts(table, "varNames")?, self.texts(table, "varUnits")?);
        let data = self.cells(table, "data")?;
        if data.is_empty() || names.len() != data.len() {
            return Ok(false);
        }
        let times = self.row_times(objects, table)?;
        let first = self.contents.columns.len();
        if let RowTimes::Instants(seconds) = &times {
            let column = Column::from_numbers(self.path(path, "time"), seconds.clone());
            self.contents.columns.push(column);
        }
        for (number, (name, value)) in names.iter().zip(data).enumerate() {
            let begin = self.contents.columns.len();
            let at = self.path(path, name);
            match value {
                Object::Dataset(values) => {
                    self.add_dataset(&values, at, &Attributes::default(), depth + 1)?;
                }
                _ => self.add_unusable(at, "no array of numbers".into()),
            }
            for column in &mut self.contents.columns[begin..] {
                column.unit = units.get(number).cloned().unwrap_or_default();
            }
        }
        if let RowTimes::Step(step) = times {
            let added = &mut self.contents.columns[first..];
            added.iter_mut().for_each(|column| column.axis = Axis::Even { start: 0.0, step });
        }
        Ok(true)
    }

    /// Returns the elements of a cell array; no elements if the array is empty, missing or
    /// unusable.
    fn cells(&mut self, group: &Group, name: &str) -> Result<Vec<Object>, Fault> {
        let Ok(cells) = group.dataset(name) else { return Ok(Vec::new()) };
        if Attributes::from_dataset(&cells).has("MATLAB_empty") {
            return Ok(Vec::new());
        }
        match values::references(&cells, self.len, &mut self.budget) {
            Ok(Content::References(cells)) => Ok(cells),
            Ok(_) | Err(Trouble::Unusable(_)) => Ok(Vec::new()),
            Err(Trouble::Fault(fault)) => Err(fault),
        }
    }

    /// Returns the texts of a cell array; an element that is not a text becomes an empty text.
    fn texts(&mut self, group: &Group, name: &str) -> Result<Vec<String>, Fault> {
        let text = |cell: &Object| match cell {
            Object::Dataset(text) if !Attributes::from_dataset(text).has("MATLAB_empty") => {
                values::characters(text).unwrap_or_default()
            }
            _ => String::new(),
        };
        Ok(self.cells(group, name)?.iter().map(text).collect())
    }

    fn row_times(&mut self, objects: &Objects, table: &Group) -> Result<RowTimes, Fault> {
        if let Ok(times) = table.dataset("rowTimes") {
            let object = referred(&times);
            let seconds = object.map(|object| self.seconds(objects, object)).transpose()?;
            return Ok(seconds.flatten().map_or(RowTimes::Unknown, RowTimes::Instants));
        }
        let Ok(times) = table.group("rowTimes") else { return Ok(RowTimes::Unknown) };
        let number = |reader: &mut Self, name: &str| -> Result<Option<f64>, Fault> {
            let Ok(dataset) = times.dataset(name) else { return Ok(None) };
            Ok(reader.numbers(&dataset)?.first().map(|number| number.re))
        };
        let step = if number(self, "specifiedAsRate")? == Some(1.0) {
            number(self, "sampleRate")?.map(|rate| 1.0 / rate)
        } else {
            let object = times.dataset("stepSize").ok().as_ref().and_then(referred);
            let length = object.and_then(|object| objects.value(object, "millis"));
            match length {
                Some(Object::Dataset(length)) => {
                    self.numbers(length)?.first().map(|step| step.re / MILLISECONDS)
                }
                _ => None,
            }
        };
        let step = step.filter(|step| *step > 0.0 && step.is_normal());
        Ok(step.map_or(RowTimes::Unknown, RowTimes::Step))
    }

    /// Returns the instants of an array of durations or dates, in s after the first one.
    fn seconds(&mut self, objects: &Objects, object: u32) -> Result<Option<Vec<f64>>, Fault> {
        let property = match objects.class(object) {
            Some("duration") => "millis",
            Some("datetime") => "data",
            _ => return Ok(None),
        };
        let Some(Object::Dataset(dataset)) = objects.value(object, property) else {
            return Ok(None);
        };
        let milliseconds = self.numbers(dataset)?;
        let Some(first) = milliseconds.first() else { return Ok(None) };
        // A date is the sum of two numbers: the imaginary part holds the digits that the real part
        // cannot hold.
        let since = milliseconds.iter().map(|time| time - first);
        Ok(Some(since.map(|since| (since.re + since.im) / MILLISECONDS).collect()))
    }

    /// Returns the numbers of a data set; none if it cannot be read.
    fn numbers(&mut self, dataset: &Dataset) -> Result<Vec<Complex<f64>>, Fault> {
        let attributes = Attributes::from_dataset(dataset);
        match values::read(dataset, &attributes, self.len, &mut self.budget) {
            Ok(Content::Numbers(array)) => {
                Ok(array.values.into_iter().map(Complex::from).collect())
            }
            Ok(Content::Complex { values, .. }) => Ok(values),
            Ok(Content::References(_)) | Err(Trouble::Unusable(_)) => Ok(Vec::new()),
            Err(Trouble::Fault(fault)) => Err(fault),
        }
    }
}
