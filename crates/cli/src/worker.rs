//! The program as a process that works for `mechid fleet`.

use std::ffi::{OsStr, OsString};
use std::io;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::OnceLock;

use mechid::analysis::fleet::serve;

/// Word after the name of the program that makes it work for a fleet. It is none of the subcommands: nobody calls
/// it but the program itself.
const WORD: &str = "fleet-worker";

/// The program, and the arguments, that work for a fleet.
static PROGRAM: OnceLock<(PathBuf, Vec<OsString>)> = OnceLock::new();

/// Says by which program, with which arguments before the word `fleet-worker`, `mechid fleet` works on its
/// records: one that calls [`run`](crate::run) with its arguments. Without, it works in its own process, which a record can
/// end.
pub fn set_worker_program(program: impl Into<PathBuf>, arguments: &[&str]) {
    let words = arguments.iter().copied().chain([WORD]).map(OsString::from);
    let _ = PROGRAM.set((program.into(), words.collect()));
}

/// Returns the program that works for a fleet, and its arguments.
pub fn worker_program() -> Option<&'static (PathBuf, Vec<OsString>)> {
    PROGRAM.get()
}

/// Works for a fleet, if the arguments say so.
pub fn work(arguments: &[OsString]) -> Option<ExitCode> {
    let [_, word] = arguments else { return None };
    (word == OsStr::new(WORD)).then(|| match serve(io::stdin(), io::stdout()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(_) => ExitCode::from(crate::FAILURE),
    })
}
