//! Input that would need too much memory or time is refused with a message. In these tests the
//! operating system limits the memory of the process, and each run must end within a maximum time.
#![cfg(target_os = "linux")]

use std::f64::consts::PI;
use std::fs;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Output};
use std::time::{Duration, Instant};

use flate2::Compression;
use flate2::write::{GzEncoder, ZlibEncoder};

/// Memory that the program gets, in kB: the memory allowed for a file of 1 MB, plus the program and
/// its stacks.
const MEMORY_KB: usize = 1_000_000;

/// Time within which the program must end. Other tests run at the same time, without optimisation.
const PATIENCE: Duration = Duration::from_secs(30);

/// Runs the program under the limits.
fn limited(folder: &Path, arguments: &str) -> Output {
    let begun = Instant::now();
    let program = assert_cmd::cargo::cargo_bin("mechid");
    let script = format!("ulimit -v {MEMORY_KB} && exec \"$0\" {arguments}");
    let output = Command::new("sh")
        .args(["-c", &script])
        .arg(program)
        .current_dir(folder)
        .env("MALLOC_ARENA_MAX", "2")
        .output()
        .unwrap();
    assert!(begun.elapsed() < PATIENCE, "{arguments}: {:?}", begun.elapsed());
    output
}

/// Runs the program, which must refuse the file because of the limit on memory and name the option.
fn refused(folder: &Path, arguments: &str) {
    let output = limited(folder, arguments);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{arguments}: {message}");
    assert!(message.contains("--memory-gb"), "{arguments}: {message}");
}

/// Returns a MATLAB file with one vector `v` of `len` zero bytes.
fn matlab(len: u32) -> Vec<u8> {
    let mut packed = ZlibEncoder::new(Vec::new(), Compression::best());
    let words = [14, 56 + len.next_multiple_of(8), 6, 8, 9, 0, 5, 8, len, 1, 1, 1];
    packed.write_all(&words.map(u32::to_le_bytes).concat()).unwrap();
    packed.write_all(b"v\0\0\0\0\0\0\0").unwrap();
    packed.write_all(&[2, len].map(u32::to_le_bytes).concat()).unwrap();
    let zeros = vec![0; 1 << 20];
    let mut left = len.next_multiple_of(8) as usize;
    while left > 0 {
        let some = left.min(zeros.len());
        packed.write_all(&zeros[..some]).unwrap();
        left -= some;
    }
    let packed = packed.finish().unwrap();
    let mut file = b"MATLAB 5.0 MAT-file".to_vec();
    file.resize(124, b' ');
    file.extend(b"\x00\x01IM");
    file.extend([15_u32, packed.len() as u32].map(u32::to_le_bytes).concat());
    file.extend(packed);
    file
}

#[test]
fn a_small_file_of_many_numbers_is_refused_before_they_are_held() {
    let home = tempfile::tempdir().unwrap();
    // The compressed file contains 250 million values of one byte, which need 2 GB as numbers of
    // eight bytes.
    let file = matlab(250_000_000);
    assert!(file.len() < 300_000, "{}", file.len());
    fs::write(home.path().join("a.mat"), file).unwrap();
    refused(home.path(), "info a.mat");
    refused(home.path(), "identify a.mat --force v --displacement v --sample-rate 1");
    // A record that can be read may still be too large to analyse.
    fs::write(home.path().join("b.mat"), matlab(6_000_000)).unwrap();
    refused(home.path(), "info b.mat");
    let machine = r#"{"system": {"mass": 25, "damping": 188.5, "stiffness": 142122}}"#;
    fs::write(home.path().join("m.json"), machine).unwrap();
    refused(home.path(), "predict m.json b.mat --force v --sample-rate 1000");
    let allowed = limited(home.path(), "info b.mat --memory-gb 1 --quiet");
    assert_eq!(allowed.status.code(), Some(0), "{}", String::from_utf8_lossy(&allowed.stderr));
}

/// Returns a record with this number of forces and displacements, all of them noise, and the names
/// of its columns.
fn wide_record(channels: usize, samples: usize) -> (String, String) {
    let names =
        |kind: &str| (1..=channels).map(|at| format!("{kind}{at}")).collect::<Vec<_>>().join(",");
    let mut text = format!("time,{},{}\n", names("f"), names("x"));
    let mut state = 1_u64;
    for row in 0..samples {
        text += &format!("{}", row as f64 / 256.0);
        for _ in 0..2 * channels {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            text += &format!(",{}", (state >> 40) as f64 / 1e7 - 0.8);
        }
        text.push('\n');
    }
    (text, format!("--force {} --displacement {}", names("f"), names("x")))
}

