//! Analysis of many records with the same settings: each row of the result equals the row of a
//! single identification, and no part of the result is lost or computed twice.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use mechid_analysis::batch::{ModeCell, ParameterCell};
use mechid_analysis::fleet::{Fleet, FleetSummary, TrendAxis, Trends, read_results};
use mechid_analysis::identify::Method;
use mechid_analysis::measurement::Reading;
use mechid_analysis::{
    AnalysisError, Channels, Identify, ResponseQuantity, ResultRow, SavedAnalysis, Window, identify,
};
use mechid_io::{ParquetColumn, ParquetValues, Table, TimeAxis, write_parquet};
use mechid_signal::{Sampling, noise};
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

/// Records that can be identified, each with another force, and four records that cannot.
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
    assert_eq!(row.covariance, found.summary().covariance);
    assert_eq!(
        row.modes[0].natural_frequency_hz,
        found.summary().modes[0].row.natural_frequency_hz.value
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

    // A second run computes no part of the result again, and has the same summary.
    let again = run(&records, &one, 2);
    assert_eq!(again.computed_records, 0);
    assert_eq!((again.failed, &again.failures), (first.failed, &first.failures));

    // A part of the result that is lost or damaged is computed again, with the same content.
    let names: Vec<&String> = table.keys().collect();
    fs::remove_file(one.join(names[0])).unwrap();
    fs::write(one.join(names[1]), &table[names[1]][..100]).unwrap();
    assert_eq!(run(&records, &one, 2).computed_parts, 2);
    assert!(table == contents(&one));

    // After a record has changed, its part of the result is computed again. The part of the old
    // record stays in the folder, and the summary counts it in `other_parts`.
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

/// One file with four records made from the example record: a complete one, one cut short, one with
/// a sample that is not finite, and another complete one.
fn one_file(home: &TempDir) -> PathBuf {
    let rig = Table::read(RIG).unwrap();
    let rig = rig.record(&TimeAxis::Column("time"), &["force", "displacement"]).unwrap();
    let len = rig.len();
    let lengths = [("monday", len), ("cut", 100), ("broken", len), ("friday", len)];
    let ids = lengths.iter().flat_map(|(id, len)| vec![Some((*id).to_owned()); *len]);
    let rows = |values: &[f64]| -> Vec<Option<f64>> {
        lengths.iter().flat_map(|(_, len)| values[..*len].iter().map(|v| Some(*v))).collect()
    };
    let mut displacement = rows(rig.channel(1));
    displacement[len + 100 + 7] = None;
    let columns = [
        ParquetColumn { name: "day", values: ParquetValues::Text(ids.collect()) },
        ParquetColumn { name: "force", values: ParquetValues::Number(rows(rig.channel(0))) },
        ParquetColumn { name: "displacement", values: ParquetValues::Number(displacement) },
    ];
    let path = home.path().join("week.parquet");
    let rate = (rig.sampling().rate_hz()).to_string();
    write_parquet(&path, &columns, &[("sample_rate_hz", rate)]).unwrap();
    path
}

#[test]
fn a_file_of_many_records_makes_a_row_for_each() {
    let home = tempfile::tempdir().unwrap();
    let path = one_file(&home);
    let reading = Reading { record_column: Some("day".into()), ..Reading::default() };
    let analysis = SavedAnalysis { reading, ..analysis() };
    let folder = home.path().join("results");
    let fleet = Fleet::new(analysis.clone(), std::slice::from_ref(&path), &folder, 3).unwrap();
    let ids = |at: usize| -> Vec<String> {
        let records = fleet.parts()[at].records().iter();
        records.map(|record| record.rows.as_ref().unwrap().id.clone()).collect()
    };
    assert_eq!(
        (ids(0), ids(1)),
        (["monday", "cut", "broken"].map(String::from).into(), vec!["friday".into()])
    );
    let summary = fleet.run(2, &|_| ()).unwrap();
    assert_eq!((summary.records, summary.failed, summary.parts), (4, 2, 2));
    let failure = |code: &str| {
        let mut all = summary.failures.iter();
        all.find(|failure| failure.code == code).unwrap()
    };
    assert!(failure("io.not-finite").record.ends_with("week.parquet, record broken"));
    assert!(failure("io.not-finite").message.contains("(record broken), sample 8"));
    assert!(failure("analysis.window").message.contains("(record cut) has 100"));

    // A record of the file, analysed alone, gives the same numbers as its source file, the example
    // record.
    let alone = |id: &str| {
        let reading = Reading { record_id: Some(id.into()), ..analysis.reading.clone() };
        SavedAnalysis { reading, ..analysis.clone() }
    };
    let row = alone("friday").row("friday", || alone("friday").open(&path));
    assert_eq!(row.error, None);
    let file = self::analysis().row("rig", || self::analysis().open(RIG));
    assert_eq!(row.parameters, file.parameters);
    let parts = contents(&folder);
    fs::remove_dir_all(&folder).unwrap();
    Fleet::new(analysis.clone(), std::slice::from_ref(&path), &folder, 3)
        .unwrap()
        .run(1, &|_| ())
        .unwrap();
    assert!(parts == contents(&folder));

    let refused = |analysis: &SavedAnalysis| analysis.open(&path).unwrap_err();
    let error = refused(&analysis);
    assert!(matches!(error, AnalysisError::RecordId { id: None, records: 4, .. }), "{error}");
    let error = refused(&alone("sunday")).to_string();
    assert!(
        error
            .ends_with("holds 4 records (monday, cut, broken, friday), but none of them is sunday"),
        "{error}"
    );
    // If the column does not identify records, the row of the file has the error.
    let reading = Reading { record_column: Some("force".into()), ..Reading::default() };
    let wrong = SavedAnalysis { reading, ..self::analysis() };
    let summary = Fleet::new(wrong, &[path], &folder, 3).unwrap().run(1, &|_| ()).unwrap();
    assert_eq!((summary.records, summary.failures[0].code.as_str()), (1, "io.record-column"));
}

#[test]
fn a_folder_of_results_is_read_back_as_it_was_computed() {
    let home = tempfile::tempdir().unwrap();
    let (records, folder) = (records(&home), home.path().join("results"));
    run(&records, &folder, 2);
    let rows = read_results(&folder).unwrap().rows;
    assert_eq!(rows.len(), 10);
    for row in &rows {
        assert_eq!(*row, analysis().row(&row.record, || analysis().open(&row.record)));
    }
    assert!(matches!(read_results(home.path()), Err(AnalysisError::NoRecord)));
}

/// Rows of a modal test have no covariance, so their intervals are those of a normal distribution
/// with the standard error of the row. A mode of an ambient record that is too short has no
/// standard error.
#[test]
fn intervals_of_modes_are_normal_or_absent() {
    let row = |number: usize, error: Option<f64>| {
        let rejected = analysis().row(&format!("r{number}.csv"), || Err(AnalysisError::NoRecord));
        let mode = ModeCell {
            natural_frequency_hz: 10.0 + 0.1 * number as f64,
            natural_frequency_standard_error_hz: error,
            damping_ratio: 0.01,
            damping_ratio_standard_error: error.map(|error| 0.01 * error),
        };
        ResultRow { error: None, modes: vec![mode], ..rejected }
    };
    let trends =
        Trends::from_rows(&[row(0, Some(0.1)), row(1, None), row(2, Some(0.2))], TrendAxis::Order);
    let [low, high] = trends.series[0].points[0].interval.unwrap();
    assert!((low - 10.0 + 0.195_996).abs() < 1e-6 && (high - 10.0 - 0.195_996).abs() < 1e-6);
    for series in &trends.series {
        let known: Vec<bool> = series.points.iter().map(|point| point.interval.is_some()).collect();
        assert_eq!(known, [true, false, true]);
    }
    assert_eq!(trends.without_interval, 2);
    assert!(trends.to_string().contains("note: 2 values without an interval"), "{trends}");
    let all = Trends::from_rows(&[row(0, Some(0.1))], TrendAxis::Order);
    assert!(!all.to_string().contains("without an interval"), "{all}");
}

#[test]
fn trends_find_what_stands_out_and_nothing_else() {
    let rig = analysis().row("rig", || analysis().open(RIG));
    // The values have a normal distribution around 25 kg, except one outlier. The number in the
    // name of a record decreases from record to record.
    let noise = noise::white(Sampling::new(1.0, 2000).unwrap(), 1, 0.2, 7).unwrap();
    let rows: Vec<_> = (0..)
        .zip(noise.channel(0))
        .map(|(k, noise)| {
            let value = if k == 1234 { 30.0 } else { 25.0 + noise };
            let cell = ParameterCell { value, ..rig.parameters[0].clone() };
            let record = format!("speed-{}.csv", 5000 - k);
            mechid_analysis::ResultRow {
                record,
                parameters: vec![cell],
                modes: Vec::new(),
                ..rig.clone()
            }
        })
        .collect();
    let trends = Trends::from_rows(&rows, TrendAxis::Number);
    assert_eq!(
        (trends.records, trends.failed, trends.analyses, trends.series.len()),
        (2000, 0, 1, 1)
    );
    let mass = &trends.series[0];
    assert!((mass.median - 25.0).abs() < 0.02 && (mass.spread - 0.2).abs() < 0.02, "{mass:?}");
    assert!(mass.points.is_sorted_by(|a, b| a.at < b.at));
    assert_eq!(mass.points[0].at, 3001.0);
    let outliers: Vec<&str> = mass.outliers().map(|point| point.record.as_str()).collect();
    assert!(outliers.contains(&"speed-3766.csv"));
    // On average, one of 2,000 values with a normal distribution lies more than 3.5 standard
    // deviations from the mean.
    assert!(outliers.len() <= 4, "{outliers:?}");
    // The interval equals the interval in the row of this record.
    let interval = mass.points[0].interval.unwrap();
    let error = mass.points[0].standard_error.unwrap();
    assert!(interval[1] - interval[0] > 3.9 * error);
    assert_eq!(Trends::from_rows(&rows, TrendAxis::Order).series[0].points[0].at, 1.0);
    assert_eq!(Trends::from_rows(&[rig], TrendAxis::Number).without_number, 1);
}
