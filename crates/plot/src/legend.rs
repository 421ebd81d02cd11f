//! Legends: their entries, and positions where they hide no curve.

use crate::canvas::{Anchor, Canvas, Point, Stroke, TextStyle};
use crate::curve::{Kind, Reference};
use crate::marks;
use crate::panel::Panel;
use crate::style::{Color, LABEL_SIZE, Resolved};
use crate::text::{Weight, text_width};
use crate::trace::{Segment, meets};

/// Height of a row, px.
const ROW: f64 = 18.0;
/// Length of the sample of a line in a legend, px.
const LINE_SAMPLE: f64 = 36.0;
/// Length of the sample of a marker without a line in a legend, px.
const POINT_SAMPLE: f64 = 12.0;
/// Distance between the sample of a line or marker and its label, px.
const GAP: f64 = 7.0;
/// Distance between two entries in a row, px.
const BETWEEN: f64 = 20.0;
/// Distance between the entries and the edge of a box, px.
const PADDING: f64 = 7.0;
/// Font size of the labels, px.
const TEXT: f64 = LABEL_SIZE - 1.0;

/// Sample of a line or marker, to the left of a legend label.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Sample {
    Curve(Kind, Resolved),
    Line(Stroke),
}

/// Label of a legend, with its sample of a line or marker.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Entry {
    label: String,
    sample: Sample,
}

impl Entry {
    fn sample_length(&self) -> f64 {
        match self.sample {
            Sample::Curve(Kind::Points | Kind::Stems, _) => POINT_SAMPLE,
            _ => LINE_SAMPLE,
        }
    }

    fn width(&self) -> f64 {
        self.sample_length() + GAP + text_width(&self.label, TEXT, Weight::Regular)
    }

    /// Draws the entry from `x` on, with its label `indent` further to the right.
    fn draw(&self, sheet: &mut Canvas, (x, y): Point, indent: f64) {
        let length = self.sample_length();
        let start = x + (indent - length) / 2.0;
        match self.sample {
            Sample::Curve(kind, style) => marks::sample(sheet, kind, style, (start, y), length),
            Sample::Line(stroke) => sheet.line((start, y), (start + length, y), stroke),
        }
        let style = TextStyle::new(TEXT).anchored(Anchor::Start);
        sheet.text((x + indent + GAP, y + 0.36 * TEXT), &self.label, &style);
    }
}

/// Label of the bands around curves with standard errors; the script has the same label.
const BAND: &str = "± 2 standard errors";

/// Returns the entries of a panel: its labelled curves, the bands around them, then its labelled
/// reference lines.
pub(crate) fn entries(panel: &Panel) -> Vec<Entry> {
    let curves = panel.curves.iter().zip(panel.styles()).map(|(curve, style)| Entry {
        label: curve.label.clone(),
        sample: Sample::Curve(curve.kind, style),
    });
    let banded = panel.curves.iter().zip(panel.styles()).find(|(curve, _)| !curve.error.is_empty());
    let band = banded.map(|(_, style)| Entry {
        label: BAND.to_owned(),
        sample: Sample::Curve(Kind::Band, style),
    });
    let references = panel.references.iter().map(|reference| Entry {
        label: reference.label.clone(),
        sample: Sample::Line(reference_stroke(reference)),
    });
    curves.chain(band).chain(references).filter(|entry| !entry.label.is_empty()).collect()
}

/// Returns the entries of several panels, each label once.
pub(crate) fn union<'a>(panels: impl Iterator<Item = &'a Panel>) -> Vec<Entry> {
    let mut union: Vec<Entry> = Vec::new();
    for entry in panels.flat_map(entries) {
        if !union.iter().any(|known| known.label == entry.label) {
            union.push(entry);
        }
    }
    union
}

pub(crate) fn reference_stroke(reference: &Reference) -> Stroke {
    Stroke { color: reference.color, width: 1.1, dash: reference.dash }
}

/// Returns the width of the widest sample of a line or marker in a legend with one entry per row.
fn indent(entries: &[Entry]) -> f64 {
    entries.iter().map(Entry::sample_length).fold(0.0, f64::max)
}

