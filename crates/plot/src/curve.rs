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

/// One set of points with its style and its legend label.
///
/// Parts of the style that are not set follow the index of the curve in its panel: the k-th curve
/// has the k-th colour, dash and marker of the cycle.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    pub(crate) label: String,
    pub(crate) kind: Kind,
    pub(crate) x: Vec<f64>,
    pub(crate) y: Vec<f64>,
    /// Upper edge of a band; empty for other curves.
    pub(crate) upper: Vec<f64>,
    pub(crate) style: Style,
    pub(crate) slot: Option<usize>,
    /// Phases of the points of a magnitude curve, in degrees; empty if the curve has no phases.
    pub(crate) phase_deg: Vec<f64>,
    /// Standard errors of the ordinates; empty if they are not known.
    pub(crate) error: Vec<f64>,
    /// Note for each point; empty if there are none.
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

    /// Creates a line through the points (`x` and `y` of equal length, in the units of the axes). A
    /// curve with an empty label is not in the legend.
    pub fn line(label: impl Into<String>, x: &[f64], y: &[f64]) -> Self {
        Curve::new(Kind::Line, label, x, y)
    }

    /// Creates a line as [`line`](Self::line) does (`x` and `y` of equal length, in the units of
    /// the axes), with a marker at each point: for sweeps, whose points are the computed values.
    pub fn marked_line(label: impl Into<String>, x: &[f64], y: &[f64]) -> Self {
        Curve::new(Kind::MarkedLine, label, x, y)
    }

    /// Creates a curve of markers without a line, for measurements. `x` and `y` are of equal
    /// length, in the units of the axes.
    pub fn points(label: impl Into<String>, x: &[f64], y: &[f64]) -> Self {
        Curve::new(Kind::Points, label, x, y)
    }

    /// Creates a stem from zero (from the bottom of a logarithmic axis) to each point, in the units
    /// of the axes: for line spectra.
    pub fn stems(label: impl Into<String>, x: &[f64], y: &[f64]) -> Self {
        Curve::new(Kind::Stems, label, x, y)
    }

    /// Creates a shaded band between `lower` and `upper`, one entry of each per abscissa, in the
    /// units of the axes: for confidence intervals. The band has the style of the curve that is
    /// added next.
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

    /// Draws the line with this width, px.
    #[must_use]
    pub fn width(mut self, width: f64) -> Self {
        self.style.width = Some(width);
        self
    }

    /// Sets the style of the curve to number `slot` of the cycle. The style is then independent of
    /// the position of the curve in the panel, so that the same method has the same style in every
    /// figure.
    #[must_use]
    pub fn slot(mut self, slot: usize) -> Self {
        self.slot = Some(slot);
        self
    }

    /// Adds phases to the curve of a magnitude, in degrees, one for each point. An interactive
    /// figure then offers phase, real and imaginary part and the Nyquist plot.
    #[must_use]
    pub fn phase(mut self, phase_deg: &[f64]) -> Self {
        self.phase_deg = phase_deg.to_vec();
        self
    }

    /// Shades ± 2 standard errors around the curve; `error` has one standard error for each point,
    /// in the unit of the ordinate. For levels in decibels, the band is ± 2 standard errors of the
    /// magnitude.
    #[must_use]
    pub fn standard_error(mut self, error: &[f64]) -> Self {
        self.error = error.to_vec();
        self
    }

    /// Gives each point a note, such as the name of its record, which an interactive figure shows
    /// at the pointer.
    #[must_use]
    pub fn notes(mut self, notes: Vec<String>) -> Self {
        self.notes = notes;
        self
    }

    /// Returns the legend label.
    pub fn label(&self) -> &str {
        &self.label
    }

    /// Returns the abscissae, one for each point, in the unit of the axis.
    pub fn x(&self) -> &[f64] {
        &self.x
    }

    /// Returns the ordinates, one for each point, in the unit of the axis; for a band, its lower
    /// edge.
    pub fn y(&self) -> &[f64] {
        &self.y
    }

    pub(crate) fn has_line(&self) -> bool {
        matches!(self.kind, Kind::Line | Kind::MarkedLine)
    }

    pub(crate) fn has_markers(&self) -> bool {
        matches!(self.kind, Kind::MarkedLine | Kind::Points | Kind::Stems)
    }

    /// Returns all ordinates of the curve and, for a band, of its upper edge.
    pub(crate) fn ordinates(&self) -> impl Iterator<Item = f64> {
        self.y.iter().chain(&self.upper).copied()
    }
}

/// Straight line across the panel at one value of one axis, such as a true value.
#[derive(Debug, Clone, PartialEq)]
pub struct Reference {
    pub(crate) label: String,
    pub(crate) value: f64,
    pub(crate) horizontal: bool,
    pub(crate) color: Color,
    pub(crate) dash: Dash,
}

impl Reference {
    /// Creates a horizontal line at the ordinate `y`, in the unit of its axis.
    pub fn horizontal(label: impl Into<String>, y: f64) -> Self {
        Reference {
            label: label.into(),
            value: y,
            horizontal: true,
            color: Color::BLACK,
            dash: Dash::LongDash,
        }
    }

    /// Creates a vertical line at the abscissa `x`, in the unit of its axis.
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

    /// Returns the legend label.
    pub fn label(&self) -> &str {
        &self.label
    }

    /// Returns the position of the line, in the unit of its axis.
    pub fn value(&self) -> f64 {
        self.value
    }

    /// Returns whether the line is horizontal, at an ordinate; otherwise it is vertical, at an
    /// abscissa.
    pub fn is_horizontal(&self) -> bool {
        self.horizontal
    }
}
