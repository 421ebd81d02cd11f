//! Section 5.3: stiffness and damping of one degree of freedom from the frequency domain.

use super::super::super::case::{Case, Machine};
use super::super::super::published::Method::{
    self, CentralDifference as Central, Houbolt, Newmark, Rk4, WilsonTheta as Wilson,
};
use super::super::evidence::{View, mean};
use super::super::markdown::number;
use super::super::rerun::{Domain, errors};
use super::{Claim, Finding, Support, best_npi};

pub const CLAIMS: &[Claim] = &[
    Claim {
        number: 13,
        section: "5.3.1",
        statement: "The errors fall as NPI grows, opposite to the time domain.",
        test: "in each of the ten columns of 5.3.1 and 5.3.2 the error falls at every step up to NPI 18",
        support: Support::Tables,
        judge: errors_fall,
    },
    Claim {
        number: 14,
        section: "5.3.1",
        statement: "The reason is that a larger NPI resolves the frequencies more finely.",
        test: "Newmark's errors in K and C fall from NPI 2 to 20; and they fall when only the resolution is refined (NPI 2, 4, 8, 16 with 64, 128, 256, 512 samples: one and the same step)",
        support: Support::Tables,
        judge: finer_resolution,
    },
    Claim {
        number: 15,
        section: "5.3.1",
        statement: "For K Newmark and Houbolt are equivalent and best, then central difference, then Wilson θ.",
        test: "each of the two means of 5.3.1 below the three others, the two within 10 % of each other, central difference below Wilson θ",
        support: Support::Tables,
        judge: stiffness_ranking,
    },
    Claim {
        number: 16,
        section: "5.3.1",
        statement: "Wilson θ stays high and nearly constant in K from NPI 8 on, the only method without a good range.",
        test: "its errors from NPI 8 on lie within 5 points and above 20 %; each other method somewhere comes below 10 %",
        support: Support::Tables,
        judge: wilson_has_no_range,
    },
    Claim {
        number: 17,
        section: "5.3.1",
        statement: "For C Runge-Kutta and Newmark converge to the truth, Newmark faster; the others scatter as NPI grows.",
        test: "in 5.3.2 the two fall from NPI 2 to 20, Newmark's mean is the lower, and at NPI 20 each other method is worse than both",
        support: Support::Tables,
        judge: damping_converges,
    },
    Claim {
        number: 18,
        section: "5.3",
        statement: "No range of NPI suits all; each method has its own.",
        test: "the NPI of smallest error in K differs between each two neighbours of the five columns of 5.3.1",
        support: Support::Tables,
        judge: own_ranges,
    },
    Claim {
        number: 19,
        section: "5.3",
        statement: "With a well chosen range, Newmark at NPI 20.2–22, the estimate is nearly exact.",
        test: "both means of 5.3.3 below 1 %",
        support: Support::Tables,
        judge: nearly_exact,
    },
];

const TABLES: [(&str, &str); 2] = [("5.3.1", "K"), ("5.3.2", "C")];

fn ends(view: &View, table: &str, method: Method) -> [f64; 2] {
    [2.0, 20.0].map(|npi| view.error(table, method, npi))
}

fn errors_fall(view: &View) -> Result<Finding, String> {
    let (mut tests, mut words) = (Vec::new(), Vec::new());
    for (table, parameter) in TABLES {
        for method in Method::ALL {
            let errors: Vec<f64> = view
                .series(table, method)
                .into_iter()
                .filter(|(npi, _)| *npi <= 18.0)
                .map(|(_, e)| e)
                .collect();
            tests.push(errors.windows(2).all(|w| w[1] < w[0]));
            let [two, twenty] = ends(view, table, method).map(number);
            words.push(format!("{} {parameter} {two} → {twenty}", method.name()));
        }
    }
    Ok(Finding::new(tests, format!("NPI 2 → 20: {}.", words.join(", "))))
}

