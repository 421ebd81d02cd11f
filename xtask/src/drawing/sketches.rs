//! The dissertation's model sketches, figures 4.2.1 to 4.2.3, drawn from the description of the
//! models in its text.

use mechid::plot::{Anchor, Canvas, Color, Point, Stroke, TextStyle};

use super::symbols::{PART, THIN, arrow, dashpot, ground, hatched, spring};

const STEEL: Color = Color("#dfe7ee");
const OIL: Color = Color("#fbe3b5");
const LABEL: TextStyle = TextStyle::new(15.0).italic();
const NOTE: TextStyle = TextStyle::new(12.5);
const FORCE: Color = Color::VERMILION;
const MOTION: Color = Color::BLUE;

/// Figure 4.2.1: mass on spring and dashpot.
pub fn mass_spring_damper() -> String {
    let mut sheet = Canvas::new(560.0, 270.0);
    title(&mut sheet, 280.0, "Single degree of freedom: mass, spring and viscous damper");
    let (wall, floor, left, right, top) = (60.0, 226.0, 260.0, 400.0, 96.0);
    ground(&mut sheet, (wall, floor), (wall, 76.0));
    ground(&mut sheet, (480.0, floor), (wall, floor));
    spring(&mut sheet, (wall, 128.0), (left, 128.0));
    dashpot(&mut sheet, (wall, 184.0), (left, 184.0));
    for wheel in [left + 30.0, right - 30.0] {
        sheet.circle((wheel, floor - 8.0), 7.2, Some(Color::WHITE), Some(PART));
    }
    sheet.rect((left, top), (right - left, floor - 16.0 - top), Some(STEEL), Some(PART));
    sheet.text(((left + right) / 2.0, 160.0), "M", &TextStyle::new(19.0).italic());
    sheet.text((160.0, 110.0), "K", &LABEL);
    sheet.text((160.0, 214.0), "C", &LABEL);
    arrow(&mut sheet, (right, 153.0), (right + 74.0, 153.0), FORCE, 2.0);
    sheet.text((right + 82.0, 158.0), "F(t)", &LABEL.colored(FORCE).anchored(Anchor::Start));
    displacement(&mut sheet, (left + 70.0, top - 18.0), (1.0, 0.0), "X(t)");
    sheet.finish("Mass, spring and viscous damper")
}

/// Figure 4.2.2: rigid shaft on two supports, loaded through a journal bearing at mid-span.
pub fn shaft_and_bearing() -> String {
    let mut sheet = Canvas::new(900.0, 430.0);
    title(&mut sheet, 450.0, "Rigid shaft on two supports with a journal bearing at mid-span");
    sheet.text((290.0, 62.0), "along the shaft", &NOTE.colored(Color::GREY));
    sheet.text((700.0, 62.0), "across the bearing", &NOTE.colored(Color::GREY));
    side_view(&mut sheet);
    cross_section(&mut sheet);
    sheet.finish("Rigid shaft with a journal bearing")
}

/// Shaft, its two supports and the pulled bearing housing on its spring.
fn side_view(sheet: &mut Canvas) {
    let (axis, middle, floor) = (210.0, 290.0, 380.0);
    for support in [90.0, 490.0] {
        sheet.polygon(
            &[
                (support - 10.0, axis + 26.0),
                (support + 10.0, axis + 26.0),
                (support + 26.0, floor),
                (support - 26.0, floor),
            ],
            Some(Color::WHITE),
            Some(PART),
        );
        sheet.rect((support - 20.0, axis - 26.0), (40.0, 52.0), Some(STEEL), Some(PART));
    }
    ground(sheet, (540.0, floor), (40.0, floor));
    // Housing cut open: steel, oil film, shaft, oil film, steel.
    hatched(sheet, (middle - 58.0, axis - 62.0), (116.0, 124.0), STEEL);
    sheet.rect((middle - 58.0, axis - 24.0), (116.0, 48.0), Some(OIL), Some(THIN));
    sheet.rect((40.0, axis - 15.0), (500.0, 30.0), Some(Color("#eef2f6")), Some(PART));
    center_line(sheet, (26.0, axis), (554.0, axis));
    spring(sheet, (middle, axis + 62.0), (middle, floor));
    sheet.text((middle + 16.0, 332.0), "K_{sy}", &LABEL.anchored(Anchor::Start));
    arrow(sheet, (middle, axis - 62.0), (middle, 84.0), FORCE, 2.0);
    sheet.text((middle + 10.0, 98.0), "F_{y}(t)", &LABEL.colored(FORCE).anchored(Anchor::Start));
    sheet.text((180.0, axis - 24.0), "rigid shaft", &NOTE);
    leader(sheet, (middle + 40.0, axis + 20.0), (middle + 96.0, axis + 66.0));
    sheet.text((middle + 100.0, axis + 76.0), "oil film", &NOTE.anchored(Anchor::Start));
    leader(sheet, (middle + 50.0, axis - 50.0), (middle + 96.0, axis - 84.0));
    sheet.text((middle + 100.0, axis - 84.0), "bearing housing, M", &NOTE.anchored(Anchor::Start));
    sheet.text((90.0, axis - 38.0), "support", &NOTE);
    sheet.text((490.0, axis - 38.0), "support", &NOTE);
}

