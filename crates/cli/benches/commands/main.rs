//! Whole commands on large input: their time and their peak memory, as the operating system reports
//! them.
//!
//! Commands that are compared run alternately. The last lines show each result beside its goal. If
//! `MECHID_BENCH_PYTHON` names a Python interpreter that has `pyarrow`, the reading time is also
//! compared with that of Arrow's CSV reader.

#![allow(clippy::print_stdout, reason = "a bench reports")]

use std::error::Error;
use std::fmt::Write as _;
use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

use mechid::io::csv_text;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Time between two readings of the memory of a command.
const TICK: Duration = Duration::from_millis(2);

/// Returns whether every command runs only once, on small input, as under `cargo test`.
fn is_tried_only() -> bool {
    !std::env::args().any(|word| word == "--bench")
}

/// Minimum time and maximum memory over several runs of a command.
#[derive(Debug, Clone, Copy)]
struct Cost {
    seconds: f64,
    megabytes: f64,
}

/// Runs a command once.
fn run(folder: &Path, arguments: &[&str]) -> Result<Cost> {
    let begin = Instant::now();
    let mut child = Command::new(env!("CARGO_BIN_EXE_mechid"))
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .spawn()?;
    let mut megabytes = 0.0_f64;
    let status = loop {
        megabytes = megabytes.max(peak_memory(&child).unwrap_or(0.0));
        if let Some(status) = child.try_wait()? {
            break status;
        }
        std::thread::sleep(TICK);
    };
    let seconds = begin.elapsed().as_secs_f64();
    if !status.success() {
        return Err(format!("mechid {} ended with {status}", arguments.join(" ")).into());
    }
    Ok(Cost { seconds, megabytes })
}

/// Largest memory of a running command, in MB; `None` if the system does not report it.
fn peak_memory(child: &Child) -> Option<f64> {
    let status = fs::read_to_string(format!("/proc/{}/status", child.id())).ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<f64>().ok()? * 1024e-6)
}

/// Process with Arrow's CSV reader, which reads the names of files from its standard input.
struct Arrow {
    // The process ends when its standard input is closed.
    _python: Child,
    files: ChildStdin,
    seconds: BufReader<ChildStdout>,
}

impl Arrow {
    fn start() -> Option<Self> {
        let python = std::env::var("MECHID_BENCH_PYTHON").ok()?;
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/commands/arrow_csv.py");
        let mut child = Command::new(python)
            .arg(script)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .ok()?;
        let (files, seconds) = (child.stdin.take()?, BufReader::new(child.stdout.take()?));
        Some(Self { _python: child, files, seconds })
    }

    fn read(&mut self, file: &Path) -> Result<f64> {
        writeln!(self.files, "{}", file.display())?;
        let mut line = String::new();
        self.seconds.read_line(&mut line)?;
        Ok(line.trim().parse()?)
    }
}

/// One result of the summary at the end, with its goal.
struct Figure {
    what: String,
    value: String,
    goal: &'static str,
}

fn figure(what: impl Into<String>, value: String, goal: &'static str) -> Figure {
    Figure { what: what.into(), value, goal }
}

/// Writes a record of one mass: time, force, displacement and velocity.
fn write_record(path: &Path, periods: usize) -> Result<()> {
    let description = format!(
        r#"{{
        "system": {{ "mass": 1, "damping": 6, "stiffness": 40000 }},
        "sampling": {{ "samples": 4096, "rate_hz": 2048 }},
        "excitation": [{{ "dof": 1, "lines": "1:400", "amplitude": 1, "phases": "random", "seed": 1 }}],
        "periods": {periods},
        "noise": {{ "displacement": {{ "fraction_of_rms": 0.01 }}, "seed": 3 }}
    }}"#
    );
    let experiment = mechid::io::Experiment::parse("one mass", &description)?;
    let measured = mechid::simulate(&experiment)?;
    let (force, response) = (&measured.measured_force, &measured.measured_response);
    let columns: [(String, &[f64]); 3] = [
        ("force".into(), force.channel(0)),
        ("x".into(), response.displacement().channel(0)),
        ("v".into(), response.velocity().channel(0)),
    ];
    fs::write(path, csv_text(force.sampling(), &columns))?;
    fs::write(path.with_extension("json"), description)?;
    Ok(())
}