fn finer_resolution(view: &View) -> Result<Finding, String> {
    let sweep = TABLES.map(|(table, _)| ends(view, table, Newmark));
    let refined: Result<Vec<Vec<f64>>, String> = [(2.0, 64), (4.0, 128), (8.0, 256), (16.0, 512)]
        .into_iter()
        .map(|(npi, nt)| {
            errors(
                view.source,
                Case { machine: Machine::SDOF, nt, npi },
                Newmark,
                Domain::Frequency,
            )
        })
        .collect();
    let refined = refined?;
    let at_one_step = [0, 1].map(|at| refined.iter().map(|e| e[at]).collect::<Vec<f64>>());
    let fall = |e: &Vec<f64>| e.windows(2).all(|w| w[1] < 0.9 * w[0]);
    let tests = sweep.iter().map(|[two, twenty]| twenty < two).chain(at_one_step.iter().map(fall));
    let arrows = |e: &[f64]| e.iter().map(|v| number(*v)).collect::<Vec<_>>().join(" → ");
    let numbers = format!(
        "NPI 2 → 20: K {}, C {}. At one step, resolution doubled thrice: K {}, C {}.",
        arrows(&sweep[0]),
        arrows(&sweep[1]),
        arrows(&at_one_step[0]),
        arrows(&at_one_step[1])
    );
    Ok(Finding::new(tests.collect::<Vec<_>>(), numbers))
}

fn stiffness_ranking(view: &View) -> Result<Finding, String> {
    let of = |m| view.mean("5.3.1", m);
    let best = [Newmark, Houbolt].into_iter();
    let first = best.flat_map(|m| [Rk4, Central, Wilson].map(|o| of(m) < of(o)));
    let close = (of(Newmark) - of(Houbolt)).abs() < 0.1 * of(Newmark).max(of(Houbolt));
    let tests = first.chain([close, of(Central) < of(Wilson)]);
    Ok(Finding::new(tests, format!("Means: {}.", view.ranking("5.3.1"))))
}

fn wilson_has_no_range(view: &View) -> Result<Finding, String> {
    let high: Vec<f64> = view
        .series("5.3.1", Wilson)
        .into_iter()
        .filter(|(npi, _)| *npi >= 8.0)
        .map(|(_, e)| e)
        .collect();
    let smallest = |series: &[f64]| series.iter().copied().fold(f64::INFINITY, f64::min);
    let (low, top) = (smallest(&high), high.iter().copied().fold(0.0, f64::max));
    let best = |m| smallest(&view.series("5.3.1", m).iter().map(|(_, e)| *e).collect::<Vec<_>>());
    let rivals = [Rk4, Newmark, Central, Houbolt];
    let words = rivals.map(|m| format!("{} {}", m.name(), number(best(m)))).join(", ");
    let tests = [top - low < 5.0, low > 20.0].into_iter().chain(rivals.map(|m| best(m) < 10.0));
    let range = format!("Wilson θ from NPI 8 on: {} to {}.", number(low), number(top));
    Ok(Finding::new(tests, format!("{range} Smallest error of the others: {words}.")))
}

fn damping_converges(view: &View) -> Result<Finding, String> {
    let (rk, newmark) = (ends(view, "5.3.2", Rk4), ends(view, "5.3.2", Newmark));
    let mean_of = |m| view.mean("5.3.2", m);
    let rivals =
        [Central, Houbolt, Wilson].map(|m| ends(view, "5.3.2", m)[1] > rk[1].max(newmark[1]));
    let tests = [rk[1] < rk[0], newmark[1] < newmark[0], mean_of(Newmark) < mean_of(Rk4)]
        .into_iter()
        .chain(rivals);
    let words = Method::ALL.map(|m| {
        let [two, twenty] = ends(view, "5.3.2", m).map(number);
        format!("{} {two} → {twenty}", m.name())
    });
    Ok(Finding::new(tests, format!("NPI 2 → 20: {}.", words.join(", "))))
}

fn own_ranges(view: &View) -> Result<Finding, String> {
    let best = Method::ALL.map(|m| best_npi(&view.series("5.3.1", m)));
    let named = Method::ALL.iter().zip(best).map(|(m, npi)| format!("{} {npi}", m.name()));
    let words: Vec<String> = named.collect();
    let tests = best.windows(2).map(|w| w[0] != w[1]).collect::<Vec<_>>();
    Ok(Finding::new(tests, format!("Smallest error in K at NPI: {}.", words.join(", "))))
}

fn nearly_exact(view: &View) -> Result<Finding, String> {
    let of = |p| mean(view.series_of("5.3.3", p, Newmark).into_iter().map(|(_, e)| e));
    let means = ["K", "C"].map(of);
    let words = format!("Means: K {}, C {}.", number(means[0]), number(means[1]));
    Ok(Finding::new(means.map(|m| m < 1.0), words))
}
