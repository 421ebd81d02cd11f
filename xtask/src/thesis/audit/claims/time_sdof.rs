//! Section 5.2: stiffness and damping of one degree of freedom from the time domain.

use super::super::super::case::{Case, Machine};
use super::super::super::published::Method::{
    self, CentralDifference as Central, Houbolt, Newmark, Rk4, WilsonTheta as Wilson,
};
use super::super::evidence::{View, mean};
use super::super::markdown::number;
use super::super::rerun::{Domain, errors};
use super::{Claim, Finding, Support, below, in_order};

pub const CLAIMS: &[Claim] = &[
    Claim {
        number: 1,
        section: "5.2",
        statement: "The estimates drift away from the truth as NPI, and with it the step, grows.",
        test: "in each of the ten columns of 5.2.2 and 5.2.3 the error rises at every step from NPI 6 on",
        support: Support::Tables,
        judge: drift,
    },
    Claim {
        number: 2,
        section: "5.2",
        statement: "Between NPI 2 and 4 the errors fall, except Houbolt's in damping.",
        test: "error at NPI 4 below that at NPI 2 in each column of 5.2.4 and 5.2.5, above it for Houbolt in 5.2.5",
        support: Support::Tables,
        judge: fall_up_to_four,
    },
    Claim {
        number: 3,
        section: "5.2",
        statement: "For K over NPI 2–20 the central difference is best, even better than Runge-Kutta; then Newmark, Wilson θ, Houbolt.",
        test: "the means of 5.2.2 in that order, and central difference below Runge-Kutta",
        support: Support::Tables,
        judge: |v| ranked(v, "5.2.2", [Central, Newmark, Wilson, Houbolt]),
    },
    Claim {
        number: 4,
        section: "5.2",
        statement: "At large NPI the error in K of Wilson θ and above all of Houbolt grows strongly.",
        test: "at NPI 20 both above each of the three others, Houbolt above Wilson θ",
        support: Support::Tables,
        judge: large_npi,
    },
    Claim {
        number: 5,
        section: "5.2",
        statement: "For C over NPI 2–20 Newmark is best, even better than Runge-Kutta; then central difference, Houbolt, Wilson θ.",
        test: "the means of 5.2.3 in that order, and Newmark below Runge-Kutta",
        support: Support::Tables,
        judge: |v| ranked(v, "5.2.3", [Newmark, Central, Houbolt, Wilson]),
    },
    Claim {
        number: 6,
        section: "5.2",
        statement: "Towards NPI 4 the stiffness of nearly every method tends to the true value.",
        test: "error in 5.2.4 at NPI 4 below 3 %, for each method",
        support: Support::Tables,
        judge: near_truth_at_four,
    },
    Claim {
        number: 7,
        section: "5.2, congress paper",
        statement: "For C between NPI 2 and 4 Newmark is best, then central difference, Houbolt, Wilson θ; the last two are strongly biased.",
        test: "the means of 5.2.5 in that order, Newmark below Runge-Kutta, the last two above 20 %",
        support: Support::Tables,
        judge: small_npi_damping,
    },
    Claim {
        number: 8,
        section: "5.2, congress paper",
        statement: "On the whole Newmark is better than Runge-Kutta, above all in C.",
        test: "mean below that of Runge-Kutta in each of 5.2.2–5.2.5",
        support: Support::Tables,
        judge: newmark_beats_runge_kutta,
    },
    Claim {
        number: 9,
        section: "5.2, congress paper",
        statement: "With C = 50 N·s/m Houbolt finds C well at NPI 6–8 and Wilson θ at NPI 10–12, both with a satisfactory K.",
        test: "on a grid of 0.2 within the window: smallest error in C below 1 %, error in K below 10 % throughout",
        support: Support::Nothing,
        judge: light_damping,
    },
    Claim {
        number: 10,
        section: "congress paper",
        statement: "At NPI 6.6 Houbolt's C is off by only 0.0013.",
        test: "error in C at NPI 6.6 with C = 50, in per cent, is 0.0013 in its printed digits",
        support: Support::Nothing,
        judge: houbolt_at_six_point_six,
    },
    Claim {
        number: 11,
        section: "5.2, congress paper",
        statement: "The bad damping estimates of Houbolt and Wilson θ come from the strong damping, ζ = 0.40.",
        test: "for each of the two, the mean relative error in C over NPI 2–20 falls at each step from C = 180 to 100, 50 and 25 N·s/m",
        support: Support::Nothing,
        judge: strong_damping,
    },
    Claim {
        number: 12,
        section: "5.2",
        statement: "The step (through NPI) together with the machine's dynamics decides the accuracy.",
        test: "in each column of 5.2.2 and 5.2.3 the largest error is at least twice the smallest",
        support: Support::Tables,
        judge: step_decides,
    },
];

