//! The variables of a MATLAB file.

use mechid_signal::message;
use nalgebra::Complex;

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
    /// Complex numbers, the first index fastest.
    Complex { lengths: Vec<usize>, values: Vec<Complex<f64>> },
    /// A text of one line.
    Text(String),
    /// The fields of a struct.
    Struct(Vec<Array>),
    /// Elements of a cell array or of an array of structs, each with its index as a name.
    Elements { kind: &'static str, elements: Vec<Array> },
    /// A value that cannot be a channel, with its name for messages.
    Other(&'static str),
}

/// Maximum depth of nested arrays; deeper files are refused as forged.
const MOST_NESTED: usize = 32;

/// Maximum length of a text, in characters: a longer one is neither a name nor a unit.
const MAX_TEXT: usize = 256;

/// Maximum number of dimensions; an array with more is refused as damaged.
const MOST_DIMENSIONS: usize = 64;

/// Flag for complex numbers, in the word with the class.
const COMPLEX: u32 = 0x0800;

impl Array {
    /// Returns whether the value contains numbers at any depth.
    pub fn has_numbers(&self) -> bool {
        match &self.value {
            Value::Real { .. } | Value::Complex { .. } => true,
            Value::Struct(inner) | Value::Elements { elements: inner, .. } => {
                inner.iter().any(Self::has_numbers)
            }
            Value::Text(_) | Value::Other(_) => false,
        }
    }

    /// Reads the variable in the data of an element that begins at byte `at` of the file.
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
            // An object of this format has no element with its dimensions: its name comes next.
            let name = text(elements.required("name")?.data);
            return Ok(Self { name, value: Value::Other(object(&mut elements)) });
        }
        let size = elements.required("size")?;
        let lengths = lengths(&size, endian)?;
        let name = text(elements.required("name")?.data);
        let value = match class {
            1 => cells(&mut elements, endian, depth, budget)?,
            2 => structs(&mut elements, &lengths, endian, depth, budget)?,
            3 => Value::Other("an object"),
            4 => characters(&mut elements, endian),
            5 => Value::Other("a sparse matrix"),
            _ if flags & COMPLEX != 0 => complex(&mut elements, endian, lengths, budget)?,
            _ => real(&mut elements, endian, &lengths, budget)?,
        };
        Ok(Self { name, value })
    }
}

/// Returns the lengths of the dimensions of a variable, two or more.
fn lengths(size: &Element<'_>, endian: Endian) -> Result<Vec<usize>, Fault> {
    let lengths = match size.count() {
        Some(2..=MOST_DIMENSIONS) => size.numbers(endian),
        _ => None,
    };
    let lengths = lengths.ok_or_else(|| Fault::new(size.at, "a variable has no size"))?;
    let length = |value: &f64| {
        // An f64 represents every u32 exactly, and no file can have a dimension longer than
        // `u32::MAX`.
        let whole = (0.0..=f64::from(u32::MAX)).contains(value) && value.fract() == 0.0;
        whole.then_some(*value as usize).ok_or_else(|| {
            Fault::new(
                size.at,
                format!("{} is not a possible size of a dimension", message::number(*value)),
            )
        })
    };
    lengths.iter().map(length).collect()
}