/// Measures the reading of a text file of 2·10⁶ rows and 4 columns.
fn reading(folder: &Path, figures: &mut Vec<Figure>) -> Result<()> {
    let periods = if is_tried_only() { 4 } else { 488 };
    let record = folder.join("record.csv");
    write_record(&record, periods)?;
    let megabytes = fs::metadata(&record)?.len() as f64 * 1e-6;
    println!("a text of {} × 4, {megabytes:.0} MB", 4096 * periods);
    let force = ["force", "record.csv", "--system", "record.json", "--displacement", "x"];
    let force = [&force[..], &["--velocity", "v", "--method", "discretised"]].concat();
    let with_output = [&force[..], &["--output", "force.csv"]].concat();
    let identify = ["identify", "record.csv", "--force", "force", "--displacement", "x"];
    let frf = ["frf", "record.csv", "--force", "force", "--displacement", "x"];
    let period = ["--period", "4096"];
    let commands: [(&str, Vec<&str>); 5] = [
        ("info", vec!["info", "record.csv"]),
        ("identify", [&identify[..], &period].concat()),
        ("frf", [&frf[..], &period].concat()),
        ("force", force),
        ("force --output", with_output),
    ];
    let mut arrow = Arrow::start();
    let mut theirs = f64::INFINITY;
    let mut costs = [Cost { seconds: f64::INFINITY, megabytes: 0.0 }; 5];
    for _ in 0..if is_tried_only() { 1 } else { 9 } {
        if let Some(arrow) = &mut arrow {
            theirs = theirs.min(arrow.read(&record)?);
        }
        for (cost, (_, arguments)) in costs.iter_mut().zip(&commands) {
            let once = run(folder, arguments)?;
            cost.seconds = cost.seconds.min(once.seconds);
            cost.megabytes = cost.megabytes.max(once.megabytes);
        }
    }
    if theirs.is_finite() {
        println!("Arrow, one thread: {theirs:.2} s");
    }
    for ((name, _), Cost { seconds, megabytes }) in commands.iter().zip(costs) {
        println!("{name:<16} {seconds:6.2} s {megabytes:6.1} MB");
    }
    for ((name, _), Cost { seconds, megabytes }) in commands.iter().zip(costs).take(3) {
        if theirs.is_finite() {
            let ratio = format!("{:.2}", seconds / theirs);
            figures.push(figure(format!("{name} over Arrow's reader"), ratio, "1.5 at most"));
        }
        figures.push(figure(format!("{name}, MB"), format!("{megabytes:.1}"), "64 at most"));
    }
    let [.., without, with] = costs;
    let written = fs::metadata(folder.join("force.csv"))?.len() as f64 * 1e-6;
    // Additional time per MB written, divided by the time per MB read.
    let ratio = (with.seconds - without.seconds) / written / (without.seconds / megabytes);
    figures.push(figure(
        "force --output: writing over reading",
        format!("{ratio:.2}"),
        "1 at most",
    ));
    Ok(())
}

/// Writes a symmetric matrix as a Matrix Market file of coordinates, from its lower triangle.
fn write_matrix(path: &Path, n: usize, entries: &[(usize, usize, f64)]) -> Result<()> {
    let mut text = String::from("%%MatrixMarket matrix coordinate real symmetric\n");
    writeln!(text, "{n} {n} {}", entries.len())?;
    for (row, column, value) in entries {
        writeln!(text, "{} {} {value}", row + 1, column + 1)?;
    }
    fs::write(path, text)?;
    Ok(())
}

/// Simulates a chain in Matrix Market files, with two outputs.
fn simulation(folder: &Path, figures: &mut Vec<Figure>) -> Result<()> {
    for n in [1_000, 10_000, 100_000] {
        let n = if is_tried_only() { n / 100 + 100 } else { n };
        let diagonal = |value: f64| (0..n).map(move |i| (i, i, value));
        let stiffness = diagonal(2000.0).chain((1..n).map(|i| (i, i - 1, -900.0)));
        write_matrix(&folder.join("m.mtx"), n, &diagonal(1.0).collect::<Vec<_>>())?;
        write_matrix(&folder.join("c.mtx"), n, &diagonal(0.2).collect::<Vec<_>>())?;
        write_matrix(&folder.join("k.mtx"), n, &stiffness.collect::<Vec<_>>())?;
        let description = format!(
            r#"{{ "system": {{ "mass": "m.mtx", "damping": "c.mtx", "stiffness": "k.mtx" }},
                "sampling": {{ "samples": 1000, "rate_hz": 1000 }},
                "excitation": [{{ "dof": 1, "lines": "1:100", "amplitude": 1 }}],
                "outputs": [1, {n}], "scheme": {{ "name": "newmark" }}, "response": "from-rest" }}"#
        );
        fs::write(folder.join("chain.json"), description)?;
        let cost = repeatedly(folder, &["simulate", "chain.json", "--output", "chain.csv"], 5)?;
        let goal = if n == 1_000 { "0.5 at most" } else { "" };
        let what = format!("simulate {n} degrees of freedom × 1,000 steps, s");
        figures.push(figure(what, format!("{:.3}", cost.seconds), goal));
    }
    Ok(())
}

