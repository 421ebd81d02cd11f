//! Analyses whose results are an [`Answer`]: frequency responses, free decays, modes, sweeps,
//! inspection.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use mechid::analysis::sweep::{SweepSettings, sweep_record};
use mechid::analysis::time_limit::within;
use mechid::analysis::{InspectSettings, RecordPlan};
use mechid::io::FrequencyResponses;
use mechid::{DecaySettings, FrfSettings, ModeSet, ModesSettings};
use pyo3::prelude::*;

use crate::answer::Answer;
use crate::machine::Machine;
use crate::measurement::Measurement;
use crate::responses::ResponseTable;
use crate::simulated::described;
use crate::{failure, work};

/// Estimates frequency responses, averaged over all records; settings are JSON.
#[pyfunction]
#[pyo3(signature = (records, settings, threads))]
pub fn frf(
    py: Python<'_>,
    records: Vec<PyRef<'_, Measurement>>,
    settings: &str,
    threads: Option<usize>,
) -> PyResult<Answer> {
    let how: FrfSettings = failure::settings(py, settings)?;
    let records: Vec<mechid::Measurement> = records.iter().map(|record| record.0.clone()).collect();
    let find = move || mechid::frf_of_records(&records, &how);
    work::watched(py, threads, || Ok(()), find).map(Answer::new)
}

/// Identifies the modes of a free decay; settings are JSON.
#[pyfunction]
#[pyo3(signature = (record, settings, time_limit, threads))]
pub fn decay(
    py: Python<'_>,
    record: PyRef<'_, Measurement>,
    settings: &str,
    time_limit: Option<f64>,
    threads: Option<usize>,
) -> PyResult<Answer> {
    let how: DecaySettings = failure::settings(py, settings)?;
    let record = record.0.clone();
    let find = move || within(time_limit, || mechid::decay(&record, &how));
    work::watched(py, threads, || Ok(()), find).map(Answer::new)
}

/// Identifies the modes of a test with forces, of an ambient record, or of tables of frequency
/// responses; settings are JSON, and diagrams are added on demand.
#[pyfunction]
#[pyo3(signature = (records, tables, settings, diagrams, time_limit, threads))]
pub fn modes(
    py: Python<'_>,
    records: Vec<PyRef<'_, Measurement>>,
    tables: Vec<PyRef<'_, ResponseTable>>,
    settings: &str,
    diagrams: bool,
    time_limit: Option<f64>,
    threads: Option<usize>,
) -> PyResult<Answer> {
    let how: ModesSettings = failure::settings(py, settings)?;
    let records: Vec<mechid::Measurement> = records.iter().map(|record| record.0.clone()).collect();
    let tables: Vec<FrequencyResponses> = tables.iter().map(|table| table.0.clone()).collect();
    let find = move || {
        let mut modes = if tables.is_empty() {
            mechid::modes(&records, &how)?
        } else {
            mechid::modes_of_responses(&tables, &how)?
        };
        if diagrams {
            modes.add_diagrams()?;
        }
        Ok::<_, mechid::analysis::AnalysisError>(modes)
    };
    let find = move || within(time_limit, find);
    work::watched(py, threads, || Ok(()), find).map(Answer::new)
}

/// Compares two sets of modes, each given as a file, or as a name and the JSON of a result; returns
/// JSON and text.
#[pyfunction]
pub fn compare_modes(
    py: Python<'_>,
    first: (PathBuf, Option<String>),
    second: (PathBuf, Option<String>),
) -> PyResult<(String, String)> {
    let [first, second] = [first, second].map(|(path, json)| mode_set(py, path, json));
    let (first, second) = (first?, second?);
    let comparison = work::brief(py, || mechid::compare_modes(&first, &second))?;
    Ok((failure::json(py, &comparison)?, comparison.to_string()))
}

fn mode_set(py: Python<'_>, path: PathBuf, json: Option<String>) -> PyResult<ModeSet> {
    match json {
        None => work::watched(py, None, || Ok(()), move || ModeSet::read(path)),
        Some(json) => {
            let json: serde_json::Value = failure::settings(py, &json)?;
            work::brief(py, || ModeSet::from_json(&path.to_string_lossy(), json))
        }
    }
}

/// Inspects the file of a saved plan; plan and settings are JSON.
#[pyfunction]
pub fn inspect(py: Python<'_>, plan: &str, settings: &str) -> PyResult<Answer> {
    let plan: RecordPlan = failure::settings(py, plan)?;
    let how: InspectSettings = failure::settings(py, settings)?;
    let look = move || mechid::inspect(&plan.path, &plan.reading, &plan.window, &how);
    work::watched(py, None, || Ok(()), look).map(Answer::new)
}

/// Identifies a record, or a described experiment (a JSON file, or a name and a JSON text), at many
/// sampling steps, and calls `progress` with the number of completed steps.
#[pyfunction]
#[pyo3(signature = (record, experiment, settings, reference, progress, threads))]
pub fn sweep(
    py: Python<'_>,
    record: Option<PyRef<'_, Measurement>>,
    experiment: Option<(PathBuf, Option<String>)>,
    settings: &str,
    reference: Option<PyRef<'_, Machine>>,
    progress: Option<Py<PyAny>>,
    threads: Option<usize>,
) -> PyResult<Answer> {
    let how: SweepSettings = failure::settings(py, settings)?;
    let done = Arc::new(AtomicUsize::new(0));
    let count = Arc::clone(&done);
    let step = move || {
        count.fetch_add(1, Ordering::Relaxed);
    };
    let mut reported = 0;
    let tell = || -> PyResult<()> {
        let steps = done.load(Ordering::Relaxed);
        match &progress {
            Some(progress) if steps > reported => {
                reported = steps;
                progress.call1(py, (steps,)).map(drop)
            }
            _ => Ok(()),
        }
    };
    let answer = match (record, experiment) {
        (Some(record), _) => {
            let record = record.0.clone();
            let reference = reference.map(|machine| machine.0.system().clone());
            let find = move || sweep_record(&record, &how, reference.as_ref(), &step);
            work::watched(py, threads, tell, find)?
        }
        (None, experiment) => {
            let (file, text) = experiment.unwrap_or_default();
            let experiment = work::brief(py, || described(&file, text.as_deref()))?;
            work::watched(py, threads, tell, move || mechid::sweep(&experiment, &how, &step))?
        }
    };
    Ok(Answer::new(answer))
}
