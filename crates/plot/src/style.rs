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
    /// Orange of the Okabe–Ito palette.
    pub const ORANGE: Color = Color("#e69f00");
    /// Sky blue of the Okabe–Ito palette.
    pub const SKY: Color = Color("#56b4e9");
    /// Black: the true value, the reference, the measurement.
    pub const BLACK: Color = Color("#000000");
    /// Dark grey: frames and tick labels.
    pub const DARK: Color = Color("#333333");
    /// Middle grey: the background.
    pub const GREY: Color = Color("#808080");
    /// White: the paper.
    pub const WHITE: Color = Color("#ffffff");

    /// Curve colours in the order of the curves of a panel. The yellow of the palette is omitted,
    /// because it is hardly visible on white paper.
    ///
    /// # Source
    /// M. Okabe and K. Ito, *Color Universal Design* (2008).
    pub const CYCLE: [Color; 6] =
        [Color::BLUE, Color::VERMILION, Color::GREEN, Color::PURPLE, Color::ORANGE, Color::SKY];
}

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
