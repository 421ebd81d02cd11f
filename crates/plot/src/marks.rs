//! Markers, and the samples of curves that legends show.

use crate::canvas::{Canvas, Point, Stroke};
use crate::curve::Kind;
use crate::style::{Color, Marker, Resolved};

/// Opacity of a shaded band.
pub(crate) const BAND_OPACITY: f64 = 0.22;

/// Minimum radius of a marker, px; stems so close together that their markers would be at most this
/// large are drawn without markers.
pub(crate) const LEAST_RADIUS: f64 = 1.4;

/// Returns the radius, in px, at which `count` markers do not overlap in a panel of this width.
pub(crate) fn marker_radius(width: f64, count: usize) -> f64 {
    (0.45 * width / count as f64).clamp(LEAST_RADIUS, 3.6)
}

/// Draws a marker whose extent is about `radius` on each side.
pub(crate) fn marker(sheet: &mut Canvas, marker: Marker, (x, y): Point, radius: f64, color: Color) {
    let r = radius;
    let open = Some(Stroke::solid(color, 0.45 * r));
    match marker {
        Marker::Circle => sheet.circle((x, y), r, Some(color), None),
        Marker::Square => {
            sheet.rect((x - 0.88 * r, y - 0.88 * r), (1.76 * r, 1.76 * r), Some(color), None)
        }
        Marker::Diamond => {
            sheet.polygon(
                &[(x, y - 1.3 * r), (x + 1.3 * r, y), (x, y + 1.3 * r), (x - 1.3 * r, y)],
                Some(color),
                None,
            );
        }
        Marker::Triangle => {
            sheet.polygon(
                &[(x, y - 1.3 * r), (x + 1.15 * r, y + 0.8 * r), (x - 1.15 * r, y + 0.8 * r)],
                Some(color),
                None,
            );
        }
        Marker::TriangleDown => {
            sheet.polygon(
                &[(x, y + 1.3 * r), (x + 1.15 * r, y - 0.8 * r), (x - 1.15 * r, y - 0.8 * r)],
                Some(color),
                None,
            );
        }
        Marker::Cross | Marker::Plus => {
            let (a, b) = if marker == Marker::Cross { (r, r) } else { (1.3 * r, 0.0) };
            let path = format!(
                "M{:.2} {:.2}L{:.2} {:.2}M{:.2} {:.2}L{:.2} {:.2}",
                x - a,
                y - b,
                x + a,
                y + b,
                x - b,
                y + a,
                x + b,
                y - a
            );
            sheet.path(&path, None, open);
        }
    }
}

/// Draws the sample of a curve in a legend: `length` px from `at` to the right.
pub(crate) fn sample(sheet: &mut Canvas, kind: Kind, style: Resolved, at: Point, length: f64) {
    let middle = (at.0 + length / 2.0, at.1);
    match kind {
        Kind::Band => {
            sheet.open_faded(BAND_OPACITY);
            sheet.rect((at.0, at.1 - 5.0), (length, 10.0), Some(style.color), None);
            sheet.close_group();
        }
        Kind::Stems => sheet.line(
            (middle.0, at.1 + 6.0),
            (middle.0, at.1 - 3.0),
            Stroke::solid(style.color, 1.3),
        ),
        Kind::Line | Kind::MarkedLine => {
            let stroke = Stroke { color: style.color, width: style.width, dash: style.dash };
            sheet.line(at, (at.0 + length, at.1), stroke);
        }
        Kind::Points => {}
    }
    match kind {
        Kind::MarkedLine | Kind::Points => marker(sheet, style.marker, middle, 3.4, style.color),
        Kind::Stems => marker(sheet, style.marker, (middle.0, at.1 - 3.0), 2.6, style.color),
        Kind::Line | Kind::Band => {}
    }
}
