//! Tables of frequency responses as the estimators take them.

use std::borrow::Cow;
use std::f64::consts::TAU;

use mechid_estimate::checks::{Finding, after_response_fit, coherence};
use mechid_estimate::frequency_domain::FrequencyData;
use mechid_estimate::{Estimate, Frf};
use mechid_io::{FrequencyResponses, ResponseFunction};
use mechid_model::ResponseQuantity;
use nalgebra::{Complex, DMatrix};

use super::checks::When;
use super::tables::IdentifyResponses;
use super::{Band, added_decay};
use crate::AnalysisError;

/// Noise as a table states it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Noise {
    Stated,
    Coherence,
    Unknown,
}

impl Noise {
    /// Returns where the noise is known from, in words.
    pub(super) fn source(self) -> Option<&'static str> {
        match self {
            Noise::Stated => Some("that follows from the standard errors"),
            Noise::Coherence => Some("that follows from the coherence"),
            Noise::Unknown => None,
        }
    }
}

/// A table as the estimators take it.
pub(super) struct Tabulated {
    pub(super) points: Vec<String>,
    /// Degrees of freedom with a force, counted from 0.
    pub(super) driven: Vec<usize>,
    pub(super) noise: Noise,
    pub(super) data: FrequencyData,
    /// Responses with their coherence, to be checked, and the degrees of freedom of their forces.
    coherent: Coherent,
}

impl Tabulated {
    pub(super) fn of(
        table: &FrequencyResponses,
        how: &IdentifyResponses,
    ) -> Result<Self, AnalysisError> {
        let measured = quantity(table, how)?;
        let table = &match table.added_decay {
            Some(rate) => Cow::Owned(added_decay::as_derivatives(table, measured, rate)),
            None => Cow::Borrowed(table),
        };
        let points = match how.points.is_empty() {
            true => distinct(table.functions.iter().map(|f| &f.response)),
            false => how.points.clone(),
        };
        let mut forces = distinct(table.functions.iter().map(|f| &f.reference));
        if !how.points.is_empty() {
            forces.retain(|force| points.contains(force));
        }
        let missing = |response: &str, force: &str| AnalysisError::NoResponse {
            file: table.file.clone(),
            response: response.into(),
            force: force.into(),
        };
        let place = |force: &String| {
            let at = points.iter().position(|point| point == force);
            at.ok_or_else(|| missing(force, force))
        };
        let driven: Vec<usize> = forces.iter().map(place).collect::<Result<_, _>>()?;
        if driven.is_empty() {
            return Err(missing(&points.join(", "), &points.join(", ")));
        }
        let mut functions: Vec<Vec<&ResponseFunction>> = Vec::new();
        for point in &points {
            let find = |force: &String| {
                let of_pair = |f: &&ResponseFunction| f.response == *point && f.reference == *force;
                table.functions.iter().find(of_pair).ok_or_else(|| missing(point, force))
            };
            functions.push(forces.iter().map(find).collect::<Result<_, _>>()?);
        }
        let rows = rows(table, how.band)?;
        let omega: Vec<f64> = rows.iter().map(|row| TAU * table.frequency_hz[*row]).collect();
        let matrix = |of: &dyn Fn(&ResponseFunction) -> Complex<f64>| {
            DMatrix::from_fn(points.len(), forces.len(), |i, j| of(functions[i][j]))
        };
        let response: Vec<_> =
            rows.iter().map(|row| matrix(&|function| function.values[*row])).collect();
        let from_responses = FrequencyData::from_responses;
        let all = functions.iter().flatten();
        if all.clone().all(|f| f.standard_error.is_some()) {
            let error = |f: &ResponseFunction, row: usize| match &f.standard_error {
                Some(errors) => Complex::from(2.0 * errors[row] * errors[row]),
                None => Complex::default(),
            };
            let variance: Vec<_> =
                rows.iter().map(|row| matrix(&|f| error(f, *row)).map(|z| z.re)).collect();
            let data = from_responses(&omega, &response, Some(&variance), measured, &driven)?;
            return Ok(Self { points, driven, noise: Noise::Stated, data, coherent: Vec::new() });
        }
        let Some(coherent) = coherent(table, how, &points, &forces, &rows, &response)? else {
            let data = from_responses(&omega, &response, None, measured, &driven)?;
            return Ok(Self { points, driven, noise: Noise::Unknown, data, coherent: Vec::new() });
        };
        let mut data: Option<FrequencyData> = None;
        for (frf, dofs) in &coherent {
            let one = frf.data(dofs)?;
            data = Some(match data {
                None => one,
                Some(before) => before.and(&one)?,
            });
        }
        let data = data.ok_or(AnalysisError::NoRecord)?;
        Ok(Self { points, driven, noise: Noise::Coherence, data, coherent })
    }

    /// Returns the findings before and after the fit; `all` is the number of rows of all tables.
    pub(super) fn findings(
        &self,
        estimate: &Estimate,
        all: usize,
    ) -> Result<Vec<(When, Finding)>, AnalysisError> {
        let mut findings = Vec::new();
        for (frf, driven) in &self.coherent {
            let share = (driven.len() * frf.omega().len()) as f64 / all as f64;
            let fitted = share * estimate.parameters().len() as f64;
            let after = after_response_fit(frf, driven, estimate, fitted)?;
            findings.extend(coherence(frf).map(|finding| (When::Before, finding)));
            findings.extend(after.into_iter().map(|finding| (When::After, finding)));
        }
        Ok(findings)
    }
}

