//! The pictures of the report.

use mechid::estimate::frequency_domain::Motion;
use mechid::plot::{Axis, Color, Curve, Dash, Figure, Legend, Panel, Reference};
use mechid::signal::{Record, Spectrum};

use super::reconstruction::Reconstruction;
use super::residual::Residual;
use super::{Contents, excitation};
use crate::commands::identify::Identified;
use crate::error::CliError;

/// Width of a figure, px: two stand side by side on a screen, and on a telephone the numbers of
/// one can still be read.
const WIDTH: f64 = 480.0;

/// Height of a panel with its labels, px.
const PANEL: f64 = 210.0;

/// A picture with its words.
pub struct Drawn {
    pub id: &'static str,
    pub svg: String,
    pub caption: String,
}

fn drawn(id: &'static str, figure: Figure, caption: String) -> Result<Drawn, CliError> {
    let panels = figure.panels();
    // Many curves have a legend of several rows.
    let curves = panels.iter().map(|panel| panel.data().len()).max().unwrap_or(0);
    let height = PANEL * (panels.len() as f64).max(1.5) + 12.0 * curves as f64;
    let figure = figure.size(WIDTH, height);
    let svg = figure.to_inline_svg(id, &caption)?;
    Ok(Drawn { id, svg, caption })
}

/// Symbol and unit of a kind of motion.
pub fn symbol(kind: Motion) -> (&'static str, &'static str) {
    match kind {
        Motion::Displacement => ("Displacement", "m"),
        Motion::Velocity => ("Velocity", "m/s"),
        Motion::Acceleration => ("Acceleration", "m/s²"),
    }
}

/// `name`, numbered where there are several.
fn numbered(name: &str, dof: usize, dofs: usize) -> String {
    if dofs == 1 { name.into() } else { format!("{name} {}", dof + 1) }
}

fn times(record: &Record) -> Vec<f64> {
    record.sampling().times().collect()
}

/// Time history of the window above the amplitudes of its mean period, of each channel.
fn history(name: (&str, &str), window: &Record, period: &Record, channels: &[usize]) -> Figure {
    let spectrum = Spectrum::of(period);
    let hz: Vec<f64> = (1..spectrum.len()).map(|n| spectrum.frequency_hz(n)).collect();
    let mut figure = Figure::new("");
    for &c in channels {
        let label = numbered(name.0, c, window.channels());
        let curve = Curve::line("", &times(window), window.channel(c)).width(1.0);
        let time =
            Panel::new(Axis::linear("Time in the window", "s"), Axis::linear(&label, name.1));
        figure = figure.panel(time.curve(curve));
        let amplitude: Vec<f64> = (1..spectrum.len()).map(|n| spectrum.line(n, c).norm()).collect();
        let axis = Axis::linear(numbered("Amplitude", c, window.channels()), name.1);
        let stems = Curve::stems("", &hz, &amplitude).color(Color::VERMILION);
        figure = figure.panel(Panel::new(Axis::linear("Frequency", "Hz"), axis).curve(stems));
    }
    figure
}

/// A thin line over the thick one that it should hide.
fn overlay(t: &[f64], measured: &[f64], name: &str, own: &[f64]) -> [Curve; 2] {
    [
        Curve::line("measured", t, measured).color(Color::GREY).width(2.6),
        Curve::line(name, t, own).color(Color::BLUE).width(1.1).dash(Dash::Solid),
    ]
}

/// Time histories and spectra of force and motion.
pub fn data(found: &Identified) -> Result<Vec<Drawn>, CliError> {
    let source = &found.measured;
    let (motion, kind) = source.motion();
    let (force, mean) = (excitation::force(found)?, found.fitted.frequency.is_some());
    let period = if mean { motion.period_mean(source.period)? } else { motion.clone() };
    let of = match (mean, source.periods) {
        (false, _) => "the window taken as one period",
        (true, 1) => "the period",
        (true, _) => "the mean period",
    };
    let acting: Vec<usize> =
        (0..force.channels()).filter(|c| force.column(*c).amax() > 0.0).collect();
    let all: Vec<usize> = (0..motion.channels()).collect();
    let name = symbol(kind);
    Ok(vec![
        drawn(
            "force",
            history(("Force", "N"), &source.force, &force, &acting),
            format!("Measured force: time history of the window, and line amplitudes of {of}."),
        )?,
        drawn(
            "motion",
            history(name, motion, &period, &all),
            format!("Measured {kind}: time history of the window, and line amplitudes of {of}."),
        )?,
    ])
}

/// Measured and identified receptance.
///
/// # Errors
/// [`CliError::NoSpectra`], [`CliError::NothingToDraw`].
pub fn receptance(found: &Identified) -> Result<Drawn, CliError> {
    let caption = "Receptance, motion over force: measured on the lines used, and that of the \
                   identified machine.";
    drawn("receptance", found.receptance("")?, caption.into())
}