#[test]
fn more_unknowns_than_equations_are_refused_before_any_work() {
    let home = tempfile::tempdir().unwrap();
    let (text, columns) = wide_record(500, 300);
    fs::write(home.path().join("a.csv"), text).unwrap();
    for more in ["", "--period 100", "--extent open", "--domain time --derivatives spectral"] {
        let output = limited(home.path(), &format!("identify a.csv {columns} {more}"));
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{more}: {message}");
        assert!(message.contains("equations do not determine 1500 unknowns"), "{more}: {message}");
    }
    refused(home.path(), &format!("frf a.csv {columns}"));
    // A fit with transients needs 1100 bytes for each of the 300,000 numbers in this small file.
    let mut packed = GzEncoder::new(Vec::new(), Compression::best());
    packed.write_all(b"force,displacement\n").unwrap();
    (0..150_000).for_each(|row| writeln!(packed, "{},{}", row % 7, row % 5).unwrap());
    fs::write(home.path().join("b.csv.gz"), packed.finish().unwrap()).unwrap();
    for more in ["", "--extent open"] {
        let columns = "--force force --displacement displacement --sample-rate 1000";
        refused(home.path(), &format!("identify b.csv.gz {columns} {more}"));
    }
}

/// Returns a table of the accelerances of a uniform chain with fixed ends, at all points to a force
/// at the first point, with noise; all its modes lie below 40 Hz.
fn chain_table(points: usize, lines: usize) -> String {
    let names = |at| format!("h_{at}_1_real,h_{at}_1_imaginary");
    let names: Vec<String> = (1..=points).map(names).collect();
    let mut text = format!("frequency_hz,time_derivative,{}\n", names.join(","));
    let mut state = 1_u64;
    let mut noise = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (state >> 40) as f64 / f64::from(1 << 24) - 0.5
    };
    let angle = |mode: usize| PI * mode as f64 / (points + 1) as f64;
    for line in 1..=lines {
        let hz = 45.0 * line as f64 / lines as f64;
        text += &format!("{hz},2");
        for point in 1..=points {
            let of_mode = |mode: usize| {
                let own = 40.0 * (angle(mode) / 2.0).sin();
                let (real, imaginary) = (own * own - hz * hz, 0.02 * own * hz);
                let gain = (angle(mode) * point as f64).sin() * angle(mode).sin() * hz * hz
                    / real.hypot(imaginary).powi(2);
                [-gain * real, gain * imaginary]
            };
            let parts = (1..=points).map(of_mode).fold([0.0; 2], |[a, b], [c, d]| [a + c, b + d]);
            text += &format!(",{:.4},{:.4}", parts[0] + noise(), parts[1] + noise());
        }
        text.push('\n');
    }
    text
}

/// A table that needs more memory than allowed is refused. An earlier version had no limit for
/// tables: the modes of 60 points and three forces took 1.9 GB.
#[test]
fn a_table_of_many_points_is_refused_before_any_work() {
    let home = tempfile::tempdir().unwrap();
    let run = |arguments: &str| {
        let allowed = limited(home.path(), arguments);
        assert!(allowed.status.success(), "{}", String::from_utf8_lossy(&allowed.stderr));
    };
    fs::write(home.path().join("many.csv"), chain_table(60, 300)).unwrap();
    refused(home.path(), "identify many.csv --frf-table");
    refused(home.path(), "modes many.csv --memory-gb 0.05");
    run("modes many.csv");
    fs::write(home.path().join("few.csv"), chain_table(2, 200)).unwrap();
    for command in ["identify few.csv --frf-table", "modes few.csv"] {
        refused(home.path(), &format!("{command} --memory-gb 0.001"));
        run(&format!("{command} --memory-gb 0.004"));
    }
}

#[test]
fn a_description_of_a_long_record_is_refused_before_any_work() {
    let home = tempfile::tempdir().unwrap();
    for (samples, periods, response) in
        [(100_000_000, 1, "from-rest"), (1000, 20_000, "periodic"), (10, 1_u64 << 50, "from-rest")]
    {
        let description = format!(
            r#"{{"system": {{"mass": 25, "damping": 188.5, "stiffness": 142122}},
                "sampling": {{"samples": {samples}, "rate_hz": 128}}, "periods": {periods},
                "excitation": {{"kind": "harmonic", "amplitude": 1, "frequency_hz": 12.8}},
                "scheme": {{"name": "newmark"}}, "response": "{response}"}}"#
        );
        fs::write(home.path().join("long.json"), description).unwrap();
        refused(home.path(), "simulate long.json --output a.csv");
    }
    let simulate = "simulate long.json --output a.csv --quiet --memory-gb";
    let description = fs::read_to_string(home.path().join("long.json")).unwrap();
    let shorter = description.replace(&(1_u64 << 50).to_string(), "100");
    fs::write(home.path().join("long.json"), shorter).unwrap();
    // The simulation needs 128 bytes for each of the 1000 samples.
    refused(home.path(), &format!("{simulate} 0.00012"));
    let allowed = limited(home.path(), &format!("{simulate} 0.00013"));
    assert_eq!(allowed.status.code(), Some(0), "{}", String::from_utf8_lossy(&allowed.stderr));
}

