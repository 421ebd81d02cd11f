//! Appendices B and E, and the general conclusions of section 6.1.

use mechid::model::Discretisation;
use mechid::signal::Interpolation;

use super::super::super::published::Method::{self, CentralDifference as Central, Newmark, Rk4};
use super::super::appendices::{modal_errors, refined_errors};
use super::super::evidence::{Source, View};
use super::super::markdown::number;
use super::super::rerun::{Domain, EULER, Equation, Parameters, bearing, force, sdof};
use super::{Claim, DIRECT, Finding, Support, best_npi};

pub const CLAIMS: &[Claim] = &[
    Claim {
        number: 50,
        section: "6.2, Appendix B",
        statement: "One or two intermediate points by linear interpolation (Nt = 128) are promising in the time domain.",
        test: "NPI 6–10, K and C: the error with two points is smaller than with one (and, corrected, with one smaller than with none)",
        support: Support::Tables,
        judge: interpolation,
    },
    Claim {
        number: 51,
        section: "Appendix E",
        statement: "Runge-Kutta and Newmark with the time domain give modal parameters as good as the Fourier series method of Steffen & Rade (1991).",
        test: "the printed errors of E1 and E2 are at most the largest of that method; corrected: so are those of a rerun, Nt = 2048, at the best NPI of 2, 4 … 20 (the printed NPI is not stated)",
        support: Support::Tables,
        judge: |v| modal(v, &[(Rk4, "E1"), (Newmark, "E2")]),
    },
    Claim {
        number: 52,
        section: "Appendix E",
        statement: "The central difference is excellent there too.",
        test: "as the rerun of claim 51",
        support: Support::Nothing,
        judge: |v| modal(v, &[(Central, "")]),
    },
    Claim {
        number: 53,
        section: "6.1",
        statement: "Both formulations, time and frequency, can be satisfactory under suitable conditions.",
        test: "one degree of freedom: for each method and domain there is an NPI with errors in K and C below 10 %",
        support: Support::Tables,
        judge: both_satisfactory,
    },
    Claim {
        number: 54,
        section: "6.1",
        statement: "The continuous force equation is far better than the discretised one.",
        test: "rms deviation of |F̂/F| less than half, five methods, one degree of freedom at NPI 20 and 3.4, bearing at NPI 14 and 6, parameters of the time domain",
        support: Support::Figures,
        judge: continuous_is_better,
    },
    Claim {
        number: 55,
        section: "6.1",
        statement: "The best step is hard to choose: it hangs together with the machine's dynamics and cannot be arbitrary.",
        test: "the NPI of least error differs from the most frequent one, for each column of 5.2.2, 5.2.3 and 5.6.2–5.6.9",
        support: Support::Tables,
        judge: best_step,
    },
    Claim {
        number: 56,
        section: "6.1",
        statement: "Newmark, central difference, Houbolt and Wilson θ are usable to compute the states for identification, given a proper step.",
        test: "for each there is an NPI of 5.2.2–5.2.5 with errors in K and C below 10 %",
        support: Support::Tables,
        judge: usable,
    },
];