/// Returns the responses of a table as the estimators take them, and in words where their noise is
/// known from.
pub(crate) fn response_data(
    table: &FrequencyResponses,
    how: &IdentifyResponses,
) -> Result<(FrequencyData, Option<&'static str>), AnalysisError> {
    if table.added_decay.is_some() {
        let why = format!("{} is of an exponential window, which is for `identify`", table.file);
        return Err(AnalysisError::Setting { setting: "exponential_percent", why });
    }
    let tabulated = Tabulated::of(table, how)?;
    Ok((tabulated.data, tabulated.noise.source()))
}

/// Returns the quantity that the table states or the settings give.
fn quantity(
    table: &FrequencyResponses,
    how: &IdentifyResponses,
) -> Result<ResponseQuantity, AnalysisError> {
    let mut stated = table.functions.iter().filter_map(|f| f.quantity);
    let refuse = |why: String| Err(AnalysisError::Setting { setting: "quantity", why });
    match (stated.clone().next(), how.quantity) {
        (None, None) => refuse(format!(
            "{} does not say what was measured: displacement, velocity or acceleration per force",
            table.file
        )),
        (Some(of_file), Some(given)) if of_file != given => {
            refuse(format!("{} states {of_file}, not {given}", table.file))
        }
        (Some(of_file), _) => match stated.find(|quantity| *quantity != of_file) {
            None => Ok(of_file),
            Some(other) => refuse(format!(
                "{} has responses of {of_file} and of {other}: choose `points` of one kind",
                table.file
            )),
        },
        (None, Some(given)) => Ok(given),
    }
}

/// Returns the rows of a table inside the band, without that of 0 Hz.
fn rows(table: &FrequencyResponses, band: Option<Band>) -> Result<Vec<usize>, AnalysisError> {
    let Band { low_hz, high_hz } = band.unwrap_or(Band { low_hz: 0.0, high_hz: f64::INFINITY });
    let hz = &table.frequency_hz;
    let rows: Vec<usize> =
        (0..hz.len()).filter(|at| hz[*at] > 0.0 && (low_hz..=high_hz).contains(&hz[*at])).collect();
    if rows.is_empty() {
        let (first_hz, last_hz) = (hz[0], hz[hz.len() - 1]);
        return Err(AnalysisError::EmptyBand { low_hz, high_hz, first_hz, last_hz });
    }
    Ok(rows)
}

/// Frequency responses with their coherence, and the degrees of freedom of their forces.
type Coherent = Vec<(Frf, Vec<usize>)>;

/// Returns the responses with the coherence of the table: of all forces together where it is multiple,
/// otherwise of each by itself; `None` if the table has none.
fn coherent(
    table: &FrequencyResponses,
    how: &IdentifyResponses,
    points: &[String],
    forces: &[String],
    rows: &[usize],
    response: &[DMatrix<Complex<f64>>],
) -> Result<Option<Coherent>, AnalysisError> {
    let measured = quantity(table, how)?;
    let omega: Vec<f64> = rows.iter().map(|row| TAU * table.frequency_hz[*row]).collect();
    let of = |point: &String, force: Option<&String>| {
        let fits = |c: &&mechid_io::CoherenceFunction| {
            c.response == *point && c.reference.as_ref() == force
        };
        table.coherence.iter().find(fits).map(|c| &c.values)
    };
    let columns = |force: Option<&String>| -> Option<DMatrix<f64>> {
        let each: Option<Vec<&Vec<f64>>> = points.iter().map(|point| of(point, force)).collect();
        each.map(|each| DMatrix::from_fn(rows.len(), points.len(), |row, at| each[at][rows[row]]))
    };
    let together = columns(None);
    let apart: Option<Vec<_>> = forces.iter().map(|force| columns(Some(force))).collect();
    if together.is_none() && apart.is_none() {
        return Ok(None);
    }
    let Some(averages) = how.averages else {
        let why = format!(
            "{} has coherences: from how many independent averages? (The standard errors follow from both)",
            table.file
        );
        return Err(AnalysisError::Setting { setting: "averages", why });
    };
    let dof = |force: &String| points.iter().position(|point| point == force);
    let driven: Vec<usize> = forces.iter().filter_map(dof).collect();
    let frf = |response: Vec<DMatrix<Complex<f64>>>, coherence: DMatrix<f64>| {
        Frf::new(omega.clone(), response, coherence, averages, measured)
    };
    if let Some(apart) = apart {
        let each = apart.into_iter().enumerate().map(|(force, coherence)| {
            let column = response.iter().map(|h| h.columns(force, 1).into_owned()).collect();
            Ok((frf(column, coherence)?, vec![driven[force]]))
        });
        return Ok(Some(each.collect::<Result<_, AnalysisError>>()?));
    }
    match together {
        Some(coherence) => Ok(Some(vec![(frf(response.to_vec(), coherence)?, driven)])),
        None => Ok(None),
    }
}

/// Returns the different texts, in the order in which they first appear.
fn distinct<'a>(texts: impl Iterator<Item = &'a String>) -> Vec<String> {
    let mut all: Vec<String> = Vec::new();
    for text in texts {
        if !all.contains(text) {
            all.push(text.clone());
        }
    }
    all
}
