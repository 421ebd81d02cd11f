//! Analyses of many records: the exit code, the folder, and a second run.

use std::fs;
use std::path::Path;

use serde_json::Value;

fn program(folder: &Path, arguments: &str) -> std::process::Output {
    let mut command = assert_cmd::Command::cargo_bin("mechid").unwrap();
    command.current_dir(folder).args(arguments.split_whitespace()).output().unwrap()
}

#[test]
fn a_record_that_fails_is_told_by_the_exit_code_and_nothing_is_computed_twice() {
    let home = tempfile::tempdir().unwrap();
    let rig = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machine.csv");
    let rig = fs::read_to_string(rig).unwrap();
    fs::create_dir(home.path().join("day")).unwrap();
    for name in ["a.csv", "b.csv", "c.csv"] {
        fs::write(home.path().join("day").join(name), format!("# {name}\n{rig}")).unwrap();
    }
    let analysis = r#"{"channels": {"force": ["force"], "displacement": ["displacement"]},
        "window": {"period": 256}}"#;
    fs::write(home.path().join("analysis.json"), analysis).unwrap();
    let run = "fleet day --analysis analysis.json --output out/results --part-records 2 --json";
    let first = program(home.path(), run);
    assert_eq!(first.status.code(), Some(0), "{}", String::from_utf8_lossy(&first.stderr));
    let report: Value = serde_json::from_slice(&first.stdout).unwrap();
    assert_eq!((&report["records"], &report["failed"]), (&3.into(), &0.into()));
    assert_eq!(fs::read_dir(home.path().join("out/results")).unwrap().count(), 2);

    let again: Value = serde_json::from_slice(&program(home.path(), run).stdout).unwrap();
    assert_eq!(again["computed_records"], 0);
    let dotted = run.replace("fleet day", "fleet ./day ././day/a.csv");
    let again: Value = serde_json::from_slice(&program(home.path(), &dotted).stdout).unwrap();
    assert_eq!((&again["records"], &again["computed_records"]), (&3.into(), &0.into()));

    fs::write(home.path().join("day/d.csv"), "").unwrap();
    let failed = program(home.path(), run);
    assert_eq!(failed.status.code(), Some(1), "{}", String::from_utf8_lossy(&failed.stderr));
    let report: Value = serde_json::from_slice(&failed.stdout).unwrap();
    assert_eq!(report["failures"][0]["code"], "io.empty");
    // The part with the records a and b is unchanged; only the part with c and the new record d is
    // computed.
    assert_eq!((&report["computed_parts"], &report["other_parts"]), (&1.into(), &1.into()));

    let trends =
        program(home.path(), "trends out/results --output page.html --plot trends.svg --json");
    assert_eq!(trends.status.code(), Some(0), "{}", String::from_utf8_lossy(&trends.stderr));
    let trends: Value = serde_json::from_slice(&trends.stdout).unwrap();
    // The folder has two versions of the second part; the newer version counts for the record c,
    // which is in both.
    assert_eq!((&trends["records"], &trends["failed"]), (&4.into(), &1.into()));
    assert_eq!(trends["superseded"], 1);
    assert_eq!(trends["series"][0]["points"].as_array().unwrap().len(), 3);
    let page = fs::read_to_string(home.path().join("page.html")).unwrap();
    assert!(
        page.contains("io.empty")
            && page.contains("damping ratio 1")
            && page.matches("<script").count() == 1
    );
    assert!(home.path().join("trends.svg").exists());
    let refused = program(home.path(), "trends day");
    assert_eq!(refused.status.code(), Some(2));

    // The rows of the last run count, even if an earlier run had computed these rows.
    let of_other =
        analysis.replace("\"window\"", "\"identify\": {\"method\": \"least-squares\"}, \"window\"");
    fs::write(home.path().join("other.json"), of_other).unwrap();
    let values = || {
        let trends = program(home.path(), "trends out/more --json");
        let trends: Value = serde_json::from_slice(&trends.stdout).unwrap();
        trends["series"][0]["points"].clone()
    };
    let run = run.replace("out/results", "out/more");
    program(home.path(), &run);
    let of_first = values();
    program(home.path(), &run.replace("analysis.json", "other.json"));
    assert_ne!(values(), of_first);
    let again: Value = serde_json::from_slice(&program(home.path(), &run).stdout).unwrap();
    assert_eq!((&again["computed_records"], values()), (&0.into(), of_first));

    // An error in the settings ends the run with exit code 2; it is not an error of a single
    // record.
    fs::write(home.path().join("analysis.json"), "{}").unwrap();
    let refused = program(home.path(), "fleet day --analysis analysis.json --output none");
    assert_eq!(refused.status.code(), Some(2));
    assert!(!home.path().join("none").exists());
}

