//! The variables of a MATLAB file.

use mechid_signal::message;

use super::element::{Element, Elements, Endian, MATRIX};
use crate::contents::Fault;
use crate::limits::Budget;

/// A variable, or a field of a struct.
#[derive(Debug)]
pub(crate) struct Array {
    pub name: String,
    pub value: Value,
}

/// The value of a variable.
#[derive(Debug)]
pub(crate) enum Value {
    /// Real numbers, column by column.
    Real { rows: usize, columns: usize, values: Vec<f64> },
    /// Its fields.
    Struct(Vec<Array>),
    /// No channel; its name, for people.
    Other(&'static str),
}

/// Depth to which structs in structs are read; deeper ones are refused as forged.
const MOST_NESTED: usize = 32;

/// Number of dimensions beyond which a size is refused as damaged.
const MOST_DIMENSIONS: usize = 64;

/// Flag of complex numbers, in the word that holds the class.
const COMPLEX: u32 = 0x0800;

impl Array {
    /// Reads the variable in the data of an element, which begin at byte `at` of the file.
    pub fn read(
        data: &[u8],
        at: usize,
        endian: Endian,
        depth: usize,
        budget: &mut Budget,
    ) -> Result<Self, Fault> {
        budget.take_column().map_err(|limit| Fault::too_large(at, limit))?;
        if data.is_empty() {
            return Ok(Self { name: String::new(), value: Value::Other("nothing") });
        }
        let mut elements = Elements::new(data, at, endian);
        let flags = elements.required("class")?;
        let flags = match flags.data.first_chunk::<4>() {
            Some(word) => endian.u32(*word),
            None => return Err(Fault::new(flags.at, "the class of a variable is cut short")),
        };
        let class = flags & 0xff;
        if class > 15 {
            // Objects have no size here, but their name comes next.
            let name = text(elements.required("name")?.data);
            return Ok(Self { name, value: Value::Other("an object") });
        }
        let size = elements.required("size")?;
        let lengths = lengths(&size, endian)?;
        let name = text(elements.required("name")?.data);
        let value = match class {
            1 => Value::Other("a cell array"),
            2 if lengths.iter().any(|len| *len != 1) => Value::Other("an array of structs"),
            2 => fields(&mut elements, endian, depth, budget)?,
            3 => Value::Other("an object"),
            4 => Value::Other("text"),
            5 => Value::Other("a sparse matrix"),
            _ if flags & COMPLEX != 0 => Value::Other("complex numbers"),
            _ => real(&mut elements, endian, &lengths, budget)?,
        };
        Ok(Self { name, value })
    }
}

/// Lengths of the dimensions of a variable, two or more.
fn lengths(size: &Element<'_>, endian: Endian) -> Result<Vec<usize>, Fault> {
    let lengths = match size.count() {
        Some(2..=MOST_DIMENSIONS) => size.numbers(endian),
        _ => None,
    };
    let lengths = lengths.ok_or_else(|| Fault::new(size.at, "a variable has no size"))?;
    let length = |value: &f64| {
        // Every u32 is a number exactly; no file has room for a longer dimension.
        let whole = (0.0..=f64::from(u32::MAX)).contains(value) && value.fract() == 0.0;
        whole.then_some(*value as usize).ok_or_else(|| {
            Fault::new(size.at, format!("a dimension of {} is no length", message::number(*value)))
        })
    };
    lengths.iter().map(length).collect()
}

/// The real numbers of a full matrix.
fn real(
    elements: &mut Elements<'_>,
    endian: Endian,
    lengths: &[usize],
    budget: &mut Budget,
) -> Result<Value, Fault> {
    let part = elements.required("numbers")?;
    let Some(count) = part.count() else {
        let what = format!("a variable holds data of type {}, no numbers", part.kind);
        return Err(Fault::new(part.at, what));
    };
    let product = lengths.iter().try_fold(1_usize, |product, len| product.checked_mul(*len));
    if product != Some(count) {
        let sizes: Vec<String> = lengths.iter().map(usize::to_string).collect();
        let what = format!("a variable of {} numbers holds {count}", sizes.join(" × "));
        return Err(Fault::new(part.at, what));
    }
    match *lengths {
        _ if count == 0 => Ok(Value::Other("nothing")),
        [rows, columns] => {
            budget.take_numbers(count).map_err(|limit| Fault::too_large(part.at, limit))?;
            let values = part.numbers(endian).unwrap_or_default();
            Ok(Value::Real { rows, columns, values })
        }
        _ => Ok(Value::Other("an array of more than two dimensions")),
    }
}

/// The fields of a single struct.
fn fields(
    elements: &mut Elements<'_>,
    endian: Endian,
    depth: usize,
    budget: &mut Budget,
) -> Result<Value, Fault> {
    let length = elements.required("length of field names")?;
    let at = length.at;
    if depth == MOST_NESTED {
        return Err(Fault::new(at, format!("structs are nested more than {MOST_NESTED} deep")));
    }
    let length = match length.count() {
        Some(1) => length.numbers(endian).map_or(0.0, |n| n[0]),
        _ => 0.0,
    };
    if !(length >= 1.0 && length.fract() == 0.0) {
        return Err(Fault::new(at, "the field names of a struct have no length"));
    }
    let names = elements.required("field names")?;
    let mut fields = Vec::new();
    for name in names.data.chunks_exact(length as usize) {
        let field = elements.required("fields")?;
        if field.kind != MATRIX {
            return Err(Fault::new(field.at, "a field of a struct is no variable"));
        }
        let Array { value, .. } = Array::read(field.data, field.at, endian, depth + 1, budget)?;
        fields.push(Array { name: text(name), value });
    }
    Ok(Value::Struct(fields))
}

/// A name, which ends at the first zero.
fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}
