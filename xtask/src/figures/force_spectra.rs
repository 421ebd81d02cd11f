//! Spectra of identified forces: figures 5.4.x, 5.5.x, 5.8.x, 5.9.x, of Appendix A and of the
//! papers.

use mechid::plot::{Axis, Curve, Dash, Figure, Panel, Reference};

use super::Plan;
use super::series::{BEARING, Domain, Equation, ForceLines, Reading, force_lines, same_ordinates};
use super::sweeps::slot;
use crate::thesis::case::{Case, Machine};
use crate::thesis::published::Method;

/// One simulation and the method that identifies its force.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Spectra {
    case: Case,
    domain: Domain,
    equation: Equation,
}

impl Spectra {
    fn figure(self, number: &str) -> Result<Figure, String> {
        let equation = match self.equation {
            Equation::Continuous => "continuous",
            Equation::Discretised => "discretised",
        };
        let title = format!(
            "{number}: Force by the {equation} equation, parameters of the {}, NPI = {}, N_{{t}} = {}",
            self.domain.name(),
            self.case.npi,
            self.case.nt
        );
        let figure = Figure::new(title).shared_legend().share_x().columns(2);
        Ok(self.panels()?.into_iter().fold(figure, Figure::panel))
    }

    /// Returns the panels with and without slips side by side; for the bearing, the driven
    /// direction is above the other direction.
    fn panels(self) -> Result<Vec<Panel>, String> {
        let readings: Result<Vec<Vec<ForceLines>>, String> =
            Reading::BOTH.into_iter().map(|reading| self.lines(reading)).collect();
        let readings = readings?;
        let directions: &[(usize, &str)] = match self.case.machine {
            Machine::SingleDof { .. } => &[(0, "|F̂|")],
            Machine::Bearing { .. } => &[(1, "|F̂_{y}|"), (0, "|F̂_{x}|, true value 0")],
        };
        let row = |&(dof, name): &(usize, &str)| {
            let pair = Reading::BOTH.iter().zip(&readings);
            same_ordinates(
                pair.map(|(reading, lines)| self.panel(*reading, lines, dof, name)).collect(),
            )
        };
        Ok(directions.iter().flat_map(row).collect())
    }

    fn lines(self, reading: Reading) -> Result<Vec<ForceLines>, String> {
        let one =
            |&method: &Method| force_lines(reading, self.case, method, self.domain, self.equation);
        Method::ALL.iter().map(one).collect()
    }

    fn panel(self, reading: Reading, lines: &[ForceLines], dof: usize, name: &str) -> Panel {
        // The discretised equation can change the force by a large factor, so its axis is
        // logarithmic. The continuous equation changes the force by a fraction only.
        let ordinate = match self.equation {
            Equation::Continuous => Axis::linear(name, "N"),
            Equation::Discretised => Axis::log10(name, "N"),
        };
        let mut panel = Panel::new(Axis::log10("Angular frequency ω", "rad/s"), ordinate)
            .title(reading.title());
        for (method, found) in Method::ALL.iter().zip(lines) {
            let curve = Curve::line(method.name(), &found.omega, &found.amplitude[dof]);
            panel = panel.curve(curve.slot(slot(*method)));
        }
        let driven = dof + 1 == self.case.machine.system().dof();
        if driven {
            panel =
                panel.reference(Reference::horizontal("true force", self.case.machine.amplitude()));
        }
        panel
            .reference(Reference::vertical("ω_{n}", self.case.machine.omega_n()).dash(Dash::Dotted))
    }
}

/// All force figures.
pub(crate) fn plans() -> Vec<Plan> {
    use Domain::{Frequency, Time};
    use Equation::{Continuous, Discretised};
    let sdof = |npi: f64, domain, equation| Spectra {
        case: Case { machine: Machine::SDOF, nt: 256, npi },
        domain,
        equation,
    };
    let bearing = |npi: f64, nt: usize, domain, equation| Spectra {
        case: Case { machine: BEARING, nt, npi },
        domain,
        equation,
    };
    let figures = [
        ("5.4.2", sdof(20.0, Time, Continuous)),
        ("5.4.3", sdof(3.4, Time, Continuous)),
        ("5.4.5", sdof(20.0, Frequency, Continuous)),
        ("5.4.6", sdof(8.0, Frequency, Continuous)),
        ("5.5.2", sdof(20.0, Time, Discretised)),
        ("5.5.3", sdof(3.4, Time, Discretised)),
        ("5.8.2", bearing(6.0, 256, Time, Continuous)),
        ("5.8.3", bearing(14.0, 256, Time, Continuous)),
        ("5.8.4", bearing(6.0, 512, Time, Continuous)),
        ("5.8.5", bearing(14.0, 512, Time, Continuous)),
        ("5.8.7", bearing(10.0, 256, Frequency, Continuous)),
        ("5.8.8", bearing(20.0, 256, Frequency, Continuous)),
        ("5.9.2", bearing(6.0, 256, Time, Discretised)),
        ("5.9.3", bearing(14.0, 256, Time, Discretised)),
        ("A-force-npi-10", bearing(10.0, 512, Frequency, Continuous)),
        ("A-force-npi-20", bearing(20.0, 512, Frequency, Continuous)),
        ("P1-4", bearing(6.0, 256, Time, Continuous)),
        ("P1-5", bearing(2.0, 256, Time, Continuous)),
        ("P1-6", bearing(6.0, 256, Time, Discretised)),
        ("P1-7", bearing(2.0, 256, Time, Discretised)),
    ];
    figures
        .into_iter()
        .map(|(number, spectra)| Plan { number, draw: Box::new(move || spectra.figure(number)) })
        .collect()
}
