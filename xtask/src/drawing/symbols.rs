//! Symbols of mechanical sketches: springs, dashpots, grounds, arrows.

use mechid::plot::{Canvas, Color, Point, Stroke};

/// Stroke of the outlines of parts.
pub const PART: Stroke = Stroke::solid(Color::DARK, 1.6);
/// Thin lines: hatching, axes, dimensions.
pub const THIN: Stroke = Stroke::solid(Color::DARK, 0.9);

/// A frame of reference along a line: a point is `along` px from the start and `across` px to its
/// right.
#[derive(Debug, Clone, Copy)]
struct Rail {
    start: Point,
    unit: Point,
    length: f64,
}

impl Rail {
    fn new(from: Point, to: Point) -> Self {
        let (dx, dy) = (to.0 - from.0, to.1 - from.1);
        // Two equal points have no direction; a millionth of a pixel is invisible and avoids a
        // division by zero.
        let length = dx.hypot(dy).max(1e-6);
        Rail { start: from, unit: (dx / length, dy / length), length }
    }

    fn at(&self, along: f64, across: f64) -> Point {
        let (ux, uy) = self.unit;
        (self.start.0 + along * ux - across * uy, self.start.1 + along * uy + across * ux)
    }
}

/// A coil spring between two points.
pub fn spring(sheet: &mut Canvas, from: Point, to: Point) {
    const TURNS: usize = 5;
    const WIDTH: f64 = 8.0;
    let rail = Rail::new(from, to);
    let lead = 0.2 * rail.length;
    let pitch = (rail.length - 2.0 * lead) / (2 * TURNS) as f64;
    let mut points = vec![from, rail.at(lead, 0.0)];
    for half in 0..2 * TURNS {
        let side = if half % 2 == 0 { WIDTH } else { -WIDTH };
        points.push(rail.at(lead + (half as f64 + 0.5) * pitch, side));
    }
    points.extend([rail.at(rail.length - lead, 0.0), to]);
    sheet.polyline(&points, PART);
}

/// A viscous dashpot between two points.
pub fn dashpot(sheet: &mut Canvas, from: Point, to: Point) {
    const WIDTH: f64 = 9.0;
    let rail = Rail::new(from, to);
    let (bottom, piston, rim) = (0.36 * rail.length, 0.5 * rail.length, 0.66 * rail.length);
    sheet.line(from, rail.at(bottom, 0.0), PART);
    sheet.polyline(
        &[
            rail.at(rim, -WIDTH),
            rail.at(bottom, -WIDTH),
            rail.at(bottom, WIDTH),
            rail.at(rim, WIDTH),
        ],
        PART,
    );
    sheet.line(
        rail.at(piston, 0.75 - WIDTH),
        rail.at(piston, WIDTH - 0.75),
        Stroke { width: 2.6, ..PART },
    );
    sheet.line(rail.at(piston, 0.0), to, PART);
}

/// Fixed ground along a line, hatched on its left as seen from `from`.
pub fn ground(sheet: &mut Canvas, from: Point, to: Point) {
    const STEP: f64 = 9.0;
    let rail = Rail::new(from, to);
    sheet.line(from, to, PART);
    let count = (rail.length / STEP).floor() as usize;
    for index in 1..=count {
        let along = index as f64 * STEP;
        sheet.line(rail.at(along, 0.0), rail.at(along - 8.0, -8.0), THIN);
    }
}

/// The head of an arrow that comes from `from` and ends at `tip`.
pub fn arrow_head(sheet: &mut Canvas, from: Point, tip: Point, length: f64, color: Color) {
    let rail = Rail::new(tip, from);
    let half = 0.42 * length;
    sheet.polygon(
        &[tip, rail.at(length, half), rail.at(0.75 * length, 0.0), rail.at(length, -half)],
        Some(color),
        None,
    );
}

/// An arrow.
pub fn arrow(sheet: &mut Canvas, from: Point, to: Point, color: Color, width: f64) {
    let head = 5.0 + 3.0 * width;
    let rail = Rail::new(from, to);
    // The shaft ends inside the head, since its blunt end would show at the tip.
    sheet.line(
        from,
        rail.at((rail.length - 0.7 * head).max(0.0), 0.0),
        Stroke::solid(color, width),
    );
    arrow_head(sheet, from, to, head, color);
}

/// A rectangle with round corners.
pub fn rounded(
    sheet: &mut Canvas,
    (x, y): Point,
    (w, h): Point,
    r: f64,
    fill: Color,
    stroke: Stroke,
) {
    let path = format!(
        "M{:.2} {y:.2}h{:.2}q{r:.2} 0 {r:.2} {r:.2}v{:.2}q0 {r:.2} -{r:.2} {r:.2}h-{:.2}q-{r:.2} 0 -{r:.2} -{r:.2}v-{:.2}q0 -{r:.2} {r:.2} -{r:.2}z",
        x + r,
        w - 2.0 * r,
        h - 2.0 * r,
        w - 2.0 * r,
        h - 2.0 * r
    );
    sheet.path(&path, Some(fill), Some(stroke));
}

/// A rectangle hatched at 45°, as cut parts are.
pub fn hatched(sheet: &mut Canvas, corner: Point, size: Point, fill: Color) {
    const STEP: f64 = 8.0;
    sheet.rect(corner, size, Some(fill), None);
    sheet.open_clip(corner, size);
    let reach = size.0 + size.1;
    let count = (reach / STEP).ceil() as usize;
    for index in 0..=count {
        let x = corner.0 + index as f64 * STEP;
        sheet.line((x, corner.1), (x - size.1, corner.1 + size.1), Stroke::solid(Color::GREY, 0.7));
    }
    sheet.close_group();
    sheet.rect(corner, size, None, Some(PART));
}
