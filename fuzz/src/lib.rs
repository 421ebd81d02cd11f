//! Random and damaged input for every reader and public function of the workspace.
//!
//! A [`Target`] takes bytes and returns an error if a checked property does not hold; a panic, a
//! hang and too much memory are errors, too. [`run`] calls it with the files of its corpus (a
//! folder of `corpus` in this package) and then with mutations of them, or with random bytes; the
//! target draws the arguments of public functions from random bytes. Each case is determined by the
//! seed and its number.
//!
//! - `cargo test -p mechid-fuzz` runs some thousand cases of each target.
//! - `cargo run --release -p mechid-fuzz -- --cases 10000000` runs many. `--target NAME` selects
//!   one target, `--seed` other cases, and `--case` repeats a single case.
//!
//! An input that fails is written to `target/fuzz`. Once the defect is corrected, the input is
//! added to the corpus, so that every run tests it.
//!
//! To add a target, write a function in a file of `targets` and add a line to [`targets::all`].

pub mod depth;
mod mutation;
pub mod targets;

use std::fmt::Write as _;
use std::panic::{self, AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use std::{fs, io, thread};

use peak_alloc::PeakAlloc;
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;

/// The allocator of this package's programs, which measures the memory.
#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// The number of changes to an input is less than 2 to this power.
const MANY: u32 = 6;
const FEW: u32 = 3;

/// Message and place of the last panic.
static LAST_PANIC: Mutex<String> = Mutex::new(String::new());

fn last_panic() -> MutexGuard<'static, String> {
    LAST_PANIC.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A function under test that takes bytes, with its inputs and limits.
#[derive(Debug, Clone, Copy)]
pub struct Target {
    /// Name of the target.
    pub name: &'static str,
    /// Folder of the corpus.
    pub corpus: &'static str,
    /// Kind of the inputs.
    pub input: Input,
    /// Memory that a case may use, in bytes: a constant part and a part for each byte of the input.
    pub memory: [usize; 2],
    /// Runs a case; an error states the property that does not hold.
    pub run: fn(&[u8]) -> Result<(), String>,
}

/// Kind of the inputs of a target.
#[derive(Debug, Clone, Copy)]
pub enum Input {
    /// Files of the corpus with changes; some changes insert one of these texts, such as words of a
    /// format.
    Mutations(&'static [&'static str]),
    /// Files of the corpus with few changes, or with changes of numbers only: the reader accepts
    /// most of these inputs. Some changes insert one of these texts.
    Few(&'static [&'static str]),
    /// Random bytes, from which a target draws arguments.
    Bytes,
}

/// Choice of the cases to run.
#[derive(Debug, Clone)]
pub struct Cases {
    /// Number of mutations, in addition to the corpus.
    pub count: u64,
    /// Number of the first mutation.
    pub first: u64,
    /// Seed of all mutations.
    pub seed: u64,
    /// Time after which a case counts as a hang.
    pub time_limit: Duration,
    /// Time after which no further case is started.
    pub total_time: Duration,
}

/// Result of a run without a failure.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Summary {
    /// Number of cases run.
    pub cases: u64,
    /// Largest memory that a case used, in bytes.
    pub peak: usize,
    /// Longest time that a case took.
    pub longest: Duration,
    /// Number of cases by the greatest [`Depth`](depth::Depth) that each case reached: refused by
    /// the reader, read, analysis begun, with a result.
    pub depths: [u64; 4],
}

impl std::fmt::Display for Summary {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { cases, peak, longest, depths: [refused, read, reached, fitted] } = self;
        write!(
            f,
            "{cases} cases: {refused} refused by the reader, {read} read, {reached} at work, {fitted} with a result; \
             {:.1} MB, {:.2} s at most",
            *peak as f64 / 1e6,
            longest.as_secs_f64()
        )
    }
}

/// A case that failed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Failure {
    /// Name of the target.
    pub target: &'static str,
    /// Number of the case, or name of the file of the corpus.
    pub case: String,
    /// Description of the failure.
    pub what: String,
    /// Path to which the input was written.
    pub input: PathBuf,
}

impl std::fmt::Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { target, case, what, input } = self;
        write!(f, "{target}, case {case}: {what}; the input is {}", input.display())
    }
}

/// Returns the files of a corpus, sorted by name: their names and contents.
///
/// # Errors
/// If the folder or a file cannot be read.
pub fn corpus(target: &Target) -> io::Result<Vec<(String, Vec<u8>)>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(target.corpus);
    let mut files = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned());
        files.push((name.unwrap_or_default(), fs::read(path)?));
    }
    files.sort();
    Ok(files)
}

