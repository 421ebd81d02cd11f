//! Output files that are written completely or not at all.

use std::collections::BTreeSet;
use std::fs::{self, File, OpenOptions, Permissions};
use std::io::{self, BufWriter, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::IoError;
use crate::standard::{input_name, is_input, is_standard_output, output_name};

/// A complete file to be written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OutputFile {
    /// Destination.
    pub path: PathBuf,
    /// Content.
    pub content: Vec<u8>,
}

/// File that is written in parts under a temporary name in the folder of its destination, and gets
/// its name in [`write_all`]; if it is dropped before that, it is removed.
///
/// On Linux the file has no name until then, so that it disappears however the program ends. On
/// other systems, and on file systems without unnamed files, it has a hidden name in the folder of
/// the destination; [`remove_unfinished_files`] removes it when a signal ends the program. If the
/// program is killed, the file is removed when the same destination is next written to.
///
/// A file that is replaced keeps its permissions; a read-only file is not replaced.
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
    // Fields are dropped in this order: the file must be closed before it is removed.
    stream: BufWriter<File>,
    stage: Stage,
}

/// Storage of the content until it is complete.
#[derive(Debug)]
enum Stage {
    /// File without a name, on the file system of the destination.
    #[cfg(target_os = "linux")]
    Unnamed { destination: PathBuf },
    /// File with a temporary name in the folder of the destination.
    Beside { temporary: Temporary, destination: PathBuf },
    /// Temporary file in another folder: the destination is not a regular file and is written into.
    Elsewhere { destination: PathBuf },
    /// Temporary file in another folder: the content goes to standard output.
    StandardOutput,
}

/// File that is removed when it is dropped, unless it was renamed.
#[derive(Debug)]
struct Temporary(PathBuf);

/// Paths of all [`Temporary`] files of this process.
static TEMPORARIES: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// Writes all files, or none: each is written under a temporary name first, and the files get their
/// names only when all are complete, those of `begun` first.
///
/// A destination that is not a regular file (a pipe, `/dev/null`) is written into; so is standard
/// output, given as `-` or by a name of the system such as `/dev/stdout`, even if it is redirected
/// to a file. Standard output is written last, so that a reader that has closed it does not prevent
/// the other files.
///
/// # Errors
/// [`IoError::Write`] naming the file, also for two files with one destination; the files at the
/// destinations are then unchanged. If only standard output fails, because its reader has closed
/// it, all other files are already written.
pub fn write_all(begun: Vec<BegunFile>, files: &[OutputFile]) -> Result<(), IoError> {
    let mut staged_files = begun;
    for file in files {
        let mut staged = BegunFile::begin(&file.path)?;
        staged.append(&file.content)?;
        staged_files.push(staged);
    }
    let mut destinations = BTreeSet::new();
    for file in &mut staged_files {
        let is_new =
            file.stage.destination().is_none_or(|path| destinations.insert(path.to_owned()));
        if !is_new {
            let twice =
                io::Error::new(io::ErrorKind::AlreadyExists, "two files have this destination");
            return Err(failed(&file.path, twice));
        }
        file.complete()?;
    }
    let (last, first): (Vec<_>, Vec<_>) =
        staged_files.into_iter().partition(BegunFile::is_for_standard_output);
    first.into_iter().chain(last).try_for_each(BegunFile::commit)
}

