//! Drawing of a figure whose layout is known.

use crate::axis::NEPER;
use crate::canvas::{Anchor, Canvas, Point, Stroke, TextStyle};
use crate::curve::{Curve, Kind};
use crate::figure::Figure;
use crate::layout::{Layout, PanelLayout, Place, TICK};
use crate::legend;
use crate::marks::{BAND_OPACITY, LEAST_RADIUS, marker, marker_radius};
use crate::panel::Panel;
use crate::style::{Color, LABEL_SIZE, Marker, PANEL_TITLE_SIZE, Resolved, TICK_SIZE, TITLE_SIZE};
use crate::trace;

/// Height of the middle of a digit above the baseline, as a fraction of the font size.
const MIDDLE: f64 = 0.36;

const GRID: Stroke = Stroke::solid(Color::GRID, 0.8);
const FINE_GRID: Stroke = Stroke::solid(Color::FINE_GRID, 0.7);
const FRAME: Stroke = Stroke::solid(Color::DARK, 0.9);

pub(crate) fn figure(figure: &Figure, layout: &Layout, sheet: &mut Canvas) {
    if !figure.title.is_empty() {
        sheet.text((layout.size.0 / 2.0, 24.0), &figure.title, &TextStyle::new(TITLE_SIZE).bold());
    }
    let edge = 10.0;
    legend::draw_strip(sheet, &layout.strip, (edge, layout.strip_top), layout.size.0 - 2.0 * edge);
    for (content, place) in figure.panels.iter().zip(&layout.panels) {
        panel(content, place, sheet);
    }
}

fn panel(panel: &Panel, layout: &PanelLayout, sheet: &mut Canvas) {
    sheet.open_group("panel", &panel.title);
    grid(layout, sheet);
    sheet.open_clip(layout.corner, layout.size);
    references(panel, layout, sheet);
    let styles = panel.styles();
    // Bands are drawn below all lines, regardless of their order.
    let (bands, lines): (Vec<_>, Vec<_>) =
        panel.curves.iter().zip(styles).partition(|(curve, _)| curve.kind == Kind::Band);
    for (curve, style) in bands.into_iter().chain(lines) {
        sheet.open_group("curve", &curve.label);
        draw_curve(panel, layout, curve, style, sheet);
        sheet.close_group();
    }
    sheet.close_group();
    sheet.rect(layout.corner, layout.size, None, Some(FRAME));
    axes(panel, layout, sheet);
    match layout.place {
        Place::Nowhere => {}
        Place::Inside(at) => legend::draw_box(sheet, &layout.entries, at),
        Place::Above => {
            let width = layout.size.0;
            let top = layout.corner.1 - legend::strip_height(&layout.entries, width);
            legend::draw_strip(sheet, &layout.entries, (layout.corner.0, top), width);
        }
    }
    sheet.close_group();
}

fn grid(layout: &PanelLayout, sheet: &mut Canvas) {
    let ((left, top), (width, height)) = (layout.corner, layout.size);
    let across = |y: f64| ((left, y), (left + width, y));
    let down = |x: f64| ((x, top), (x, top + height));
    let (x, y) = (layout.maps.x, layout.maps.y);
    let lines = |values: &mut dyn Iterator<Item = f64>,
                 stroke: Stroke,
                 vertical: bool,
                 sheet: &mut Canvas| {
        let line = |value| if vertical { down(x.pixel(value)) } else { across(y.pixel(value)) };
        sheet.segments(values.map(line), stroke);
    };
    lines(&mut layout.x_ticks.minor.iter().copied(), FINE_GRID, true, sheet);
    lines(&mut layout.y_ticks.minor.iter().copied(), FINE_GRID, false, sheet);
    lines(&mut layout.x_ticks.major.iter().map(|tick| tick.0), GRID, true, sheet);
    lines(&mut layout.y_ticks.major.iter().map(|tick| tick.0), GRID, false, sheet);
}

fn references(panel: &Panel, layout: &PanelLayout, sheet: &mut Canvas) {
    let ((left, top), (width, height)) = (layout.corner, layout.size);
    for reference in &panel.references {
        sheet.open_group("reference", &reference.label);
        let stroke = legend::reference_stroke(reference);
        if reference.horizontal {
            let y = layout.maps.y.pixel(reference.value);
            sheet.line((left, y), (left + width, y), stroke);
        } else {
            let x = layout.maps.x.pixel(reference.value);
            sheet.line((x, top), (x, top + height), stroke);
        }
        sheet.close_group();
    }
}

