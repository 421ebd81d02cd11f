//! `-` as the name of standard input and standard output. A file of that name is given as `./-`.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;
use std::sync::OnceLock;

use crate::{escaped, path_text};

/// Common name of standard input and standard output.
const DASH: &str = "-";

/// Other names of standard output. They are not opened as files: if standard output is redirected
/// to a file, opening would replace that file or overwrite its beginning.
const OUTPUT: [&str; 3] = ["/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"];

/// Returns whether `path` is the common name of standard input, `-`.
pub(crate) fn is_input(path: &Path) -> bool {
    path == Path::new(DASH)
}

/// Returns whether `path` is a name of standard output: `-`, `/dev/stdout` or the like.
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

/// Returns the name of an output for messages: its path, [`escaped`], or `standard output`.
pub fn output_name(path: &Path) -> String {
    if is_standard_output(path) { "standard output".into() } else { shown(path) }
}

/// Returns the name of an input for messages: its path, [`escaped`], or `standard input`.
pub fn input_name(path: &Path) -> String {
    if is_input(path) { "standard input".into() } else { shown(path) }
}

fn shown(path: &Path) -> String {
    escaped(&path_text(path)).into_owned()
}

/// Opens a file for a single pass.
pub(crate) fn open(path: &Path) -> io::Result<Box<dyn Read + Send>> {
    if is_input(path) { Ok(Box::new(io::stdin())) } else { Ok(Box::new(File::open(path)?)) }
}

/// Reads the text of a description. The text of standard input is cached, because it can be read
/// only once, while a system and the covariance of its parameters are read from the same text.
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
