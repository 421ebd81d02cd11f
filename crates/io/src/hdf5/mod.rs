//! HDF5 files, and MATLAB files of version 7.3, which are HDF5.
//!
//! # Source
//! The HDF Group, *HDF5 File Format Specification*, version 3, read by the crate `hdf5-pure`; The MathWorks,
//! *MAT-File Versions*, for the attributes and the order of dimensions of version 7.3.

mod attributes;
mod values;

use std::panic::{AssertUnwindSafe, catch_unwind};

use hdf5_pure::{File, Group};

use self::attributes::Attributes;
use crate::IoError;
use crate::contents::{Axis, Column, Contents, Fault, Place};
use crate::limits::{Budget, Limits};
use crate::stated_rates::{step, with_own_times, with_stated_rates};

/// Largest depth of groups in groups; deeper ones are refused as forged, as cycles of links are.
const MAX_DEPTH: usize = 16;

/// Largest number of groups; a cycle of links makes more.
const MAX_GROUPS: usize = 4096;

/// Largest number of bytes that a byte of the file may stand for: deflate packs 1032 into one.
const MAX_EXPANSION: u64 = 1100;

/// Length below which a file may declare as many bytes as one of this length.
const MIN_BYTES: u64 = 4096;

/// Reads the data sets of a file as columns.
pub(crate) fn read(file: &str, bytes: Vec<u8>, limits: &Limits) -> Result<Contents, IoError> {
    let is_matlab = bytes.starts_with(b"MATLAB");
    let budget = Budget::new(limits, bytes.len());
    // The crate is young: a panic in it is a file that it does not read.
    let read = catch_unwind(AssertUnwindSafe(|| Reader::read(bytes, is_matlab, budget)));
    let read = read.unwrap_or_else(|_| Err(Fault::new(0, "its structure is damaged")));
    let contents = read.map_err(|fault| fault.error(file, Place::Byte(1)))?;
    let contents = with_own_times(with_stated_rates(contents));
    if contents.columns.is_empty() {
        return Err(IoError::Empty { file: file.into(), found: "it has no data set of numbers" });
    }
    Ok(contents.with_usual_length())
}

/// A file on its way into columns.
struct Reader {
    contents: Contents,
    budget: Budget,
    is_matlab: bool,
    /// Length of the file, in bytes.
    len: u64,
    /// Groups so far.
    groups: usize,
}

impl Reader {
    fn read(bytes: Vec<u8>, is_matlab: bool, budget: Budget) -> Result<Contents, Fault> {
        let len = bytes.len() as u64;
        let file = File::from_bytes(bytes).map_err(damaged)?;
        let format = if is_matlab { "MATLAB 7.3 (HDF5)" } else { "HDF5" };
        let contents = Contents { format: format.into(), ..Contents::default() };
        let mut reader = Self { contents, budget, is_matlab, len, groups: 0 };
        reader.add_group(&file.root(), "", 0)?;
        Ok(reader.contents)
    }

    /// Sign between the names of a group and its members.
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
                "groups in groups deeper than {MAX_DEPTH}, or more than {MAX_GROUPS} of them (a cycle of links?)"
            );
            return Err(Fault::new(0, what));
        }
        let attributes = Attributes::of_group(group);
        for (name, value) in attributes.numbers() {
            let name = self.path(path, name);
            self.contents.scalars.push((name, value));
        }
        let mut names = group.datasets().map_err(damaged)?;
        names.sort_by_key(|a| natural(a));
        for name in names {
            self.budget.take_column().map_err(|limit| Fault::too_large(0, limit))?;
            let at = self.path(path, &name);
            self.add_dataset(group, &name, at, &attributes)?;
        }
        let mut names = group.groups().map_err(damaged)?;
        names.sort_by_key(|a| natural(a));
        for name in names.into_iter().filter(|name| !name.starts_with('#')) {
            self.budget.take_column().map_err(|limit| Fault::too_large(0, limit))?;
            let at = self.path(path, &name);
            match group.group(&name) {
                Ok(inner) => self.add_group(&inner, &at, depth + 1)?,
                Err(error) => {
                    let what = format!("a group that cannot be read ({error})");
                    self.contents.columns.push(Column::unusable(at, what));
                }
            }
        }
        Ok(())
    }

    fn add_dataset(
        &mut self,
        group: &Group,
        name: &str,
        path: String,
        of_group: &Attributes,
    ) -> Result<(), Fault> {
        let unusable = |what: String| Column::unusable(path.clone(), what);
        let dataset = match group.dataset(name) {
            Ok(dataset) => dataset,
            Err(error) => {
                self.contents.columns.push(unusable(format!("data that cannot be read ({error})")));
                return Ok(());
            }
        };
        let attributes = Attributes::of_dataset(&dataset);
        let array = match values::read(&dataset, &attributes, self.len, &mut self.budget) {
            Ok(array) => array,
            Err(values::Trouble::Unusable(what)) => {
                self.contents.columns.push(unusable(what));
                return Ok(());
            }
            Err(values::Trouble::Fault(fault)) => return Err(fault),
        };
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
                ..Column::of_numbers(name, values)
            });
        }
        Ok(())
    }
}

/// Sorts names with numbers at their ends by these.
fn natural(name: &str) -> (String, u64, String) {
    let stem = name.trim_end_matches(|c: char| c.is_ascii_digit());
    let number = name[stem.len()..].parse().unwrap_or(0);
    (stem.into(), number, name.into())
}

fn damaged(error: hdf5_pure::Error) -> Fault {
    Fault::new(0, format!("its structure is damaged, or of a kind that is not read here ({error})"))
}

/// Takes room for numbers of some bytes each, of which a file of `len` bytes may hold so many.
fn take_numbers(count: u64, bytes_each: u64, len: u64, budget: &mut Budget) -> Result<(), Fault> {
    let bytes = count.saturating_mul(bytes_each.max(1));
    if bytes > len.max(MIN_BYTES).saturating_mul(MAX_EXPANSION) {
        let what =
            format!("a data set of {bytes} bytes in a file of {len}, which cannot hold as many");
        return Err(Fault::new(0, what));
    }
    let (unpacked, limit) = budget.unpacked_bytes();
    if bytes > unpacked as u64 {
        return Err(Fault::too_large(0, limit));
    }
    let count = usize::try_from(count).unwrap_or(usize::MAX);
    budget.take_numbers(count).map_err(|limit| Fault::too_large(0, limit))
}
