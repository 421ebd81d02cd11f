//! Tables of results of many records, computed in parts; a run can be interrupted and continued.
//!
//! | File | What it does |
//! |---|---|
//! | `part` | the unit of work: some records with one file of results |
//! | `rows` | the rows of records of a file |
//! | `worker`, `serve`, `frames` | rows computed in separate processes, which can crash |
//! | `table` | rows as columns of that file |
//! | `trends` | the parameters of all records over their order or a number in their names |
//! | `results` | the rows of all files, read back |
//! | `summary` | number of records, speed, and failures with their reasons |
//!
//! The folder of results is the whole state: a part is computed if its file is missing, and its
//! file is written completely or not at all. The rows of a part do not depend on the order of the
//! parts or on the process.

mod changes;
mod failures;
mod frames;
mod part;
mod results;
mod rows;
mod serve;
mod summary;
mod table;
mod trends;
mod worker;

use std::path::{Component, Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use mechid_io::{create_folder, escaped, files_of, path_text, special_kind};
use rayon::ThreadPoolBuilder;

pub use self::changes::{ChangeKind, SIGNIFICANT};
pub use self::failures::FailureCount;
pub use self::part::{FleetRecord, Part, PartDone};
pub use self::results::{Results, read_results};
pub use self::serve::serve;
pub use self::summary::FleetSummary;
pub use self::table::results_as_parquet;
pub use self::trends::{OUTLIER, TrendAxis, TrendChange, TrendPoint, TrendSeries, Trends};
pub use self::worker::{Isolation, RECORD_MEMORY_GB, RECORD_SECONDS, Worker};
use crate::{AnalysisError, SavedAnalysis};

/// Default number of records in a part.
pub const RECORDS_PER_PART: usize = 32;

/// Many records, an analysis, and the folder of their results.
///
/// ```
/// use mechid_analysis::fleet::Fleet;
/// use mechid_analysis::{Channels, ResponseQuantity, SavedAnalysis, Window};
///
/// let rig = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/machine.csv");
/// let analysis = SavedAnalysis {
///     channels: Channels::new("force", ResponseQuantity::Displacement, "displacement"),
///     window: Window { period: Some(256), ..Window::default() },
///     ..SavedAnalysis::default()
/// };
/// let folder = std::env::temp_dir().join(format!("mechid-fleet-{}", std::process::id()));
/// let fleet = Fleet::new(analysis, &[rig.into(), "lost.csv".into()], &folder, 32)?;
/// let summary = fleet.run(2, &|_| ())?;
/// assert_eq!((summary.records, summary.failed), (2, 1));
/// assert_eq!(summary.failures[0].code, "io.read");
/// // All parts exist, so no record is computed again.
/// assert_eq!(fleet.run(2, &|_| ())?.computed_records, 0);
/// # std::fs::remove_dir_all(folder).unwrap();
/// # Ok::<(), mechid_analysis::AnalysisError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Fleet {
    analysis: SavedAnalysis,
    folder: PathBuf,
    parts: Vec<Part>,
    left_out: Vec<String>,
}

impl Fleet {
    /// Divides records into parts of `records_per_part`, in the order of their paths. A folder is
    /// replaced by its files, and a file with a
    /// [`Reading::record_column`](crate::measurement::Reading::record_column) by its records, in
    /// the order of its rows; duplicates are removed. Named pipes, sockets and devices are ignored.
    ///
    /// # Errors
    /// [`AnalysisError::NoRecord`], the errors of [`SavedAnalysis::check`],
    /// [`AnalysisError::Setting`] for parts without records and for results in a folder of records,
    /// and [`AnalysisError::Io`] if a folder cannot be listed.
    pub fn new(
        analysis: SavedAnalysis,
        records: &[PathBuf],
        folder: impl AsRef<Path>,
        records_per_part: usize,
    ) -> Result<Self, AnalysisError> {
        analysis.check()?;
        if records_per_part == 0 {
            let why = "the results are written in parts, one part for a group of records; a part needs at least \
                       one record";
            return Err(AnalysisError::Setting { setting: "part_records", why: why.into() });
        }
        let folder = folder.as_ref();
        let mut files: Vec<PathBuf> = Vec::new();
        for record in records {
            refuse_results(record, folder)?;
            // Removes `./`, because a path names the same record with and without `./`.
            let is_named = |part: &Component<'_>| *part != Component::CurDir;
            let files_of = files_of(record)?.into_iter();
            files.extend(files_of.map(|file| file.components().filter(is_named).collect()));
        }
        files.sort();
        files.dedup();
        let mut left_out = Vec::new();
        files.retain(|file| match special_kind(file) {
            None => true,
            Some(kind) => {
                left_out.push(format!("{} ({kind})", escaped(&path_text(file))));
                false
            }
        });
        if files.is_empty() {
            return Err(AnalysisError::NoRecord);
        }
        let records: Vec<FleetRecord> =
            files.into_iter().flat_map(|file| FleetRecord::from_file(file, &analysis)).collect();
        let parts = records.chunks(records_per_part).map(|some| Part::new(some, &analysis));
        Ok(Self { folder: folder.to_owned(), parts: parts.collect(), analysis, left_out })
    }

