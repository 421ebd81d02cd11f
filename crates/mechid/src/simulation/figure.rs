//! Force and motion over time.

use mechid_plot::{Axis, Color, Curve, Figure, Panel};

use super::Simulation;
use super::summary::Group;

/// Degrees of freedom drawn at most, side by side.
const SHOWN: usize = 4;

impl Simulation {
    /// Draws the measured record over time: a column of panels for each degree of freedom, the first
    /// four at most, with force (N), displacement (m), velocity (m/s) and acceleration (m/s²).
    pub fn figure(&self, title: &str) -> Figure {
        let dof = self.measured_force.channels();
        let shown = dof.min(SHOWN);
        let mut figure = Figure::new(match shown < dof {
            true => format!("{title}, degrees of freedom 1 to {SHOWN} of {dof}"),
            false => title.to_owned(),
        });
        for (group, color) in self.groups().iter().zip(Color::CYCLE) {
            for at in 0..shown {
                figure = figure.panel(panel(group, at, color));
            }
        }
        figure.columns(shown).share_x()
    }
}

fn panel(group: &Group<'_>, dof: usize, color: Color) -> Panel {
    let record = group.measured;
    let mut name = match record.channels() {
        1 => group.name.to_owned(),
        _ => format!("{} {}", group.name, dof + 1),
    };
    name[..1].make_ascii_uppercase();
    let time: Vec<f64> = record.sampling().times().collect();
    Panel::new(Axis::linear("Time", "s"), Axis::linear(name, group.unit))
        .curve(Curve::line("", &time, record.channel(dof)).color(color).width(1.2))
}
