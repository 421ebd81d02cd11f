//! Worker processes of a fleet: a record that exhausts memory, aborts or hangs ends only its own
//! process.

use std::ffi::OsString;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::slice::from_ref;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use mechid_io::{Limits, RecordRows, parse_parquet_rows, path_text};

use super::frames;
use super::results::Cells;
use super::serve::{Order, READY, Task};
use crate::{AnalysisError, ResultRow, SavedAnalysis};

/// Default limit of the memory for a record, in GB.
pub const RECORD_MEMORY_GB: f64 = 8.0;

/// Default limit of the time for a record, in s.
pub const RECORD_SECONDS: f64 = 600.0;

/// Maximum number of bytes kept from the error stream of a process.
const LONGEST_MESSAGE: u64 = 4096;

/// Maximum time for the start of a process. A failure during the start is not due to a record.
const START: Duration = Duration::from_secs(120);

/// Maximum time from the end of the output of a process to its exit.
const FAREWELL: Duration = Duration::from_secs(5);
/// Time between two checks whether a process has ended.
const POLL: Duration = Duration::from_millis(5);

/// Messages with which a process ends if an allocation fails, or the system has no memory for a
/// thread.
const OUT_OF_MEMORY: [&str; 2] = ["memory allocation of", "Cannot allocate memory"];

/// Isolation of records in separate processes: the program that identifies them, and the limits for
/// each record.
///
/// The program reads its orders from standard input and ends with [`serve`](super::serve).
#[derive(Debug, Clone, PartialEq)]
pub struct Isolation {
    /// The program.
    pub program: PathBuf,
    /// Arguments of the program.
    pub arguments: Vec<OsString>,
    /// Writable memory that a record and the program itself may take, in units of GB; only Linux
    /// enforces it.
    pub record_memory_gb: f64,
    /// Time that a record may take, in s.
    pub record_seconds: f64,
}

impl Isolation {
    /// Creates the isolation of records in processes of `program`, with the limits
    /// [`RECORD_MEMORY_GB`] and [`RECORD_SECONDS`].
    pub fn new(program: impl Into<PathBuf>, arguments: Vec<OsString>) -> Self {
        Self {
            program: program.into(),
            arguments,
            record_memory_gb: RECORD_MEMORY_GB,
            record_seconds: RECORD_SECONDS,
        }
    }

    /// Checks the limits.
    ///
    /// # Errors
    /// [`AnalysisError::Setting`] for a limit that is not positive and finite.
    pub fn check(&self) -> Result<(), AnalysisError> {
        let limits =
            [("record_memory_gb", self.record_memory_gb), ("record_seconds", self.record_seconds)];
        for (setting, limit) in limits {
            if !(limit > 0.0 && limit.is_finite()) {
                let why = format!("a positive, finite number is needed, got {limit}");
                return Err(AnalysisError::Setting { setting, why });
            }
        }
        Ok(())
    }

    /// Returns the memory that a record may take, in bytes: the smaller of the limit and the memory
    /// that the system allows this process (`ulimit -v`).
    fn memory_bytes(&self) -> u64 {
        // The conversion saturates: a number that is too large becomes the largest integer, which
        // exceeds any address space.
        let bytes = (self.record_memory_gb * 1e9) as u64;
        #[cfg(target_os = "linux")]
        let bytes = {
            use rustix::process::{Resource, getrlimit};

            let of_system = getrlimit(Resource::As);
            let limits = [of_system.current, of_system.maximum];
            limits.into_iter().flatten().fold(bytes, u64::min)
        };
        bytes
    }
}

/// Identifies records in a separate process, and starts a new process if a record has ended the old
/// one.
#[derive(Debug)]
pub struct Worker {
    isolation: Isolation,
    analysis: SavedAnalysis,
    running: Option<Running>,
}

/// A running worker process.
#[derive(Debug)]
struct Running {
    child: Child,
    orders: Option<ChildStdin>,
    rows: Receiver<Vec<u8>>,
    /// Text that the process wrote to its error stream.
    said: JoinHandle<String>,
}

impl Worker {
    /// Creates a worker; its process starts with the first record.
    ///
    /// # Errors
    /// Those of [`Isolation::check`].
    pub fn new(isolation: Isolation, analysis: SavedAnalysis) -> Result<Self, AnalysisError> {
        isolation.check()?;
        Ok(Self { isolation, analysis, running: None })
    }

    /// Returns the rows of some records of a file, in their order, or of the whole file if no
    /// records are given.
    ///
    /// If the process ends while it reads several records together, it is started again for each of
    /// these records: the row of a record is an error only if this record alone ends the process.
    ///
    /// # Errors
    /// [`AnalysisError::RecordProcess`] or [`AnalysisError::RecordMemory`] if no process can be
    /// started.
    pub(super) fn rows(
        &mut self,
        path: &Path,
        records: &[RecordRows],
    ) -> Result<Vec<ResultRow>, AnalysisError> {
        let mut rows = Vec::with_capacity(records.len().max(1));
        if records.len() > 1 {
            self.ask(path, records, &mut rows)?;
        }
        // If `records` is empty, the whole file is one record and has one row.
        for at in rows.len()..records.len().max(1) {
            let alone = records.get(at).map(from_ref).unwrap_or_default();
            if let Some(why) = self.ask(path, alone, &mut rows)? {
                let failed = || Err(why);
                let row = self.analysis.row(&path_text(path), failed);
                let record_id = alone.first().map(|record| record.id.clone());
                rows.push(ResultRow { record_id, ..row });
            }
        }
        Ok(rows)
    }