fn repeatedly(folder: &Path, arguments: &[&str], times: usize) -> Result<Cost> {
    let mut best = run(folder, arguments)?;
    for _ in 1..if is_tried_only() { 1 } else { times } {
        let once = run(folder, arguments)?;
        best.seconds = best.seconds.min(once.seconds);
        best.megabytes = best.megabytes.max(once.megabytes);
    }
    Ok(best)
}

/// Returns the description of a chain of `n` masses between two walls, all of them driven by a
/// force.
fn driven_chain(n: usize, samples: usize, lines: usize, periods: usize) -> String {
    let matrix = |diagonal: f64, off: f64| {
        let entry = |i: usize, j: usize| match i.abs_diff(j) {
            0 => diagonal + 0.01 * diagonal * i as f64,
            1 => off,
            _ => 0.0,
        };
        let rows: Vec<String> = (0..n)
            .map(|i| format!("{:?}", (0..n).map(|j| entry(i, j)).collect::<Vec<_>>()))
            .collect();
        format!("[{}]", rows.join(","))
    };
    let driven: Vec<String> = (1..=n)
        .map(|dof| {
            format!(
                r#"{{ "dof": {dof}, "lines": "1:{lines}", "amplitude": 1, "phases": "random", "seed": {dof} }}"#
            )
        })
        .collect();
    format!(
        r#"{{ "system": {{ "mass": {}, "damping": {}, "stiffness": {} }},
            "sampling": {{ "samples": {samples}, "rate_hz": 64 }}, "excitation": [{}],
            "periods": {periods}, "noise": {{ "displacement": {{ "fraction_of_rms": 0.01 }}, "seed": 3 }} }}"#,
        matrix(1.0, 0.0),
        matrix(5.0, -2.0),
        matrix(2500.0, -1000.0),
        driven.join(",")
    )
}

/// Identifies every entry of M, C and K of machines with many degrees of freedom.
fn identification(folder: &Path, figures: &mut Vec<Figure>) -> Result<()> {
    let channels =
        |kind: &str, n: usize| (1..=n).map(|i| format!("{kind}_{i}")).collect::<Vec<_>>().join(",");
    // Each force drives all lines with its own random phases, so that the forces are independent.
    let cases = [
        (50, 2048, 1, "least-squares", "2 s and 200 MB at most"),
        (10, 2048, 4, "maximum-likelihood", "2 s at most"),
        (20, 2048, 4, "maximum-likelihood", "20 s at most"),
    ];
    for (n, samples, periods, method, goal) in cases {
        let n = if is_tried_only() { n / 5 } else { n };
        fs::write(folder.join("machine.json"), driven_chain(n, samples, 500, periods))?;
        run(folder, &["simulate", "machine.json", "--output", "machine.csv", "--quiet"])?;
        let (force, displacement) = (channels("force", n), channels("displacement", n));
        let mut arguments = vec!["identify", "machine.csv", "--force", &force];
        arguments.extend(["--displacement", &displacement, "--method", method]);
        arguments.extend(["--period", "2048"]);
        let cost = repeatedly(folder, &arguments, 3)?;
        let value = format!("{:.2} s, {:.0} MB", cost.seconds, cost.megabytes);
        figures.push(figure(format!("identify {n} degrees of freedom, {method}"), value, goal));
    }
    Ok(())
}

fn main() -> Result<()> {
    let folder = tempfile::tempdir()?;
    let mut figures = Vec::new();
    reading(folder.path(), &mut figures)?;
    simulation(folder.path(), &mut figures)?;
    identification(folder.path(), &mut figures)?;
    println!("\nfigures and their goals");
    for Figure { what, value, goal } in figures {
        println!("{what:<62} {value:>18}   {goal}");
    }
    Ok(())
}
