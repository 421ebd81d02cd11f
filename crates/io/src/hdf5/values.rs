//! Numbers in a data set.

use hdf5_pure::{CompoundField, CompoundType, DType, Dataset, Datatype, FormatError, Object};
use mechid_signal::message;
use nalgebra::Complex;

use super::attributes::Attributes;
use super::take_numbers;
use crate::contents::Fault;
use crate::limits::Budget;
use crate::mat::COMPLEX_NUMBERS;

/// Maximum number of channels of an array; an array with more is refused, because it is probably
/// transposed.
const MAX_CHANNELS: usize = 4096;

/// Contents of a data set.
pub(super) enum Content {
    Numbers(Array),
    /// Complex numbers, whose last index varies fastest, with the lengths of the dimensions.
    Complex {
        lengths: Vec<usize>,
        values: Vec<Complex<f64>>,
    },
    /// Other data sets and groups, to which a MATLAB cell array refers.
    References(Vec<Object>),
}

/// Maximum length of a MATLAB text, in characters.
const MAX_TEXT: u64 = 256;

/// Returns a MATLAB text of one line, which is stored as one number per character.
pub(super) fn characters(dataset: &Dataset) -> Option<String> {
    let count = dataset.shape().ok()?.iter().try_fold(1_u64, |count, len| count.checked_mul(*len));
    if count? > MAX_TEXT || dataset.dtype().ok()? != DType::U16 {
        return None;
    }
    String::from_utf16(&dataset.read_u16().ok()?).ok()
}

/// Estimated memory of an open object, as a number of array elements.
const OBJECT_NUMBERS: u64 = 64;

/// Numbers of a data set, in the order of the file.
pub(super) struct Array {
    pub values: Vec<f64>,
    /// Lengths of the dimensions that are longer than 1.
    shape: Vec<usize>,
}

/// Reason why a data set cannot be read as an array of numbers.
pub(super) enum Trouble {
    /// The data set cannot be used, but other data sets of the file can.
    Unusable(String),
    /// The whole file is refused.
    Fault(Fault),
}

/// Reads a data set of numbers or of references.
pub(super) fn read(
    dataset: &Dataset,
    attributes: &Attributes,
    len: u64,
    budget: &mut Budget,
) -> Result<Content, Trouble> {
    let unusable = |what: &str| Err(Trouble::Unusable(what.into()));
    if let Some(class) = unusable_class(attributes) {
        return unusable(class);
    }
    match dataset.dtype().map_err(cannot_be_read)? {
        DType::F32 | DType::F64 => {}
        DType::I8 | DType::I16 | DType::I32 | DType::I64 => {}
        DType::U8 | DType::U16 | DType::U32 | DType::U64 => {}
        DType::String | DType::VariableLengthString => return unusable("text"),
        DType::Compound(fields) if is_complex(&fields) => {
            return complex(dataset, len, budget);
        }
        DType::Compound(_) => return unusable("records of several fields"),
        DType::ObjectReference => return references(dataset, len, budget),
        _ => return unusable("no numbers"),
    }
    Ok(Content::Numbers(array(dataset, len, budget)?))
}

/// Returns the content of a data set of MATLAB that is not numbers, in words; `None` for numbers.
fn unusable_class(attributes: &Attributes) -> Option<&'static str> {
    if attributes.has("MATLAB_empty") {
        return Some("an empty array");
    }
    match attributes.text("MATLAB_class") {
        Some("char") => Some("text"),
        Some("function_handle") => Some("a function"),
        _ if attributes.has("MATLAB_object_decode") => Some(
            "an object of MATLAB, such as a timetable or a string: save S = struct('time', \
             seconds(T.Time - T.Time(1)), 'x', T.x) instead",
        ),
        _ if attributes.has("MATLAB_sparse") => Some("a sparse matrix"),
        _ => None,
    }
}

