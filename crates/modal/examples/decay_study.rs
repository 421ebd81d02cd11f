//! Study of free decays with exactly known modes, under white and coloured noise: percentage of
//! records with the right number of modes, coverage of the 95 % intervals, ratio of the scatter to
//! the Cramér–Rao bound.
//!
//! ```sh
//! cargo run --release -p mechid-modal --example decay_study -- 1000
//! ```
//!
//! The arguments are the number of experiments per case and, optionally, the first letters of the
//! names of the cases to run.

#![allow(clippy::print_stdout, reason = "the table is the result")]

#[path = "../tests/free_decay/noisy/mod.rs"]
mod decay;

use decay::{Case, found_in_noise};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let runs: usize = arguments.next().map_or(Ok(200), |runs| runs.parse())?;
    let only = arguments.next().unwrap_or_default();
    println!(
        "| Modes, channels, noise | right number | coverage f, ζ, shape | scatter f, ζ | alarms: colour, onset |"
    );
    println!("|---|---|---|---|---|");
    let separate =
        |modes, channels, noise, coloured| Case { modes, channels, noise, coloured, close: false };
    let pair =
        |channels, noise, coloured| Case { modes: 2, channels, noise, coloured, close: true };
    let cases = [
        separate(1, 1, 0.001, false),
        separate(1, 1, 0.05, false),
        separate(2, 1, 0.01, false),
        separate(2, 4, 0.05, false),
        separate(3, 2, 0.01, false),
        separate(4, 3, 0.05, false),
        separate(5, 1, 0.001, false),
        separate(5, 4, 0.01, false),
        pair(1, 0.01, false),
        pair(2, 0.05, false),
        separate(1, 1, 0.05, true),
        separate(2, 2, 0.01, true),
        separate(3, 4, 0.05, true),
        separate(5, 4, 0.01, true),
        pair(2, 0.01, true),
    ];
    for case in cases.iter().filter(|case| case.name().starts_with(&only)) {
        let outcome = case.run(runs);
        let ([f, z, s], [sf, sz]) = (outcome.coverage(), outcome.scatter());
        let [white, onset] = outcome.alarm_rates();
        let shapes = if s.is_nan() { "–".to_owned() } else { format!("{s:.1} %") };
        println!(
            "| {} | {:.1} % | {f:.1} %, {z:.1} %, {shapes} | {sf:.3}, {sz:.3} | {white:.1} %, {onset:.1} % |",
            case.name(),
            outcome.right(),
        );
    }
    for coloured in [false, true].into_iter().filter(|_| only.is_empty()) {
        for channels in [1, 4] {
            let runs = 5 * runs as u64;
            let found = found_in_noise(channels, coloured, runs);
            let noise = if coloured { "AR(0.9)" } else { "white" };
            println!("modes in {noise} noise alone, {channels} channels: {found} of {runs}");
        }
    }
    Ok(())
}
