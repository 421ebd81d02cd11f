//! Small drawings for the choice of a figure; the style sheet shows the numbers of their axes in
//! print only.

use crate::axis::Mapping;
use crate::canvas::{Anchor, Canvas, Stroke, TextStyle};
use crate::curve::Kind;
use crate::figure::Figure;
use crate::layout::{Layout, PanelLayout};
use crate::ticks::Ticks;
use crate::trace::{self, Mappings};

/// Size of a small drawing, px.
const SIZE: (f64, f64) = (120.0, 54.0);

/// Font size of the numbers beside a small drawing, px.
const NUMBERS: f64 = 9.0;

/// Draws the curves of the first panel.
pub(super) fn svg(figure: &Figure, layout: &Layout) -> String {
    let mut sheet = Canvas::new(SIZE.0, SIZE.1).decorative();
    if let (Some(panel), Some(layout)) = (figure.panels.first(), layout.panels.first()) {
        let maps = Mappings {
            x: Mapping::new(panel.x.scale, layout.x_range, (0.0, SIZE.0)),
            y: Mapping::new(panel.y.scale, layout.y_range, (SIZE.1 - 1.0, 1.0)),
        };
        for (curve, style) in panel.curves.iter().zip(panel.styles()) {
            let mut points = trace::map(maps, &curve.x, &curve.y);
            points = trace::thin_coarsely(points, SIZE.0 / 2.0);
            match curve.kind {
                Kind::Band => {}
                Kind::Points => sheet.dots(&points, 1.6, style.color),
                Kind::Stems => {
                    let base = trace::stem_base(maps, panel.y.scale, layout.y_range);
                    let stems = points.into_iter().map(|(x, y)| ((x, base), (x, y)));
                    sheet.segments(stems, Stroke::solid(style.color, 0.8));
                }
                Kind::Line | Kind::MarkedLine => {
                    sheet.polyline(&points, Stroke::solid(style.color, 1.0));
                }
            }
        }
        numbers(&mut sheet, layout, maps);
    }
    sheet.finish("")
}

/// Writes the first and the last number of each axis beside the drawing.
fn numbers(sheet: &mut Canvas, layout: &PanelLayout, maps: Mappings) {
    let ends = |ticks: &Ticks| {
        let factor = ticks.factor.clone().unwrap_or_default();
        let ends = [ticks.major.first(), ticks.major.last()];
        ends.map(|end| end.map(|(value, label)| (*value, format!("{label}{factor}"))))
    };
    let below = TextStyle::new(NUMBERS);
    for (value, label) in ends(&layout.x_ticks).into_iter().flatten() {
        sheet.text((maps.x.pixel(value), SIZE.1 + NUMBERS), &label, &below);
    }
    let beside = TextStyle::new(NUMBERS).anchored(Anchor::End);
    for (value, label) in ends(&layout.y_ticks).into_iter().flatten() {
        sheet.text((-2.0, maps.y.pixel(value) + 0.36 * NUMBERS), &label, &beside);
    }
}
