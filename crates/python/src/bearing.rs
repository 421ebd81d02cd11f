//! Bearing tests.

use mechid::analysis::bearing::BearingPlan;
use mechid::analysis::time_limit::within;
use mechid::io::FrequencyResponses;
use mechid::{BearingData, IdentifyBearing, identify_bearing};
use pyo3::prelude::*;

use crate::answer::Answer;
use crate::measurement::Measurement;
use crate::responses::ResponseTable;
use crate::{failure, work};

/// Identifies a bearing from records. If there are baseline records, subtracts their coefficients.
/// Settings are JSON.
#[pyfunction]
#[pyo3(signature = (tests, baseline, settings, time_limit, threads))]
pub fn bearing(
    py: Python<'_>,
    tests: Vec<PyRef<'_, Measurement>>,
    baseline: Vec<PyRef<'_, Measurement>>,
    settings: &str,
    time_limit: Option<f64>,
    threads: Option<usize>,
) -> PyResult<Answer> {
    let how: IdentifyBearing = failure::settings(py, settings)?;
    let [tests, baseline] = [tests, baseline].map(|records| {
        records.iter().map(|record| record.0.clone()).collect::<Vec<mechid::Measurement>>()
    });
    let find = move || {
        let dry = (!baseline.is_empty()).then(|| BearingData::from_records(&baseline, &how));
        identify_bearing(&BearingData::from_records(&tests, &how)?, dry.transpose()?.as_ref(), &how)
    };
    let find = move || within(time_limit, find);
    work::watched(py, threads, || Ok(()), find).map(Answer::new)
}

/// Identifies a bearing from tables of frequency responses. If there are baseline tables, subtracts
/// their coefficients. Settings are JSON.
#[pyfunction]
#[pyo3(signature = (tests, baseline, settings, time_limit, threads))]
pub fn bearing_of_responses(
    py: Python<'_>,
    tests: Vec<PyRef<'_, ResponseTable>>,
    baseline: Vec<PyRef<'_, ResponseTable>>,
    settings: &str,
    time_limit: Option<f64>,
    threads: Option<usize>,
) -> PyResult<Answer> {
    let how: IdentifyBearing = failure::settings(py, settings)?;
    let [tests, baseline] = [tests, baseline].map(|tables| {
        tables.iter().map(|table| table.0.clone()).collect::<Vec<FrequencyResponses>>()
    });
    let find = move || {
        let dry = (!baseline.is_empty()).then(|| BearingData::from_responses(&baseline, &how));
        identify_bearing(
            &BearingData::from_responses(&tests, &how)?,
            dry.transpose()?.as_ref(),
            &how,
        )
    };
    let find = move || within(time_limit, find);
    work::watched(py, threads, || Ok(()), find).map(Answer::new)
}

/// Identifies a bearing at the speeds and loads of a campaign, whose description is JSON.
#[pyfunction]
#[pyo3(signature = (campaign, threads))]
pub fn bearing_campaign(
    py: Python<'_>,
    campaign: &str,
    threads: Option<usize>,
) -> PyResult<Answer> {
    let plan: BearingPlan = failure::settings(py, campaign)?;
    work::watched(py, threads, || Ok(()), move || plan.run()).map(Answer::new)
}
