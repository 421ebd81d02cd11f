//! Conversion of tables of frequency responses to data for the estimators.

use std::borrow::Cow;
use std::f64::consts::TAU;

use mechid_checks::{Finding, after_response_fit, after_table_fit, coherence, leakage};
use mechid_estimate::Estimate;
use mechid_io::{CoherenceFunction, Direction, FrequencyResponses, ResponseFunction};
use mechid_model::ResponseQuantity;
use mechid_signal::Sampling;
use mechid_spectra::frf::{Frf, Segments};
use mechid_spectra::{FrequencyData, Lines};
use nalgebra::{Complex, DMatrix};

use super::checks::When;
use super::response_settings::IdentifyResponses;
use super::structure::Form;
use super::{Band, added_decay};
use crate::AnalysisError;
use crate::limits::COHERENCE_OF_ONE;

/// Noise as stated by a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Noise {
    Stated,
    Coherence,
    Unknown,
}

impl Noise {
    /// Returns the origin of the noise level, in words.
    pub(super) fn source(self) -> Option<&'static str> {
        match self {
            Noise::Stated => Some("that follows from the standard errors"),
            Noise::Coherence => Some("that follows from the coherence"),
            Noise::Unknown => None,
        }
    }
}

/// Responses of a table, sorted by their points.
struct Layout<'a> {
    points: Vec<String>,
    /// Points of the forces.
    forces: Vec<String>,
    /// Degrees of freedom with a force, counted from 0.
    driven: Vec<usize>,
    /// Responses, points × forces.
    functions: Vec<Vec<&'a ResponseFunction>>,
}

impl<'a> Layout<'a> {
    /// Finds the responses at the `chosen` points, or at all of them if none is chosen.
    fn new(table: &'a FrequencyResponses, chosen: &[String]) -> Result<Self, AnalysisError> {
        let points = if chosen.is_empty() {
            distinct(table.functions.iter().map(|f| &f.response))
        } else {
            chosen.to_vec()
        };
        let mut forces = distinct(table.functions.iter().map(|f| &f.reference));
        if !chosen.is_empty() {
            forces.retain(|force| points.contains(force));
        }
        let missing = |response: &str, force: &str| AnalysisError::NoResponse {
            file: table.file.clone(),
            response: response.into(),
            force: force.into(),
            advice: reciprocity(table, force),
        };
        let index = |force: &String| {
            let at = points.iter().position(|point| point == force);
            at.ok_or_else(|| missing(force, force))
        };
        let driven: Vec<usize> = forces.iter().map(index).collect::<Result<_, _>>()?;
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
        Ok(Self { points, forces, driven, functions })
    }
}

/// Returns advice for a force at a point without a measured response, for instance from a roving
/// hammer.
fn reciprocity(table: &FrequencyResponses, force: &str) -> &'static str {
    if table.functions.iter().any(|f| f.response == force) {
        return "";
    }
    "; by reciprocity (`structure` symmetric) a row of responses also serves as a column"
}

/// Returns a table in which reciprocal responses replace missing responses, with a remark on this.
/// Returns the table itself if `structure` is not symmetric, if points are chosen, if the responses
/// to every force are complete, or if reciprocity cannot complete the responses to any force.
///
/// # Source
/// Ewins, *Modal Testing*, 2nd ed. (2000), section 2.5 (symmetric matrices have a symmetric
/// receptance).
fn with_reciprocal<'a>(
    table: Cow<'a, FrequencyResponses>,
    how: &IdentifyResponses,
) -> (Cow<'a, FrequencyResponses>, Option<String>) {
    let functions = &table.functions;
    let is_there = |all: &[ResponseFunction], response: &String, reference: &String| {
        all.iter().any(|f| f.response == *response && f.reference == *reference)
    };
    let responses = distinct(functions.iter().map(|f| &f.response));
    let is_whole = |force: &&String| {
        responses.contains(force) && responses.iter().all(|p| is_there(functions, p, force))
    };
    let is_symmetric = how.structure.forms.contains(&Form::Symmetric);
    let forces = distinct(functions.iter().map(|f| &f.reference));
    if !is_symmetric || !how.points.is_empty() || forces.iter().all(|force| is_whole(&force)) {
        return (table, None);
    }
    let mut completed = functions.clone();
    for function in functions {
        if !is_there(&completed, &function.reference, &function.response) {
            let mut reciprocal = function.clone();
            std::mem::swap(&mut reciprocal.response, &mut reciprocal.reference);
            completed.push(reciprocal);
        }
    }
    let points = distinct(completed.iter().map(|f| &f.response));
    let is_whole = |force: &String| points.iter().all(|point| is_there(&completed, point, force));
    let whole: Vec<String> = forces.into_iter().filter(is_whole).collect();
    if whole.is_empty() {
        return (table, None);
    }
    completed.retain(|f| whole.contains(&f.reference));
    let remark = format!(
        "{0} has responses at {1} to forces at other points. By reciprocity these responses are also used as the \
         responses at the other points to a force at {1}",
        table.file,
        whole.join(", ")
    );
    let mut reciprocal = table.into_owned();
    for coherence in &mut reciprocal.coherence {
        let CoherenceFunction { response, reference: Some(reference), .. } = coherence else {
            continue;
        };
        if whole.contains(response) && !whole.contains(reference) {
            std::mem::swap(response, reference);
        }
    }
    reciprocal.functions = completed;
    (Cow::Owned(reciprocal), Some(remark))
}

