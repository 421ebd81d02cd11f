//! Columns of a table of frequency responses, identified by their names and units.

use mechid_model::ResponseQuantity;
use nalgebra::Complex;

use crate::responses::{FrequencyResponses, ResponseFunction};
use crate::units::{ResponseUnit, label_notes, name_without_brackets, number_and_rest};
use crate::{Evidence, IoError, StatedUnit, Table, escaped};

/// Name of the point in a table with a single response.
const ALONE: &str = "1";

/// Maximum absolute phase, in rad, of a column without a unit that is read as radians; larger
/// phases are degrees.
const MAX_RADIANS: f64 = 6.5;

/// Part of a frequency response in a column.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Part {
    Real,
    Imaginary,
    Magnitude,
    /// Magnitude, in dB.
    Level,
    /// Phase, with the size of its unit in rad if the unit is stated.
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
    /// Unit of the column and the text that states it, if any.
    unit: Option<(ResponseUnit, String)>,
    /// Text of a unit that contradicts the name of the column or another unit, and the text that it
    /// contradicts.
    contradiction: Option<[String; 2]>,
    /// Factor from the unit of the column to SI units.
    in_si: f64,
    /// Text that may be a unit but is not understood.
    doubt: Option<StatedUnit>,
}

impl Heading {
    fn new(table: &Table, column: usize) -> Option<Self> {
        let name = table.names()[column].trim();
        let bare = name_without_brackets(name);
        let (bare, reference) = without_level(&bare);
        let lower = bare.to_lowercase();
        let mut heading = Self {
            column,
            part: Part::Real,
            points: [ALONE, ALONE].map(String::from),
            quantity: None,
            is_inverse: false,
            unit: None,
            contradiction: None,
            in_si: 1.0,
            doubt: None,
        };
        let (mut part, mut points) = (None, Vec::new());
        for word in lower.split(['_', ' ', '.', ':', ',']).filter(|word| !word.is_empty()) {
            if !heading.take_word(word, &mut part, lower == word) {
                points.push(original(name, word));
            }
        }
        let is_unit = |note: &String| !is_symbol(note);
        let notes = label_notes(name).into_iter().filter(is_unit);
        let notes: Vec<String> = reference.into_iter().chain(notes).collect();
        let is_level = notes.iter().any(|note| level(note).is_some());
        heading.part = part.or(is_level.then_some(Part::Level))?;
        heading.points = match points_in_notes(&label_notes(name)) {
            Some(points_in_notes) => points_in_notes,
            None => points_of(points)?,
        };
        heading.take_notes(table, column, notes);
        Some(heading)
    }

    /// Reads a word of the name, in lower case; `is_alone` is `true` if it is the whole name.
    /// Returns `false` for a word that is not known, such as a point.
    fn take_word(&mut self, word: &str, part: &mut Option<Part>, is_alone: bool) -> bool {
        match word {
            "real" | "re" => *part = Some(Part::Real),
            "imaginary" | "imag" | "im" => *part = Some(Part::Imaginary),
            "magnitude" | "mag" | "amplitude" | "ampl" | "abs" | "modulus" => {
                *part = Some(part.unwrap_or(Part::Magnitude));
            }
            "db" => *part = Some(Part::Level),
            _ if word.starts_with("20log") || word.starts_with("20*log") => {
                *part = Some(Part::Level);
            }
            "deg" | "degrees" | "°" | "rad" if is_alone => {
                *part = Some(Part::Phase(angle(word)));
            }
            "phase" | "angle" | "arg" => *part = Some(Part::Phase(None)),
            "deg" | "degrees" | "degree" | "rad" | "radians"
                if matches!(part, Some(Part::Phase(_))) =>
            {
                *part = Some(Part::Phase(angle(word)));
            }
            "error" => *part = Some(Part::StandardError),
            "standard" | "std" | "h" | "frf" | "part" | "of" | "tf" | "level" | "gain" => {}
            "receptance" | "compliance" => self.quantity = Some(ResponseQuantity::Displacement),
            "mobility" => self.quantity = Some(ResponseQuantity::Velocity),
            "accelerance" | "inertance" => self.quantity = Some(ResponseQuantity::Acceleration),
            "apparent" | "mass" => self.inverse(ResponseQuantity::Acceleration),
            "impedance" => self.inverse(ResponseQuantity::Velocity),
            "stiffness" => self.inverse(ResponseQuantity::Displacement),
            "mechanical" | "dynamic" => {}
            _ => return false,
        }
        true
    }

