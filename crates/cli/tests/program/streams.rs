//! Standard input and output in place of files, tested with the pipes of a real shell.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use super::{mechid, refused};

const EXAMPLES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples");

/// Runs a shell line in a folder with the examples; the command `mechid` in this line starts the
/// program under test.
fn shell(folder: &Path, line: &str) -> Output {
    for file in ["machine.csv", "machine.json"] {
        fs::copy(Path::new(EXAMPLES).join(file), folder.join(file)).unwrap();
    }
    let program = Path::new(env!("CARGO_BIN_EXE_mechid")).parent().unwrap();
    let path = format!("{}:{}", program.display(), std::env::var("PATH").unwrap());
    let line = format!("set -o pipefail; {line}");
    let mut bash = Command::new("bash");
    bash.current_dir(folder).env("PATH", path).args(["-c", &line]).output().unwrap()
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

const FORCE: &str = "mechid force machine.csv --system machine.json --displacement displacement \
                     --period 256";

/// If the output file is standard output, the report goes to standard error, so that standard
/// output has only the file.
#[test]
fn an_output_to_standard_output_is_alone_there() {
    let folder = tempfile::tempdir().unwrap();
    for line in [
        FORCE,
        "mechid simulate machine.json",
        "mechid multisine --samples 64 --rate 64 --amplitude 1",
        "mechid frf machine.csv --force force --displacement displacement --period 256",
        "mechid report machine.csv --force force --displacement displacement --period 256",
    ] {
        let file = if line.starts_with("mechid report") { "named.html" } else { "named.csv" };
        let named = shell(folder.path(), &format!("{line} --output {file}"));
        assert!(named.status.success(), "{line}: {}", text(&named.stderr));
        let expected = fs::read_to_string(folder.path().join(file)).unwrap();
        for name in ["-", "/dev/stdout"] {
            let piped = shell(folder.path(), &format!("{line} --output {name} | cat"));
            assert!(piped.status.success(), "{line}");
            // A page shows the command that made it.
            assert_eq!(
                text(&piped.stdout)
                    .replace(&format!("--output {name}"), &format!("--output {file}")),
                expected,
                "{line}"
            );
            let report = text(&piped.stderr).replace("standard output", file);
            assert_eq!(report, text(&named.stdout), "{line}");
        }
    }
}

/// If the reader of a pipe stops after three lines of a longer output, the program ends with exit
/// code 141 and no error.
#[test]
fn a_reader_may_have_seen_enough() {
    let folder = tempfile::tempdir().unwrap();
    let line =
        "mechid multisine --samples 64 --rate 64 --amplitude 1 --periods 2000 -o - | head -3";
    let piped = shell(folder.path(), line);
    assert_eq!(piped.status.code(), Some(141), "{}", text(&piped.stderr));
    let lines: Vec<&str> = text(&piped.stdout).lines().collect();
    assert_eq!((lines[0], lines.len()), ("time,force", 3));
    assert!(lines[1].starts_with("0.0,") && lines[2].starts_with("0.015625,"), "{lines:?}");
    let closed = shell(folder.path(), &format!("{line} > /dev/null; exit ${{PIPESTATUS[0]}}"));
    assert_eq!(closed.status.code(), Some(141), "{}", text(&closed.stderr));
}

/// If `>>` redirects standard output to a file, the output `/dev/stdout` is appended and the
/// existing content of the file is kept.
#[test]
fn a_redirected_output_is_written_where_the_shell_says() {
    let folder = tempfile::tempdir().unwrap();
    let line = "mechid multisine --samples 8 --rate 8 --amplitude 1 -q -o";
    shell(folder.path(), &format!("{line} named.csv; echo above > all.csv"));
    let named = fs::read_to_string(folder.path().join("named.csv")).unwrap();
    shell(folder.path(), &format!("{line} /dev/stdout >> all.csv"));
    let all = fs::read_to_string(folder.path().join("all.csv")).unwrap();
    assert_eq!(all, format!("above\n{named}"));
}

#[test]
fn standard_output_takes_one_thing() {
    let folder = tempfile::tempdir().unwrap();
    let design = "multisine --samples 64 --rate 64 --amplitude 1 --output";
    for name in ["-", "/dev/stdout"] {
        let message = refused(folder.path(), &format!("{design} {name} --json"));
        assert_eq!(
            message,
            "error: only one output can go to standard output, not 1 file and the report: write to named \
             files, or leave --json out\n"
        );
    }
    let both = shell(folder.path(), &format!("{FORCE} --output - --spectrum /dev/stdout"));
    assert_eq!((both.status.code(), text(&both.stdout)), (Some(2), ""));
    assert!(text(&both.stderr).contains("not 2 files: name the others"), "{}", text(&both.stderr));
}

#[test]
fn a_record_may_come_from_standard_input() {
    let folder = tempfile::tempdir().unwrap();
    let roles = "--force force --displacement displacement --period 256";
    for line in [
        "info RECORD".into(),
        format!("identify RECORD {roles}"),
        format!("frf RECORD {roles}"),
        format!("sweep RECORD {roles} --decimate 1,2 --estimator least-squares"),
        "force RECORD --system machine.json --displacement displacement --period 256".into(),
    ] {
        let named =
            shell(folder.path(), &format!("mechid {}", line.replace("RECORD", "machine.csv")));
        let piped = line.replace("RECORD", "-");
        let packed = shell(folder.path(), &format!("gzip -c machine.csv | mechid {piped}"));
        let piped = shell(folder.path(), &format!("cat machine.csv | mechid {piped}"));
        assert!(piped.status.success(), "{line}: {}", text(&piped.stderr));
        let told = |output: &Output| text(&output.stdout).replace("standard input", "machine.csv");
        assert_eq!(told(&piped), text(&named.stdout), "{line}");
        assert_eq!(told(&packed).replace(", in gzip", ""), text(&named.stdout), "{line}");
    }
    let ragged = shell(folder.path(), "printf 't,x\\n0,1\\n1\\n' | mechid info -");
    assert_eq!(
        text(&ragged.stderr),
        "error: standard input, line 3: this line has 1 field, but the first line has 2\n"
    );
    // The path `./-` means a file with the name `-`, not standard input.
    fs::write(folder.path().join("-"), "t,x\n0,1\n1,2\n").unwrap();
    assert!(mechid(folder.path(), "info ./-").starts_with("./-: "));
}

/// One command passes an identified machine, with the covariance of its parameters, to the standard
/// input of the next command.
#[test]
fn a_description_may_come_from_standard_input() {
    let folder = tempfile::tempdir().unwrap();
    let identify = "mechid identify machine.csv --force force --displacement displacement \
                    --period 256 --json";
    shell(folder.path(), &format!("{identify} > found.json"));
    for line in [
        "mechid modes FILE",
        "mechid force machine.csv --system FILE --displacement 3 --period 256",
    ] {
        let named = shell(folder.path(), &line.replace("FILE", "found.json"));
        let piped = shell(folder.path(), &format!("{identify} | {}", line.replace("FILE", "-")));
        assert!(piped.status.success(), "{line}: {}", text(&piped.stderr));
        let told = text(&piped.stdout).replace("standard input", "found.json");
        assert_eq!(told, text(&named.stdout), "{line}");
    }
    let simulated =
        shell(folder.path(), "mechid simulate - -q -o - < machine.json | cmp - machine.csv");
    assert!(simulated.status.success(), "{}", text(&simulated.stderr));
}

/// An output that is also an input is refused for every path to it, and the input is unchanged.
#[test]
fn an_output_that_is_an_input_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    shell(
        folder,
        "ln -s machine.csv link.csv; ln machine.csv hard.csv; ln -s machine.json to.json",
    );
    let record = fs::read(folder.join("machine.csv")).unwrap();
    let frf = "mechid frf machine.csv --force force --displacement displacement --period 256";
    let page = "mechid report ./machine.csv --force force --displacement displacement";
    for line in [
        format!("{FORCE} --output machine.csv"),
        format!("{FORCE} --output ./link.csv"),
        format!("{FORCE} --spectrum hard.csv"),
        format!("{FORCE} --output machine.json"),
        format!("{frf} --output machine.csv"),
        "mechid simulate machine.json --output to.json".to_owned(),
        format!("mv machine.csv a.html; {} --output a.html", page.replace("machine.csv", "a.html")),
    ] {
        let run = shell(folder, &line);
        assert_eq!(run.status.code(), Some(2), "{line}: {}", text(&run.stderr));
        assert!(text(&run.stderr).contains("input"), "{line}: {}", text(&run.stderr));
        let kept = fs::read(folder.join("hard.csv")).unwrap();
        assert!(kept == record, "{line}");
    }
}

