//! The eleven lines that describe a function.

use super::lines::{Line, Lines, number};
use crate::contents::Fault;
use crate::responses::AveragedSegments;
use crate::units::names_quantity;
use crate::{Quantity, StatedUnit, stated_unit};

/// Prefix of the second line of the description if this line states the decay, in 1/s, that a
/// window adds.
pub(super) const ADDED_DECAY: &str = "ADDED DECAY 1/S ";

/// Prefix of the third line of the description if this line states the segments over which the
/// responses are averaged. The numbers after the prefix are in the order of
/// [`AveragedSegments::numbers`].
pub(super) const SEGMENTS: &str = "SEGMENTS ";

/// Description of the function in a dataset 58.
#[derive(Debug)]
pub(crate) struct Header {
    /// Title: the first line of the description; empty if the line is NONE.
    pub title: String,
    /// Decay, in 1/s, that an exponential window adds to every mode, as the second line of the
    /// dataset states it.
    pub added_decay: Option<f64>,
    /// Segments over which the function was averaged, as the third line of the dataset states them.
    pub segments: Option<AveragedSegments>,
    /// Type of the function: 1 is a response in time, 4 a frequency response function.
    pub function: u32,
    /// Node and direction of the measurement.
    pub response: String,
    /// Node and direction of the reference, if any.
    pub reference: Option<String>,
    pub is_complex: bool,
    pub is_double: bool,
    /// Number of values, or of pairs of instant and value.
    pub count: usize,
    pub is_even: bool,
    /// First abscissa, for even spacing; `step` is the increment.
    pub start: f64,
    pub step: f64,
    /// Type of the abscissa: 17 is time, 18 frequency.
    pub abscissa: u32,
    /// Labels of the abscissa and of its unit; empty without one.
    pub abscissa_labels: [String; 2],
    /// Quantity, for messages; empty if the file does not state it.
    pub quantity: String,
    /// Labels of the units of the ordinate and of its denominator; empty without one.
    pub units: [String; 2],
    /// Data types of the ordinate and of its denominator: 8, 11 and 12 are a response, 9 and
    /// 13 a force.
    pub ordinate: [u32; 2],
    /// Offset of the line that states the form and the number of the values, for messages.
    pub form_at: usize,
}

impl Header {
    pub fn read(lines: &mut Lines<'_>) -> Result<Self, Fault> {
        let mut next =
            || lines.required("a dataset 58 ends within its eleven lines of description");
        let title = label(next()?.text);
        let added_decay = next()?.text.strip_prefix(ADDED_DECAY.as_bytes()).and_then(number);
        let segments = next()?.text.strip_prefix(SEGMENTS.as_bytes()).and_then(segments_of);
        for _ in 4..=5 {
            next()?;
        }
        let (what, form, abscissa, ordinate) = (next()?, next()?, next()?, next()?);
        let denominator = next()?;
        next()?;
        let point = |from: usize| -> Result<(i64, i64), Fault> {
            Ok((whole(&what, from, 10)?, whole(&what, from + 10, 4)?))
        };
        let (response, reference) = (point(41)?, point(66)?);
        let ordinate_type: u32 = whole(&form, 0, 10)?;
        let spacing: u32 = whole(&form, 20, 10)?;
        if !matches!(ordinate_type, 2 | 4 | 5 | 6) || spacing > 1 {
            return Err(form.fault(format!(
                "an ordinate of data type {ordinate_type} with spacing {spacing} cannot be read: the \
                 possible types are 2, 4, 5 and 6, with spacing 0 or 1"
            )));
        }
        let is_even = spacing == 1;
        Ok(Self {
            title,
            added_decay,
            segments,
            function: whole(&what, 0, 5)?,
            response: degree_of_freedom(response, &what)?,
            reference: (reference.0 != 0)
                .then(|| degree_of_freedom(reference, &what))
                .transpose()?,
            is_complex: ordinate_type > 4,
            is_double: matches!(ordinate_type, 4 | 6),
            count: whole(&form, 10, 10)?,
            is_even,
            start: if is_even { real(&form, 30)? } else { 0.0 },
            step: if is_even { real(&form, 43)? } else { 0.0 },
            abscissa: whole(&abscissa, 0, 10)?,
            abscissa_labels: [26, 47].map(|from| label(field(&abscissa, from, 20))),
            quantity: quantity(&ordinate)?,
            units: [&ordinate, &denominator].map(|line| label(field(line, 47, 20))),
            ordinate: [whole(&ordinate, 0, 10)?, whole(&denominator, 0, 10)?],
            form_at: form.at,
        })
    }

    /// Returns the number of numbers in the file: the values and, for uneven spacing, their
    /// instants.
    pub fn numbers(&self) -> usize {
        let numbers_per_value = 1 + usize::from(self.is_complex) + usize::from(!self.is_even);
        self.count.saturating_mul(numbers_per_value)
    }

