//! Faulty input of every kind gives one clear message and exit code 2, and no file is written.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use assert_cmd::Command;

/// A record of 32 samples, 4 ms apart: a force on line 3 and a displacement that responds to it.
fn good() -> String {
    record(|k| {
        let turn = std::f64::consts::TAU * 3.0 * f64::from(k) / 32.0;
        (0.004 * f64::from(k), turn.cos(), 1e-3 * turn.sin())
    })
}

fn record(sample: impl Fn(u8) -> (f64, f64, f64)) -> String {
    let mut text = String::from("time,force,x\n");
    for (time, force, x) in (0..32).map(sample) {
        writeln!(text, "{time},{force},{x}").unwrap();
    }
    text
}

/// Runs `mechid` on a file of this content in an empty folder, where it must fail with a message
/// that contains all of `parts`, without other output, and leave the folder unchanged.
fn refused(content: &str, arguments: &str, parts: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.csv"), content).unwrap();
    let output = Command::cargo_bin("mechid")
        .unwrap()
        .current_dir(folder.path())
        .args(arguments.split_whitespace())
        .output()
        .unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{arguments}: {message}");
    assert!(message.starts_with("error: "), "{arguments}: {message}");
    for part in parts {
        assert!(message.contains(part), "{arguments}: \"{part}\" is missing in: {message}");
    }
    assert!(output.stdout.is_empty(), "{arguments} printed something");
    assert_eq!(files(folder.path()), ["a.csv"], "{arguments} left something behind");
}

fn files(folder: &Path) -> Vec<String> {
    let name = |entry: std::io::Result<fs::DirEntry>| entry.unwrap().file_name().into_string();
    fs::read_dir(folder).unwrap().map(|entry| name(entry).unwrap()).collect()
}

/// Runs `identify` on a file with this content, with a plot and the arguments `more`; the run must
/// fail.
fn identify(content: &str, more: &str, parts: &[&str]) {
    let common = "identify a.csv --force force --displacement x --plot out.svg";
    refused(content, &format!("{common} {more}"), parts);
}

/// The good record with one line replaced.
fn with_line(number: usize, line: &str) -> String {
    let text = good();
    let mut lines: Vec<&str> = text.lines().collect();
    lines[number - 1] = line;
    lines.join("\n")
}

#[test]
fn missing_file() {
    refused("", "identify b.csv --force 1 --displacement 2", &["cannot read b.csv: "]);
    refused("", "info b.csv", &["cannot read b.csv: "]);
    refused("", "simulate b.json --output out.csv", &["cannot read b.json: "]);
}

#[test]
fn missing_column_lists_those_there_are() {
    let parts = ["a.csv has no column \"F\"", "1 \"time\", 2 \"force\", 3 \"x\""];
    refused(&good(), "identify a.csv --force F --displacement x", &parts);
    refused(&good(), "identify a.csv --force 4 --displacement x", &["no column \"4\"", "3 \"x\""]);
    refused(&good(), "info a.csv --columns F", &parts);
}

#[test]
fn tables_of_frequency_responses() {
    refused(&good(), "identify a.csv --frf-table", &["a.csv has no frequency response: name col"]);
    let table = "f,real,imag,coherence\n1,1e-3,-2e-3,0.9\n2,1e-3,-3e-3,0.9\n";
    refused(table, "identify a.csv --frf-table", &["--quantity", "does not say what was measured"]);
    let told = "identify a.csv --frf-table --quantity velocity";
    refused(table, told, &["state their number of independent averages"]);
    refused(table, &format!("{told} --averages 8 --band-hz 5:9"), &["5 and 9 Hz"]);
    refused(table, &format!("{told} --averages 8 --force 1"), &["cannot be used with"]);
}

#[test]
fn noise_of_the_force_belongs_to_open_records() {
    for (arguments, parts) in [
        ("--force-noise -1", ["--force-noise: ", "zero or positive, got -1"]),
        ("--force-noise nan", ["--force-noise: ", "zero or positive, got NaN"]),
        ("--force-noise 1,2", ["--force-noise: ", "one for each of 1 forces, not 2"]),
        ("--force-noise 1 --period 20", ["--force-noise: ", "available only for open records"]),
        ("--force-noise 1 --from-frf h1", ["--force-noise: ", "not to --from-frf"]),
        (
            "--force-noise 1 --method least-squares",
            ["--method: ", "open records and hits need maximum-likelihood"],
        ),
        ("--force-noise 1 --extent period", ["--force-noise: ", "available only for open records"]),
    ] {
        identify(&good(), arguments, &parts);
    }
}

