//! HDF5 files, and MATLAB files of version 7.3, which are HDF5.
//!
//! # Source
//! The HDF Group, *HDF5 File Format Specification*, version 3, read by the crate `hdf5-pure`; The
//! MathWorks, *MAT-File Versions*, for the attributes and the order of dimensions of version 7.3.

mod attributes;
mod objects;
mod soft_links;
mod values;

use std::panic::{AssertUnwindSafe, catch_unwind};

use hdf5_pure::{Dataset, File, Group, Object};

use self::attributes::Attributes;
use self::objects::Objects;
use self::values::{Array, Content, Trouble};
use crate::IoError;
use crate::contents::{Axis, Cause, Column, ComplexArray, Contents, Fault, Place};
use crate::labels::with_labels;
use crate::limits::{Budget, Limits};
use crate::mat::COMPLEX_NUMBERS;
use crate::stated_rates::{step, with_own_times, with_stated_rates};

/// Maximum depth of nested groups; cycles of links are deeper and are refused.
const MAX_DEPTH: usize = 16;

/// Maximum number of groups; a cycle of links has more.
const MAX_GROUPS: usize = 4096;

/// Maximum ratio of unpacked to stored bytes: deflate reaches 1032.
const MAX_EXPANSION: u64 = 1100;

/// Minimum length, in bytes, that is assumed for a file when its expansion is checked.
const MIN_BYTES: u64 = 4096;

/// Reads the data sets of a file as columns.
pub(crate) fn read(file: &str, bytes: Vec<u8>, limits: &Limits) -> Result<Contents, IoError> {
    let is_matlab = bytes.starts_with(b"MATLAB");
    let budget = Budget::new(limits, bytes.len());
    // The decoder crate is young, so its panics are reported as a damaged file.
    let read = catch_unwind(AssertUnwindSafe(|| Reader::read(bytes, is_matlab, budget)));
    let read = read.unwrap_or_else(|_| Err(Fault::new(0, "its structure is damaged")));
    let contents = read.map_err(|fault| fault.error(file, Place::Byte(1)))?;
    let contents = with_labels(with_own_times(with_stated_rates(contents)));
    if contents.columns.is_empty() {
        return Err(IoError::Empty { file: file.into(), found: "there is no data set of numbers" });
    }
    Ok(contents.with_usual_length())
}

/// Reader of the data sets of a file into columns.
struct Reader {
    contents: Contents,
    budget: Budget,
    is_matlab: bool,
    /// Length of the file, in bytes.
    len: u64,
    /// Number of groups so far.
    groups: usize,
    /// Objects of a MATLAB file.
    objects: Option<Objects>,
}

impl Reader {
    fn read(mut bytes: Vec<u8>, is_matlab: bool, budget: Budget) -> Result<Contents, Fault> {
        let len = bytes.len() as u64;
        soft_links::remove(&mut bytes);
        let file = File::from_bytes(bytes).map_err(damaged)?;
        let format = if is_matlab { "MATLAB 7.3 (HDF5)" } else { "HDF5" };
        let contents = Contents { format: format.into(), ..Contents::default() };
        let mut reader = Self { contents, budget, is_matlab, len, groups: 0, objects: None };
        if is_matlab {
            reader.objects = Objects::read(&file.root(), len, &mut reader.budget)?;
        }
        reader.add_group(&file.root(), "", 0)?;
        Ok(reader.contents)
    }

    /// Returns the character between the name of a group and the name of a member in a path.
    fn separator(&self) -> char {
        if self.is_matlab { '.' } else { '/' }
    }

    fn path(&self, group: &str, name: &str) -> String {
        match group {
            "" => name.into(),
            group => format!("{group}{}{name}", self.separator()),
        }
    }

