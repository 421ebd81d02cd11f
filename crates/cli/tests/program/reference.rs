//! The reference page names every field of a report, and its example of a description is valid.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use serde_json::Value;

use super::mechid;

fn page() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/book/src/reference/json.md");
    fs::read_to_string(path).unwrap()
}

/// Returns the part of the page below a heading of second level.
fn section<'a>(page: &'a str, heading: &str) -> &'a str {
    let (_, rest) = page.split_once(&format!("\n## {heading}\n")).unwrap_or_else(|| {
        panic!("no section {heading}");
    });
    rest.split("\n## ").next().unwrap()
}

/// Collects the paths of all values that are neither object nor list, such as
/// `modes[].damping_ratio.value`.
fn leaves(value: &Value, path: &str, into: &mut BTreeSet<String>) {
    match value {
        Value::Object(fields) => {
            for (name, value) in fields {
                let dot = if path.is_empty() { "" } else { "." };
                leaves(value, &format!("{path}{dot}{name}"), into);
            }
        }
        Value::Array(values) => values.iter().for_each(|v| leaves(v, &format!("{path}[]"), into)),
        _ => drop(into.insert(path.to_owned())),
    }
}

/// Returns true if the section names the path, the uncertain number that contains the value at the
/// path, or, for a value that is null, fields below the path.
fn is_named(section: &str, path: &str) -> bool {
    let row = |path: &str| {
        section.lines().find(|line| line.starts_with('|') && line.contains(&format!("`{path}`")))
    };
    if row(path).is_some() {
        return true;
    }
    let of_uncertain = [".value", ".standard_error", ".interval", ".interval[]"]
        .iter()
        .filter_map(|field| path.strip_suffix(field))
        .any(|parent| row(parent).is_some_and(|row| row.contains("uncertain")));
    // The page of file formats describes the fields of a machine, so a link to it is enough.
    let of_description = ["analysis.machine.", "machine."].iter().any(|m| path.starts_with(m));
    if of_description && section.contains("formats.md#machines-of-named-elements") {
        return true;
    }
    // A value that is null in this report may be an object or a list in another report, so it is
    // enough that the page names the fields of this object or list.
    of_uncertain || [".", "["].iter().any(|next| section.contains(&format!("`{path}{next}")))
}

/// The machine of the example, with two parallel springs and with a candidate position for a
/// sensor. The data determine only the sum of the stiffnesses.
const DRAWN: &str = r#"{
    "dofs": ["x"],
    "elements": [
        {"name": "m", "at": "x", "m": {"prior": {"mean": 25, "standard_deviation": 1}}},
        {"name": "a", "at": "x", "k": {"start": 1e5, "min": 0}, "c": {"start": 100}},
        {"name": "b", "at": "x", "k": {"start": 1e4, "min": 0}}
    ],
    "sensors": [{"name": "displacement", "at": "x", "quantity": "displacement"}],
    "inputs": [{"kind": "force", "name": "force", "at": "x"}],
    "candidates": {"sensors": [{"at": "x", "quantity": "velocity"}]}
}"#;

