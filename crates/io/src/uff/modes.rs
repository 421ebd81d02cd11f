//! Modes at nodes (dataset 55).

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use nalgebra::Complex;

use super::lines::{Line, Lines, is_mark, number};
use super::{dataset_number, skip_to_end};
use crate::IoError;
use crate::contents::{Fault, Place};
use crate::geometry::{NodalMode, NodalModes};

/// Names of the values at a node, in the order of the dataset.
const DIRECTIONS: [&str; 6] = ["+X", "+Y", "+Z", "+RX", "+RY", "+RZ"];

/// Maximum number of values at a node: translations and rotations.
const MOST_VALUES: usize = DIRECTIONS.len();

/// Mode with the values at each node.
struct Nodal {
    frequency_hz: f64,
    damping_ratio: f64,
    values: BTreeMap<u32, Vec<Complex<f64>>>,
}

/// Reads the modes of a file; directions without motion in all modes are omitted.
pub(crate) fn read_modes(file: &str, bytes: &[u8]) -> Result<NodalModes, IoError> {
    let mut lines = Lines::new(bytes);
    let modes = modes(&mut lines).map_err(|fault| {
        let at = Place::Line(lines.number_at(fault.at));
        fault.error(file, at)
    })?;
    let Some(first) = modes.first() else {
        return Err(IoError::Empty {
            file: file.into(),
            found: "there is no dataset 55 with modes at nodes",
        });
    };
    let zero = vec![Complex::default(); MOST_VALUES];
    let width = |node: &u32| first.values.get(node).map_or(0, Vec::len);
    let mut points = Vec::new();
    for node in first.values.keys() {
        for at in 0..width(node) {
            let value = |mode: &Nodal| mode.values.get(node).unwrap_or(&zero).get(at).copied();
            if modes.iter().any(|mode| value(mode).is_some_and(|z| z != Complex::default())) {
                points.push((*node, at, width(node)));
            }
        }
    }
    let name = |(node, at, width): &(u32, usize, usize)| match width {
        1 => node.to_string(),
        _ => format!("{node}{}", DIRECTIONS[*at]),
    };
    let of = |mode: &Nodal| NodalMode {
        frequency_hz: mode.frequency_hz,
        damping_ratio: mode.damping_ratio,
        shape: points
            .iter()
            .map(|(node, at, _)| {
                mode.values.get(node).and_then(|v| v.get(*at)).copied().unwrap_or_default()
            })
            .collect(),
    };
    Ok(NodalModes {
        file: file.into(),
        points: points.iter().map(name).collect(),
        modes: modes.iter().map(of).collect(),
    })
}

fn modes(lines: &mut Lines<'_>) -> Result<Vec<Nodal>, Fault> {
    let mut modes = Vec::new();
    while let Some(mark) = lines.next() {
        if mark.text.trim_ascii().is_empty() {
            continue;
        }
        if !is_mark(mark.text) {
            return Err(mark.fault("a dataset must begin with -1 in columns 5 and 6"));
        }
        let id = lines.required("a dataset begins here and has no number")?;
        if dataset_number(&id)? == 55 {
            modes.extend(mode(lines)?);
        } else {
            skip_to_end(lines)?;
        }
    }
    Ok(modes)
}

/// Reads a dataset 55; `None` if its data are not a mode.
fn mode(lines: &mut Lines<'_>) -> Result<Option<Nodal>, Fault> {
    const SHORT: &str = "dataset 55 is cut short";
    for _ in 0..5 {
        lines.required(SHORT)?;
    }
    let kind = lines.required(SHORT)?;
    let integer = |line: &Line<'_>, at: usize| -> Result<usize, Fault> {
        number(columns(line, 10 * at, 10))
            .ok_or_else(|| line.fault(format!("no whole number in field {}", at + 1)))
    };
    let (analysis, data, width) = (integer(&kind, 1)?, integer(&kind, 4)?, integer(&kind, 5)?);
    // The analysis types are normal modes, and complex eigenvalues of first and second order.
    if ![2, 3, 7].contains(&analysis) {
        skip_to_end(lines)?;
        return Ok(None);
    }
    if !(1..=MOST_VALUES).contains(&width) || ![2, 5].contains(&data) {
        return Err(
            kind.fault(format!("{width} values of type {data} at a node cannot be a mode shape"))
        );
    }
    let about = lines.required(SHORT)?;
    let (integers, reals) = (integer(&about, 0)?, integer(&about, 1)?);
    if integers > MOST_REALS || reals > MOST_REALS {
        return Err(about.fault(format!(
            "{integers} whole numbers and {reals} real numbers are too many for a mode"
        )));
    }
    for _ in 1..(2 + integers).div_ceil(8) {
        lines.required(SHORT)?;
    }
    let values = numbers(lines, reals)?;
    let value = |at: usize| values.get(at).copied().unwrap_or(0.0);
    let (frequency_hz, damping_ratio) = if analysis == 2 {
        (value(0), value(2))
    } else {
        let size = value(0).hypot(value(1));
        (size / TAU, if size > 0.0 { -value(0) / size } else { 0.0 })
    };
    let mut nodes = BTreeMap::new();
    loop {
        let line = lines.required("dataset has no end: the file is cut short")?;
        if is_mark(line.text) {
            break;
        }
        let node: u32 = number(columns(&line, 0, 10))
            .ok_or_else(|| line.fault("the number of the node is missing in columns 1 to 10"))?;
        let numbers_per_value = if data == 5 { 2 } else { 1 };
        let numbers = numbers(lines, numbers_per_value * width)?;
        let complex = |part: &[f64]| Complex::new(part[0], part.get(1).copied().unwrap_or(0.0));
        if nodes.insert(node, numbers.chunks(numbers_per_value).map(complex).collect()).is_some() {
            return Err(line.fault(format!("node {node} occurs twice")));
        }
    }
    Ok(Some(Nodal { frequency_hz, damping_ratio, values: nodes }))
}

