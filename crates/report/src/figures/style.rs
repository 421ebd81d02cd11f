//! Style of frequency responses.

use mechid_model::ResponseQuantity;
use mechid_plot::Axis;
use mechid_plot::charts::Quantity;
use nalgebra::Complex;

/// Style of the frequency responses in a figure.
///
/// ```
/// use mechid_report::{FigureStyle, FrequencyScale, MagnitudeScale, PhaseStyle};
///
/// let style = FigureStyle {
///     phase: PhaseStyle::Continuous,
///     frequency: Some(FrequencyScale::Logarithmic),
///     magnitude: MagnitudeScale::Decibel,
///     quantity: None,
/// };
/// assert_ne!(style, FigureStyle::default());
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FigureStyle {
    /// Branch of the phase.
    pub phase: PhaseStyle,
    /// Frequency axis; `None`: logarithmic for a system over its whole range, linear over a band.
    pub frequency: Option<FrequencyScale>,
    /// Magnitude axis.
    pub magnitude: MagnitudeScale,
    /// Response per unit force: receptance, mobility or accelerance; `None`: the measured quantity
    /// or, for a system, the receptance.
    pub quantity: Option<ResponseQuantity>,
}

/// Returns name and unit of the response per unit force.
pub(super) fn per_force(quantity: ResponseQuantity) -> Quantity<'static> {
    match quantity {
        ResponseQuantity::Displacement => Quantity::new("Receptance", "m/N"),
        ResponseQuantity::Velocity => Quantity::new("Mobility", "m/(s·N)"),
        ResponseQuantity::Acceleration => Quantity::new("Accelerance", "m/(s²·N)"),
    }
}

/// Returns (iω)ᵈ, which converts a receptance to the response per unit force of the d-th
/// derivative.
pub(super) fn derivative(quantity: ResponseQuantity, omega: f64) -> Complex<f64> {
    let order = match quantity {
        ResponseQuantity::Displacement => 0,
        ResponseQuantity::Velocity => 1,
        ResponseQuantity::Acceleration => 2,
    };
    Complex::new(0.0, omega).powi(order)
}

/// Branch of the phase of a frequency response.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum PhaseStyle {
    /// Phase between −180° and 180°; the curve is interrupted where the phase jumps.
    #[default]
    Wrapped,
    /// Phase without jumps, unwrapped from the lowest frequency.
    Continuous,
}

/// Scale of a frequency axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrequencyScale {
    /// Equal distances for equal differences.
    Linear,
    /// Equal distances for equal ratios.
    Logarithmic,
}

/// Scale of a magnitude axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum MagnitudeScale {
    /// Logarithmic, in the unit of the response.
    #[default]
    Logarithmic,
    /// Decibels relative to one unit of the response.
    Decibel,
}

impl FigureStyle {
    /// Returns the frequency axis in Hz.
    pub(super) fn frequency_axis(self, usual: FrequencyScale) -> Axis {
        match self.frequency.unwrap_or(usual) {
            FrequencyScale::Linear => Axis::linear("Frequency", "Hz"),
            FrequencyScale::Logarithmic => Axis::log10("Frequency", "Hz"),
        }
    }

    /// Returns the axis of a magnitude in this unit.
    pub(super) fn magnitude_axis(self, magnitude: Quantity<'_>) -> Axis {
        match self.magnitude {
            MagnitudeScale::Logarithmic => Axis::log10(magnitude.name, magnitude.unit),
            MagnitudeScale::Decibel => {
                Axis::linear(magnitude.name, format!("dB re 1 {}", magnitude.unit))
            }
        }
    }
}
