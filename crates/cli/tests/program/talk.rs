//! Messages of the program: completion scripts for shells, no colours in pipes, no output with
//! --quiet.

use std::f64::consts::PI;
use std::fs;
use std::process::Command;

use super::{mechid, refused, run};

const SUBCOMMANDS: [&str; 11] = [
    "completions",
    "force",
    "frf",
    "identify",
    "info",
    "modes",
    "multisine",
    "report",
    "simulate",
    "stability",
    "sweep",
];

#[test]
fn completions_know_every_subcommand() {
    let folder = tempfile::tempdir().unwrap();
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = mechid(folder.path(), &format!("completions {shell}"));
        for subcommand in SUBCOMMANDS {
            assert!(script.contains(subcommand), "{shell}: {subcommand}");
        }
        assert!(script.contains("band-hz"), "{shell}");
    }
    let message = refused(folder.path(), "completions tcsh");
    assert!(message.contains("bash, elvish, fish, powershell, zsh"), "{message}");
}

/// The shell bash parses the completion script without an error; it does not run the script.
#[test]
fn bash_understands_its_completions() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mechid.bash");
    fs::write(&path, mechid(folder.path(), "completions bash")).unwrap();
    let output = Command::new("bash").arg("-n").arg(&path).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn no_colours_go_into_pipes() {
    let folder = tempfile::tempdir().unwrap();
    let mut calls = vec!["--help".to_owned(), "--version".into(), "nonsense".into(), "info".into()];
    calls.extend(SUBCOMMANDS.map(|subcommand| format!("{subcommand} --help")));
    calls.push("info no-such-file".into());
    for arguments in calls {
        let output = run(folder.path(), &arguments);
        for stream in [output.stdout, output.stderr] {
            assert!(!stream.contains(&0x1b), "{arguments}: {}", String::from_utf8_lossy(&stream));
        }
    }
}

#[test]
fn quiet_success_says_nothing_and_quiet_failure_says_what_is_wrong() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.csv"), "t,f\n0,1\n1,-1\n2,1\n3,-1\n").unwrap();
    assert_eq!(mechid(folder.path(), "info a.csv --quiet"), "");
    let message = refused(folder.path(), "info a.csv --columns x --quiet");
    assert!(message.starts_with("error: a.csv has no column \"x\""), "{message}");
}

/// Messages use the singular for a count of one, and ordinal numbers have the right ending.
#[test]
fn one_thing_is_told_as_one() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: String| fs::write(folder.path().join(name), text).unwrap();
    write("one.csv", "x\n1\n".into());
    let told = mechid(folder.path(), "info one.csv");
    assert!(
        told.starts_with("one.csv: text, fields between blanks, 1 column, 1 sample;"),
        "{told}"
    );
    let rows = (0..32).map(|k| {
        let turn = PI * f64::from(k) / 8.0;
        format!("{},{},{},1\n", f64::from(k) / 16.0, turn.cos(), turn.sin())
    });
    write("a.csv", "t,f,x,v\n".to_owned() + &rows.collect::<String>());
    let record = "a.csv --force f --displacement x --period 16";
    let told = mechid(folder.path(), &format!("identify {record} --mass 1"));
    assert!(told.contains("; 1 line, 1 (1 Hz)\n"), "{told}");
    let told = mechid(folder.path(), &format!("frf {record}"));
    assert!(told.contains("equivalent to 2 averages; 1 line, 1 Hz\n"), "{told}");
    for (factor, ordinal) in [(3, "3rd"), (6, "6th"), (11, "11th"), (21, "21st")] {
        let told = refused(
            folder.path(),
            &format!("sweep {record} --velocity v --estimator least-squares --decimate {factor}"),
        );
        assert!(told.contains(&format!("cannot be reduced to every {ordinal} sample")), "{told}");
    }
    let told = refused(folder.path(), "identify a.csv --force f,0 --displacement x,v --mass 1");
    assert!(told.contains("--mass gives 1 value, the record has 2 degrees of freedom"), "{told}");
}

/// The displacement is a random walk, so the report has warnings and notes. Each is one line, and
/// no empty line separates them.
#[test]
fn warnings_stand_together() {
    let folder = tempfile::tempdir().unwrap();
    let mut text = String::from("time,f,x\n");
    let (mut noise, mut x) = (1_u32, 0.0);
    for k in 0..256 {
        noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let f: f64 = [3, 7, 11].iter().map(|n| (f64::from(n * k) / 64.0 * PI).sin()).sum();
        x += f64::from(noise >> 16) - 32_768.0;
        text += &format!("{},{f},{x}\n", 0.01 * f64::from(k));
    }
    fs::write(folder.path().join("a.csv"), text).unwrap();
    let told = mechid(
        folder.path(),
        "identify a.csv --force f --displacement x --period 120 --method least-squares",
    );
    let lines: Vec<&str> = told.lines().collect();
    let of = |kind: &str| -> Vec<usize> {
        (0..lines.len()).filter(|at| lines[*at].starts_with(kind)).collect()
    };
    for kind in ["  ", "note: "] {
        let at = of(kind);
        assert!(at.len() > 1, "{told}");
        assert!(at.windows(2).all(|pair| pair[1] == pair[0] + 1), "{told}");
    }
    let first = |kind: &str| of(kind)[0];
    assert!(lines[first("  ") - 1].ends_with("checks: warning"), "{told}");
    assert_eq!(lines[first("note: ") - 1], "", "{told}");
}
