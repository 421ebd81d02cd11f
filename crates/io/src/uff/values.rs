//! The values of a function, printed or binary.

use mechid_signal::message;

use super::header::Header;
use super::lines::{Line, Lines, is_mark, number};
use crate::contents::Fault;

/// Width of a printed number in single precision.
const SINGLE: usize = 13;

/// Width of a printed number in double precision.
const DOUBLE: usize = 20;

/// Reads the printed numbers up to the mark at the end of the dataset, which is not consumed.
pub(crate) fn printed(header: &Header, lines: &mut Lines<'_>) -> Result<Vec<f64>, Fault> {
    let expected = header.numbers();
    let mut values = Vec::new();
    while values.len() < expected {
        let line = lines.required("the file is cut short within the values of a dataset 58")?;
        if is_mark(line.text) {
            let what = format!(
                "a function should have {}, but it ends after {}",
                message::count(expected, "number"),
                values.len()
            );
            return Err(line.fault(what));
        }
        row(header, &line, &mut values)?;
    }
    if values.len() > expected {
        let what = format!(
            "a function should have {}, but it has more",
            message::count(expected, "number")
        );
        return Err(Fault::new(lines.at().saturating_sub(1), what));
    }
    Ok(values)
}

/// Reads the numbers of a line: separated by blanks, or by their columns if they touch.
fn row(header: &Header, line: &Line<'_>, values: &mut Vec<f64>) -> Result<(), Fault> {
    let before = values.len();
    let blank = |b: &u8| b.is_ascii_whitespace();
    for word in line.text.split(blank).filter(|word| !word.is_empty()) {
        let Some(value) = number(word) else {
            values.truncate(before);
            return by_columns(header, line, values);
        };
        values.push(value);
    }
    Ok(())
}

fn by_columns(header: &Header, line: &Line<'_>, values: &mut Vec<f64>) -> Result<(), Fault> {
    let mut remaining = line.text;
    while !remaining.trim_ascii().is_empty() {
        // Unevenly spaced instants are single precision even if the values are double.
        let numbers_per_value = 2 + usize::from(header.is_complex);
        let is_instant = !header.is_even && values.len().is_multiple_of(numbers_per_value);
        let width = if header.is_double && !is_instant { DOUBLE } else { SINGLE };
        let (field, after) = remaining.split_at(width.min(remaining.len()));
        let value = number(field).ok_or_else(|| {
            let text = String::from_utf8_lossy(field.trim_ascii()).into_owned();
            line.fault(format!("\"{text}\" is not a number"))
        })?;
        values.push(value);
        remaining = after;
    }
    Ok(())
}

/// Number format of a dataset 58b.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Binary {
    is_big_endian: bool,
}

impl Binary {
    /// Reads the format from the line with the number of the dataset; `None` if the values are
    /// printed.
    pub fn from_id(id: &Line<'_>) -> Result<Option<Self>, Fault> {
        if !matches!(id.text.get(6), Some(b'b' | b'B')) {
            return Ok(None);
        }
        let field = |from: usize| id.text.get(from..from + 6).and_then(number::<u32>);
        match (field(7), field(13)) {
            (Some(order @ 1..=2), Some(2)) => Ok(Some(Self { is_big_endian: order == 2 })),
            (Some(1..=2), Some(format)) => Err(id.fault(format!(
                "floating point format {format}{} of a dataset 58b cannot be read, only 2 (IEEE 754): \
                 export the dataset as IEEE 754, or as text",
                match format {
                    1 => " (DEC VMS)",
                    3 => " (IBM 5/370)",
                    _ => "",
                }
            ))),
            _ => Err(id.fault("the byte order of a dataset 58b is neither 1 nor 2")),
        }
    }

    /// Reads the numbers; the end of the dataset must follow.
    pub fn read(self, header: &Header, lines: &mut Lines<'_>) -> Result<Vec<f64>, Fault> {
        let width = if header.is_double { 8 } else { 4 };
        let expected = header.numbers();
        let plain = expected.saturating_mul(width);
        // The standard requires single-precision instants; some programs write double.
        let narrow = plain.saturating_sub(4 * header.count);
        let is_mixed = header.is_double
            && !header.is_even
            && !ends_after(lines.rest(), plain)
            && ends_after(lines.rest(), narrow);
        let len = if is_mixed { narrow } else { plain };
        if !ends_after(lines.rest(), len) {
            let what = format!(
                "the dataset should end after {len} bytes of binary values, but it does not"
            );
            return Err(Fault::new(lines.at(), what));
        }
        let mut bytes = lines.take(len);
        let numbers_per_value = 2 + usize::from(header.is_complex);
        let values = (0..expected).map(|k| {
            let narrow = width == 4 || (is_mixed && k % numbers_per_value == 0);
            self.number(&mut bytes, narrow).unwrap_or(f64::NAN)
        });
        let values = values.collect();
        if lines.rest().first().is_some_and(|b| matches!(b, b'\n' | b'\r')) {
            lines.next();
        }
        Ok(values)
    }

    /// Returns the next number, of 4 or 8 bytes.
    fn number(self, bytes: &mut &[u8], narrow: bool) -> Option<f64> {
        if narrow {
            let (number, rest) = bytes.split_first_chunk::<4>()?;
            *bytes = rest;
            let big = f32::from_be_bytes(*number);
            return Some(f64::from(if self.is_big_endian {
                big
            } else {
                f32::from_le_bytes(*number)
            }));
        }
        let (number, rest) = bytes.split_first_chunk::<8>()?;
        *bytes = rest;
        let big = f64::from_be_bytes(*number);
        Some(if self.is_big_endian { big } else { f64::from_le_bytes(*number) })
    }
}

/// Returns whether the mark at the end of a dataset follows after `len` bytes, directly or on the
/// next line.
fn ends_after(bytes: &[u8], len: usize) -> bool {
    let Some(rest) = bytes.get(len..) else { return false };
    let line_end = rest.iter().take_while(|b| matches!(b, b'\n' | b'\r')).count();
    let after_line_end = &rest[line_end.min(2)..];
    after_line_end.starts_with(b"    -1")
        && after_line_end.get(6).is_none_or(u8::is_ascii_whitespace)
}
