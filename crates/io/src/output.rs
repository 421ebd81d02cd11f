//! Files that appear complete or not at all.

use std::collections::BTreeSet;
use std::fs::{self, File, OpenOptions, Permissions};
use std::io::{self, BufWriter, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::IoError;
use crate::standard::{input_name, is_input, is_standard_output, output_name};

/// A file to be written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OutputFile {
    /// Destination.
    pub path: PathBuf,
    /// Content.
    pub content: Vec<u8>,
}

/// A file that is written piece by piece beside its destination, and takes its name in
/// [`write_all`]; dropped before that, it is removed again.
///
/// On Linux the file has no name until then, so that nothing is left of it however the program
/// ends. Elsewhere, and on file systems without such files, it has a hidden name beside the
/// destination; [`remove_unfinished_files`] removes it when a signal ends the program, and what a killed
/// program leaves of it is removed when the same destination is next written to.
///
/// A file that is replaced keeps its permissions; one without permission to write is not replaced.
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

/// Place of the content until it is complete.
#[derive(Debug)]
enum Stage {
    /// File without a name, on the file system of the destination.
    #[cfg(target_os = "linux")]
    Unnamed { destination: PathBuf },
    /// File under another name beside the destination.
    Beside { temporary: Temporary, destination: PathBuf },
    /// Temporary file elsewhere: the destination is no regular file and is written into.
    Elsewhere { destination: PathBuf },
    /// Temporary file elsewhere: it goes to standard output.
    StandardOutput,
}

/// A file that is removed when it is no longer used, unless it was renamed.
#[derive(Debug)]
struct Temporary(PathBuf);

/// Paths of all [`Temporary`] files of this process.
static TEMPORARIES: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// Writes all files, or none: each is written beside its destination first, and they take their
/// names only once all are complete, those that were begun before first.
///
/// A destination that is no regular file (a pipe, `/dev/null`) is written into; so is standard
/// output, called `-` or by a name of the system such as `/dev/stdout`, whatever it is redirected to. It comes
/// last: a reader that has closed it takes no other file away.
///
/// # Errors
/// [`IoError::Write`] naming the file, also for two files with one destination; whatever stood at
/// the destinations still stands there, unless standard output alone was closed.
pub fn write_all(begun: Vec<BegunFile>, files: &[OutputFile]) -> Result<(), IoError> {
    let mut all = begun;
    for file in files {
        let mut staged = BegunFile::begin(&file.path)?;
        staged.append(&file.content)?;
        all.push(staged);
    }
    let mut destinations = BTreeSet::new();
    for file in &mut all {
        let is_new =
            file.stage.destination().is_none_or(|path| destinations.insert(path.to_owned()));
        if !is_new {
            let twice = io::Error::new(io::ErrorKind::AlreadyExists, "two files would go there");
            return Err(failed(&file.path, twice));
        }
        file.complete()?;
    }
    let (last, first): (Vec<_>, Vec<_>) =
        all.into_iter().partition(BegunFile::is_for_standard_output);
    first.into_iter().chain(last).try_for_each(BegunFile::commit)
}

/// Refuses outputs that would replace an input: the same file by whatever path or link, standard
/// input redirected from it included. Pipes and devices may be both.
///
/// # Errors
/// [`IoError::OutputIsInput`].
pub fn refuse_replaced_inputs(
    inputs: &[impl AsRef<Path>],
    outputs: &[impl AsRef<Path>],
) -> Result<(), IoError> {
    for output in outputs.iter().map(AsRef::as_ref) {
        let Some(replaced) = replaced_file(output) else { continue };
        for input in inputs.iter().map(AsRef::as_ref) {
            let handle = match is_input(input) {
                true => same_file::Handle::stdin(),
                false => same_file::Handle::from_path(input),
            };
            if handle.is_ok_and(|input| input == replaced) {
                return Err(IoError::OutputIsInput {
                    output: output_name(output),
                    input: input_name(input),
                });
            }
        }
    }
    Ok(())
}

/// The regular file that an output would replace.
fn replaced_file(output: &Path) -> Option<same_file::Handle> {
    if is_standard_output(output) || !fs::metadata(output).is_ok_and(|metadata| metadata.is_file())
    {
        return None;
    }
    same_file::Handle::from_path(output).ok()
}

impl BegunFile {
    /// Begins a file that is to stand at `path`.
    ///
    /// # Errors
    /// [`IoError::Write`], also for a file that must not be written to.
    pub fn begin(path: impl AsRef<Path>) -> Result<Self, IoError> {
        let path = path.as_ref().to_owned();
        match Self::open(&path) {
            Ok((file, stage)) => Ok(Self { path, stream: BufWriter::new(file), stage }),
            Err(source) => Err(failed(&path, source)),
        }
    }

    /// Returns whether it goes to standard output.
    pub fn is_for_standard_output(&self) -> bool {
        matches!(self.stage, Stage::StandardOutput)
    }

