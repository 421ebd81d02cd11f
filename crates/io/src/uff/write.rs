//! Writer of frequency responses as datasets 151, 164 and 58.

use std::fmt::Write as _;

use mechid_model::ResponseQuantity;

use super::header::{ADDED_DECAY, SEGMENTS};
use crate::geometry::Direction;
use crate::responses::{FrequencyResponses, ResponseFunction};

/// Maximum relative deviation of evenly spaced frequencies from a constant step.
const EVEN: f64 = 1e-9;

/// Returns a universal file: a header (151), SI units (164), and a dataset 58 for each frequency
/// response and coherence, in double precision. The error is the name of a point that does not
/// consist of a node and a direction.
pub(crate) fn write_responses(responses: &FrequencyResponses) -> Result<String, String> {
    let mut text = String::new();
    let title = printable(&responses.file);
    // The header has the name of the file, a description, programs and dates. The dates are always
    // the same, so that two runs write the same file.
    for line in ["    -1", "   151", &title, "NONE", "mechid"] {
        let _ = writeln!(text, "{line}");
    }
    let _ = writeln!(text, "{:10}{:10}{:10}{:10}{:10}", "01-JAN-00", "00:00:00", 0, 0, 0);
    let _ = writeln!(text, "{:10}{:10}", "01-JAN-00", "00:00:00");
    let _ = writeln!(text, "mechid\n{:10}{:10}\n    -1", "01-JAN-00", "00:00:00");
    let _ = writeln!(text, "    -1\n   164\n{:10}{:20}{:10}", 1, "SI: Meter (newton)", 2);
    let one = "  1.00000000000000000D+00";
    let _ = writeln!(text, "{one}{one}{one}\n  2.73150000000000000D+02\n    -1");
    let about = match responses.added_decay {
        Some(rate) => format!("{ADDED_DECAY}{rate:e}"),
        None => "NONE".into(),
    };
    let averaged = match responses.segments {
        Some(segments) => {
            let numbers = segments.numbers().map(|number| format!("{number:?}"));
            format!("{SEGMENTS}{}", numbers.join(" "))
        }
        None => "NONE".into(),
    };
    for function in &responses.functions {
        let numbers = function.values.iter().flat_map(|z| [z.re, z.im]).collect();
        let of = Dataset {
            title: &title,
            about: [&about, &averaged],
            function: 4,
            response: point(&function.response)?,
            reference: point(&function.reference)?,
            ordinate: ordinate(function),
            is_complex: true,
            frequency_hz: &responses.frequency_hz,
            numbers,
        };
        of.write(&mut text);
    }
    for coherence in &responses.coherence {
        let of = Dataset {
            title: &title,
            about: [&about, &averaged],
            function: 6,
            response: point(&coherence.response)?,
            reference: match &coherence.reference {
                Some(reference) => point(reference)?,
                None => (0, 0),
            },
            ordinate: [(0, "NONE", "NONE"), (0, "NONE", "NONE")],
            is_complex: false,
            frequency_hz: &responses.frequency_hz,
            numbers: coherence.values.clone(),
        };
        of.write(&mut text);
    }
    Ok(text)
}

/// Data type, name and unit.
type Ordinate = (u32, &'static str, &'static str);

/// Returns the ordinates of response and force of a frequency response.
fn ordinate(function: &ResponseFunction) -> [Ordinate; 2] {
    let response = match function.quantity {
        Some(ResponseQuantity::Displacement) => (8, "Displacement", "m"),
        Some(ResponseQuantity::Velocity) => (11, "Velocity", "m/s"),
        Some(ResponseQuantity::Acceleration) => (12, "Acceleration", "m/s^2"),
        None => (0, "NONE", "NONE"),
    };
    [response, (13, "Excitation Force", "N")]
}

struct Dataset<'a> {
    title: &'a str,
    /// Second and third line of the description.
    about: [&'a str; 2],
    /// Type of the function: 4 is a frequency response function, 6 a coherence.
    function: u32,
    /// Node and direction.
    response: (u32, i32),
    reference: (u32, i32),
    ordinate: [Ordinate; 2],
    is_complex: bool,
    frequency_hz: &'a [f64],
    /// Values; a complex value is two numbers.
    numbers: Vec<f64>,
}

