//! Lines for the reader's shell that are not commands of `mechid`: what is cheap is run, the rest
//! is held to the workspace, and a line that nothing here knows must not be in a page.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

/// Words with which a command in running text begins.
pub const BEGINNINGS: [&str; 5] = ["cargo ", "git ", "mdbook ", "rustup ", "MECHID_"];

/// What holds the lines: the workspace as cargo sees it.
pub struct Workspace {
    root: PathBuf,
    metadata: Value,
}

impl Workspace {
    pub fn of(root: &Path) -> Self {
        let told = cargo(root, &["metadata", "--no-deps", "--offline", "--format-version", "1"]);
        Self { root: root.to_owned(), metadata: serde_json::from_str(&told).unwrap() }
    }

    /// Holds one line to what is there.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn hold(&self, line: &str) -> Result<(), String> {
        let typed = line.split(" # ").next().unwrap_or_default().trim();
        let mut words = shlex::split(typed).ok_or("no shell reads it")?;
        let settings = words.iter().take_while(|word| word.contains('=')).count();
        let settings: Vec<String> = words.drain(..settings).collect();
        let words: Vec<&str> = words.iter().map(String::as_str).filter(|w| *w != "…").collect();
        match words[..] {
            ["cargo", task, ref rest @ ..] => match self.alias(task) {
                Some(meant) => self.hold(&format!("cargo {meant} {}", rest.join(" "))),
                None => self.hold_cargo(typed, task, rest, &settings),
            },
            ["mdbook", "build", folder] => self.build_book(folder),
            _ => Err("nothing holds this command".into()),
        }
    }

    fn hold_cargo(
        &self,
        typed: &str,
        task: &str,
        rest: &[&str],
        settings: &[String],
    ) -> Result<(), String> {
        let own = rest.split(|word| *word == "--").next().unwrap_or_default();
        known_options(task, own)?;
        let package = match value(own, &["-p", "--package"]) {
            Some(name) => Some(self.package(name).ok_or(format!("no package {name}"))?),
            None => None,
        };
        let target = |option: &str, kind: &str| match (value(own, &[option]), package) {
            (None, _) => Ok(None),
            (Some(name), Some(package)) => {
                target(package, kind, name).map(Some).ok_or(format!("no {kind} {name}"))
            }
            (Some(_), None) => Err(format!("{option} without --package")),
        };
        let chosen = [("--example", "example"), ("--test", "test"), ("--bench", "bench")];
        let chosen: Vec<Value> = chosen
            .iter()
            .filter_map(|(option, kind)| target(option, kind).transpose())
            .collect::<Result<_, _>>()?;
        let has = |kind: &str| package.is_some_and(|p| !targets(p, kind).is_empty());
        match task {
            "run" if !chosen.is_empty() || has("bin") => Ok(()),
            "test" if !chosen.is_empty() => test_knows(&chosen[0], own, settings),
            "bench" if has("bench") => Ok(()),
            "install" => self.installs(value(own, &["--path"]).unwrap_or_default()),
            "tree" if own.is_empty() => Ok(()),
            // Whatever needs the whole workspace, the check of every change runs.
            _ if own.contains(&"--workspace") => self.is_run_always(typed),
            _ => Err("nothing holds this command of cargo".into()),
        }
    }

    /// What `.cargo/config.toml` puts in the place of this word.
    fn alias(&self, task: &str) -> Option<String> {
        let config = std::fs::read_to_string(self.root.join(".cargo/config.toml")).unwrap();
        let line = config.lines().find_map(|line| line.strip_prefix(task)?.strip_prefix(" = "))?;
        Some(line.trim_matches('"').to_owned())
    }

    fn package(&self, name: &str) -> Option<&Value> {
        self.metadata["packages"].as_array().unwrap().iter().find(|p| p["name"] == name)
    }

    /// The folder's package brings the program of this book.
    fn installs(&self, folder: &str) -> Result<(), String> {
        let manifest = self.root.join(folder).join("Cargo.toml");
        let packages = self.metadata["packages"].as_array().unwrap();
        let there =
            packages.iter().find(|p| Path::new(p["manifest_path"].as_str().unwrap()) == manifest);
        match there.and_then(|package| target(package, "bin", "mechid")) {
            Some(_) => Ok(()),
            None => Err(format!("no program mechid in \"{folder}\"")),
        }
    }

    fn is_run_always(&self, line: &str) -> Result<(), String> {
        let checks = std::fs::read_to_string(self.root.join(".ci/run")).unwrap();
        let line = line.trim_end_matches(" --open");
        match checks
            .lines()
            .any(|check| check.trim_end_matches(" --locked") == line.trim_end_matches(" --locked"))
        {
            true => Ok(()),
            false => Err(format!("`.ci/run` has no such line: {line}")),
        }
    }

    /// Where mdBook is installed, it must make the page that a reader opens first.
    fn build_book(&self, folder: &str) -> Result<(), String> {
        let book = self.root.join(folder);
        if !book.join("book.toml").is_file() {
            return Err(format!("no book.toml in {folder}"));
        }
        let made = tempfile::tempdir().unwrap();
        let run =
            Command::new("mdbook").arg("build").arg(&book).arg("-d").arg(made.path()).output();
        match run {
            Ok(output) if !made.path().join("index.html").is_file() => {
                Err(String::from_utf8_lossy(&output.stderr).into_owned())
            }
            _ => Ok(()),
        }
    }
}