    fn open(path: &Path) -> io::Result<(File, Stage)> {
        if is_standard_output(path) {
            return Ok((tempfile::tempfile()?, Stage::StandardOutput));
        }
        // Through a symbolic link, so that the link stays one.
        let destination = resolved(path)?;
        let permissions = match fs::metadata(&destination) {
            Ok(metadata) if metadata.is_dir() => return Err(io::ErrorKind::IsADirectory.into()),
            Ok(metadata) if !metadata.is_file() => {
                return Ok((tempfile::tempfile()?, Stage::Elsewhere { destination }));
            }
            Ok(metadata) => {
                // Renaming would not ask for this permission.
                if metadata.permissions().readonly() {
                    let why = "the file that stands there is read-only";
                    return Err(io::Error::new(io::ErrorKind::PermissionDenied, why));
                }
                OpenOptions::new().write(true).open(&destination)?;
                Some(metadata.permissions())
            }
            Err(_) => None,
        };
        let (file, stage) = stage(destination)?;
        if let Some(permissions) = permissions {
            keep(&file, permissions)?;
        }
        Ok((file, stage))
    }

    /// Writes more of it.
    ///
    /// # Errors
    /// [`IoError::Write`].
    pub fn append(&mut self, content: impl AsRef<[u8]>) -> Result<(), IoError> {
        self.stream.write_all(content.as_ref()).map_err(|source| failed(&self.path, source))
    }

    /// Brings all of it to the disk.
    fn complete(&mut self) -> Result<(), IoError> {
        let written = self.stream.flush().and_then(|()| self.stream.get_ref().sync_all());
        written.map_err(|source| failed(&self.path, source))
    }

    fn commit(self) -> Result<(), IoError> {
        let Self { path, stream, stage } = self;
        let done = match stage {
            #[cfg(target_os = "linux")]
            Stage::Unnamed { destination } => unnamed::link(stream.get_ref(), &destination),
            // It stays open, and so locked, until it has its name.
            Stage::Beside { temporary, destination } => fs::rename(&temporary.0, destination),
            Stage::Elsewhere { destination } => {
                let into = File::options().write(true).open(destination);
                into.and_then(|into| copied(stream.get_ref(), into))
            }
            Stage::StandardOutput => copied(stream.get_ref(), io::stdout().lock()),
        };
        done.map_err(|source| failed(&path, source))
    }
}

impl Stage {
    /// The name it will take; `None` for what is written into.
    fn destination(&self) -> Option<&Path> {
        match self {
            #[cfg(target_os = "linux")]
            Self::Unnamed { destination } => Some(destination),
            Self::Beside { destination, .. } => Some(destination),
            Self::Elsewhere { .. } | Self::StandardOutput => None,
        }
    }
}

/// Number of links to links that are followed, as the system does.
const MOST_LINKS: usize = 40;

/// A path without symbolic links, whether a file stands there or not; links in a ring are an error.
fn resolved(path: &Path) -> io::Result<PathBuf> {
    let mut path = path.to_owned();
    for _ in 0..MOST_LINKS {
        if let Ok(resolved) = fs::canonicalize(&path) {
            return Ok(resolved);
        }
        let folder = match path.parent() {
            Some(folder) if folder != Path::new("") => folder.to_owned(),
            _ => PathBuf::from("."),
        };
        // A link to a file that is not there yet; that to a pipe has no path, and is opened as it is.
        if fs::metadata(&path).is_err()
            && let Ok(target) = fs::read_link(&path)
        {
            path = folder.join(target);
            continue;
        }
        return Ok(match (fs::canonicalize(folder), path.file_name()) {
            (Ok(folder), Some(name)) => folder.join(name),
            _ => path,
        });
    }
    Err(io::Error::other("it is a symbolic link in a ring of links"))
}

/// Creates the file that is to become `destination`.
fn stage(destination: PathBuf) -> io::Result<(File, Stage)> {
    beside::remove_abandoned(&destination);
    #[cfg(target_os = "linux")]
    if let Some(file) = unnamed::create(&destination) {
        return Ok((file, Stage::Unnamed { destination }));
    }
    let (file, temporary) = beside::create(&destination)?;
    Ok((file, Stage::Beside { temporary, destination }))
}

/// Gives a new file the permissions of the one that it replaces. That it belongs to somebody else, or
/// that the file system knows none, is no reason not to write it.
fn keep(file: &File, permissions: Permissions) -> io::Result<()> {
    match file.set_permissions(permissions) {
        Err(e) if e.kind() == io::ErrorKind::Unsupported => Ok(()),
        other => other,
    }
}

/// Temporary files with a hidden name beside their destination.
mod beside {
    use super::{File, OpenOptions, Path, PathBuf, Temporary, fs, io};

    /// Number of bytes of the name of a destination in that of its temporary file: with what stands
    /// around it no more than the 255 that file systems allow.
    const NAME_BYTES: usize = 200;

    /// Number of names tried.
    const ATTEMPTS: u32 = 100;

    const ENDING: &str = ".tmp";

    /// Beginning of the names of all temporary files of a destination.
    fn beginning(destination: &Path) -> io::Result<String> {
        let name = destination.file_name().ok_or(io::ErrorKind::InvalidInput)?;
        let name = name.to_string_lossy();
        let end = (0..=NAME_BYTES.min(name.len())).rev().find(|end| name.is_char_boundary(*end));
        Ok(format!(".{}.", &name[..end.unwrap_or(0)]))
    }

