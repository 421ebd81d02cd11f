//! `cargo xtask …`: project tasks.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program talks to its terminal")]

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::{Parser, Subcommand};
use indicatif::ProgressBar;
use xtask::studies::{self, Plan};
use xtask::thesis::reproduce::{self, Reproduction};
use xtask::{conformance, cost};

/// Project tasks.
#[derive(Debug, Parser)]
#[command(name = "cargo xtask")]
struct Tasks {
    #[command(subcommand)]
    task: Task,
}

#[derive(Debug, Subcommand)]
enum Task {
    /// Compute every table and figure of the dissertation, and write them with the audit page.
    ReproduceThesis {
        /// Only the table or figure of this number, for example 5.6.4 or figure-5.2.4.
        #[arg(long, value_name = "NUMBER")]
        only: Option<String>,
        /// Compare with the golden files (to 1e-9) and with the tables, figures and pages of the
        /// repository, without writing them; superfluous files are errors, too.
        #[arg(long, conflicts_with = "bless")]
        check: bool,
        /// Rewrite the golden files on purpose.
        #[arg(long)]
        bless: bool,
        /// Folder of the tables and figures [default: docs/thesis].
        #[arg(long, value_name = "FOLDER")]
        out: Option<PathBuf>,
    },
    /// Compute every number that somebody else printed or that has a closed form, and write the
    /// page of the book about it.
    Conformance {
        /// Compare the page with what is computed now, without writing it.
        #[arg(long)]
        check: bool,
        /// Folder of the page and of the rows as JSON [default: the book, without JSON].
        #[arg(long, value_name = "FOLDER")]
        out: Option<PathBuf>,
    },
    /// Run studies of many seeded experiments and write their results as Parquet. The short form
    /// tests the coverage of the intervals; the long form runs all studies in a given time.
    Studies {
        /// Compare the short form with the page of the book, without writing it.
        #[arg(long, conflicts_with_all = ["seconds", "out"])]
        check: bool,
        /// Time budget of the long form, in s [default: the short form].
        #[arg(long)]
        seconds: Option<f64>,
        /// First seed.
        #[arg(long, default_value_t = 0)]
        seed: u64,
        /// Run only the long studies whose names contain this text [default: all].
        #[arg(long, default_value = "", hide_default_value = true)]
        only: String,
        /// Cargo's profile for the long studies.
        #[arg(long, default_value = "release")]
        profile: String,
        /// Folder of the results; if it is given, the book is not written [default:
        /// target/studies].
        #[arg(long, value_name = "FOLDER")]
        out: Option<PathBuf>,
    },
    /// Measure how time grows with degrees of freedom and samples, and write the page of the book
    /// about it (with --release, on an idle machine).
    MeasureCost {
        /// Time for the repeated runs of each point, in s.
        #[arg(long, default_value_t = 0.5)]
        seconds: f64,
        /// Measure only the laboratory tests, with the program of the same build.
        #[arg(long)]
        lab: bool,
    },
}

fn main() -> ExitCode {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or(Path::new("."));
    let outcome = match Tasks::parse().task {
        Task::Conformance { check: true, .. } => conformance_compared(root),
        Task::Conformance { out, .. } => {
            conformance::write(root, out.as_deref()).map(|rows| println!("{rows} rows written"))
        }
        Task::Studies { check: true, seed, .. } => studies_compared(root, seed),
        Task::Studies { seconds, seed, only, profile, out, .. } => {
            run_studies(root, seconds, Plan { seed, budget: None, only, profile, out })
        }
        Task::MeasureCost { lab: true, .. } => cost::write_lab(root),
        Task::MeasureCost { seconds, .. } => cost::write(root, seconds),
        Task::ReproduceThesis { only, check, bless, out } => {
            reproduce_thesis(root, only.as_deref(), check, bless, out)
        }
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(words) => {
            eprintln!("error: {words}");
            ExitCode::FAILURE
        }
    }
}

fn reproduce_thesis(
    root: &Path,
    only: Option<&str>,
    check: bool,
    bless: bool,
    out: Option<PathBuf>,
) -> Result<(), String> {
    let out = out.unwrap_or_else(|| root.join("docs/thesis"));
    let reproduction = computed(root, only)?;
    if check {
        return compared(root, &reproduction, only.is_none());
    }
    let files = reproduction.write(&out)?;
    println!("{files} files written to {}", out.display());
    if bless {
        reproduction.bless(root)?;
        println!("{} golden files rewritten", reproduction.golden_files());
    }
    Ok(())
}

fn conformance_compared(root: &Path) -> Result<(), String> {
    match conformance::differences(root)?.as_slice() {
        [] => {
            println!("the page agrees");
            Ok(())
        }
        differences => {
            differences.iter().take(20).for_each(|difference| eprintln!("{difference}"));
            Err(format!("{} differences from the page", differences.len()))
        }
    }
}

fn run_studies(root: &Path, seconds: Option<f64>, plan: Plan) -> Result<(), String> {
    let budget = seconds.map(Duration::try_from_secs_f64).transpose();
    let budget = budget.map_err(|e| format!("--seconds: {e}"))?;
    let (told, alarms) = studies::run(root, &Plan { budget, ..plan })?;
    print!("{told}");
    if alarms.is_empty() { Ok(()) } else { Err(alarms.join("\n")) }
}

fn studies_compared(root: &Path, seed: u64) -> Result<(), String> {
    let all = studies::short(seed)?;
    let coverages: Vec<_> = all.into_iter().map(|(coverage, _)| coverage).collect();
    let mut wrong = studies::alarms(&coverages)?;
    if seed == 0 {
        wrong.extend(studies::differences(root, &coverages)?);
    }
    if wrong.is_empty() {
        println!("{} intervals agree with the page", coverages.len() as u64 * studies::SHORT);
        return Ok(());
    }
    Err(wrong.join("\n"))
}

fn computed(root: &Path, only: Option<&str>) -> Result<Reproduction, String> {
    let start = Instant::now();
    let bar = ProgressBar::new(reproduce::ticks(root)? as u64);
    let artefacts = reproduce::all(root, || bar.inc(1))?;
    bar.finish_and_clear();
    println!(
        "{} tables and figures in {:.1} s",
        artefacts.artefacts.len(),
        start.elapsed().as_secs_f64()
    );
    only.map_or(Ok(artefacts.clone()), |number| artefacts.only(number))
}

fn compared(root: &Path, reproduction: &Reproduction, whole: bool) -> Result<(), String> {
    let differences = reproduction.differences(root, whole)?;
    if differences.is_empty() {
        println!(
            "{} golden files, {} tables and figures and {} pages agree",
            reproduction.golden_files(),
            reproduction.artefacts.len(),
            reproduction.pages.len()
        );
        return Ok(());
    }
    for difference in differences.iter().take(20) {
        eprintln!("{difference}");
    }
    Err(format!("{} differences from the files of the repository", differences.len()))
}