/// Maximum number of type-specific real numbers; a dataset with more is an error.
const MOST_REALS: usize = 64;

/// Reads numbers in fields of 13 columns, six a line.
fn numbers(lines: &mut Lines<'_>, count: usize) -> Result<Vec<f64>, Fault> {
    let mut values = Vec::with_capacity(count);
    while values.len() < count {
        let line = lines.required("numbers of dataset 55 are missing")?;
        for field in 0..(count - values.len()).min(6) {
            let value = number::<f64>(columns(&line, 13 * field, 13)).filter(|v| v.is_finite());
            let from = 13 * field + 1;
            values.push(value.ok_or_else(|| {
                line.fault(format!("no number in columns {from} to {}", from + 12))
            })?);
        }
    }
    Ok(values)
}

fn columns<'a>(line: &Line<'a>, from: usize, width: usize) -> &'a [u8] {
    let tail = line.text.get(from..).unwrap_or_default();
    tail.get(..width).unwrap_or(tail)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Geometry, PointShape};

    /// Returns the universal file of two nodes with complex shapes, as this crate writes it.
    fn written() -> String {
        let geometry = Geometry::from_names(["1+Z", "2+Z"]);
        let names = ["1+Z".to_owned(), "2+Z".to_owned()];
        let shape = |hz: f64, entries: [[f64; 2]; 2]| PointShape {
            frequency_hz: hz,
            damping_ratio: 0.02,
            displacement: geometry.displacement(&names, &entries).unwrap(),
        };
        geometry.universal_file(&[
            shape(12.5, [[1.0, 0.0], [0.5, 0.25]]),
            shape(31.0, [[-0.5, 0.0], [1.0, -0.125]]),
        ])
    }

    #[test]
    fn modes_that_are_written_are_read() {
        let text = written();
        let read = read_modes("a.unv", text.as_bytes()).unwrap();
        assert_eq!(read.points, ["1+Z", "2+Z"]);
        let modes = read.modes.iter().map(|mode| (mode.frequency_hz, mode.damping_ratio));
        for ((hz, ratio), expected) in modes.zip([12.5, 31.0]) {
            assert!((hz / expected - 1.0).abs() < 1e-5 && (ratio - 0.02).abs() < 1e-6);
        }
        let (half, quarter) = (Complex::new(0.5, 0.25), Complex::new(1.0, -0.125));
        assert_eq!(read.modes[0].shape, [Complex::from(1.0), half]);
        assert_eq!(read.modes[1].shape, [Complex::from(-0.5), quarter]);
        let geometry = Geometry::parse("a.unv", &text).unwrap();
        assert_eq!((geometry.points.len(), geometry.lines.len()), (2, 1));
    }

    #[test]
    fn a_file_that_is_cut_short_or_wrong_is_an_error_with_its_line() {
        let text = written();
        for end in 0..text.len() {
            // A file that is cut between two datasets is still a valid file.
            if let Ok(read) = read_modes("a.unv", &text.as_bytes()[..end]) {
                assert!((1..=2).contains(&read.modes.len()));
            }
        }
        let mut wrong = text.clone();
        let at = text.rfind("  1.00000E+00").unwrap();
        wrong.replace_range(at..at + 13, "  1.00q00E+00");
        let error = read_modes("a.unv", wrong.as_bytes()).unwrap_err().to_string();
        assert!(error.contains("no number in columns"), "{error}");
        assert!(matches!(read_modes("a.unv", b""), Err(IoError::Empty { .. })));
    }
}
