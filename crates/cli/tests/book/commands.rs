//! Shell commands of the pages that are not commands of `mechid`. Each command is checked against
//! the workspace, and the program that it starts is run. A page must not have a command that this
//! file does not know.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use super::runs::Run;

/// First words of commands in running text.
pub const BEGINNINGS: [&str; 8] =
    ["cargo ", "git ", "mdbook ", "rustup ", "pip ", "python ", ".ci/", "MECHID_"];

/// The workspace as cargo describes it; the command lines of the pages are checked against it.
pub struct Workspace {
    root: PathBuf,
    metadata: Value,
}

impl Workspace {
    pub fn of(root: &Path) -> Self {
        let told = cargo(root, &["metadata", "--no-deps", "--offline", "--format-version", "1"]);
        Self { root: root.to_owned(), metadata: serde_json::from_str(&told).unwrap() }
    }

    /// Returns the way in which a test runs a command line of the pages.
    ///
    /// # Errors
    /// If the workspace has no target, option or script for the command line; the error gives the
    /// reason.
    pub fn meaning(&self, line: &str) -> Result<Run, String> {
        let typed = line.split(" # ").next().unwrap_or_default().trim();
        let mut words = shlex::split(typed).ok_or("no shell reads it")?;
        let settings = words.iter().take_while(|word| word.contains('=')).count();
        let settings: Vec<String> = words.drain(..settings).collect();
        let words: Vec<&str> = words.iter().map(String::as_str).filter(|w| *w != "…").collect();
        match words[..] {
            ["cargo", task, ref rest @ ..] => match self.alias(task) {
                Some(meant) => self.meaning(&format!("cargo {meant} {}", rest.join(" "))),
                None => self.meaning_of_cargo(typed, task, rest, &settings),
            },
            ["mdbook", "build", folder] if self.root.join(folder).join("book.toml").is_file() => {
                Ok(Run::Book(folder.into()))
            }
            ["mdbook", "build", folder] => Err(format!("no book.toml in {folder}")),
            // A measurement of times needs an idle computer, so it is not run; the Python checks
            // test only the types of the script.
            ["python", script]
                if script.starts_with("crates/python/examples/")
                    && self.root.join(script).is_file() =>
            {
                Ok(Run::Always)
            }
            // `.ci/python` runs this line in a clean environment.
            ["pip" | "python", ..] => has_line(&self.root, ".ci/python", typed),
            [".ci/run"] => Ok(Run::Always),
            [check] if check.starts_with(".ci/") => has_line(&self.root, ".ci/run", check),
            _ => Err("nothing runs this command".into()),
        }
    }

    fn meaning_of_cargo(
        &self,
        typed: &str,
        task: &str,
        rest: &[&str],
        settings: &[String],
    ) -> Result<Run, String> {
        let mut parts = rest.split(|word| *word == "--");
        let own = parts.next().unwrap_or_default();
        let arguments = parts.flatten().map(|word| (*word).to_owned()).collect();
        known_options(task, own)?;
        let package = match value(own, &["-p", "--package"]) {
            Some(name) => Some(self.package(name).ok_or(format!("no package {name}"))?),
            None => None,
        };
        let chosen = ["example", "test", "bench"].into_iter().find_map(|kind| {
            let name = value(own, &[format!("--{kind}").as_str()])?;
            let there = package.and_then(|package| target(package, kind, name));
            Some(there.map(|there| (kind, there)).ok_or(format!("no {kind} {name}")))
        });
        let bins = package.map(|package| targets(package, "bin")).unwrap_or_default();
        match (task, chosen.transpose()?) {
            ("run", Some((kind, example))) => Ok(Run::program(kind, &example, arguments)),
            ("run", None) if bins.len() == 1 => Ok(Run::program("bin", bins[0], arguments)),
            ("test", Some((_, test))) => test_knows(&test, own, settings).map(|()| Run::Always),
            ("bench", None) => is_benched(package),
            ("new", None) | ("add", None) => self.begins_a_crate(own),
            ("install", _) => self.installs(value(own, &["--path"]).unwrap_or_default()),
            ("tree", _) if own.is_empty() => Ok(Run::Always),
            // Commands for the whole workspace must be among the commands of `.ci/run`.
            _ if own.contains(&"--workspace") => self.is_run_always(typed),
            _ => Err("nothing runs this command of cargo".into()),
        }
    }

