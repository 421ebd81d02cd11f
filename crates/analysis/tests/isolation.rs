//! Tests with records that make the analysing process end. The tests start this same program again
//! as the analysing process, so it has its own `main`.

use std::fs;
use std::io::{stdin, stdout};
use std::path::{Path, PathBuf};

use mechid_analysis::fleet::{Fleet, FleetSummary, Isolation, serve};
use mechid_analysis::{AnalysisError, Channels, ResponseQuantity, SavedAnalysis, Window};

/// Argument that makes this program analyse records for a fleet.
const SERVE: &str = "serve";

const RIG: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/machine.csv");

fn main() {
    if std::env::args().nth(1).as_deref() == Some(SERVE) {
        serve(stdin(), stdout()).unwrap();
        return;
    }
    rows_are_those_of_one_process();
    a_program_that_ends_makes_rows();
    #[cfg(target_os = "linux")]
    {
        limits::records_beyond_the_limits_make_rows();
        limits::the_record_that_ends_the_process_has_the_error();
    }
}

fn analysis() -> SavedAnalysis {
    SavedAnalysis {
        channels: Channels::new("force", ResponseQuantity::Displacement, "displacement"),
        window: Window { period: Some(256), ..Window::default() },
        ..SavedAnalysis::default()
    }
}

fn isolation() -> Isolation {
    Isolation::new(std::env::current_exe().unwrap(), vec![SERVE.into()])
}

fn run(
    analysis: SavedAnalysis,
    records: &[PathBuf],
    folder: &Path,
    isolation: &Isolation,
) -> Result<FleetSummary, AnalysisError> {
    Fleet::new(analysis, records, folder, 2)?.run_isolated(2, isolation, &|_| ())
}

/// The rows of a fleet have the same bytes whether one process or several compute them.
fn rows_are_those_of_one_process() {
    let home = tempfile::tempdir().unwrap();
    let records = [RIG.into(), "lost.csv".into(), home.path().join("empty.csv")];
    fs::write(&records[2], "").unwrap();
    let [apart, together] = ["apart", "together"].map(|name| home.path().join(name));
    let summary = run(analysis(), &records, &apart, &isolation()).unwrap();
    let fleet = Fleet::new(analysis(), &records, &together, 2).unwrap();
    let other = fleet.run(1, &|_| ()).unwrap();
    assert_eq!((summary.records, summary.failed), (3, 2));
    assert_eq!(summary.failures, other.failures);
    for part in fleet.parts() {
        let read = |folder: &Path| fs::read(folder.join(part.file_name())).unwrap();
        assert!(read(&apart) == read(&together), "{}", part.file_name());
    }
}

fn a_program_that_ends_makes_rows() {
    let home = tempfile::tempdir().unwrap();
    let by = |program: &str, script: &str| {
        let isolation = Isolation::new(program, vec!["-c".into(), script.into()]);
        run(analysis(), &[RIG.into()], &home.path().join(script.len().to_string()), &isolation)
    };
    let ended = by("sh", "printf '\\0\\0\\0\\0'; echo it is over >&2; exit 3").unwrap();
    assert_eq!(ended.failures[0].code, "analysis.record-process");
    let message = &ended.failures[0].message;
    assert!(message.contains("exit status: 3: it is over"), "{message}");
    let killed = by("sh", "printf '\\0\\0\\0\\0'; kill -SEGV $$").unwrap();
    assert!(killed.failures[0].message.contains("signal: 11"), "{}", killed.failures[0].message);
    // A program whose output has another format sends no row.
    let chatty = by("sh", "printf '\\0\\0\\0\\0\\4\\0\\0\\0abcd'; cat > /dev/null").unwrap();
    assert_eq!(chatty.failures[0].code, "analysis.record-process");
    // If the program cannot start or does not exist, the error is that of the run and not of a
    // record.
    let error = by("sh", "echo no such module >&2; exit 1").unwrap_err().to_string();
    assert!(error.contains("exit status: 1: no such module"), "{error}");
    let missing = Isolation::new("no such program", Vec::new());
    let folder = home.path().join("missing");
    let error = run(analysis(), &[RIG.into()], &folder, &missing).unwrap_err();
    assert!(matches!(error, AnalysisError::RecordProcess { .. }), "{error}");
    assert_eq!(fs::read_dir(folder).unwrap().count(), 0);
    let wrong = Isolation { record_seconds: f64::NAN, ..isolation() };
    let error = run(analysis(), &[RIG.into()], home.path(), &wrong).unwrap_err();
    assert!(matches!(error, AnalysisError::Setting { setting: "record_seconds", .. }), "{error}");
}

