//! Points of a structure, the lines between them, and mode shapes at these points.

use std::path::Path;

use nalgebra::Complex;

use crate::contents::Place;
use crate::{IoError, standard, uff};

/// Points of a structure, and lines between them for drawing.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Geometry {
    /// Points, each with a unique name.
    pub points: Vec<GeometryPoint>,
    /// Lines: the indices of the two points that each line joins.
    pub lines: Vec<[usize; 2]>,
}

/// A point of a structure.
#[derive(Debug, Clone, PartialEq)]
pub struct GeometryPoint {
    /// Name, such as the number of a node.
    pub name: String,
    /// Cartesian coordinates, in m.
    pub position: [f64; 3],
}

/// Point and direction of a sensor or of a force.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Direction<'a> {
    /// Name of the point.
    pub point: &'a str,
    /// Axis: 0, 1, 2 for translations along x, y, z, and 3, 4, 5 for rotations about them.
    pub axis: usize,
    /// `true` for the direction against the axis.
    pub is_negative: bool,
}

/// Mode of a structure with its shape at the points of a [`Geometry`].
#[derive(Debug, Clone, PartialEq)]
pub struct PointShape {
    /// Natural frequency, in Hz.
    pub frequency_hz: f64,
    /// Damping ratio, a pure number.
    pub damping_ratio: f64,
    /// Displacement of each point along x, y, z, as real and imaginary part, in pure numbers.
    pub displacement: Vec<[[f64; 2]; 3]>,
}

/// Modes at nodes, as a finite-element program or another modal analysis writes them.
#[derive(Debug, Clone, PartialEq)]
pub struct NodalModes {
    /// Name of the file for messages.
    pub file: String,
    /// Points and directions of the entries of each shape, such as `12+Z`; the node alone if the
    /// values have no direction.
    pub points: Vec<String>,
    /// The modes, in the order of the file.
    pub modes: Vec<NodalMode>,
}

/// Mode at the nodes of a structure, as a universal file states it.
#[derive(Debug, Clone, PartialEq)]
pub struct NodalMode {
    /// Natural frequency, in Hz.
    pub frequency_hz: f64,
    /// Damping ratio, a pure number; 0 if the file states none.
    pub damping_ratio: f64,
    /// Shape, a pure number for each point and direction.
    pub shape: Vec<Complex<f64>>,
}

impl NodalModes {
    /// Reads the modes of a universal file: datasets 55 of normal modes (analysis type 2) and
    /// complex modes (types 3 and 7). Directions without motion in all modes are omitted.
    ///
    /// # Errors
    /// [`IoError::Read`], [`IoError::Malformed`] with the wrong line, [`IoError::Empty`] without a
    /// mode.
    ///
    /// # Source
    /// University of Cincinnati, SDRL, *Universal File Formats for Modal Analysis Testing*, dataset
    /// 55.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, IoError> {
        let file = standard::input_name(path.as_ref());
        match standard::read_text(path.as_ref()) {
            Ok(text) => Self::parse(&file, &text),
            Err(source) => Err(IoError::Read { file, source }),
        }
    }

    /// Reads the modes in the text of a universal file; `file` is its name in messages.
    ///
    /// # Errors
    /// As [`NodalModes::read`].
    pub fn parse(file: &str, text: &str) -> Result<Self, IoError> {
        uff::read_modes(file, text.as_bytes())
    }
}

/// Names of the axes, in the order of [`Direction::axis`].
const AXES: [&str; 6] = ["X", "Y", "Z", "RX", "RY", "RZ"];

impl<'a> Direction<'a> {
    /// Splits a name such as `12+Z`, `12-z` or `bracket+RX`; `None` if it does not end with a sign
    /// and an axis. Capital and small letters of the axis are the same.
    pub fn parse(name: &'a str) -> Option<Self> {
        let at = name.rfind(['+', '-'])?;
        let axis = AXES.iter().position(|axis| axis.eq_ignore_ascii_case(&name[at + 1..]))?;
        let point = &name[..at];
        let is_negative = name[at..].starts_with('-');
        (!point.is_empty()).then_some(Self { point, axis, is_negative })
    }

    /// Returns the number of the node if the point is a node of a universal file.
    pub fn node(&self) -> Option<u32> {
        self.point.parse().ok()
    }

