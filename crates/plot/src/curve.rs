//! Curves and reference lines.

use crate::style::{Color, Dash, Marker, Style};

/// Way in which the points of a curve are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Line,
    MarkedLine,
    Points,
    Stems,
    Band,
}

/// One set of points with its look and its legend label.
///
/// Parts of the look that are not set follow the place of the curve in its panel:
/// the k-th curve has the k-th colour, dash and marker of the cycle.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    pub(crate) label: String,
    pub(crate) kind: Kind,
    pub(crate) x: Vec<f64>,
    pub(crate) y: Vec<f64>,
    /// Upper edge of a band; empty otherwise.
    pub(crate) upper: Vec<f64>,
    pub(crate) style: Style,
    pub(crate) slot: Option<usize>,
    /// Phases of a magnitude, in degrees; empty if it has none.
    pub(crate) phase_deg: Vec<f64>,
    /// Standard errors of the ordinates; empty if they are not known.
    pub(crate) error: Vec<f64>,
    /// Words about each point; empty if there are none.
    pub(crate) notes: Vec<String>,
}

impl Curve {
    fn new(kind: Kind, label: impl Into<String>, x: &[f64], y: &[f64]) -> Self {
        Curve {
            label: label.into(),
            kind,
            x: x.to_vec(),
            y: y.to_vec(),
            upper: Vec::new(),
            style: Style::default(),
            slot: None,
            phase_deg: Vec::new(),
            error: Vec::new(),
            notes: Vec::new(),
        }
    }

    /// A line through the points (`x` and `y` of equal length, in the units of the axes). An empty
    /// label keeps the curve out of the legend.
    pub fn line(label: impl Into<String>, x: &[f64], y: &[f64]) -> Self {
        Curve::new(Kind::Line, label, x, y)
    }

    /// A line through the points, as [`line`](Self::line) takes them in the units of the axes and
    /// of equal length, with a marker at each: for sweeps, where the points are what was computed.
    pub fn marked_line(label: impl Into<String>, x: &[f64], y: &[f64]) -> Self {
        Curve::new(Kind::MarkedLine, label, x, y)
    }

    /// Markers alone, `x` and `y` of equal length in the units of the axes: for measurements.
    pub fn points(label: impl Into<String>, x: &[f64], y: &[f64]) -> Self {
        Curve::new(Kind::Points, label, x, y)
    }

    /// A stem from zero (from the bottom of a logarithmic axis) to each point, in the units of the
    /// axes: for line spectra.
    pub fn stems(label: impl Into<String>, x: &[f64], y: &[f64]) -> Self {
        Curve::new(Kind::Stems, label, x, y)
    }

    /// A shaded band between `lower` and `upper`, one entry of each per abscissa, in the units of
    /// the axes: for confidence intervals. It takes the look of the curve added after it.
    pub fn band(label: impl Into<String>, x: &[f64], lower: &[f64], upper: &[f64]) -> Self {
        Curve { upper: upper.to_vec(), ..Curve::new(Kind::Band, label, x, lower) }
    }

    /// Draws the curve in this colour.
    #[must_use]
    pub fn color(mut self, color: Color) -> Self {
        self.style.color = Some(color);
        self
    }

    /// Draws the line with this pattern.
    #[must_use]
    pub fn dash(mut self, dash: Dash) -> Self {
        self.style.dash = Some(dash);
        self
    }

    /// Draws the points with this marker.
    #[must_use]
    pub fn marker(mut self, marker: Marker) -> Self {
        self.style.marker = Some(marker);
        self
    }

    /// Draws the line this wide, px.
    #[must_use]
    pub fn width(mut self, width: f64) -> Self {
        self.style.width = Some(width);
        self
    }

    /// Gives the curve the look of number `slot` of the cycle, wherever it stands in its panel:
    /// the same method keeps the same look in every figure.
    #[must_use]
    pub fn slot(mut self, slot: usize) -> Self {
        self.slot = Some(slot);
        self
    }

    /// Gives a magnitude the phases of its points, in degrees, one for each: an interactive figure
    /// then draws phase, real and imaginary part and the Nyquist plot from them.
    #[must_use]
    pub fn phase(mut self, phase_deg: &[f64]) -> Self {
        self.phase_deg = phase_deg.to_vec();
        self
    }

    /// Shades ± 2 standard errors around the curve; `error` has one standard error for each point, in the unit
    /// of the ordinate.
    #[must_use]
    pub fn standard_error(mut self, error: &[f64]) -> Self {
        self.error = error.to_vec();
        self
    }

    /// Gives each point words, such as the name of its record, which an interactive figure shows when
    /// the pointer is over it.
    #[must_use]
    pub fn notes(mut self, notes: Vec<String>) -> Self {
        self.notes = notes;
        self
    }

    /// Legend label.
    pub fn label(&self) -> &str {
        &self.label
    }

    /// Abscissae, one for each point, in the unit of the axis.
    pub fn x(&self) -> &[f64] {
        &self.x
    }

    /// Ordinates, one for each point, in the unit of the axis; of a band, those of its lower edge.
    pub fn y(&self) -> &[f64] {
        &self.y
    }

    pub(crate) fn has_line(&self) -> bool {
        matches!(self.kind, Kind::Line | Kind::MarkedLine)
    }

    pub(crate) fn has_markers(&self) -> bool {
        matches!(self.kind, Kind::MarkedLine | Kind::Points | Kind::Stems)
    }

    /// All ordinates: those of the curve and, for a band, those of its upper edge.
    pub(crate) fn ordinates(&self) -> impl Iterator<Item = f64> {
        self.y.iter().chain(&self.upper).copied()
    }
}

/// A straight line across the panel at one value of one axis, such as the true value of what is estimated.
#[derive(Debug, Clone, PartialEq)]
pub struct Reference {
    pub(crate) label: String,
    pub(crate) value: f64,
    pub(crate) horizontal: bool,
    pub(crate) color: Color,
    pub(crate) dash: Dash,
}

impl Reference {
    /// A horizontal line at the ordinate `y`, in the unit of its axis.
    pub fn horizontal(label: impl Into<String>, y: f64) -> Self {
        Reference {
            label: label.into(),
            value: y,
            horizontal: true,
            color: Color::BLACK,
            dash: Dash::LongDash,
        }
    }

    /// A vertical line at the abscissa `x`, in the unit of its axis.
    pub fn vertical(label: impl Into<String>, x: f64) -> Self {
        Reference {
            horizontal: false,
            color: Color::GREY,
            dash: Dash::Dashed,
            ..Reference::horizontal(label, x)
        }
    }

    /// Draws the line in this colour.
    #[must_use]
    pub fn color(mut self, color: Color) -> Self {
        self.color = color;
        self
    }

    /// Draws the line with this pattern.
    #[must_use]
    pub fn dash(mut self, dash: Dash) -> Self {
        self.dash = dash;
        self
    }

    /// Legend label.
    pub fn label(&self) -> &str {
        &self.label
    }

    /// Position of the line, in the unit of its axis.
    pub fn value(&self) -> f64 {
        self.value
    }

    /// Returns whether the line is horizontal, at one ordinate, rather than vertical, at one abscissa.
    pub fn is_horizontal(&self) -> bool {
        self.horizontal
    }
}
