//! Axes: quantity, unit, scale and range.

/// Number of decibels in a change by the factor e, the base of natural logarithms: a relative error
/// times this number is the error in decibels.
pub const NEPER: f64 = 20.0 * std::f64::consts::LOG10_E;

/// Maximum rounding error, relative to the largest value of a figure: logarithmic axes end at this
/// level, and responses that never exceed it are not drawn.
pub const ROUNDING: f64 = 1e-12;

/// Linear or logarithmic scale of an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Scale {
    /// Equal distances on the axis are equal differences of the values.
    #[default]
    Linear,
    /// Equal distances on the axis are equal ratios of the values.
    Log10,
}

impl Scale {
    /// Returns the position on an axis of this scale, up to a factor and an offset.
    pub(crate) fn forward(self, value: f64) -> f64 {
        match self {
            Scale::Linear => value,
            Scale::Log10 => value.log10(),
        }
    }

    pub(crate) fn can_show(self, value: f64) -> bool {
        value.is_finite() && (self == Scale::Linear || value > 0.0)
    }
}

/// One axis of a panel.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    pub(crate) label: String,
    pub(crate) unit: String,
    pub(crate) scale: Scale,
    pub(crate) range: Option<(f64, f64)>,
    pub(crate) step: Option<f64>,
}

impl Axis {
    /// Creates a linear axis for the quantity `label` in `unit`; an empty unit means a pure number.
    pub fn linear(label: impl Into<String>, unit: impl Into<String>) -> Self {
        Axis {
            label: label.into(),
            unit: unit.into(),
            scale: Scale::Linear,
            range: None,
            step: None,
        }
    }

    /// Creates a logarithmic axis for the quantity `label` in `unit`.
    pub fn log10(label: impl Into<String>, unit: impl Into<String>) -> Self {
        Axis { scale: Scale::Log10, ..Axis::linear(label, unit) }
    }

    /// Shows `low` to `high`, in the unit of the axis, instead of all points; points outside are
    /// not drawn.
    #[must_use]
    pub fn range(mut self, low: f64, high: f64) -> Self {
        self.range = Some((low, high));
        self
    }

    /// Labels multiples of `step` on a linear axis, such as 45 for a phase in degrees. A step with
    /// fewer than two or more than forty labels is ignored.
    #[must_use]
    pub fn step(mut self, step: f64) -> Self {
        self.step = Some(step);
        self
    }

    /// Returns whether the axis has levels in decibels.
    pub(crate) fn is_decibel(&self) -> bool {
        self.unit.starts_with("dB")
    }

    /// Returns `label (unit)`, or the label alone for a pure number.
    pub fn caption(&self) -> String {
        match (self.label.is_empty(), self.unit.is_empty()) {
            (_, true) => self.label.clone(),
            (true, false) => format!("({})", self.unit),
            (false, false) => format!("{} ({})", self.label, self.unit),
        }
    }
}

/// Mapping of values to pixels along one axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Mapping {
    scale: Scale,
    origin: f64,
    slope: f64,
    pixel: f64,
}

impl Mapping {
    /// Creates the mapping of `low` to `pixels.0` and of `high` to `pixels.1`.
    pub(crate) fn new(scale: Scale, (low, high): (f64, f64), pixels: (f64, f64)) -> Self {
        let origin = scale.forward(low);
        let slope = (pixels.1 - pixels.0) / (scale.forward(high) - origin);
        Mapping { scale, origin, slope, pixel: pixels.0 }
    }

    pub(crate) fn pixel(&self, value: f64) -> f64 {
        self.pixel + (self.scale.forward(value) - self.origin) * self.slope
    }
}

/// Minimum magnitude of a value, and minimum length of an axis; smaller values are drawn as zero,
/// because the pixels per unit would overflow.
pub(crate) const TINY: f64 = 1e-290;

/// Returns the range that shows everything from `low` to `high`, with the fraction `margin` of this
/// range added on both sides.
pub(crate) fn padded(scale: Scale, low: f64, high: f64, margin: f64) -> (f64, f64) {
    match scale {
        Scale::Linear => {
            // A constant curve still needs a range: ± 5 % of its value, or ± 1 around zero.
            let largest = low.abs().max(high.abs());
            let pad = if largest < TINY {
                1.0
            } else if high - low > 1e-12 * largest {
                (high - low) * margin
            } else {
                0.05 * largest
            };
            (low - pad, high + pad)
        }
        Scale::Log10 => {
            let ratio = high / low;
            let factor = if ratio > 1.0 + 1e-9 { ratio.powf(margin) } else { 2.0 };
            (low / factor, high * factor)
        }
    }
}