#[test]
fn a_study_is_simulated_identified_and_shown_side_by_side() {
    let home = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| fs::write(home.path().join(name), text).unwrap();
    write(
        "rig.json",
        r#"{ "system": { "mass": 25, "damping": 188.5, "stiffness": 142122 },
             "sampling": { "samples": 256, "rate_hz": 128 },
             "excitation": { "lines": "4:60", "amplitude": 2 }, "periods": 2,
             "noise": { "displacement": { "fraction_of_rms": 0.01 }, "seed": 1 } }"#,
    );
    write(
        "analysis.json",
        r#"{ "channels": { "force": ["force"], "displacement": ["displacement"] },
             "reading": { "record_column": "run" }, "window": { "period": 256 },
             "identify": { "method": "maximum-likelihood" } }"#,
    );
    write("runs.csv", "system.mass;noise.seed\n20;1\n25;2\n30;3\n");
    let json = |arguments: &str| -> Value {
        let done = program(home.path(), arguments);
        assert_eq!(done.status.code(), Some(0), "{}", String::from_utf8_lossy(&done.stderr));
        serde_json::from_slice(&done.stdout).unwrap()
    };
    let made = json("simulate rig.json --study runs.csv --output study.parquet --json");
    assert_eq!((&made["runs"], &made["samples"]), (&3.into(), &1536.into()));
    assert_eq!(made["fields"], serde_json::json!(["system.mass", "noise.seed"]));
    json("fleet study.parquet --analysis analysis.json --output study --json");
    let trends = json("trends study --json");
    for (point, mass) in
        trends["series"][0]["points"].as_array().unwrap().iter().zip([20., 25., 30.])
    {
        let (value, error) =
            (point["value"].as_f64().unwrap(), point["standard_error"].as_f64().unwrap());
        assert!((value - mass).abs() < 4.0 * error, "{point}");
    }

    // The standard deviation over 100 seeds has a standard error of 7 %, and agrees with the
    // standard errors of the fits.
    json("simulate rig.json --runs 100 --output seeds.parquet --json");
    json("fleet seeds.parquet --analysis analysis.json --output seeds --json");
    let trends = json("trends seeds --json");
    assert_eq!(trends["records"], 100);
    for series in trends["series"].as_array().unwrap() {
        let ratio = series["spread"].as_f64().unwrap() / series["standard_error"].as_f64().unwrap();
        assert!((0.7..1.4).contains(&ratio), "{}: {ratio}", series["name"]);
    }

    for (arguments, expected) in [
        ("--runs 3 --output runs.csv", "--runs writes a Parquet file"),
        ("--study runs.csv --output other.csv", "--study writes a Parquet file"),
        ("--study rig.json --output a.parquet", "rig.json"),
        ("--study analysis.csv --output a.parquet", "cannot read analysis.csv"),
    ] {
        let refused = program(home.path(), &format!("simulate rig.json {arguments}"));
        assert_eq!(refused.status.code(), Some(2), "{arguments}");
        let message = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert!(message.contains(expected), "{arguments}: {message}");
    }
    assert!(!home.path().join("a.parquet").exists());
}

