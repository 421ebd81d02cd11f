//! A record gives the same result in every format.

use std::fs;
use std::io::Write as _;
use std::path::Path;

use flate2::Compression;
use flate2::write::{GzEncoder, ZlibEncoder};
use mechid::io::{Table, TimeAxis};
use mechid::signal::Sampling;

use super::{mechid, refused};

const COLUMNS: [&str; 2] = ["force", "displacement"];

/// Writes the example record as text, as a MATLAB file with and without compression, as a universal
/// file, and as gzip; returns the folder and the names of the files.
fn records() -> (tempfile::TempDir, [&'static str; 6]) {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machine.csv");
    let record = Table::read(&source).unwrap();
    let record = record.record(&TimeAxis::Column("time"), &COLUMNS).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| fs::write(folder.path().join(name), bytes).unwrap();
    let columns: Vec<(String, &[f64])> =
        (0..2).map(|c| (COLUMNS[c].into(), record.channel(c))).collect();
    let text = mechid::io::csv_text(record.sampling(), &columns);
    let times: Vec<f64> = record.sampling().times().collect();
    let mut all = vec![("time".to_string(), &times[..])];
    all.extend(columns.clone());
    let functions: Vec<u8> =
        (1..).zip(&columns).flat_map(|(n, c)| function(n, record.sampling().dt(), c.1)).collect();
    let mut gzip = GzEncoder::new(Vec::new(), Compression::fast());
    gzip.write_all(text.as_bytes()).unwrap();
    write("rec.csv", text.as_bytes());
    write("rec.csv.gz", &gzip.finish().unwrap());
    write("plain.mat", &matlab(&all, false));
    write("packed.mat", &matlab(&all, true));
    write("rec.unv", &functions);
    let mut gzip = GzEncoder::new(Vec::new(), Compression::fast());
    gzip.write_all(&functions).unwrap();
    write("rec.unv.gz", &gzip.finish().unwrap());
    (folder, ["rec.csv", "rec.csv.gz", "plain.mat", "packed.mat", "rec.unv", "rec.unv.gz"])
}

/// Returns columns of doubles as a MATLAB file of level 5.
pub fn matlab(columns: &[(String, &[f64])], packed: bool) -> Vec<u8> {
    let mut file = b"MATLAB 5.0 MAT-file, by hand".to_vec();
    file.resize(124, b' ');
    file.extend(b"\x00\x01IM");
    let element = |kind: u32, data: &[u8]| {
        let len = u32::try_from(data.len()).unwrap();
        let mut bytes = [kind.to_le_bytes(), len.to_le_bytes()].concat();
        bytes.extend(data);
        bytes
    };
    let padded = |kind: u32, data: &[u8]| {
        let mut bytes = element(kind, data);
        bytes.resize(bytes.len().next_multiple_of(8), 0);
        bytes
    };
    let words = |words: [u32; 2]| words.map(u32::to_le_bytes).concat();
    for (name, values) in columns {
        let numbers: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let size = [u32::try_from(values.len()).unwrap(), 1];
        let parts = [
            padded(6, &words([6, 0])),
            padded(5, &words(size)),
            padded(1, name.as_bytes()),
            padded(9, &numbers),
        ];
        let variable = element(14, &parts.concat());
        if packed {
            let mut zlib = ZlibEncoder::new(Vec::new(), Compression::fast());
            zlib.write_all(&variable).unwrap();
            file.extend(element(15, &zlib.finish().unwrap()));
        } else {
            file.extend(variable);
        }
    }
    file
}

/// Returns a response over time at a node in direction +Z, as a binary dataset 58.
fn function(node: u32, dt: f64, values: &[f64]) -> Vec<u8> {
    let len = values.len();
    let mut text = format!("    -1\n    58b     1     2          11{:12}     0     0\n", 8 * len);
    text += &"NONE\n".repeat(5);
    text += &format!(
        "    1         0    0         0       NONE{node:10}   3       NONE         0   0\n"
    );
    text +=
        &format!("         4{len:10}         1  0.00000E+00{:>13}  0.00000E+00\n", exponent(dt));
    text += &"         0    0    0    0 NONE                 NONE\n".repeat(4);
    let mut bytes = text.into_bytes();
    bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
    bytes.extend(b"    -1\n");
    bytes
}

/// Formats a number as Fortran's E13.5 does.
fn exponent(value: f64) -> String {
    let text = format!("{value:.5E}");
    let (mantissa, power) = text.split_once('E').unwrap();
    format!("{mantissa}E{:+03}", power.parse::<i32>().unwrap())
}

fn columns_of(file: &str) -> (&'static str, &'static str) {
    if file.contains("unv") { ("1+Z", "2+Z") } else { ("force", "displacement") }
}

#[test]
fn identify_finds_the_same_machine_in_every_format() {
    let (folder, files) = records();
    let report = |file: &str| {
        let (force, motion) = columns_of(file);
        let arguments = format!("--force {force} --displacement {motion} --period 256 --json");
        let told = mechid(folder.path(), &format!("identify {file} {arguments}"));
        let told = told.replace(&format!("residual 1 with {force}:"), "residual 1 with f:");
        let mut told: serde_json::Value = serde_json::from_str(&told.replace(file, "rec")).unwrap();
        // The report has the column names of the file.
        assert_eq!(told["channels"]["force"][0], force);
        told.as_object_mut().unwrap().remove("channels");
        told
    };
    let first = report(files[0]);
    for file in files {
        assert_eq!(report(file), first, "{file}");
    }
}

#[test]
fn force_finds_the_same_force_in_every_format() {
    let (folder, files) = records();
    let arguments = "identify rec.csv --force force --displacement displacement --period 256";
    let machine = mechid(folder.path(), &format!("{arguments} --json"));
    fs::write(folder.path().join("machine.json"), machine).unwrap();
    let report = |file: &str| {
        let motion = columns_of(file).1;
        let arguments =
            format!("--system machine.json --displacement {motion} --period 256 --json");
        let told = mechid(folder.path(), &format!("force {file} {arguments}"));
        // Each format has its own name for the column, which the report repeats.
        let column = format!("\"column\": \"{motion}\"");
        assert!(told.contains(&column), "{told}");
        told.replace(file, "rec").replace(&column, "")
    };
    let first = report(files[0]);
    for file in files {
        assert_eq!(report(file), first, "{file}");
    }
}

#[test]
fn a_machine_with_an_undetermined_parameter_is_refused_by_its_name() {
    let (folder, _) = records();
    let arguments = "identify rec.csv --force force --displacement displacement --period 256";
    let machine = mechid(folder.path(), &format!("{arguments} --json"));
    let mut machine: serde_json::Value = serde_json::from_str(&machine).unwrap();
    assert_eq!(machine["covariance"]["parameters"][1], "c");
    machine["covariance"]["matrix"][1][1] = serde_json::Value::Null;
    fs::write(folder.path().join("machine.json"), machine.to_string()).unwrap();
    let arguments = "force rec.csv --system machine.json --displacement displacement --period 256";
    let message = refused(folder.path(), arguments);
    let part = "error: machine.json: the covariance of c is not known (null), because the record";
    assert!(message.starts_with(part), "{message}");
}

#[test]
fn a_universal_file_needs_no_rate_and_bears_no_other() {
    let (folder, _) = records();
    let common = "identify rec.unv --force 1+Z --displacement 2+Z --period 256";
    let message = refused(folder.path(), &format!("{common} --sample-rate 100"));
    assert!(
        message.contains("the sample rate 100 Hz contradicts rec.unv: column 1 \"1+Z\" has 128 Hz"),
        "{message}"
    );
    assert_eq!(
        mechid(folder.path(), &format!("{common} --sample-rate 128")),
        mechid(folder.path(), common)
    );
}

#[test]
fn a_window_counts_the_samples_of_its_columns() {
    let (folder, _) = records();
    let message = refused(
        folder.path(),
        "identify plain.mat --force force --displacement displacement --start 500 --period 256",
    );
    assert!(message.contains("samples 500 to 755") && message.contains("has 512"), "{message}");
}

#[test]
fn limits_on_memory_can_be_raised() {
    let folder = tempfile::tempdir().unwrap();
    let columns = mechid::io::Limits::DEFAULT.columns + 1;
    let row = |value: &str| format!("{}\n", vec![value; columns].join(","));
    fs::write(folder.path().join("wide.csv"), row("0") + &row("1") + &row("0")).unwrap();
    let told = refused(folder.path(), "info wide.csv --sample-rate 10 --columns 1,2");
    assert!(told.contains("more than 65536 columns") && told.contains("--raise-limits"), "{told}");
    let told =
        mechid(folder.path(), "info wide.csv --sample-rate 10 --columns 1,2 --raise-limits 2");
    assert!(told.contains("3 samples"), "{told}");
}

/// A logger that is stopped early leaves the rest of its file empty; a remark names the empty part.
#[test]
fn what_was_left_out_of_a_file_is_told() {
    let (folder, _) = records();
    let mut bytes = fs::read(folder.path().join("rec.csv")).unwrap();
    bytes.resize(bytes.len() + 4096, 0);
    fs::write(folder.path().join("reserved.csv"), bytes).unwrap();
    for command in ["info reserved.csv", "identify reserved.csv --force force --displacement 3"] {
        let told = mechid(folder.path(), command);
        assert!(told.contains("4096 zero bytes after the last line"), "{command}: {told}");
    }
}

/// Frequency responses to two forces are the same with one and with two sensors. A comment with two
/// names above five columns is not used as a header, and a note says so.
#[test]
fn frequency_responses_take_any_numbers_of_forces_and_responses() {
    let folder = tempfile::tempdir().unwrap();
    let noise = |seed: u64| {
        let sampling = Sampling::new(0.01, 2048).unwrap();
        mechid::signal::noise::white(sampling, 1, 1.0, seed).unwrap().channel(0).to_vec()
    };
    let (f, g) = (noise(1), noise(2));
    let mut text = String::from("# time, force\n");
    for k in 0..f.len() {
        let before = if k > 0 { g[k - 1] } else { 0.0 };
        let [x, y] = [2.0 * f[k] - before, f[k] + 3.0 * before];
        text += &format!("{:?},{:?},{:?},{x:?},{y:?}\n", k as f64 * 0.01, f[k], g[k]);
    }
    fs::write(folder.path().join("a.csv"), text).unwrap();
    let common = "frf a.csv --time 1 --force 2,3 --segment 256";
    let found = mechid(folder.path(), &format!("{common} --displacement 4 --output r.unv"));
    assert!(found.contains("the comment \"time, force\" has 2 fields"), "{found}");
    let tables = [("4", 1), ("4,5", 2)].map(|(columns, motions)| {
        let run = format!("{common} --displacement {columns} --json");
        let table: serde_json::Value = serde_json::from_str(&mechid(folder.path(), &run)).unwrap();
        assert_eq!(table["coherence"].as_array().unwrap().len(), motions);
        table["responses"][1]["real"].clone()
    });
    assert_eq!(tables[0], tables[1]);
    let why = super::refused(folder.path(), &format!("{common} --displacement 4 --estimator h2"));
    assert!(why.contains("as many responses"), "{why}");
}