/// Journal in the clearance of the housing, and the housing on its two springs.
fn cross_section(sheet: &mut Canvas) {
    let (x, y, floor, wall) = (720.0, 210.0, 380.0, 590.0);
    ground(sheet, (850.0, floor), (620.0, floor));
    ground(sheet, (wall, 270.0), (wall, 150.0));
    spring(sheet, (x, y + 62.0), (x, floor));
    spring(sheet, (wall, y), (x - 62.0, y));
    hatched(sheet, (x - 62.0, y - 62.0), (124.0, 124.0), STEEL);
    sheet.circle((x, y), 46.0, Some(OIL), Some(PART));
    // The journal runs off centre, where the film carries its load.
    sheet.circle((x + 5.0, y + 7.0), 34.0, Some(Color("#eef2f6")), Some(PART));
    turning(sheet, (x + 5.0, y + 7.0), 22.0);
    sheet.text((x + 16.0, 332.0), "K_{sy}", &LABEL.anchored(Anchor::Start));
    sheet.text((wall + 34.0, y - 20.0), "K_{sx}", &LABEL);
    arrow(sheet, (x + 62.0, y), (x + 122.0, y), FORCE, 2.0);
    sheet.text((x + 100.0, y - 12.0), "F_{x}(t)", &LABEL.colored(FORCE).anchored(Anchor::Start));
    arrow(sheet, (x, y - 62.0), (x, 84.0), FORCE, 2.0);
    sheet.text((x + 10.0, 98.0), "F_{y}(t)", &LABEL.colored(FORCE).anchored(Anchor::Start));
    axes(sheet, (806.0, 344.0));
}

/// Figure 4.2.3: the bearing as eight coefficients between housing and ground.
pub fn bearing_scheme() -> String {
    let mut sheet = Canvas::new(700.0, 430.0);
    title(&mut sheet, 350.0, "The bearing as eight linear coefficients");
    let (x, y, half, wall, floor) = (330.0, 190.0, 56.0, 80.0, 376.0);
    ground(&mut sheet, (wall, 260.0), (wall, 120.0));
    ground(&mut sheet, (430.0, floor), (230.0, floor));
    spring(&mut sheet, (wall, y - 30.0), (x - half, y - 30.0));
    dashpot(&mut sheet, (wall, y + 30.0), (x - half, y + 30.0));
    spring(&mut sheet, (x - 30.0, y + half), (x - 30.0, floor));
    dashpot(&mut sheet, (x + 30.0, y + half), (x + 30.0, floor));
    sheet.rect((x - half, y - half), (2.0 * half, 2.0 * half), Some(STEEL), Some(PART));
    sheet.text((x, y + 6.0), "M", &TextStyle::new(19.0).italic());
    sheet.text((177.0, y - 48.0), "K_{xx}", &LABEL);
    sheet.text((177.0, y + 62.0), "C_{xx}", &LABEL);
    sheet.text((x - 46.0, 318.0), "K_{yy}", &LABEL.anchored(Anchor::End));
    sheet.text((x + 48.0, 318.0), "C_{yy}", &LABEL.anchored(Anchor::Start));
    arrow(&mut sheet, (x + half, y), (x + half + 70.0, y), FORCE, 2.0);
    sheet.text(
        (x + half + 44.0, y - 12.0),
        "F_{x}(t)",
        &LABEL.colored(FORCE).anchored(Anchor::Start),
    );
    arrow(&mut sheet, (x, y - half), (x, 68.0), FORCE, 2.0);
    sheet.text((x + 10.0, 82.0), "F_{y}(t)", &LABEL.colored(FORCE).anchored(Anchor::Start));
    displacement(&mut sheet, (x + half + 14.0, y + 36.0), (1.0, 0.0), "X(t)");
    displacement(&mut sheet, (x - 34.0, y - half - 8.0), (0.0, -1.0), "Y(t)");
    coupling(&mut sheet, (470.0, 290.0));
    sheet.finish("The bearing as eight linear coefficients")
}

