//! Nodes (datasets 15 and 2411) and trace lines (82).

use std::collections::BTreeMap;

use super::lines::{Line, Lines, is_mark, number};
use super::{dataset_number, skip_to_end, units};
use crate::IoError;
use crate::contents::{Fault, Place};
use crate::geometry::{Geometry, GeometryPoint};

/// Nodes and trace lines, identified by their numbers.
#[derive(Default)]
struct Model {
    nodes: BTreeMap<u32, [f64; 3]>,
    lines: Vec<[u32; 2]>,
    /// Factor from m to the unit of length in the file.
    length: Option<f64>,
}

/// Reads the geometry of a file.
pub(crate) fn read_geometry(file: &str, bytes: &[u8]) -> Result<Geometry, IoError> {
    let mut lines = Lines::new(bytes);
    let model = model(&mut lines).map_err(|fault| {
        let at = Place::Line(lines.number_at(fault.at));
        fault.error(file, at)
    })?;
    if model.nodes.is_empty() {
        return Err(IoError::Empty { file: file.into(), found: "there is no dataset 15 or 2411" });
    }
    let length = model.length.filter(|length| *length > 0.0).unwrap_or(1.0);
    let point = |(number, position): (&u32, &[f64; 3])| GeometryPoint {
        name: number.to_string(),
        position: position.map(|value| value / length),
    };
    let index: BTreeMap<u32, usize> = model.nodes.keys().zip(0..).map(|(k, at)| (*k, at)).collect();
    // A line to a node that the file does not define cannot be drawn, so it is omitted.
    let pairs = model.lines.iter().filter_map(|[a, b]| Some([*index.get(a)?, *index.get(b)?]));
    Ok(Geometry { lines: pairs.collect(), points: model.nodes.iter().map(point).collect() })
}

fn model(lines: &mut Lines<'_>) -> Result<Model, Fault> {
    let mut model = Model::default();
    while let Some(mark) = lines.next() {
        if mark.text.trim_ascii().is_empty() {
            continue;
        }
        if !is_mark(mark.text) {
            return Err(mark.fault("a dataset must begin with -1 in columns 5 and 6"));
        }
        let id = lines.required("a dataset begins here and has no number")?;
        match dataset_number(&id)? {
            15 => nodes(lines, &mut model, true)?,
            2411 => nodes(lines, &mut model, false)?,
            82 => trace_lines(lines, &mut model)?,
            164 => {
                model.length = Some(units(lines)?.length);
                skip_to_end(lines)?;
            }
            _ => skip_to_end(lines)?,
        }
    }
    Ok(model)
}

/// Reads nodes to the end of the dataset: number, coordinate systems and colour, then the
/// coordinates on the same line (15) or on the next (2411).
fn nodes(lines: &mut Lines<'_>, model: &mut Model, is_one_line: bool) -> Result<(), Fault> {
    loop {
        let line = lines.required("dataset has no end: the file is cut short")?;
        if is_mark(line.text) {
            return Ok(());
        }
        let node: u32 = number(columns(&line, 0, 10))
            .ok_or_else(|| line.fault("the number of the node is missing in columns 1 to 10"))?;
        let (line, start, width) = if is_one_line {
            (line, 40, 13)
        } else {
            (lines.required("the coordinates of a node are missing")?, 0, 25)
        };
        let position = [0, 1, 2].map(|k| number::<f64>(columns(&line, start + k * width, width)));
        let [Some(x), Some(y), Some(z)] = position.map(|v| v.filter(|v| v.is_finite())) else {
            return Err(line.fault(format!(
                "a node has three coordinates from column {}, each of {width} columns",
                start + 1
            )));
        };
        if model.nodes.insert(node, [x, y, z]).is_some() {
            return Err(line.fault(format!("node {node} occurs twice")));
        }
    }
}

/// Reads a trace line, which is a list of nodes; a 0 in the list interrupts the line.
fn trace_lines(lines: &mut Lines<'_>, model: &mut Model) -> Result<(), Fault> {
    let about = lines.required("a trace line has no description")?;
    lines.required("a trace line has no name")?;
    let count: usize = number(columns(&about, 10, 10))
        .ok_or_else(|| about.fault("the number of nodes is missing in columns 11 to 20"))?;
    let mut chain: Vec<u32> = Vec::new();
    loop {
        let line = lines.required("dataset has no end: the file is cut short")?;
        if is_mark(line.text) {
            break;
        }
        for k in 0..line.text.len().div_ceil(10) {
            let field = columns(&line, 10 * k, 10);
            let node = number(field).ok_or_else(|| {
                line.fault(format!("no node in columns {} to {}", 10 * k + 1, 10 * k + 10))
            })?;
            chain.push(node);
        }
    }
    if chain.len() != count {
        return Err(
            about.fault(format!("a trace line states {count} nodes, but has {}", chain.len()))
        );
    }
    let drawn = chain.windows(2).filter(|pair| pair[0] != 0 && pair[1] != 0);
    model.lines.extend(drawn.map(|pair| [pair[0], pair[1]]));
    Ok(())
}

fn columns<'a>(line: &Line<'a>, from: usize, width: usize) -> &'a [u8] {
    let tail = line.text.get(from..).unwrap_or_default();
    tail.get(..width).unwrap_or(tail)
}
