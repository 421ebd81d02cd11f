//! Force and response over time.

use mechid_plot::{Axis, Color, Curve, Figure, Panel};

use super::Simulation;
use super::summary::Group;

/// Maximum number of degrees of freedom that are drawn, side by side.
const SHOWN: usize = 4;

impl Simulation {
    /// Draws the measured record over time: a column of panels for each of at most four degrees of
    /// freedom, with force (N), displacement (m), velocity (m/s) and acceleration (m/s²).
    pub fn figure(&self, title: &str) -> Figure {
        let groups = self.groups();
        let counts = groups.iter().map(|group| group.dofs.len());
        let (fewest, most) = (counts.clone().min().unwrap_or(0), counts.max().unwrap_or(0));
        let shown = fewest.min(SHOWN);
        let mut figure = Figure::new(if shown < most {
            format!("{title}, the first {shown} of {most} degrees of freedom")
        } else {
            title.to_owned()
        });
        for (group, color) in groups.iter().zip(Color::CYCLE) {
            for at in 0..shown {
                figure = figure.panel(panel(group, at, color));
            }
        }
        figure.columns(shown).share_x()
    }
}

fn panel(group: &Group<'_>, channel: usize, color: Color) -> Panel {
    let record = group.measured;
    let mut name = group.named(channel, ' ');
    name[..1].make_ascii_uppercase();
    let time: Vec<f64> = record.sampling().times().collect();
    Panel::new(Axis::linear("Time", "s"), Axis::linear(name, group.unit))
        .curve(Curve::line("", &time, record.channel(channel)).color(color).width(1.2))
}
