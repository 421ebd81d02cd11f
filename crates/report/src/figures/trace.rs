//! Curves of complex frequency responses.

use std::f64::consts::TAU;

use mechid_plot::charts::{FrequencyResponse, Quantity, bode};
use mechid_plot::{Figure, NEPER};
use nalgebra::Complex;

use super::style::{FigureStyle, FrequencyScale, MagnitudeScale, PhaseStyle};

/// Curve of a frequency response before it is drawn.
pub struct Trace {
    name: String,
    frequency_hz: Vec<f64>,
    magnitude: Vec<f64>,
    phase_deg: Vec<f64>,
    standard_error: Vec<f64>,
}

/// Maximum difference, in degrees, of two angles that are equal up to rounding.
const ALIKE: f64 = 1e-6;

/// Returns an angle, in degrees. An angle of ±180° (up to rounding) gets the sign of the previous
/// angle, so that the phase of an undamped system does not alternate. Without a previous angle,
/// ±180° becomes −180°.
fn wrapped(previous: Option<f64>, angle: f64) -> f64 {
    match angle.abs() > 180.0 - ALIKE {
        true if previous.is_some_and(|previous| previous > 90.0) => 180.0,
        true => -180.0,
        false => angle,
    }
}

/// Returns an angle on the branch nearest to another angle, both in degrees. If two branches are
/// equally near, as at a resonance of an undamped system, returns the angle with the smaller
/// magnitude, and −180° instead of 180°.
fn next_to(other: f64, angle: f64) -> f64 {
    let near = angle - 360.0 * ((angle - other) / 360.0).round();
    let beyond = near - (near - other).signum() * 360.0;
    let smaller = beyond.abs() < near.abs() - ALIKE;
    let negative = beyond.abs() < near.abs() + ALIKE && beyond < near;
    let as_near = (near - other).abs() > 180.0 - ALIKE;
    if as_near && (smaller || negative) { beyond } else { near }
}

impl Trace {
    /// Creates the curve of points (ω, H).
    pub fn line(
        style: FigureStyle,
        name: String,
        points: impl Iterator<Item = (f64, Complex<f64>)>,
    ) -> Self {
        let mut previous = 0.0;
        Self::from_points(style, name, points, |_, angle| {
            previous = next_to(previous, angle);
            previous
        })
    }

    /// Creates the curve of points (ω, H). Each phase is on the branch nearest to the phase of
    /// another curve at about the same frequency.
    pub fn beside(
        style: FigureStyle,
        curve: &Self,
        name: String,
        points: impl Iterator<Item = (f64, Complex<f64>)>,
    ) -> Self {
        Self::from_points(style, name, points, |frequency_hz, angle| {
            let right = curve.frequency_hz.partition_point(|f| *f < frequency_hz);
            let at = right.min(curve.phase_deg.len().saturating_sub(1));
            next_to(curve.phase_deg.get(at).copied().unwrap_or(0.0), angle)
        })
    }

    /// Returns the curve with standard errors of its magnitudes, one for each drawn point, in the
    /// unit of the response. If one of the errors is undefined, the curve is returned without
    /// standard errors.
    ///
    /// # Source
    /// 20 lg(x) has the derivative 20/(x ln 10).
    pub fn standard_error(mut self, style: FigureStyle, errors: Vec<f64>) -> Self {
        let is_whole = errors.len() == self.magnitude.len();
        if is_whole && errors.iter().all(|error| error.is_finite()) {
            let of_decibels =
                |(error, level): (f64, &f64)| NEPER * error / 10f64.powf(level / 20.0);
            self.standard_error = match style.magnitude {
                MagnitudeScale::Logarithmic => errors,
                MagnitudeScale::Decibel => {
                    errors.into_iter().zip(&self.magnitude).map(of_decibels).collect()
                }
            };
        }
        self
    }

