//! Behaviour common to all subcommands: the records that they read, and their messages.

mod bearing;
mod care;
mod checks;
mod elements;
mod fleet;
mod forces;
mod hammer;
mod identification;
mod info;
mod large;
mod limits;
mod lines;
mod modal;
mod modes;
mod pictures;
mod public;
mod public_cases;
mod records;
mod reference;
mod silverbox;
mod streams;
mod stretches;
mod sweep;
mod talk;
mod time_limit;
mod unexplained;
mod units;

use std::path::Path;

use assert_cmd::Command;

/// Runs `mechid` in a folder, where it must succeed; returns its output.
pub fn mechid(folder: &Path, arguments: &str) -> String {
    let output = run(folder, arguments);
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments}: {message}");
    String::from_utf8(output.stdout).unwrap()
}

/// Runs `mechid` in a folder, where it must fail with exit code 2; returns its message.
pub fn refused(folder: &Path, arguments: &str) -> String {
    let output = run(folder, arguments);
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{arguments}: {message}");
    assert!(output.stdout.is_empty(), "{arguments} printed something");
    message
}

fn run(folder: &Path, arguments: &str) -> std::process::Output {
    Command::cargo_bin("mechid")
        .unwrap()
        .current_dir(folder)
        .args(arguments.split_whitespace())
        .output()
        .unwrap()
}
