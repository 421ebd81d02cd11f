//! Frequency responses and coherences in datasets 58 and 58b.

use std::collections::BTreeMap;

use mechid_model::ResponseQuantity;
use nalgebra::Complex;

use super::function::dataset;
use super::header::Header;
use super::lines::{Line, Lines, is_mark};
use super::{Units, dataset_number, skip_to_end, units};
use crate::contents::{Fault, Place};
use crate::limits::Budget;
use crate::responses::{CoherenceFunction, FrequencyResponses, ResponseFunction};
use crate::units::ResponseUnit;
use crate::{Evidence, IoError, Quantity, StatedUnit, Unit, escaped};

/// Abscissa type of a frequency.
const FREQUENCY: u32 = 18;

/// Data type of an excitation force.
const EXCITATION_FORCE: u32 = 13;

/// Data type of any quantity; the label or the user states the quantity.
const GENERAL: u32 = 1;

/// Maximum relative difference between two equal frequencies printed in single precision.
const SAME_FREQUENCY: f64 = 2e-5;

/// Reads the frequency responses of a file, in SI units.
pub(crate) fn read(
    file: &str,
    bytes: &[u8],
    budget: Budget,
) -> Result<FrequencyResponses, IoError> {
    let mut lines = Lines::new(bytes);
    match functions(file, &mut lines, budget) {
        Ok(responses) if responses.functions.is_empty() => Err(IoError::Empty {
            file: file.into(),
            found: "there is no dataset 58 with a frequency response function",
        }),
        Ok(responses) => Ok(responses),
        Err(fault) => {
            let at = Place::Line(lines.number_at(fault.at));
            Err(fault.error(file, at))
        }
    }
}

fn functions(
    file: &str,
    lines: &mut Lines<'_>,
    mut budget: Budget,
) -> Result<FrequencyResponses, Fault> {
    let mut responses = FrequencyResponses { file: file.into(), ..FrequencyResponses::default() };
    let (mut stated, mut others, mut labels) = (None, 0_usize, Vec::new());
    while let Some(mark) = lines.next() {
        if mark.text.trim_ascii().is_empty() {
            continue;
        }
        if !is_mark(mark.text) {
            return Err(mark.fault("a dataset must begin with -1 in columns 5 and 6"));
        }
        let id = lines.required("a dataset begins here and has no number")?;
        match dataset_number(&id)? {
            58 => {
                let (header, values) = dataset(lines, &id, &mut budget)?;
                match header.function {
                    4 | 6 => {
                        add(&mut responses, &id, &header, &values)?;
                        if labels.len() < responses.functions.len() {
                            labels.push(header.units);
                        }
                    }
                    _ => others += 1,
                }
            }
            164 => stated = Some(units(lines)?),
            _ => {}
        }
        skip_to_end(lines)?;
    }
    if others > 0 {
        responses.remarks.push(format!(
            "left out: datasets 58 that are neither a frequency response nor a coherence ({others})"
        ));
    }
    to_si(&mut responses, &labels, stated.as_ref());
    Ok(responses)
}

/// Adds a frequency response or a coherence.
fn add(
    responses: &mut FrequencyResponses,
    id: &Line<'_>,
    header: &Header,
    values: &[f64],
) -> Result<(), Fault> {
    if header.abscissa != FREQUENCY {
        let abscissa = header.abscissa;
        return Err(id.fault(format!(
            "{} has an abscissa of type {abscissa}, but needs type 18 (frequency)",
            header.kind()
        )));
    }
    let (mut frequency_hz, numbers) = frequencies_and_values(header, values);
    let in_hz = frequency_unit(responses, header);
    frequency_hz.iter_mut().for_each(|frequency| *frequency *= in_hz);
    if let Some(at) = numbers.iter().position(|z| !z.is_finite()) {
        return Err(id.fault(format!("value {} of the function is not finite", at + 1)));
    }
    same_frequencies(responses, id, frequency_hz)?;
    responses.added_decay =
        responses.added_decay.or(header.added_decay.filter(|rate| rate.is_finite() && *rate > 0.0));
    responses.segments = responses.segments.or(header.segments);
    let response = header.response.clone();
    if header.function == 6 {
        let values = numbers.iter().map(|z| z.re).collect();
        let reference = header.reference.clone();
        responses.coherence.push(CoherenceFunction { response, reference, values });
        return Ok(());
    }
    if !header.is_complex {
        return Err(
            id.fault("a frequency response function needs complex numbers, but this dataset has real numbers")
        );
    }
    let Some(reference) = header.reference.clone() else {
        return Err(id.fault("a frequency response function needs a reference"));
    };
    let denominator = header.ordinate[1];
    if ![0, GENERAL, EXCITATION_FORCE].contains(&denominator) {
        return Err(id.fault(format!(
            "the response is per quantity of type {denominator}, but must be per excitation force (13)"
        )));
    }
    let (quantity, values, standard_error) = (quantity(header), numbers, None);
    responses.functions.push(ResponseFunction {
        response,
        reference,
        quantity,
        values,
        standard_error,
    });
    Ok(())
}

