//! Frequency responses in arrays of complex numbers: points × references, with the frequencies
//! along one dimension.

use mechid_model::ResponseQuantity;
use nalgebra::Complex;

use crate::contents::ComplexArray;
use crate::response_columns::{invert, points_of};
use crate::responses::{CoherenceFunction, FrequencyResponses, ResponseFunction};
use crate::units::{ResponseUnit, is_unit, label_notes, name_without_brackets, unit_text};
use crate::{Evidence, IoError, StatedUnit, Table, escaped};

/// Words, in lower case, that identify an array of coherences by its name.
const COHERENCE: [&str; 3] = ["coherence", "coh", "gamma2"];

/// Adds the responses in those complex arrays of a file that have one value per frequency.
///
/// The dimension of the frequencies is the first one whose length is the number of frequencies; the
/// other dimensions are points of the response and points of the force. An array with one other
/// dimension has the responses to one force.
///
/// # Errors
/// [`IoError::Description`] if no array has a dimension of the length of the frequencies, for an
/// array with too many dimensions, with values that are not finite or with units that contradict
/// each other, and for two arrays with the same response.
pub(crate) fn add_functions(
    table: &Table,
    arrays: &[ComplexArray],
    responses: &mut FrequencyResponses,
) -> Result<(), IoError> {
    let wrong = |what: String| IoError::Description { file: table.file().into(), what };
    let count = responses.frequency_hz.len();
    let (over_frequency, others): (Vec<&ComplexArray>, Vec<_>) =
        arrays.iter().partition(|array| array.lengths.contains(&count));
    if over_frequency.is_empty() {
        let sizes: Vec<String> = arrays.iter().map(sizes).collect();
        let sizes = sizes.join(", ");
        return Err(wrong(format!(
            "none of the dimensions {sizes} equals the number of frequencies, {count}"
        )));
    }
    for array in over_frequency {
        if let Some(at) = array.values.iter().position(|value| !value.is_finite()) {
            let name = escaped(&array.name);
            return Err(wrong(format!("entry {} of {name} is not finite", at + 1)));
        }
        let shape = Shape::new(array, count).map_err(wrong)?;
        add_array(array, &shape, responses).map_err(wrong)?;
    }
    if !others.is_empty() {
        let names: Vec<_> = others.iter().map(|array| escaped(&array.name)).collect();
        responses.remarks.push(format!(
            "left out: {} (no dimension has the length of the frequency vector)",
            names.join(", ")
        ));
    }
    add_coherence(table, responses);
    Ok(())
}

/// Adds the responses of one array.
fn add_array(
    array: &ComplexArray,
    shape: &Shape,
    responses: &mut FrequencyResponses,
) -> Result<(), String> {
    let [points, references] = shape.points.map(|dimension| dimension.len);
    let header = Header::new(array)?;
    let named = header.points().filter(|_| points * references == 1);
    for response in 0..points {
        for reference in 0..references {
            let numbers = [response, reference].map(|index| (index + 1).to_string());
            let [to, from] = named.clone().unwrap_or(numbers);
            if responses.functions.iter().any(|f| f.response == to && f.reference == from) {
                return Err(format!(
                    "{} and another array have the response at {} to a force at {}: omit one array",
                    escaped(&array.name),
                    escaped(&to),
                    escaped(&from)
                ));
            }
            let mut values = shape.values(array, [response, reference]);
            header.convert(&mut values)?;
            responses.functions.push(ResponseFunction {
                response: to,
                reference: from,
                quantity: header.quantity,
                values,
                standard_error: None,
            });
        }
    }
    responses.remarks.push(format!(
        "{}: {points} by {references} responses (points of the response by points of the force) {}",
        header.name,
        header.units_remark()
    ));
    if let Some(text) = header.unclear_unit {
        let quantity = header.quantity.unwrap_or(ResponseQuantity::Displacement);
        let stated = StatedUnit { text, unit: None, evidence: Evidence::Unused };
        responses.doubts.push((header.name, stated, quantity.into()));
    }
    Ok(())
}

/// Information that the name and the attributes of an array give about its responses.
#[derive(Debug)]
struct Header {
    /// Name of the array, for messages.
    name: String,
    /// Words of the name, without its unit.
    words: Vec<String>,
    quantity: Option<ResponseQuantity>,
    /// Unit, and the text that states it.
    unit: Option<(ResponseUnit, String)>,
    /// Text that may be a unit and is not understood.
    unclear_unit: Option<String>,
}

