//! Frequency responses in arrays of complex numbers: points × references, with the frequencies
//! along one dimension.

use mechid_model::ResponseQuantity;
use nalgebra::Complex;

use crate::contents::ComplexArray;
use crate::response_columns::points_of;
use crate::responses::{CoherenceFunction, FrequencyResponses, ResponseFunction};
use crate::{IoError, Table, escaped};

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
/// array with too many dimensions, for one that is not finite, and for two arrays with the same
/// response.
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
        responses
            .remarks
            .push(format!("left out: {} (no dimension is frequency)", names.join(", ")));
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
    let leaf = array.name.rsplit_once(['.', '/']).map_or(array.name.as_str(), |(_, leaf)| leaf);
    let words: Vec<String> =
        leaf.split('_').filter(|word| !word.is_empty()).map(String::from).collect();
    // `H_2_1` and `H21` name points; `H` and `H1` name an estimator.
    let has_points =
        words.len() > 2 || leaf.len() > 2 && leaf.ends_with(|c: char| c.is_ascii_digit());
    let named = points_of(words).filter(|_| has_points && points * references == 1);
    for response in 0..points {
        for reference in 0..references {
            let numbers = [response, reference].map(|index| (index + 1).to_string());
            let [to, from] = named.clone().unwrap_or(numbers);
            if responses.functions.iter().any(|f| f.response == to && f.reference == from) {
                return Err(format!(
                    "{} and another array have the response at {} to a force at {}: leave one out",
                    escaped(&array.name),
                    escaped(&to),
                    escaped(&from)
                ));
            }
            responses.functions.push(ResponseFunction {
                response: to,
                reference: from,
                quantity: quantity_of_name(leaf),
                values: shape.values(array, [response, reference]),
                standard_error: None,
            });
        }
    }
    responses.remarks.push(format!(
        "{}: {points} by {references} responses (points of the response by points of the force) in SI units, because \
         no units are stated",
        escaped(&array.name)
    ));
    Ok(())
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
            // A vector is a matrix of one row or one column.
            [points] => [points, one],
            [points, references] => [points, references],
            _ => {
                return Err(format!(
                    "{} has more than three dimensions; only three are known: frequency, response point and reference point",
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
        let leaf = name.rsplit_once(['.', '/']).map_or(name.as_str(), |(_, leaf)| leaf);
        let stem = leaf.split('[').next().unwrap_or_default().to_lowercase();
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
