//! Panels: a pair of axes with curves and reference lines.

use crate::axis::{Axis, ROUNDING, Scale, padded};
use crate::curve::{Curve, Kind, Reference};
use crate::error::PlotError;
use crate::style::Resolved;

/// Position of the legend of a panel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Legend {
    /// Inside, at a position where it hides no curve; above the panel if there is no such position.
    #[default]
    Auto,
    /// Outside, above the panel.
    Above,
    /// No legend.
    Hidden,
}

/// Part of a frequency response that a panel shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ResponsePart {
    /// Magnitude.
    Magnitude,
    /// Phase, in degrees.
    Phase,
}

/// Pair of axes with curves and reference lines.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    pub(crate) title: String,
    pub(crate) x: Axis,
    pub(crate) y: Axis,
    pub(crate) curves: Vec<Curve>,
    pub(crate) references: Vec<Reference>,
    pub(crate) legend: Legend,
    pub(crate) reach_y: Option<(f64, f64)>,
    pub(crate) part: Option<ResponsePart>,
}

impl Panel {
    /// Creates an empty panel.
    pub fn new(x: Axis, y: Axis) -> Self {
        Panel {
            title: String::new(),
            x,
            y,
            curves: Vec::new(),
            references: Vec::new(),
            legend: Legend::Auto,
            reach_y: None,
            part: None,
        }
    }

    /// Writes a title above the panel.
    #[must_use]
    pub fn title(mut self, title: impl Into<String>) -> Self {
        self.title = title.into();
        self
    }

    /// Adds a curve.
    #[must_use]
    pub fn curve(mut self, curve: Curve) -> Self {
        self.curves.push(curve);
        self
    }

    /// Adds curves.
    #[must_use]
    pub fn curves(mut self, curves: impl IntoIterator<Item = Curve>) -> Self {
        self.curves.extend(curves);
        self
    }

    /// Adds a reference line. It is drawn under the curves, and the range of the axis always
    /// includes it.
    #[must_use]
    pub fn reference(mut self, reference: Reference) -> Self {
        self.references.push(reference);
        self
    }

    /// Extends the ordinate to at least `low` to `high`, so that panels can share a scale.
    #[must_use]
    pub fn including_y(mut self, low: f64, high: f64) -> Self {
        self.reach_y = Some((low, high));
        self
    }

    /// Replaces the ordinate axis of the panel.
    #[must_use]
    pub fn y(mut self, axis: Axis) -> Self {
        self.y = axis;
        self
    }

    /// Sets the position of the legend.
    #[must_use]
    pub fn legend(mut self, legend: Legend) -> Self {
        self.legend = legend;
        self
    }

    /// States which part of a frequency response the panel shows, so that an interactive figure can
    /// offer the other parts. The curves of a magnitude panel have phases, and the next panel shows
    /// these phases.
    #[must_use]
    pub fn part(mut self, part: ResponsePart) -> Self {
        self.part = Some(part);
        self
    }

    /// Returns the title.
    pub fn name(&self) -> &str {
        &self.title
    }

    /// Returns the abscissa.
    pub fn x_axis(&self) -> &Axis {
        &self.x
    }

    /// Returns the ordinate.
    pub fn y_axis(&self) -> &Axis {
        &self.y
    }

    /// Returns the curves in order.
    pub fn data(&self) -> &[Curve] {
        &self.curves
    }

    /// Returns the reference lines in order.
    pub fn references(&self) -> &[Reference] {
        &self.references
    }

    /// Returns the style of each curve, in order.
    pub(crate) fn styles(&self) -> Vec<Resolved> {
        let mut next = 0;
        let slot = |curve: &Curve| {
            curve.slot.unwrap_or_else(|| {
                let slot = next;
                // A band has the style of the line that follows it.
                next += usize::from(curve.kind != Kind::Band);
                slot
            })
        };
        let slots: Vec<usize> = self.curves.iter().map(slot).collect();
        self.curves.iter().zip(slots).map(|(curve, slot)| curve.style.resolve(slot)).collect()
    }

    /// Checks that every coordinate can be shown on its axis.
    pub(crate) fn validate(&self) -> Result<(), PlotError> {
        for axis in [&self.x, &self.y] {
            if let Some((low, high)) = axis.range
                && !(axis.scale.can_show(low)
                    && axis.scale.can_show(high)
                    && low < high
                    && (high - low).is_finite())
            {
                return Err(PlotError::Range { axis: axis.caption(), low, high });
            }
        }
        if let Some((low, high)) = self.reach_y
            && !(self.y.scale.can_show(low) && self.y.scale.can_show(high))
        {
            return Err(PlotError::Range { axis: self.y.caption(), low, high });
        }
        for curve in &self.curves {
            self.validate_curve(curve)?;
        }
        for reference in &self.references {
            let axis = if reference.horizontal { &self.y } else { &self.x };
            if !axis.scale.can_show(reference.value) {
                return Err(PlotError::Reference {
                    label: reference.label.clone(),
                    value: reference.value,
                });
            }
        }
        Ok(())
    }

