//! Sections 5.4 and 5.5: the force on one degree of freedom.

use mechid::model::Discretisation;
use mechid_problems::{exact_foh_periodic, exact_zoh_periodic};

use super::super::super::case::Machine;
use super::super::super::published::Method;
use super::super::super::simulate::Sequences;
use super::super::evidence::View;
use super::super::markdown::number;
use super::super::rerun::{Domain, EULER, Equation, Parameters, Ratios, force, sdof, sequences};
use super::{Claim, Finding, Support};

pub const CLAIMS: &[Claim] = &[
    Claim {
        number: 20,
        section: "5.4.1",
        statement: "With the continuous equation, better responses and parameters give a better force.",
        test: "for each method the rms deviation of |F̂/F| is smaller at NPI 3.4 than at NPI 20 (parameters from the time domain)",
        support: Support::Figures,
        judge: better_parameters,
    },
    Claim {
        number: 21,
        section: "5.4.1",
        statement: "Above ωn the identified spectrum looks like the flat true one, whatever the method and the domain of the parameters.",
        test: "at every line above ωn |F̂/F| is within 10 % of 1: five methods, parameters of the time domain at NPI 20 and 3.4, of the frequency domain at NPI 20 and 8",
        support: Support::Figures,
        judge: flat_above_resonance,
    },
    Claim {
        number: 22,
        section: "5.4.1, 5.8.1, 6.1",
        statement: "Exact parameters give the exact force with the continuous equation.",
        test: "|F̂/F| is 1 to 1e−9 at every line, five methods at NPI 20 and 3.4",
        support: Support::Figures,
        judge: exact_parameters,
    },
    Claim {
        number: 23,
        section: "5.5.1, 5.9.1, 6.1",
        statement: "The discretised equation gives strongly dispersed forces over the whole band, for all methods and NPI.",
        test: "|F̂/F| varies by more than 0.2 over the lines, five methods at NPI 20 and 3.4",
        support: Support::Figures,
        judge: discretised_disperses,
    },
    Claim {
        number: 24,
        section: "5.5.1, 5.9.1, 6.1",
        statement: "The cause is probably the early truncation of the state equation's Taylor series.",
        test: "with exact parameters at NPI 3.4: eight terms of the series leave less than a tenth of the rms deviation of one term, on the exact response to a held force, to a linear force, and on the data of each method",
        support: Support::Nothing,
        judge: truncation_is_the_cause,
    },
];

const TIME: Parameters = Parameters::From(Domain::Time);
const FREQUENCY: Parameters = Parameters::From(Domain::Frequency);

fn each_method<T>(of: impl Fn(Method) -> Result<T, String>) -> Result<Vec<(Method, T)>, String> {
    Method::ALL.iter().map(|m| Ok((*m, of(*m)?))).collect()
}

fn better_parameters(view: &View) -> Result<Finding, String> {
    let rms = |m, npi| {
        Ok::<f64, String>(force(view.source, sdof(npi), m, TIME, Equation::Continuous)?.rms())
    };
    let pairs = each_method(|m| Ok([rms(m, 20.0)?, rms(m, 3.4)?]))?;
    let words: Vec<String> = pairs
        .iter()
        .map(|(m, [far, near])| format!("{} {} → {}", m.name(), number(*far), number(*near)))
        .collect();
    let tests = pairs.iter().map(|(_, [far, near])| near < far);
    Ok(Finding::new(tests, format!("rms deviation, NPI 20 → 3.4: {}.", words.join(", "))))
}

fn flat_above_resonance(view: &View) -> Result<Finding, String> {
    let settings = [(TIME, 20.0), (TIME, 3.4), (FREQUENCY, 20.0), (FREQUENCY, 8.0)];
    let worst = each_method(|m| {
        let one = |(p, npi)| {
            let ratios = force(view.source, sdof(npi), m, p, Equation::Continuous)?;
            Ok(ratios.worst_above(Machine::SDOF.omega_n()))
        };
        settings.into_iter().map(one).collect::<Result<Vec<f64>, String>>()
    })?;
    let words: Vec<String> = worst
        .iter()
        .map(|(m, w)| {
            let shown: Vec<String> = w.iter().map(|v| number(*v)).collect();
            format!("{} {}", m.name(), shown.join(" / "))
        })
        .collect();
    let tests = worst.iter().flat_map(|(_, w)| w.iter().map(|v| *v < 0.1));
    Ok(Finding::new(
        tests,
        format!("Largest deviation above ωn in the four settings: {}.", words.join(", ")),
    ))
}

fn exact_parameters(view: &View) -> Result<Finding, String> {
    let (mut tests, mut words) = (Vec::new(), Vec::new());
    for npi in [20.0, 3.4] {
        for method in Method::ALL {
            let ratios =
                force(view.source, sdof(npi), method, Parameters::Exact, Equation::Continuous)?;
            let exact = ratios.range().iter().all(|r| (r - 1.0).abs() < 1e-9);
            tests.push(exact);
            if !exact {
                words.push(format!("{} at NPI {npi}: {}", method.name(), ratios.words()));
            }
        }
    }
    let list = if words.is_empty() { "no exception".to_owned() } else { words.join(", ") };
    Ok(Finding::new(tests, format!("Range of |F̂/F| where it is not 1: {list}.")))
}

fn discretised_disperses(view: &View) -> Result<Finding, String> {
    let (mut tests, mut words) = (Vec::new(), Vec::new());
    for npi in [20.0, 3.4] {
        for method in Method::ALL {
            let ratios = force(view.source, sdof(npi), method, TIME, EULER)?;
            tests.push(ratios.spread() > 0.2);
            words.push(format!("{} {}", method.name(), ratios.words()));
        }
    }
    let (far, near) = words.split_at(Method::ALL.len());
    let numbers = format!("|F̂/F| at NPI 20: {}; at NPI 3.4: {}.", far.join(", "), near.join(", "));
    Ok(Finding::new(tests, numbers))
}

fn truncation_is_the_cause(view: &View) -> Result<Finding, String> {
    let case = sdof(3.4);
    let (machine, record) = (case.machine.system(), case.force());
    let words = |e: mechid_problems::ProblemError| e.to_string();
    let exactly = |response| Sequences { machine: case.machine, response, force: record.clone() };
    let mut data = vec![
        (
            "exact response, held force",
            exactly(exact_zoh_periodic(&machine, &record).map_err(words)?),
        ),
        (
            "exact response, linear force",
            exactly(exact_foh_periodic(&machine, &record).map_err(words)?),
        ),
    ];
    for method in Method::ALL {
        data.push((method.name(), sequences(view.source, case, method)?));
    }
    let steps = [
        Equation::Discretised(Discretisation::Euler),
        Equation::Taylor(2),
        Equation::Taylor(8),
        Equation::Discretised(Discretisation::ZeroOrderHold),
        Equation::Discretised(Discretisation::FirstOrderHold),
    ];
    let (mut tests, mut lines) = (Vec::new(), Vec::new());
    for (name, sequences) in &data {
        let rms = |step: &Equation| Ok(Ratios::new(sequences, &machine, *step)?.rms());
        let rms: Vec<f64> = steps.iter().map(rms).collect::<Result<_, String>>()?;
        tests.push(rms[2] < 0.1 * rms[0]);
        let shown: Vec<String> = rms.iter().map(|r| number(*r)).collect();
        lines.push(format!("{name} {}", shown.join(" / ")));
    }
    let head = "rms deviation with Euler / second order / eighth order / exact for a held force / \
                exact for a linear force";
    Ok(Finding::new(tests, format!("{head}: {}.", lines.join("; "))))
}
