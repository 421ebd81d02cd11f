//! Conversion of a dataset 58 to columns of a table.

use super::header::Header;
use super::lines::{Line, Lines};
use super::values::{Binary, printed};
use crate::contents::{Axis, Column, Contents, Fault};
use crate::limits::Budget;
use crate::{Quantity, Unit, escaped};

/// Abscissa types other than time: frequency, and revolutions or orders of a shaft.
const NOT_TIME: [u32; 3] = [18, 19, 20];

/// Adds the columns of the dataset whose number is on the line `id`: one or, for uneven instants,
/// two.
pub(super) fn read(
    lines: &mut Lines<'_>,
    id: &Line<'_>,
    contents: &mut Contents,
    budget: &mut Budget,
) -> Result<(), Fault> {
    let (header, values) = dataset(lines, id, budget)?;
    add(header, values, contents);
    Ok(())
}

/// Reads the dataset whose number is on the line `id`: its description and its numbers.
pub(super) fn dataset(
    lines: &mut Lines<'_>,
    id: &Line<'_>,
    budget: &mut Budget,
) -> Result<(Header, Vec<f64>), Fault> {
    let binary = Binary::from_id(id)?;
    let header = Header::read(lines)?;
    if header.count == 0 {
        return Err(Fault::new(header.form_at, "a function without values"));
    }
    // A number needs at least one byte, so the number of remaining bytes limits the memory that a
    // forged header can claim.
    let numbers = header.numbers().min(lines.rest().len());
    let room = (0..if header.is_even { 1 } else { 2 }).try_for_each(|_| budget.take_column());
    room.and_then(|()| budget.take_numbers(numbers))
        .map_err(|limit| Fault::too_large(header.form_at, limit))?;
    let values = match binary {
        None => printed(&header, lines)?,
        Some(binary) => binary.read(&header, lines)?,
    };
    Ok((header, values))
}

/// Returns the size of the unit of the instants, in s, that the label of the abscissa states; a
/// remark is added if this unit is not the second, or if the label is not a unit of time.
fn time_unit(header: &Header, remarks: &mut Vec<String>) -> f64 {
    let Some(stated) = header.abscissa_unit(Quantity::Time) else { return 1.0 };
    let is_time = |unit: &&Unit| unit.quantity == Quantity::Time;
    let in_s = stated.used().filter(is_time).map(|unit| unit.in_si);
    let text = escaped(&stated.text);
    let remark = match in_s {
        Some(1.0) => return 1.0,
        Some(in_s) => format!(
            "the labels of the file state instants in {text}: the instants were multiplied by {in_s} to get s"
        ),
        None => {
            format!(
                "the labels of the file state instants in {text}, which is not a unit of time: s is assumed"
            )
        }
    };
    if !remarks.contains(&remark) {
        remarks.push(remark);
    }
    in_s.unwrap_or(1.0)
}

fn add(header: Header, values: Vec<f64>, contents: &mut Contents) {
    let name = match (&header.reference, header.function) {
        (Some(reference), 2..) => format!("{}/{reference}", header.response),
        _ => header.response.clone(),
    };
    let about: Vec<&str> = [header.title.as_str(), &header.quantity]
        .into_iter()
        .filter(|part| !part.is_empty())
        .collect();
    let about = about.join(", ");
    let kind = match header.ordinate[0] {
        8 => Some(Quantity::DISPLACEMENT),
        11 => Some(Quantity::VELOCITY),
        12 => Some(Quantity::ACCELERATION),
        9 | 13 => Some(Quantity::Force),
        _ => None,
    };
    let unit = header.units[0].clone();
    let in_time = header.function <= 1 && !NOT_TIME.contains(&header.abscissa);
    if !in_time || header.is_complex {
        let what = if in_time { "complex numbers".into() } else { header.kind() };
        contents.columns.push(Column { about, ..Column::unusable(name, what) });
        return;
    }
    let in_s = time_unit(&header, &mut contents.remarks);
    let columns = &mut contents.columns;
    if header.is_even {
        let axis = Axis::Even { start: in_s * header.start, step: in_s * header.step };
        columns.push(Column { about, axis, unit, kind, ..Column::from_numbers(name, values) });
        return;
    }
    let (pairs, _) = values.as_chunks::<2>();
    let (times, values) = pairs.iter().map(|[time, value]| (in_s * *time, *value)).unzip();
    // The column of instants is its own time axis, too.
    let axis = Axis::Column(columns.len());
    columns.push(Column { axis, ..Column::from_numbers(format!("{name} time"), times) });
    columns.push(Column { about, axis, unit, kind, ..Column::from_numbers(name, values) });
}