/// Measured and modelled motion with what is left, over one period or the whole open record.
pub fn fit(contents: &Contents<'_>, residual: &Residual) -> Result<Drawn, CliError> {
    let source = &contents.found.measured;
    let (label, unit) = symbol(residual.kind);
    let [measured, modelled, left] = [&residual.measured, &residual.modelled, &residual.residual]
        .map(|record| record.window(0, source.period));
    let (measured, modelled, left) = (measured?, modelled?, left?);
    let t = times(&measured);
    let mut figure = Figure::new("").share_x();
    for c in 0..measured.channels() {
        let axis = |name: &str| Axis::linear(numbered(name, c, measured.channels()), unit);
        let time = || Axis::linear("Time in the window", "s");
        let both = Panel::new(time(), axis(label))
            .curves(overlay(&t, measured.channel(c), "modelled", modelled.channel(c)))
            .legend(Legend::Above);
        let rest = Curve::line("", &t, left.channel(c)).color(Color::VERMILION).width(1.0);
        figure = figure.panel(both).panel(Panel::new(time(), axis("Residual")).curve(rest));
    }
    let extent = match source.periods {
        1 => "over the window",
        _ => "over the first period",
    };
    drawn(
        "fit",
        figure,
        format!(
            "Measured {} and that of the identified machine under the measured force {extent}; below, their difference.",
            residual.kind
        ),
    )
}

/// Amplitudes of motion and residual, on the lines used or all.
pub fn residual_spectrum(found: &Identified, residual: &Residual) -> Result<Drawn, CliError> {
    let source = &found.measured;
    let lines = found.fitted.frequency.as_ref().map(|(lines, _)| lines.as_slice().to_vec());
    let mean = |record: &Record| match lines {
        Some(_) => record.period_mean(source.period),
        None => Ok(record.clone()),
    };
    let [motion, left] = [&residual.measured, &residual.residual].map(mean);
    let (motion, left) = (Spectrum::of(&motion?), Spectrum::of(&left?));
    let mut shown = lines.unwrap_or_else(|| (1..motion.len()).collect());
    shown.sort_unstable();
    let (_, unit) = symbol(residual.kind);
    let mut figure = Figure::new("");
    for c in 0..motion.channels() {
        let points = |spectrum: &Spectrum| -> (Vec<f64>, Vec<f64>) {
            let point = |n: &usize| (spectrum.frequency_hz(*n), spectrum.line(*n, c).norm());
            // A logarithmic axis has no place for nothing.
            shown.iter().map(point).filter(|(_, amplitude)| *amplitude > 0.0).unzip()
        };
        let axis = Axis::log10(numbered("Amplitude", c, motion.channels()), unit);
        let mut panel = Panel::new(Axis::linear("Frequency", "Hz"), axis).legend(Legend::Above);
        for (name, spectrum, slot) in [("measured", &motion, 0), ("residual", &left, 1)] {
            let (hz, amplitude) = points(spectrum);
            if !hz.is_empty() {
                panel = panel.curve(Curve::points(name, &hz, &amplitude).slot(slot));
            }
        }
        figure = figure.panel(panel);
    }
    drawn(
        "residual-spectrum",
        figure,
        format!(
            "Spectra of the measured {} and of the residual: noise lies flat, what the model misses has the shape of a resonance or of the force.",
            residual.kind
        ),
    )
}

/// Correlation of the residual with itself and with the forces.
pub fn correlations(residual: &Residual) -> Result<Drawn, CliError> {
    let dofs = residual.channels.len();
    let mut figure = Figure::new("");
    for (c, channel) in residual.channels.iter().enumerate() {
        let own = (1, "Autocorrelation".to_owned(), &channel.whiteness);
        let forces = channel.forces.iter().map(|(force, found)| {
            let first = -((found.coefficients.len() / 2) as i32);
            (first, numbered("With the force", *force, dofs), found)
        });
        for (first, name, found) in std::iter::once(own).chain(forces) {
            let lags: Vec<f64> = (first..).take(found.coefficients.len()).map(f64::from).collect();
            let label = numbered(&name, c, dofs);
            let panel = Panel::new(Axis::linear("Lag", "samples"), Axis::linear(label, ""))
                .curve(Curve::stems("", &lags, &found.coefficients).color(Color::BLUE))
                .reference(Reference::horizontal("95 % of white noise", found.bound))
                .reference(Reference::horizontal("", -found.bound))
                .legend(Legend::Above);
            figure = figure.panel(panel);
        }
    }
    drawn(
        "correlations",
        figure,
        "Autocorrelation of the residual, and its correlation with the force; 95 % of the stems of white noise stay between the dashed lines.".into(),
    )
}

/// The force found and the one measured.
pub fn force(reconstruction: &Reconstruction) -> Result<Drawn, CliError> {
    let (found, measured) = (reconstruction.found.record(), &reconstruction.measured);
    let t = times(measured);
    let mut figure = Figure::new("").share_x();
    for &c in &reconstruction.forced {
        let (own, truth) = (found.channel(c), measured.channel(c));
        let axis = |name: &str| Axis::linear(numbered(name, c, measured.channels()), "N");
        let time = || Axis::linear("Time in the window", "s");
        let both = Panel::new(time(), axis("Force"))
            .curves(overlay(&t, truth, "found from the motion", own))
            .legend(Legend::Above);
        let apart: Vec<f64> = own.iter().zip(truth).map(|(f, m)| f - m).collect();
        let mut below = Panel::new(time(), axis("Difference"));
        if let Some(error) = reconstruction.found.standard_error() {
            let upper: Vec<f64> = error.channel(c).iter().map(|e| 2.0 * e).collect();
            let lower: Vec<f64> = upper.iter().map(|e| -e).collect();
            below = below
                .curve(Curve::band("± 2 standard errors", &t, &lower, &upper))
                .legend(Legend::Above);
        }
        let difference = Curve::line("", &t, &apart).color(Color::VERMILION).width(1.0);
        figure = figure.panel(both).panel(below.curve(difference));
    }
    drawn(
        "reconstructed-force",
        figure,
        "Force found from the motion with the identified machine, and the measured one; below, their difference.".into(),
    )
}