const TABLES: [&str; 2] = ["5.2.2", "5.2.3"];

/// Tests for each column of tables 5.2.2 and 5.2.3 whether, at NPI 6 and above, the error increases
/// from each NPI to the next.
fn drift(view: &View) -> Result<Finding, String> {
    let rising = |table, method| {
        let tail: Vec<f64> = view
            .series(table, method)
            .into_iter()
            .filter(|(npi, _)| *npi >= 6.0)
            .map(|(_, e)| e)
            .collect();
        tail.windows(2).all(|w| w[0] < w[1])
    };
    let columns = |table| Method::ALL.map(move |method| (table, method));
    let not: Vec<String> = TABLES
        .into_iter()
        .flat_map(columns)
        .filter(|(t, m)| !rising(t, *m))
        .map(|(t, m)| {
            let at = |npi| number(view.error(t, m, npi));
            let parameter = if t == "5.2.2" { "K" } else { "C" };
            format!("{} {parameter} {} → {} → {}", m.name(), at(2.0), at(10.0), at(20.0))
        })
        .collect();
    let numbers = if not.is_empty() {
        "No exception.".to_owned()
    } else {
        format!("Not (NPI 2 → 10 → 20): {}.", not.join("; "))
    };
    Ok(Finding::new(TABLES.into_iter().flat_map(columns).map(|(t, m)| rising(t, m)), numbers))
}

fn fall_up_to_four(view: &View) -> Result<Finding, String> {
    let pair = |table, m| [2.0, 4.0].map(|npi| view.error(table, m, npi));
    let tests = ["5.2.4", "5.2.5"].into_iter().flat_map(|table| {
        Method::ALL.map(|m| {
            let [two, four] = pair(table, m);
            if table == "5.2.5" && m == Houbolt { four > two } else { four < two }
        })
    });
    let words = |table| {
        let one = |m: Method| {
            let [two, four] = pair(table, m).map(number);
            format!("{} {two} → {four}", m.name())
        };
        Method::ALL.map(one).join(", ")
    };
    Ok(Finding::new(tests, format!("K: {}. C: {}.", words("5.2.4"), words("5.2.5"))))
}

fn ranked(view: &View, table: &str, order: [Method; 4]) -> Result<Finding, String> {
    let tests = [in_order(view, table, &order), below(view, table, order[0], &[Rk4])].concat();
    Ok(Finding::new(tests, format!("Means: {}.", view.ranking(table))))
}

fn large_npi(view: &View) -> Result<Finding, String> {
    let at = |m| view.error("5.2.2", m, 20.0);
    let rivals = [Rk4, Newmark, Central];
    let above = [Wilson, Houbolt].into_iter().flat_map(|m| rivals.map(|o| at(m) > at(o)));
    let words = Method::ALL.map(|m| format!("{} {}", m.name(), number(at(m)))).join(", ");
    Ok(Finding::new(above.chain([at(Houbolt) > at(Wilson)]), format!("At NPI 20: {words}.")))
}

fn near_truth_at_four(view: &View) -> Result<Finding, String> {
    let at = |m| view.error("5.2.4", m, 4.0);
    let words = Method::ALL.map(|m| format!("{} {}", m.name(), number(at(m)))).join(", ");
    Ok(Finding::new(Method::ALL.map(|m| at(m) < 3.0), format!("At NPI 4: {words}.")))
}

fn small_npi_damping(view: &View) -> Result<Finding, String> {
    let mut finding = ranked(view, "5.2.5", [Newmark, Central, Houbolt, Wilson])?;
    let biased = [Houbolt, Wilson].map(|m| view.mean("5.2.5", m) > 20.0);
    finding.tally = finding.tally.and(biased.into_iter().collect());
    Ok(finding)
}

