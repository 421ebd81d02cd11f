//! Stabilisation diagram, mode indicator, and responses over frequency (measured, and explained by
//! modes).

use mechid_analysis::Modes;
use mechid_analysis::modes::{Diagrams, ModeIndicator, StabilisationRows};
use mechid_analysis::text::{compact, significant};
use mechid_plot::{Axis, Color, Curve, Figure, Panel};

use crate::ReportError;

/// Maximum number of points of a curve; a panel cannot show more.
const SHOWN: usize = 4000;

/// Draws three diagrams, one below the other: the root of the sum of squares of all responses, the
/// stabilisation diagram and the mode indicator. Each response is divided by its RMS in the band;
/// the sum is drawn as measured, as explained by the modes, and for the difference.
///
/// # Errors
/// [`ReportError`] if the diagrams cannot be computed or drawn.
pub fn figure(modes: &Modes) -> Result<Figure, ReportError> {
    let summary = modes.summary();
    let natural: Vec<f64> =
        summary.modes.iter().map(|m| m.mode.row.natural_frequency_hz.value).collect();
    let files: Vec<&str> = summary.records.iter().map(|record| record.file.as_str()).collect();
    let spectrum = modes.spectrum();
    let diagrams = modes.diagrams()?;
    let sum = (spectrum.frequency_hz.as_slice(), spectrum.measured.as_slice());
    let below = [
        stabilisation(&diagrams.stabilisation, sum),
        diagrams.mode_indicator.as_ref().map(indicator),
    ];
    let figure = Figure::new(files.join(", ")).panel(responses(modes));
    let figure = below.into_iter().flatten().fold(figure, Figure::panel);
    Ok(figure.share_x().mark_x("natural frequencies", &natural))
}

/// Draws the stabilisation diagram and the mode indicator of a saved result; `None` without poles
/// and indicator. Behind the poles is the sum of the responses, if the indicator was saved.
pub fn diagrams(title: &str, diagrams: &Diagrams) -> Option<Figure> {
    // The sum of the squared singular values equals the sum of the squares of all responses.
    let sum = |indicator: &ModeIndicator| -> Vec<f64> {
        let square = |at: usize| indicator.singular_values.iter().map(move |v| v[at].powi(2));
        (0..indicator.frequency_hz.len()).map(|at| square(at).sum::<f64>().sqrt()).collect()
    };
    let sum = diagrams.mode_indicator.as_ref().map(|one| (one.frequency_hz.as_slice(), sum(one)));
    let sum = sum.as_ref().map_or((&[][..], &[][..]), |(hz, values)| (*hz, values.as_slice()));
    let panels = [
        stabilisation(&diagrams.stabilisation, sum),
        diagrams.mode_indicator.as_ref().map(indicator),
    ];
    let figure = panels.into_iter().flatten().fold(Figure::new(title), Figure::panel);
    (!figure.panels().is_empty()).then(|| figure.share_x())
}

/// Returns every k-th value, at most [`SHOWN`] values in all.
fn thinned(values: &[f64]) -> Vec<f64> {
    values.iter().copied().step_by(values.len().div_ceil(SHOWN).max(1)).collect()
}

fn responses(modes: &Modes) -> Panel {
    let spectrum = modes.spectrum();
    let frequency = thinned(&spectrum.frequency_hz);
    let curve = |name: &str, values: &[f64]| Curve::line(name, &frequency, &thinned(values));
    let axis = Axis::log10("Responses over their RMS", "");
    let panel = Panel::new(Axis::linear("Frequency", "Hz"), axis)
        .curve(curve("measured", &spectrum.measured).color(Color::GREY).width(2.4));
    if spectrum.modelled.is_empty() {
        return panel;
    }
    panel
        .curve(curve("modes", &spectrum.modelled).color(Color::VERMILION))
        .curve(curve("difference", &spectrum.residual))
}