/// Draws what springs and dashpots do not show: the housing, the shaft and the coordinates.
fn coupling(sheet: &mut Canvas, (x, y): Point) {
    let start = NOTE.anchored(Anchor::Start);
    let lines = [
        "Cross-coupling by the oil film",
        "Y and Ẏ push along X: K_{xy}, C_{xy}",
        "X and Ẋ push along Y: K_{yx}, C_{yx}",
    ];
    sheet.line((x - 10.0, y - 14.0), (x - 10.0, y + 44.0), Stroke::solid(OIL, 3.0));
    for (row, line) in lines.iter().enumerate() {
        sheet.text((x, y + 19.0 * row as f64), line, &if row == 0 { start.bold() } else { start });
    }
}

fn title(sheet: &mut Canvas, middle: f64, text: &str) {
    sheet.text((middle, 28.0), text, &TextStyle::new(15.0).bold());
}

/// A displacement measured from `from` along the unit vector `along`.
fn displacement(sheet: &mut Canvas, from: Point, along: Point, label: &str) {
    let across = (-along.1, along.0);
    let tick = |part: f64| (from.0 + part * across.0, from.1 + part * across.1);
    sheet.line(tick(-7.0), tick(7.0), Stroke::solid(MOTION, 1.4));
    let tip = (from.0 + 46.0 * along.0, from.1 + 46.0 * along.1);
    arrow(sheet, from, tip, MOTION, 1.4);
    let (at, anchor) = if along.0 != 0.0 {
        ((tip.0 + 6.0, tip.1 + 5.0), Anchor::Start)
    } else {
        ((tip.0 - 6.0, tip.1 + 12.0), Anchor::End)
    };
    sheet.text(at, label, &LABEL.colored(MOTION).anchored(anchor));
}

fn center_line(sheet: &mut Canvas, from: Point, to: Point) {
    sheet.line(
        from,
        to,
        Stroke { color: Color::GREY, width: 1.0, dash: mechid::plot::Dash::DashDot },
    );
}

fn leader(sheet: &mut Canvas, from: Point, to: Point) {
    sheet.circle(from, 2.0, Some(Color::DARK), None);
    sheet.line(from, to, THIN);
}

/// The sense of rotation: three quarters of a circle with an arrow head.
fn turning(sheet: &mut Canvas, (x, y): Point, radius: f64) {
    let end = (x + radius, y);
    let path = format!(
        "M{:.2} {y:.2}A{radius:.2} {radius:.2} 0 1 0 {:.2} {:.2}",
        end.0 - 2.0 * radius,
        end.0,
        end.1
    );
    sheet.path(&path, None, Some(Stroke::solid(Color::DARK, 1.2)));
    super::symbols::arrow_head(
        sheet,
        (end.0 - 2.0, end.1 + 9.0),
        (end.0, end.1 - 2.0),
        8.0,
        Color::DARK,
    );
    sheet.text((x, y + 5.0), "Ω", &LABEL);
}

/// The fixed axes X and Y.
fn axes(sheet: &mut Canvas, origin: Point) {
    arrow(sheet, origin, (origin.0 + 44.0, origin.1), Color::DARK, 1.2);
    arrow(sheet, origin, (origin.0, origin.1 - 44.0), Color::DARK, 1.2);
    sheet.text((origin.0 + 52.0, origin.1 + 5.0), "X", &LABEL.anchored(Anchor::Start));
    sheet.text((origin.0, origin.1 - 52.0), "Y", &LABEL);
}
