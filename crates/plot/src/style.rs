//! Colours, dashes and markers that can be distinguished in grey print and by colour-blind readers.

/// Font size of captions and legends, px.
pub(crate) const LABEL_SIZE: f64 = 13.0;
/// Font size of tick labels, px.
pub(crate) const TICK_SIZE: f64 = 11.5;
/// Font size of the title of a figure, px.
pub(crate) const TITLE_SIZE: f64 = 15.0;
/// Font size of the title of a panel, px.
pub(crate) const PANEL_TITLE_SIZE: f64 = 13.0;

/// Colour in SVG notation (`#rrggbb`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Color(pub &'static str);

impl Color {
    /// Blue of the Okabe–Ito palette.
    pub const BLUE: Color = Color("#0072b2");
    /// Vermilion of the Okabe–Ito palette.
    pub const VERMILION: Color = Color("#d55e00");
    /// Bluish green of the Okabe–Ito palette.
    pub const GREEN: Color = Color("#009e73");
    /// Reddish purple of the Okabe–Ito palette.
    pub const PURPLE: Color = Color("#cc79a7");
    /// Dark brown.
    pub const BROWN: Color = Color("#732600");
    /// Indigo.
    pub const INDIGO: Color = Color("#332288");
    /// Black: the true value, the reference, the measurement.
    pub const BLACK: Color = Color("#000000");
    /// Dark grey: frames and tick labels.
    pub const DARK: Color = Color("#333333");
    /// Middle grey: lines in the background, such as a measurement behind its fit.
    pub const GREY: Color = Color("#808080");
    /// White: the paper.
    pub const WHITE: Color = Color("#ffffff");
    /// Edges of legends.
    pub(crate) const LIGHT: Color = Color("#c8c8c8");
    /// Colour of the grid lines at labelled ticks.
    pub(crate) const GRID: Color = Color("#e0e0e0");
    /// Colour of the grid lines at ticks without labels.
    pub(crate) const FINE_GRID: Color = Color("#f1f1f1");

    /// Curve colours in the order of the curves of a panel. Brown and indigo replace the yellow,
    /// orange and sky blue of the palette, whose contrast to white paper is below 3:1.
    ///
    /// # Source
    /// M. Okabe and K. Ito, *Color Universal Design* (2008).
    pub const CYCLE: [Color; 6] =
        [Color::BLUE, Color::VERMILION, Color::GREEN, Color::PURPLE, Color::BROWN, Color::INDIGO];
}

/// Colours of a drawing that a page in dark mode replaces, each with its replacement.
pub(crate) const DARK_MODE: [(Color, Color); 12] = [
    (Color::WHITE, Color("#14181d")),
    (Color::DARK, Color("#d5d9de")),
    (Color::BLACK, Color("#f0f3f6")),
    (Color::GREY, Color("#9aa3ad")),
    (Color::LIGHT, Color("#4a525b")),
    (Color::GRID, Color("#2b323a")),
    (Color::FINE_GRID, Color("#1e242a")),
    (Color::BLUE, Color("#4aa3e0")),
    (Color::VERMILION, Color("#ff8a3d")),
    (Color::GREEN, Color("#2fc79b")),
    (Color::BROWN, Color("#ffed99")),
    (Color::INDIGO, Color("#6f5fef")),
];

/// Line pattern.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Dash {
    /// Solid line: ────
    #[default]
    Solid,
    /// Dashed line: ─ ─ ─
    Dashed,
    /// Dotted line: · · · ·
    Dotted,
    /// Line of dashes and dots: ─ · ─ ·
    DashDot,
    /// Line of long dashes: ── ──
    LongDash,
}

impl Dash {
    const CYCLE: [Dash; 5] =
        [Dash::Solid, Dash::Dashed, Dash::DashDot, Dash::LongDash, Dash::Dotted];

    /// Returns the SVG dash array for a stroke of the given width, px; `None` for a solid line.
    pub(crate) fn array(self, width: f64) -> Option<Vec<f64>> {
        let pattern: &[f64] = match self {
            Dash::Solid => return None,
            Dash::Dashed => &[4.0, 2.6],
            Dash::Dotted => &[1.2, 2.0],
            Dash::DashDot => &[5.0, 2.2, 1.2, 2.2],
            Dash::LongDash => &[8.0, 2.6],
        };
        Some(pattern.iter().map(|part| part * width).collect())
    }
}

/// Shape drawn at each point of a curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Marker {
    /// Circle: ●
    Circle,
    /// Square: ■
    Square,
    /// Triangle: ▲
    Triangle,
    /// Diamond: ◆
    Diamond,
    /// Inverted triangle: ▼
    TriangleDown,
    /// Diagonal cross: ×
    Cross,
    /// Upright cross: +
    Plus,
}