    fn inverse(&mut self, quantity: ResponseQuantity) {
        (self.quantity, self.is_inverse) = (Some(quantity), true);
    }

    /// Updates the part and the unit from the texts in brackets, `notes`, and from the line of
    /// units.
    fn take_notes(&mut self, table: &Table, column: usize, notes: Vec<String>) {
        let row = label_notes(&format!("[{}]", table.unit_text(column)));
        let is_phase = matches!(self.part, Part::Phase(_));
        let notes = notes.into_iter().filter(|note| points_in_note(note).is_none());
        let notes = notes.chain(row).filter(|note| !(is_phase && describes_phase(note)));
        for note in notes.filter(|note| !note.is_empty()) {
            let lower = note.to_lowercase();
            if let (Part::Phase(_), Some(unit)) = (self.part, angle(&lower)) {
                self.part = Part::Phase(Some(unit));
            } else if let (Part::Magnitude | Part::Level, Some(reference)) =
                (self.part, level(&note))
            {
                self.part = Part::Level;
                self.take_unit(number_and_rest(reference).unwrap_or((1.0, reference)));
            } else if !self.take_unit((1.0, &note)) {
                let evidence = Evidence::Unused;
                self.doubt.get_or_insert(StatedUnit { text: note, unit: None, evidence });
            }
        }
    }

    /// Returns a text of the column that may be a unit but is not understood, or a text which
    /// states that a level in dB has no reference. `None` if the column has neither.
    fn doubt(&self) -> Option<StatedUnit> {
        let has_reference = self.part != Part::Level || self.unit.is_some();
        let text = "dB without a reference".into();
        let assumed = StatedUnit { text, unit: None, evidence: Evidence::Unused };
        self.doubt.clone().or((!has_reference).then_some(assumed))
    }

    fn take_unit(&mut self, (number, text): (f64, &str)) -> bool {
        let Some(unit) = ResponseUnit::parse(text) else { return text.is_empty() };
        let of_name = self.quantity.map(|quantity| (quantity, self.is_inverse));
        let other = match &self.unit {
            Some((known, known_text)) => (*known != unit).then(|| known_text.clone()),
            None => of_name
                .filter(|(quantity, _)| *quantity != unit.quantity)
                .map(|(quantity, _)| format!("a {quantity} per force in the name")),
        };
        self.contradiction = self.contradiction.take().or(other.map(|other| [text.into(), other]));
        self.unit = Some((unit, text.into()));
        self.quantity = Some(unit.quantity);
        self.is_inverse = unit.is_inverse;
        self.in_si = number * unit.in_si;
        true
    }
}

/// Returns the reference of a level in dB, such as `dB re 1 m/s²/N` or `dB(g/N)`; the reference is
/// empty for `dB` alone. `None` if the text is not a level.
fn level(note: &str) -> Option<&str> {
    let after = note.get(..2).filter(|start| start.eq_ignore_ascii_case("db"))?;
    let after = &note[after.len()..];
    if after.starts_with(char::is_alphanumeric) {
        return None;
    }
    let after = after.trim_start_matches([' ', ':', ',']);
    let reference = ["re ", "ref ", "re. ", "ref. ", "re: ", "rel. "];
    let reference = reference.into_iter().find_map(|word| after.strip_prefix(word));
    let reference = reference.unwrap_or(after).trim();
    let inner = reference.strip_prefix('(').and_then(|rest| rest.strip_suffix(')'));
    Some(inner.unwrap_or(reference))
}

