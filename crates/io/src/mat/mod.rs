//! MATLAB files of level 5, which versions 5 to 7.2 write, compressed or not.
//!
//! This reader replaces two existing crates: one accepts only the header of MATLAB itself (not that
//! of SciPy) and reads a truncated file without an error; the other crate prints to the terminal,
//! and reads neither structs nor doubles that are stored as bytes.
//!
//! # Source
//! The MathWorks, *MAT-File Format*.

mod array;
mod element;

use std::io::Read as _;

use flate2::read::ZlibDecoder;
use mechid_signal::message;

use self::array::{Array, Value};
use self::element::{COMPRESSED, Elements, Endian, MATRIX};
use crate::IoError;
use crate::contents::{Column, ComplexArray, Contents, Fault, Place};
use crate::labels::with_labels;
use crate::limits::{Budget, Limit};
use crate::stated_rates::{with_own_times, with_stated_rates};

/// Number of bytes before the first variable.
const HEADER: usize = 128;

/// Maximum number of columns of a matrix with fewer rows than columns; a wider one is refused,
/// because it is probably transposed.
const WIDEST: usize = 256;

/// Term for complex numbers in a message about a channel.
pub(crate) const COMPLEX_NUMBERS: &str = "complex numbers (`frf_table` reads frequency responses)";

/// Reads the variables of a file as columns.
pub(crate) fn read(file: &str, bytes: &[u8], budget: Budget) -> Result<Contents, IoError> {
    let contents = contents(bytes, budget).map_err(|fault| {
        let at = Place::Byte(fault.at + 1);
        fault.error(file, at)
    })?;
    let contents = with_labels(with_own_times(with_stated_rates(contents)));
    if contents.columns.is_empty() {
        return Err(IoError::Empty { file: file.into(), found: "there is no vector of numbers" });
    }
    Ok(contents.with_usual_length())
}

fn contents(bytes: &[u8], mut budget: Budget) -> Result<Contents, Fault> {
    let endian = match bytes.get(HEADER - 2..HEADER) {
        Some(b"IM") => Endian::Little,
        Some(b"MI") => Endian::Big,
        _ => return Err(Fault::new(0, "the header of 128 bytes ends with neither IM nor MI")),
    };
    let mut contents = Contents { format: "MATLAB level 5".into(), ..Contents::default() };
    let mut elements = Elements::new(&bytes[HEADER..], HEADER, endian);
    while let Some(element) = elements.next_at_top()? {
        let at = element.at;
        let variable = match element.kind {
            MATRIX => Array::read(element.data, at, endian, 0, &mut budget)?,
            COMPRESSED => {
                let inflated = inflated(element.data, at, budget.unpacked_bytes())?;
                budget.take_bytes(inflated.len()).map_err(|limit| Fault::too_large(at, limit))?;
                // Errors inside a compressed variable are reported at the position of this
                // variable.
                let inside = |fault: Fault| Fault { at, ..fault };
                let mut elements = Elements::new(&inflated, at, endian);
                let inner = elements.next().map_err(inside)?;
                let Some(inner) = inner.filter(|e| e.kind == MATRIX) else {
                    return Err(Fault::new(at, "the compressed data are not a variable"));
                };
                let variable = Array::read(inner.data, at, endian, 0, &mut budget);
                budget.give_bytes(inflated.len());
                variable.map_err(inside)?
            }
            // Other elements are allowed but contain no variables.
            _ => continue,
        };
        add(&mut contents, variable, at, &mut budget)?;
    }
    Ok(contents)
}

fn inflated(data: &[u8], at: usize, (most, limit): (usize, Limit)) -> Result<Vec<u8>, Fault> {
    let mut bytes = Vec::new();
    let read = ZlibDecoder::new(data).take(most as u64 + 1).read_to_end(&mut bytes);
    match read {
        Ok(_) if bytes.len() > most => Err(Fault::too_large(at, limit)),
        Ok(_) => Ok(bytes),
        Err(e) => Err(Fault::new(at, format!("a compressed variable is damaged ({e})"))),
    }
}

/// Adds the variable at byte `at`: vectors as columns, a single number as a scalar.
fn add(
    contents: &mut Contents,
    Array { name, value }: Array,
    at: usize,
    budget: &mut Budget,
) -> Result<(), Fault> {
    match value {
        Value::Struct(fields) => {
            for field in fields {
                let name = format!("{name}.{}", field.name);
                add(contents, Array { name, ..field }, at, budget)?;
            }
        }
        Value::Elements { kind, elements } if !elements.iter().any(Array::has_numbers) => {
            let texts = elements.into_iter().filter_map(|element| match element.value {
                Value::Text(text) => Some((name.clone() + &element.name, text)),
                _ => None,
            });
            contents.texts.extend(texts);
            contents.columns.push(Column::unusable(name, kind));
        }
        Value::Elements { elements, .. } => {
            for element in elements {
                let name = name.clone() + &element.name;
                add(contents, Array { name, ..element }, at, budget)?;
            }
        }
        Value::Real { values, .. } if values.len() == 1 => {
            contents.scalars.push((name, values[0]));
        }
        Value::Real { rows, columns, values } => {
            add_matrix(contents, name, [rows, columns], values, at, budget)?;
        }
        Value::Complex { lengths, values } => {
            let array = ComplexArray::first_fastest(name.clone(), lengths, values);
            contents.complex.push(array);
            contents.columns.push(Column::unusable(name, COMPLEX_NUMBERS));
        }
        Value::Text(text) => {
            contents.texts.push((name.clone(), text));
            contents.columns.push(Column::unusable(name, "text"));
        }
        Value::Other(what) => contents.columns.push(Column::unusable(name, what)),
    }
    Ok(())
}

/// Adds a matrix: a vector as one column, otherwise each of its columns.
fn add_matrix(
    contents: &mut Contents,
    name: String,
    [rows, columns]: [usize; 2],
    values: Vec<f64>,
    at: usize,
    budget: &mut Budget,
) -> Result<(), Fault> {
    if rows == 1 || columns == 1 {
        contents.columns.push(Column::from_numbers(name, values));
        return Ok(());
    }
    if columns > WIDEST && columns > rows {
        let what = format!(
            "a matrix of {} and {columns} columns (transpose it: a channel is a column)",
            message::count(rows, "row")
        );
        contents.columns.push(Column::unusable(name, what));
        return Ok(());
    }
    for (number, column) in (1..).zip(values.chunks_exact(rows)) {
        budget.take_column().map_err(|limit| Fault::too_large(at, limit))?;
        contents.columns.push(Column::from_numbers(format!("{name}[{number}]"), column.to_vec()));
    }
    Ok(())
}
