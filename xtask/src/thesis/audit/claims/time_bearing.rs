//! Section 5.6: stiffness and damping of the bearing from the time domain.

use super::super::super::published::Method::{
    self, CentralDifference as Central, Houbolt, Newmark, WilsonTheta as Wilson,
};
use super::super::evidence::View;
use super::super::markdown::number;
use super::{Claim, DIRECT, Finding, Support, below, in_order};

pub const CLAIMS: &[Claim] = &[
    Claim {
        number: 25,
        section: "5.6.1",
        statement: "Among the direct methods the central difference is best for all four stiffness coefficients at Nt = 256.",
        test: "its mean below those of the three others in each of 5.6.2–5.6.5",
        support: Support::Tables,
        judge: |v| best_in(v, Central, &STIFFNESS_256),
    },
    Claim {
        number: 26,
        section: "5.6.1",
        statement: "Among the direct methods Newmark is best for all four damping coefficients at Nt = 256.",
        test: "its mean below those of the three others in each of 5.6.6–5.6.9",
        support: Support::Tables,
        judge: |v| best_in(v, Newmark, &DAMPING_256),
    },
    Claim {
        number: 27,
        section: "5.6.1",
        statement: "Both superiorities persist at Nt = 512.",
        test: "the same for 5.6.10–5.6.13 and 5.6.14–5.6.17",
        support: Support::Tables,
        judge: at_512,
    },
    Claim {
        number: 28,
        section: "5.6.1",
        statement: "All coefficients improve as NPI falls.",
        test: "in each of the forty columns of 5.6.2–5.6.9 the error rises at every step from NPI 2 to 20",
        support: Support::Tables,
        judge: improve_as_npi_falls,
    },
    Claim {
        number: 29,
        section: "5.6.1",
        statement: "Rankings: Kxx central difference, Newmark, Houbolt, Wilson θ; Cxx Newmark, Wilson θ, Houbolt, central difference; Cxy Newmark, Houbolt, Wilson θ, central difference; Cyx Newmark, central difference, Houbolt, Wilson θ; Cyy Newmark, central difference, then the other two.",
        test: "each pair of neighbours in these orders",
        support: Support::Tables,
        judge: rankings,
    },
    Claim {
        number: 30,
        section: "5.6.1",
        statement: "For Cyx Wilson θ beats Houbolt above NPI 10.",
        test: "at each NPI from 12 to 20 of 5.6.8",
        support: Support::Tables,
        judge: wilson_beats_houbolt,
    },
    Claim {
        number: 31,
        section: "5.6.1",
        statement: "Houbolt and Wilson θ are very bad for Cyy, mostly at low NPI.",
        test: "mean of 5.6.9 above 50 %, and error at NPI 2 above that at NPI 20, for both",
        support: Support::Tables,
        judge: bad_for_cyy,
    },
    Claim {
        number: 32,
        section: "5.6.1",
        statement: "The damping curves are less dispersed than the stiffness curves.",
        test: "the spread of the five methods' estimates, in per cent of the truth and averaged over NPI, is smaller for Cxx than for Kxx, and so on for xy, yx, yy",
        support: Support::Tables,
        judge: dispersion,
    },
    Claim {
        number: 33,
        section: "5.6.1",
        statement: "Doubling the samples to Nt = 512 improves the results.",
        test: "each of the forty means of 5.6.10–5.6.17 below its partner of 5.6.2–5.6.9",
        support: Support::Tables,
        judge: doubling_samples,
    },
    Claim {
        number: 34,
        section: "5.6.1, 5.7.1",
        statement: "Kxx, Kxy, Cxx, Cxy are estimated more consistently than Kyx, Kyy, Cyx, Cyy.",
        test: "for each method, stiffness and damping, Nt 256, Nt 512 and the frequency domain: the two x means together below the two y means",
        support: Support::Tables,
        judge: x_rows_better,
    },
];

const STIFFNESS_256: [&str; 4] = ["5.6.2", "5.6.3", "5.6.4", "5.6.5"];
const DAMPING_256: [&str; 4] = ["5.6.6", "5.6.7", "5.6.8", "5.6.9"];
const STIFFNESS_512: [&str; 4] = ["5.6.10", "5.6.11", "5.6.12", "5.6.13"];
const DAMPING_512: [&str; 4] = ["5.6.14", "5.6.15", "5.6.16", "5.6.17"];
const FREQUENCY: [[&str; 4]; 2] =
    [["5.7.1", "5.7.2", "5.7.3", "5.7.4"], ["5.7.5", "5.7.6", "5.7.7", "5.7.8"]];

fn best_in(view: &View, method: Method, tables: &[&str]) -> Result<Finding, String> {
    let rivals = DIRECT.into_iter().filter(|m| *m != method).collect::<Vec<_>>();
    let tests = tables.iter().flat_map(|t| below(view, t, method, &rivals));
    let words = tables.iter().map(|t| {
        let means = DIRECT.map(|m| format!("{} {}", m.name(), number(view.mean(t, m))));
        format!("{t}: {}", means.join(", "))
    });
    let words: Vec<String> = words.collect();
    Ok(Finding::new(tests, format!("Means {}.", words.join("; "))))
}

fn at_512(view: &View) -> Result<Finding, String> {
    let stiffness = best_in(view, Central, &STIFFNESS_512)?;
    let damping = best_in(view, Newmark, &DAMPING_512)?;
    Ok(Finding {
        tally: stiffness.tally.and(damping.tally),
        numbers: format!("{} {}", stiffness.numbers, damping.numbers),
    })
}

