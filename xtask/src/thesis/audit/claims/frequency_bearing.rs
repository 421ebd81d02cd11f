//! Section 5.7 and Appendix A: the bearing from the frequency domain; both domains compared.

use super::super::super::published::Method::{
    self, CentralDifference as Central, Houbolt, Newmark, Rk4, WilsonTheta as Wilson,
};
use super::super::evidence::View;
use super::super::markdown::number;
use super::{Claim, DIRECT, Finding, Support, below, best_npi, in_order};

pub const CLAIMS: &[Claim] = &[
    Claim {
        number: 36,
        section: "5.7.1",
        statement: "Kxx and Kxy become good for all methods as NPI grows, the central difference being worst.",
        test: "in 5.7.1 and 5.7.2 each error is smaller at NPI 20 than at NPI 2, and the central difference has the largest mean",
        support: Support::Tables,
        judge: stiffness_x,
    },
    Claim {
        number: 37,
        section: "5.7.1",
        statement: "Kyx is scattered, without a winner; Kyy likewise, the central difference being worst.",
        test: "no method is best at more than half of the NPI of 5.7.3, nor of 5.7.4; the central difference has the largest mean of 5.7.4",
        support: Support::Tables,
        judge: stiffness_y,
    },
    Claim {
        number: 38,
        section: "5.7.1",
        statement: "Cxx becomes good as NPI falls; order: central difference, Newmark, Wilson θ, Houbolt.",
        test: "the means of 5.7.5 in that order, and each direct method's error smaller at NPI 2 than at NPI 20",
        support: Support::Tables,
        judge: |v| damping_x(v, "5.7.5", &[Central, Newmark, Wilson, Houbolt]),
    },
    Claim {
        number: 39,
        section: "5.7.1",
        statement: "Cxy behaves like Cxx, but the central difference is no longer good.",
        test: "in 5.7.6 each direct method's error is smaller at NPI 2 than at NPI 20, and Newmark, Houbolt and Wilson θ have smaller means than the central difference",
        support: Support::Tables,
        judge: damping_xy,
    },
    Claim {
        number: 40,
        section: "5.7.1",
        statement: "For Cyx central difference and Wilson θ are far off.",
        test: "both means of 5.7.7 above 50 % and above those of the three others",
        support: Support::Tables,
        judge: |v| far_off(v, "5.7.7", &[Central, Wilson], &[Rk4, Newmark, Houbolt]),
    },
    Claim {
        number: 41,
        section: "5.7.1",
        statement: "For Cyy Newmark is good and better than Runge-Kutta; the three others are very high.",
        test: "Newmark's mean of 5.7.8 below Runge-Kutta's; those of the three others above 50 % and above both",
        support: Support::Tables,
        judge: damping_yy,
    },
    Claim {
        number: 42,
        section: "5.7, Appendix A",
        statement: "Nf = 256 instead of 128 harmonics changes nothing of importance.",
        test: "each of the forty means of A1–A8 within 10 points of its partner of 5.7.1–5.7.8",
        support: Support::Tables,
        judge: more_harmonics,
    },
    Claim {
        number: 43,
        section: "6.1",
        statement: "A growing NPI helps the frequency domain and harms the time domain, and conversely.",
        test: "in each column the error is smaller at NPI 20 than at NPI 2 (frequency: 5.3.1, 5.3.2, 5.7.1–5.7.8) or larger (time: 5.2.2, 5.2.3, 5.6.2–5.6.9)",
        support: Support::Tables,
        judge: opposite_domains,
    },
];

const TABLES: [&str; 8] = ["5.7.1", "5.7.2", "5.7.3", "5.7.4", "5.7.5", "5.7.6", "5.7.7", "5.7.8"];
const APPENDIX: [&str; 8] = ["A1", "A2", "A3", "A4", "A5", "A6", "A7", "A8"];
const TIME: [&str; 8] = ["5.6.2", "5.6.3", "5.6.4", "5.6.5", "5.6.6", "5.6.7", "5.6.8", "5.6.9"];

fn ends(view: &View, table: &str, method: Method) -> [f64; 2] {
    [2.0, 20.0].map(|npi| view.error(table, method, npi))
}

/// Tests that the mean error of `method` is the largest; the mean of each other method must be
/// smaller.
fn worst(view: &View, table: &str, method: Method) -> Vec<bool> {
    let rivals = Method::ALL.into_iter().filter(|m| *m != method);
    rivals.map(|m| view.mean(table, m) < view.mean(table, method)).collect()
}

fn trend(view: &View, table: &str) -> String {
    let one = |m: Method| {
        let [two, twenty] = ends(view, table, m).map(number);
        format!("{} {two} → {twenty}", m.name())
    };
    format!("{table}, NPI 2 → 20: {}", Method::ALL.map(one).join(", "))
}

