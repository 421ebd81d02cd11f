//! A reader at a terminal, who runs the commands of a page in a separate folder.

use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use tempfile::TempDir;

/// The ways to start the program: an installed program, and the program of a fresh clone.
const PROGRAM: [&str; 2] = ["mechid", "cargo run --package mechid-cli --"];

/// Standard shell commands with which the pages select rows and columns of a text.
const TEXT_TOOLS: [&str; 2] = ["tail ", "paste "];

/// A folder with the repository's examples and the files that earlier commands wrote.
pub struct Session {
    /// Temporary folder; it is removed at the end of the session.
    _home: TempDir,
    /// Current folder of the reader.
    folder: PathBuf,
    /// Exit code of the last command; if the code is not 0, the page must show it by `echo $?`.
    code: i32,
}

impl Session {
    pub fn new(root: &Path) -> Self {
        let home = tempfile::tempdir().unwrap();
        let folder = home.path().to_owned();
        for name in ["examples", "examples/frame", "examples/rotor"] {
            fs::create_dir(folder.join(name)).unwrap();
        }
        for file in [
            "machine.json",
            "machine.csv",
            "bearing-rig.csv",
            "bearing-dry.csv",
            "hammer-1.csv",
            "hammer-2.csv",
            "decay.csv",
            "frame/frame.csv",
            "rotor/rotor.json",
            "rotor/mass.mtx",
            "rotor/stiffness.mtx",
            "rotor/gyroscopic.mtx",
            "rotor/runs.csv",
        ] {
            let name = Path::new("examples").join(file);
            fs::copy(root.join(&name), folder.join(&name)).unwrap();
        }
        Self { _home: home, folder, code: 0 }
    }

    /// Writes a file that a page shows.
    pub fn write(&self, name: &str, text: &str) {
        fs::write(self.folder.join(name), text).unwrap();
    }

    /// Copies a file that the reader has downloaded.
    pub fn copy(&self, file: &Path) {
        fs::copy(file, self.folder.join(file.file_name().unwrap())).unwrap();
    }

    /// Returns the text of a file in the current folder, if it exists.
    pub fn read(&self, name: &str) -> Option<String> {
        fs::read_to_string(self.folder.join(name)).ok()
    }

    /// Returns true if a line makes or enters a folder.
    pub fn walks(line: &str) -> bool {
        line.starts_with("mkdir ") || line.starts_with("cd ")
    }

    /// Makes or enters a folder if the line says so.
    pub fn walk(&mut self, line: &str) -> Result<(), String> {
        let done = match line.split_whitespace().collect::<Vec<_>>()[..] {
            ["mkdir", name] => fs::create_dir(self.folder.join(name)),
            ["cd", name] => self.folder.join(name).canonicalize().map(|at| self.folder = at),
            _ => Ok(()),
        };
        done.map_err(|error| format!("{line}: {error}"))
    }

    /// Runs a command and returns what the terminal shows.
    pub fn run(&mut self, command: &str) -> Result<String, String> {
        if command == "echo $?" {
            return Ok(format!("{}\n", std::mem::take(&mut self.code)));
        }
        if self.code != 0 {
            return Err(format!("exit code {} before it; show it by `echo $?`", self.code));
        }
        let (command, to) = match command.split_once(" > ") {
            Some((command, file)) => (command, Some(file.trim())),
            None => (command, None),
        };
        let words: Vec<&str> = command.split_whitespace().collect();
        let shown = match words[..] {
            ["cat", file] => self.read(file).ok_or(format!("no file {file}"))?,
            ["head", lines, file] => {
                let text = self.read(file).ok_or(format!("no file {file}"))?;
                let lines =
                    lines.trim_start_matches('-').parse().map_err(|_| "head -LINES FILE")?;
                text.split_inclusive('\n').take(lines).collect()
            }
            _ => self.start(&words.join(" "))?,
        };
        match to {
            Some(file) if self.code == 0 => {
                self.write(file, &shown);
                Ok(String::new())
            }
            _ => Ok(shown),
        }
    }

