//! Time and memory of the program for typical tests of a laboratory.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use mechid::io::csv_text;
use mechid::model::Response;
use mechid::signal::{NoiseLevel, Record, Sampling, noise};
use mechid_problems::exact_foh_periodic;
use mechid_problems::machines::{Support, chain};
use nalgebra::DMatrix;

/// Time after which a case is ended, in s.
const MOST_SECONDS: f64 = 120.0;

/// Time between two readings of the memory of a program.
const POLL: Duration = Duration::from_millis(20);

/// One case: its name, its input file, and the arguments of the program.
struct Case {
    name: &'static str,
    file: &'static str,
    arguments: Vec<String>,
}

/// Time and memory of a case.
struct Cost {
    name: &'static str,
    /// Time in s; `None` if the program was stopped after [`MOST_SECONDS`].
    seconds: Option<f64>,
    /// Largest memory in GB; `None` if the system does not report it.
    memory: Option<f64>,
}

/// Makes the cases, runs the program on each, and returns a table of the page.
///
/// # Errors
/// A case that cannot be made, or a program that cannot be started.
pub fn table(program: &Path) -> Result<String, String> {
    let folder = std::env::temp_dir().join(format!("mechid-lab-{}", std::process::id()));
    fs::create_dir_all(&folder).map_err(|e| e.to_string())?;
    let costs = cases(&folder)?.into_iter().map(|case| measured(program, &folder, case));
    let costs = costs.collect::<Result<Vec<_>, _>>();
    fs::remove_dir_all(&folder).map_err(|e| e.to_string())?;
    let mut text = String::from("| Test | time | memory |\n|---|---|---|\n");
    for Cost { name, seconds, memory } in costs? {
        let time = match seconds {
            Some(seconds) => format!("{seconds:.1} s"),
            None => format!("ended after {MOST_SECONDS} s"),
        };
        let memory = memory.map_or("not known".into(), |gb| format!("{gb:.2} GB"));
        let _ = writeln!(text, "| {name} | {time} | {memory} |");
    }
    Ok(text)
}

fn measured(program: &Path, folder: &Path, case: Case) -> Result<Cost, String> {
    let mut command = Command::new(program);
    command.args(&case.arguments).current_dir(folder).stdout(Stdio::null()).stderr(Stdio::null());
    let begin = Instant::now();
    let mut child = command.spawn().map_err(|e| format!("{}: {e}", program.display()))?;
    let mut memory: Option<f64> = None;
    let seconds = loop {
        memory = memory.into_iter().chain(largest_memory(&child)).reduce(f64::max);
        let seconds = begin.elapsed().as_secs_f64();
        if let Some(status) = child.try_wait().map_err(|e| e.to_string())? {
            if !status.success() {
                return Err(format!("{}: the program ended with {status}", case.name));
            }
            break Some(seconds);
        }
        if seconds > MOST_SECONDS {
            child.kill().and_then(|()| child.wait()).map_err(|e| e.to_string())?;
            break None;
        }
        sleep(POLL);
    };
    fs::remove_file(folder.join(case.file)).map_err(|e| e.to_string())?;
    Ok(Cost { name: case.name, seconds, memory })
}

/// Returns the largest memory of a running program, in GB, if the system states it.
fn largest_memory(child: &Child) -> Option<f64> {
    let status = fs::read_to_string(format!("/proc/{}/status", child.id())).ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kilobytes: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kilobytes * 1024.0 / 1e9)
}

fn cases(folder: &Path) -> Result<Vec<Case>, String> {
    let words = |text: &str| text.split_whitespace().map(String::from).collect();
    shaken(&folder.join("tower.csv"), 5, &[4], 40_960)?;
    shaken(&folder.join("shakers.csv"), 8, &[1, 6], 56_320)?;
    decay(&folder.join("decay.csv"))?;
    dense_chain(&folder.join("dense.json"))?;
    Ok(vec![
        Case {
            name: "tower of five storeys, 40,960 samples, `--structure chain`",
            file: "tower.csv",
            arguments: words(
                "identify tower.csv --force 0,0,0,0,f5 --displacement x1,x2,x3,x4,x5 --structure chain",
            ),
        },
        Case {
            name: "two shakers, eight responses, 56,320 samples",
            file: "shakers.csv",
            arguments: words(
                "identify shakers.csv --force 0,f2,0,0,0,0,f7,0 --displacement x1,x2,x3,x4,x5,x6,x7,x8",
            ),
        },
        Case {
            name: "free decay of ten modes, three channels, 65,536 samples",
            file: "decay.csv",
            arguments: words("modes decay.csv --acceleration a1,a2,a3"),
        },
        Case {
            name: "chain of 1,000 masses in full matrices, 200 steps",
            file: "dense.json",
            arguments: words("simulate dense.json --output response.csv --quiet"),
        },
    ])
}