    /// Returns a pure number: 1 if both names denote the same point and the same direction, and −1
    /// if they denote the same point and opposite directions; `None` for other names. A name
    /// without a direction matches only the same name.
    ///
    /// ```
    /// use mechid_io::Direction;
    ///
    /// assert_eq!(Direction::relative_sign("1-z", "1-Z"), Some(1.0));
    /// assert_eq!(Direction::relative_sign("1-z", "1+Z"), Some(-1.0));
    /// assert_eq!(Direction::relative_sign("1", "1+Z"), None);
    /// ```
    pub fn relative_sign(one: &str, other: &str) -> Option<f64> {
        if one == other {
            return Some(1.0);
        }
        let (a, b) = (Direction::parse(one)?, Direction::parse(other)?);
        let is_same = a.point == b.point && a.axis == b.axis;
        is_same.then_some(if a.is_negative == b.is_negative { 1.0 } else { -1.0 })
    }

    /// Returns the name of the point in the positive direction, with a capital axis: `12+Z`.
    pub fn positive_name(&self) -> String {
        format!("{}+{}", self.point, AXES[self.axis])
    }
}

/// Returns whether a name is a node with a direction, as universal files name their channels:
/// `12+Z`, `3-RX`.
///
/// # Source
/// Structural Dynamics Research Laboratory, University of Cincinnati, *Universal File Formats*,
/// dataset 58 (nodes and directions).
pub fn is_directed_point(name: &str) -> bool {
    Direction::parse(name).is_some_and(|direction| direction.node().is_some())
}