/// Draws the poles of models of increasing order over the sum of the responses (frequencies, in Hz,
/// and magnitudes), whose logarithm is scaled to the height of the diagram; `None` without poles.
///
/// # Source
/// Peeters & Van der Auweraer (2005), Proceedings of the 1st International Operational Modal
/// Analysis Conference (stabilisation diagram).
pub fn stabilisation(poles: &StabilisationRows, sum: (&[f64], &[f64])) -> Option<Panel> {
    let highest = *poles.order.iter().max()? as f64;
    let mut panel = Panel::new(Axis::linear("Frequency", "Hz"), Axis::linear("Order", ""));
    let (frequency, magnitude) = (thinned(sum.0), thinned(sum.1));
    let positive = || frequency.iter().zip(&magnitude).filter(|(_, value)| **value > 0.0);
    let (low, high) =
        positive().fold((f64::INFINITY, 0.0f64), |(a, b), (_, v)| (a.min(*v), b.max(*v)));
    if high > low {
        let x: Vec<f64> = positive().map(|(hz, _)| *hz).collect();
        let scaled = |value: f64| highest * (value / low).ln() / (high / low).ln();
        let y: Vec<f64> = positive().map(|(_, value)| scaled(*value)).collect();
        let curve = Curve::line("sum of the responses, logarithm", &x, &y);
        panel = panel.curve(curve.color(Color::GREY).width(1.2));
    }
    let looks =
        [("stable pole", true, 0, Color::BLUE), ("new or moving pole", false, 5, Color::VERMILION)];
    for (name, is_stable, slot, color) in looks {
        let some: Vec<usize> =
            (0..poles.order.len()).filter(|at| poles.is_stable[*at] == is_stable).collect();
        if some.is_empty() {
            continue;
        }
        let x: Vec<f64> = some.iter().map(|at| poles.frequency_hz[*at]).collect();
        let y: Vec<f64> = some.iter().map(|at| poles.order[*at] as f64).collect();
        let words = |at: &usize| {
            format!(
                "order {}: {} Hz, damping ratio {} %",
                poles.order[*at],
                compact(poles.frequency_hz[*at], 6),
                significant(100.0 * poles.damping_ratio[*at], 3)
            )
        };
        let notes = some.iter().map(words).collect();
        panel = panel.curve(Curve::points(name, &x, &y).slot(slot).color(color).notes(notes));
    }
    Some(panel)
}

fn indicator(indicator: &ModeIndicator) -> Panel {
    let frequency = thinned(&indicator.frequency_hz);
    let name = if indicator.is_measured { "Mode indicator" } else { "Mode indicator of the modes" };
    let mut panel = Panel::new(Axis::linear("Frequency", "Hz"), Axis::log10(name, ""));
    for (number, values) in (1..).zip(&indicator.singular_values) {
        let pairs: Vec<(f64, f64)> =
            frequency.iter().copied().zip(thinned(values)).filter(|(_, v)| *v > 0.0).collect();
        if pairs.is_empty() {
            continue;
        }
        let (x, y): (Vec<f64>, Vec<f64>) = pairs.into_iter().unzip();
        panel = panel.curve(Curve::line(format!("singular value {number}"), &x, &y));
    }
    panel
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poles_are_drawn_with_their_words_over_the_scaled_sum() {
        let poles = StabilisationRows {
            order: vec![2, 4],
            frequency_hz: vec![5.0, 5.01],
            damping_ratio: vec![0.02; 2],
            is_stable: vec![false, true],
        };
        let sum: (&[f64], &[f64]) = (&[1.0, 5.0, 9.0], &[1e-6, 1e-3, 0.0]);
        let figure = Figure::new("").panel(stabilisation(&poles, sum).unwrap());
        let curves = figure.panels()[0].data();
        assert_eq!(curves[0].y(), [0.0, 4.0]);
        let svg = figure.to_interactive_svg("s", "s").unwrap();
        assert!(svg.contains("order 4: 5.01 Hz, damping ratio 2.00 %"), "{svg}");
        assert!(stabilisation(&StabilisationRows::default(), sum).is_none());
    }
}
