//! Columns of a table of frequency responses, identified by their names and units.

use mechid_model::ResponseQuantity;
use nalgebra::Complex;

use crate::escape::escaped;
use crate::responses::{FrequencyResponses, ResponseFunction};
use crate::units::{ResponseUnit, label_notes, name_without_brackets, number_and_rest};
use crate::{Evidence, IoError, Quantity, StatedUnit, Table};

/// Names, in lower case, of a column of frequencies; those before [`IN_RADIANS`] are in Hz unless a
/// unit states otherwise.
const FREQUENCY: [&str; 10] =
    ["frequency_hz", "frequency", "freq", "f", "frequenz", "hz", "khz", "rpm", "omega", "w"];

/// Names of a column of angular frequencies, in rad/s.
const IN_RADIANS: [&str; 4] = ["omega", "w", "ω", "radians"];

/// Names of a column of multiples of the speed of rotation.
const ORDERS: [&str; 2] = ["order", "orders"];

/// Name of the point in a table with a single response.
const ALONE: &str = "1";

/// Maximum absolute phase, in rad, of a column without a unit that is read as radians; larger
/// phases are degrees.
const MAX_RADIANS: f64 = 6.5;

/// Part of a frequency response: what the numbers of a column are.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Part {
    Real,
    Imaginary,
    Magnitude,
    /// Magnitude, in dB.
    Level,
    /// Phase, with the size of its unit in radians if it is stated.
    Phase(Option<f64>),
    StandardError,
}

/// Information about a frequency response in the header of a column.
#[derive(Debug, Clone, PartialEq)]
struct Heading {
    column: usize,
    part: Part,
    /// Points of response and force.
    points: [String; 2],
    quantity: Option<ResponseQuantity>,
    /// `true` for a force per response: the inverse of a receptance, mobility or accelerance.
    is_inverse: bool,
    /// Factor from the unit of the column to SI units.
    in_si: f64,
    /// Text that may be a unit but is not understood.
    doubt: Option<StatedUnit>,
}

impl Heading {
    fn new(table: &Table, column: usize) -> Option<Self> {
        let name = table.names()[column].trim();
        let lower = name_without_brackets(name).to_lowercase();
        let mut heading = Self {
            column,
            part: Part::Real,
            points: [ALONE, ALONE].map(String::from),
            quantity: None,
            is_inverse: false,
            in_si: 1.0,
            doubt: None,
        };
        let (mut part, mut points) = (None, Vec::new());
        for word in lower.split(['_', ' ', '.', ':', ',']).filter(|word| !word.is_empty()) {
            match word {
                "real" | "re" => part = Some(Part::Real),
                "imaginary" | "imag" | "im" => part = Some(Part::Imaginary),
                "magnitude" | "mag" | "amplitude" | "ampl" | "abs" | "modulus" => {
                    part = Some(part.unwrap_or(Part::Magnitude));
                }
                "db" => part = Some(Part::Level),
                "phase" | "angle" | "arg" => part = Some(Part::Phase(None)),
                "deg" | "degrees" | "degree" | "rad" | "radians"
                    if matches!(part, Some(Part::Phase(_))) =>
                {
                    part = Some(Part::Phase(angle(word)));
                }
                "error" => part = Some(Part::StandardError),
                "standard" | "std" | "h" | "frf" | "part" | "of" | "tf" => {}
                "receptance" | "compliance" => {
                    heading.quantity = Some(ResponseQuantity::Displacement)
                }
                "mobility" => heading.quantity = Some(ResponseQuantity::Velocity),
                "accelerance" | "inertance" => {
                    heading.quantity = Some(ResponseQuantity::Acceleration)
                }
                "apparent" | "mass" => heading.inverse(ResponseQuantity::Acceleration),
                "impedance" => heading.inverse(ResponseQuantity::Velocity),
                "stiffness" => heading.inverse(ResponseQuantity::Displacement),
                "mechanical" | "dynamic" => {}
                other => points.push(original(name, other)),
            }
        }
        heading.part = part?;
        heading.points = points_of(points)?;
        heading.take_notes(table, column, name);
        Some(heading)
    }

    fn inverse(&mut self, quantity: ResponseQuantity) {
        (self.quantity, self.is_inverse) = (Some(quantity), true);
    }