#[test]
fn bearing_tests_need_two_directions() {
    let common = "bearing a.csv --force force --stator-mass";
    refused(
        &good(),
        &format!("{common} 2 --displacement x"),
        &["needs two columns, x and y, of each quantity"],
    );
    refused(
        &good(),
        &format!("{common} 0 --displacement x"),
        &["--stator-mass: a positive number"],
    );
    refused(&good(), "bearing a.csv --force force --displacement x", &["--stator-mass <KG>"]);
    refused("{\"points\": 3}", "bearing a.csv --campaign", &["a.csv: points: "]);
}

#[test]
fn duplicate_column_lists_those_there_are() {
    let twice = good().replacen("time,force,x", "time,x,x", 1);
    let arguments = "identify a.csv --force 2 --displacement x";
    refused(&twice, arguments, &["several columns \"x\"", "by its number: 2 \"x\", 3 \"x\""]);
    let parts = ["column 2 of a.csv is used twice, as \"force\" and as \"2\"", "3 \"x\""];
    refused(&good(), "identify a.csv --force force --displacement 2", &parts);
}

#[test]
fn text_where_a_number_is_needed() {
    let text = with_line(7, "0.02,1.0,overload");
    identify(&text, "", &["a.csv, line 7, column 3 \"x\": \"overload\" is not a number"]);
    identify(&with_line(9, "0.028,,0"), "", &["line 9, column 2 \"force\": the field is empty"]);
}

#[test]
fn nan_and_infinity() {
    identify(
        &with_line(5, "0.012,NaN,0"),
        "",
        &["line 5, column 2 \"force\": NaN is not a finite"],
    );
    identify(&with_line(5, "0.012,1,-inf"), "", &["line 5, column 3 \"x\": -inf is not a finite"]);
}

#[test]
fn ragged_rows() {
    identify(
        &with_line(20, "0.072,1"),
        "",
        &["a.csv, line 20: this line has 2 fields, but the first line has 3"],
    );
    identify(&with_line(20, "0.072,1,2,3"), "", &["a.csv, line 20: this line has 4 fields"]);
}

#[test]
fn lines_above_the_table() {
    let text = format!("Analyser 7\nRate;250\n\n{}", good());
    let parts = ["a.csv: the table seems to begin on line 4, with 3 fields", "`skip_lines` 3"];
    identify(&text, "", &parts);
    refused(&text, "info a.csv", &parts);
    // If `--skip-lines` also skips the header, the columns have no names.
    identify(&text, "--skip-lines 4 --sample-rate 250", &["a.csv has no column \"force\""]);
}

#[test]
fn json_for_a_record() {
    let parts = ["a.csv is JSON, not a table of samples", "simulate", "as `system`"];
    identify("{ \"system\": { \"mass\": 1 } }", "", &parts);
}

#[test]
fn nonlinear_terms_that_cannot_be() {
    identify(&good(), "--nonlinear k3", &["`name: expression`"]);
    identify(&good(), "--nonlinear k3:x2^3", &["k3: x2^3", "degrees of freedom"]);
    let misplaced = ["--nonlinear: it belongs to nonlinear terms, not to --domain time"];
    identify(&good(), "--nonlinear k3:x^3 --domain time", &misplaced);
    let not_periods = ["--nonlinear: it belongs to nonlinear terms, not to --from-frf"];
    identify(&good(), "--nonlinear k3:x^3 --from-frf h1 --segment 16", &not_periods);
    identify(&good(), "--search phase", &["--search: it belongs to nonlinear terms"]);
}

#[test]
fn empty_record() {
    identify("", "", &["a.csv holds no data: it is empty"]);
    identify("time,force,x\n", "", &["a.csv holds no data: there is a header and nothing below"]);
}

#[test]
fn uneven_time_steps() {
    let text = with_line(18, "0.0615,1,0");
    identify(&text, "", &["the step up to line 19 is 0.0065 s, but the usual step is 0.004 s"]);
}

#[test]
fn no_time_axis() {
    let text = good().replacen("time", "clock", 1);
    identify(&text, "", &["--time", "--sample-rate", "1 \"clock\", 2 \"force\""]);
    identify(&good(), "--sample-rate 0", &["sample rate must be a positive"]);
    identify(&good(), "--sample-rate -5", &["sample rate must be a positive"]);
}