/// Limits of memory, which only Linux enforces.
#[cfg(target_os = "linux")]
mod limits {
    use std::fmt::Write as _;
    use std::fs;

    use mechid_analysis::fleet::{Fleet, Isolation, read_results};
    use mechid_analysis::{Reading, SavedAnalysis};
    use mechid_io::{ParquetColumn, ParquetValues, write_parquet};

    use super::{RIG, analysis, isolation, run};

    /// Text of a table with this many columns and rows; each number takes eight bytes in memory.
    fn table(columns: usize, rows: usize) -> String {
        let mut text = String::from("time,force,displacement");
        (3..columns).for_each(|column| write!(text, ",c{column}").unwrap());
        let rest = ",1".repeat(columns - 1);
        (0..rows).for_each(|row| write!(text, "\n{row}{rest}").unwrap());
        text + "\n"
    }

    pub fn records_beyond_the_limits_make_rows() {
        let home = tempfile::tempdir().unwrap();
        let at = |name: &str| home.path().join(name);
        // The 40 million numbers take 320 MB, which the settings of the reading allow.
        fs::write(at("large.csv"), table(2000, 20_000)).unwrap();
        let records = [RIG.into(), at("large.csv")];
        let reading = Reading { memory_gb: Some(50.0), ..Reading::default() };
        let analysis = SavedAnalysis { reading, ..analysis() };
        let little = Isolation { record_memory_gb: 0.3, ..isolation() };
        let summary = run(analysis.clone(), &records, &at("little"), &little).unwrap();
        assert_eq!((summary.records, summary.failed), (2, 1));
        assert_eq!(summary.failures[0].code, "analysis.record-memory", "{summary}");
        assert!(summary.failures[0].message.contains("more than 0.3 GB of memory"), "{summary}");
        let hasty = Isolation { record_seconds: 1e-6, ..isolation() };
        let summary = run(analysis, &records, &at("hasty"), &hasty).unwrap();
        assert_eq!((summary.failed, &*summary.failures[0].code), (2, "analysis.record-time"));
    }

    /// Several records are read together, and one of them is too large for the process: only the
    /// row of this record has the error.
    pub fn the_record_that_ends_the_process_has_the_error() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("many.parquet");
        let rig = fs::read_to_string(RIG).unwrap();
        let rows: Vec<Vec<f64>> = rig
            .lines()
            .skip(1)
            .map(|line| line.split(',').map(|number| number.parse().unwrap()).collect())
            .collect();
        // The second record needs more memory than the limit.
        let counts = [("a", 1), ("b", 8_000), ("c", 1)];
        let ids =
            counts.iter().flat_map(|(id, count)| vec![Some((*id).to_owned()); count * rows.len()]);
        let repeats: usize = counts.iter().map(|(_, count)| count).sum();
        let column = |at: usize| {
            let one = rows.iter().map(|row| Some(row[at]));
            ParquetValues::Number(one.collect::<Vec<_>>().repeat(repeats))
        };
        let columns = [
            ParquetColumn { name: "day", values: ParquetValues::Text(ids.collect()) },
            ParquetColumn { name: "force", values: column(1) },
            ParquetColumn { name: "displacement", values: column(2) },
        ];
        write_parquet(&path, &columns, &[]).unwrap();
        drop(columns);
        let reading = Reading {
            record_column: Some("day".into()),
            sample_rate_hz: Some(128.0),
            memory_gb: Some(50.0),
            ..Reading::default()
        };
        let analysis = SavedAnalysis { reading, ..analysis() };
        let little = Isolation { record_memory_gb: 0.05, ..isolation() };
        let results = home.path().join("results");
        let summary =
            Fleet::new(analysis, &[path], &results, 3).unwrap().run_isolated(1, &little, &|_| ());
        let summary = summary.unwrap();
        assert_eq!((summary.records, summary.failed), (3, 1), "{summary}");
        let rows = read_results(&results).unwrap().rows;
        let failed: Vec<_> = rows.iter().filter(|row| row.error.is_some()).collect();
        assert_eq!((failed.len(), failed[0].record_id.as_deref()), (1, Some("b")));
        assert_eq!(failed[0].error.as_ref().unwrap().code, "analysis.record-memory");
    }
}
