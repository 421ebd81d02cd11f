//! The program as a worker process of `mechid fleet`.

use std::ffi::{OsStr, OsString};
use std::io;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::OnceLock;

use mechid::analysis::fleet::serve;

/// First argument of a worker process. It is not a subcommand: only the program itself uses it.
const WORD: &str = "fleet-worker";

/// Program and arguments of a worker process.
static PROGRAM: OnceLock<(PathBuf, Vec<OsString>)> = OnceLock::new();

/// Sets the program that `mechid fleet` starts as worker processes, and the arguments that it gets
/// before the word `fleet-worker`. This program must call [`run`](crate::run) with its arguments.
/// If no program is set, the records are identified in the calling process, and a faulty record can
/// end that process.
pub fn set_worker_program(program: impl Into<PathBuf>, arguments: &[&str]) {
    let words = arguments.iter().copied().chain([WORD]).map(OsString::from);
    let _ = PROGRAM.set((program.into(), words.collect()));
}

/// Returns program and arguments of a worker process.
pub fn worker_program() -> Option<&'static (PathBuf, Vec<OsString>)> {
    PROGRAM.get()
}

/// Runs as a worker process if the arguments ask for one.
pub fn work(arguments: &[OsString]) -> Option<ExitCode> {
    let [_, word] = arguments else { return None };
    (word == OsStr::new(WORD)).then(|| match serve(io::stdin(), io::stdout()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(_) => ExitCode::from(crate::FAILURE),
    })
}