fn cargo(root: &Path, arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO")).current_dir(root).args(arguments).output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "cargo {arguments:?}: {message}");
    String::from_utf8(output.stdout).unwrap()
}

/// Whether cargo's own help has every option.
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

/// The word after one of these options.
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

/// Whether the sources of a test have the tests that a line picks, and the setting it makes.
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

/// The Rust files in a folder and the folders in it.
fn below(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let (folders, mut files): (Vec<PathBuf>, Vec<PathBuf>) = entries.partition(|e| e.is_dir());
    files.retain(|file| file.extension().is_some_and(|ending| ending == "rs"));
    files.extend(folders.iter().flat_map(|folder| below(folder)));
    files
}

#[test]
fn what_is_not_there_is_found() {
    let workspace = Workspace::of(&crate::root());
    for line in [
        "cargo run --package mechid-cli -- identify",
        "cargo run --package mechid --example 01_identify_a_record",
        "cargo bench -p mechid-integrate",
        "MECHID_BLESS=1 cargo test -p mechid-cli --test book fits # and so on",
        "cargo install --path crates/cli",
        "cargo xtask reproduce-thesis",
    ] {
        workspace.hold(line).unwrap_or_else(|why| panic!("{line}: {why}"));
    }
    for (line, why) in [
        ("curl -O record.csv", "nothing holds"),
        ("cargo run --pakage mechid-cli --", "no option --pakage"),
        ("cargo run --package mechid-cly --", "no package mechid-cly"),
        ("cargo run --package mechid --example 99_not_there", "no example 99_not_there"),
        ("cargo run --package mechid-signal", "nothing holds"),
        ("cargo test -p mechid-cli --test boook", "no test boook"),
        ("cargo test -p mechid-cli --test book no_such_test", "no test no_such_test"),
        ("MECHID_BLUNDER=1 cargo test -p mechid-cli --test book", "does not know MECHID_B"),
        ("cargo bench -p mechid-cli", "nothing holds"),
        ("cargo install --path crates/mechid", "no program mechid"),
        ("cargo test --workspace --no-run", "no such line"),
        ("cargo frobnicate", "no command frobnicate"),
        ("mdbook build docs", "no book.toml"),
        ("echo 'open", "no shell"),
    ] {
        let found = workspace.hold(line).expect_err(line);
        assert!(found.contains(why), "{line}: {found}");
    }
}