impl Marker {
    const CYCLE: [Marker; 6] = [
        Marker::Circle,
        Marker::Square,
        Marker::Triangle,
        Marker::Diamond,
        Marker::TriangleDown,
        Marker::Cross,
    ];
}

/// Style of one curve: parts that are `None` follow the index of the curve in its panel.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Style {
    pub(crate) color: Option<Color>,
    pub(crate) dash: Option<Dash>,
    pub(crate) marker: Option<Marker>,
    pub(crate) width: Option<f64>,
}

/// Style with every part set.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Resolved {
    pub(crate) color: Color,
    pub(crate) dash: Dash,
    pub(crate) marker: Marker,
    pub(crate) width: f64,
}

impl Style {
    /// Returns the style of curve number `slot` of a panel.
    pub(crate) fn resolve(self, slot: usize) -> Resolved {
        Resolved {
            color: self.color.unwrap_or(Color::CYCLE[slot % Color::CYCLE.len()]),
            dash: self.dash.unwrap_or(Dash::CYCLE[slot % Dash::CYCLE.len()]),
            marker: self.marker.unwrap_or(Marker::CYCLE[slot % Marker::CYCLE.len()]),
            width: self.width.unwrap_or(1.7),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Red, green and blue in linear light.
    type Light = [f64; 3];

    fn times(matrix: [[f64; 3]; 3], v: Light) -> Light {
        matrix.map(|row| row.iter().zip(v).map(|(a, b)| a * b).sum())
    }

    fn light(color: Color) -> Light {
        [1, 3, 5].map(|at| {
            let value = f64::from(u8::from_str_radix(&color.0[at..at + 2], 16).unwrap()) / 255.0;
            if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
        })
    }

    /// Contrast by WCAG 2.
    fn contrast(a: Color, b: Color) -> f64 {
        let luminance = |color| times([[0.2126, 0.7152, 0.0722]; 3], light(color))[0];
        let (a, b) = (luminance(a), luminance(b));
        (a.max(b) + 0.05) / (a.min(b) + 0.05)
    }

    /// Returns the smallest difference of two colours in Oklab, in per cent of the difference of
    /// black and white. It is the smallest of four values: for normal vision, and for vision
    /// without red, green or blue cones (Machado, Oliveira and Fernandes 2009).
    fn least_difference(a: Color, b: Color) -> f64 {
        const VISION: [[[f64; 3]; 3]; 4] = [
            [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            [[0.1523, 1.0526, -0.2049], [0.1145, 0.7863, 0.0992], [-0.0039, -0.0481, 1.0520]],
            [[0.3673, 0.8606, -0.2280], [0.2801, 0.6725, 0.0474], [-0.0118, 0.0429, 0.9689]],
            [[1.2555, -0.0767, -0.1788], [-0.0784, 0.9308, 0.1476], [0.0047, 0.6914, 0.3039]],
        ];
        let oklab = |light: Light| {
            let cones = [
                [0.41222, 0.53633, 0.05145],
                [0.21190, 0.68070, 0.10740],
                [0.08830, 0.28172, 0.62998],
            ];
            let axes = [
                [0.21045, 0.79362, -0.00407],
                [1.97800, -2.42859, 0.45059],
                [0.02590, 0.78277, -0.80868],
            ];
            times(axes, times(cones, light.map(|v| v.clamp(0.0, 1.0))).map(f64::cbrt))
        };
        let seen = |matrix| [a, b].map(|color| oklab(times(matrix, light(color))));
        let difference = |[a, b]: [Light; 2]| {
            a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
        };
        VISION.map(seen).map(difference).into_iter().fold(f64::INFINITY, |a, b| a.min(100.0 * b))
    }

    /// Each colour must have a contrast of 3:1 to the paper (WCAG 1.4.11), and two colours must
    /// differ by more than 6 % of the difference of black and white. A difference of 2 % is just
    /// visible between adjacent areas, and 6 % between separate curves.
    #[test]
    fn colours_of_curves_are_seen_and_told_apart_on_both_papers() {
        let dark = |color| DARK_MODE.iter().find(|(of, _)| *of == color).map_or(color, |c| c.1);
        for cycle in [Color::CYCLE, Color::CYCLE.map(dark)] {
            let paper = if cycle == Color::CYCLE { Color::WHITE } else { dark(Color::WHITE) };
            for (at, color) in cycle.into_iter().enumerate() {
                assert!(contrast(color, paper) >= 3.0, "{color:?}: {}", contrast(color, paper));
                for other in &cycle[..at] {
                    let least = least_difference(color, *other);
                    assert!(least > 6.0, "{color:?} {other:?}: {least}");
                }
            }
        }
    }

    #[test]
    fn the_script_and_the_style_have_no_colours_of_curves() {
        let texts = [include_str!("interactive/script.js"), include_str!("interactive/figure.css")];
        for color in Color::CYCLE {
            assert!(texts.iter().all(|text| !text.contains(color.0)), "{color:?}");
        }
    }
}