/// A table converted to data for the estimators.
pub(super) struct Tabulated {
    pub(super) points: Vec<String>,
    /// Degrees of freedom with a force, counted from 0.
    pub(super) driven: Vec<usize>,
    pub(super) noise: Noise,
    pub(super) data: FrequencyData,
    /// Responses with their coherence, for checks, and the degrees of freedom of their forces.
    coherent: Coherent,
    /// Responses to each force separately, with its degree of freedom; empty if a coherence states
    /// the noise.
    columns: Vec<(FrequencyData, usize)>,
    /// `true` if the responses are averages over segments, and their window and number
    /// are known.
    is_averaged: bool,
    /// Remarks on entries of the table that were not used.
    pub(super) remarks: Vec<String>,
}

impl Tabulated {
    pub(super) fn new(
        table: &FrequencyResponses,
        how: &IdentifyResponses,
    ) -> Result<Self, AnalysisError> {
        let measured = quantity(table, how)?;
        let table = with_positive_directions(table, &how.points);
        let (table, by_reciprocity) = with_reciprocal(table, how);
        let table: &FrequencyResponses = &table;
        let table = &match table.added_decay {
            Some(rate) => Cow::Owned(added_decay::as_derivatives(table, measured, rate)),
            None => Cow::Borrowed(table),
        };
        let Layout { points, forces, driven, functions } = Layout::new(table, &how.points)?;
        let rows = rows(table, how.band)?;
        let omega: Vec<f64> = rows.iter().map(|row| TAU * table.frequency_hz[*row]).collect();
        let response: Vec<DMatrix<Complex<f64>>> = rows
            .iter()
            .map(|row| {
                DMatrix::from_fn(points.len(), forces.len(), |i, j| functions[i][j].values[*row])
            })
            .collect();
        let errors = standard_errors(&functions, &rows);
        let stated = errors.is_some();
        let averaged = Averaged::from_table(table, &rows)?;
        let is_averaged = averaged.is_some();
        let is_certain = !is_averaged && !stated && is_without_noise(table, &rows);
        let mut remarks = Vec::from_iter(by_reciprocity);
        remarks.extend(noise_remarks(table, how, is_averaged, is_certain));
        if (is_averaged || !stated) && !is_certain {
            let tables = Columns { points: &points, forces: &forces, rows: &rows, measured };
            let coherent = tables.coherent(table, how, &response, averaged, errors.as_deref())?;
            if let Some(coherent) = coherent {
                let data = averages_of(&coherent)?;
                let noise = if stated { Noise::Stated } else { Noise::Coherence };
                let columns = Vec::new();
                return Ok(Self {
                    points,
                    driven,
                    noise,
                    data,
                    coherent,
                    columns,
                    is_averaged,
                    remarks,
                });
            }
        }
        if is_averaged {
            remarks.push(uncorrected(table, "segments are stated, but no coherence"));
        }
        let noise = if stated { Noise::Stated } else { Noise::Unknown };
        let columns = columns(&omega, &response, errors.as_deref(), measured, &driven)?;
        let data = together(columns.iter().map(|(data, _)| Ok(data.clone())))?;
        let (coherent, is_averaged) = (Vec::new(), false);
        Ok(Self { points, driven, noise, data, coherent, columns, is_averaged, remarks })
    }

    /// Returns the responses as averages over segments whose window and number are known, with the
    /// degrees of freedom of the forces; `None` if the table does not state the segments.
    pub(super) fn averaged(&self) -> Option<&Coherent> {
        self.is_averaged.then_some(&self.coherent)
    }

