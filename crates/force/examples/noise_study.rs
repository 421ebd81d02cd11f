//! Prints the tables of `docs/book/src/studies/force.md`: `cargo run --release -p mechid-force
//! --example noise_study`. With `-- known` the program prints only the first table, with `--
//! coverage 200` the table of the intervals over 200 records each, and with `-- accelerations 100`
//! the table for tests that measure only accelerations.
#![allow(clippy::print_stdout, reason = "an example talks to its reader")]

#[allow(dead_code, reason = "the test uses the rest")]
#[path = "../tests/suite/study/mod.rs"]
mod study;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let runs = arguments.get(1).and_then(|runs| runs.parse().ok()).unwrap_or(100);
    if arguments.first().is_some_and(|first| first == "accelerations") {
        study::accelerations::table(runs, |row| println!("{row}"));
        return;
    }
    if arguments.first().is_some_and(|first| first == "coverage") {
        let methods = arguments.get(2..).unwrap_or_default();
        println!("{}", study::coverage::coverage_table(runs, methods));
        return;
    }
    println!("{}", study::known_table());
    if arguments.first().is_some_and(|first| first == "known") {
        return;
    }
    println!("{}\n{}", study::unknown_table(), study::rule_table(&study::rule_rows()));
}