#[test]
fn every_field_of_every_report_is_in_the_reference() {
    let folder = tempfile::tempdir().unwrap();
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
    for file in [
        "machine.csv",
        "machine.json",
        "bearing-rig.csv",
        "bearing-dry.csv",
        "hammer-1.csv",
        "hammer-2.csv",
        "decay.csv",
    ] {
        fs::copy(examples.join(file), folder.path().join(file)).unwrap();
    }
    fs::write(folder.path().join("drawn.json"), DRAWN).unwrap();
    let data = concat!(env!("CARGO_MANIFEST_DIR"), "/../io/tests/data/plain.mat");
    let identify = "identify machine.csv --force force --displacement displacement";
    let found = mechid(folder.path(), &format!("{identify} --period 256 --json"));
    fs::write(folder.path().join("found.json"), found).unwrap();
    let analysis = r#"{"channels":{"force":["force"],"displacement":["displacement"]}}"#;
    fs::write(folder.path().join("analysis.json"), analysis).unwrap();
    let nonlinear = format!("{identify} --period 256 --nonlinear k3:x1^3 --search delay");
    let found = mechid(folder.path(), &format!("{nonlinear} --json"));
    fs::write(folder.path().join("nonlinear.json"), found).unwrap();
    let measured = "--force force --displacement displacement --period 256";
    mechid(folder.path(), &format!("frf machine.csv {measured} --output frf.csv"));
    let time = "--velocity velocity --acceleration acceleration --domain time";
    for arguments in [
        format!("{identify} --period 256"),
        nonlinear,
        format!("{identify} {time} --mass 25"),
        "identify machine.csv --machine drawn.json --period 256".into(),
        format!("{} --period 256 --output report.html", identify.replace("identify", "report")),
        "fleet machine.csv --analysis analysis.json --output results".into(),
        "force machine.csv --system found.json --displacement displacement --period 256".into(),
        "force machine.csv --system machine.json --displacement displacement".into(),
        "frf machine.csv --force force --displacement displacement --period 256".into(),
        "identify hammer-1.csv hammer-2.csv --force force --struck 1,2 --acceleration a1,a2 --hits"
            .into(),
        "frf hammer-1.csv --force force,0 --acceleration a1,a2 --hits --exponential-percent 1".into(),
        "identify frf.csv --frf-table --quantity displacement --band-hz 1:60".into(),
        "bearing bearing-rig.csv --baseline bearing-dry.csv --force fx,fy --acceleration ax,ay \
         --displacement dx,dy --stator-mass 20 --rotation-hz 50 --period 256 --load 2500 --clearance \
         100e-6 --diameter 0.1 --length 0.05 --viscosity 0.02"
            .into(),
        "modes decay.csv --acceleration a1,a2,a3".into(),
        "modes hammer-1.csv hammer-2.csv --force force --force-at 1,2 --acceleration a1 --response-at 1 \
         --hits --band-hz 2:100 --validate-percent 30"
            .into(),
        "modes hammer-1.csv --force force --acceleration a1,a2 --band-hz 2:100 --near-hz 12,31".into(),
        format!("info {data}"),
        "info machine.csv --sample-rate 128".into(),
        "modes found.json".into(),
        "modes nonlinear.json".into(),
        "predict found.json machine.csv --force force --displacement displacement --settle 64"
            .into(),
        "predict nonlinear.json machine.csv --force force --displacement displacement --period 256"
            .into(),
        "modes machine.json".into(),
        "multisine --samples 64 --rate 64 --inputs 2 --output force.csv".into(),
        "simulate machine.json --output record.csv".into(),
        "stability machine.json".into(),
        "sweep machine.json --npi 2,4".into(),
    ] {
        let report = mechid(folder.path(), &format!("{arguments} --json"));
        let report: Value = serde_json::from_str(&report).unwrap();
        let command = arguments.split_whitespace().next().unwrap();
        let page = page();
        let mut section = section(&page, &format!("mechid {command}")).to_owned();
        if ["report", "bearing"].contains(&command) {
            // The JSON report of the command `report` also has all fields of the command
            // `identify`; that of the command `bearing` also has the checks of `identify`.
            section += self::section(&page, "mechid identify");
        }
        let mut paths = BTreeSet::new();
        leaves(&report, "", &mut paths);
        assert!(paths.len() > 5, "{arguments}");
        for path in paths {
            assert!(is_named(&section, &path), "{arguments}: `{path}` is not in the reference");
        }
    }
}

#[test]
fn the_description_in_the_reference_is_one() {
    let page = page();
    let (_, json) = page.split_once("```json\n").unwrap();
    let (json, _) = json.split_once("```").unwrap();
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.json"), json).unwrap();
    let report = mechid(folder.path(), "simulate a.json --output a.csv --json");
    let report: Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report["response"]["from"]["displacement"], 0.001);
    let text = fs::read_to_string(folder.path().join("a.csv")).unwrap();
    assert_eq!(text.lines().count(), 513);
    // Every kind of force and every scheme has a row.
    let description = section(&page, "The description of an experiment");
    for name in [
        "multisine",
        "harmonic",
        "sweep",
        "prbs",
        "random",
        "impulse",
        "half-sine",
        "exact",
        "newmark",
        "central-difference",
        "houbolt",
        "wilson-theta",
        "generalised-alpha",
        "hht-alpha",
        "bathe",
        "rho-infinity-bathe",
        "matrix-exponential",
        "runge-kutta-4",
    ] {
        assert!(description.contains(&format!("| `{name}`")), "{name}");
    }
}

/// An initial state may be given as a displacement without a velocity, or as a velocity without a
/// displacement.
#[test]
fn a_start_needs_no_more_than_it_says() {
    let folder = tempfile::tempdir().unwrap();
    for (given, other) in [("displacement", "velocity"), ("velocity", "displacement")] {
        let json = format!(
            r#"{{ "system": {{ "mass": 1, "damping": 0, "stiffness": 100 }},
                 "sampling": {{ "samples": 64, "rate_hz": 100 }}, "excitation": [],
                 "scheme": {{ "name": "newmark" }}, "response": {{ "from": {{ "{given}": 1 }} }} }}"#
        );
        fs::write(folder.path().join("a.json"), json).unwrap();
        let report = mechid(folder.path(), "simulate a.json --output a.csv --json");
        let report: Value = serde_json::from_str(&report).unwrap();
        assert_eq!(report["response"]["from"][given], 1.0);
        assert!(report["response"]["from"].get(other).is_none());
    }
}