    /// Replaces the averaged responses by responses that are corrected for the bias of the window.
    pub(super) fn replace(
        &mut self,
        responses: &mut dyn Iterator<Item = Frf>,
    ) -> Result<(), AnalysisError> {
        for ((frf, _), other) in self.coherent.iter_mut().zip(responses) {
            *frf = other;
        }
        self.data = averages_of(&self.coherent)?;
        Ok(())
    }

    /// Returns the findings before and after the fit. `all` is the number of rows of all tables;
    /// `settled` states whether the bias of the window was separated from the system.
    pub(super) fn findings(
        &self,
        estimate: &Estimate,
        all: usize,
        settled: bool,
    ) -> Result<Vec<(When, Finding)>, AnalysisError> {
        let (mut findings, modes) = (Vec::new(), estimate.modes()?);
        if !self.columns.is_empty() {
            let after = after_table_fit(&self.columns, estimate)?.into_iter().flatten();
            findings.extend(after.map(|finding| (When::After, finding)));
        }
        for (frf, driven) in &self.coherent {
            let share = (driven.len() * frf.omega().len()) as f64 / all as f64;
            let fitted = share * estimate.parameters().len() as f64;
            let after = after_response_fit(frf, driven, estimate, fitted)?;
            findings.extend(coherence(frf).map(|finding| (When::Before, finding)));
            let blunt = leakage(frf, &modes, settled);
            findings.extend(after.into_iter().chain(blunt).map(|finding| (When::After, finding)));
        }
        Ok(findings)
    }
}

/// Returns the remark that the bias of the window was not corrected, with the reason.
fn uncorrected(table: &FrequencyResponses, why: &str) -> String {
    format!("{}: {why}: the bias of the window was not corrected", table.file)
}

/// Returns remarks on the noise that a table states. `is_averaged` states whether the segments of
/// the table are used. `is_certain` states whether the coherence of the table is 1, so that it
/// contains no information about the noise.
fn noise_remarks(
    table: &FrequencyResponses,
    how: &IdentifyResponses,
    is_averaged: bool,
    is_certain: bool,
) -> Vec<String> {
    let mut remarks = Vec::new();
    if table.segments.is_some() && !is_averaged {
        let why = "its frequencies are not those of the stated segments";
        remarks.push(uncorrected(table, why));
    }
    if is_averaged && how.averages.is_some() {
        remarks.push(format!(
            "{}: the table states its segments, which determine the number of averages; `averages` was not used",
            table.file
        ));
    }
    if is_certain {
        remarks.push(format!(
            "{}: a coherence of 1 shows no noise; the noise was estimated from the residual",
            table.file
        ));
    }
    remarks
}

/// Returns the standard errors (points × forces) at some rows of a table; `None` unless every
/// response has a standard error.
fn standard_errors(
    functions: &[Vec<&ResponseFunction>],
    rows: &[usize],
) -> Option<Vec<DMatrix<f64>>> {
    let stated: Vec<Vec<&Vec<f64>>> = functions
        .iter()
        .map(|of_point| of_point.iter().map(|f| f.standard_error.as_ref()).collect())
        .collect::<Option<_>>()?;
    let (points, forces) = (stated.len(), stated.first().map_or(0, Vec::len));
    let at_row = |row: &usize| DMatrix::from_fn(points, forces, |i, j| stated[i][j][*row]);
    Some(rows.iter().map(at_row).collect())
}

/// Returns the responses to each force separately, with its degree of freedom.
fn columns(
    omega: &[f64],
    response: &[DMatrix<Complex<f64>>],
    errors: Option<&[DMatrix<f64>]>,
    measured: ResponseQuantity,
    driven: &[usize],
) -> Result<Vec<(FrequencyData, usize)>, AnalysisError> {
    let column = |(input, dof): (usize, &usize)| {
        let response: Vec<_> = response.iter().map(|h| h.columns(input, 1).into_owned()).collect();
        // The real and the imaginary part each have this standard error, so the variance of the
        // complex value is twice the square of the standard error.
        let variance: Option<Vec<_>> = errors.map(|errors| {
            errors.iter().map(|e| e.columns(input, 1).map(|e| 2.0 * e * e)).collect()
        });
        let variance = variance.as_deref();
        let data = FrequencyData::from_responses(omega, &response, variance, measured, &[*dof])?;
        Ok((data, *dof))
    };
    driven.iter().enumerate().map(column).collect()
}

