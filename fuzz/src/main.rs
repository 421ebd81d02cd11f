//! Runs a chosen number of cases: `cargo run --release -p mechid-fuzz -- --cases 10000000`.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "it prints for the user who runs it")]

use std::process::ExitCode;
use std::time::Duration;

use mechid_fuzz::{Cases, run, targets};

const USAGE: &str = "\
Options: --target NAME (default: all), --cases COUNT (default: 1000000 of each), --seed NUMBER (1),
--case NUMBER (only this case), --seconds COUNT (at most, for each target), --case-seconds COUNT (after which a
case counts as a hang: 10; more if other programs run)";

fn main() -> ExitCode {
    match options() {
        Ok((names, cases)) => {
            let mut failed = false;
            for target in
                targets::all().iter().filter(|t| names.is_empty() || names.contains(&t.name.into()))
            {
                match run(target, &cases) {
                    Ok(summary) => println!("{}: {summary}", target.name),
                    Err(failure) => {
                        eprintln!("{failure}");
                        failed = true;
                    }
                }
            }
            ExitCode::from(u8::from(failed))
        }
        Err(what) => {
            eprintln!("{what}\n{USAGE}");
            ExitCode::from(2)
        }
    }
}

/// Returns the names of the chosen targets, and the choice of the cases.
fn options() -> Result<(Vec<String>, Cases), String> {
    let mut names = Vec::new();
    let mut cases = Cases {
        count: 1_000_000,
        first: 0,
        seed: 1,
        time_limit: Duration::from_secs(10),
        total_time: Duration::MAX,
    };
    let mut arguments = std::env::args().skip(1);
    while let Some(option) = arguments.next() {
        let value = arguments.next().ok_or_else(|| format!("{option} needs a value"))?;
        let number = || value.parse::<u64>().map_err(|e| format!("{option} {value}: {e}"));
        match option.as_str() {
            "--target" => names.push(value),
            "--cases" => cases.count = number()?,
            "--seed" => cases.seed = number()?,
            "--case" => (cases.first, cases.count) = (number()?, 1),
            "--case-seconds" => cases.time_limit = Duration::from_secs(number()?),
            "--seconds" => cases.total_time = Duration::from_secs(number()?),
            _ => return Err(format!("there is no option {option}")),
        }
    }
    let known = |name: &&String| !targets::all().iter().any(|t| t.name == name.as_str());
    match names.iter().find(known) {
        Some(name) => Err(format!("there is no target {name}")),
        None => Ok((names, cases)),
    }
}
