//! Figures for frequent purposes: records with spectra, Bode plots, sweeps, stability.

use crate::axis::Axis;
use crate::curve::{Curve, Reference};
use crate::figure::Figure;
use crate::panel::{Panel, ResponsePart};
use crate::style::{Color, Dash};

/// Quantity with its unit, such as ("Force", "N").
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Quantity<'a> {
    /// Name on an axis.
    pub name: &'a str,
    /// Unit; empty for a pure number.
    pub unit: &'a str,
}

impl<'a> Quantity<'a> {
    /// Creates a quantity.
    pub const fn new(name: &'a str, unit: &'a str) -> Self {
        Quantity { name, unit }
    }
}

/// One curve of a chart: abscissae and ordinates of equal length with a name.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Series<'a> {
    /// Legend label.
    pub name: &'a str,
    /// Abscissae, one for each point, in the unit of the axis.
    pub x: &'a [f64],
    /// Ordinates, one for each point, in the unit of the axis.
    pub y: &'a [f64],
    /// Index in the cycle of curve styles; `None` follows the order of the series.
    pub slot: Option<usize>,
}

impl<'a> Series<'a> {
    /// Creates a series of points, `x` and `y` of equal length, in the units of the axes.
    pub const fn new(name: &'a str, x: &'a [f64], y: &'a [f64]) -> Self {
        Series { name, x, y, slot: None }
    }

    /// Returns the series with style number `slot` of the cycle; without this call, the style
    /// follows the position of the series.
    #[must_use]
    pub const fn slot(mut self, slot: usize) -> Self {
        self.slot = Some(slot);
        self
    }
}

/// Returns a record over time (s) above its line spectrum (amplitudes over frequency, Hz).
pub fn time_and_spectrum(
    title: &str,
    quantity: Quantity<'_>,
    record: Series<'_>,
    spectrum: Series<'_>,
) -> Figure {
    let time = Panel::new(Axis::linear("Time", "s"), Axis::linear(quantity.name, quantity.unit))
        .curve(Curve::line("", record.x, record.y).width(1.2));
    let amplitude = Axis::linear(format!("{} amplitude", quantity.name), quantity.unit);
    let frequency = Panel::new(Axis::linear("Frequency", "Hz"), amplitude)
        .curve(Curve::stems("", spectrum.x, spectrum.y).color(Color::VERMILION));
    Figure::new(title).panel(time).panel(frequency)
}

/// One frequency response: magnitude and phase at the same frequencies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrequencyResponse<'a> {
    /// Legend label.
    pub name: &'a str,
    /// Frequencies, one for each point, in the unit of the axis; positive.
    pub frequency: &'a [f64],
    /// Magnitudes, one for each point, in the unit of the axis; positive.
    pub magnitude: &'a [f64],
    /// Phases, degrees.
    pub phase_deg: &'a [f64],
    /// Standard errors of the magnitudes, one for each point, in the same unit; empty if not known.
    pub standard_error: &'a [f64],
}

/// Returns a Bode plot: measured points under fitted lines, magnitude above phase (degrees). Lines
/// in the phase panel are interrupted at jumps of more than 180°.
///
/// `frequency` is the abscissa, such as `Axis::log10("Frequency", "Hz")`, and `magnitude` the
/// ordinate of the upper panel, such as `Axis::log10("Receptance", "m/N")`; the fits may have a
/// finer frequency grid than the measurement.
pub fn bode(
    title: &str,
    frequency: Axis,
    magnitude: Axis,
    measured: &[FrequencyResponse<'_>],
    fitted: &[FrequencyResponse<'_>],
) -> Figure {
    let mut above = Panel::new(frequency.clone(), magnitude).part(ResponsePart::Magnitude);
    let phase = Axis::linear("Phase", "°").step(45.0);
    let mut below = Panel::new(frequency, phase).part(ResponsePart::Phase);
    for (slot, response) in measured.iter().enumerate() {
        // A single measurement is the reference for all fits and has a neutral colour.
        let color =
            if measured.len() == 1 { Color::GREY } else { Color::CYCLE[slot % Color::CYCLE.len()] };
        let points = |label: &str, y: &[f64]| {
            Curve::points(label, response.frequency, y).slot(slot).color(color)
        };
        let magnitude = points(response.name, response.magnitude).phase(response.phase_deg);
        above = above.curve(magnitude.standard_error(response.standard_error));
        below = below.curve(points("", response.phase_deg));
    }
    for (index, response) in fitted.iter().enumerate() {
        let slot = if measured.len() == fitted.len() { index } else { index + measured.len() };
        let color = if measured.len() == 1 {
            Color::CYCLE[(index + 1) % Color::CYCLE.len()]
        } else {
            Color::CYCLE[slot % Color::CYCLE.len()]
        };
        let line = |label: &str, x: &[f64], y: &[f64]| {
            Curve::line(label, x, y).slot(slot).dash(Dash::Solid).color(color)
        };
        let magnitude = line(response.name, response.frequency, response.magnitude);
        let magnitude = magnitude.phase(response.phase_deg);
        above = above.curve(magnitude.standard_error(response.standard_error));
        let runs = response.phase_deg.chunk_by(|a, b| (b - a).abs() <= 180.0);
        let mut start = 0;
        for run in runs {
            let end = start + run.len();
            below = below.curve(line("", &response.frequency[start..end], run));
            start = end;
        }
    }
    Figure::new(title).panel(above).panel(below).share_x()
}

/// Returns a panel with the estimates of one coefficient over a swept setting: one marked line for
/// each method, and a reference line for the true value. All values are in the units of the axes.
///
/// The k-th method always has the k-th style, so that several sweeps can be compared.
pub fn sweep_panel(
    setting: Axis,
    coefficient: Quantity<'_>,
    methods: &[Series<'_>],
    truth: Option<f64>,
) -> Panel {
    let mut panel = Panel::new(setting, Axis::linear(coefficient.name, coefficient.unit));
    for (index, method) in methods.iter().enumerate() {
        let curve = Curve::marked_line(method.name, method.x, method.y);
        panel = panel.curve(curve.slot(method.slot.unwrap_or(index)));
    }
    match truth {
        Some(value) => panel.reference(Reference::horizontal("true value", value)),
        None => panel,
    }
}

/// Returns a figure with one [`sweep_panel`]; all values are in the units of the axes.
pub fn sweep(
    title: &str,
    setting: Axis,
    coefficient: Quantity<'_>,
    methods: &[Series<'_>],
    truth: Option<f64>,
) -> Figure {
    Figure::new(title).panel(sweep_panel(setting, coefficient, methods, truth))
}

/// Returns a figure of the spectral radius of time-stepping schemes against the step, with the
/// limit of stability.
///
/// Abscissae are Δt/T, the step over the natural period, all positive; ordinates are spectral
/// radii.
pub fn stability(title: &str, schemes: &[Series<'_>]) -> Figure {
    let mut panel = Panel::new(
        Axis::log10("Step over natural period Δt/T", ""),
        Axis::linear("Spectral radius ρ", ""),
    )
    .reference(Reference::horizontal("limit of stability", 1.0));
    for scheme in schemes {
        panel = panel.curve(Curve::line(scheme.name, scheme.x, scheme.y));
    }
    // Schemes are compared at spectral radii ρ ≤ 1, so that the curves of unstable schemes may be
    // clipped.
    panel.y = panel.y.range(0.0, 1.6);
    Figure::new(title).panel(panel)
}
