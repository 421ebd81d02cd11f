//! Measured and computed responses over time, and their difference.

use mechid_analysis::identify::prediction::Compared;
use mechid_plot::{Axis, Color, Curve, Figure, Panel};

/// Maximum number of samples that are drawn; a panel cannot show more.
const SHOWN: usize = 4000;

/// Returns the responses of the first measured quantity, measured and computed, above the residual,
/// for every degree of freedom; `computed` is a word for the computed response, such as predicted.
pub fn motion(title: &str, compared: &Compared, computed: &str) -> Figure {
    let (measured, predicted) = (&compared.measured, &compared.predicted);
    let shown = measured.len().min(SHOWN);
    let time: Vec<f64> = measured.sampling().times().take(shown).collect();
    let unit = compared.kind.unit();
    let mut figure = Figure::new(if shown < measured.len() {
        format!("{title}; the first {shown} samples")
    } else {
        title.to_owned()
    });
    for channel in 0..measured.channels() {
        let name = &compared.names[channel];
        let (x, model) =
            (&measured.channel(channel)[..shown], &predicted.channel(channel)[..shown]);
        let residual: Vec<f64> = x.iter().zip(model).map(|(x, model)| x - model).collect();
        let axis = || Axis::linear("Time", "s");
        figure = figure
            .panel(
                Panel::new(axis(), Axis::linear(name, unit))
                    .curve(Curve::line("measured", &time, x).color(Color::GREY).width(2.4))
                    .curve(Curve::line(computed, &time, model).color(Color::VERMILION)),
            )
            .panel(
                Panel::new(axis(), Axis::linear(format!("Residual of {name}"), unit))
                    .curve(Curve::line("", &time, &residual)),
            );
    }
    figure.share_x()
}