fn draw_curve(
    panel: &Panel,
    layout: &PanelLayout,
    curve: &Curve,
    style: Resolved,
    sheet: &mut Canvas,
) {
    let points = trace::map(layout.maps, &curve.x, &curve.y);
    let stroke = Stroke { color: style.color, width: style.width, dash: style.dash };
    if curve.kind == Kind::Band {
        let width = layout.size.0;
        let mut edge = trace::thin_out(trace::map(layout.maps, &curve.x, &curve.upper), width);
        edge.reverse();
        let points = trace::thin_out(points, width);
        sheet.open_faded(BAND_OPACITY);
        sheet.polygon(&[points, edge].concat(), Some(style.color), None);
        sheet.close_group();
        return;
    }
    if !curve.error.is_empty() {
        error_band(panel, layout, curve, style.color, sheet);
    }
    let radius = marker_radius(layout.size.0, points.len());
    if curve.kind == Kind::Stems {
        draw_stems(panel, layout, &points, style.color, sheet);
    }
    if curve.has_markers() && (curve.kind != Kind::Stems || radius > LEAST_RADIUS) {
        let markers = trace::thin_markers(points.clone(), layout.size.0, radius);
        match style.marker {
            Marker::Circle if markers.len() > MANY => {
                sheet.dots(&markers, 2.0 * radius, style.color);
            }
            Marker::Circle => sheet.discs(&markers, radius, style.color),
            shape => markers
                .into_iter()
                .for_each(|point| marker(sheet, shape, point, radius, style.color)),
        }
    }
    if curve.has_line() {
        let line =
            if curve.kind == Kind::Line { trace::thin_out(points, layout.size.0) } else { points };
        sheet.polyline(&line, stroke);
    }
}

/// Maximum number of circles that are drawn one by one; more circles are drawn as one path, which
/// needs only a third of the characters in the file.
const MANY: usize = 400;

/// Half-width of an error band, in standard errors.
const ERRORS: f64 = 2.0;

/// Shades ± 2 standard errors; for levels in decibels, these are standard errors of the magnitude.
/// An edge that is zero or negative has no logarithm and is drawn at the bottom.
fn error_band(
    panel: &Panel,
    layout: &PanelLayout,
    curve: &Curve,
    color: Color,
    sheet: &mut Canvas,
) {
    let by = |error: f64| {
        if panel.y.is_decibel() { NEPER * (error / NEPER).ln_1p() } else { error }
    };
    let edge = |sign: f64| {
        let edge = curve.y.iter().zip(&curve.error).map(|(y, error)| y + by(sign * ERRORS * error));
        let lowest = layout.y_range.0;
        edge.map(|y| if y.is_finite() { y.max(lowest) } else { lowest }).collect::<Vec<f64>>()
    };
    let [lower, mut upper] = [-1.0, 1.0]
        .map(|sign| trace::thin_out(trace::map(layout.maps, &curve.x, &edge(sign)), layout.size.0));
    upper.reverse();
    sheet.open_faded(BAND_OPACITY);
    sheet.polygon(&[lower, upper].concat(), Some(color), None);
    sheet.close_group();
}

fn draw_stems(
    panel: &Panel,
    layout: &PanelLayout,
    points: &[Point],
    color: Color,
    sheet: &mut Canvas,
) {
    let base = trace::stem_base(layout.maps, panel.y.scale, layout.y_range);
    let stems = trace::thin_stems(points, base);
    // Hundreds of wide stems would merge into one area.
    let width = (layout.size.0 / stems.len() as f64 * 0.5).clamp(0.5, 1.3);
    let stems = stems.into_iter().map(|(x, y)| ((x, base), (x, y)));
    sheet.segments(stems, Stroke::solid(color, width));
}

fn axes(panel: &Panel, layout: &PanelLayout, sheet: &mut Canvas) {
    let ((left, top), (width, height)) = (layout.corner, layout.size);
    let (right, bottom) = (left + width, top + height);
    let small = TextStyle::new(TICK_SIZE);
    let end = small.anchored(Anchor::End);
    for (value, label) in &layout.x_ticks.major {
        let x = layout.maps.x.pixel(*value);
        sheet.line((x, bottom), (x, bottom + TICK), FRAME);
        if layout.labels_x {
            sheet.text((x, bottom + TICK + 3.0 + TICK_SIZE), label, &small);
        }
    }
    for (value, label) in &layout.y_ticks.major {
        let y = layout.maps.y.pixel(*value);
        sheet.line((left - TICK, y), (left, y), FRAME);
        sheet.text((left - TICK - 4.0, y + MIDDLE * TICK_SIZE), label, &end);
    }
    let caption = TextStyle::new(LABEL_SIZE);
    if layout.labels_x {
        let y = bottom + TICK + TICK_SIZE + 7.0 + LABEL_SIZE + 2.0;
        sheet.text((left + width / 2.0, y), &panel.x.caption(), &caption);
        if let Some(factor) = &layout.x_ticks.factor {
            sheet.text((right, y), factor, &end);
        }
    }
    if let Some(factor) = &layout.y_ticks.factor {
        sheet.text((left - TICK, top - 6.0), factor, &small.anchored(Anchor::Start));
    }
    let vertical = TextStyle { vertical: true, ..caption };
    sheet.text((layout.y_caption_x, top + height / 2.0), &panel.y.caption(), &vertical);
    if layout.titled {
        let above = if layout.place == Place::Above {
            legend::strip_height(&layout.entries, width)
        } else {
            0.0
        };
        sheet.text(
            (left + width / 2.0, top - above - 8.0),
            &panel.title,
            &TextStyle::new(PANEL_TITLE_SIZE).bold(),
        );
    }
}
