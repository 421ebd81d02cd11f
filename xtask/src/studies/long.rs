//! Long studies: examples that print tables, each with an equal share of the time.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use super::{Plan, page, results};

/// Maximum time of a study, in shares of the time budget; a study that takes longer is stopped.
const PATIENCE: u32 = 4;
/// Time between two checks of a running study.
const LOOK: Duration = Duration::from_millis(200);

/// An example that prints its tables in Markdown.
pub(super) struct Study {
    name: &'static str,
    example: &'static str,
    /// Arguments before and after the number of experiments.
    around: [&'static [&'static str]; 2],
    /// Number of experiments of the first run, whose time determines the number of the second run.
    probe: u64,
    page: Option<Page>,
}

/// Page of the book whose tables a study updates.
struct Page {
    path: &'static str,
    /// Number of experiments stated on the page: no run has more; with fewer, the page is not
    /// changed.
    experiments: u64,
}

const fn study(name: &'static str, example: &'static str) -> Study {
    Study { name, example, around: [&[], &[]], probe: 2, page: None }
}

impl Study {
    const fn on(self, path: &'static str, experiments: u64) -> Self {
        Self { page: Some(Page { path, experiments }), ..self }
    }
}

const STUDIES: [Study; 11] = [
    Study { probe: 20, ..study("checks", "checks_study") }
        .on("docs/book/src/studies/checks.md", 1000),
    study("faults", "fault_study"),
    study("parts", "parts_study"),
    study("random tests", "random_study"),
    study("hammer", "hammer_study"),
    study("bearings", "bearing_study").on("docs/book/src/studies/bearing.md", 1000),
    Study { around: [&[], &["auto"]], ..study("coloured noise", "coloured_noise_study") },
    study("modes", "modal_study").on("docs/book/src/studies/modes.md", 200),
    study("decays", "decay_study").on("docs/book/src/studies/decays.md", 400),
    study("ambient", "ambient_study").on("docs/book/src/studies/modes.md", 200),
    Study { around: [&["coverage"], &[]], probe: 4, ..study("forces", "noise_study") },
];

/// Returns the studies whose names contain `only`.
pub(super) fn chosen(only: &str) -> Result<Vec<&'static Study>, String> {
    let chosen: Vec<&Study> = STUDIES.iter().filter(|study| study.name.contains(only)).collect();
    if chosen.is_empty() {
        let names: Vec<&str> = STUDIES.iter().map(|study| study.name).collect();
        return Err(format!("no study \"{only}\"; there are {}", names.join(", ")));
    }
    Ok(chosen)
}

/// Runs studies in equal shares of the time; writes the printed output of each as text, the cells
/// of all tables as Parquet, and the tables of the book for which there are enough experiments.
/// Returns a line for each study, and the failed studies.
pub(super) fn run(
    root: &Path,
    out: &Path,
    plan: &Plan,
    budget: Duration,
) -> Result<(String, Vec<String>), String> {
    let chosen = chosen(&plan.only)?;
    let share = budget / chosen.len() as u32;
    let programs = built(root, &chosen, &plan.profile)?;
    let (mut told, mut cells, mut failed) = (String::new(), Vec::new(), Vec::new());
    for study in chosen {
        let (experiments, printed) = match study.run(&programs.join(study.example), share) {
            Ok(run) => run,
            Err(why) => {
                failed.push(format!("{}: {why}", study.name));
                continue;
            }
        };
        let file = out.join(format!("{}.txt", study.name.replace(' ', "-")));
        std::fs::write(&file, &printed).map_err(|e| format!("{}: {e}", file.display()))?;
        let tables = tables(&printed);
        tables.iter().for_each(|table| cells.extend(table.cells(study.name)));
        let _ =
            writeln!(told, "{}: {experiments} experiments, {} tables", study.name, tables.len());
        if let Some(page) = &study.page
            && plan.out.is_none()
            && experiments >= page.experiments
        {
            let texts = tables.iter().map(|table| table.text.as_str());
            let written = page::rewrite_tables(&root.join(page.path), texts)?;
            let _ = writeln!(told, "  {written} written into {}", page.path);
        }
    }
    results::write_cells(&out.join("studies.parquet"), &cells)?;
    Ok((told, failed))
}