/// Returns the responses with points in positive directions: a force or a response in −Z becomes a
/// force or a response in +Z with the opposite sign. Points requested in negative directions are
/// unchanged.
pub(crate) fn with_positive_directions<'a>(
    table: &'a FrequencyResponses,
    points: &[String],
) -> Cow<'a, FrequencyResponses> {
    let is_negative = |point: &String| {
        Direction::parse(point).is_some_and(|one| one.is_negative && one.node().is_some())
    };
    let mut directions = table.functions.iter().flat_map(|f| [&f.response, &f.reference]);
    if !directions.any(is_negative) || points.iter().any(is_negative) {
        return Cow::Borrowed(table);
    }
    let mut positive = table.clone();
    let turn = |point: &mut String| {
        let positive = Direction::parse(point).filter(|_| is_negative(point));
        let positive = positive.map(|direction| direction.positive_name());
        let is_turned = positive.is_some();
        *point = positive.unwrap_or_else(|| std::mem::take(point));
        is_turned
    };
    for function in &mut positive.functions {
        if turn(&mut function.response) != turn(&mut function.reference) {
            function.values.iter_mut().for_each(|value| *value = -*value);
        }
    }
    for coherence in &mut positive.coherence {
        turn(&mut coherence.response);
        if let Some(reference) = &mut coherence.reference {
            turn(reference);
        }
    }
    Cow::Owned(positive)
}

/// Returns the responses of a table as data for the estimators, and the origin of the noise level
/// in words.
pub(crate) fn response_data(
    table: &FrequencyResponses,
    how: &IdentifyResponses,
) -> Result<(FrequencyData, Option<&'static str>), AnalysisError> {
    if table.added_decay.is_some() {
        let why = format!(
            "{} was measured with an exponential window, which adds damping: use a table without this window",
            table.file
        );
        return Err(AnalysisError::Setting { setting: "exponential_percent", why });
    }
    let tabulated = Tabulated::new(table, how)?;
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
                "{} has responses of {of_file} and of {other}: choose `points` with one quantity",
                table.file
            )),
        },
        (None, Some(given)) => Ok(given),
    }
}

/// Returns the rows of a table inside the band, excluding 0 Hz.
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
pub(super) type Coherent = Vec<(Frf, Vec<usize>)>;

/// Concatenates responses into the data of one fit.
fn averages_of(coherent: &Coherent) -> Result<FrequencyData, AnalysisError> {
    together(coherent.iter().map(|(frf, dofs)| Ok(frf.data(dofs)?)))
}

/// Returns the data of all tables, concatenated.
pub(super) fn joined(measured: &[Tabulated]) -> Result<FrequencyData, AnalysisError> {
    together(measured.iter().map(|one| Ok(one.data.clone())))
}

/// Concatenates data for one fit.
fn together(
    mut each: impl Iterator<Item = Result<FrequencyData, AnalysisError>>,
) -> Result<FrequencyData, AnalysisError> {
    let first = each.next().ok_or(AnalysisError::NoRecord)??;
    each.try_fold(first, |data, next| Ok(data.and(&next?)?))
}

/// Returns whether the median coherence of a table on the given rows is 1, except for rounding.
fn is_without_noise(table: &FrequencyResponses, rows: &[usize]) -> bool {
    let values = table.coherence.iter().flat_map(|c| rows.iter().map(|row| c.values[*row]));
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).is_some_and(|median| 1.0 - median < COHERENCE_OF_ONE)
}

/// Segments over which the responses of a table were averaged.
struct Averaged {
    lines: Lines,
    segments: Segments,
    count: usize,
}

/// Largest distance of a frequency from a line, in lines, that counts as rounding in the file.
const OF_LINE: f64 = 1e-3;

impl Averaged {
    /// Returns the stated segments of a table; `None` if the table states none, or if its
    /// frequencies are not lines of these segments.
    fn from_table(
        table: &FrequencyResponses,
        rows: &[usize],
    ) -> Result<Option<Self>, AnalysisError> {
        let Some(stated) = table.segments else { return Ok(None) };
        let per_line_hz = stated.sample_rate_hz / stated.samples as f64;
        let lines = rows.iter().map(|row| table.frequency_hz[*row] / per_line_hz);
        if lines.clone().any(|line| (line - line.round()).abs() > OF_LINE || line.round() < 1.0) {
            return Ok(None);
        }
        let sampling = Sampling::from_rate_hz(stated.sample_rate_hz, stated.samples)?;
        let lines = Lines::new(sampling, lines.map(|line| line.round() as usize))?;
        let segments = match stated.window {
            None => Segments::Periods(stated.samples),
            Some(window) => Segments::Windowed { len: stated.samples, hop: stated.hop, window },
        };
        Ok(Some(Self { lines, segments, count: stated.count }))
    }
}