#[test]
fn window_past_the_end() {
    let part = "the window needs samples 9 to 40 (counted from 1), but a.csv has 32";
    identify(&good(), "--start 9 --period 32", &[part]);
    identify(&good(), "--period 16 --periods 3", &["samples 1 to 48"]);
    identify(&good(), "--start 33", &["a.csv has 32"]);
    refused(&good(), "info a.csv --start 9 --period 32", &[part]);
    identify(&good(), "--start 0", &["counted from 1"]);
    identify(&good(), "--periods 2", &["--period"]);
}

#[test]
fn no_excited_line() {
    // Line 3 of a record of 128 ms is at 23.4375 Hz.
    identify(&good(), "--band-hz 30:60", &["no excited line between 30 and 60 Hz", "23.4375"]);
    identify(&good(), "--band-hz 1e300:2e300", &["between 1e300 and 2e300 Hz"]);
    identify(&good(), "--lines even", &["no excited line among even"]);
    identify(&good(), "--lines 1:20", &["line 20 is not between 1 and 15"]);
    identify(&good(), "--lines 5:1", &["\"5:1\" is not a choice of lines", "first:step:last"]);
    identify(&good(), "--band-hz 60:30", &["low:high"]);
    identify(&good(), "--period 2", &["2 equations do not determine 3 unknowns"]);
}

#[test]
fn a_force_that_is_zero() {
    let text = record(|k| (0.004 * f64::from(k), 0.0, f64::from(k)));
    identify(&text, "", &["a.csv: the force (column force) is zero throughout the window"]);
    // A force that does not vary excites no line.
    let text = record(|k| (0.004 * f64::from(k), 0.1, f64::from(k % 5)));
    identify(&text, "", &["no excited line: the force does not vary over a period of 32 samples"]);
}

#[test]
fn a_mass_no_body_has() {
    identify(&good(), "--mass -3", &["a mass must be positive and finite, got -3 kg"]);
    identify(&good(), "--mass 0", &["got 0 kg"]);
    identify(&good(), "--mass NaN", &["got NaN kg"]);
    identify(
        &good(),
        "--mass 1,2,3",
        &["--mass gives 3 values, the record has 1 degree of freedom"],
    );
    identify(&good(), "--mass heavy", &["\"heavy\" is neither a number nor unknown"]);
}

#[test]
fn too_few_rows_for_the_unknowns() {
    // One line is two real equations; mass, damping and stiffness are three unknowns.
    identify(&good(), "", &["2 equations do not determine 3 unknowns"]);
    let common = "identify a.csv --force 2 --displacement 3 --velocity 4 --acceleration 5";
    let arguments = format!("{common} --domain time --period 2 --periods 1 --sample-rate 1");
    let text = "t,f,x,v,a\n0,1,2,3,4\n1,2,3,4,6\n2,1,1,1,1\n";
    refused(text, &arguments, &["2 equations do not determine 3 unknowns"]);
}

#[test]
fn a_singular_fit_names_what_the_data_do_not_excite() {
    // In a static test velocity and acceleration are zero, so mass and damping cannot be found.
    let mut text = String::from("time,f,x,v,a\n");
    for k in 0..20 {
        writeln!(text, "{k},{k},{},0,0", 0.5 * f64::from(k)).unwrap();
    }
    let common = "identify a.csv --force f --displacement x --velocity v --acceleration a";
    refused(&text, &format!("{common} --domain time"), &["the data do not determine m, c:"]);
    // A displacement that is zero in every sample is like that of a sensor that is not connected.
    let text = record(|k| {
        let t = f64::from(k);
        (0.004 * t, (t * t).sin(), 0.0)
    });
    identify(&text, "", &["the data do not determine m, c, k"]);
}

#[test]
fn columns_that_do_not_pair_up() {
    refused(&good(), "identify a.csv --force force", &["--displacement, --velocity or"]);
    refused(
        &good(),
        "identify a.csv --force 2,0 --displacement 3",
        &["names 1 column, but --force names 2"],
    );
    identify(&good(), "--domain time", &["in the time domain"]);
    refused(&good(), "identify a.csv --displacement x", &["--force"]);
}

#[test]
fn instruments_need_two_periods() {
    identify(&good(), "--method instrumental", &["2"]);
}

#[test]
fn files_that_cannot_be_written() {
    let common = "identify a.csv --force force --displacement x --mass 1 --plot";
    refused(&good(), &format!("{common} out.pdf"), &["must end in .svg, .png or .html"]);
    refused(&good(), &format!("{common} no/such/folder/out.svg"), &["cannot write no/such/folder"]);
}