fn interpolation(view: &View) -> Result<Finding, String> {
    let npis = [6.0, 7.0, 8.0, 9.0, 10.0];
    if view.source == Source::Printed {
        let of = |table, parameter| view.unspecified(table, parameter);
        let (mut tests, mut words) = (Vec::new(), Vec::new());
        for parameter in ["K", "C"] {
            let (one, two) = (of("B1", parameter), of("B2", parameter));
            tests.extend(one.iter().zip(&two).map(|(a, b)| b < a));
            let shown = |e: &[f64]| e.iter().map(|v| number(*v)).collect::<Vec<_>>().join(", ");
            words.push(format!("{parameter}: one point {}; two {}", shown(&one), shown(&two)));
        }
        let note =
            "The integrator is not named, and no interpolation we tried gives these numbers.";
        return Ok(Finding::new(tests, format!("NPI 6 … 10, {}. {note}", words.join(". "))));
    }
    let linear = Interpolation::Linear;
    let kinds = [(0, linear), (1, linear), (2, linear), (2, Interpolation::NotAKnotSpline)];
    let (mut tests, mut words) = (Vec::new(), Vec::new());
    for (parameter, name) in ["K", "C"].into_iter().enumerate() {
        let mut lines = Vec::new();
        for npi in npis {
            let errors: Result<Vec<f64>, String> = kinds
                .iter()
                .map(|(n, kind)| Ok(refined_errors(*n, *kind, npi)?[parameter]))
                .collect();
            let errors = errors?;
            tests.extend([errors[1] < errors[0], errors[2] < errors[1]]);
            let shown: Vec<String> = errors.iter().map(|e| number(*e)).collect();
            lines.push(format!("NPI {npi}: {}", shown.join(" / ")));
        }
        words.push(format!("{name}: {}", lines.join(", ")));
    }
    let head = "Newmark, no point / one / two linear points / two by cubic spline";
    Ok(Finding::new(tests, format!("{head}. {}.", words.join(". "))))
}

/// Returns the NPI among 2, 4 … 20 with the smallest maximum error, and the errors of all modal
/// parameters at this NPI.
fn best_rerun(view: &View, method: Method) -> Result<(f64, Vec<f64>), String> {
    let sweep: Result<Vec<(f64, Vec<f64>)>, String> = (1..=10)
        .map(|half| f64::from(2 * half))
        .map(|npi| Ok((npi, modal_errors(view.source, method, npi, Discretisation::Euler)?)))
        .collect();
    let largest = |errors: &[f64]| errors.iter().copied().fold(0.0, f64::max);
    let best = sweep?.into_iter().min_by(|a, b| largest(&a.1).total_cmp(&largest(&b.1)));
    best.ok_or_else(|| "no NPI was tried".to_owned())
}

fn modal(view: &View, methods: &[(Method, &str)]) -> Result<Finding, String> {
    let theirs = view.printed_errors("E-steffen-rade-2", Method::FourierSeries);
    let worst = theirs.iter().copied().fold(0.0, f64::max);
    let list = |e: &[f64]| e.iter().map(|v| number(*v)).collect::<Vec<_>>().join(", ");
    let (mut tests, mut words) = (Vec::new(), Vec::new());
    for (method, table) in methods {
        if view.source == Source::Printed && !table.is_empty() {
            let errors = view.printed_errors(table, *method);
            words.push(format!("{} {}", method.name(), list(&errors)));
            tests.extend(errors.iter().map(|e| *e <= worst));
            continue;
        }
        let (npi, errors) = best_rerun(view, *method)?;
        tests.extend(errors.iter().map(|e| *e <= worst));
        let small = modal_errors(view.source, *method, 2.0, Discretisation::Euler)?;
        let exact = modal_errors(view.source, *method, npi, Discretisation::FirstOrderHold)?;
        words.push(format!(
            "{} at NPI {npi} {} (at NPI 2 {}; exact discretisation at NPI {npi} {})",
            method.name(),
            list(&errors),
            list(&small),
            list(&exact)
        ));
    }
    let order = "frequency, damping, shape of the slower mode, then of the faster";
    let numbers = format!("Errors of {order}: {}. Theirs: {}.", words.join("; "), list(&theirs));
    Ok(Finding::new(tests, numbers))
}

/// Returns the NPI at which the larger of the errors in K and C is smallest, and this error.
fn satisfactory(view: &View, tables: [&str; 2], method: Method) -> (f64, f64) {
    let [k, c] = tables.map(|t| view.series(t, method));
    let both: Vec<(f64, f64)> = k.iter().zip(&c).map(|(k, c)| (k.0, k.1.max(c.1))).collect();
    let npi = best_npi(&both);
    let error = both.iter().find(|(n, _)| *n == npi).map_or(f64::NAN, |(_, e)| *e);
    (npi, error)
}