impl Study {
    /// Returns the number of experiments, and the output, of the longest run that the share of the
    /// time allows.
    fn run(&self, program: &Path, share: Duration) -> Result<(u64, String), String> {
        let start = Instant::now();
        let printed = self.printed(program, self.probe, share)?;
        let each = start.elapsed().as_secs_f64() / self.probe as f64;
        let left = share.saturating_sub(start.elapsed());
        let most = self.page.as_ref().map_or(u64::MAX, |page| page.experiments);
        let experiments = ((left.as_secs_f64() / each.max(1e-6)) as u64).min(most);
        if experiments <= self.probe {
            return Ok((self.probe, printed));
        }
        Ok((experiments, self.printed(program, experiments, share)?))
    }

    fn printed(&self, program: &Path, experiments: u64, share: Duration) -> Result<String, String> {
        let mut command = Command::new(program);
        command.args(self.around[0]).arg(experiments.to_string()).args(self.around[1]);
        finished(&mut command, share * PATIENCE)
    }
}

/// Builds the examples and returns the folder that has them.
fn built(root: &Path, chosen: &[&Study], profile: &str) -> Result<PathBuf, String> {
    let mut cargo = Command::new("cargo");
    cargo.current_dir(root).args(["build", "--workspace", "--locked", "--quiet"]);
    cargo.args(["--profile", profile]);
    for study in chosen {
        cargo.args(["--example", study.example]);
    }
    finished(&mut cargo, Duration::MAX)?;
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or(root.join("target"), PathBuf::from);
    // Cargo's folder of the profile `dev` is called `debug`.
    Ok(target.join(if profile == "dev" { "debug" } else { profile }).join("examples"))
}

/// Returns the output of a command; a command that takes longer than `longest` is stopped.
fn finished(command: &mut Command, longest: Duration) -> Result<String, String> {
    let words = |e: std::io::Error| e.to_string();
    let mut child = command.stdout(Stdio::piped()).spawn().map_err(words)?;
    let stdout = child.stdout.take();
    let reader =
        std::thread::spawn(move || stdout.map_or(Ok(String::new()), std::io::read_to_string));
    let start = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().map_err(words)? {
            break status;
        }
        if start.elapsed() > longest {
            child.kill().map_err(words)?;
            return Err(format!("stopped after {:.0} s", start.elapsed().as_secs_f64()));
        }
        std::thread::sleep(LOOK);
    };
    let printed = reader.join().map_err(|_| "its output ended".to_owned())?.map_err(words)?;
    if status.success() { Ok(printed) } else { Err(format!("{status}")) }
}

/// A table in Markdown.
struct Printed {
    text: String,
    lines: Vec<Vec<String>>,
}

/// Returns the tables of a text.
fn tables(text: &str) -> Vec<Printed> {
    let mut tables: Vec<Printed> = Vec::new();
    let mut is_within = false;
    for line in text.lines() {
        let is_row = line.starts_with('|');
        if is_row && !is_within {
            tables.push(Printed { text: String::new(), lines: Vec::new() });
        }
        is_within = is_row;
        if let (true, Some(table)) = (is_row, tables.last_mut()) {
            table.text.push_str(line);
            table.text.push('\n');
            let inner = line.trim().trim_start_matches('|').trim_end_matches('|');
            table.lines.push(inner.split(" | ").map(|cell| cell.trim().to_owned()).collect());
        }
    }
    tables
}

impl Printed {
    /// Returns study, row, column and value of each cell, except the first cell of each row.
    fn cells(&self, study: &str) -> Vec<[String; 4]> {
        let Some((header, rows)) = self.lines.split_first() else { return Vec::new() };
        let rows = rows.iter().skip(1).filter(|row| row.len() > 1);
        let cell =
            |row: &str, column: &str, value: &str| [study, row, column, value].map(str::to_owned);
        rows.flat_map(|row| {
            header[1..].iter().zip(&row[1..]).map(|(column, value)| cell(&row[0], column, value))
        })
        .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_become_cells() {
        let text =
            "words\n| a | b |\n|---|---|\n| one | 1.5 |\n| two |  |\n\n| c |\n|---|\n| x |\n";
        let tables = tables(text);
        assert_eq!(tables.len(), 2);
        assert!(tables[0].text.starts_with("| a | b |\n|---|---|\n| one"));
        let cells = tables[0].cells("s");
        assert_eq!(cells[0], ["s", "one", "b", "1.5"]);
        assert_eq!(cells[1], ["s", "two", "b", ""]);
        assert!(tables[1].cells("s").is_empty());
    }

    #[test]
    fn a_study_that_hangs_is_stopped() {
        let mut hangs = Command::new("sleep");
        let told = finished(hangs.arg("60"), Duration::from_millis(300)).unwrap_err();
        assert!(told.starts_with("stopped after"), "{told}");
    }
}