    /// Returns the command that `.cargo/config.toml` defines for this word.
    fn alias(&self, task: &str) -> Option<String> {
        let config = std::fs::read_to_string(self.root.join(".cargo/config.toml")).unwrap();
        let line = config.lines().find_map(|line| line.strip_prefix(task)?.strip_prefix(" = "))?;
        Some(line.trim_matches('"').to_owned())
    }

    fn package(&self, name: &str) -> Option<&Value> {
        self.metadata["packages"].as_array().unwrap().iter().find(|p| p["name"] == name)
    }

    /// Checks that the package in this folder has the program `mechid`. The script `.ci/python`
    /// compiles the program, without the tests and their features.
    fn installs(&self, folder: &str) -> Result<Run, String> {
        let manifest = self.root.join(folder).join("Cargo.toml");
        let packages = self.metadata["packages"].as_array().unwrap();
        let there =
            packages.iter().find(|p| Path::new(p["manifest_path"].as_str().unwrap()) == manifest);
        match there.and_then(|package| target(package, "bin", "mechid")) {
            Some(_) => Ok(Run::Always),
            None => Err(format!("no program mechid in \"{folder}\"")),
        }
    }

    /// Creates a crate, as a reader would, beside a clone of the workspace, and adds a crate of the
    /// workspace as a dependency.
    fn begins_a_crate(&self, words: &[&str]) -> Result<Run, String> {
        let [name, options @ ..] = words else { return Err("no name".into()) };
        let beside = tempfile::tempdir().unwrap();
        cargo(beside.path(), &["new", "--quiet", "--vcs", "none", "rig"]);
        if let Some(path) = value(options, &["--path"]) {
            let there = path.strip_prefix("../mechid/").ok_or("not in a clone beside it")?;
            let there = self.root.join(there);
            let add = ["add", name, "--offline", "--path", there.to_str().unwrap()];
            cargo(&beside.path().join("rig"), &add);
        }
        Ok(Run::Always)
    }

    fn is_run_always(&self, line: &str) -> Result<Run, String> {
        has_line(&self.root, ".ci/run", line.trim_end_matches(" --open"))
    }
}

/// Checks that the script has this line, with or without `--locked`.
fn has_line(root: &Path, script: &str, line: &str) -> Result<Run, String> {
    let checks = std::fs::read_to_string(root.join(script)).unwrap();
    let unlocked = |line: &str| line.trim_end_matches(" --locked").to_owned();
    match checks.lines().any(|check| unlocked(check.trim_start()) == unlocked(line)) {
        true => Ok(Run::Always),
        false => Err(format!("`{script}` has no such line: {line}")),
    }
}

fn cargo(root: &Path, arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO")).current_dir(root).args(arguments).output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "cargo {arguments:?}: {message}");
    String::from_utf8(output.stdout).unwrap()
}

/// Checks that the help of cargo lists every option of the command.
fn known_options(task: &str, words: &[&str]) -> Result<(), String> {
    let help = Command::new(env!("CARGO")).args([task, "-h"]).output().unwrap();
    if !help.status.success() {
        return Err(format!("cargo has no command {task}"));
    }
    let help = String::from_utf8(help.stdout).unwrap();
    let known: BTreeSet<&str> =
        help.split(|c: char| c.is_whitespace() || ",=[".contains(c)).collect();
    match words.iter().find(|word| word.starts_with('-') && !known.contains(*word)) {
        Some(option) => Err(format!("cargo {task} has no option {option}")),
        None => Ok(()),
    }
}

/// Returns the word after one of these options.
fn value<'a>(words: &[&'a str], options: &[&str]) -> Option<&'a str> {
    let at = words.iter().position(|word| options.contains(word))?;
    words.get(at + 1).copied()
}

fn targets<'a>(package: &'a Value, kind: &str) -> Vec<&'a Value> {
    let all = package["targets"].as_array().unwrap().iter();
    all.filter(|target| target["kind"].as_array().unwrap().iter().any(|k| k == kind)).collect()
}

fn target(package: &Value, kind: &str, name: &str) -> Option<Value> {
    targets(package, kind).into_iter().find(|target| target["name"] == name).cloned()
}

