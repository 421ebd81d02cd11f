//! The variables of a MATLAB file.

use super::element::{Elements, Endian, Fault, MATRIX};

/// A variable, or a field of a struct.
#[derive(Debug)]
pub(crate) struct Array {
    pub name: String,
    pub value: Value,
}

/// What a variable holds.
#[derive(Debug)]
pub(crate) enum Value {
    /// Real numbers, column by column.
    Real { rows: usize, columns: usize, values: Vec<f64> },
    /// Its fields.
    Struct(Vec<Array>),
    /// Something that makes no channel; what a person calls it.
    Other(&'static str),
}

/// Structs in structs that are followed; more would be a forged file.
const DEEPEST: usize = 32;

/// Flag of complex numbers, in the word that holds the class.
const COMPLEX: u32 = 0x0800;

impl Array {
    /// The variable in the data of an element, which begin at byte `at` of the file.
    pub fn read(data: &[u8], at: usize, endian: Endian, depth: usize) -> Result<Self, Fault> {
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
        let lengths = size.numbers(endian).filter(|lengths| lengths.len() >= 2);
        let lengths = lengths.ok_or_else(|| Fault::new(size.at, "a variable has no size"))?;
        let name = text(elements.required("name")?.data);
        let value = match class {
            1 => Value::Other("a cell array"),
            2 if lengths.iter().any(|len| *len != 1.0) => Value::Other("an array of structs"),
            2 => fields(&mut elements, endian, depth)?,
            3 => Value::Other("an object"),
            4 => Value::Other("text"),
            5 => Value::Other("a sparse matrix"),
            _ if flags & COMPLEX != 0 => Value::Other("complex numbers"),
            _ => real(&mut elements, endian, &lengths)?,
        };
        Ok(Self { name, value })
    }
}

/// The real numbers of a full matrix.
fn real(elements: &mut Elements<'_>, endian: Endian, lengths: &[f64]) -> Result<Value, Fault> {
    let part = elements.required("numbers")?;
    let values = part.numbers(endian);
    let values = values.ok_or_else(|| {
        Fault::new(part.at, format!("a variable holds data of type {}, no numbers", part.kind))
    })?;
    let product: f64 = lengths.iter().product();
    if product != values.len() as f64 {
        let what = format!("a variable of {product} numbers holds {}", values.len());
        return Err(Fault::new(part.at, what));
    }
    if values.is_empty() {
        return Ok(Value::Other("nothing"));
    }
    // Now every length is at most that of `values`.
    match lengths {
        [rows, columns] => {
            Ok(Value::Real { rows: *rows as usize, columns: *columns as usize, values })
        }
        _ => Ok(Value::Other("an array of more than two dimensions")),
    }
}

/// The fields of a single struct.
fn fields(elements: &mut Elements<'_>, endian: Endian, depth: usize) -> Result<Value, Fault> {
    let length = elements.required("length of field names")?;
    let at = length.at;
    if depth == DEEPEST {
        return Err(Fault::new(at, format!("structs stand {DEEPEST} deep in each other")));
    }
    let length = length.numbers(endian).and_then(|n| n.first().copied()).unwrap_or(0.0) as usize;
    let names = elements.required("field names")?;
    if length == 0 {
        return Err(Fault::new(at, "the field names of a struct have no length"));
    }
    let mut fields = Vec::new();
    for name in names.data.chunks_exact(length) {
        let field = elements.required("fields")?;
        if field.kind != MATRIX {
            return Err(Fault::new(field.at, "a field of a struct is no variable"));
        }
        let Array { value, .. } = Array::read(field.data, field.at, endian, depth + 1)?;
        fields.push(Array { name: text(name), value });
    }
    Ok(Value::Struct(fields))
}

/// A name, which ends at the first zero.
fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}