    /// Reads the texts in brackets and in the line of units.
    fn take_notes(&mut self, table: &Table, column: usize, name: &str) {
        let notes = label_notes(name);
        let row = label_notes(&format!("[{}]", table.unit_text(column)));
        for note in notes.into_iter().chain(row).filter(|note| !note.is_empty()) {
            let lower = note.to_lowercase();
            let is_level = lower.split([' ', ':', '(']).next() == Some("db");
            if let (Part::Phase(_), Some(unit)) = (self.part, angle(&lower)) {
                self.part = Part::Phase(Some(unit));
            } else if is_level && matches!(self.part, Part::Magnitude | Part::Level) {
                self.part = Part::Level;
                let reference = lower.find("re").map_or("", |at| note[at + 2..].trim());
                self.take_unit(number_and_rest(reference).unwrap_or((1.0, reference)));
            } else if !self.take_unit((1.0, &note)) && !matches!(self.part, Part::Phase(_)) {
                let evidence = Evidence::Unused;
                self.doubt.get_or_insert(StatedUnit { text: note, unit: None, evidence });
            }
        }
    }

    fn take_unit(&mut self, (number, text): (f64, &str)) -> bool {
        let Some(unit) = ResponseUnit::parse(text) else { return text.is_empty() };
        self.quantity = Some(unit.quantity);
        self.is_inverse = unit.is_inverse;
        self.in_si = number * unit.in_si;
        true
    }
}

/// Returns the size of a unit of angle, in rad.
fn angle(text: &str) -> Option<f64> {
    match text.trim() {
        "rad" | "radian" | "radians" => Some(1.0),
        "deg" | "degree" | "degrees" | "°" | "grad" => Some(1_f64.to_radians()),
        _ => None,
    }
}

/// Returns a word of a name in its original case.
fn original(name: &str, lower: &str) -> String {
    let at = name.to_lowercase().find(lower);
    at.and_then(|at| name.get(at..at + lower.len())).unwrap_or(lower).to_owned()
}

/// Returns the points of response and force in a name, such as `h_2_1`, `H21` or `frf_12+Z_1+Z`;
/// `None` if it has none.
pub(crate) fn points_of(mut words: Vec<String>) -> Option<[String; 2]> {
    if let [word] = &words[..] {
        let digits: Vec<char> = word.trim_start_matches(['h', 'H']).chars().collect();
        if let [a, b] = digits[..]
            && a.is_ascii_digit()
            && b.is_ascii_digit()
        {
            words = vec![a.into(), b.into()];
        }
    }
    if words.len() > 2 {
        words.remove(0);
    }
    let mut words = words.into_iter();
    let mut next = || words.next().unwrap_or_else(|| ALONE.into());
    let points = [next(), next()];
    words.next().is_none().then_some(points)
}

/// Returns the column of frequencies, by its name or its field in a struct.
fn frequency_column(table: &Table) -> Option<usize> {
    let names = || FREQUENCY.iter().chain(&IN_RADIANS);
    let of_struct = |at: &usize| {
        let leaf = table.names()[*at].rsplit_once(['.', '/']).map(|(_, leaf)| leaf.to_lowercase());
        leaf.is_some_and(|leaf| names().any(|name| *name == leaf))
    };
    names().find_map(|name| table.find(name).ok()).or_else(|| (0..table.width()).find(of_struct))
}

