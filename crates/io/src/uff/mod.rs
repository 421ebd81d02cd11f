//! Universal files: functions of time, and frequency responses, in datasets 58 and 58b.
//!
//! # Source
//! University of Cincinnati, SDRL, *Universal File Formats for Modal Analysis Testing*, datasets
//! 58, 58b, 151 and 164.

mod function;
mod geometry;
mod header;
mod lines;
mod modes;
mod responses;
mod shapes;
mod values;
mod write;

use std::collections::BTreeMap;

use self::lines::{Line, Lines, is_mark, number};
use crate::contents::{Column, Contents, Fault, Override, Place};
use crate::limits::Budget;
use crate::units::ResponseUnit;
use crate::{IoError, Quantity, Unit};

pub(crate) use self::geometry::read_geometry;
pub(crate) use self::modes::read_modes;
pub(crate) use self::responses::read as read_responses;
pub(crate) use self::shapes::write_shapes;
pub(crate) use self::write::write_responses;

/// Reads the functions of a file as columns.
pub(crate) fn read(file: &str, bytes: &[u8], budget: Budget) -> Result<Contents, IoError> {
    let mut lines = Lines::new(bytes);
    match datasets(&mut lines, budget) {
        Ok(contents) if contents.columns.is_empty() => {
            Err(IoError::Empty { file: file.into(), found: "there is no dataset 58" })
        }
        Ok(contents) => Ok(contents.with_usual_length()),
        Err(fault) => {
            let at = Place::Line(lines.number_at(fault.at));
            Err(fault.error(file, at))
        }
    }
}

fn datasets(lines: &mut Lines<'_>, mut budget: Budget) -> Result<Contents, Fault> {
    let mut contents = Contents { format: "universal file".into(), ..Contents::default() };
    let mut skipped: BTreeMap<u32, usize> = BTreeMap::new();
    let mut stated = None;
    while let Some(mark) = lines.next() {
        if mark.text.trim_ascii().is_empty() {
            continue;
        }
        if !is_mark(mark.text) {
            return Err(mark.fault("a dataset must begin with -1 in columns 5 and 6"));
        }
        let id = lines.required("a dataset begins here and has no number")?;
        let dataset = dataset_number(&id)?;
        match dataset {
            58 => function::read(lines, &id, &mut contents, &mut budget)?,
            164 => stated = Some(units(lines)?),
            _ => *skipped.entry(dataset).or_default() += 1,
        }
        skip_to_end(lines)?;
    }
    if let Some(units) = stated {
        contents.remarks.push(units.remark());
        units.apply(&mut contents.columns);
    }
    if !skipped.is_empty() {
        let counts: Vec<String> =
            skipped.iter().map(|(n, count)| format!("{n} ({count})")).collect();
        contents.remarks.push(format!("left out: datasets {}", counts.join(", ")));
    }
    Ok(contents)
}

/// Skips the rest of a dataset.
fn skip_to_end(lines: &mut Lines<'_>) -> Result<(), Fault> {
    while !is_mark(lines.required("dataset has no end: the file is cut short")?.text) {}
    Ok(())
}

/// Returns the number of a dataset, in columns 1 to 6 of its first line.
fn dataset_number(id: &Line<'_>) -> Result<u32, Fault> {
    let field = id.text.get(..6).unwrap_or(id.text);
    number(field).ok_or_else(|| {
        let word = id.text.trim_ascii_start().get(..3).unwrap_or_default();
        id.fault(if word.eq_ignore_ascii_case(b"58b") {
            "the number of a binary dataset is 58 in columns 5 and 6, followed by b in column 7"
        } else {
            "the number of the dataset is missing in columns 1 to 6"
        })
    })
}

/// Units in dataset 164.
struct Units {
    code: u32,
    name: String,
    /// Factors from SI units to the units of the file, for lengths and forces.
    length: f64,
    force: f64,
}

/// Reads the units in dataset 164.
fn units(lines: &mut Lines<'_>) -> Result<Units, Fault> {
    let first = lines.required("the units are cut short")?;
    let code: u32 = number(first.text.get(..10).unwrap_or(first.text))
        .ok_or_else(|| first.fault("the units code is missing in columns 1 to 10"))?;
    let name = String::from_utf8_lossy(first.text.get(10..30).unwrap_or_default());
    let factors = lines.required("the units are cut short")?;
    let factor = |field: usize| -> Result<f64, Fault> {
        let part = factors.text.get(25 * field..).unwrap_or_default();
        number(part.get(..25).unwrap_or(part))
            .ok_or_else(|| factors.fault("the factor of a unit is not a number"))
    };
    Ok(Units { code, name: name.trim().into(), length: factor(0)?, force: factor(1)? })
}

impl Units {
    /// Applies the unit of dataset 164 to each column of a known quantity, unless the label of the
    /// column states a unit other than the SI unit.
    fn apply(&self, columns: &mut [Column]) {
        for column in columns {
            let Some(quantity) = column.kind else { continue };
            let per_si = if quantity == Quantity::Force { self.force } else { self.length };
            let in_si = 1.0 / per_si;
            // A label in SI units is often left unchanged when a program writes other units.
            let is_stated = Unit::parse(&column.unit).is_some_and(|unit| unit.in_si != 1.0);
            if !is_stated && in_si.is_normal() && in_si > 0.0 && in_si != 1.0 {
                let name = format!("the unit of dataset 164 (code {} {})", self.code, self.name);
                column.overriding = Some(Override::Unit(Unit { name, quantity, in_si }));
            }
        }
    }

    /// Returns the factor that converts a frequency response to SI units, and the labels that were
    /// used. The factor comes from the labels or, without them, from the factors of the file.
    fn factor(stated: Option<&Self>, labels: &[String; 2]) -> (f64, Vec<String>) {
        let [motion, force] = labels;
        let of_label = |label: &String, is_force: bool| {
            let unit = Unit::parse(label).filter(|unit| unit.in_si != 1.0)?;
            ((unit.quantity == Quantity::Force) == is_force).then_some(unit.in_si)
        };
        if let Some(whole) =
            ResponseUnit::parse(motion).filter(|unit| !unit.is_inverse && unit.in_si != 1.0)
        {
            return (whole.in_si, vec![motion.clone()]);
        }
        let used = [(motion, false), (force, true)].into_iter();
        let used = used.filter(|(label, is_force)| of_label(label, *is_force).is_some());
        let used = used.map(|(label, _)| label.clone()).collect();
        let length =
            of_label(motion, false).or(stated.map(|units| 1.0 / units.length)).unwrap_or(1.0);
        let force = of_label(force, true).or(stated.map(|units| 1.0 / units.force)).unwrap_or(1.0);
        (length / force, used)
    }

    fn remark(&self) -> String {
        let Self { code, name, length, force } = self;
        format!(
            "units: code {code} {name}; to get SI units, divide lengths by {length} and forces by \
             {force}"
        )
    }
}
