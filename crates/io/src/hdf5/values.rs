//! Numbers of a data set.

use hdf5_pure::{DType, Dataset};
use mechid_signal::message;

use super::attributes::Attributes;
use super::take_numbers;
use crate::contents::Fault;
use crate::limits::Budget;

/// Number of channels above which an array is refused as transposed.
const MAX_CHANNELS: usize = 4096;

/// Numbers of a data set, in the order of the file.
pub(super) struct Array {
    pub values: Vec<f64>,
    /// Dimensions that are not 1.
    shape: Vec<usize>,
}

/// Reason why a data set is no array of numbers.
pub(super) enum Trouble {
    /// The data set cannot be used; others can.
    Unusable(String),
    /// The file is refused.
    Fault(Fault),
}

/// Reads a data set of real numbers.
pub(super) fn read(
    dataset: &Dataset,
    attributes: &Attributes,
    len: u64,
    budget: &mut Budget,
) -> Result<Array, Trouble> {
    let unusable = |what: &str| Err(Trouble::Unusable(what.into()));
    let failed =
        |error: hdf5_pure::Error| Trouble::Unusable(format!("data that cannot be read ({error})"));
    if attributes.has("MATLAB_empty") {
        return unusable("an empty array");
    }
    match attributes.text("MATLAB_class") {
        Some("char") => return unusable("text"),
        Some("cell") => return unusable("a cell array"),
        Some("function_handle") => return unusable("a function"),
        _ if attributes.has("MATLAB_object_decode") => {
            return unusable(
                "an object of MATLAB, such as a timetable or a string: save its columns as vectors",
            );
        }
        _ if attributes.has("MATLAB_sparse") => return unusable("a sparse matrix"),
        _ => {}
    }
    match dataset.dtype().map_err(failed)? {
        DType::F32 | DType::F64 => {}
        DType::I8 | DType::I16 | DType::I32 | DType::I64 => {}
        DType::U8 | DType::U16 | DType::U32 | DType::U64 => {}
        DType::String | DType::VariableLengthString => return unusable("text"),
        DType::Compound(fields) if is_complex(&fields) => return unusable("complex numbers"),
        DType::Compound(_) => return unusable("records of several fields"),
        DType::ObjectReference => {
            return unusable("references to other data (a cell array, or an array of structs)");
        }
        _ => return unusable("no numbers"),
    }
    let dimensions = dataset.shape().map_err(failed)?;
    let count = dimensions.iter().try_fold(1_u64, |product, len| product.checked_mul(*len));
    let each = dataset.element_size().map_err(failed)?;
    let Some(count) = count else { return unusable("more numbers than can be counted") };
    if count == 0 {
        return unusable("an empty array");
    }
    // A number is held as one of eight bytes, and a chunk whole.
    take_numbers(count, each, len, budget).map_err(Trouble::Fault)?;
    if let Some(chunk) = dataset.chunk_shape().map_err(failed)? {
        let numbers = chunk.iter().try_fold(1_u64, |product, len| product.checked_mul(*len));
        let mut room = *budget;
        take_numbers(numbers.unwrap_or(u64::MAX), each, len, &mut room).map_err(Trouble::Fault)?;
    }
    let values = dataset.read_f64().map_err(failed)?;
    let shape: Vec<usize> = dimensions
        .iter()
        .filter(|len| **len != 1)
        .map(|len| usize::try_from(*len).unwrap_or(usize::MAX))
        .collect();
    if values.len() as u64 != count {
        return unusable("fewer numbers than it declares");
    }
    match shape[..] {
        [] | [_] => {}
        [a, b] if a.min(b) > MAX_CHANNELS => {
            let size = format!("an array of {a} by {b} numbers");
            return Err(Trouble::Unusable(size));
        }
        [_, _] => {}
        _ => {
            let many = message::count(shape.len(), "dimension");
            return Err(Trouble::Unusable(format!("an array of {many}")));
        }
    }
    Ok(Array { values, shape })
}

fn is_complex(fields: &[(String, DType)]) -> bool {
    let names: Vec<&str> = fields.iter().map(|(name, _)| name.as_str()).collect();
    matches!(names[..], ["r" | "real", "i" | "imag"])
}

impl Array {
    /// Returns the channels: columns of a matrix of MATLAB, which stand one after the other, and otherwise the lines of
    /// numbers along the longer side.
    pub fn into_channels(self, is_matlab: bool) -> Vec<Vec<f64>> {
        let [slow, fast] = self.shape[..] else { return vec![self.values] };
        if is_matlab || fast > slow {
            return self.values.chunks_exact(fast).map(<[f64]>::to_vec).collect();
        }
        (0..fast)
            .map(|channel| self.values.iter().skip(channel).step_by(fast).copied().collect())
            .collect()
    }
}