/// Reads a data set of real numbers after its memory is subtracted from the budget.
fn array(dataset: &Dataset, len: u64, budget: &mut Budget) -> Result<Array, Trouble> {
    let unusable = |what: &str| Err(Trouble::Unusable(what.into()));
    let dimensions = dataset.shape().map_err(cannot_be_read)?;
    let count = dimensions.iter().try_fold(1_u64, |product, len| product.checked_mul(*len));
    let element_bytes = dataset.element_size().map_err(cannot_be_read)?;
    let Some(count) = count else { return unusable("an array with too many numbers") };
    if count == 0 {
        return unusable("an empty array");
    }
    // Each number uses eight bytes in memory. A chunk is unpacked as a whole, so one chunk must
    // also fit into the remaining budget.
    take_numbers(count, element_bytes, len, budget).map_err(Trouble::Fault)?;
    if let Some(chunk) = dataset.chunk_shape().map_err(cannot_be_read)? {
        let numbers = chunk.iter().try_fold(1_u64, |product, len| product.checked_mul(*len));
        let mut room = *budget;
        take_numbers(numbers.unwrap_or(u64::MAX), element_bytes, len, &mut room)
            .map_err(Trouble::Fault)?;
    }
    let values = dataset.read_f64().map_err(cannot_be_read)?;
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

fn cannot_be_read(error: hdf5_pure::Error) -> Trouble {
    Trouble::Unusable(format!("data that cannot be read ({error})"))
}

/// Returns the lengths of the dimensions of a data set whose elements need `numbers` numbers each,
/// and subtracts their memory from the budget.
fn lengths(
    dataset: &Dataset,
    numbers: u64,
    len: u64,
    budget: &mut Budget,
) -> Result<Vec<usize>, Trouble> {
    let failed =
        |error: hdf5_pure::Error| Trouble::Unusable(format!("data that cannot be read ({error})"));
    let shape = dataset.shape().map_err(failed)?;
    let element_bytes = dataset.element_size().map_err(failed)?;
    let count = shape.iter().try_fold(1_u64, |count, len| count.checked_mul(*len));
    let Some(count) = count.filter(|count| *count > 0) else {
        return Err(Trouble::Unusable("an empty array".into()));
    };
    take_numbers(count.saturating_mul(numbers), element_bytes.div_ceil(numbers), len, budget)
        .map_err(Trouble::Fault)?;
    if let Some(chunk) = dataset.chunk_shape().map_err(failed)? {
        let count = chunk.iter().try_fold(1_u64, |count, len| count.checked_mul(*len));
        let mut room = *budget;
        take_numbers(count.unwrap_or(u64::MAX), element_bytes, len, &mut room)
            .map_err(Trouble::Fault)?;
    }
    Ok(shape.iter().map(|len| usize::try_from(*len).unwrap_or(usize::MAX)).collect())
}

/// Real and imaginary part of an element, from its two fields.
struct Pair(Complex<f64>);

impl CompoundType for Pair {
    fn datatype() -> Result<Datatype, FormatError> {
        <(f64, f64) as CompoundType>::datatype()
    }

    fn encode(&self, output: &mut Vec<u8>) {
        (self.0.re, self.0.im).encode(output);
    }

    fn decode(datatype: &Datatype, bytes: &[u8]) -> Result<Self, FormatError> {
        let Datatype::Compound { members, .. } = datatype else {
            return Err(FormatError::CompoundFieldMissing("real".into()));
        };
        let part = |at: usize| {
            let missing = || FormatError::CompoundFieldMissing("a part".into());
            let member = members.get(at).ok_or_else(missing)?;
            let start = usize::try_from(member.byte_offset).map_err(|_| missing())?;
            let end = start.saturating_add(member.datatype.type_size() as usize);
            let bytes = bytes.get(start..end).ok_or_else(missing)?;
            f64::decode_field(&member.datatype, bytes)
                .or_else(|_| f32::decode_field(&member.datatype, bytes).map(f64::from))
        };
        Ok(Self(Complex::new(part(0)?, part(1)?)))
    }
}

/// Reads complex numbers.
fn complex(dataset: &Dataset, len: u64, budget: &mut Budget) -> Result<Content, Trouble> {
    // A complex number counts as four numbers, because during decoding the stored bytes need memory
    // in addition to the two numbers.
    let lengths = lengths(dataset, 4, len, budget)?;
    let pairs = dataset.read_compound::<Pair>();
    let pairs = pairs.map_err(|error| {
        Trouble::Unusable(format!("complex numbers that cannot be read ({error})"))
    })?;
    let values: Vec<Complex<f64>> = pairs.into_iter().map(|pair| pair.0).collect();
    if values.len() != lengths.iter().product::<usize>() {
        return Err(Trouble::Unusable(COMPLEX_NUMBERS.into()));
    }
    Ok(Content::Complex { lengths, values })
}

/// Returns the objects to which a data set of references refers.
pub(super) fn references(
    dataset: &Dataset,
    len: u64,
    budget: &mut Budget,
) -> Result<Content, Trouble> {
    // Every object is opened, and an open object needs far more memory than a number.
    let lengths = lengths(dataset, OBJECT_NUMBERS, len, budget)?;
    for _ in 0..lengths.iter().product() {
        budget.take_column().map_err(|limit| Trouble::Fault(Fault::too_large(0, limit)))?;
    }
    let objects = dataset.dereference();
    let objects = objects
        .map_err(|error| Trouble::Unusable(format!("references without a target ({error})")))?;
    Ok(Content::References(objects))
}

fn is_complex(fields: &[(String, DType)]) -> bool {
    let names: Vec<&str> = fields.iter().map(|(name, _)| name.as_str()).collect();
    matches!(names[..], ["r" | "real", "i" | "imag"])
}

impl Array {
    /// Returns the channels: columns of a MATLAB matrix, which are stored one after the other;
    /// otherwise the rows or columns along the longer side.
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