    /// Makes a file under the first name that is free.
    pub fn named<T>(
        destination: &Path,
        make: impl Fn(&Path) -> io::Result<T>,
    ) -> io::Result<(T, PathBuf)> {
        let beginning = beginning(destination)?;
        for attempt in 0..ATTEMPTS {
            let name = format!("{beginning}{}-{attempt}{ENDING}", std::process::id());
            let path = destination.with_file_name(name);
            match make(&path) {
                Err(e) if e.kind() == io::ErrorKind::AlreadyExists => {}
                made => return made.map(|made| (made, path)),
            }
        }
        Err(io::ErrorKind::AlreadyExists.into())
    }

    /// Creates a temporary file, and locks it as long as it is open.
    pub fn create(destination: &Path) -> io::Result<(File, Temporary)> {
        let open = |path: &Path| OpenOptions::new().write(true).create_new(true).open(path);
        let (file, path) = named(destination, open)?;
        // Where files cannot be locked, abandoned ones stay.
        let _ = file.try_lock();
        Ok((file, Temporary::new(path)))
    }

    /// Removes temporary files of a destination that no running program has locked.
    pub fn remove_abandoned(destination: &Path) {
        let Ok(beginning) = beginning(destination) else { return };
        let Some(entries) = destination.parent().and_then(|folder| fs::read_dir(folder).ok())
        else {
            return;
        };
        let is_temporary = |name: &str| {
            let middle = name.strip_prefix(&beginning).and_then(|n| n.strip_suffix(ENDING));
            let digits = |n: &str| !n.is_empty() && n.bytes().all(|b| b.is_ascii_digit());
            middle.and_then(|m| m.split_once('-')).is_some_and(|(a, b)| digits(a) && digits(b))
        };
        for entry in entries.flatten() {
            let is_ours = entry.file_name().to_str().is_some_and(is_temporary);
            if !is_ours || !entry.file_type().is_ok_and(|kind| kind.is_file()) {
                continue;
            }
            // It stays locked until it is gone.
            let file = File::open(entry.path());
            if file.as_ref().is_ok_and(|file| file.try_lock().is_ok()) {
                let _ = fs::remove_file(entry.path());
            }
        }
    }
}

/// Temporary files without a name.
#[cfg(target_os = "linux")]
mod unnamed {
    use std::os::fd::AsRawFd as _;

    use rustix::fs::{AtFlags, CWD, Mode, OFlags};

    use super::{File, Path, beside, fs, io};

    /// Creates a file without a name in the folder of the destination; `None` where the file system
    /// has none, or the folder of open files by which it gets its name is missing.
    pub fn create(destination: &Path) -> Option<File> {
        let flags = OFlags::TMPFILE | OFlags::WRONLY | OFlags::CLOEXEC;
        let mode = Mode::from_raw_mode(0o666);
        let file = File::from(rustix::fs::open(destination.parent()?, flags, mode).ok()?);
        fs::symlink_metadata(link_to(&file)).ok()?;
        Some(file)
    }

    fn link_to(file: &File) -> String {
        format!("/proc/self/fd/{}", file.as_raw_fd())
    }

    /// Gives a file its name, which replaces the file that had it.
    pub fn link(file: &File, destination: &Path) -> io::Result<()> {
        let link = |path: &Path| {
            rustix::fs::linkat(CWD, link_to(file), CWD, path, AtFlags::SYMLINK_FOLLOW)
        };
        match link(destination) {
            Err(rustix::io::Errno::EXIST) => {}
            other => return Ok(other?),
        }
        // Only renaming replaces; for that moment it needs another name, and is not abandoned.
        let _ = file.try_lock();
        let ((), path) = beside::named(destination, |path| Ok(link(path)?))?;
        fs::rename(&path, destination).inspect_err(|_| drop(fs::remove_file(&path)))
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

impl Temporary {
    fn new(path: PathBuf) -> Self {
        temporaries().insert(path.clone());
        Self(path)
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.0);
        temporaries().remove(&self.0);
    }
}

fn temporaries() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    // A set of paths is whole whenever a thread panics.
    TEMPORARIES.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes the temporary files of every [`BegunFile`] of this process that is not complete.
///
/// A program calls it when a signal ends it: then nothing is dropped. The files cannot be completed
/// afterwards.
pub fn remove_unfinished_files() {
    for path in &*temporaries() {
        let _ = fs::remove_file(path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_named_file_that_is_not_complete_can_be_removed() {
        let folder = tempfile::tempdir().unwrap();
        let destination = folder.path().join("a.csv");
        let (_file, temporary) = beside::create(&destination).unwrap();
        assert!(temporary.0.exists());
        remove_unfinished_files();
        assert!(!temporary.0.exists());
        let path = temporary.0.clone();
        assert!(temporaries().contains(&path));
        drop(temporary);
        assert!(!temporaries().contains(&path));
    }
}