/// Returns the frequencies of a table, in Hz; a text that may be their unit is added to `doubts`.
pub(crate) fn frequencies(
    table: &Table,
    doubts: &mut Vec<(String, StatedUnit, Quantity)>,
) -> Result<Vec<f64>, IoError> {
    let named = frequency_column(table);
    let column = match named {
        Some(column) => column,
        None if !table.complex().is_empty() => {
            return Err(IoError::Description {
                file: table.file().into(),
                what: format!(
                    "it has responses, and no vector of their frequencies: save it as {}",
                    FREQUENCY[..4].join(" or ")
                ),
            });
        }
        None if ORDERS.iter().any(|name| table.find(name).is_ok()) => {
            return Err(IoError::Description {
                file: table.file().into(),
                what: "the frequencies are orders, multiples of a speed of rotation that it does not state: \
                       multiply them by it"
                    .into(),
            });
        }
        None => 0,
    };
    let values = table.values(column)?;
    let mut stated = table.stated_unit(column, Some(Quantity::Frequency));
    let name = table.short_name(column).to_lowercase();
    if stated.is_none() && IN_RADIANS.contains(&name.as_str()) {
        let unit = crate::Unit::parse("rad/s");
        stated = Some(StatedUnit { text: name, unit, evidence: Evidence::Likely });
    } else if stated.is_none() && named.is_none() && !table.names()[column].is_empty() {
        let text = table.names()[column].clone();
        stated = Some(StatedUnit { text, unit: None, evidence: Evidence::Unused });
    }
    let Some(stated) = stated else { return Ok(values.to_vec()) };
    let factor = match stated.used() {
        Some(unit) if unit.quantity == Quantity::Frequency => unit.in_si,
        Some(unit) => {
            return Err(IoError::OtherQuantity {
                file: table.file().into(),
                column: table.label(column),
                unit: unit.name.clone(),
                quantity: unit.quantity,
                wanted: Quantity::Frequency,
            });
        }
        None => 1.0,
    };
    if stated.evidence != Evidence::Stated {
        doubts.push((table.label(column), stated, Quantity::Frequency));
    }
    Ok(values.iter().map(|value| value * factor).collect())
}

/// Adds the responses in the columns of a table.
pub(crate) fn add_functions(
    table: &Table,
    responses: &mut FrequencyResponses,
) -> Result<(), IoError> {
    let headings: Vec<Heading> =
        (0..table.width()).filter_map(|column| Heading::new(table, column)).collect();
    for first in &headings {
        if !matches!(first.part, Part::Real | Part::Magnitude | Part::Level) {
            continue;
        }
        let same_response = |part: &dyn Fn(Part) -> bool| {
            headings.iter().find(|heading| heading.points == first.points && part(heading.part))
        };
        let function = function(table, first, &same_response)?;
        if responses.functions.iter().any(|known| {
            (&known.response, &known.reference) == (&function.response, &function.reference)
        }) {
            let what = format!(
                "several columns hold the response at {} to a force at {}: leave out all but one",
                function.response, function.reference
            );
            return Err(IoError::Description { file: table.file().into(), what });
        }
        responses.functions.push(function);
        let doubts = [Some(first), same_response(&|part| part == Part::Imaginary)];
        for heading in doubts.into_iter().flatten() {
            if let Some(doubt) = &heading.doubt {
                let quantity = heading.quantity.unwrap_or(ResponseQuantity::Displacement);
                let label = table.label(heading.column);
                responses.doubts.push((label, doubt.clone(), quantity.into()));
            }
        }
    }
    Ok(())
}

/// Function that returns the column of the same response whose part passes a test.
type OtherPart<'a> = dyn Fn(&dyn Fn(Part) -> bool) -> Option<&'a Heading> + 'a;

/// Reads one response.
fn function<'a>(
    table: &Table,
    first: &Heading,
    other: &OtherPart<'a>,
) -> Result<ResponseFunction, IoError> {
    let missing = |what: &str| IoError::Description {
        file: table.file().into(),
        what: format!(
            "column {} has no {what} beside it: a frequency response has a real and an imaginary part, or a \
             magnitude and a phase",
            table.label(first.column)
        ),
    };
    let values = table.values(first.column)?;
    let mut values = match first.part {
        Part::Real => {
            let second =
                other(&|part| part == Part::Imaginary).ok_or_else(|| missing("imaginary part"))?;
            let imaginary = table.values(second.column)?;
            let in_si = if second.in_si == 1.0 { first.in_si } else { second.in_si };
            let pairs = values.iter().zip(imaginary);
            pairs.map(|(re, im)| Complex::new(re * first.in_si, im * in_si)).collect::<Vec<_>>()
        }
        _ => {
            let second =
                other(&|part| matches!(part, Part::Phase(_))).ok_or_else(|| missing("phase"))?;
            let phase = table.values(second.column)?;
            let largest = phase.iter().fold(0.0_f64, |largest, phase| largest.max(phase.abs()));
            let unit = match second.part {
                Part::Phase(Some(unit)) => unit,
                _ if largest > MAX_RADIANS => 1_f64.to_radians(),
                _ => 1.0,
            };
            let size = |value: f64| match first.part {
                Part::Level => first.in_si * 10_f64.powf(value / 20.0),
                _ => first.in_si * value,
            };
            let pairs = values.iter().zip(phase);
            pairs.map(|(value, phase)| Complex::from_polar(size(*value), phase * unit)).collect()
        }
    };
    let mut standard_error = match other(&|part| part == Part::StandardError) {
        Some(error) => {
            let values = table.values(error.column)?;
            Some(values.iter().map(|value| value * first.in_si).collect::<Vec<f64>>())
        }
        None => None,
    };
    if first.is_inverse {
        invert(&mut values, standard_error.as_deref_mut()).map_err(|row| IoError::Description {
            file: table.file().into(),
            what: format!(
                "value {row} of column {} is 0, and has no inverse",
                table.label(first.column)
            ),
        })?;
    }
    let [response, reference] = first.points.clone();
    Ok(ResponseFunction { response, reference, quantity: first.quantity, values, standard_error })
}

