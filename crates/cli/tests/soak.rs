//! Runs of `mechid fleet` under disturbances: a run is killed, finds the disk full, reads faulty
//! records, or writes into the same folder as another run. In the end the results are those of an
//! undisturbed run, to the last byte.
//!
//! `MECHID_SOAK_SECONDS=3600 cargo test --release -p mechid-cli --test soak` runs this for an hour;
//! the check of every change runs it for some seconds.
#![cfg(target_os = "linux")]

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// Duration of the run in seconds, unless `MECHID_SOAK_SECONDS` is set.
const SECONDS: u64 = 5;

/// Number of good records; there are two faulty ones in addition.
const RECORDS: usize = 12;

/// Pseudorandom numbers.
struct Draws(u64);

impl Draws {
    /// Returns a number below `end`.
    fn below(&mut self, end: u64) -> u64 {
        // Linear congruential generator of Numerical Recipes; only its high digits are random
        // enough.
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % end
    }
}

/// Writes the records: good ones, one that is cut short, and a file that is no record.
fn write_records(home: &Path) {
    let rig = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machine.csv");
    let rig = fs::read_to_string(rig).unwrap();
    let day = home.join("day");
    fs::create_dir(&day).unwrap();
    for record in 0..RECORDS {
        fs::write(day.join(format!("{record}.csv")), format!("# {record}\n{rig}")).unwrap();
    }
    fs::write(day.join("cut.csv"), &rig[..rig.len() / 3]).unwrap();
    fs::write(day.join("noise.bin"), b"\0\x01\x02mechid").unwrap();
    let analysis = r#"{"channels": {"force": ["force"], "displacement": ["displacement"]},
        "window": {"period": 256}}"#;
    fs::write(home.join("analysis.json"), analysis).unwrap();
}

/// Starts `mechid fleet` in a shell that first runs `before`.
fn start(home: &Path, results: &str, before: &str) -> Child {
    let run = "fleet day --analysis analysis.json --part-records 2 --workers 2 --quiet --output";
    Command::new("sh")
        .args(["-c", &format!("{before} exec \"$0\" {run} {results}")])
        .arg(assert_cmd::cargo::cargo_bin("mechid"))
        .current_dir(home)
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

/// Returns the files of a folder with their contents.
fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let files = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    files
        .map(|path| {
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            (name, fs::read(path).unwrap())
        })
        .collect()
}

/// Disturbs a run that writes into `results`.
fn disturbed(home: &Path, draws: &mut Draws) {
    let patience = draws.below(400);
    match draws.below(4) {
        // The fleet is killed at a random time.
        0 => {
            let mut fleet = start(home, "results", "");
            sleep(Duration::from_millis(patience));
            let _ = fleet.kill();
            fleet.wait().unwrap();
        }
        // The limit of zero bytes per file acts like a full disk.
        1 => {
            let status = start(home, "results", "trap '' XFSZ; ulimit -f 0;").wait().unwrap();
            assert!(matches!(status.code(), Some(1 | 2)), "{status}");
        }
        // Two fleets run at the same time, and one of them is killed.
        2 => {
            let [mut one, mut other] = [(); 2].map(|()| start(home, "results", ""));
            sleep(Duration::from_millis(patience));
            let _ = one.kill();
            one.wait().unwrap();
            assert_eq!(other.wait().unwrap().code(), Some(1));
        }
        // With little memory, the results have a row for some records only, or for none; so this
        // run writes into a separate folder.
        _ => {
            let kilobytes = 60_000 + 1000 * draws.below(100);
            let limit = format!("ulimit -v {kilobytes};");
            start(home, "little", &limit).wait().unwrap();
            let _ = fs::remove_dir_all(home.join("little"));
        }
    }
}

#[test]
fn what_disturbs_a_fleet_leaves_nothing_half_doubled_or_different() {
    let seconds = std::env::var("MECHID_SOAK_SECONDS").ok().and_then(|text| text.parse().ok());
    let end = Instant::now() + Duration::from_secs(seconds.unwrap_or(SECONDS));
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    write_records(home);
    assert_eq!(start(home, "undisturbed", "").wait().unwrap().code(), Some(1));
    let expected = contents(&home.join("undisturbed"));
    assert_eq!(expected.len(), (RECORDS + 2) / 2);
    let (mut draws, mut rounds) = (Draws(1998), 0);
    while rounds == 0 || Instant::now() < end {
        (0..1 + draws.below(5)).for_each(|_| disturbed(home, &mut draws));
        assert_eq!(start(home, "results", "").wait().unwrap().code(), Some(1));
        let mut found = contents(&home.join("results"));
        // A file that was being written when a run of `mechid fleet` was killed has a hidden name;
        // a later run removes it.
        found.retain(|name, _| !name.starts_with('.'));
        assert_eq!(found.keys().collect::<Vec<_>>(), expected.keys().collect::<Vec<_>>());
        assert!(found == expected, "the rows differ, round {rounds}");
        fs::remove_dir_all(home.join("results")).unwrap();
        rounds += 1;
    }
    assert!(rounds > 0);
}