impl Geometry {
    /// Reads the geometry in a universal file (datasets 15 or 2411, and 82), or in a table: a row
    /// `name, x, y, z` for each point, in m, and a row `line, name, name, …` for each polyline.
    ///
    /// Coordinates of a universal file are converted to m by its dataset 164, if it has one.
    ///
    /// # Errors
    /// [`IoError::Read`], and [`IoError::Malformed`] with the wrong line.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, IoError> {
        let file = standard::input_name(path.as_ref());
        match standard::read_text(path.as_ref()) {
            Ok(text) => Self::parse(&file, &text),
            Err(source) => Err(IoError::Read { file, source }),
        }
    }

    /// Reads the geometry in the text of a file, as [`Geometry::read`] does; `file` is its name in
    /// messages.
    ///
    /// # Errors
    /// [`IoError::Malformed`] with the wrong line.
    pub fn parse(file: &str, text: &str) -> Result<Self, IoError> {
        let first = text.lines().find(|line| !line.trim().is_empty()).unwrap_or_default();
        if first.trim_end() == "    -1" {
            return uff::read_geometry(file, text.as_bytes());
        }
        let mut geometry = Self::default();
        for (number, line) in (1..).zip(text.lines()) {
            geometry.read_row(line).map_err(|what| {
                let at = Place::Line(number);
                IoError::Malformed { file: file.to_owned(), at, what }
            })?;
        }
        if geometry.points.is_empty() {
            return Err(IoError::Empty {
                file: file.into(),
                found: "there is no row `name, x, y, z`",
            });
        }
        Ok(geometry)
    }

    fn read_row(&mut self, line: &str) -> Result<(), String> {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            return Ok(());
        }
        let cells: Vec<&str> = line.split([',', ';', '\t']).map(str::trim).collect();
        let cells = if cells.len() > 1 { cells } else { line.split_whitespace().collect() };
        if cells[0].eq_ignore_ascii_case("line") {
            return self.join(&cells[1..]);
        }
        let numbers: Option<Vec<f64>> = cells[1..].iter().map(|cell| cell.parse().ok()).collect();
        match numbers.as_deref() {
            Some(&[x, y, z]) if [x, y, z].iter().all(|value: &f64| value.is_finite()) => {
                self.add(cells[0], [x, y, z])
            }
            // A first row without numbers is the header of the table.
            None if self.points.is_empty() && cells.len() == 4 => Ok(()),
            _ => Err("a point is a name and three coordinates in m".into()),
        }
    }

    pub(crate) fn add(&mut self, name: &str, position: [f64; 3]) -> Result<(), String> {
        if self.index(name).is_some() {
            return Err(format!("point {name} occurs twice"));
        }
        self.points.push(GeometryPoint { name: name.to_owned(), position });
        Ok(())
    }

    /// Adds lines through the points in the given order.
    fn join(&mut self, names: &[&str]) -> Result<(), String> {
        let index =
            |name: &&str| self.index(name).ok_or_else(|| format!("there is no point {name}"));
        let chain: Vec<usize> = names.iter().map(index).collect::<Result<_, _>>()?;
        if chain.len() < 2 {
            return Err("a line needs at least two points".into());
        }
        self.lines.extend(chain.windows(2).map(|pair| [pair[0], pair[1]]));
        Ok(())
    }

    /// Returns the index of a point.
    pub fn index(&self, name: &str) -> Option<usize> {
        self.points.iter().position(|point| point.name == name)
    }

    /// Creates a geometry from names alone: points in a row, 1 m apart along x, in the order of
    /// their names, joined by a line. Names `row.column`, such as `2.3+Z`, create a grid in the
    /// plane of x and y. A name without sign and axis is a separate point.
    pub fn from_names<'a>(names: impl IntoIterator<Item = &'a str>) -> Self {
        let mut geometry = Self::default();
        for name in names {
            let point = Direction::parse(name).map_or(name, |direction| direction.point);
            if geometry.index(point).is_none() {
                let x = geometry.points.len() as f64;
                geometry
                    .points
                    .push(GeometryPoint { name: point.to_owned(), position: [x, 0.0, 0.0] });
            }
        }
        let cell = |point: &GeometryPoint| {
            let (row, column) = point.name.split_once('.')?;
            Some([row.parse::<u32>().ok()?, column.parse::<u32>().ok()?])
        };
        let cells: Option<Vec<[u32; 2]>> = geometry.points.iter().map(cell).collect();
        match cells {
            Some(cells) if cells.len() > 1 => {
                for (point, [row, column]) in geometry.points.iter_mut().zip(&cells) {
                    point.position = [f64::from(*column), f64::from(*row), 0.0];
                }
                for (at, [row, column]) in cells.iter().enumerate() {
                    let next = [[*row, column.saturating_add(1)], [row.saturating_add(1), *column]];
                    let neighbours =
                        next.iter().filter_map(|next| cells.iter().position(|cell| cell == next));
                    geometry.lines.extend(neighbours.map(|other| [at, other]));
                }
            }
            _ => geometry.lines = (1..geometry.points.len()).map(|k| [k - 1, k]).collect(),
        }
        geometry
    }

    /// Returns the displacement along x, y, z of each point of a shape (real and imaginary parts,
    /// pure numbers) whose entries have these names, such as `1+Z`; an entry whose name has no axis
    /// is a displacement of its point along z. Rotations (`1+RZ`) do not displace their point.
    /// `None` if the geometry does not have the point of an entry.
    ///
    /// # Source
    /// Ours.
    pub fn displacement(&self, names: &[String], shape: &[[f64; 2]]) -> Option<Vec<[[f64; 2]; 3]>> {
        let mut moved = vec![[[0.0; 2]; 3]; self.points.len()];
        for (name, [re, im]) in names.iter().zip(shape) {
            let whole = Direction { point: name, axis: 2, is_negative: false };
            let direction = match self.index(name) {
                Some(_) => whole,
                None => Direction::parse(name)?,
            };
            let sign = if direction.is_negative { -1.0 } else { 1.0 };
            let point = self.index(direction.point)?;
            if let Some(displacement) = moved[point].get_mut(direction.axis) {
                *displacement = [sign * re, sign * im];
            }
        }
        Some(moved)
    }

    /// Returns a universal file of the geometry and the shapes on it: units (164: SI), points (15),
    /// lines (82), and a complex dataset 55 for each shape, with 3 degrees of freedom per point.
    ///
    /// Points whose names are not numbers are numbered from 1.
    pub fn universal_file(&self, shapes: &[PointShape]) -> String {
        uff::write_shapes(self, shapes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_make_a_row_or_a_grid() {
        let row = Geometry::from_names(["1+Z", "2+Z", "2+X", "end"]);
        let names: Vec<&str> = row.points.iter().map(|point| point.name.as_str()).collect();
        assert_eq!(names, ["1", "2", "end"]);
        assert_eq!(row.lines, [[0, 1], [1, 2]]);
        let grid = Geometry::from_names(["1.1+Z", "1.2+Z", "2.1+Z", "2.2+Z"]);
        assert_eq!(grid.points[3].position, [2.0, 2.0, 0.0]);
        assert_eq!(grid.lines, [[0, 1], [0, 2], [1, 3], [2, 3]]);
        assert_eq!(Geometry::from_names([]), Geometry::default());
    }

    #[test]
    fn letters_of_an_axis_may_be_small() {
        let direction = Direction { point: "12", axis: 5, is_negative: true };
        assert_eq!([Direction::parse("12-RZ"), Direction::parse("12-rz")], [Some(direction); 2]);
        assert_eq!((direction.node(), direction.positive_name().as_str()), (Some(12), "12+RZ"));
        assert!(is_directed_point("1-z") && !is_directed_point("a-z") && !is_directed_point("1"));
        assert_eq!(Direction::relative_sign("arm", "arm"), Some(1.0));
        assert_eq!(Direction::relative_sign("1+Z", "2+Z"), None);
    }

    #[test]
    fn a_table_has_points_and_lines_and_names_what_is_wrong() {
        let text =
            "point,x,y,z\n# corners\n1, 0, 0, 0\n2, 1.5, 0, 0\n3, 1.5, 1, 0\nline, 1, 2, 3\n";
        let geometry = Geometry::parse("frame.csv", text).unwrap();
        assert_eq!(geometry.points[1].position, [1.5, 0.0, 0.0]);
        assert_eq!(geometry.lines, [[0, 1], [1, 2]]);
        for (text, part) in [
            ("1 0 0 0\n1 1 0 0\n", "line 2: point 1 occurs twice"),
            ("1 0 0 0\nline 1 7\n", "line 2: there is no point 7"),
            ("1 0 0 0\n2 0 NaN 0\n", "line 2: a point is a name"),
            ("1 0 0 0\n2 0 0\n", "line 2: a point is a name"),
            ("\n", "holds no data"),
        ] {
            let message = Geometry::parse("g.txt", text).unwrap_err().to_string();
            assert!(message.contains(part), "{message}");
        }
    }

    #[test]
    fn entries_move_their_points_along_their_axes() {
        let geometry = Geometry::from_names(["1-Z", "2+X"]);
        let names = ["1-Z".to_owned(), "2+X".to_owned(), "2".to_owned()];
        let moved = geometry.displacement(&names, &[[1.0, 2.0], [3.0, 0.0], [5.0, 0.0]]).unwrap();
        assert_eq!(moved[0], [[0.0; 2], [0.0; 2], [-1.0, -2.0]]);
        assert_eq!(moved[1], [[3.0, 0.0], [0.0; 2], [5.0, 0.0]]);
        assert!(geometry.displacement(&["9+X".to_owned()], &[[1.0, 0.0]]).is_none());
        let rotation = geometry.displacement(&["1+RZ".to_owned()], &[[1.0, 0.0]]).unwrap();
        assert_eq!(rotation, [[[0.0; 2]; 3]; 2]);
    }

    /// Points and lines are the same after the universal file is read back. The numbers and field
    /// widths of a shape are those of the format.
    #[test]
    fn a_universal_file_keeps_points_lines_and_shapes() {
        let geometry = Geometry::parse("g", "10 0 0 0\n20 0.5 0 0.125\nline 10 20\n").unwrap();
        let shape = PointShape {
            frequency_hz: 12.5,
            damping_ratio: 0.02,
            displacement: vec![[[0.0; 2]; 3], [[1.0, 0.0], [0.0; 2], [-0.5, 0.25]]],
        };
        let text = geometry.universal_file(&[shape]);
        assert_eq!(Geometry::parse("g.unv", &text).unwrap(), geometry);
        assert!(text.lines().all(|line| line.len() <= 80));
        let lines: Vec<&str> = text.lines().collect();
        let at = lines.iter().position(|line| line.trim() == "55").unwrap();
        // The line states: structural model, complex eigenvalues, three translations, displacement,
        // complex, three values.
        assert_eq!(
            lines[at + 6].split_whitespace().collect::<Vec<_>>(),
            ["1", "3", "2", "8", "5", "3"]
        );
        let eigenvalue: Vec<f64> =
            lines[at + 8].split_whitespace().map(|v| v.parse().unwrap()).collect();
        let omega = std::f64::consts::TAU * 12.5;
        assert!((eigenvalue[0] + 0.02 * omega).abs() < 1e-4);
        assert!((eigenvalue[1] - omega * (1.0f64 - 4e-4).sqrt()).abs() < 1e-3);
        assert_eq!(lines[at + 11].trim(), "20");
        assert_eq!(lines[at + 12].len(), 78);
        assert_eq!(&lines[at + 12][..13], "  1.00000E+00");
    }
}