/// Checks that the package has benches, and that `cargo test` runs the measurements of each bench
/// once.
fn is_benched(package: Option<&Value>) -> Result<Run, String> {
    let benches = package.map(|package| targets(package, "bench")).unwrap_or_default();
    match benches.iter().find(|bench| bench["test"] != true) {
        Some(bench) => Err(format!("no test runs the bench {}", bench["name"])),
        None if benches.is_empty() => Err("nothing runs a bench that is not there".into()),
        None => Ok(Run::Always),
    }
}

/// Checks that the source files of a test target contain the test function that a command line
/// selects, and the environment variables that the line sets.
fn test_knows(test: &Value, words: &[&str], settings: &[String]) -> Result<(), String> {
    let main = Path::new(test["src_path"].as_str().unwrap());
    let files = below(main.parent().unwrap());
    let sources = files.iter().filter_map(|file| std::fs::read_to_string(file).ok());
    let sources = sources.collect::<String>();
    let at = words.iter().position(|word| *word == "--test").unwrap_or_default();
    if let Some(name) = words.get(at + 2).filter(|word| !word.starts_with('-'))
        && !sources.contains(&format!("fn {name}"))
        && !sources.contains(&format!("mod {name};"))
    {
        return Err(format!("no test {name}"));
    }
    let mut names = settings.iter().filter_map(|setting| setting.split('=').next());
    match names.find(|name| !sources.contains(&format!("\"{name}\""))) {
        Some(name) => Err(format!("the test does not know {name}")),
        None => Ok(()),
    }
}

/// Returns the Rust files in a folder and in the folders below it.
fn below(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let (folders, mut files): (Vec<PathBuf>, Vec<PathBuf>) = entries.partition(|e| e.is_dir());
    files.retain(|file| file.extension().is_some_and(|ending| ending == "rs"));
    files.extend(folders.iter().flat_map(|folder| below(folder)));
    files
}

#[test]
fn lines_are_known_by_what_they_run() {
    let workspace = Workspace::of(&crate::root());
    let program = |kind: &'static str, name: &str, arguments: &[&str]| Run::Program {
        kind,
        name: name.into(),
        arguments: arguments.iter().map(|word| (*word).to_owned()).collect(),
    };
    for (line, run) in [
        (
            "cargo run --package mechid-cli -- identify a.csv",
            program("bin", "mechid", &["identify", "a.csv"]),
        ),
        (
            "cargo run --package mechid --example 01_identify_a_record",
            program("example", "01_identify_a_record", &[]),
        ),
        ("cargo bench -p mechid-integrate", Run::Always),
        ("MECHID_BLESS=1 cargo test -p mechid-cli --test book fits # and so on", Run::Always),
        ("cargo install --path crates/cli", Run::Always),
        ("cargo xtask reproduce-thesis", program("bin", "xtask", &["reproduce-thesis"])),
        ("mdbook build docs/book", Run::Book("docs/book".into())),
        ("cargo doc --workspace --no-deps --open", Run::Always),
        ("pip install \"./crates/python[test]\" && python -m pytest crates/python", Run::Always),
        (".ci/python", Run::Always),
    ] {
        assert_eq!(workspace.meaning(line), Ok(run), "{line}");
    }
}

#[test]
fn what_is_not_there_is_found() {
    let workspace = Workspace::of(&crate::root());
    for (line, why) in [
        ("curl -O record.csv", "nothing runs"),
        ("cargo run --pakage mechid-cli --", "no option --pakage"),
        ("cargo run --package mechid-cly --", "no package mechid-cly"),
        ("cargo run --package mechid --example 99_not_there", "no example 99_not_there"),
        ("cargo run --example 01_identify_a_record", "no example 01"),
        ("cargo run --package mechid-signal", "nothing runs"),
        ("cargo test -p mechid-cli --test boook", "no test boook"),
        ("cargo test -p mechid-cli --test book no_such_test", "no test no_such_test"),
        ("MECHID_BLUNDER=1 cargo test -p mechid-cli --test book", "does not know MECHID_B"),
        ("cargo bench -p mechid-plot", "nothing runs"),
        ("cargo install --path crates/mechid", "no program mechid"),
        ("cargo test --workspace --no-run", "no such line"),
        ("pip install mechid-of-another", "`.ci/python` has no such line"),
        (".ci/parrot", "`.ci/run` has no such line"),
        ("cargo frobnicate", "no command frobnicate"),
        ("mdbook build docs", "no book.toml"),
        ("echo 'open", "no shell"),
    ] {
        let found = workspace.meaning(line).expect_err(line);
        assert!(found.contains(why), "{line}: {found}");
    }
}
