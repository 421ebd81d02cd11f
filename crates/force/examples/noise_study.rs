//! Prints the tables of `docs/book/src/choose/force.md`:
//! `cargo run --release -p mechid-force --example noise_study`.
#![allow(clippy::print_stdout, reason = "an example talks to its reader")]

#[allow(dead_code, reason = "the test uses the rest")]
#[path = "../tests/suite/study/mod.rs"]
mod study;

fn main() {
    let [known, unknown] = study::tables();
    println!("{known}\n{unknown}\n{}", study::rule_table(&study::rule_rows()));
}
