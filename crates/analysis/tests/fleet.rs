//! Many records by one analysis: rows judged by single identifications, and parts that are neither
//! lost nor made twice.
#![cfg(feature = "parquet")]

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use mechid_analysis::fleet::{Fleet, FleetSummary};
use mechid_analysis::identify::Method;
use mechid_analysis::{
    AnalysisError, Channels, Identify, ResponseQuantity, SavedAnalysis, Window, identify,
};
use tempfile::TempDir;

/// The example record.
const RIG: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/machine.csv");

fn analysis() -> SavedAnalysis {
    SavedAnalysis {
        channels: Channels::new("force", ResponseQuantity::Displacement, "displacement"),
        window: Window { period: Some(256), ..Window::default() },
        identify: Identify::spectra(Method::MaximumLikelihood),
        ..SavedAnalysis::default()
    }
}

/// Records that can be identified, each with another force, and four that cannot.
fn records(home: &TempDir) -> Vec<PathBuf> {
    let rig = fs::read_to_string(RIG).unwrap();
    let mut all = Vec::new();
    let mut add = |name: &str, text: String| {
        let path = home.path().join(name);
        fs::write(&path, text).unwrap();
        all.push(path);
    };
    for k in 0..5 {
        add(&format!("good-{k}.csv"), format!("# record {k}\n{rig}"));
    }
    add("bad-column.csv", rig.replace("displacement", "strain"));
    add("bad-cut.csv", rig.lines().take(100).collect::<Vec<_>>().join("\n"));
    add("bad-empty.csv", String::new());
    let mut lines: Vec<String> = rig.lines().map(str::to_owned).collect();
    let fifth = lines.len() - 5;
    lines[fifth] = "1,NaN,NaN,NaN,NaN".into();
    add("bad-nan.csv", lines.join("\n"));
    all.push(home.path().join("bad-lost.csv"));
    all
}

fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(folder).unwrap().map(Result::unwrap);
    entries
        .map(|entry| {
            let name = entry.file_name().into_string().unwrap();
            (name, fs::read(entry.path()).unwrap())
        })
        .collect()
}

fn run(records: &[PathBuf], folder: &Path, workers: usize) -> FleetSummary {
    Fleet::new(analysis(), records, folder, 3).unwrap().run(workers, &|_| ()).unwrap()
}

#[test]
fn a_row_is_the_identification_of_its_record() {
    let analysis = analysis();
    let row = analysis.row("rig", || analysis.open(RIG));
    let found = identify(&[analysis.open(RIG).unwrap()], &analysis.identify).unwrap();
    assert_eq!(row.error, None);
    for cell in &row.parameters {
        let parameter = found.estimate().parameter(&cell.name).unwrap();
        assert_eq!(cell.value.to_bits(), parameter.value.to_bits());
        assert_eq!(cell.standard_error, Some(parameter.standard_error));
    }
    assert_eq!(row.covariance.as_ref(), Some(&found.summary().covariance));
    assert_eq!(
        row.modes[0].natural_frequency_hz,
        found.summary().modes[0].natural_frequency_hz.value
    );
    let codes: Vec<&str> = row.findings.iter().map(|finding| finding.code.as_str()).collect();
    assert!(
        codes.contains(&"persistent_excitation") || codes.contains(&"excited_lines"),
        "{codes:?}"
    );
    assert!(codes.iter().all(|code| !code.is_empty()));
    assert_eq!(row, analysis.row("rig", || analysis.open(RIG)));
}

#[test]
fn a_bad_record_is_a_row_with_its_error() {
    let home = tempfile::tempdir().unwrap();
    let codes: Vec<(String, String)> = records(&home)
        .iter()
        .map(|path| {
            let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
            let row = analysis().row(&name, || analysis().open(path));
            (name, row.error.map_or_else(String::new, |error| error.code))
        })
        .collect();
    let expected = [
        ("bad-column", "io.missing-column"),
        ("bad-cut", "analysis.window"),
        ("bad-empty", "io.empty"),
        ("bad-nan", "io.not-finite"),
        ("bad-lost", "io.read"),
    ];
    for (name, code) in expected {
        let got = codes.iter().find(|(record, _)| record == name).unwrap();
        assert_eq!(got.1, code, "{name}");
    }
    assert_eq!(codes.iter().filter(|(_, code)| code.is_empty()).count(), 5);
    let panicking = analysis().row("panic", || panic!("a defect"));
    let error = panicking.error.unwrap();
    assert_eq!(error.code, "internal");
    assert!(error.message.contains("a defect"), "{}", error.message);
}

#[test]
fn parts_are_the_same_for_any_number_of_workers_and_made_once() {
    let home = tempfile::tempdir().unwrap();
    let records = records(&home);
    let [one, two] = ["one", "two"].map(|name| home.path().join(name));
    let first = run(&records, &one, 1);
    assert_eq!((first.records, first.failed, first.parts, first.computed_parts), (10, 5, 4, 4));
    let failed: usize = first.failures.iter().map(|failure| failure.records).sum();
    assert_eq!(failed, 5);
    run(&records, &two, 3);
    let table = contents(&one);
    assert_eq!(table.len(), 4);
    assert!(table == contents(&two));

    // Again: nothing is computed, and the summary is the same.
    let again = run(&records, &one, 2);
    assert_eq!(again.computed_records, 0);
    assert_eq!((again.failed, &again.failures), (first.failed, &first.failures));

    // A part that is lost, or damaged, is made again as it was.
    let names: Vec<&String> = table.keys().collect();
    fs::remove_file(one.join(names[0])).unwrap();
    fs::write(one.join(names[1]), &table[names[1]][..100]).unwrap();
    assert_eq!(run(&records, &one, 2).computed_parts, 2);
    assert!(table == contents(&one));

    // A record that changes makes another part; the old one is told.
    fs::write(&records[0], fs::read_to_string(RIG).unwrap()).unwrap();
    let changed = run(&records, &one, 2);
    assert_eq!((changed.computed_parts, changed.other_parts), (1, 1));
}

#[test]
fn an_analysis_that_fits_no_record_is_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |analysis: SavedAnalysis| {
        let error = Fleet::new(analysis, &[RIG.into()], folder.path(), 3).unwrap_err();
        error.code()
    };
    assert_eq!(refused(SavedAnalysis::default()), "analysis.no-force");
    let window = Window { period: Some(0), ..Window::default() };
    assert_eq!(refused(SavedAnalysis { window, ..analysis() }), "analysis.setting");
    let none = Fleet::new(analysis(), &[], folder.path(), 3).unwrap_err();
    assert!(matches!(none, AnalysisError::NoRecord), "{none}");
    let saved = serde_json::to_string(&analysis()).unwrap();
    assert_eq!(serde_json::from_str::<SavedAnalysis>(&saved).unwrap(), analysis());
    assert_ne!(analysis().hash(), SavedAnalysis::default().hash());
}