fn improve_as_npi_falls(view: &View) -> Result<Finding, String> {
    let mut counts = Vec::new();
    let mut tests = Vec::new();
    for table in STIFFNESS_256.into_iter().chain(DAMPING_256) {
        let rising =
            Method::ALL.map(|m| view.series(table, m).windows(2).all(|pair| pair[0].1 < pair[1].1));
        counts.push(format!("{table} {}", rising.iter().filter(|r| **r).count()));
        tests.extend(rising);
    }
    Ok(Finding::new(tests, format!("Columns of five that do: {}.", counts.join(", "))))
}

fn rankings(view: &View) -> Result<Finding, String> {
    let orders: [(&str, &[Method]); 5] = [
        ("5.6.2", &[Central, Newmark, Houbolt, Wilson]),
        ("5.6.6", &[Newmark, Wilson, Houbolt, Central]),
        ("5.6.7", &[Newmark, Houbolt, Wilson, Central]),
        ("5.6.8", &[Newmark, Central, Houbolt, Wilson]),
        ("5.6.9", &[Newmark, Central, Houbolt]),
    ];
    let tests = orders.iter().flat_map(|(t, order)| in_order(view, t, order)).chain(below(
        view,
        "5.6.9",
        Central,
        &[Wilson],
    ));
    let words = orders.map(|(t, _)| format!("{t}: {}", view.ranking(t)));
    Ok(Finding::new(tests, format!("{}.", words.join("; "))))
}

fn wilson_beats_houbolt(view: &View) -> Result<Finding, String> {
    let npis = [12.0, 14.0, 16.0, 18.0, 20.0];
    let at = |npi| [Wilson, Houbolt].map(|m| view.error("5.6.8", m, npi));
    let words = npis.map(|npi| {
        let [wilson, houbolt] = at(npi).map(number);
        format!("NPI {npi}: {wilson} against {houbolt}")
    });
    Ok(Finding::new(npis.map(|n| at(n)[0] < at(n)[1]), format!("{}.", words.join(", "))))
}

fn bad_for_cyy(view: &View) -> Result<Finding, String> {
    let (mut tests, mut words) = (Vec::new(), Vec::new());
    for method in [Houbolt, Wilson] {
        let mean = view.mean("5.6.9", method);
        let [two, twenty] = [2.0, 20.0].map(|npi| view.error("5.6.9", method, npi));
        tests.extend([mean > 50.0, two > twenty]);
        let [mean, two, twenty] = [mean, two, twenty].map(number);
        words.push(format!("{} mean {mean}, NPI 2 → 20: {two} → {twenty}", method.name()));
    }
    Ok(Finding::new(tests, format!("{}.", words.join("; "))))
}

/// Largest minus smallest deviation of the five methods, averaged over NPI.
fn spread(view: &View, table: &str) -> f64 {
    let columns = Method::ALL.map(|m| view.deviations(table, m));
    let rows = columns[0].len();
    let at = |row: usize| {
        let values = columns.each_ref().map(|c| c[row].1);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        high - values.iter().copied().fold(f64::INFINITY, f64::min)
    };
    (0..rows).map(at).sum::<f64>() / rows as f64
}

fn dispersion(view: &View) -> Result<Finding, String> {
    let pairs = STIFFNESS_256.iter().zip(DAMPING_256);
    let spreads: Vec<[f64; 2]> = pairs.map(|(k, c)| [spread(view, k), spread(view, c)]).collect();
    let words = ["xx", "xy", "yx", "yy"]
        .iter()
        .zip(&spreads)
        .map(|(name, [k, c])| format!("K{name} {} and C{name} {}", number(*k), number(*c)));
    let words: Vec<String> = words.collect();
    let tests = spreads.iter().map(|[k, c]| c < k);
    Ok(Finding::new(tests, format!("Mean spread: {}.", words.join(", "))))
}

fn doubling_samples(view: &View) -> Result<Finding, String> {
    let pairs = STIFFNESS_256.into_iter().chain(DAMPING_256);
    let pairs = pairs.zip(STIFFNESS_512.into_iter().chain(DAMPING_512));
    let (mut tests, mut rises) = (Vec::new(), Vec::new());
    for (one, double) in pairs {
        for method in Method::ALL {
            let (from, to) = (view.mean(one, method), view.mean(double, method));
            tests.push(to < from);
            if to >= from {
                rises.push(format!("{} {double} {} → {}", method.name(), number(from), number(to)));
            }
        }
    }
    let rises = if rises.is_empty() { "none".to_owned() } else { rises.join(", ") };
    Ok(Finding::new(tests, format!("Means that rise: {rises}.")))
}

fn x_rows_better(view: &View) -> Result<Finding, String> {
    let sets = [
        ("K, Nt 256", STIFFNESS_256),
        ("C, Nt 256", DAMPING_256),
        ("K, Nt 512", STIFFNESS_512),
        ("C, Nt 512", DAMPING_512),
        ("K, frequency", FREQUENCY[0]),
        ("C, frequency", FREQUENCY[1]),
    ];
    let (mut tests, mut words) = (Vec::new(), Vec::new());
    for (name, [xx, xy, yx, yy]) in sets {
        let of = |m, a, b| (view.mean(a, m) + view.mean(b, m)) / 2.0;
        tests.extend(Method::ALL.map(|m| of(m, xx, xy) < of(m, yx, yy)));
        let over_methods = |a, b| Method::ALL.iter().map(|m| of(*m, a, b)).sum::<f64>() / 5.0;
        words.push(format!(
            "{name}: {} against {}",
            number(over_methods(xx, xy)),
            number(over_methods(yx, yy))
        ));
    }
    Ok(Finding::new(tests, format!("Means over all methods, {}.", words.join("; "))))
}