#[test]
fn pages_that_cannot_be_written() {
    let common = "report a.csv --displacement x --force";
    refused(&good(), &format!("{common} force --output out.pdf"), &["must end in .html"]);
    refused(&good(), &format!("{common} F --output out.html"), &["no column \"F\""]);
    let elsewhere = format!("{common} force --mass 1 --output no/such/folder/out.html");
    refused(&good(), &elsewhere, &["cannot write no/such/folder"]);
    // One line gives two equations, so the fit fails after the record was read.
    refused(&good(), &format!("{common} force --output out.html"), &["3 unknowns"]);
}

#[test]
fn descriptions_that_describe_nothing() {
    let common = "simulate a.csv --output out.csv";
    refused(
        "{ \"system\": 3 }",
        common,
        &["a.csv: system: invalid type: integer `3`", "line 1 column"],
    );
    let text = |system: &str, more: &str| {
        format!(
            "{{ \"system\": {system}, \"sampling\": {{ \"samples\": 16, \"rate_hz\": 16 }}, \
             \"excitation\": [{{ \"lines\": \"1:3\", \"amplitude\": 1 }}] {more} }}"
        )
    };
    let sdof = "{ \"mass\": 1, \"damping\": 0.1, \"stiffness\": 40 }";
    let scheme = |more: &str| text(sdof, &format!(", \"scheme\": {{ \"name\": {more} }}"));
    refused(&text(sdof, ", \"perods\": 3"), common, &["unknown field `perods`"]);
    refused(&scheme("\"newmark\", \"beta\": -1"), common, &["-1"]);
    refused(&scheme("\"wilson-theta\", \"theta\": 0.5"), common, &["0.5"]);
    let from_rest = text(sdof, ", \"response\": \"from-rest\"");
    refused(&from_rest, common, &["gives the periodic response only"]);
    // The step is ωΔt = 4; central difference is stable up to 2.
    let stiff = "{ \"mass\": 1, \"damping\": 0, \"stiffness\": 4096 }";
    let scheme = ", \"scheme\": { \"name\": \"central-difference\" }";
    refused(&text(stiff, scheme), common, &["central difference is unstable", "3.125000e-2 s"]);
    // The oscillation grows at c/2m = 0.05 1/s and doubles in ln 2 / 0.05 s.
    let growing = "{ \"mass\": 1, \"damping\": -0.1, \"stiffness\": 40 }";
    let told =
        ["reaches no periodic response", "pole 0.05 ± 6.324i rad/s", "doubles every 13.86 s"];
    refused(&text(growing, ""), common, &told);
    // The force acts exactly at the resonance of an undamped oscillator.
    let resonant = "{ \"mass\": 1, \"damping\": 0, \"stiffness\": 39.47841760435743 }";
    refused(&text(resonant, ""), common, &["6.28"]);
}

#[test]
fn a_free_decay_that_is_none() {
    let common = "modes a.csv --displacement x --plot out.svg";
    let fit = |more: &str, parts: &[&str]| refused(&good(), &format!("{common} {more}"), parts);
    fit("--from 1", &["--from: 1 s is not in the window, which is 0.128 s long"]);
    fit("--from 0.1 --to 0.05", &["--to: it must be after --from"]);
    fit("--from -1", &["--from: -1 s is not in the window"]);
    fit("--to inf", &["--to: inf s is not in the window"]);
    fit("--period 8", &["--period: a free decay has no period: choose --from and --to"]);
    fit("--velocity force", &["one kind of response: name the columns of displacement or"]);
    fit("--modes 0", &["--modes"]);
    fit("--modes 99", &["99 modes cannot be fitted: give a number from 1 to 40"]);
    fit("--from 0 --modes 5", &["the record has 32 samples, but at least 61 are needed"]);
    refused(&good(), "modes a.csv", &["name the columns of the response with --displacement"]);
    let still = record(|k| (0.004 * f64::from(k), 1.0, 2.5));
    refused(&still, "modes a.csv --displacement x --from 0", &["channel 1 is constant at 2.5"]);
    let growing = record(|k| {
        let t = f64::from(k);
        (0.004 * t, 0.0, (0.1 * t).exp() * (0.7 * t).sin() + 0.01 * (3.0 * t * t).sin())
    });
    let grows = ["grows, at", "the system is unstable"];
    refused(&growing, "modes a.csv --displacement x --from 0", &grows);
}