fn newmark_beats_runge_kutta(view: &View) -> Result<Finding, String> {
    let tables = ["5.2.2", "5.2.3", "5.2.4", "5.2.5"];
    let words = tables.map(|t| {
        let [n, rk] = [Newmark, Rk4].map(|m| number(view.mean(t, m)));
        format!("{t}: {n} against {rk}")
    });
    let tests = tables.map(|t| view.mean(t, Newmark) < view.mean(t, Rk4));
    Ok(Finding::new(tests, format!("{}.", words.join("; "))))
}

fn damped(view: &View, damping: f64, npi: f64, method: Method) -> Result<Vec<f64>, String> {
    let case = Case { machine: Machine::SingleDof { damping }, nt: 256, npi };
    errors(view.source, case, method, Domain::Time)
}

fn light_damping(view: &View) -> Result<Finding, String> {
    let (mut tests, mut words) = (Vec::new(), Vec::new());
    for (method, from) in [(Houbolt, 30), (Wilson, 50)] {
        let window: Result<Vec<(f64, Vec<f64>)>, String> = (from..=from + 10)
            .map(|fifths| f64::from(fifths) / 5.0)
            .map(|npi| Ok((npi, damped(view, 50.0, npi, method)?)))
            .collect();
        let window = window?;
        let closest = window.iter().min_by(|a, b| a.1[1].total_cmp(&b.1[1]));
        let (npi, best) = closest.map_or((f64::NAN, f64::NAN), |(n, e)| (*n, e[1]));
        let stiffness = window.iter().map(|(_, e)| e[0]).fold(0.0, f64::max);
        tests.extend([best < 1.0, stiffness < 10.0]);
        let edges = [&window[0], &window[10]].map(|(n, e)| format!("{} at NPI {n}", number(e[1])));
        words.push(format!(
            "{}: C best {} at NPI {npi}, but {}; K up to {}",
            method.name(),
            number(best),
            edges.join(" and "),
            number(stiffness)
        ));
    }
    let note = "The good damping is where the error changes sign.";
    Ok(Finding::new(tests, format!("{}. {note}", words.join(". "))))
}

fn houbolt_at_six_point_six(view: &View) -> Result<Finding, String> {
    let error = damped(view, 50.0, 6.6, Houbolt)?[1];
    let matches = (error * 1e4).round() == 13.0;
    Ok(Finding::new([matches], format!("{error:.5} %.")))
}

fn strong_damping(view: &View) -> Result<Finding, String> {
    let (mut tests, mut words) = (Vec::new(), Vec::new());
    for method in [Houbolt, Wilson] {
        let mut means = Vec::new();
        for damping in [180.0, 100.0, 50.0, 25.0] {
            let sweep: Result<Vec<f64>, String> = (1..=10)
                .map(|half| Ok(damped(view, damping, f64::from(2 * half), method)?[1]))
                .collect();
            means.push(mean(sweep?.into_iter()));
        }
        tests.extend(means.windows(2).map(|w| w[1] < w[0]));
        let shown: Vec<String> = means.iter().map(|m| number(*m)).collect();
        words.push(format!("{} {}", method.name(), shown.join(" → ")));
    }
    Ok(Finding::new(tests, format!("Mean error in C: {}.", words.join("; "))))
}

fn step_decides(view: &View) -> Result<Finding, String> {
    let ratio = |table, method| {
        let errors: Vec<f64> = view.series(table, method).into_iter().map(|(_, e)| e).collect();
        let largest = errors.iter().copied().fold(0.0, f64::max);
        largest / errors.iter().copied().fold(f64::INFINITY, f64::min)
    };
    let ratios: Vec<f64> = TABLES.iter().flat_map(|t| Method::ALL.map(|m| ratio(t, m))).collect();
    let [low, high] = [f64::min as fn(f64, f64) -> f64, f64::max]
        .map(|f| number(ratios.iter().copied().reduce(f).unwrap_or(f64::NAN)));
    let numbers = format!("Largest over smallest error of a column: {low} to {high}.");
    Ok(Finding::new(ratios.into_iter().map(|r| r >= 2.0), numbers))
}