/// If the output cannot be written, the program fails without a panic.
#[test]
fn a_full_stream_is_told_by_the_exit_code() {
    let folder = tempfile::tempdir().unwrap();
    let info = "mechid info machine.csv";
    for (line, code) in [
        (format!("{info} > /dev/full"), 2),
        (format!("{info} --json > /dev/full"), 2),
        ("mechid --help > /dev/full".to_owned(), 2),
        ("mechid --version > /dev/full".to_owned(), 2),
        ("mechid info nowhere.csv 2> /dev/full".to_owned(), 2),
        ("mechid info --nonsense 2> /dev/full".to_owned(), 2),
        ("mechid info nowhere.csv 2>&-".to_owned(), 2),
        // A stream that is closed at the start is replaced by the null device, see SECURITY.md.
        (format!("{info} >&-"), 0),
        (
            "mechid multisine --samples 8 --rate 8 --amplitude 1 -o a.csv >&- && test -s a.csv"
                .to_owned(),
            0,
        ),
        (format!("{info} | true; exit ${{PIPESTATUS[0]}}"), 141),
        ("mechid identify --help | head -1; exit ${PIPESTATUS[0]}".to_owned(), 141),
    ] {
        let run = shell(folder.path(), &line);
        // If the program has written the whole report before the reader closes the pipe, the exit
        // code is 0 instead of 141.
        let piped = code == 141 && run.status.code() == Some(0);
        assert!(piped || run.status.code() == Some(code), "{line}: {:?}", run.status);
        assert!(!text(&run.stderr).contains("panicked"), "{line}");
    }
}

