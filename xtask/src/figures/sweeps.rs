//! Estimates against NPI: figures 5.2.4–5.2.9, 5.3.x, 5.6.x, 5.7.x and those of Appendix A.

use std::sync::Arc;

use mechid::plot::charts::{Quantity, Series, sweep_panel};
use mechid::plot::{Axis, Dash, Figure, Panel, Reference};

use super::Plan;
use super::series::{BEARING, Domain, Reading, same_ordinates};
use crate::thesis::case::{Case, Machine};
use crate::thesis::published::Method;

/// Sweep: one machine, one estimator, many NPI.
#[derive(Debug, Clone, PartialEq)]
struct Sweep {
    machine: Machine,
    domain: Domain,
    nt: usize,
    npi: Vec<f64>,
    methods: Vec<Method>,
    /// Range of NPI that the dissertation recommends, if it names one.
    window: Option<(f64, f64)>,
}

impl Sweep {
    fn new(machine: Machine, domain: Domain, nt: usize, npi: Vec<f64>) -> Self {
        Sweep { machine, domain, nt, npi, methods: Method::ALL.to_vec(), window: None }
    }

    fn only(mut self, method: Method) -> Self {
        self.methods = vec![method];
        self
    }

    fn window(mut self, low: f64, high: f64) -> Self {
        self.window = Some((low, high));
        self
    }

    /// Returns the estimates of one parameter: a vector for each method, with a value for each NPI.
    fn estimates(&self, reading: Reading, parameter: usize) -> Result<Vec<Vec<f64>>, String> {
        let one = |method: Method, npi: f64| {
            let case = Case { machine: self.machine, nt: self.nt, npi };
            let sequences = reading.sequences(case, method)?;
            Ok(self.domain.estimate(reading, case, method, &sequences)?[parameter])
        };
        self.methods
            .iter()
            .map(|&method| self.npi.iter().map(|&npi| one(method, npi)).collect())
            .collect()
    }

    fn panel(&self, reading: Reading, parameter: &str) -> Result<Panel, String> {
        let index = self.machine.parameters().iter().position(|name| *name == parameter);
        let index = index.ok_or_else(|| format!("there is no parameter {parameter}"))?;
        let estimates = self.estimates(reading, index)?;
        let series: Vec<Series<'_>> = self
            .methods
            .iter()
            .zip(&estimates)
            .map(|(method, values)| {
                Series::new(method.name(), &self.npi, values).slot(slot(*method))
            })
            .collect();
        let name = format!("{} estimated", subscripted(parameter));
        let truth = self.machine.truth()[index];
        let quantity = Quantity::new(&name, unit(parameter));
        let span = self.npi.last().unwrap_or(&0.0) - self.npi.first().unwrap_or(&0.0);
        let step = match span {
            wide if wide > 10.0 => 2.0,
            middle if middle > 3.0 => 1.0,
            _ => 0.5,
        };
        let setting = Axis::linear("NPI", "").step(step);
        let mut panel = sweep_panel(setting, quantity, &series, Some(truth));
        for (value, label) in self
            .window
            .iter()
            .flat_map(|(low, high)| [(*low, "window of the dissertation"), (*high, "")])
        {
            panel = panel.reference(Reference::vertical(label, value).dash(Dash::Dotted));
        }
        Ok(panel.title(reading.title()))
    }

    /// Returns two panels of one parameter on the same scale, with and without the slips; one panel
    /// if no slip has an effect.
    fn panels(&self, parameter: &str) -> Result<Vec<Panel>, String> {
        let panels: Result<Vec<Panel>, String> =
            Reading::BOTH.into_iter().map(|reading| self.panel(reading, parameter)).collect();
        let mut panels = panels?;
        if panels[0].data() == panels[1].data() {
            panels.truncate(1);
            panels = panels.into_iter().map(|panel| panel.title("no slip is involved")).collect();
        }
        Ok(same_ordinates(panels))
    }

    fn figure(&self, number: &str, parameters: &[&str]) -> Result<Figure, String> {
        let what = match parameters {
            [one] => subscripted(one),
            many if many.iter().all(|name| name.starts_with('K')) => "Stiffness".to_owned(),
            _ => "Damping".to_owned(),
        };
        let title = format!(
            "{number}: {what} identified in the {}, N_{{t}} = {}",
            self.domain.name(),
            self.nt
        );
        let title = match self.machine {
            Machine::SingleDof { damping } if self.machine != Machine::SDOF => {
                format!("{title}, true C = {damping} N·s/m")
            }
            _ => title,
        };
        let mut figure = Figure::new(title).shared_legend();
        let mut columns = 1;
        for parameter in parameters {
            let panels = self.panels(parameter)?;
            columns = panels.len();
            figure = panels.into_iter().fold(figure, Figure::panel);
        }
        if parameters.len() > 1 {
            figure = figure.share_x();
        }
        Ok(figure.columns(columns))
    }
}