    /// Adds the data sets and the groups of a group.
    fn add_group(&mut self, group: &Group, path: &str, depth: usize) -> Result<(), Fault> {
        self.groups += 1;
        if depth > MAX_DEPTH || self.groups > MAX_GROUPS {
            let what = format!(
                "groups are nested more than {MAX_DEPTH} deep, or there are more than {MAX_GROUPS} groups (a cycle \
                 of links?)"
            );
            return Err(Fault::new(0, what));
        }
        let attributes = Attributes::from_group(group);
        for (name, value) in attributes.numbers() {
            let name = self.path(path, name);
            self.contents.scalars.push((name, value));
        }
        let (datasets, groups) = match (group.datasets(), group.groups()) {
            (Ok(datasets), Ok(groups)) => (datasets, groups),
            (Err(error), _) | (_, Err(error)) if depth == 0 => return Err(damaged(error)),
            (Err(error), _) | (_, Err(error)) => {
                self.add_unusable(path.into(), format!("a group that cannot be read ({error})"));
                return Ok(());
            }
        };
        for name in in_natural_order(datasets) {
            self.budget.take_column().map_err(|limit| Fault::too_large(0, limit))?;
            let at = self.path(path, &name);
            match group.dataset(&name) {
                Ok(dataset) => self.add_dataset(&dataset, at, &attributes, depth)?,
                Err(error) => self.add_unusable(at, format!("data that cannot be read ({error})")),
            }
        }
        let groups = in_natural_order(groups).into_iter();
        for name in groups.filter(|name| !name.starts_with('#')) {
            self.budget.take_column().map_err(|limit| Fault::too_large(0, limit))?;
            let at = self.path(path, &name);
            match group.group(&name) {
                Ok(inner) => self.add_group(&inner, &at, depth + 1)?,
                Err(error) => {
                    self.add_unusable(at, format!("a group that cannot be read ({error})"));
                }
            }
        }
        Ok(())
    }

    fn add_unusable(&mut self, path: String, what: String) {
        self.contents.columns.push(Column::unusable(path, what));
    }

    fn add_dataset(
        &mut self,
        dataset: &Dataset,
        path: String,
        of_group: &Attributes,
        depth: usize,
    ) -> Result<(), Fault> {
        let attributes = Attributes::from_dataset(dataset);
        if attributes.has("MATLAB_object_decode") && self.add_timetable(dataset, &path, depth)? {
            return Ok(());
        }
        match self.content(dataset, &attributes) {
            Ok(Content::Numbers(array)) => self.add_numbers(array, path, &attributes, of_group)?,
            Ok(Content::Complex { lengths, values }) => {
                let array = if self.is_matlab {
                    let lengths = lengths.into_iter().rev().collect();
                    ComplexArray::first_fastest(path.clone(), lengths, values)
                } else {
                    ComplexArray::last_fastest(path.clone(), lengths, values)
                };
                let unit = attributes.unit(0).or(of_group.unit(0)).unwrap_or_default();
                self.contents.complex.push(ComplexArray { unit, ..array });
                self.add_unusable(path, COMPLEX_NUMBERS.into());
            }
            Ok(Content::References(objects)) => {
                let is_cell = attributes.text("MATLAB_class") == Some("cell");
                self.add_elements(objects, &path, is_cell, depth + 1)?;
            }
            Err(Trouble::Unusable(what)) => {
                if attributes.text("MATLAB_class") == Some("char") {
                    let text = values::characters(dataset).map(|text| (path.clone(), text));
                    self.contents.texts.extend(text);
                }
                self.add_unusable(path, what);
            }
            Err(Trouble::Fault(fault)) => return Err(fault),
        }
        Ok(())
    }

    /// Reads the values of a data set and applies the factor and the offset of its attributes. A
    /// file that exceeds a limit is refused; damaged data make only this data set unusable, because
    /// it may not be needed.
    fn content(&mut self, dataset: &Dataset, attributes: &Attributes) -> Result<Content, Trouble> {
        let scaling = attributes.scaling().map_err(Trouble::Unusable)?;
        let (len, budget) = (self.len, &mut self.budget);
        // A panic of the decoder makes only this data set unusable, not the whole file.
        let read =
            catch_unwind(AssertUnwindSafe(|| values::read(dataset, attributes, len, budget)));
        let damaged = |_| Err(Trouble::Unusable("data that cannot be read (damaged)".into()));
        let mut content = read.unwrap_or_else(damaged).map_err(|trouble| match trouble {
            Trouble::Fault(Fault { cause: Cause::Malformed(what), .. }) => Trouble::Unusable(what),
            other => other,
        })?;
        if let Some((factor, offset)) = scaling {
            match &mut content {
                Content::Numbers(array) => {
                    array.values.iter_mut().for_each(|value| *value = *value * factor + offset);
                }
                Content::Complex { values, .. } => {
                    values.iter_mut().for_each(|value| *value = *value * factor + offset);
                }
                Content::References(_) => {}
            }
        }
        Ok(content)
    }