    /// Sends records to the process and receives their rows; returns the error if some rows are
    /// missing.
    fn ask(
        &mut self,
        path: &Path,
        records: &[RecordRows],
        rows: &mut Vec<ResultRow>,
    ) -> Result<Option<AnalysisError>, AnalysisError> {
        let order = serde_json::to_vec(&Order::new(path, records)).unwrap_or_default();
        let mut running = match self.running.take() {
            Some(running) => running,
            None => self.start()?,
        };
        let patience = Duration::try_from_secs_f64(self.isolation.record_seconds);
        let patience = patience.unwrap_or(Duration::MAX);
        // If the process has ended, this write fails. The error is returned further down, where the
        // code waits for the rows.
        if let Some(orders) = &mut running.orders {
            let _ = frames::write(orders, &order);
        }
        for _ in 0..records.len().max(1) {
            let received = running.rows.recv_timeout(patience);
            match received.map(row_of) {
                Ok(Some(row)) => rows.push(row),
                Err(RecvTimeoutError::Timeout) => {
                    drop(running.end());
                    let seconds = self.isolation.record_seconds;
                    return Ok(Some(AnalysisError::RecordTime { seconds }));
                }
                Ok(None) => {
                    drop(running.end());
                    let how = "the output of the process was not a row of results".into();
                    return Ok(Some(AnalysisError::RecordProcess { how }));
                }
                Err(RecvTimeoutError::Disconnected) => {
                    return Ok(Some(running.cause_of_end(self.isolation.memory_bytes())));
                }
            }
        }
        self.running = Some(running);
        Ok(None)
    }

    fn start(&self) -> Result<Running, AnalysisError> {
        let Isolation { program, arguments, .. } = &self.isolation;
        let failed = |error: io::Error| AnalysisError::RecordProcess {
            how: format!("{} cannot be started: {error}", path_text(program)),
        };
        let mut command = Command::new(program);
        command.args(arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        // A backtrace needs memory; a process that fails for lack of memory would wait for this
        // memory for ever.
        command.env("RUST_BACKTRACE", "0");
        #[cfg(unix)]
        {
            use std::os::unix::process::CommandExt as _;

            // The process gets its own process group, so that Ctrl-C ends only the fleet: if Ctrl-C
            // also ended this process, its record would appear as a failure.
            command.process_group(0);
        }
        let mut child = command.spawn().map_err(failed)?;
        let pipes = (child.stdin.take(), child.stdout.take(), child.stderr.take());
        let (Some(mut orders), Some(mut output), Some(errors)) = pipes else {
            return Err(failed(io::ErrorKind::BrokenPipe.into()));
        };
        let (sender, rows) = channel();
        let reader = thread::Builder::new().spawn(move || {
            while let Ok(Some(row)) = frames::read(&mut output) {
                if sender.send(row).is_err() {
                    return;
                }
            }
        });
        let listener = thread::Builder::new().spawn(move || {
            let (mut said, mut errors) = (Vec::new(), errors);
            let _ = errors.by_ref().take(LONGEST_MESSAGE).read_to_end(&mut said);
            // The rest of the error stream is read and discarded, because a full pipe would block
            // the process.
            let _ = io::copy(&mut errors, &mut io::sink());
            String::from_utf8_lossy(&said).into_owned()
        });
        let said = reader.and(listener).map_err(|error| {
            let _ = child.kill();
            let _ = child.wait();
            failed(error)
        })?;
        let memory_bytes = self.isolation.memory_bytes();
        let task = Task { analysis: self.analysis.clone(), memory_bytes: Some(memory_bytes) };
        let _ = frames::write(&mut orders, &serde_json::to_vec(&task).unwrap_or_default());
        let running = Running { child, orders: Some(orders), rows, said };
        match running.rows.recv_timeout(START) {
            Ok(ready) if ready == READY => Ok(running),
            _ => Err(running.cause_of_end(memory_bytes)),
        }
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        if let Some(running) = self.running.take() {
            drop(running.end());
        }
    }
}

impl Running {
    /// Ends the process; returns its exit status, and the text of its error stream.
    fn end(mut self) -> (io::Result<ExitStatus>, String) {
        let _ = self.child.kill();
        let status = self.child.wait();
        (status, self.said.join().unwrap_or_default())
    }

    /// Returns the reason for the end of a process that may use this memory, in bytes.
    fn cause_of_end(mut self, memory_bytes: u64) -> AnalysisError {
        // Closing the input ends the process.
        self.orders = None;
        let begun = Instant::now();
        while matches!(self.child.try_wait(), Ok(None)) && begun.elapsed() < FAREWELL {
            thread::sleep(POLL);
        }
        let (status, said) = self.end();
        if OUT_OF_MEMORY.iter().any(|message| said.contains(message)) {
            return AnalysisError::RecordMemory { gb: memory_bytes as f64 / 1e9 };
        }
        let status = status.map_or_else(|error| error.to_string(), |status| status.to_string());
        let said = said.lines().next_back().unwrap_or_default();
        let how = if said.is_empty() { status } else { format!("{status}: {said}") };
        AnalysisError::RecordProcess { how }
    }
}

/// Reads a row that a process has sent; `None` if the bytes are not a row.
fn row_of(bytes: Vec<u8>) -> Option<ResultRow> {
    let mut rows = parse_parquet_rows("a row", bytes, &Limits::DEFAULT).ok()?;
    Some(Cells::new(rows.pop()?).row())
}