impl Header {
    /// Reads the name and the unit of an array; fails if its units contradict each other.
    fn new(array: &ComplexArray) -> Result<Self, String> {
        let leaf = leaf(&array.name);
        let bare = name_without_brackets(leaf);
        let words = bare.split('_').filter(|word| !word.is_empty());
        let mut words: Vec<String> = words.map(String::from).collect();
        let of_name = quantity_of_name(leaf);
        let mut quantity = of_name;
        let notes = label_notes(leaf).into_iter();
        let mut texts: Vec<String> =
            notes.filter(|note| !unit_text(&format!("[{note}]")).is_empty()).collect();
        texts.extend(take_unit_words(&mut words, quantity.is_some()));
        texts.push(array.unit.trim().to_owned());
        let name = escaped(&array.name).into_owned();
        let (mut unit, mut unclear_unit) = (None, None);
        for text in texts.into_iter().filter(|text| !text.is_empty()) {
            let Some(parsed) = ResponseUnit::parse(&text) else {
                unclear_unit.get_or_insert(text);
                continue;
            };
            let is_other_quantity =
                of_name.is_some_and(|name| name != parsed.quantity || parsed.is_inverse);
            if is_other_quantity || unit.as_ref().is_some_and(|(known, _)| *known != parsed) {
                return Err(format!(
                    "the unit {} of {name} contradicts this name or another stated unit: state one unit",
                    escaped(&text)
                ));
            }
            quantity = Some(parsed.quantity);
            unit = Some((parsed, text));
        }
        let unclear_unit = unclear_unit.filter(|_| unit.is_none());
        Ok(Self { name, words, quantity, unit, unclear_unit })
    }

    /// Returns the points of response and force in the name; `None` if it has none.
    fn points(&self) -> Option<[String; 2]> {
        // `H_2_1` and `H21` name points; `H` and `H1` name an estimator.
        let stem = self.words.join("_");
        let ends_with_number = stem.len() > 2 && stem.ends_with(|c: char| c.is_ascii_digit());
        let has_points = self.words.len() > 2 || ends_with_number;
        points_of(self.words.clone()).filter(|_| has_points)
    }

    /// Converts the values of a response to SI units.
    fn convert(&self, values: &mut [Complex<f64>]) -> Result<(), String> {
        let Some((unit, _)) = &self.unit else { return Ok(()) };
        values.iter_mut().for_each(|value| *value *= unit.in_si);
        if unit.is_inverse {
            let inverted = invert(values, None);
            inverted
                .map_err(|at| format!("value {at} of {} is 0, so it has no inverse", self.name))?;
        }
        Ok(())
    }

    /// Returns the end of the remark on the responses: their unit.
    fn units_remark(&self) -> String {
        match (&self.unit, &self.unclear_unit) {
            (Some((unit, text)), _) => {
                format!("in {}, multiplied by {} to get SI units", escaped(text), unit.in_si)
            }
            (None, Some(text)) => {
                format!("read in SI units, because the unit {} is not understood", escaped(text))
            }
            (None, None) => "read in SI units, because no units are stated".into(),
        }
    }
}

/// Returns the name of an array without the names of the structs or groups that contain it.
fn leaf(name: &str) -> &str {
    // A slash in a unit in brackets at the end of the name, such as `[m/N]`, does not separate
    // groups.
    let open = [(']', '['), (')', '(')].into_iter().find(|(close, _)| name.ends_with(*close));
    let end = open.and_then(|(_, open)| name.rfind(open)).unwrap_or(name.len());
    let start = name[..end].rfind(['.', '/']).map_or(0, |at| at + 1);
    &name[start..]
}

