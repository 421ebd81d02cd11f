//! Tables of results of many records, part by part, that can be interrupted and continued.
//!
//! | File | What it does |
//! |---|---|
//! | `part` | the unit of work: some records, whose rows become one file |
//! | `table` | rows as columns of that file |
//! | `trends` | the parameters of all records over their order or a number in their names |
//! | `results` | the rows of all files, read back |
//! | `summary` | how many records, how fast, and which failed why |
//!
//! The folder of results is the whole state: a part is computed where its file is missing, and its
//! file appears complete or not at all. Whoever computes a part, in whatever order and process, writes
//! the same rows.

mod changes;
mod failures;
mod part;
mod results;
mod summary;
mod table;
mod trends;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use mechid_io::{create_folder, files_of};
use rayon::ThreadPoolBuilder;

pub use self::changes::{ChangeKind, SIGNIFICANT};
pub use self::failures::FailureCount;
pub use self::part::{FleetRecord, Part, PartDone};
pub use self::results::read_results;
pub use self::summary::FleetSummary;
pub use self::table::results_as_parquet;
pub use self::trends::{OUTLIER, TrendAxis, TrendChange, TrendPoint, TrendSeries, Trends};
use crate::{AnalysisError, SavedAnalysis};

/// Number of records in a part unless it is said.
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
/// // All is there: nothing is computed again.
/// assert_eq!(fleet.run(2, &|_| ())?.computed_records, 0);
/// # std::fs::remove_dir_all(folder).unwrap();
/// # Ok::<(), mechid_analysis::AnalysisError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Fleet {
    analysis: SavedAnalysis,
    folder: PathBuf,
    parts: Vec<Part>,
}

impl Fleet {
    /// Divides records into parts of `records_per_part`, by rising path. A folder stands for the files in
    /// it, and a file with a [`Reading::record_column`](crate::measurement::Reading::record_column) for
    /// the records in it, in the order of its rows; a record named twice is taken once.
    ///
    /// # Errors
    /// [`AnalysisError::NoRecord`], those of [`SavedAnalysis::check`], [`AnalysisError::Setting`] for parts
    /// without records, and [`AnalysisError::Io`] if a folder cannot be listed.
    pub fn new(
        analysis: SavedAnalysis,
        records: &[PathBuf],
        folder: impl AsRef<Path>,
        records_per_part: usize,
    ) -> Result<Self, AnalysisError> {
        analysis.check()?;
        if records_per_part == 0 {
            let why = "a part has one record at least".into();
            return Err(AnalysisError::Setting { setting: "part_records", why });
        }
        let mut files = Vec::new();
        for record in records {
            files.extend(files_of(record)?);
        }
        files.sort();
        files.dedup();
        if files.is_empty() {
            return Err(AnalysisError::NoRecord);
        }
        let records: Vec<FleetRecord> =
            files.into_iter().flat_map(|file| FleetRecord::of_file(file, &analysis)).collect();
        let parts = records.chunks(records_per_part).map(|some| Part::new(some, &analysis));
        Ok(Self { folder: folder.as_ref().to_owned(), parts: parts.collect(), analysis })
    }

    /// Returns the parts.
    pub fn parts(&self) -> &[Part] {
        &self.parts
    }

    /// Returns the number of records.
    pub fn record_count(&self) -> usize {
        self.parts.iter().map(|part| part.records().len()).sum()
    }

    /// Computes the parts that are missing, with `workers` threads of one record each at a time, and
    /// calls `done` after each part.
    ///
    /// # Errors
    /// [`AnalysisError::Io`] if a part cannot be written, [`AnalysisError::Setting`] if the system does
    /// not give the threads. What was written stays; a later call goes on from there.
    pub fn run(
        &self,
        workers: usize,
        done: &(dyn Fn(&PartDone) + Sync),
    ) -> Result<FleetSummary, AnalysisError> {
        let begun = Instant::now();
        create_folder(&self.folder)?;
        let next = AtomicUsize::new(0);
        let results = Mutex::new(Vec::with_capacity(self.parts.len()));
        let failure = Mutex::new(None);
        let work = || {
            while let Some(part) = self.parts.get(next.fetch_add(1, Ordering::Relaxed)) {
                match part.run(&self.analysis, &self.folder) {
                    Ok(result) => {
                        done(&result);
                        results.lock().unwrap_or_else(PoisonError::into_inner).push(result);
                    }
                    Err(error) => {
                        next.store(self.parts.len(), Ordering::Relaxed);
                        *failure.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                    }
                }
            }
        };
        // A pool of one thread each: an identification that divides its work does so within its worker.
        let pools = (0..workers.clamp(1, self.parts.len()))
            .map(|_| ThreadPoolBuilder::new().num_threads(1).build());
        let pools = pools.collect::<Result<Vec<_>, _>>().map_err(|error| {
            AnalysisError::Setting { setting: "workers", why: error.to_string() }
        })?;
        std::thread::scope(|scope| {
            for pool in &pools {
                scope.spawn(move || pool.install(work));
            }
        });
        match failure.into_inner().unwrap_or_else(PoisonError::into_inner) {
            Some(error) => Err(error),
            None => {
                let results = results.into_inner().unwrap_or_else(PoisonError::into_inner);
                FleetSummary::of(results, &self.folder, begun.elapsed().as_secs_f64())
            }
        }
    }
}