/// Splits off a level in dB with its reference from a name without brackets: `H11 dB re 1 g/N`
/// gives `H11` and `dB re 1 g/N`.
fn without_level(name: &str) -> (&str, Option<String>) {
    let lower = name.to_ascii_lowercase();
    let starts_word = |at: &usize| !name[..*at].ends_with(char::is_alphanumeric);
    let find = |text: &str| {
        let at = lower.find(text)?;
        let is_word = !lower[at + text.len()..].starts_with(char::is_alphabetic);
        is_word.then_some(at)
    };
    let words =
        ["re", "ref", "rel"].map(|word| ["db ", "db:", "db("].map(|db| format!("{db}{word}")));
    let start = words.as_flattened().iter().find_map(|text| find(text));
    match start.filter(starts_word) {
        Some(at) => (name[..at].trim_end_matches([' ', ',', '_', '-']), Some(name[at..].into())),
        None => (name, None),
    }
}

/// Returns whether a text in brackets is the symbol of a response or its argument, as in `Re(H)`
/// and `H(jω)`.
fn is_symbol(note: &str) -> bool {
    let lower = note.trim().to_lowercase();
    let is_response = lower
        .strip_prefix('h')
        .is_some_and(|rest| rest.is_empty() || rest.bytes().all(|b| b.is_ascii_digit()));
    is_response
        || ["frf", "tf", "jω", "iω", "jw", "iw", "ω", "omega", "f"].contains(&lower.as_str())
}

/// Returns whether a text in brackets describes a phase without its unit: `Phase (unwrapped)`.
fn describes_phase(note: &str) -> bool {
    ["unwrapped", "wrapped", "continuous", "-"].contains(&note.trim().to_lowercase().as_str())
}

/// Returns the size of a unit of angle, in rad.
fn angle(text: &str) -> Option<f64> {
    match text.trim() {
        "rad" | "radian" | "radians" => Some(1.0),
        "mrad" => Some(1e-3),
        "deg" | "degree" | "degrees" | "°" | "grad" => Some(1_f64.to_radians()),
        "gon" => Some(std::f64::consts::PI / 200.0),
        "rev" | "turn" | "turns" | "cycle" | "cycles" => Some(std::f64::consts::TAU),
        _ => None,
    }
}

/// Returns a word of a name in its original case.
fn original(name: &str, lower: &str) -> String {
    let at = name.to_lowercase().find(lower);
    at.and_then(|at| name.get(at..at + lower.len())).unwrap_or(lower).to_owned()
}

/// Returns the points of response and force in brackets, such as those of `H(2,1)`.
fn points_in_notes(notes: &[String]) -> Option<[String; 2]> {
    notes.iter().find_map(|note| points_in_note(note))
}

fn points_in_note(note: &str) -> Option<[String; 2]> {
    let (response, reference) = note.split_once([',', ';'])?;
    let points = [response, reference].map(|point| point.trim().to_owned());
    let is_number = |point: &String| !point.is_empty() && point.bytes().all(|b| b.is_ascii_digit());
    points.iter().all(is_number).then_some(points)
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

/// Adds the responses in the columns of a table.
pub(crate) fn add_functions(
    table: &Table,
    responses: &mut FrequencyResponses,
) -> Result<(), IoError> {
    let headings: Vec<Heading> =
        (0..table.width()).filter_map(|column| Heading::new(table, column)).collect();
    for first in &headings {
        if let Some([text, other]) = &first.contradiction {
            let column = table.label(first.column);
            let (text, other) = (escaped(text), escaped(other));
            return Err(IoError::Description {
                file: table.file().into(),
                what: format!("column {column} states {text} and {other}: state one unit"),
            });
        }
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
            if let Some(doubt) = heading.doubt() {
                let quantity = heading.quantity.unwrap_or(ResponseQuantity::Displacement);
                let label = table.label(heading.column);
                responses.doubts.push((label, doubt, quantity.into()));
            }
        }
    }
    Ok(())
}

/// Function that searches the columns of one response and returns the column whose part (real part,
/// phase, …) passes a test.
type OtherPart<'a> = dyn Fn(&dyn Fn(Part) -> bool) -> Option<&'a Heading> + 'a;