#[test]
fn a_message_about_a_long_text_is_short() {
    let home = tempfile::tempdir().unwrap();
    let terms: Vec<String> = (1..200_000).map(|at| format!("k{at}: x1^3")).collect();
    let machine = format!(
        r#"{{"system": {{"mass": 1, "damping": 1, "stiffness": 1}}, "nonlinear": "{}"}}"#,
        terms.join(", ")
    );
    fs::write(home.path().join("m.json"), machine).unwrap();
    let output = limited(home.path(), "simulate m.json --output a.csv");
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{}", message.len());
    assert!(message.len() < 2000 && message.contains("invalid type"), "{message}");
}

#[test]
fn a_matrix_of_comments_in_gzip_is_refused() {
    let home = tempfile::tempdir().unwrap();
    let mut packed = GzEncoder::new(Vec::new(), Compression::best());
    packed.write_all(b"%%MatrixMarket matrix coordinate real general\n").unwrap();
    let comments = b"%\n".repeat(1 << 20);
    (0..60).for_each(|_| packed.write_all(&comments).unwrap());
    fs::write(home.path().join("k.mtx.gz"), packed.finish().unwrap()).unwrap();
    let machine = r#"{"system": {"mass": "k.mtx.gz", "damping": "k.mtx.gz", "stiffness": "k.mtx.gz"},
        "sampling": {"rate_hz": 100, "samples": 10}, "excitation": {"lines": "1:4", "amplitude": 2}}"#;
    fs::write(home.path().join("m.json"), machine).unwrap();
    let output = limited(home.path(), "simulate m.json --output a.csv");
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains("k.mtx.gz") && message.contains("bytes"), "{message}");
}

#[test]
fn a_text_that_repeats_itself_in_gzip_is_refused() {
    let home = tempfile::tempdir().unwrap();
    let mut member = GzEncoder::new(Vec::new(), Compression::best());
    let rows = "0.125,1\n".repeat(1 << 17);
    (0..8).for_each(|_| member.write_all(rows.as_bytes()).unwrap());
    let member = member.finish().unwrap();
    let file = member.repeat((1 << 20) / member.len());
    fs::write(home.path().join("a.csv.gz"), file).unwrap();
    let output = limited(home.path(), "info a.csv.gz");
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains("the compressed data are longer than"), "{message}");
}

/// Nonlinear terms are refused quickly if the data do not determine their coefficients. The terms
/// are one argument of 87 kB; an argument of a command line has at most 128 kB.
#[test]
fn many_nonlinear_terms_are_refused_before_any_work() {
    let home = tempfile::tempdir().unwrap();
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machine.csv");
    fs::copy(example, home.path().join("a.csv")).unwrap();
    let terms: Vec<String> = (0..8000).map(|at| format!("k{at}:x1^3")).collect();
    let begun = Instant::now();
    let line = "identify a.csv --force force --displacement displacement";
    let output =
        limited(home.path(), &format!("{line} --period 256 --nonlinear {}", terms.join(",")));
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains("equations do not determine 8003 unknowns"), "{message}");
    assert!(begun.elapsed() < PATIENCE);
}

/// The white noise of the response has nothing to do with the force, so the searches find no
/// machine. With little memory, the limit of the work ends them, and the message names this limit;
/// a long time limit replaces it, and no message names a limit.
#[test]
fn a_search_ends_at_the_limit_of_its_work() {
    let home = tempfile::tempdir().unwrap();
    let mut state = 1_u64;
    let mut noise = || {
        // Linear congruential generator of Knuth's MMIX.
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f64 / f64::from(1 << 24) - 0.5
    };
    let mut rows = String::from("time,f,y1,y2\n");
    for row in 0..1500 {
        let [f, y1, y2] = [noise(), noise(), noise()];
        rows.push_str(&format!("{},{f:.5},{y1:.5},{y2:.5}\n", f64::from(row) * 0.01));
    }
    fs::write(home.path().join("noise.csv"), rows).unwrap();
    let of = "identify noise.csv --force f,0 --displacement y1,y2 --json";
    let text = |arguments: &str| {
        let output = limited(home.path(), arguments);
        let [out, err] = [output.stdout, output.stderr].map(|o| String::from_utf8(o).unwrap());
        out + &err
    };
    let ended = "reached the limit of the work for a file of this size";
    let limited = text(&format!("{of} --memory-gb 0.006"));
    assert!(limited.contains(ended), "{limited}");
    assert_eq!(limited, text(&format!("{of} --memory-gb 0.006")));
    let whole = text(&format!("{of} --memory-gb 0.006 --time-limit 1000"));
    assert!(!whole.contains(ended) && !whole.contains("time limit of"), "{whole}");
}