    fn validate_curve(&self, curve: &Curve) -> Result<(), PlotError> {
        let upper_len = if curve.kind == Kind::Band { curve.upper.len() } else { curve.y.len() };
        if curve.x.len() != curve.y.len() || upper_len != curve.y.len() {
            return Err(PlotError::LengthMismatch {
                curve: curve.label.clone(),
                x_len: curve.x.len(),
                y_len: if curve.x.len() == curve.y.len() { upper_len } else { curve.y.len() },
            });
        }
        for numbers in [&curve.phase_deg, &curve.error] {
            if !numbers.is_empty() && numbers.len() != curve.x.len() {
                return Err(PlotError::LengthMismatch {
                    curve: curve.label.clone(),
                    x_len: curve.x.len(),
                    y_len: numbers.len(),
                });
            }
        }
        if curve.x.is_empty() {
            return Err(PlotError::EmptyCurve { curve: curve.label.clone() });
        }
        let xs = curve.x.iter().enumerate().map(|(index, &value)| ('x', index, value));
        let ys =
            curve.ordinates().enumerate().map(|(index, value)| ('y', index % curve.x.len(), value));
        let more = curve.phase_deg.iter().chain(&curve.error);
        if let Some((index, value)) =
            more.copied().enumerate().find(|(_, value)| !value.is_finite())
        {
            let (curve, index) = (curve.label.clone(), index % curve.x.len());
            return Err(PlotError::NonFinite { curve, coordinate: 'y', index, value });
        }
        for (coordinate, index, value) in xs.chain(ys) {
            let scale = if coordinate == 'x' { self.x.scale } else { self.y.scale };
            let name = curve.label.clone();
            if !value.is_finite() {
                return Err(PlotError::NonFinite { curve: name, coordinate, index, value });
            }
            if !scale.can_show(value) {
                return Err(PlotError::NotPositive { curve: name, coordinate, index, value });
            }
        }
        Ok(())
    }

    /// Returns the smallest and largest abscissa of the curves and reference lines.
    pub(crate) fn x_extent(&self) -> (f64, f64) {
        let references =
            self.references.iter().filter(|line| !line.horizontal).map(|line| line.value);
        extent(self.curves.iter().flat_map(|curve| curve.x.iter().copied()).chain(references))
    }

    /// Returns whether markers or stems need space beyond the outermost points.
    pub(crate) fn has_markers(&self) -> bool {
        self.curves.iter().any(Curve::has_markers)
    }

    /// Returns the range of the abscissa of the panel. All points are in `extent`; `markers` states
    /// whether the range has space for markers.
    pub(crate) fn x_range(&self, extent: (f64, f64), markers: bool) -> (f64, f64) {
        // Curves without markers need no margin: they extend to both edges of the panel.
        let margin = if markers { 0.03 } else { 0.0 };
        self.x.range.unwrap_or_else(|| {
            let (low, high) = padded(self.x.scale, extent.0, extent.1, margin);
            // An axis of positive times or frequencies does not begin below zero.
            (if extent.0 > 0.0 { low.max(0.0) } else { low }, high)
        })
    }

    /// Returns the ordinates that the panel shows.
    pub(crate) fn y_range(&self) -> (f64, f64) {
        if let Some(range) = self.y.range {
            return range;
        }
        let references =
            self.references.iter().filter(|line| line.horizontal).map(|line| line.value);
        let reach = self.reach_y.iter().flat_map(|(low, high)| [*low, *high]);
        let values = self.curves.iter().flat_map(Curve::ordinates);
        let (low, high) = extent(values.chain(references).chain(reach));
        let from_zero = self.y.scale == Scale::Linear
            && self.curves.iter().any(|curve| curve.kind == Kind::Stems);
        if from_zero {
            let (low, high) = padded(Scale::Linear, low.min(0.0), high.max(0.0), 0.06);
            // The stems begin at the lower edge of the frame, without a margin, if no value is
            // negative.
            let rising = !self.curves.iter().flat_map(Curve::ordinates).any(|value| value < 0.0);
            return (if rising { 0.0 } else { low }, high);
        }
        // Values as small as the rounding error of the largest value would extend a logarithmic
        // axis by many decades.
        let low = if self.y.scale == Scale::Log10 { low.max(ROUNDING * high) } else { low };
        padded(self.y.scale, low, high, 0.06)
    }
}

fn extent(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
        (low.min(value), high.max(value))
    })
}