/// Part of a table that is used.
struct Columns<'a> {
    points: &'a [String],
    forces: &'a [String],
    rows: &'a [usize],
    measured: ResponseQuantity,
}

impl Columns<'_> {
    /// Returns responses with their coherence: averages over the segments that the table states,
    /// otherwise over the given number of averages.
    fn frequency_responses(
        &self,
        table: &FrequencyResponses,
        averages: Option<f64>,
        response: Vec<DMatrix<Complex<f64>>>,
        coherence: DMatrix<f64>,
        averaged: Option<&Averaged>,
        errors: Option<&[DMatrix<f64>]>,
    ) -> Result<Frf, AnalysisError> {
        if let Some(Averaged { lines, segments, count }) = averaged {
            let over = (*segments, *count);
            return Ok(Frf::from_segments(
                lines,
                response,
                coherence,
                errors,
                over,
                self.measured,
            )?);
        }
        let omega = self.rows.iter().map(|row| TAU * table.frequency_hz[*row]).collect();
        let averages = averages.ok_or_else(|| AnalysisError::Setting {
            setting: "averages",
            why: format!(
                "{} has coherences: state their number of independent averages; coherences and averages \
                 give the standard errors",
                table.file
            ),
        })?;
        Ok(Frf::new(omega, response, coherence, averages, self.measured)?)
    }

    /// Returns the responses with the coherence of the table. A multiple coherence gives one item
    /// for all forces, an ordinary coherence one item for each force. `None` if the table has no
    /// coherence.
    fn coherent(
        &self,
        table: &FrequencyResponses,
        how: &IdentifyResponses,
        response: &[DMatrix<Complex<f64>>],
        averaged: Option<Averaged>,
        errors: Option<&[DMatrix<f64>]>,
    ) -> Result<Option<Coherent>, AnalysisError> {
        let Self { points, forces, rows, .. } = *self;
        let of = |point: &String, force: Option<&String>| {
            let fits =
                |c: &&CoherenceFunction| c.response == *point && c.reference.as_ref() == force;
            table.coherence.iter().find(fits).map(|c| &c.values)
        };
        let columns = |force: Option<&String>| -> Option<DMatrix<f64>> {
            let coherences: Option<Vec<&Vec<f64>>> =
                points.iter().map(|point| of(point, force)).collect();
            coherences.map(|coherences| {
                DMatrix::from_fn(rows.len(), points.len(), |row, at| coherences[at][rows[row]])
            })
        };
        let together = columns(None);
        let apart: Option<Vec<_>> = forces.iter().map(|force| columns(Some(force))).collect();
        if together.is_none() && apart.is_none() {
            return Ok(None);
        }
        let frf = |response, coherence, errors: Option<&[DMatrix<f64>]>| {
            self.frequency_responses(
                table,
                how.averages,
                response,
                coherence,
                averaged.as_ref(),
                errors,
            )
        };
        let dof = |force: &String| points.iter().position(|point| point == force);
        let driven: Vec<usize> = forces.iter().filter_map(dof).collect();
        if let Some(apart) = apart {
            let separate = apart.into_iter().enumerate().map(|(force, coherence)| {
                let column = response.iter().map(|h| h.columns(force, 1).into_owned()).collect();
                let errors: Option<Vec<_>> = errors.map(|errors| {
                    errors.iter().map(|e| e.columns(force, 1).into_owned()).collect()
                });
                Ok((frf(column, coherence, errors.as_deref())?, vec![driven[force]]))
            });
            return Ok(Some(separate.collect::<Result<_, AnalysisError>>()?));
        }
        match together {
            Some(coherence) => Ok(Some(vec![(frf(response.to_vec(), coherence, errors)?, driven)])),
            None => Ok(None),
        }
    }
}

/// Returns the distinct texts, in the order of their first appearance.
fn distinct<'a>(texts: impl Iterator<Item = &'a String>) -> Vec<String> {
    let mut distinct: Vec<String> = Vec::new();
    for text in texts {
        if !distinct.contains(text) {
            distinct.push(text.clone());
        }
    }
    distinct
}