fn both_satisfactory(view: &View) -> Result<Finding, String> {
    let (mut tests, mut words) = (Vec::new(), Vec::new());
    for (domain, tables) in [("time", ["5.2.2", "5.2.3"]), ("frequency", ["5.3.1", "5.3.2"])] {
        for method in Method::ALL {
            let (npi, error) = satisfactory(view, tables, method);
            tests.push(error < 10.0);
            words.push(format!("{} {domain} {} (NPI {npi})", method.name(), number(error)));
        }
    }
    let numbers = format!("Smallest of the larger error of K and C: {}.", words.join(", "));
    Ok(Finding::new(tests, numbers))
}

fn continuous_is_better(view: &View) -> Result<Finding, String> {
    let (mut tests, mut words) = (Vec::new(), Vec::new());
    let cases = [sdof(20.0), sdof(3.4), bearing(256, 14.0), bearing(256, 6.0)];
    let time = Parameters::From(Domain::Time);
    for (at, case) in cases.into_iter().enumerate() {
        let mut shown = Vec::new();
        for method in Method::ALL {
            let rms = |e| Ok::<_, String>(force(view.source, case, method, time, e)?.rms());
            let (smooth, steps) = (rms(Equation::Continuous)?, rms(EULER)?);
            tests.push(smooth < 0.5 * steps);
            shown.push(format!("{} {} against {}", method.name(), number(smooth), number(steps)));
        }
        let machine = if at < 2 { "one degree of freedom" } else { "bearing" };
        words.push(format!("{machine}, NPI {}: {}", case.npi, shown.join(", ")));
    }
    Ok(Finding::new(tests, format!("{}.", words.join("; "))))
}

fn best_step(view: &View) -> Result<Finding, String> {
    let tables =
        ["5.2.2", "5.2.3", "5.6.2", "5.6.3", "5.6.4", "5.6.5", "5.6.6", "5.6.7", "5.6.8", "5.6.9"];
    let columns = || tables.iter().flat_map(|t| Method::ALL.map(|m| (*t, m)));
    let best: Vec<f64> = columns().map(|(t, m)| best_npi(&view.series(t, m))).collect();
    let count = |npi: f64| best.iter().filter(|b| **b == npi).count();
    let npis: Vec<f64> = (1..=10).map(|half| f64::from(2 * half)).collect();
    let usual = npis.iter().copied().max_by_key(|n| count(*n)).unwrap_or(f64::NAN);
    let histogram: Vec<String> =
        npis.iter().filter(|n| count(**n) > 0).map(|n| format!("NPI {n}: {}", count(*n))).collect();
    let ours: Vec<f64> = columns().map(|(t, m)| best_npi(&view.best(t, m))).collect();
    let smallest = ours.iter().filter(|n| **n == 2.0).count();
    let numbers = format!(
        "Columns by their best NPI: {}. With the exact discretisation the smallest step, NPI 2, is best in {smallest} of {}.",
        histogram.join(", "),
        ours.len()
    );
    Ok(Finding::new(best.iter().map(|b| *b != usual), numbers))
}

fn usable(view: &View) -> Result<Finding, String> {
    let (mut tests, mut words) = (Vec::new(), Vec::new());
    for method in DIRECT {
        let wide = satisfactory(view, ["5.2.2", "5.2.3"], method);
        let near = satisfactory(view, ["5.2.4", "5.2.5"], method);
        let (npi, error) = if wide.1 < near.1 { wide } else { near };
        tests.push(error < 10.0);
        words.push(format!("{} {} (NPI {npi})", method.name(), number(error)));
    }
    let numbers = format!("Smallest of the larger error of K and C: {}.", words.join(", "));
    Ok(Finding::new(tests, numbers))
}
