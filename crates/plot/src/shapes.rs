//! Mode shapes as deflected lines, and matrices as squares.

use serde::Serialize;

use crate::canvas::{Anchor, Canvas, Stroke, TextStyle};
use crate::interactive::{DrawnSet, with_metadata};
use crate::style::Color;

/// Modes to be drawn at the points of a structure.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ShapeDrawing {
    /// Name and Cartesian coordinates of each point, in one unit of length.
    pub points: Vec<(String, [f64; 3])>,
    /// Pairs of points, by their index, that a line joins.
    pub lines: Vec<[usize; 2]>,
    /// The modes.
    pub modes: Vec<DrawnMode>,
}

/// A mode to be drawn.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct DrawnMode {
    /// Name, such as `mode 1: 12.5 Hz, damping ratio 2 %`.
    pub name: String,
    /// Name under a small drawing.
    pub short_name: String,
    /// Real and imaginary part of the displacement along x, y, z, for each point; in any scale.
    pub displacement: Vec<[[f64; 2]; 3]>,
}

/// Size of the drawing, px.
const SIZE: (f64, f64) = (640.0, 340.0);

/// Size of a small drawing, px.
const SMALL: (f64, f64) = (120.0, 64.0);

/// Rotation about the vertical axis, and tilt towards the viewer, of the first view, in radians.
const VIEW: (f64, f64) = (-0.5, 0.42);

/// Colours of the lines at rest, of the deflected lines and of the points.
const COLORS: [Color; 3] = [Color::GREY, Color::BLUE, Color::VERMILION];

/// Largest displacement in the drawing, relative to the size of the structure; the script uses the
/// same value.
const DEFLECTION: f64 = 0.16;

/// Maximum fractions of the width and of the height of the canvas that the structure fills. The
/// third number is for the depth of the structure: this fraction of its horizontal extent is added
/// to its drawn height. The script uses the same values.
const FILLED: (f64, f64, f64) = (0.7, 0.8, 0.45);

/// Maximum number of points whose names are written.
const NAMED: usize = 40;

#[derive(Serialize)]
struct ShapeData<'a> {
    w: f64,
    h: f64,
    turn: f64,
    tilt: f64,
    points: Vec<[f64; 3]>,
    names: Vec<&'a str>,
    lines: &'a [[usize; 2]],
    modes: Vec<ModeData<'a>>,
    colors: [&'static str; 3],
}

#[derive(Serialize)]
struct ModeData<'a> {
    n: &'a str,
    s: Vec<[f64; 6]>,
}

impl DrawnMode {
    /// Returns the largest modulus of a displacement, or 1 if all are zero.
    fn largest(&self) -> f64 {
        let sizes = self.displacement.iter().flatten().map(|[re, im]| re.hypot(*im));
        let largest = sizes.filter(|size| size.is_finite()).fold(0.0, f64::max);
        if largest > 0.0 { largest } else { 1.0 }
    }

    fn data(&self) -> ModeData<'_> {
        let largest = self.largest();
        // Four digits of the largest value are finer than the resolution of a screen.
        let short = |value: f64| (1e4 * value / largest).round() / 1e4 + 0.0;
        let point = |by: &[[f64; 2]; 3]| {
            let [[a, b], [c, d], [e, f]] = by.map(|entry| entry.map(short));
            [a, b, c, d, e, f]
        };
        ModeData { n: &self.name, s: self.displacement.iter().map(point).collect() }
    }
}

impl ShapeDrawing {
    /// Returns whether points, lines and modes are consistent and all numbers are finite.
    fn is_drawable(&self) -> bool {
        let has_points = |pair: &[usize; 2]| pair.iter().all(|at| *at < self.points.len());
        let is_finite = |mode: &DrawnMode| {
            let mut numbers = mode.displacement.iter().flatten().flatten();
            mode.displacement.len() == self.points.len() && numbers.all(|value| value.is_finite())
        };
        !self.modes.is_empty()
            && self.lines.iter().all(has_points)
            && self.modes.iter().all(is_finite)
            && self.points.iter().all(|(_, at)| at.iter().all(|value| value.is_finite()))
    }

    /// Draws the first mode at its largest deflection on the undeformed lines, and small drawings
    /// of all modes, with the numbers for the script. The script animates the modes: complex modes
    /// appear as travelling waves. The canvas is empty if there are no modes, if a line has a
    /// missing point, if a mode has no displacement for one of the points, or if a number is not
    /// finite.
    pub fn draw(&self, label: &str) -> DrawnSet {
        let Some(first) = self.modes.first().filter(|_| self.is_drawable()) else {
            return DrawnSet { svg: Canvas::new(SIZE.0, SIZE.1).finish(label), map: Vec::new() };
        };
        let data = ShapeData {
            w: SIZE.0,
            h: SIZE.1,
            turn: VIEW.0,
            tilt: VIEW.1,
            points: self.points.iter().map(|(_, position)| *position).collect(),
            names: self.points.iter().map(|(name, _)| name.as_str()).collect(),
            lines: &self.lines,
            modes: self.modes.iter().map(DrawnMode::data).collect(),
            colors: COLORS.map(|color| color.0),
        };
        // Numbers and texts can always be serialised.
        let json = serde_json::to_string(&data).unwrap_or_default();
        let svg = self.sheet(first, SIZE, true).finish(label);
        let svg = svg.replacen("<svg ", "<svg class=\"shape\" ", 1);
        let small = |mode: &DrawnMode| {
            let sheet = self.sheet(mode, SMALL, false).decorative();
            (mode.short_name.clone(), sheet.finish(""))
        };
        DrawnSet { svg: with_metadata(&svg, &json), map: self.modes.iter().map(small).collect() }
    }