impl Dataset<'_> {
    fn write(&self, text: &mut String) {
        let _ = writeln!(text, "    -1\n    58");
        let [about, averaged] = self.about;
        for line in [self.title, about, averaged, "NONE", "NONE"] {
            let _ = writeln!(text, "{line}");
        }
        let ((node, direction), (from, along)) = (self.response, self.reference);
        let _ = write!(text, "{:5}{:10}{:5}{:10}", self.function, 0, 0, 0);
        let _ =
            writeln!(text, " {:10}{node:10}{direction:4} {:10}{from:10}{along:4}", "NONE", "NONE");
        let hz = self.frequency_hz;
        let (start, step) = (hz[0], if hz.len() > 1 { hz[1] - hz[0] } else { 0.0 });
        let expected =
            |k: usize| start + k as f64 * (hz[hz.len() - 1] - start) / (hz.len() - 1).max(1) as f64;
        let is_even = hz.iter().enumerate().all(|(k, f)| (f - expected(k)).abs() <= EVEN * f.abs());
        let kind = if self.is_complex { 6 } else { 4 };
        let _ = write!(text, "{kind:10}{:10}{:10}", hz.len(), u32::from(is_even));
        let [start, step] = if is_even { [start, step] } else { [0.0; 2] };
        let _ = writeln!(text, "{}{}{}", narrow(start), narrow(step), narrow(0.0));
        axis(text, (18, "Frequency", "Hz"));
        self.ordinate.into_iter().for_each(|ordinate| axis(text, ordinate));
        axis(text, (0, "NONE", "NONE"));
        let numbers_per_value = if self.is_complex { 2 } else { 1 };
        // For evenly spaced frequencies, a line has four numbers, as the standard requires. For
        // unevenly spaced frequencies, it has one complex or two real values, each after its
        // frequency.
        let values = match (is_even, self.is_complex) {
            (true, true) => 2,
            (true, false) => 4,
            (false, true) => 1,
            (false, false) => 2,
        };
        for (line, numbers) in self.numbers.chunks(values * numbers_per_value).enumerate() {
            for (at, value) in numbers.chunks(numbers_per_value).enumerate() {
                if !is_even {
                    text.push_str(&narrow(hz[line * values + at]));
                }
                for number in value {
                    let _ = write!(text, "{number:20.12e}");
                }
            }
            text.push('\n');
        }
        text.push_str("    -1\n");
    }
}

/// Appends an axis: data type, exponents of its unit, name and unit.
fn axis(text: &mut String, (kind, name, unit): Ordinate) {
    let _ = writeln!(text, "{kind:10}{:5}{:5}{:5} {name:20} {unit:20}", 0, 0, 0);
}

/// Returns a number in a field of 13 columns, with as many digits as fit.
fn narrow(number: f64) -> String {
    let mut digits = 8;
    loop {
        let text = format!("{number:.digits$e}");
        if text.len() <= 12 || digits == 0 {
            return format!("{text:>13}");
        }
        digits -= 1;
    }
}

/// Returns node and direction of a point such as `12+Z`; the direction is 0, as for a scalar, if
/// there is only a node.
fn point(label: &str) -> Result<(u32, i32), String> {
    node_and_direction(label).ok_or_else(|| label.to_owned())
}

fn node_and_direction(label: &str) -> Option<(u32, i32)> {
    if let Ok(node) = label.parse() {
        return Some((node, 0));
    }
    let direction = Direction::parse(label)?;
    let sign = if direction.is_negative { -1 } else { 1 };
    Some((direction.node()?, sign * (direction.axis as i32 + 1)))
}

/// Returns a line of at most 80 printable characters.
fn printable(text: &str) -> String {
    let printable: String =
        text.chars().map(|c| if c.is_ascii_graphic() || c == ' ' { c } else { '?' }).collect();
    // A title that looks like the end of a dataset would end the dataset, so the title gets a
    // prefix.
    format!("FRF of {}", printable.get(..printable.len().min(72)).unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_and_numbers_keep_to_their_columns() {
        assert_eq!(point("12+Z"), Ok((12, 3)));
        assert_eq!(point("3-RX"), Ok((3, -4)));
        assert_eq!(point("3-rx"), Ok((3, -4)));
        assert_eq!(point("7"), Ok((7, 0)));
        assert!(["x", "1+Q", "+X", "1-"].iter().all(|label| point(label).is_err()));
        for number in [0.0, 1.0, -0.390625, 78.125, 0.596_046_447_753_906_2, -1.0e-300, 1.5e300] {
            let text = narrow(number);
            assert_eq!(text.len(), 13, "{text}");
            let back: f64 = text.trim().parse().unwrap();
            assert!((back - number).abs() <= 1e-5 * number.abs(), "{text}");
        }
        assert_eq!(narrow(78.125), " 7.81250000e1");
    }
}