/// Returns the size of a legend inside a panel, with one entry per row.
pub(crate) fn box_size(entries: &[Entry]) -> Point {
    let label = |entry: &Entry| entry.width() - entry.sample_length();
    let widest = entries.iter().map(label).fold(0.0, f64::max);
    (indent(entries) + widest + 2.0 * PADDING, ROW * entries.len() as f64 + 2.0 * PADDING - 4.0)
}

/// Returns the top left corner of a legend, a box of the size `legend`, at a position where the
/// legend hides none of the segments `drawn`; `None` if there is no such position. The box is
/// inside the frame, which begins at `corner` and has the size `size`.
pub(crate) fn free_place(
    corner: Point,
    size: Point,
    legend: Point,
    drawn: &[Segment],
) -> Option<Point> {
    const INSET: f64 = 9.0;
    const CLEARANCE: f64 = 6.0;
    let (free_x, free_y) = (size.0 - legend.0 - 2.0 * INSET, size.1 - legend.1 - 2.0 * INSET);
    if free_x < 0.0 || free_y < 0.0 {
        return None;
    }
    // The usual positions come first: the corners, right before left, then the middles of the
    // sides.
    let places = [
        (1.0, 0.0),
        (0.0, 0.0),
        (1.0, 1.0),
        (0.0, 1.0),
        (1.0, 0.5),
        (0.0, 0.5),
        (0.5, 0.0),
        (0.5, 1.0),
    ];
    places
        .into_iter()
        .map(|(across, down)| {
            (corner.0 + INSET + across * free_x, corner.1 + INSET + down * free_y)
        })
        .find(|(left, top)| {
            let low = (left - CLEARANCE, top - CLEARANCE);
            let high = (left + legend.0 + CLEARANCE, top + legend.1 + CLEARANCE);
            !drawn.iter().any(|segment| meets(*segment, low, high))
        })
}

/// Draws a legend inside a panel.
pub(crate) fn draw_box(sheet: &mut Canvas, entries: &[Entry], (x, y): Point) {
    let edge = Stroke::solid(Color::LIGHT, 0.7);
    sheet.rect((x, y), box_size(entries), Some(Color::WHITE), Some(edge));
    for (row, entry) in entries.iter().enumerate() {
        entry.draw(
            sheet,
            (x + PADDING, y + PADDING - 2.0 + ROW * (row as f64 + 0.5)),
            indent(entries),
        );
    }
}

/// Returns the entries of each row of a legend with this width, by index.
fn rows(entries: &[Entry], width: f64) -> Vec<std::ops::Range<usize>> {
    let mut rows: Vec<std::ops::Range<usize>> = Vec::new();
    let mut used = f64::INFINITY;
    for (index, entry) in entries.iter().enumerate() {
        let more = BETWEEN + entry.width();
        match rows.last_mut() {
            Some(row) if used + more <= width => {
                row.end = index + 1;
                used += more;
            }
            _ => {
                rows.push(index..index + 1);
                used = entry.width();
            }
        }
    }
    rows
}

/// Returns the height of a legend above a panel or a figure.
pub(crate) fn strip_height(entries: &[Entry], width: f64) -> f64 {
    let rows = rows(entries, width).len();
    if rows == 0 { 0.0 } else { ROW * rows as f64 + 6.0 }
}

/// Draws a legend in centred rows from the top left corner `at`.
pub(crate) fn draw_strip(sheet: &mut Canvas, entries: &[Entry], at: Point, width: f64) {
    for (row, range) in rows(entries, width).into_iter().enumerate() {
        let members = &entries[range];
        let total: f64 =
            members.iter().map(Entry::width).sum::<f64>() + BETWEEN * (members.len() - 1) as f64;
        let mut x = at.0 + (width - total) / 2.0;
        for entry in members {
            entry.draw(sheet, (x, at.1 + ROW * (row as f64 + 0.5)), entry.sample_length());
            x += entry.width() + BETWEEN;
        }
    }
}
