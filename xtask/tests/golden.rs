//! The numbers agree with the golden files. After an intended change, run `cargo xtask
//! reproduce-thesis --bless`.

use std::path::{Path, PathBuf};
use std::process::Command;

use xtask::thesis::reproduce;

#[test]
fn tables_and_figures_agree_with_their_golden_files() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let reproduction = reproduce::all(root, || ()).unwrap();
    let differences = reproduction.differences(root, true).unwrap();
    assert!(differences.is_empty(), "{}", differences.join("\n"));
    let files = std::fs::read_dir(root.join("tests/golden")).unwrap().count();
    assert_eq!(files, reproduction.golden_files(), "a golden file without its table or figure");
}

/// Returns the pages of a folder and of its subfolders.
fn pages(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let (folders, mut files): (Vec<PathBuf>, Vec<PathBuf>) = entries.partition(|e| e.is_dir());
    files.retain(|file| file.extension().is_some_and(|ending| ending == "md"));
    files.extend(folders.iter().flat_map(|folder| pages(folder)));
    files
}

/// Runs the commands that the pages show; a command that draws everything draws only one table
/// here.
#[test]
fn the_tasks_in_the_pages_run() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let pages = pages(&root.join("docs"));
    let text: String = pages.iter().map(|page| std::fs::read_to_string(page).unwrap()).collect();
    let mut run = 0;
    for line in text.lines().filter_map(|line| line.strip_prefix("cargo xtask ")) {
        let mut words: Vec<&str> = line.split(" # ").next().unwrap().split_whitespace().collect();
        let checks = words.contains(&"--check");
        if !checks && !words.contains(&"--only") {
            words.extend(["--only", "table-5.2.1"]);
        }
        let out = tempfile::tempdir().unwrap();
        let output = Command::new(env!("CARGO_BIN_EXE_xtask"))
            .args(words)
            .arg("--out")
            .arg(out.path())
            .output()
            .unwrap();
        assert!(output.status.success(), "{line}: {}", String::from_utf8_lossy(&output.stderr));
        let written = std::fs::read_dir(out.path()).unwrap().count();
        assert_eq!(written == 0, checks, "{line}: {written} files");
        run += 1;
    }
    assert!(run > 2, "only {run} lines");
}