    /// Adds the elements of a cell array (`name{2}`), or the fields of an array of structs
    /// (`name(2).field`).
    fn add_elements(
        &mut self,
        objects: Vec<Object>,
        path: &str,
        is_cell: bool,
        depth: usize,
    ) -> Result<(), Fault> {
        if depth > MAX_DEPTH {
            return Err(Fault::new(
                0,
                format!("references are nested more than {MAX_DEPTH} deep (a cycle?)"),
            ));
        }
        let before = (self.contents.columns.len(), self.contents.scalars.len());
        for (number, object) in (1..).zip(objects) {
            let at = match path.rsplit_once('.') {
                Some((of, field)) if !is_cell => format!("{of}({number}).{field}"),
                _ => format!("{path}{{{number}}}"),
            };
            match object {
                Object::Dataset(dataset) => {
                    self.add_dataset(&dataset, at, &Attributes::default(), depth)?;
                }
                Object::Group(group) => self.add_group(&group, &at, depth)?,
                _ => self.add_unusable(at, "no data set and no group".into()),
            }
        }
        let (columns, scalars) = before;
        let added = &self.contents.columns[columns..];
        if self.contents.scalars.len() == scalars && added.iter().all(|c| c.values.is_err()) {
            self.contents.columns.truncate(columns);
            self.add_unusable(path.into(), "a cell array without vectors of numbers".into());
        }
        Ok(())
    }

    fn add_numbers(
        &mut self,
        array: Array,
        path: String,
        attributes: &Attributes,
        of_group: &Attributes,
    ) -> Result<(), Fault> {
        if let [value] = array.values[..] {
            self.contents.scalars.push((path, value));
            return Ok(());
        }
        let channels = array.into_channels(self.is_matlab);
        let several = channels.len() > 1;
        let axis = attributes.numbers().find_map(|(name, value)| step(name, value));
        let axis = axis.map(|step| Axis::Even { start: attributes.start(), step });
        for (number, values) in (1..).zip(channels) {
            if several {
                self.budget.take_column().map_err(|limit| Fault::too_large(0, limit))?;
            }
            let name = if several { format!("{path}[{number}]") } else { path.clone() };
            self.contents.columns.push(Column {
                unit: attributes.unit(number - 1).or(of_group.unit(number - 1)).unwrap_or_default(),
                about: attributes.about(),
                axis: axis.unwrap_or(Axis::Unknown),
                ..Column::from_numbers(name, values)
            });
        }
        Ok(())
    }
}

/// Returns the names sorted so that the numbers at their ends are in rising order.
fn in_natural_order(mut names: Vec<String>) -> Vec<String> {
    names.sort_by_key(|name| natural(name));
    names
}

/// Returns a sort key that orders names with numbers at their ends by these numbers.
fn natural(name: &str) -> (String, u64, String) {
    let stem = name.trim_end_matches(|c: char| c.is_ascii_digit());
    let number = name[stem.len()..].parse().unwrap_or(0);
    (stem.into(), number, name.into())
}

fn damaged(error: hdf5_pure::Error) -> Fault {
    Fault::new(
        0,
        format!("the file is damaged, or it uses a part of HDF5 that mechid cannot read ({error})"),
    )
}

/// Subtracts the memory of `count` numbers from the budget; returns an error if a file of `len`
/// bytes cannot contain them.
fn take_numbers(count: u64, bytes_each: u64, len: u64, budget: &mut Budget) -> Result<(), Fault> {
    let bytes = count.saturating_mul(bytes_each.max(1));
    if bytes > len.max(MIN_BYTES).saturating_mul(MAX_EXPANSION) {
        let what =
            format!("a data set of {bytes} bytes, more than the file of {len} bytes can hold");
        return Err(Fault::new(0, what));
    }
    let (unpacked, limit) = budget.unpacked_bytes();
    if bytes > unpacked as u64 {
        return Err(Fault::too_large(0, limit));
    }
    let count = usize::try_from(count).unwrap_or(usize::MAX);
    budget.take_numbers(count).map_err(|limit| Fault::too_large(0, limit))
}