    /// Returns whether a style draws a response, in any unit, at an angular frequency (rad/s).
    pub fn is_drawn(style: FigureStyle, omega: f64, h: Complex<f64>) -> bool {
        let positive = style.frequency == Some(FrequencyScale::Logarithmic);
        h.norm() > 0.0 && (!positive || omega > 0.0)
    }

    /// Creates a curve without the points that an axis cannot show: zero magnitudes, and 0 Hz on a
    /// logarithmic axis.
    fn from_points(
        style: FigureStyle,
        name: String,
        points: impl Iterator<Item = (f64, Complex<f64>)>,
        mut continuous: impl FnMut(f64, f64) -> f64,
    ) -> Self {
        let mut trace = Self {
            name,
            frequency_hz: Vec::new(),
            magnitude: Vec::new(),
            phase_deg: Vec::new(),
            standard_error: Vec::new(),
        };
        for (omega, h) in points.filter(|(omega, h)| Self::is_drawn(style, *omega, *h)) {
            let angle = h.arg().to_degrees();
            trace.frequency_hz.push(omega / TAU);
            trace.magnitude.push(match style.magnitude {
                MagnitudeScale::Logarithmic => h.norm(),
                MagnitudeScale::Decibel => 20.0 * h.norm().log10(),
            });
            trace.phase_deg.push(match style.phase {
                PhaseStyle::Wrapped => wrapped(trace.phase_deg.last().copied(), angle),
                PhaseStyle::Continuous => continuous(omega / TAU, angle),
            });
        }
        trace
    }

    /// Returns the curve with `more` appended to its name.
    pub fn suffixed(mut self, more: &str) -> Self {
        self.name += more;
        self
    }

    /// Returns the largest magnitude, in the unit of the response; 0 without points.
    pub fn largest(&self, style: FigureStyle) -> f64 {
        let magnitude = |value: &f64| match style.magnitude {
            MagnitudeScale::Logarithmic => *value,
            MagnitudeScale::Decibel => 10f64.powf(value / 20.0),
        };
        self.magnitude.iter().map(magnitude).fold(0.0, f64::max)
    }

    /// Returns whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.magnitude.is_empty()
    }

    /// Returns the curve in the form that a chart needs.
    pub fn as_response(&self) -> FrequencyResponse<'_> {
        FrequencyResponse {
            name: &self.name,
            frequency: &self.frequency_hz,
            magnitude: &self.magnitude,
            phase_deg: &self.phase_deg,
            standard_error: &self.standard_error,
        }
    }
}

impl FigureStyle {
    /// Draws measured points and fitted lines, magnitude above phase.
    pub(super) fn chart(
        self,
        title: &str,
        usual: FrequencyScale,
        magnitude: Quantity<'_>,
        [measured, fitted]: [&[Trace]; 2],
    ) -> Figure {
        let [measured, fitted] = [measured, fitted]
            .map(|traces| traces.iter().map(Trace::as_response).collect::<Vec<_>>());
        let axes = (self.frequency_axis(usual), self.magnitude_axis(magnitude));
        bode(title, axes.0, axes.1, &measured, &fitted)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With a standard error of 1 % of the magnitude, the upper edge of the band must be 20
    /// log₁₀(1.02) dB above the curve.
    #[test]
    fn levels_in_decibels_keep_the_error_of_their_magnitude() {
        let style = FigureStyle { magnitude: MagnitudeScale::Decibel, ..FigureStyle::default() };
        let points = [2e-6, 4e-3].map(|size| (1.0, Complex::new(0.0, size)));
        let trace = Trace::line(style, String::new(), points.into_iter());
        let trace = trace.standard_error(style, vec![2e-8, 4e-5]);
        for (level, error) in trace.magnitude.iter().zip(&trace.standard_error) {
            let upper = level + NEPER * (2.0 * error / NEPER).ln_1p();
            assert!((upper - level - 20.0 * 1.02f64.log10()).abs() < 1e-12);
        }
        assert_eq!(trace.standard_error.len(), 2);
        assert!((trace.largest(style) - 4e-3).abs() < 1e-15);
    }
}