/// Control characters in names from a file are escaped before they reach a terminal.
#[test]
fn names_that_a_terminal_would_obey_are_written_out() {
    let folder = tempfile::tempdir().unwrap();
    let table = "t,\u{1b}[2Jforce,x\u{202e}y\n0,1,2\n1,2,3\n2,1,2\n3,2,3\n";
    fs::write(folder.path().join("odd.csv"), table).unwrap();
    for line in ["mechid info odd.csv", "mechid info odd.csv --json", "mechid identify odd.csv"] {
        let run = shell(folder.path(), line);
        let told = format!("{}{}", text(&run.stdout), text(&run.stderr));
        assert!(!told.contains('\u{1b}') && !told.contains('\u{202e}'), "{line}: {told:?}");
    }
}

/// A signal ends the program as usual, and no unfinished file remains.
#[test]
fn a_signal_leaves_no_unfinished_file() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(
        folder.path().join("long.json"),
        r#"{ "system": { "mass": [[25]], "damping": [[3]], "stiffness": [[1000]] },
             "sampling": { "samples": 7500000, "rate_hz": 1000 }, "scheme": { "name": "newmark" },
             "excitation": [{ "kind": "harmonic", "dof": 1, "amplitude": 1, "frequency_hz": 4 }] }"#,
    )
    .unwrap();
    for (signal, code) in [("INT", 130), ("TERM", 143)] {
        let line = format!(
            "timeout --preserve-status --signal {signal} 0.5 \
             mechid simulate long.json --output long.csv"
        );
        let ended = shell(folder.path(), &line);
        assert_eq!(ended.status.code(), Some(code), "{signal}: {}", text(&ended.stderr));
        let mut left: Vec<_> =
            fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
        left.sort();
        assert_eq!(left, ["long.json", "machine.csv", "machine.json"]);
    }
}
