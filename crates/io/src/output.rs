//! Files that appear complete or not at all.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write as _};
use std::path::{Path, PathBuf};

use crate::IoError;
use crate::standard::{is_standard_output, output_name};

/// A file to be written: where, and what.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OutputFile {
    /// Where.
    pub path: PathBuf,
    /// What.
    pub content: Vec<u8>,
}

/// A file that is written piece by piece beside its destination, and takes its name in
/// [`write_all`]; dropped before that, it is removed again.
///
/// ```
/// use mechid_io::{BegunFile, write_all};
///
/// let path = std::env::temp_dir().join("mechid-begun-file.txt");
/// let mut file = BegunFile::begin(&path)?;
/// file.append("one\n")?;
/// file.append("two\n")?;
/// assert!(!path.exists());
/// write_all(vec![file], &[])?;
/// assert_eq!(std::fs::read_to_string(&path).unwrap(), "one\ntwo\n");
/// # std::fs::remove_file(path).unwrap();
/// # Ok::<(), mechid_io::IoError>(())
/// ```
#[derive(Debug)]
pub struct BegunFile {
    path: PathBuf,
    // Fields are dropped in this order: closed, then removed.
    stream: BufWriter<File>,
    stage: Stage,
}

/// Where what is written stands until it is complete.
#[derive(Debug)]
enum Stage {
    /// Under another name beside the destination.
    Beside { temporary: Temporary, destination: PathBuf },
    /// Without a name: the destination is no regular file and is written into.
    Nameless { destination: PathBuf },
    /// Without a name: it goes to standard output.
    StandardOutput,
}

/// A file that is removed when it is no longer used; where it has been renamed, there is none.
#[derive(Debug)]
struct Temporary(PathBuf);

/// Writes all files, or none: each is written beside its destination first, and they take their
/// names only once all are complete, those that were begun before first.
///
/// A destination that is no regular file (a pipe, `/dev/null`) is written into; so is standard
/// output, called `-` or by a name of the system such as `/dev/stdout`, whatever it is redirected to.
/// There it is no error if the reader has seen enough and closed the pipe.
///
/// # Errors
/// [`IoError::Write`] naming the file; whatever stood at the destinations still stands there.
pub fn write_all(begun: Vec<BegunFile>, files: &[OutputFile]) -> Result<(), IoError> {
    let mut all = begun;
    for file in files {
        let mut staged = BegunFile::begin(&file.path)?;
        staged.append(&file.content)?;
        all.push(staged);
    }
    for file in &mut all {
        file.complete()?;
    }
    all.into_iter().try_for_each(BegunFile::commit)
}

impl BegunFile {
    /// Begins a file that is to stand at `path`.
    ///
    /// # Errors
    /// [`IoError::Write`], also if another file is being written for the same path.
    pub fn begin(path: impl AsRef<Path>) -> Result<Self, IoError> {
        let path = path.as_ref().to_owned();
        match Self::open(&path) {
            Ok((file, stage)) => Ok(Self { path, stream: BufWriter::new(file), stage }),
            Err(source) => Err(failed(&path, source)),
        }
    }

    /// Whether it goes to standard output.
    pub fn is_for_standard_output(&self) -> bool {
        matches!(self.stage, Stage::StandardOutput)
    }

    fn open(path: &Path) -> io::Result<(File, Stage)> {
        if is_standard_output(path) {
            return Ok((tempfile::tempfile()?, Stage::StandardOutput));
        }
        // Through a symbolic link, so that the link stays one.
        let destination = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        match fs::metadata(&destination) {
            Ok(found) if found.is_dir() => return Err(io::ErrorKind::IsADirectory.into()),
            Ok(found) if !found.is_file() => {
                return Ok((tempfile::tempfile()?, Stage::Nameless { destination }));
            }
            _ => {}
        }
        let name = destination.file_name().ok_or(io::ErrorKind::InvalidInput)?;
        let mut temporary_name = std::ffi::OsString::from(".");
        temporary_name.push(name);
        temporary_name.push(format!(".{}.tmp", std::process::id()));
        let temporary = destination.with_file_name(temporary_name);
        let file = OpenOptions::new().write(true).create_new(true).open(&temporary)?;
        Ok((file, Stage::Beside { temporary: Temporary(temporary), destination }))
    }

    /// Writes more of it.
    ///
    /// # Errors
    /// [`IoError::Write`].
    pub fn append(&mut self, content: impl AsRef<[u8]>) -> Result<(), IoError> {
        self.stream.write_all(content.as_ref()).map_err(|source| failed(&self.path, source))
    }

    /// Sees to it that all of it is on the disk.
    fn complete(&mut self) -> Result<(), IoError> {
        let written = self.stream.flush().and_then(|()| self.stream.get_ref().sync_all());
        written.map_err(|source| failed(&self.path, source))
    }

    fn commit(self) -> Result<(), IoError> {
        let Self { path, stream, stage } = self;
        let done = match stage {
            Stage::Beside { temporary, destination } => {
                drop(stream);
                fs::rename(&temporary.0, destination)
            }
            Stage::Nameless { destination } => {
                let into = File::options().write(true).open(destination);
                into.and_then(|into| copied(stream.get_ref(), into))
            }
            Stage::StandardOutput => match copied(stream.get_ref(), io::stdout().lock()) {
                Err(closed) if closed.kind() == io::ErrorKind::BrokenPipe => Ok(()),
                other => other,
            },
        };
        done.map_err(|source| failed(&path, source))
    }
}

/// Writes what a file holds into something else.
fn copied(mut from: &File, mut into: impl io::Write) -> io::Result<()> {
    io::Seek::rewind(&mut from)?;
    io::copy(&mut from, &mut into)?;
    into.flush()
}

fn failed(path: &Path, source: io::Error) -> IoError {
    IoError::Write { file: output_name(path), source }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.0);
    }
}