/// Writes the record of a chain under random forces, with 0.3 % noise on the forces and 1 % noise
/// on the displacements.
fn shaken(path: &Path, dof: usize, driven: &[usize], samples: usize) -> Result<(), String> {
    let system = chain(dof, Support::Fixed, 0.02, 1);
    // The response to a whole period is computed exactly; the open record is a part of this period.
    let period = Sampling::from_rate_hz(128.0, samples + 1536).map_err(|e| e.to_string())?;
    let white = noise::white(period, driven.len(), 50.0, 1).map_err(|e| e.to_string())?;
    let mut data = DMatrix::zeros(period.len(), dof);
    for (column, &at) in driven.iter().enumerate() {
        data.column_mut(at).copy_from_slice(white.channel(column));
    }
    let force = Record::new(period, data).map_err(|e| e.to_string())?;
    let response: Response = exact_foh_periodic(&system, &force).map_err(|e| e.to_string())?;
    let part = |record: &Record, level: f64, seed: u64| {
        let part = record.window(1024, samples)?;
        noise::add_white(&part, NoiseLevel::FractionOfRms(level), seed)
    };
    let measured = part(&white, 0.003, 2).map_err(|e| e.to_string())?;
    let response = part(response.displacement(), 0.01, 3).map_err(|e| e.to_string())?;
    let forces = driven.iter().enumerate();
    let forces = forces.map(|(column, at)| (format!("f{}", at + 1), measured.channel(column)));
    let responses = (0..dof).map(|at| (format!("x{}", at + 1), response.channel(at)));
    let columns: Vec<(String, &[f64])> = forces.chain(responses).collect();
    fs::write(path, csv_text(measured.sampling(), &columns)).map_err(|e| e.to_string())
}

/// Writes the decay of ten modes between 12 and 350 Hz in three channels, with 0.5 % noise.
fn decay(path: &Path) -> Result<(), String> {
    let sampling = Sampling::from_rate_hz(2048.0, 65_536).map_err(|e| e.to_string())?;
    let modes = [12.0, 31.0, 47.0, 68.0, 95.0, 130.0, 171.0, 220.0, 280.0, 350.0];
    let data = DMatrix::from_fn(sampling.len(), 3, |k, channel| {
        let t = k as f64 * sampling.dt();
        let response = modes.iter().enumerate().map(|(mode, hz)| {
            let (omega, ratio) = (std::f64::consts::TAU * hz, 0.004 + 0.0009 * mode as f64);
            let size = (1.0 + (mode * (channel + 1)) as f64).sin() + 0.3;
            size * (-ratio * omega * t).exp() * (omega * t + mode as f64).sin()
        });
        response.sum()
    });
    let record = Record::new(sampling, data).map_err(|e| e.to_string())?;
    let record = noise::add_white(&record, NoiseLevel::FractionOfRms(0.005), 4);
    let record = record.map_err(|e| e.to_string())?;
    let columns: Vec<(String, &[f64])> =
        (0..3).map(|at| (format!("a{}", at + 1), record.channel(at))).collect();
    fs::write(path, csv_text(sampling, &columns)).map_err(|e| e.to_string())
}

/// Writes a chain of 1,000 masses with complete matrices, which include all zeros.
fn dense_chain(path: &Path) -> Result<(), String> {
    let n = 1000;
    let rows = |diagonal: f64, beside: f64| -> Vec<Vec<f64>> {
        let entry = |i: usize, j: usize| match i.abs_diff(j) {
            0 => diagonal,
            1 => beside,
            _ => 0.0,
        };
        (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect()
    };
    let described = serde_json::json!({
        "system": {
            "mass": rows(1.0, 0.0), "damping": rows(0.2, -0.1), "stiffness": rows(2000.0, -1000.0),
        },
        "sampling": { "samples": 200, "rate_hz": 1000.0 },
        "excitation": [{ "dof": 1, "lines": "all", "amplitude": 50.0 }],
        "response": "from-rest",
        "scheme": { "name": "newmark" },
        "outputs": [1, n],
    });
    fs::write(path, described.to_string()).map_err(|e| e.to_string())
}

/// Returns the program that the same build made.
///
/// # Errors
/// If there is none.
pub fn program() -> Result<PathBuf, String> {
    let own = std::env::current_exe().map_err(|e| e.to_string())?;
    let program = own.with_file_name(format!("mechid{}", std::env::consts::EXE_SUFFIX));
    match program.is_file() {
        true => Ok(program),
        false => Err(format!("{}: build the program first", program.display())),
    }
}