/// Index of the style of a method, the same in every figure.
pub(crate) fn slot(method: Method) -> usize {
    Method::ALL.iter().position(|other| *other == method).unwrap_or(Method::ALL.len())
}

fn subscripted(parameter: &str) -> String {
    let (letter, direction) = parameter.split_at(1);
    if direction.is_empty() { letter.to_owned() } else { format!("{letter}_{{{direction}}}") }
}

fn unit(parameter: &str) -> &'static str {
    if parameter.starts_with('K') { "N/m" } else { "N·s/m" }
}

/// Returns `count` values from `first` on, `step` apart, both in tenths; integers avoid the
/// rounding of repeated sums of 0.2.
fn tenths(first: u32, step: u32, count: u32) -> Vec<f64> {
    (0..count).map(|index| f64::from(first + index * step) / 10.0).collect()
}

/// All sweeps with the figures drawn from them.
pub(crate) fn plans() -> Vec<Plan> {
    const STIFFNESS: [&str; 4] = ["Kxx", "Kxy", "Kyx", "Kyy"];
    const DAMPING: [&str; 4] = ["Cxx", "Cxy", "Cyx", "Cyy"];
    let light = Machine::SingleDof { damping: 50.0 };
    let (sdof, time, frequency) = (Machine::SDOF, Domain::Time, Domain::Frequency);
    let wide = || tenths(20, 20, 10);
    let narrow = Sweep::new(sdof, time, 256, tenths(20, 2, 11));
    let houbolt =
        Sweep::new(light, time, 256, tenths(40, 2, 31)).only(Method::Houbolt).window(6.0, 8.0);
    let wilson = Sweep::new(light, time, 256, tenths(80, 2, 31))
        .only(Method::WilsonTheta)
        .window(10.0, 12.0);
    let newmark = Sweep::new(sdof, frequency, 256, tenths(202, 2, 10)).only(Method::Newmark);
    let bearing = |domain, nt| Sweep::new(BEARING, domain, nt, wide());
    let pair = |numbers: [&'static str; 2], sweep: Sweep| singles(&numbers, &["K", "C"], sweep);
    let eight =
        |numbers: [&'static str; 8], sweep: Sweep| singles(&numbers, BEARING.parameters(), sweep);
    let mut plans = pair(["5.2.4", "5.2.5"], narrow);
    plans.extend(pair(["5.2.6", "5.2.7"], houbolt));
    plans.extend(pair(["5.2.8", "5.2.9"], wilson));
    plans.extend(pair(["5.3.1", "5.3.2"], Sweep::new(sdof, frequency, 256, wide())));
    plans.extend(pair(["5.3.4", "5.3.5"], newmark));
    let early = ["5.6.2", "5.6.3", "5.6.4", "5.6.5", "5.6.6", "5.6.7", "5.6.8", "5.6.9"];
    plans.extend(eight(early, bearing(time, 256)));
    let late = ["5.6.10", "5.6.11", "5.6.12", "5.6.13", "5.6.14", "5.6.15", "5.6.16", "5.6.17"];
    plans.extend(eight(late, bearing(time, 512)));
    let lines = ["5.7.2", "5.7.3", "5.7.4", "5.7.5", "5.7.6", "5.7.7", "5.7.8", "5.7.9"];
    plans.extend(eight(lines, bearing(frequency, 256)));
    let appendix = Arc::new(bearing(frequency, 512));
    for (number, parameters) in [("A-stiffness", STIFFNESS), ("A-damping", DAMPING)] {
        let sweep = Arc::clone(&appendix);
        plans.push(Plan { number, draw: Box::new(move || sweep.figure(number, &parameters)) });
    }
    plans
}

/// One figure for each parameter of a sweep.
fn singles(
    numbers: &[&'static str],
    parameters: &'static [&'static str],
    sweep: Sweep,
) -> Vec<Plan> {
    let sweep = Arc::new(sweep);
    numbers
        .iter()
        .zip(parameters)
        .map(|(&number, parameter)| {
            let sweep = Arc::clone(&sweep);
            Plan { number, draw: Box::new(move || sweep.figure(number, &[parameter])) }
        })
        .collect()
}