    /// Returns the parts.
    pub fn parts(&self) -> &[Part] {
        &self.parts
    }

    /// Returns the number of records.
    pub fn record_count(&self) -> usize {
        self.parts.iter().map(|part| part.records().len()).sum()
    }

    /// Returns the paths that are not files, each with its kind.
    pub fn left_out(&self) -> &[String] {
        &self.left_out
    }

    /// Computes the missing parts in `workers` separate processes, so that a record that crashes
    /// its process does not end the run, and calls `done` after each part.
    ///
    /// # Errors
    /// As [`Fleet::run`] and [`Isolation::check`], and [`AnalysisError::RecordProcess`] if a
    /// process cannot be started.
    pub fn run_isolated(
        &self,
        workers: usize,
        isolation: &Isolation,
        done: &(dyn Fn(&PartDone) + Sync),
    ) -> Result<FleetSummary, AnalysisError> {
        isolation.check()?;
        self.run_by(workers, done, &|| {
            let mut worker = Worker::new(isolation.clone(), self.analysis.clone())?;
            Ok(Box::new(move |part: &Part| part.run_isolated(&mut worker, &self.folder)))
        })
    }

    /// Computes the missing parts in `workers` threads, one record per thread at a time, and calls
    /// `done` after each part.
    ///
    /// # Errors
    /// [`AnalysisError::Io`] if a part cannot be written, [`AnalysisError::Setting`] if the threads
    /// cannot be created. Written parts remain, and a later call continues from there.
    pub fn run(
        &self,
        workers: usize,
        done: &(dyn Fn(&PartDone) + Sync),
    ) -> Result<FleetSummary, AnalysisError> {
        self.run_by(workers, done, &|| {
            // The pool has one thread, so that parallel parts of an identification stay within its
            // worker.
            let pool = ThreadPoolBuilder::new().num_threads(1).build().map_err(|error| {
                AnalysisError::Setting { setting: "workers", why: error.to_string() }
            })?;
            Ok(Box::new(move |part: &Part| pool.install(|| part.run(&self.analysis, &self.folder))))
        })
    }

    /// Computes the missing parts in `workers` threads. Each thread calls `make` once, which
    /// returns the function that computes a part.
    fn run_by<'a>(
        &'a self,
        workers: usize,
        done: &(dyn Fn(&PartDone) + Sync),
        make: &(dyn Fn() -> Result<Box<Compute<'a>>, AnalysisError> + Sync),
    ) -> Result<FleetSummary, AnalysisError> {
        let begun = Instant::now();
        create_folder(&self.folder)?;
        let next = AtomicUsize::new(0);
        let results = Mutex::new(Vec::with_capacity(self.parts.len()));
        let failure = Mutex::new(None);
        let work = || -> Result<(), AnalysisError> {
            let mut compute = make()?;
            while let Some(part) = self.parts.get(next.fetch_add(1, Ordering::Relaxed)) {
                let result = compute(part)?;
                done(&result);
                results.lock().unwrap_or_else(PoisonError::into_inner).push(result);
            }
            Ok(())
        };
        let fail = |error: AnalysisError| {
            next.store(self.parts.len(), Ordering::Relaxed);
            *failure.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
        };
        let run = || work().unwrap_or_else(fail);
        std::thread::scope(|scope| {
            for _ in 0..workers.clamp(1, self.parts.len()) {
                if let Err(error) = std::thread::Builder::new().spawn_scoped(scope, run) {
                    fail(AnalysisError::Setting { setting: "workers", why: error.to_string() });
                }
            }
        });
        if let Some(error) = failure.into_inner().unwrap_or_else(PoisonError::into_inner) {
            return Err(error);
        }
        let results = results.into_inner().unwrap_or_else(PoisonError::into_inner);
        let elapsed_s = begun.elapsed().as_secs_f64();
        let summary = FleetSummary::from_parts(results, &self.folder, elapsed_s)?;
        Ok(FleetSummary { left_out: self.left_out.clone(), ..summary })
    }
}

/// Function that computes a part in a thread.
type Compute<'a> = dyn FnMut(&Part) -> Result<PartDone, AnalysisError> + 'a;

/// Refuses results in a folder of records, because a later run would read them as records.
fn refuse_results(record: &Path, results: &Path) -> Result<(), AnalysisError> {
    let Ok(results) = results.canonicalize() else { return Ok(()) };
    let Ok(record) = record.canonicalize() else { return Ok(()) };
    if record == results || record.parent() == Some(&results) {
        let why = format!(
            "{} is a folder of records, and the results must not be among the records: choose another folder",
            escaped(&path_text(&results))
        );
        return Err(AnalysisError::Setting { setting: "output", why });
    }
    Ok(())
}