/// A record that needs too much memory and a record that needs too much time each become a row with
/// an error; the good record next to them is identified. A named pipe, a socket and a link to an
/// endless device are reported as left out.
#[cfg(target_os = "linux")]
#[test]
fn records_that_end_their_process_become_rows() {
    use std::io::Write as _;
    use std::os::unix::net::UnixListener;
    use std::process::Command;

    use flate2::Compression;
    use flate2::write::GzEncoder;

    let home = tempfile::tempdir().unwrap();
    let day = home.path().join("day");
    fs::create_dir(&day).unwrap();
    let rig = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machine.csv");
    fs::copy(rig, day.join("well.csv")).unwrap();
    let packed = |text: &str| {
        let mut member = GzEncoder::new(Vec::new(), Compression::best());
        member.write_all(text.as_bytes()).unwrap();
        member.finish().unwrap()
    };
    let header = packed("time,force,displacement\n");
    // One file takes a minute to read; another has more columns and rows than the allowed memory
    // can hold.
    let rows = packed(&"0,1,2\n".repeat(1 << 20));
    fs::write(day.join("slow.csv.gz"), [header, rows.repeat(400)].concat()).unwrap();
    let wide = format!("{}\n", ["1"; 20_000].join(","));
    let named = format!("time,force,displacement{}\n", ",x".repeat(20_000 - 3));
    fs::write(day.join("large.csv.gz"), [packed(&named), packed(&wide).repeat(8000)].concat())
        .unwrap();
    assert!(Command::new("mkfifo").arg(day.join("pipe.csv")).status().unwrap().success());
    let _socket = UnixListener::bind(day.join("socket.csv")).unwrap();
    // Only the administrator may create a device, but everyone may create a link to one.
    std::os::unix::fs::symlink("/dev/zero", day.join("device.csv")).unwrap();
    let analysis = r#"{"channels": {"force": ["force"], "displacement": ["displacement"]},
        "reading": {"limits_factor": 1000, "memory_gb": 100}, "window": {"period": 256}}"#;
    fs::write(home.path().join("analysis.json"), analysis).unwrap();
    let run = "fleet day --analysis analysis.json --output results --json --part-records 2 \
               --record-memory-gb 0.5 --record-seconds 10";
    let done = program(home.path(), run);
    assert_eq!(done.status.code(), Some(1), "{}", String::from_utf8_lossy(&done.stderr));
    let report: Value = serde_json::from_slice(&done.stdout).unwrap();
    assert_eq!((&report["records"], &report["failed"]), (&3.into(), &2.into()), "{report}");
    let code_of = |record: &str| {
        let mut failures = report["failures"].as_array().unwrap().iter();
        let failure = failures.find(|f| f["record"].as_str().unwrap().contains(record));
        failure.unwrap_or_else(|| panic!("{report}"))["code"].clone()
    };
    assert_eq!(code_of("large"), "analysis.record-memory");
    assert_eq!(code_of("slow"), "analysis.record-time");
    let left_out = report["left_out"].to_string();
    assert!(left_out.contains("pipe.csv (a named pipe)"), "{left_out}");
    assert!(left_out.contains("socket.csv (a socket)"), "{left_out}");
    assert!(left_out.contains("device.csv (a device)"), "{left_out}");
    // A second run keeps the rows and does not try the records again.
    let again: Value = serde_json::from_slice(&program(home.path(), run).stdout).unwrap();
    assert_eq!((&again["computed_records"], &again["failed"]), (&0.into(), &2.into()));
}

/// A fleet runs within a limit of the operating system (4 GB) that is lower than the default memory
/// of a record.
#[cfg(target_os = "linux")]
#[test]
fn the_memory_that_the_system_allows_is_enough_for_a_fleet() {
    let home = tempfile::tempdir().unwrap();
    let rig = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machine.csv");
    fs::copy(rig, home.path().join("a.csv")).unwrap();
    let analysis = r#"{"channels": {"force": ["force"], "displacement": ["displacement"]}}"#;
    fs::write(home.path().join("analysis.json"), analysis).unwrap();
    let line =
        "ulimit -v 4000000; exec \"$0\" fleet a.csv --analysis analysis.json --output results";
    let mut bash = std::process::Command::new("bash");
    bash.current_dir(home.path()).args(["-c", line, env!("CARGO_BIN_EXE_mechid")]);
    let done = bash.output().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
}

#[test]
fn results_among_the_records_are_refused() {
    let home = tempfile::tempdir().unwrap();
    let day = home.path().join("day");
    fs::create_dir(&day).unwrap();
    fs::write(day.join("a.csv"), "").unwrap();
    let analysis = r#"{"channels": {"force": ["force"], "displacement": ["displacement"]}}"#;
    fs::write(home.path().join("analysis.json"), analysis).unwrap();
    for records in ["day", "day/a.csv"] {
        let run = format!("fleet {records} --analysis analysis.json --output day/../day");
        let refused = program(home.path(), &run);
        assert_eq!(refused.status.code(), Some(2));
        let message = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert!(message.contains("among the records"), "{message}");
    }
    assert_eq!(fs::read_dir(&day).unwrap().count(), 1);
}

/// Two records whose names differ only in bytes that are not UTF-8 are different records.
#[cfg(target_os = "linux")]
#[test]
fn names_without_a_text_stay_apart() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt as _;

    let home = tempfile::tempdir().unwrap();
    let day = home.path().join("day");
    fs::create_dir(&day).unwrap();
    let rig = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machine.csv");
    for name in [b"a\xff.csv", b"a\xfe.csv"] {
        fs::copy(&rig, day.join(OsStr::from_bytes(name))).unwrap();
    }
    let analysis = r#"{"channels": {"force": ["force"], "displacement": ["displacement"]},
        "window": {"period": 256}}"#;
    fs::write(home.path().join("analysis.json"), analysis).unwrap();
    let done = program(home.path(), "fleet day --analysis analysis.json --output results");
    assert_eq!(done.status.code(), Some(0), "{}", String::from_utf8_lossy(&done.stderr));
    let trends: Value =
        serde_json::from_slice(&program(home.path(), "trends results --json").stdout).unwrap();
    let points = trends["series"][0]["points"].as_array().unwrap();
    let names: Vec<&str> = points.iter().map(|point| point["record"].as_str().unwrap()).collect();
    assert_eq!(names, [r"day/a\xfe.csv", r"day/a\xff.csv"]);
}
