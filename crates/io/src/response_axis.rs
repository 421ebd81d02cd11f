//! Frequencies of a table of frequency responses, in Hz and in rising order.

use crate::escape::escaped;
use crate::responses::FrequencyResponses;
use crate::{Evidence, IoError, Quantity, StatedUnit, Table};

/// Names, in lower case, of a column of frequencies; the names that are not in [`IN_RADIANS`] mean
/// Hz if there is no unit.
const FREQUENCY: [&str; 10] =
    ["frequency_hz", "frequency", "freq", "f", "frequenz", "hz", "khz", "rpm", "omega", "w"];

/// Names of a column of angular frequencies, in rad/s.
const IN_RADIANS: [&str; 4] = ["omega", "w", "ω", "radians"];

/// Names of a column of multiples of the speed of rotation.
const ORDERS: [&str; 2] = ["order", "orders"];

/// Prefixes of the names of a column with rotational speeds.
const SPEEDS: [&str; 4] = ["speed", "rpm", "rotation", "drehzahl"];

/// Returns the column of frequencies, by its name or its field in a struct.
fn frequency_column(table: &Table) -> Option<usize> {
    let names = || FREQUENCY.iter().chain(&IN_RADIANS);
    let of_struct = |at: &usize| {
        let leaf = table.names()[*at].rsplit_once(['.', '/']).map(|(_, leaf)| leaf.to_lowercase());
        leaf.is_some_and(|leaf| names().any(|name| *name == leaf))
    };
    names().find_map(|name| table.find(name).ok()).or_else(|| (0..table.width()).find(of_struct))
}

/// Returns the frequencies of a table, in Hz. If their unit is not stated with certainty, the text
/// that may be this unit is added to `doubts`.
pub(crate) fn frequencies(
    table: &Table,
    doubts: &mut Vec<(String, StatedUnit, Quantity)>,
) -> Result<Vec<f64>, IoError> {
    if let Some(orders) = ORDERS.iter().find_map(|name| table.find(name).ok()) {
        return frequencies_of_orders(table, orders);
    }
    let named = frequency_column(table);
    let column = match named {
        Some(column) => column,
        None if !table.complex().is_empty() => {
            return Err(IoError::Description {
                file: table.file().into(),
                what: format!(
                    "the responses need a vector of their frequencies: save this vector as {}",
                    FREQUENCY[..4].join(" or ")
                ),
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

/// Returns the frequencies, in Hz, of orders: multiples of the speed of rotation, which a second
/// column must state.
fn frequencies_of_orders(table: &Table, orders: usize) -> Result<Vec<f64>, IoError> {
    let is_speed = |at: &usize| {
        let name = table.names()[*at].to_lowercase();
        SPEEDS.iter().any(|speed| name.starts_with(speed))
    };
    let frequency = Some(Quantity::Frequency);
    let speed = (0..table.width()).filter(is_speed).find_map(|at| {
        let unit = table.stated_unit(at, frequency)?.used().cloned()?;
        (unit.quantity == Quantity::Frequency).then_some((at, unit.in_si))
    });
    let Some((speed, in_hz)) = speed else {
        return Err(IoError::Description {
            file: table.file().into(),
            what: "the frequencies are orders (multiples of the speed of rotation), but the speed is not stated: \
                   multiply the orders by the speed, or add a column speed_hz or speed_rpm"
                .into(),
        });
    };
    let pairs = table.values(orders)?.iter().zip(table.values(speed)?);
    Ok(pairs.map(|(order, speed)| order * speed * in_hz).collect())
}

/// Sorts the frequencies in rising order and removes the mirrored half of a two-sided spectrum,
/// with a remark.
pub(crate) fn sort(responses: &mut FrequencyResponses) -> Result<(), IoError> {
    let hz = &responses.frequency_hz;
    if let Some(short) = responses.functions.iter().find(|one| one.values.len() != hz.len()) {
        let (count, points) = (short.values.len(), [&short.response, &short.reference]);
        let what = format!(
            "the response at {} to a force at {} has {count} values for {} frequencies",
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
        let what = format!("the frequency {} Hz occurs twice", hz[pair[0]]);
        return Err(IoError::Description { file: responses.file.clone(), what });
    }
    let mirrored = mirrored(responses, &order);
    order.truncate(order.len() - mirrored);
    if order.iter().copied().eq(0..hz.len()) {
        return Ok(());
    }
    if negative + mirrored > 0 {
        let count = negative + mirrored;
        let frequencies = if count == 1 { "frequency" } else { "frequencies" };
        responses.remarks.push(format!(
            "left out: {count} mirrored {frequencies}, negative or above half the sampling rate"
        ));
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

/// Returns the number of lines above half the sampling rate: the values at these highest
/// frequencies mirror the values at the lowest frequencies. The table may lack the line at 0 Hz.
fn mirrored(responses: &FrequencyResponses, order: &[usize]) -> usize {
    /// Maximum relative difference between a value and its mirror image, from the rounding of
    /// printed numbers.
    const SAME: f64 = 1e-6;
    /// Minimum number of lines above 0 Hz in a spectrum that is searched for a mirrored half; in a
    /// spectrum with fewer lines, no line counts as mirrored.
    const MIN_LINES: usize = 3;
    let hz = |at: usize| responses.frequency_hz[at];
    let lines = order.iter().copied().filter(|at| hz(*at) > 0.0).collect::<Vec<_>>();
    if lines.len() < MIN_LINES {
        return 0;
    }
    // If the lines begin at 0 Hz or at the first multiple of the step, the frequencies of each
    // mirrored pair add up to the sampling rate.
    let step = hz(lines[1]) - hz(lines[0]);
    let is_complete = lines.len() < order.len() || (hz(lines[0]) / step - 1.0).abs() <= SAME;
    let pairs = || lines.iter().zip(lines.iter().rev());
    let is_mirrored = responses.functions.iter().all(|function| {
        let value = |at: usize| function.values[at];
        let size = lines.iter().map(|at| value(*at).norm()).fold(0.0, f64::max);
        pairs().all(|(at, image)| (value(*image).conj() - value(*at)).norm() <= SAME * size)
    });
    if is_complete && is_mirrored { lines.len() / 2 } else { 0 }
}