/// Runs the corpus of a target and mutations of it, until the first failure.
///
/// Cases run in a separate thread, so that a case that hangs can be reported; its thread keeps
/// running. The memory is measured for the whole process, so only one run may be active.
///
/// # Errors
/// The first case that panics, violates a checked property, or needs too much time or memory.
///
/// # Panics
/// If the corpus cannot be read or is empty.
pub fn run(target: &Target, cases: &Cases) -> Result<Summary, Failure> {
    // A backtrace would count as memory of the case.
    panic::set_hook(Box::new(|panic| *last_panic() = panic.to_string()));
    let corpus = corpus(target).expect("the corpus is in the repository");
    assert!(!corpus.is_empty(), "{} has a corpus", target.name);
    let inputs: Vec<Vec<u8>> = corpus.iter().map(|(_, input)| input.clone()).collect();
    let (to_run, inbox) = channel::<Vec<u8>>();
    let (outbox, results) = channel();
    let target = *target;
    thread::spawn(move || {
        for input in inbox {
            let result = measured(&target, &input);
            if outbox.send(result).is_err() {
                return;
            }
        }
    });
    let begin = Instant::now();
    let mut summary = Summary { cases: 0, peak: 0, longest: Duration::ZERO, depths: [0; 4] };
    let mut one = |case: String, input: Vec<u8>| {
        let failed = |what: String| {
            let input = kept(&target, &input);
            Failure { target: target.name, case: case.clone(), what, input }
        };
        if to_run.send(input.clone()).is_err() {
            return Err(failed("the thread that runs the cases has ended".into()));
        }
        let (result, peak, time, depth) = match results.recv_timeout(cases.time_limit) {
            Ok(measured) => measured,
            Err(RecvTimeoutError::Timeout) => {
                return Err(failed(format!("it takes longer than {:?}", cases.time_limit)));
            }
            Err(RecvTimeoutError::Disconnected) => {
                return Err(failed("the thread that runs the cases has ended".into()));
            }
        };
        result.map_err(&failed)?;
        let allowed = target.memory[0] + target.memory[1] * input.len();
        if peak > allowed {
            let len = input.len();
            return Err(failed(format!("{peak} bytes of memory for {len}, {allowed} are allowed")));
        }
        summary.cases += 1;
        summary.depths[depth] += 1;
        summary.peak = summary.peak.max(peak);
        summary.longest = summary.longest.max(time);
        Ok(())
    };
    for (name, input) in corpus {
        one(name, input)?;
    }
    for case in cases.first..cases.first + cases.count {
        if begin.elapsed() > cases.total_time {
            break;
        }
        let mut random = ChaCha8Rng::seed_from_u64(cases.seed);
        random.set_stream(case);
        let input = match target.input {
            Input::Mutations(words) => mutation::mutated(&inputs, words, &mut random, MANY),
            // Every second case keeps the structure of the file and changes only numbers.
            Input::Few(_) if case % 2 == 1 => mutation::renumbered(&inputs, &mut random),
            Input::Few(words) => mutation::mutated(&inputs, words, &mut random, FEW),
            Input::Bytes => mutation::bytes(&mut random),
        };
        one(case.to_string(), input)?;
    }
    Ok(summary)
}

/// Runs a case; returns its result, the memory and time that it used, and its depth.
fn measured(target: &Target, input: &[u8]) -> (Result<(), String>, usize, Duration, usize) {
    depth::taken();
    MEMORY.reset_peak_usage();
    let (before, begin) = (MEMORY.current_usage(), Instant::now());
    let result = catch_unwind(AssertUnwindSafe(|| (target.run)(input)))
        .unwrap_or_else(|_| Err(format!("it panics: {}", last_panic())));
    (result, MEMORY.peak_usage().saturating_sub(before), begin.elapsed(), depth::taken())
}

/// Writes an input that failed to `target/fuzz`, and returns its path.
fn kept(target: &Target, input: &[u8]) -> PathBuf {
    // The FNV-1a hash gives the same input the same name.
    let hash = input.iter().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3)
    });
    let mut name = target.name.to_owned();
    let _ = write!(name, "-{hash:016x}");
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/fuzz");
    let path = folder.join(name);
    let _ = fs::create_dir_all(folder).and_then(|()| fs::write(&path, input));
    path
}