fn stiffness_x(view: &View) -> Result<Finding, String> {
    let tables = ["5.7.1", "5.7.2"];
    let tests = tables.iter().flat_map(|t| {
        let falls = Method::ALL.map(|m| ends(view, t, m)).map(|[two, twenty]| twenty < two);
        [falls.to_vec(), worst(view, t, Central)].concat()
    });
    let words = tables.map(|t| format!("{}; means {}", trend(view, t), view.ranking(t)));
    Ok(Finding::new(tests, format!("{}.", words.join(". "))))
}

fn stiffness_y(view: &View) -> Result<Finding, String> {
    let wins = |table| {
        let columns = Method::ALL.map(|m| view.series(table, m));
        let winner = |row: usize| {
            let at = |c: &usize| columns[*c][row].1;
            (0..5).min_by(|a, b| at(a).total_cmp(&at(b)))
        };
        let winners: Vec<Option<usize>> = (0..columns[0].len()).map(winner).collect();
        let most = (0..5).map(|m| winners.iter().filter(|w| **w == Some(m)).count());
        (most.max().unwrap_or(0), winners.len())
    };
    let counts = ["5.7.3", "5.7.4"].map(wins);
    let scattered = counts.map(|(most, rows)| 2 * most <= rows);
    let tests = scattered.into_iter().chain(worst(view, "5.7.4", Central));
    let words = counts.map(|(most, rows)| format!("{most} of {rows}"));
    Ok(Finding::new(
        tests,
        format!(
            "Most first places of one method: {} in 5.7.3, {} in 5.7.4. Means of 5.7.3: {}; of 5.7.4: {}.",
            words[0],
            words[1],
            view.ranking("5.7.3"),
            view.ranking("5.7.4")
        ),
    ))
}

fn damping_x(view: &View, table: &str, order: &[Method]) -> Result<Finding, String> {
    let falls = DIRECT.map(|m| ends(view, table, m)).map(|[two, twenty]| two < twenty);
    let tests = in_order(view, table, order).into_iter().chain(falls);
    Ok(Finding::new(tests, format!("Means: {}. {}.", view.ranking(table), trend(view, table))))
}

fn damping_xy(view: &View) -> Result<Finding, String> {
    let mut finding = damping_x(view, "5.7.6", &[])?;
    let rivals = [Newmark, Houbolt, Wilson];
    let better = rivals.map(|m| view.mean("5.7.6", m) < view.mean("5.7.6", Central));
    finding.tally = finding.tally.and(better.into_iter().collect());
    Ok(finding)
}

fn far_off(view: &View, table: &str, bad: &[Method], others: &[Method]) -> Result<Finding, String> {
    let tests = bad.iter().flat_map(|m| {
        let mean = view.mean(table, *m);
        let above = others.iter().map(move |o| view.mean(table, *o) < mean);
        above.chain([mean > 50.0])
    });
    Ok(Finding::new(tests, format!("Means: {}.", view.ranking(table))))
}

fn damping_yy(view: &View) -> Result<Finding, String> {
    let mut finding = far_off(view, "5.7.8", &[Central, Houbolt, Wilson], &[Newmark, Rk4])?;
    let better = below(view, "5.7.8", Newmark, &[Rk4]);
    finding.tally = finding.tally.and(better.into_iter().collect());
    Ok(finding)
}

fn more_harmonics(view: &View) -> Result<Finding, String> {
    let (mut tests, mut moved) = (Vec::new(), Vec::new());
    for (table, twin) in TABLES.into_iter().zip(APPENDIX) {
        for method in Method::ALL {
            let (from, to) = (view.mean(table, method), view.mean(twin, method));
            let near = (to - from).abs() <= 10.0;
            tests.push(near);
            if !near {
                moved.push(format!("{} {twin} {} → {}", method.name(), number(from), number(to)));
            }
        }
    }
    let moved = if moved.is_empty() { "none".to_owned() } else { moved.join(", ") };
    Ok(Finding::new(tests, format!("Means that move further: {moved}.")))
}

fn opposite_domains(view: &View) -> Result<Finding, String> {
    let falls = |tables: &[&str], sign: f64| -> Vec<bool> {
        let columns = tables.iter().flat_map(|t| Method::ALL.map(|m| ends(view, t, m)));
        columns.map(|[two, twenty]| sign * (twenty - two) < 0.0).collect()
    };
    let count =
        |tests: &[bool]| format!("{} of {}", tests.iter().filter(|t| **t).count(), tests.len());
    let single = falls(&["5.3.1", "5.3.2"], 1.0);
    let bearing = falls(&TABLES, 1.0);
    let time = [falls(&["5.2.2", "5.2.3"], -1.0), falls(&TIME, -1.0)];
    let least = Method::ALL.map(|m| best_npi(&view.series("5.3.1", m)).to_string());
    let numbers = format!(
        "Frequency: {} columns of one degree of freedom, {} of the bearing fall. Time: {} and {} rise. NPI of the least error in K of 5.3.1: {}.",
        count(&single),
        count(&bearing),
        count(&time[0]),
        count(&time[1]),
        least.join(", ")
    );
    Ok(Finding::new([single, bearing, time.concat()].concat(), numbers))
}
