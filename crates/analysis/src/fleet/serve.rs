//! Worker process of a fleet.

use std::ffi::OsString;
use std::io::{self, Read, Write};
use std::ops::Range;
use std::path::PathBuf;
use std::sync::mpsc::channel;
use std::{process, thread};

use mechid_io::RecordRows;
use rayon::ThreadPoolBuilder;
use serde::{Deserialize, Serialize};

use super::frames;
use super::results_as_parquet;
use super::rows::rows_of;
use crate::SavedAnalysis;

/// Message of a process that is ready: a later crash is due to a record.
pub(super) const READY: &[u8] = b"";

/// First message: the analysis of the records that follow.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Task {
    pub analysis: SavedAnalysis,
    /// Maximum memory of the process, in bytes.
    pub memory_bytes: Option<u64>,
}

/// Message after the first one: it requests the rows of some records of a file or, if no records
/// are given, of the whole file.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Order {
    /// Name of the file, in the encoding of the system.
    path: Vec<u8>,
    records: Vec<(String, Range<usize>)>,
}

impl Order {
    pub fn new(path: &std::path::Path, records: &[RecordRows]) -> Self {
        let records = records.iter().map(|record| (record.id.clone(), record.rows.clone()));
        Self { path: path.as_os_str().as_encoded_bytes().to_vec(), records: records.collect() }
    }

    fn path(&self) -> PathBuf {
        #[cfg(unix)]
        let name = {
            use std::os::unix::ffi::OsStringExt as _;

            OsString::from_vec(self.path.clone())
        };
        #[cfg(not(unix))]
        let name = OsString::from(String::from_utf8_lossy(&self.path).into_owned());
        name.into()
    }

    fn records(&self) -> Vec<RecordRows> {
        let record = |(id, rows): &(String, Range<usize>)| {
            let (id, rows) = (id.clone(), rows.clone());
            RecordRows { id, rows }
        };
        self.records.iter().map(record).collect()
    }
}

/// Works for a fleet in another process, which sends records through `input` and receives their
/// rows through `output`. At the end of the input this process exits immediately, because the fleet
/// has ended.
///
/// # Errors
/// Errors of the streams, and of invalid messages.
pub fn serve(
    mut input: impl Read + Send + 'static,
    mut output: impl Write + Send,
) -> io::Result<()> {
    let Some(first) = frames::read(&mut input)? else { return Ok(()) };
    let Task { analysis, memory_bytes } = serde_json::from_slice(&first)?;
    limit_memory(memory_bytes)?;
    let (orders, received) = channel();
    thread::spawn(move || {
        while let Ok(Some(message)) = frames::read(&mut input) {
            if orders.send(message).is_err() {
                return;
            }
        }
        process::exit(0);
    });
    let pool = ThreadPoolBuilder::new().num_threads(1).build().map_err(io::Error::other)?;
    frames::write(&mut output, READY)?;
    pool.install(|| {
        for message in received {
            let order: Order = serde_json::from_slice(&message)?;
            rows_of(&order.path(), &order.records(), &analysis, &mut |row| {
                let row = results_as_parquet(&[row]).map_err(io::Error::other)?;
                frames::write(&mut output, &row)
            })?;
        }
        Ok(())
    })
}

/// Limits the writable memory of this process; code and reserved addresses do not count. An
/// allocation above the limit ends the process.
fn limit_memory(bytes: Option<u64>) -> io::Result<()> {
    #[cfg(target_os = "linux")]
    if let Some(bytes) = bytes {
        use rustix::process::{Resource, Rlimit, setrlimit};

        setrlimit(Resource::Data, Rlimit { current: Some(bytes), maximum: Some(bytes) })?;
    }
    #[cfg(not(target_os = "linux"))]
    let _ = bytes;
    Ok(())
}
