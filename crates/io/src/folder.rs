//! Folders of records and of results: which files are there, and how they were last changed.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use crate::IoError;
use crate::standard::{input_name, output_name};

/// Size and modification time of a file, which identify a version of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FileStamp {
    /// Number of bytes.
    pub bytes: u64,
    /// Time of the last modification, in ns since the beginning of 1970; 0 if the system does not
    /// know it.
    pub modified_ns: u128,
}

impl FileStamp {
    /// Reads size and time of a file; `None` if the file does not exist or access is denied.
    pub fn read(path: impl AsRef<Path>) -> Option<Self> {
        let metadata = fs::metadata(path).ok()?;
        let since = metadata.modified().ok().and_then(|time| time.duration_since(UNIX_EPOCH).ok());
        Some(Self {
            bytes: metadata.len(),
            modified_ns: since.map_or(0, |duration| duration.as_nanos()),
        })
    }
}

/// Returns the kind of a path that cannot be a record: `a named pipe`, `a socket`, `a device`. A
/// program that opens such a path waits until another process writes into it, possibly forever.
pub fn special_kind(path: impl AsRef<Path>) -> Option<&'static str> {
    let kind = fs::metadata(path).ok()?.file_type();
    if kind.is_file() || kind.is_dir() {
        return None;
    }
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt as _;

        if kind.is_fifo() {
            return Some("a named pipe");
        }
        if kind.is_socket() {
            return Some("a socket");
        }
    }
    Some("a device")
}

/// Creates a folder and its parents unless it exists.
///
/// # Errors
/// [`IoError::Write`].
pub fn create_folder(path: impl AsRef<Path>) -> Result<(), IoError> {
    let path = path.as_ref();
    fs::create_dir_all(path).map_err(|source| IoError::Write { file: output_name(path), source })
}

/// Returns the files of a folder, sorted by name, without hidden files and subfolders; if the path
/// is not a folder, returns the path itself.
///
/// # Errors
/// [`IoError::Read`] for a folder that cannot be read.
pub fn files_of(path: impl AsRef<Path>) -> Result<Vec<PathBuf>, IoError> {
    let path = path.as_ref();
    if !path.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let listed = || -> io::Result<Vec<PathBuf>> {
        let mut files = Vec::new();
        for entry in fs::read_dir(path)? {
            let entry = entry?;
            let hidden = entry.file_name().as_encoded_bytes().starts_with(b".");
            if !hidden && !entry.path().is_dir() {
                files.push(entry.path());
            }
        }
        files.sort();
        Ok(files)
    };
    listed().map_err(|source| IoError::Read { file: input_name(path), source })
}