/// Returns the size of the unit of the frequencies, in Hz, that the label of the abscissa states; a
/// label that does not clearly state a unit of a frequency is added to `doubts`.
fn frequency_unit(responses: &mut FrequencyResponses, header: &Header) -> f64 {
    let Some(stated) = header.abscissa_unit(Quantity::Frequency) else { return 1.0 };
    let is_frequency = |unit: &&Unit| unit.quantity == Quantity::Frequency;
    let in_hz = stated.used().filter(is_frequency).map(|unit| unit.in_si);
    let remark = format!(
        "the labels of the file state frequencies in {}: the frequencies were multiplied by {} to get Hz",
        escaped(&stated.text),
        in_hz.unwrap_or(1.0)
    );
    if in_hz.is_some_and(|in_hz| in_hz != 1.0) && !responses.remarks.contains(&remark) {
        responses.remarks.push(remark);
    }
    let stated = match in_hz {
        Some(_) => stated,
        None => StatedUnit { unit: None, evidence: Evidence::Unused, ..stated },
    };
    if stated.evidence != Evidence::Stated {
        let doubt = ("of the frequencies".to_owned(), stated, Quantity::Frequency);
        if !responses.doubts.contains(&doubt) {
            responses.doubts.push(doubt);
        }
    }
    in_hz.unwrap_or(1.0)
}

/// Returns the frequencies, in the unit of the file, and the values of a function from the numbers
/// of its data set.
fn frequencies_and_values(header: &Header, numbers: &[f64]) -> (Vec<f64>, Vec<Complex<f64>>) {
    let numbers_per_value = 1 + usize::from(header.is_complex) + usize::from(!header.is_even);
    let rows = numbers.chunks_exact(numbers_per_value);
    let frequency_hz = if header.is_even {
        (0..header.count).map(|k| header.start + k as f64 * header.step).collect()
    } else {
        rows.clone().map(|row| row[0]).collect()
    };
    let values = rows.map(|row| {
        if header.is_complex {
            Complex::new(row[numbers_per_value - 2], row[numbers_per_value - 1])
        } else {
            Complex::from(row[numbers_per_value - 1])
        }
    });
    (frequency_hz, values.collect())
}

fn quantity(header: &Header) -> Option<ResponseQuantity> {
    match header.ordinate[0] {
        8 => Some(ResponseQuantity::Displacement),
        11 => Some(ResponseQuantity::Velocity),
        12 => Some(ResponseQuantity::Acceleration),
        _ => quantity_of_label(&header.units[0]),
    }
}

/// Returns the quantity that the label of a function without a specific type states.
fn quantity_of_label(label: &str) -> Option<ResponseQuantity> {
    if let Some(unit) = ResponseUnit::parse(label).filter(|unit| !unit.is_inverse) {
        return Some(unit.quantity);
    }
    match Unit::parse(label)?.quantity {
        Quantity::Response(quantity) => Some(quantity),
        _ => None,
    }
}

/// Stores the frequencies of the first function; returns an error if another function has other
/// frequencies.
fn same_frequencies(
    responses: &mut FrequencyResponses,
    id: &Line<'_>,
    frequency_hz: Vec<f64>,
) -> Result<(), Fault> {
    if responses.frequency_hz.is_empty() {
        responses.frequency_hz = frequency_hz;
        return Ok(());
    }
    let (len, got) = (responses.frequency_hz.len(), frequency_hz.len());
    if len != got {
        return Err(id.fault(format!(
            "this function has {got} frequencies, but the first function has {len}"
        )));
    }
    let pairs = responses.frequency_hz.iter().zip(&frequency_hz);
    match pairs.into_iter().find(|(a, b)| (*a - *b).abs() > SAME_FREQUENCY * a.abs().max(b.abs())) {
        None => Ok(()),
        Some((first, other)) => {
            Err(id
                .fault(format!("a frequency is {other} Hz, but {first} Hz in the first function")))
        }
    }
}

/// Converts the responses to SI units, by their labels and the factors of the file.
fn to_si(responses: &mut FrequencyResponses, labels: &[[String; 2]], stated: Option<&Units>) {
    let (mut by_label, mut of_file) = (BTreeMap::new(), None);
    for (function, labels) in responses.functions.iter_mut().zip(labels) {
        let (factor, used) = Units::factor(stated, labels);
        if !(factor.is_finite() && factor > 0.0) || factor == 1.0 {
            continue;
        }
        function.values.iter_mut().for_each(|z| *z *= factor);
        if used.is_empty() {
            of_file = Some(factor);
        } else {
            by_label.insert(used.join(" per "), factor);
        }
    }
    if let Some((Units { code, name, .. }, factor)) = stated.zip(of_file) {
        responses.remarks.push(format!(
            "the file states its units (code {code} {name}): responses were multiplied by {factor} to \
             get SI units"
        ));
    }
    for (label, factor) in by_label {
        responses.remarks.push(format!(
            "the labels of the file state the unit {label}: responses were multiplied by {factor} to get SI units"
        ));
    }
}