    fn start(&mut self, command: &str) -> Result<String, String> {
        if TEXT_TOOLS.iter().any(|tool| command.starts_with(tool)) {
            let mut shell = Command::new("sh");
            let output = shell.current_dir(&self.folder).args(["-c", command]).output().unwrap();
            self.code = output.status.code().ok_or("killed by a signal")?;
            return String::from_utf8(output.stdout).map_err(|error| error.to_string());
        }
        let arguments = PROGRAM
            .iter()
            .find_map(|program| command.strip_prefix(program)?.strip_prefix(' '))
            .ok_or_else(|| format!("`{command}` is none of the commands a page may show"))?;
        let output = Command::cargo_bin("mechid")
            .unwrap()
            .current_dir(&self.folder)
            // The result must not depend on the width of the developer's terminal.
            .env_remove("COLUMNS")
            .args(shlex::split(arguments).ok_or_else(|| format!("no shell reads `{command}`"))?)
            .output()
            .unwrap();
        self.code = output.status.code().ok_or("killed by a signal")?;
        // A run over many records prints a report even if some of them failed.
        let reports = self.code == 0 || output.stderr.is_empty();
        let text = if reports { output.stdout } else { output.stderr };
        String::from_utf8(text).map_err(|error| error.to_string())
    }
}

/// A command and the answer of the terminal.
#[derive(Debug, PartialEq)]
pub struct Step {
    /// The command as on the page: with prompt, possibly over several lines.
    pub typed: String,
    pub shown: String,
}

impl Step {
    /// Returns the steps of a `console` block. A line that begins with `$` is typed, a backslash at
    /// its end continues it, and all other lines are answers.
    pub fn all(block: &str) -> Vec<Self> {
        let mut steps: Vec<Self> = Vec::new();
        let mut typing = false;
        for line in block.split_inclusive('\n') {
            if line.starts_with("$ ") {
                steps.push(Self { typed: line.into(), shown: String::new() });
            } else if let Some(step) = steps.last_mut() {
                if typing { step.typed.push_str(line) } else { step.shown.push_str(line) }
            }
            typing = (typing || line.starts_with("$ ")) && line.trim_end().ends_with('\\');
        }
        steps
    }

    /// Returns the command on one line, without the prompt.
    pub fn command(&self) -> String {
        let line = self.typed.trim_start_matches("$ ").replace("\\\n", " ");
        line.split_whitespace().collect::<Vec<_>>().join(" ")
    }
}

/// Returns true if the answer is the one shown. In the shown answer, a line `...` represents any
/// lines, and `[..]` any part of one line.
pub fn fits(shown: &str, answer: &str) -> bool {
    let lines: Vec<&str> = answer.lines().collect();
    fits_lines(&shown.lines().collect::<Vec<_>>(), &lines)
}

fn fits_lines(shown: &[&str], answer: &[&str]) -> bool {
    match shown.split_first() {
        None => answer.is_empty(),
        Some((&"...", rest)) => {
            (0..=answer.len()).any(|skipped| fits_lines(rest, &answer[skipped..]))
        }
        Some((line, rest)) => answer
            .split_first()
            .is_some_and(|(first, others)| fits_line(line, first) && fits_lines(rest, others)),
    }
}

fn fits_line(shown: &str, answer: &str) -> bool {
    match shown.split_once("[..]") {
        None => shown == answer,
        Some((start, rest)) => answer.strip_prefix(start).is_some_and(|others| {
            others
                .char_indices()
                .map(|(at, _)| at)
                .chain([others.len()])
                .any(|at| fits_line(rest, &others[at..]))
        }),
    }
}

#[test]
fn steps_are_commands_with_their_answers() {
    let steps = Step::all("$ mechid info \\\n    a.csv\nfirst\nsecond\n$ echo $?\n0\n");
    assert_eq!(steps.len(), 2);
    assert_eq!(steps[0].command(), "mechid info a.csv");
    assert_eq!(steps[0].shown, "first\nsecond\n");
    assert_eq!((steps[1].command().as_str(), steps[1].shown.as_str()), ("echo $?", "0\n"));
}

#[test]
fn dots_stand_for_what_is_left_out() {
    let answer = "one 1\ntwo 2\nthree 3\n";
    for shown in [answer, "...\n", "one 1\n...\n", "...\nthree 3\n", "one [..]\ntwo 2\nth[..]3\n"] {
        assert!(fits(shown, answer), "{shown}");
    }
    for shown in
        ["", "one 1\n", "...\ntwo 2\n", "one [..]\n...\nthree 4\n", "one 1\ntwo 2\nthree 3\n4\n"]
    {
        assert!(!fits(shown, answer), "{shown}");
    }
}