/// Returns the kind of an object; for tables, time series and instants, the text also states how to
/// save them.
fn object(elements: &mut Elements<'_>) -> &'static str {
    // The kind of the object comes next, then its class.
    let mut words = [(); 2].map(|()| elements.next().ok().flatten().map(|word| text(word.data)));
    match words[1].take().as_deref() {
        Some("timetable") => {
            "a timetable: save S = struct('time', seconds(T.Time - T.Time(1)), 'x', T.x) instead"
        }
        Some("table") => "a table: save table2struct(T, 'ToScalar', true)",
        Some("timeseries") => "a timeseries: save struct('time', T.Time, 'x', T.Data)",
        Some("string") => "text",
        Some("datetime" | "duration") => "instants: save seconds(t - t(1))",
        _ => "an object",
    }
}

/// Returns the number of elements of a full matrix; messages name the position of its data.
fn count_of(part: &Element<'_>, lengths: &[usize]) -> Result<usize, Fault> {
    let Some(count) = part.count() else {
        let what = format!(
            "the data of a variable have type {}, which is not a type of numbers",
            part.kind
        );
        return Err(Fault::new(part.at, what));
    };
    let product = lengths.iter().try_fold(1_usize, |product, len| product.checked_mul(*len));
    if product != Some(count) {
        let sizes: Vec<String> = lengths.iter().map(usize::to_string).collect();
        let what = format!("a variable of size {} has {count} numbers", sizes.join(" × "));
        return Err(Fault::new(part.at, what));
    }
    Ok(count)
}

/// Returns the real numbers of a full matrix.
fn real(
    elements: &mut Elements<'_>,
    endian: Endian,
    lengths: &[usize],
    budget: &mut Budget,
) -> Result<Value, Fault> {
    let part = elements.required("numbers")?;
    let count = count_of(&part, lengths)?;
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

/// Returns the complex numbers of a full array with any number of dimensions.
fn complex(
    elements: &mut Elements<'_>,
    endian: Endian,
    lengths: Vec<usize>,
    budget: &mut Budget,
) -> Result<Value, Fault> {
    let real = elements.required("real parts")?;
    let imaginary = elements.required("imaginary parts")?;
    let count = count_of(&real, &lengths)?;
    count_of(&imaginary, &lengths)?;
    if count == 0 {
        return Ok(Value::Other("nothing"));
    }
    // The real and imaginary parts are copied once more when they are combined into complex
    // numbers.
    let room = budget.take_numbers(count.saturating_mul(2));
    room.map_err(|limit| Fault::too_large(real.at, limit))?;
    let [re, im] = [real, imaginary].map(|part| part.numbers(endian).unwrap_or_default());
    let values = re.into_iter().zip(im).map(|(re, im)| Complex::new(re, im)).collect();
    Ok(Value::Complex { lengths, values })
}

/// Returns a text of one line.
fn characters(elements: &mut Elements<'_>, endian: Endian) -> Value {
    let Ok(part) = elements.required("characters") else { return Value::Other("text") };
    if part.data.len() > 2 * MAX_TEXT {
        return Value::Other("text");
    }
    let text = match part.kind {
        // MATLAB stores characters as 16-bit integers, as UTF-8 or as UTF-16.
        4 | 17 => {
            let words = part.data.as_chunks::<2>().0.iter().map(|word| endian.u16(*word));
            String::from_utf16_lossy(&words.collect::<Vec<u16>>())
        }
        _ => String::from_utf8_lossy(part.data).into_owned(),
    };
    Value::Text(text.trim_matches(['\0', ' ']).to_owned())
}

/// Reads an array inside another array.
fn inner(
    elements: &mut Elements<'_>,
    endian: Endian,
    depth: usize,
    budget: &mut Budget,
) -> Result<Array, Fault> {
    let element = elements.required("elements")?;
    if element.kind != MATRIX {
        return Err(Fault::new(element.at, "an entry of a cell array or a struct is not an array"));
    }
    if depth == MOST_NESTED {
        let what = format!("arrays are nested more than {MOST_NESTED} deep");
        return Err(Fault::new(element.at, what));
    }
    Array::read(element.data, element.at, endian, depth + 1, budget)
}

/// Returns the elements of a cell array.
fn cells(
    elements: &mut Elements<'_>,
    endian: Endian,
    depth: usize,
    budget: &mut Budget,
) -> Result<Value, Fault> {
    let mut cells = Vec::new();
    while !elements.is_at_end() {
        let Array { value, .. } = inner(elements, endian, depth, budget)?;
        cells.push(Array { name: format!("{{{}}}", cells.len() + 1), value });
    }
    Ok(Value::Elements { kind: "a cell array", elements: cells })
}

/// Returns the fields of a struct, or of each struct in an array.
fn structs(
    elements: &mut Elements<'_>,
    lengths: &[usize],
    endian: Endian,
    depth: usize,
    budget: &mut Budget,
) -> Result<Value, Fault> {
    let length = elements.required("length of field names")?;
    let at = length.at;
    let length = match length.count() {
        Some(1) => length.numbers(endian).map_or(0.0, |n| n[0]),
        _ => 0.0,
    };
    if !(length >= 1.0 && length.fract() == 0.0) {
        return Err(Fault::new(at, "the length of the field names of a struct is not stated"));
    }
    let names = elements.required("field names")?;
    let names: Vec<String> = names.data.chunks_exact(length as usize).map(text).collect();
    let mut fields = |budget: &mut Budget| -> Result<Value, Fault> {
        let fields = names.iter().map(|name| {
            let Array { value, .. } = inner(elements, endian, depth, budget)?;
            Ok(Array { name: name.clone(), value })
        });
        Ok(Value::Struct(fields.collect::<Result<_, Fault>>()?))
    };
    let count = lengths.iter().try_fold(1_usize, |product, len| product.checked_mul(*len));
    match count {
        Some(1) => fields(budget),
        // Structs without fields have no contents, so any number of them needs no memory.
        _ if names.is_empty() => Ok(Value::Other("nothing")),
        Some(count) => {
            let mut structs = Vec::new();
            for number in 1..=count {
                structs.push(Array { name: format!("({number})"), value: fields(budget)? });
            }
            Ok(Value::Elements { kind: "an array of structs", elements: structs })
        }
        None => Err(Fault::new(at, "an array of structs has too many elements")),
    }
}

/// Returns a name, which ends at the first zero byte.
fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}