    /// Draws the real part of a mode.
    fn sheet(&self, mode: &DrawnMode, size: (f64, f64), has_words: bool) -> Canvas {
        let mut sheet = Canvas::new(size.0, size.1);
        let view = View::new(&self.points, size);
        let [rest, deflected, points] = COLORS;
        let factor = DEFLECTION * view.size / mode.largest();
        let undeformed: Vec<[f64; 3]> = self.points.iter().map(|(_, position)| *position).collect();
        let moved: Vec<[f64; 3]> = undeformed
            .iter()
            .zip(&mode.displacement)
            .map(|(at, by)| [0, 1, 2].map(|axis| at[axis] + factor * by[axis][0]))
            .collect();
        let mut lines = |positions: &[[f64; 3]], stroke: Stroke| {
            let ends = |pair: &[usize; 2]| {
                let [a, b] = pair.map(|k| view.project(positions[k]));
                (a, b)
            };
            sheet.segments(self.lines.iter().map(ends), stroke);
        };
        lines(&undeformed, Stroke::solid(rest, if has_words { 1.0 } else { 0.6 }));
        lines(&moved, Stroke::solid(deflected, if has_words { 2.0 } else { 1.2 }));
        let spots: Vec<(f64, f64)> = moved.iter().map(|at| view.project(*at)).collect();
        sheet.discs(&spots, if has_words { 3.0 } else { 1.6 }, points);
        if has_words && spots.len() <= NAMED {
            let style = TextStyle::new(11.5).anchored(Anchor::Start);
            for ((x, y), (name, _)) in spots.iter().zip(&self.points) {
                sheet.text((x + 7.0, y - 6.0), name, &style);
            }
        }
        sheet
    }
}

/// Parallel projection of a structure onto a sheet.
struct View {
    middle: [f64; 3],
    size: f64,
    unit: f64,
    sheet: (f64, f64),
}

impl View {
    fn new(points: &[(String, [f64; 3])], sheet: (f64, f64)) -> Self {
        let ends = [0, 1, 2].map(|axis| {
            let values = points.iter().map(|(_, position)| position[axis]);
            values.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(v), b.max(v)])
        });
        let size = ends.iter().map(|[low, high]| high - low).fold(0.0, f64::max);
        let middle = ends.map(|[low, high]| f64::midpoint(low, high));
        let size = if size > 0.0 { size } else { 1.0 };
        let [x, y, tall] = ends.map(|[low, high]| (high - low) / size);
        let flat = if x.hypot(y) > 0.0 { x.hypot(y) } else { 1.0 };
        let (wide, high, deep) = FILLED;
        let unit = (wide * sheet.0 / flat).min(high * sheet.1 / (tall + deep * flat));
        Self { middle, size, unit, sheet }
    }

    fn project(&self, at: [f64; 3]) -> (f64, f64) {
        let [x, y, z] = [0, 1, 2].map(|axis| (at[axis] - self.middle[axis]) / self.size);
        let (turn, tilt) = VIEW;
        let (w, h) = self.sheet;
        let unit = self.unit;
        let depth = turn.sin() * x + turn.cos() * y;
        (
            w / 2.0 + unit * (turn.cos() * x - turn.sin() * y),
            h / 2.0 - unit * (z * tilt.cos() + depth * tilt.sin()),
        )
    }
}

/// Maximum number of modes for which each square of a drawn matrix contains its value; with more
/// modes, the values do not fit into the squares.
const NUMBERED: usize = 20;

/// Draws a matrix of pure numbers from 0 to 1, row by row, as one square for each number, with the
/// number in it; squares of larger numbers are darker.
pub fn matrix_of_squares(values: &[Vec<f64>], label: &str) -> String {
    const EDGE: f64 = 34.0;
    let (rows, columns) = (values.len(), values.iter().map(Vec::len).max().unwrap_or(0));
    let longest = rows.max(columns);
    let side = (440.0 / longest.max(1) as f64).clamp(14.0, 46.0);
    let at = |k: usize| EDGE + side * k as f64;
    let (width, height) = (at(columns) + 8.0, at(rows) + 8.0);
    let mut sheet = Canvas::new(width.max(160.0), height);
    let words = TextStyle::new(11.5);
    let every = (18.0 / side).ceil().max(1.0) as usize;
    for column in (0..columns).step_by(every) {
        let middle = at(column) + side / 2.0;
        sheet.text((middle, EDGE - 7.0), &(column + 1).to_string(), &words);
    }
    for row in (0..rows).step_by(every) {
        let middle = at(row) + side / 2.0;
        sheet.text((EDGE - 14.0, middle + 4.0), &(row + 1).to_string(), &words);
    }
    for (row, entries) in values.iter().enumerate() {
        for column in 0..columns {
            let value = entries.get(column).copied().unwrap_or(0.0);
            // The colour stays light enough for dark digits.
            sheet.open_faded(0.06 + 0.4 * value);
            let corner = (at(column) + 1.0, at(row) + 1.0);
            sheet.rect(corner, (side - 2.0, side - 2.0), Some(Color::BLUE), None);
            sheet.close_group();
            if longest <= NUMBERED {
                let style = TextStyle::new(if side > 30.0 { 11.5 } else { 9.0 });
                let (x, y) = (at(column) + side / 2.0, at(row) + side / 2.0 + 4.0);
                let digits = if side > 30.0 { 2 } else { 1 };
                sheet.text((x, y), &format!("{value:.digits$}"), &style);
            }
        }
    }
    sheet.finish(label)
}