/// Replaces values by their inverses and carries their standard errors over; fails with the number
/// of the first value that has no inverse, counted from 1.
fn invert(values: &mut [Complex<f64>], mut errors: Option<&mut [f64]>) -> Result<(), usize> {
    for (at, value) in values.iter_mut().enumerate() {
        if let Some(errors) = &mut errors {
            errors[at] /= value.norm_sqr();
        }
        *value = value.inv();
    }
    values.iter().position(|value| !value.is_finite()).map_or(Ok(()), |at| Err(at + 1))
}

/// Sorts the frequencies in rising order and removes the mirrored half of a two-sided spectrum,
/// with a remark.
pub(crate) fn sort(responses: &mut FrequencyResponses) -> Result<(), IoError> {
    let hz = &responses.frequency_hz;
    if let Some(short) = responses.functions.iter().find(|one| one.values.len() != hz.len()) {
        let (count, points) = (short.values.len(), [&short.response, &short.reference]);
        let what = format!(
            "the response at {} to {} has {count} values for {} frequencies",
            escaped(points[0]),
            escaped(points[1]),
            hz.len()
        );
        return Err(IoError::Description { file: responses.file.clone(), what });
    }
    let mut order: Vec<usize> = (0..hz.len()).collect();
    order.sort_by(|a, b| hz[*a].total_cmp(&hz[*b]));
    let negative = hz.iter().filter(|hz| **hz < 0.0).count();
    order.retain(|at| hz[*at] >= 0.0);
    if let Some(pair) = order.windows(2).find(|pair| hz[pair[0]] == hz[pair[1]]) {
        let what = format!("the frequency {} Hz stands there twice", hz[pair[0]]);
        return Err(IoError::Description { file: responses.file.clone(), what });
    }
    let mirrored = mirrored(responses, &order);
    order.truncate(order.len() - mirrored);
    if order.iter().copied().eq(0..hz.len()) {
        return Ok(());
    }
    if negative + mirrored > 0 {
        let count = negative + mirrored;
        responses
            .remarks
            .push(format!("left out: {count} mirrored values, of negative frequencies"));
    }
    let pick = |values: &[f64]| order.iter().map(|at| values[*at]).collect::<Vec<f64>>();
    for function in &mut responses.functions {
        function.values = order.iter().map(|at| function.values[*at]).collect();
        function.standard_error = function.standard_error.as_deref().map(pick);
    }
    for coherence in &mut responses.coherence {
        coherence.values = pick(&coherence.values);
    }
    responses.frequency_hz = pick(&responses.frequency_hz);
    Ok(())
}

/// Returns how many of the last values, in rising order, mirror the first ones: the lines above
/// half the sampling rate.
fn mirrored(responses: &FrequencyResponses, order: &[usize]) -> usize {
    /// Maximum relative difference between a value and its mirror image, from the rounding of
    /// printed numbers.
    const SAME: f64 = 1e-6;
    let len = order.len();
    if len < 4 || responses.frequency_hz[order[0]] != 0.0 {
        return 0;
    }
    let is_mirrored = responses.functions.iter().all(|function| {
        let value = |at: usize| function.values[order[at]];
        let size = (1..len).map(|at| value(at).norm()).fold(0.0, f64::max);
        (1..len).all(|at| (value(len - at).conj() - value(at)).norm() <= SAME * size)
    });
    if is_mirrored { (len - 1) / 2 } else { 0 }
}
