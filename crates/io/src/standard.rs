//! `-`: standard input where a file is read, standard output where one is written, as everywhere in
//! a shell. A file of that name is `./-`.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;
use std::sync::OnceLock;

use crate::escaped;

/// What stands for either.
const DASH: &str = "-";

/// Other names that systems have for standard output. Opened as files they would not do: where
/// standard output was redirected to a file, a new file would take its place, or its beginning be
/// written over.
const OUTPUT: [&str; 3] = ["/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"];

/// Whether what is read from `path` comes from standard input by its common name `-`.
pub(crate) fn is_input(path: &Path) -> bool {
    path == Path::new(DASH)
}

/// Whether what is written to `path` goes to standard output: it is `-`, or `/dev/stdout` and its
/// like.
///
/// ```
/// use std::path::Path;
///
/// use mechid_io::is_standard_output;
///
/// assert!(is_standard_output(Path::new("-")) && is_standard_output(Path::new("/dev/stdout")));
/// assert!(!is_standard_output(Path::new("./-")));
/// ```
pub fn is_standard_output(path: &Path) -> bool {
    path == Path::new(DASH) || OUTPUT.iter().any(|name| path == Path::new(name))
}

/// Name of a file that is written, for messages: its path, [`escaped`], or `standard output`.
pub fn output_name(path: &Path) -> String {
    if is_standard_output(path) { "standard output".into() } else { shown(path) }
}

/// Name of a file that is read, for messages: its path, [`escaped`], or `standard input`.
pub fn input_name(path: &Path) -> String {
    if is_input(path) { "standard input".into() } else { shown(path) }
}

fn shown(path: &Path) -> String {
    escaped(&path.display().to_string()).into_owned()
}

/// Opens a file to be read once.
pub(crate) fn open(path: &Path) -> io::Result<Box<dyn Read + Send>> {
    if is_input(path) { Ok(Box::new(io::stdin())) } else { Ok(Box::new(File::open(path)?)) }
}

/// The text of a description. That of standard input is kept, for it cannot be read twice: a machine
/// and the covariance of its parameters stand in one.
pub(crate) fn read_text(path: &Path) -> io::Result<String> {
    static KEPT: OnceLock<String> = OnceLock::new();
    if !is_input(path) {
        return std::fs::read_to_string(path);
    }
    match KEPT.get() {
        Some(text) => Ok(text.clone()),
        None => io::read_to_string(io::stdin()).map(|text| KEPT.get_or_init(|| text).clone()),
    }
}