/// Refuses outputs that would replace an input: the same file by any path or link, including
/// redirected standard input. Pipes and devices may be input and output at the same time.
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
            let handle = if is_input(input) {
                same_file::Handle::stdin()
            } else {
                same_file::Handle::from_path(input)
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

/// Returns the regular file that an output would replace.
fn replaced_file(output: &Path) -> Option<same_file::Handle> {
    if is_standard_output(output) || !fs::metadata(output).is_ok_and(|metadata| metadata.is_file())
    {
        return None;
    }
    same_file::Handle::from_path(output).ok()
}

impl BegunFile {
    /// Begins a file with destination `path`.
    ///
    /// # Errors
    /// [`IoError::Write`], also for a file without write permission.
    pub fn begin(path: impl AsRef<Path>) -> Result<Self, IoError> {
        let path = path.as_ref().to_owned();
        match Self::open(&path) {
            Ok((file, stage)) => Ok(Self { path, stream: BufWriter::new(file), stage }),
            Err(source) => Err(failed(&path, source)),
        }
    }

    /// Returns whether the content goes to standard output.
    pub fn is_for_standard_output(&self) -> bool {
        matches!(self.stage, Stage::StandardOutput)
    }

    fn open(path: &Path) -> io::Result<(File, Stage)> {
        if is_standard_output(path) {
            return Ok((tempfile::tempfile()?, Stage::StandardOutput));
        }
        // The target of a symbolic link is replaced, so that the link stays a link.
        let destination = resolved(path)?;
        let permissions = match fs::metadata(&destination) {
            Ok(metadata) if metadata.is_dir() => return Err(io::ErrorKind::IsADirectory.into()),
            Ok(metadata) if !metadata.is_file() => {
                return Ok((tempfile::tempfile()?, Stage::Elsewhere { destination }));
            }
            Ok(metadata) => {
                // Renaming does not need write permission on the replaced file, so this permission
                // is checked here.
                if metadata.permissions().readonly() {
                    let why = "the existing file is read-only";
                    return Err(io::Error::new(io::ErrorKind::PermissionDenied, why));
                }
                OpenOptions::new().write(true).open(&destination)?;
                Some(metadata.permissions())
            }
            Err(_) => None,
        };
        let (file, stage) = stage(destination)?;
        if let Some(permissions) = permissions {
            set_permissions(&file, permissions)?;
        }
        Ok((file, stage))
    }

    /// Appends content.
    ///
    /// # Errors
    /// [`IoError::Write`].
    pub fn append(&mut self, content: impl AsRef<[u8]>) -> Result<(), IoError> {
        self.stream.write_all(content.as_ref()).map_err(|source| failed(&self.path, source))
    }

    /// Writes all buffered content to the disk.
    fn complete(&mut self) -> Result<(), IoError> {
        let written = self.stream.flush().and_then(|()| self.stream.get_ref().sync_all());
        written.map_err(|source| failed(&self.path, source))
    }

    fn commit(self) -> Result<(), IoError> {
        let Self { path, stream, stage } = self;
        let done = match stage {
            #[cfg(target_os = "linux")]
            Stage::Unnamed { destination } => unnamed::link(stream.get_ref(), &destination),
            // The file stays open, and therefore locked, until it has its name.
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
    /// Returns the name that the file will get; `None` for a destination that is written into.
    fn destination(&self) -> Option<&Path> {
        match self {
            #[cfg(target_os = "linux")]
            Self::Unnamed { destination } => Some(destination),
            Self::Beside { destination, .. } => Some(destination),
            Self::Elsewhere { .. } | Self::StandardOutput => None,
        }
    }
}

/// Maximum number of symbolic links that are followed, as in the operating system.
const MOST_LINKS: usize = 40;

/// Resolves symbolic links in a path, which need not exist; a cycle of links is an error.
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
        // A link whose target does not exist yet is followed by its text. A link to an open pipe,
        // such as `/dev/fd/3`, is not followed: `metadata` finds the pipe, and the text of such a
        // link is not a path.
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
    Err(io::Error::other("this symbolic link leads back to itself"))
}

/// Creates the temporary file for `destination`.
fn stage(destination: PathBuf) -> io::Result<(File, Stage)> {
    beside::remove_abandoned(&destination);
    #[cfg(target_os = "linux")]
    if let Some(file) = unnamed::create(&destination) {
        return Ok((file, Stage::Unnamed { destination }));
    }
    let (file, temporary) = beside::create(&destination)?;
    Ok((file, Stage::Beside { temporary, destination }))
}

/// Gives a new file the permissions of the file that it replaces. A file system that does not
/// support permissions is not an error.
fn set_permissions(file: &File, permissions: Permissions) -> io::Result<()> {
    match file.set_permissions(permissions) {
        Err(e) if e.kind() == io::ErrorKind::Unsupported => Ok(()),
        other => other,
    }
}

/// Temporary files with a hidden name in the folder of their destination.
mod beside {
    use super::{File, OpenOptions, Path, PathBuf, Temporary, fs, io};

    /// Maximum length, in bytes, of the name of a destination within the name of its temporary
    /// file: with prefix and suffix it stays below the 255 bytes that file systems allow.
    const NAME_BYTES: usize = 200;

    /// Maximum number of names that are tried.
    const ATTEMPTS: u32 = 100;

    const ENDING: &str = ".tmp";

    /// Returns the prefix of the names of all temporary files of a destination.
    fn beginning(destination: &Path) -> io::Result<String> {
        let name = destination.file_name().ok_or(io::ErrorKind::InvalidInput)?;
        let name = name.to_string_lossy();
        let end = (0..=NAME_BYTES.min(name.len())).rev().find(|end| name.is_char_boundary(*end));
        Ok(format!(".{}.", &name[..end.unwrap_or(0)]))
    }

    /// Creates a file under the first free name.
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

    /// Creates a temporary file, locked as long as it is open.
    pub fn create(destination: &Path) -> io::Result<(File, Temporary)> {
        let open = |path: &Path| OpenOptions::new().write(true).create_new(true).open(path);
        let (file, path) = named(destination, open)?;
        // On systems without file locks, abandoned files are not removed.
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
            // The file stays locked until it is removed.
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

    /// Creates a file without a name in the folder of the destination; `None` if the file system
    /// has no such files, or if `/proc`, which is needed to name the file, is not available.
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

    /// Gives a file its name; a file that already has this name is replaced.
    pub fn link(file: &File, destination: &Path) -> io::Result<()> {
        let link = |path: &Path| {
            rustix::fs::linkat(CWD, link_to(file), CWD, path, AtFlags::SYMLINK_FOLLOW)
        };
        match link(destination) {
            Err(rustix::io::Errno::EXIST) => {}
            other => return Ok(other?),
        }
        // A link cannot replace a file, but a rename can. So the file is first linked to a
        // temporary name, and a lock marks this name as in use.
        let _ = file.try_lock();
        let ((), path) = beside::named(destination, |path| Ok(link(path)?))?;
        fs::rename(&path, destination).inspect_err(|_| drop(fs::remove_file(&path)))
    }
}

/// Copies the contents of a file into a stream.
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
    // A panic in another thread cannot leave the set of paths in a wrong state.
    TEMPORARIES.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes the temporary files of every [`BegunFile`] of this process that is not complete.
///
/// A program calls this function when a signal ends the program, because destructors do not run
/// then. The files cannot be completed afterwards.
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
