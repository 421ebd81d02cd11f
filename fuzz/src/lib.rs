//! Random and damaged input for every reader and public function of the workspace.
//!
//! A [`Target`] takes bytes and returns an error where a promise is broken; a panic, a hang and
//! memory beyond a cap are errors, too. [`run`] gives it the files of its corpus (a folder of
//! `corpus` in this package) and then mutations of them, or random bytes from which it draws the
//! arguments of public functions; each follows from its seed and its number alone.
//!
//! - `cargo test -p mechid-fuzz` runs some thousand cases of each target.
//! - `cargo run --release -p mechid-fuzz -- --cases 10000000` runs many, of one target with
//!   `--target NAME`; `--seed` chooses others, `--case` repeats one.
//!
//! An input that fails is written to `target/fuzz`. Once the defect is mended it goes to the corpus,
//! so that it is tried on every run.
//!
//! To add a target: a function in a file of `targets`, and a line in [`targets::all`].

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

/// The allocator of this package's programs, which counts.
#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Powers of two below which the number of changes to an input is drawn.
const MANY: u32 = 6;
const FEW: u32 = 3;

/// Message and place of the last panic.
static LAST_PANIC: Mutex<String> = Mutex::new(String::new());

fn last_panic() -> MutexGuard<'static, String> {
    LAST_PANIC.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Something that takes bytes.
#[derive(Debug, Clone, Copy)]
pub struct Target {
    /// Its name.
    pub name: &'static str,
    /// Folder of its corpus.
    pub corpus: &'static str,
    /// What its input is made of.
    pub input: Input,
    /// Bytes of memory that a case may take, and as many more for each byte of its input.
    pub memory: [usize; 2],
    /// Runs a case; an error says which promise is broken.
    pub run: fn(&[u8]) -> Result<(), String>,
}

/// What the input of a target is made of.
#[derive(Debug, Clone, Copy)]
pub enum Input {
    /// Files of its corpus with changes, some of which put in texts such as the words of a format.
    Mutations(&'static [&'static str]),
    /// The same with few changes, or with other numbers alone, so that most inputs pass the reader.
    Few(&'static [&'static str]),
    /// Random bytes, from which a target draws arguments.
    Bytes,
}

/// Which cases to run.
#[derive(Debug, Clone)]
pub struct Cases {
    /// Number of mutations beside the corpus.
    pub count: u64,
    /// Number of the first one.
    pub first: u64,
    /// Seed of all of them.
    pub seed: u64,
    /// Time after which a case counts as a hang.
    pub time_limit: Duration,
    /// Time after which no more cases are run.
    pub total_time: Duration,
}

/// What a run has found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Summary {
    /// Number of cases run.
    pub cases: u64,
    /// Largest memory that a case took, in bytes.
    pub peak: usize,
    /// Longest time that a case took.
    pub longest: Duration,
    /// Number of cases that came as far as each [`Depth`](depth::Depth) and no farther: refused by the
    /// reader, read, at work, with a result.
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

/// A case that broke a promise.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Failure {
    /// Name of the target.
    pub target: &'static str,
    /// Number of the case, or name of the file of the corpus.
    pub case: String,
    /// What went wrong.
    pub what: String,
    /// Where the input was written.
    pub input: PathBuf,
}

impl std::fmt::Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { target, case, what, input } = self;
        write!(f, "{target}, case {case}: {what}; the input is {}", input.display())
    }
}

/// The files of a corpus, by name.
///
/// # Errors
/// Those of reading the folder.
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
/// Cases run in a thread of their own, so that one that hangs is reported; that thread is then left
/// behind. The largest memory is that of the whole process: one run at a time.
///
/// # Errors
/// The first case that panics, breaks a promise, takes too long or too much memory.
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
            // Every second one has a sound structure.
            Input::Few(_) if case % 2 == 1 => mutation::renumbered(&inputs, &mut random),
            Input::Few(words) => mutation::mutated(&inputs, words, &mut random, FEW),
            Input::Bytes => mutation::bytes(&mut random),
        };
        one(case.to_string(), input)?;
    }
    Ok(summary)
}

/// Runs a case; returns its result, the memory and the time that it took, and its depth.
fn measured(target: &Target, input: &[u8]) -> (Result<(), String>, usize, Duration, usize) {
    depth::taken();
    MEMORY.reset_peak_usage();
    let (before, begin) = (MEMORY.current_usage(), Instant::now());
    let result = catch_unwind(AssertUnwindSafe(|| (target.run)(input)))
        .unwrap_or_else(|_| Err(format!("it panics: {}", last_panic())));
    (result, MEMORY.peak_usage().saturating_sub(before), begin.elapsed(), depth::taken())
}

/// Writes an input where it can be found again.
fn kept(target: &Target, input: &[u8]) -> PathBuf {
    // FNV-1a, which makes the same name of the same input.
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