    /// Returns what the labels of the abscissa state about the unit of the quantity `wanted`;
    /// `None` if the labels only name the quantity.
    pub fn abscissa_unit(&self, wanted: Quantity) -> Option<StatedUnit> {
        let [name, unit] = &self.abscissa_labels;
        let named = |text: &str| {
            let words = text.split(|c: char| !c.is_alphabetic()).filter(|word| !word.is_empty());
            words.clone().count() > 0 && words.into_iter().all(|word| names_quantity(word, wanted))
        };
        let unit = if named(unit) { "" } else { unit };
        stated_unit(name, unit, Some(wanted)).filter(|stated| !named(&stated.text))
    }

    /// Returns the kind of the function, for messages.
    pub fn kind(&self) -> String {
        match self.function {
            0 => "a function of unknown kind".into(),
            1 => "a response in time".into(),
            2 => "an auto spectrum".into(),
            3 => "a cross spectrum".into(),
            4 => "a frequency response function".into(),
            5 => "a transmissibility".into(),
            6 => "a coherence".into(),
            7 => "an auto correlation".into(),
            8 => "a cross correlation".into(),
            9 => "a power spectral density".into(),
            12 => "a spectrum".into(),
            other => format!("a function of type {other}"),
        }
    }
}

/// Reads the segments from numbers separated by spaces.
fn segments_of(text: &[u8]) -> Option<AveragedSegments> {
    let fields = text.split(u8::is_ascii_whitespace).filter(|field| !field.is_empty());
    let numbers: Option<Vec<f64>> = fields.map(number).collect();
    AveragedSegments::from_numbers(numbers?.try_into().ok()?)
}

/// Returns a field of a line; blank after the end of the line.
fn field<'a>(line: &Line<'a>, from: usize, width: usize) -> &'a [u8] {
    let tail = line.text.get(from..).unwrap_or_default();
    tail.get(..width).unwrap_or(tail).trim_ascii()
}

/// Returns a whole number in a field, 0 if it is blank.
fn whole<T: std::str::FromStr + Default>(
    line: &Line<'_>,
    from: usize,
    width: usize,
) -> Result<T, Fault> {
    let text = field(line, from, width);
    if text.is_empty() {
        return Ok(T::default());
    }
    number(text).ok_or_else(|| wrong(line, from, width, "whole number"))
}

/// Returns a real number in a field of 13 columns, 0 if it is blank.
fn real(line: &Line<'_>, from: usize) -> Result<f64, Fault> {
    let text = field(line, from, 13);
    if text.is_empty() {
        return Ok(0.0);
    }
    number(text).filter(|v: &f64| v.is_finite()).ok_or_else(|| wrong(line, from, 13, "number"))
}

fn wrong(line: &Line<'_>, from: usize, width: usize, kind: &str) -> Fault {
    let text = String::from_utf8_lossy(field(line, from, width)).into_owned();
    line.fault(format!("\"{text}\" in columns {} to {} is not a {kind}", from + 1, from + width))
}

/// Returns a label, empty if it is NONE.
fn label(text: &[u8]) -> String {
    match String::from_utf8_lossy(text.trim_ascii()) {
        none if none.eq_ignore_ascii_case("none") => String::new(),
        some => some.into_owned(),
    }
}

/// Returns node and direction in the usual form: `12+Z`, `3-RX`; only the node for a scalar.
fn degree_of_freedom((node, direction): (i64, i64), line: &Line<'_>) -> Result<String, Fault> {
    let sign = if direction < 0 { '-' } else { '+' };
    let axis = match direction.unsigned_abs() {
        0 => return Ok(node.to_string()),
        1 => "X",
        2 => "Y",
        3 => "Z",
        4 => "RX",
        5 => "RY",
        6 => "RZ",
        _ => return Err(line.fault(format!("direction {direction} is not between -6 and 6"))),
    };
    Ok(format!("{node}{sign}{axis}"))
}

/// Returns the quantity of the ordinate with its unit, such as `velocity in mm/s`. The quantity is
/// the label of the ordinate or, without a label, the name of its data type.
fn quantity(line: &Line<'_>) -> Result<String, Fault> {
    let kind: u32 = whole(line, 0, 10)?;
    let (name, unit) = (label(field(line, 26, 20)), label(field(line, 47, 20)));
    let name = match kind {
        _ if !name.is_empty() => name,
        8 => "displacement".into(),
        9 => "reaction force".into(),
        11 => "velocity".into(),
        12 => "acceleration".into(),
        13 => "excitation force".into(),
        15 => "pressure".into(),
        _ => String::new(),
    };
    Ok(if unit.is_empty() { name } else { format!("{name} in {unit}").trim_start().into() })
}
