//! MATLAB files of level 5, which versions 5 to 7.2 write, compressed or not.
//!
//! Read by hand: of the two crates that read them one takes nothing but MATLAB's own header (not
//! SciPy's) and leaves out what a cut-short file lacks without a word, the other prints, and knows
//! no structs and no doubles stored as bytes.
//!
//! # Source
//! The MathWorks, *MAT-File Format*.

mod array;
mod element;

use mechid_signal::counted;
use std::io::Read as _;

use flate2::read::ZlibDecoder;

use self::array::{Array, Value};
use self::element::{COMPRESSED, Elements, Endian, Fault, MATRIX};
use crate::IoError;
use crate::table::{Column, Contents, Place};

/// Bytes before the first variable.
const HEADER: usize = 128;

/// Wider matrices become no columns, unless they are longer still: more likely they lie on their
/// side.
const WIDEST: usize = 256;

/// The variables of a file as columns.
pub(crate) fn read(file: &str, bytes: &[u8]) -> Result<Contents, IoError> {
    let malformed = |fault: Fault| IoError::Malformed {
        file: file.into(),
        at: Place::Byte(fault.at + 1),
        what: fault.what,
    };
    let variables = variables(bytes).map_err(malformed)?;
    let mut contents = Contents { format: "MATLAB level 5".into(), ..Contents::default() };
    for variable in variables {
        add(&mut contents, variable);
    }
    if contents.columns.is_empty() {
        return Err(IoError::Empty { file: file.into(), found: "it has no vector of numbers" });
    }
    Ok(contents.with_usual_length())
}

/// All variables of a file.
fn variables(bytes: &[u8]) -> Result<Vec<Array>, Fault> {
    let endian = match bytes.get(HEADER - 2..HEADER) {
        Some(b"IM") => Endian::Little,
        Some(b"MI") => Endian::Big,
        _ => return Err(Fault::new(0, "the header of 128 bytes ends with neither IM nor MI")),
    };
    let mut variables = Vec::new();
    let mut elements = Elements::new(&bytes[HEADER..], HEADER, endian);
    while let Some(element) = elements.next_at_top()? {
        let at = element.at;
        match element.kind {
            MATRIX => variables.push(Array::read(element.data, at, endian, 0)?),
            COMPRESSED => {
                let inflated = inflated(element.data, at)?;
                // Places inside are told by where the compressed variable stands.
                let inside = |fault: Fault| Fault { at, ..fault };
                let mut elements = Elements::new(&inflated, at, endian);
                let inner = elements.next().map_err(inside)?;
                let Some(inner) = inner.filter(|e| e.kind == MATRIX) else {
                    return Err(Fault::new(at, "the compressed data are no variable"));
                };
                variables.push(Array::read(inner.data, at, endian, 0).map_err(inside)?);
            }
            // Others are allowed, and mean nothing here.
            _ => {}
        }
    }
    Ok(variables)
}

fn inflated(data: &[u8], at: usize) -> Result<Vec<u8>, Fault> {
    let mut bytes = Vec::new();
    match ZlibDecoder::new(data).read_to_end(&mut bytes) {
        Ok(_) => Ok(bytes),
        Err(e) => Err(Fault::new(at, format!("a compressed variable is damaged ({e})"))),
    }
}

/// Adds a variable: its vectors as columns, a single number as such.
fn add(contents: &mut Contents, Array { name, value }: Array) {
    let unusable = match value {
        Value::Struct(fields) => {
            for field in fields {
                let name = format!("{name}.{}", field.name);
                add(contents, Array { name, ..field });
            }
            return;
        }
        Value::Real { mut values, .. } if values.len() == 1 => {
            contents.scalars.push((name, values.remove(0)));
            return;
        }
        Value::Real { rows, columns, values } => {
            if rows == 1 || columns == 1 {
                contents.columns.push(Column::of_numbers(name, values));
                return;
            }
            if columns <= WIDEST || columns <= rows {
                for (number, column) in (1..).zip(values.chunks_exact(rows)) {
                    let name = format!("{name}[{number}]");
                    contents.columns.push(Column::of_numbers(name, column.to_vec()));
                }
                return;
            }
            format!(
                "a matrix of {} and {columns} columns (transpose it: a channel is a column)",
                counted(rows, "row")
            )
        }
        Value::Other(what) => what.into(),
    };
    contents.columns.push(Column::unusable(name, unusable));
}
