//! Files that appear complete or not at all.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use crate::IoError;

/// A file to be written: where, and what.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OutputFile {
    /// Where.
    pub path: PathBuf,
    /// What.
    pub content: Vec<u8>,
}

/// Writes all files, or none: each is written beside its destination first, and they take their
/// names only once all are complete.
///
/// A destination that is no regular file (a pipe, `/dev/null`) is written into.
///
/// # Errors
/// [`IoError::Write`] naming the file; whatever stood at the destinations still stands there.
pub fn write_all(files: &[OutputFile]) -> Result<(), IoError> {
    let mut staged: Vec<Staged> = Vec::new();
    for file in files {
        staged.push(Staged::write(file).map_err(|e| failed(&file.path, e))?);
    }
    for (file, staged) in files.iter().zip(staged) {
        staged.commit(&file.content).map_err(|e| failed(&file.path, e))?;
    }
    Ok(())
}

fn failed(path: &Path, source: io::Error) -> IoError {
    IoError::Write { file: path.display().to_string(), source }
}

/// A complete file that does not bear its name yet; removed again unless committed.
struct Staged {
    /// `None` for a destination that is written into.
    temporary: Option<PathBuf>,
    destination: PathBuf,
}

impl Staged {
    fn write(file: &OutputFile) -> io::Result<Self> {
        // Through a symbolic link, so that the link stays one.
        let destination = fs::canonicalize(&file.path).unwrap_or_else(|_| file.path.clone());
        match fs::metadata(&destination) {
            Ok(found) if found.is_dir() => return Err(io::ErrorKind::IsADirectory.into()),
            Ok(found) if !found.is_file() => return Ok(Self { temporary: None, destination }),
            _ => {}
        }
        let name = destination.file_name().ok_or(io::ErrorKind::InvalidInput)?;
        let mut temporary_name = std::ffi::OsString::from(".");
        temporary_name.push(name);
        temporary_name.push(format!(".{}.tmp", std::process::id()));
        let temporary = destination.with_file_name(temporary_name);
        let mut stream = OpenOptions::new().write(true).create_new(true).open(&temporary)?;
        let staged = Self { temporary: Some(temporary), destination };
        stream.write_all(&file.content)?;
        stream.sync_all()?;
        Ok(staged)
    }

    fn commit(mut self, content: &[u8]) -> io::Result<()> {
        match self.temporary.take() {
            None => File::options().write(true).open(&self.destination)?.write_all(content),
            Some(temporary) => fs::rename(&temporary, &self.destination).inspect_err(|_| {
                let _ = fs::remove_file(&temporary);
            }),
        }
    }
}

impl Drop for Staged {
    fn drop(&mut self) {
        if let Some(temporary) = &self.temporary {
            let _ = fs::remove_file(temporary);
        }
    }
}
