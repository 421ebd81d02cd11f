//! Runs the programs that the shell commands of the pages start.
//!
//! The programs are built without `--release`, even if a command on a page has it, because a second
//! profile would compile everything again.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::Mutex;
use std::time::Duration;

use mdbook_driver::MDBook;
use serde_json::Value;

/// The way in which a test runs a command line of the pages.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Run {
    /// The checks of every change already run this line, so it is not run here.
    Always,
    /// A program or an example of the workspace with the arguments of the line.
    Program { kind: &'static str, name: String, arguments: Vec<String> },
    /// The command line builds a book with mdBook; the value is the folder of the book.
    Book(String),
}

/// Paths of the programs and examples that the shell commands of the pages start, by kind and name.
pub struct Programs(BTreeMap<(String, String), PathBuf>);

impl Run {
    pub fn program(kind: &'static str, target: &Value, arguments: Vec<String>) -> Self {
        Run::Program { kind, name: target["name"].as_str().unwrap().into(), arguments }
    }

    /// Runs the line from the root of the repository, and checks that it prints something.
    ///
    /// # Errors
    /// If the run fails; the error gives the reason.
    pub fn go(&self, root: &Path, programs: &Programs) -> Result<(), String> {
        let made = tempfile::tempdir().unwrap();
        match self {
            Run::Always => Ok(()),
            // A program without arguments is only the beginning of a command.
            Run::Program { kind: "bin", arguments, .. } if arguments.is_empty() => Ok(()),
            Run::Program { kind, name, arguments } => {
                let mut program = Command::new(programs.path(kind, name)?);
                program.current_dir(root).args(arguments);
                if name == "xtask" && !arguments.iter().any(|word| word == "--check") {
                    // Other tests read the files in the repository, so the output goes to a
                    // temporary folder.
                    program.arg("--out").arg(made.path());
                }
                said(program).map(drop)
            }
            Run::Book(folder) => build_book(&root.join(folder), made.path()),
        }
    }
}

impl Programs {
    /// Builds the programs of these runs. In most cases `cargo test --workspace` has already built
    /// them.
    pub fn of(root: &Path, runs: &BTreeSet<Run>) -> Self {
        let mut build = Command::new(env!("CARGO"));
        build.current_dir(root).args(["build", "--workspace", "--locked", "--offline"]);
        build.args(["--message-format", "json"]);
        for run in runs {
            if let Run::Program { kind, name, .. } = run {
                build.arg(format!("--{kind}")).arg(name);
            }
        }
        let told = said(build).unwrap();
        let made = told.lines().filter_map(|line| {
            let message: Value = serde_json::from_str(line).ok()?;
            let (path, target) = (message["executable"].as_str()?, &message["target"]);
            let (kind, name) = (target["kind"][0].as_str()?, target["name"].as_str()?);
            Some(((kind.to_owned(), name.to_owned()), PathBuf::from(path)))
        });
        Self(made.collect())
    }

    fn path(&self, kind: &str, name: &str) -> Result<&Path, String> {
        let path = self.0.get(&(kind.to_owned(), name.to_owned()));
        path.map(PathBuf::as_path).ok_or(format!("no {kind} {name} was built"))
    }
}

/// Runs all `runs`, several at a time; returns the failures in the order of the runs.
pub fn go_all(runs: &BTreeSet<Run>, root: &Path, programs: &Programs) -> Vec<String> {
    let (waiting, failed) = (Mutex::new(runs.iter()), Mutex::new(BTreeMap::new()));
    let work = || {
        loop {
            let Some(run) = waiting.lock().unwrap().next() else { break };
            if let Err(why) = run.go(root, programs) {
                failed.lock().unwrap().insert(run, why);
            }
        }
    };
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(work);
        }
    });
    let failed = failed.into_inner().unwrap().into_iter();
    failed.map(|(run, why)| format!("{run:?}: {why}")).collect()
}

/// Maximum time of a command of the pages; a command that takes longer is stopped and reported as a
/// failure.
const LONGEST: Duration = Duration::from_secs(600);

/// Returns the output of a command, which must not be empty; the exit code must be 0.
fn said(command: Command) -> Result<String, String> {
    let mut command = assert_cmd::Command::from_std(command);
    let Output { status, stdout, stderr } =
        command.timeout(LONGEST).output().map_err(|error| format!("{command:?}: {error}"))?;
    if !status.success() || stdout.is_empty() {
        return Err(format!("{command:?}: {status}: {}", String::from_utf8_lossy(&stderr)));
    }
    String::from_utf8(stdout).map_err(|error| error.to_string())
}

/// Builds the pages that a reader opens in a browser.
fn build_book(folder: &Path, to: &Path) -> Result<(), String> {
    let mut book = MDBook::load(folder).map_err(|error| format!("{error:#}"))?;
    book.config.build.build_dir = to.to_owned();
    book.build().map_err(|error| format!("{error:#}"))?;
    let chapters = book.iter().filter_map(|item| match item {
        mdbook_driver::book::BookItem::Chapter(chapter) => chapter.path.clone(),
        _ => None,
    });
    let pages: Vec<PathBuf> =
        chapters.map(|chapter| to.join(chapter.with_extension("html"))).collect();
    match pages.iter().chain([&to.join("index.html")]).find(|page| !page.is_file()) {
        Some(page) => Err(format!("mdBook made no {}", page.display())),
        None if pages.len() < 10 => Err(format!("a book of {} pages", pages.len())),
        None => Ok(()),
    }
}
