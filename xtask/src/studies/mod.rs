//! Studies of many seeded experiments. The short form tests the coverage of the intervals at every
//! change of the code; the long form runs all studies in a given time.

pub mod binomial;
pub mod coverage;
mod long;
mod page;
mod results;

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use binomial::{LOSS, Limits, power};
use coverage::{Interval, KINDS};

pub use page::differences;

/// Number of experiments of each kind in the short form; [`short_power`] returns the probability
/// that they detect a loss of coverage.
pub const SHORT: u64 = 4096;
/// Number of experiments between two checks of the time.
const BLOCK: u64 = 1024;
/// Share of the time budget for the coverage of the known oscillator.
const COVERAGE_SHARE: f64 = 0.2;

/// Settings of a run.
#[derive(Debug, Clone)]
pub struct Plan {
    /// First of the consecutive seeds of the experiments.
    pub seed: u64,
    /// Time budget of the long form; `None` for the short one.
    pub budget: Option<Duration>,
    /// Long studies whose names contain this text.
    pub only: String,
    /// Cargo's profile for the long studies.
    pub profile: String,
    /// Folder of the results. `None` means `target/studies`; only then are the tables of the book
    /// written.
    pub out: Option<PathBuf>,
}

/// Coverage of one parameter in one kind of experiment.
#[derive(Debug, Clone, PartialEq)]
pub struct Coverage {
    /// Kind of experiment.
    pub kind: &'static str,
    /// Letter of the parameter: m, c or k.
    pub parameter: &'static str,
    /// Number of experiments.
    pub experiments: u64,
    /// Number of intervals that contain the true value.
    pub containing_truth: u64,
    /// Number of identifications that failed.
    pub failed: u64,
}

impl Coverage {
    fn new(kind: &'static str, parameter: &'static str, intervals: &[Interval]) -> Self {
        let of = || intervals.iter().filter(|interval| interval.parameter == parameter);
        Self {
            kind,
            parameter,
            experiments: of().count() as u64,
            containing_truth: of().filter(|interval| interval.holds()).count() as u64,
            failed: of().filter(|interval| interval.estimate.is_none()).count() as u64,
        }
    }

    /// Returns a sentence if the coverage is significantly below the stated coverage; otherwise
    /// `None`.
    ///
    /// # Errors
    /// A message if there are no experiments.
    pub fn alarm(&self) -> Result<Option<String>, String> {
        let Limits { fewest, .. } = Limits::new(self.experiments)?;
        let Self { kind, parameter, experiments, containing_truth, failed } = self;
        Ok((*containing_truth < fewest).then(|| {
            format!(
                "{kind}: {containing_truth} of {experiments} intervals of {parameter} hold ({failed} fits \
                 failed), where {fewest} are the fewest expected"
            )
        }))
    }
}

/// Runs the short form.
///
/// # Errors
/// The message of a generator that fails.
pub fn short(seed: u64) -> Result<Vec<(Coverage, Vec<Interval>)>, String> {
    coverages(seed, true, |done, _| done >= SHORT)
}

/// Runs experiments of each kind in blocks. A kind ends when `is_enough` returns true for its
/// number of experiments and its running time.
fn coverages(
    seed: u64,
    is_short: bool,
    is_enough: impl Fn(u64, Duration) -> bool,
) -> Result<Vec<(Coverage, Vec<Interval>)>, String> {
    let mut all = Vec::new();
    for kind in KINDS.into_iter().filter(|kind| kind.is_short || !is_short) {
        let (start, mut done, mut intervals) = (Instant::now(), 0, Vec::new());
        while !is_enough(done, start.elapsed()) {
            intervals.extend(kind.run(seed + done..seed + done + BLOCK)?);
            done += BLOCK;
        }
        for parameter in ["m", "c", "k"] {
            let own: Vec<Interval> = intervals
                .iter()
                .filter(|interval| interval.parameter == parameter)
                .cloned()
                .collect();
            all.push((Coverage::new(kind.name, parameter, &own), own));
        }
    }
    Ok(all)
}

/// Returns a sentence for each coverage that is significantly below the stated coverage.
///
/// # Errors
/// A message if there are no experiments.
pub fn alarms<'a>(all: impl IntoIterator<Item = &'a Coverage>) -> Result<Vec<String>, String> {
    let each: Result<Vec<_>, _> = all.into_iter().map(Coverage::alarm).collect();
    Ok(each?.into_iter().flatten().collect())
}

/// Runs the studies of a plan, writes their results as Parquet and the tables of the book; returns
/// the report and the alarms.
///
/// # Errors
/// The message of the study or of the file that fails.
pub fn run(root: &Path, plan: &Plan) -> Result<(String, Vec<String>), String> {
    long::chosen(&plan.only)?;
    let out = plan.out.clone().unwrap_or_else(|| root.join("target/studies"));
    std::fs::create_dir_all(&out).map_err(|e| format!("{}: {e}", out.display()))?;
    let all = match plan.budget {
        None => short(plan.seed)?,
        Some(budget) => {
            let each = budget.mul_f64(COVERAGE_SHARE / KINDS.len() as f64);
            coverages(plan.seed, false, |done, time| done >= SHORT && time >= each)?
        }
    };
    results::write(&out.join("coverage.parquet"), &all)?;
    let coverages: Vec<Coverage> = all.into_iter().map(|(coverage, _)| coverage).collect();
    let mut told = page::table(&coverages)?;
    // The page has the numbers of the short form, which anyone can repeat in seconds.
    if plan.out.is_none() && plan.budget.is_none() {
        page::write(root, &coverages)?;
    }
    let mut alarms = alarms(&coverages)?;
    if let Some(budget) = plan.budget {
        let budget = budget.mul_f64(1.0 - COVERAGE_SHARE);
        let (long, failed) = long::run(root, &out, plan, budget)?;
        told += &long;
        alarms.extend(failed);
    }
    Ok((told, alarms))
}

/// Returns the probability that the short form detects [`LOSS`] in one parameter.
///
/// # Errors
/// None in practice.
pub fn short_power() -> Result<f64, String> {
    power(SHORT, LOSS)
}