/// Removes a unit at the end of the words of a name and returns it: the words `g` and `N` give
/// `g/N`; the words `mm`, `s2` and `N` give `mm/s2/N`. If the name states a quantity, the unit need
/// not be a unit of frequency responses.
fn take_unit_words(words: &mut Vec<String>, has_quantity: bool) -> Option<String> {
    let joined = |count: usize| {
        let first = words.len().checked_sub(count).filter(|first| *first > 0)?;
        let unit: Vec<&str> =
            words[first..].iter().map(String::as_str).filter(|word| *word != "per").collect();
        Some((first, unit.join("/")))
    };
    let candidates: Vec<(usize, String)> = (1..=4).rev().filter_map(joined).collect();
    let response = candidates.iter().find(|(_, text)| ResponseUnit::parse(text).is_some());
    let unclear = || candidates.iter().find(|(_, text)| has_quantity && is_unit(text));
    let (first, text) = response.or_else(unclear)?.clone();
    words.truncate(first);
    Some(text)
}

/// Length and stride of a dimension of an array.
#[derive(Debug, Clone, Copy)]
struct Dimension {
    len: usize,
    stride: usize,
}

/// Dimensions of an array of responses: frequencies and points.
#[derive(Debug)]
struct Shape {
    frequency: Dimension,
    /// Points of the response, then of the force.
    points: [Dimension; 2],
}

impl Shape {
    fn new(array: &ComplexArray, frequencies: usize) -> Result<Self, String> {
        let dimensions = array.lengths.iter().zip(&array.strides);
        let mut point_dimensions: Vec<Dimension> =
            dimensions.map(|(len, stride)| Dimension { len: *len, stride: *stride }).collect();
        let at =
            point_dimensions.iter().position(|dimension| dimension.len == frequencies).unwrap_or(0);
        let frequency = point_dimensions.remove(at);
        let one = Dimension { len: 1, stride: 0 };
        let points = match point_dimensions[..] {
            [] => [one, one],
            // This dimension has the points of the response. For a vector it has length 1: MATLAB
            // stores a vector as a matrix of one row or one column.
            [points] => [points, one],
            [points, references] => [points, references],
            _ => {
                return Err(format!(
                    "{} has more than three dimensions; the possible ones are frequency, response point and \
                     reference point",
                    sizes(array)
                ));
            }
        };
        Ok(Self { frequency, points })
    }

    fn values(&self, array: &ComplexArray, [response, reference]: [usize; 2]) -> Vec<Complex<f64>> {
        let start = response * self.points[0].stride + reference * self.points[1].stride;
        (0..self.frequency.len).map(|k| array.values[start + k * self.frequency.stride]).collect()
    }
}

/// Returns the name and the size of an array, for messages.
fn sizes(array: &ComplexArray) -> String {
    let sizes: Vec<String> = array.lengths.iter().map(usize::to_string).collect();
    format!("{} ({})", escaped(&array.name), sizes.join(" × "))
}

/// Words, in lower case, that identify the measured quantity.
const QUANTITIES: [(&str, ResponseQuantity); 5] = [
    ("accelerance", ResponseQuantity::Acceleration),
    ("inertance", ResponseQuantity::Acceleration),
    ("mobility", ResponseQuantity::Velocity),
    ("receptance", ResponseQuantity::Displacement),
    ("compliance", ResponseQuantity::Displacement),
];

/// Returns the quantity that the name of an array states.
fn quantity_of_name(name: &str) -> Option<ResponseQuantity> {
    let lower = name.to_lowercase();
    QUANTITIES.iter().find(|(word, _)| lower.contains(word)).map(|(_, quantity)| *quantity)
}

/// Adds columns of coherences, one for each point of the response.
fn add_coherence(table: &Table, responses: &mut FrequencyResponses) {
    let is_coherence = |name: &String| {
        let stem = leaf(name).split('[').next().unwrap_or_default().to_lowercase();
        COHERENCE.contains(&stem.as_str())
    };
    let columns = (0..table.width()).filter(|at| is_coherence(&table.names()[*at]));
    let columns = columns.filter_map(|at| table.values(at).ok());
    let columns: Vec<&[f64]> =
        columns.filter(|values| values.len() == responses.frequency_hz.len()).collect();
    let mut points: Vec<&String> = Vec::new();
    for function in &responses.functions {
        if !points.contains(&&function.response) {
            points.push(&function.response);
        }
    }
    if points.len() != columns.len() {
        return;
    }
    let coherence = points.into_iter().zip(columns).map(|(point, values)| CoherenceFunction {
        response: point.clone(),
        reference: None,
        values: values.to_vec(),
    });
    responses.coherence = coherence.collect();
}