/// Reads one response.
fn function<'a>(
    table: &Table,
    first: &Heading,
    other: &OtherPart<'a>,
) -> Result<ResponseFunction, IoError> {
    let values = table.values(first.column)?;
    let mut values = match first.part {
        Part::Real => {
            let second = other(&|part| part == Part::Imaginary)
                .ok_or_else(|| missing(table, first, "imaginary part"))?;
            let imaginary = table.values(second.column)?;
            if let (Some((one, text)), Some((other, other_text))) = (&first.unit, &second.unit)
                && one != other
            {
                let [real, imaginary] = [first, second].map(|part| table.label(part.column));
                let (text, other_text) = (escaped(text), escaped(other_text));
                let what = format!(
                    "column {real} is in {text} and column {imaginary} in {other_text}: state one unit for both parts of a response"
                );
                return Err(IoError::Description { file: table.file().into(), what });
            }
            let in_si = if second.in_si == 1.0 { first.in_si } else { second.in_si };
            let pairs = values.iter().zip(imaginary);
            pairs.map(|(re, im)| Complex::new(re * first.in_si, im * in_si)).collect::<Vec<_>>()
        }
        _ => polar(table, first, other, values)?,
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
                "value {row} of column {} is 0, so it has no inverse",
                table.label(first.column)
            ),
        })?;
    }
    let [response, reference] = first.points.clone();
    Ok(ResponseFunction { response, reference, quantity: first.quantity, values, standard_error })
}

/// Reads a response from its `magnitude`, which may be a level in dB, and from its phase in another
/// column.
fn polar<'a>(
    table: &Table,
    first: &Heading,
    other: &OtherPart<'a>,
    magnitude: &[f64],
) -> Result<Vec<Complex<f64>>, IoError> {
    let phase = other(&|part| matches!(part, Part::Phase(_)));
    let second = phase.ok_or_else(|| match first.part {
        Part::Level => without_phase(table, first),
        _ => missing(table, first, "phase"),
    })?;
    if let (Part::Phase(None), Some(doubt)) = (second.part, &second.doubt) {
        let (column, text) = (table.label(second.column), escaped(&doubt.text));
        let what = format!(
            "column {column} is a phase in {text}, which is not a unit of angle: state deg, rad, mrad or gon"
        );
        return Err(IoError::Description { file: table.file().into(), what });
    }
    if first.part == Part::Magnitude && magnitude.iter().any(|value| *value < 0.0) {
        let column = table.label(first.column);
        let what = format!(
            "column {column} has negative numbers, so it is no magnitude: if these are levels, state \"dB\" with its reference, such as \"dB re 1 g/N\""
        );
        return Err(IoError::Description { file: table.file().into(), what });
    }
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
    let pairs = magnitude.iter().zip(phase);
    Ok(pairs.map(|(value, phase)| Complex::from_polar(size(*value), phase * unit)).collect())
}

/// Returns the error for a column of one part of a response, such as the real part, if there is no
/// column of the other part.
fn missing(table: &Table, heading: &Heading, what: &str) -> IoError {
    IoError::Description {
        file: table.file().into(),
        what: format!(
            "column {} has no matching {what}: a frequency response has a real and an imaginary part, or a \
             magnitude and a phase",
            table.label(heading.column)
        ),
    }
}

/// Returns the error for a column with a level in dB, if there is no column with the phase.
fn without_phase(table: &Table, heading: &Heading) -> IoError {
    let column = table.label(heading.column);
    let reference = match &heading.unit {
        Some((_, text)) => format!("re {}", escaped(text)),
        None => "without a reference".into(),
    };
    IoError::Description {
        file: table.file().into(),
        what: format!(
            "column {column} is a magnitude in decibels {reference}, and its phase is missing: add a \
             column with the phase (\"Phase [deg]\"), because a magnitude alone does not determine the \
             response"
        ),
    }
}

/// Replaces values by their inverses, and their standard errors by those of the inverses; fails
/// with the number of the first value that has no inverse, counted from 1.
pub(crate) fn invert(
    values: &mut [Complex<f64>],
    mut errors: Option<&mut [f64]>,
) -> Result<(), usize> {
    for (at, value) in values.iter_mut().enumerate() {
        if let Some(errors) = &mut errors {
            errors[at] /= value.norm_sqr();
        }
        *value = value.inv();
    }
    values.iter().position(|value| !value.is_finite()).map_or(Ok(()), |at| Err(at + 1))
}
