//! Identification from frequency responses that were measured elsewhere.

use std::borrow::Cow;
use std::f64::consts::TAU;
use std::fmt;

use mechid_estimate::checks::{
    Finding, adjust_p_values, after_response_fit, before_spectral_fit, coherence,
};
use mechid_estimate::frequency_domain::{
    FrequencyData, NoiseModel, Pooling, equation_error, output_error_pooling,
};
use mechid_estimate::{Estimate, Frf, Unknowns};
use mechid_io::{FrequencyResponses, ParameterCovariance, ResponseFunction, SystemMatrices};
use mechid_model::{ResponseQuantity, SecondOrderSystem};
use nalgebra::{Complex, DMatrix};
use serde::{Deserialize, Serialize};

use super::added_decay;
use super::checks::{CheckRow, When};
use super::fitted::{Misfit, unexplained_motion};
use super::rows::{
    CONFIDENCE, ParameterRow, ProportionalDamping, carries_covariance, covariance, mode_table,
    of_covariance, parameter_table, parameters,
};
use super::summary::{FitRow, verdict};
use super::{Band, FittedLine, KnownMass, Method, Structure, Unscaled};
use crate::AnalysisError;
use crate::machine::Machine;
use crate::measurement::Channels;
use crate::modal::{ShapedMode, shape_table};
use crate::text::{compact, paragraph, significant};

/// Settings of an identification from tables of frequency responses.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct IdentifyResponses {
    /// Measured quantity of the responses; `None`: as the table states it.
    pub quantity: Option<ResponseQuantity>,
    /// Number of independent averages behind the coherence, a pure number.
    pub averages: Option<f64>,
    /// Points of the responses, one per degree of freedom; empty: all, in the order of the table.
    pub points: Vec<String>,
    /// Frequency band to use; `None`: all frequencies above zero.
    pub band: Option<Band>,
    /// Known masses.
    pub mass: KnownMass,
    /// Form of M, C and K, such as that of a chain.
    #[serde(skip_serializing_if = "Structure::is_empty")]
    pub structure: Structure,
    /// Estimator; `None`: maximum likelihood.
    pub method: Option<Method>,
}

/// Identifies the machine behind one or several tables of frequency responses, which are fitted
/// together; each needs the response at every point where a force acts.
///
/// Maximum likelihood weights every response by its variance: from its standard error where the
/// table has one, otherwise from coherence and averages. Of a table with neither, the noise is taken as
/// white, of the level that the residual has.
///
/// # Errors
/// [`AnalysisError::NoRecord`], [`AnalysisError::NoResponse`] if a response is missing,
/// [`AnalysisError::Setting`] for settings that the table contradicts or that it needs,
/// [`AnalysisError::EmptyBand`], and [`AnalysisError::Estimate`] if the fit fails.
///
/// # Source
/// Bendat & Piersol, *Random Data*, 4th ed. (2010), chapter 9 (the variance that the coherence gives).
pub fn identify_responses(
    tables: &[FrequencyResponses],
    how: &IdentifyResponses,
) -> Result<IdentifiedResponses, AnalysisError> {
    let added_decay = added_decay::of_tables(tables)?;
    let measured = tables.iter().map(|table| Tabulated::of(table, how));
    let measured: Vec<Tabulated> = measured.collect::<Result<_, _>>()?;
    let first = measured.first().ok_or(AnalysisError::NoRecord)?;
    let mut data = first.data.clone();
    for other in &measured[1..] {
        data = data.and(&other.data)?;
    }
    let driven: Vec<usize> = measured.iter().flat_map(|m| m.driven.iter().copied()).collect();
    let fit = |unknowns: &Unknowns| {
        let windowed = match added_decay {
            Some(rate) => &added_decay::unknowns(unknowns, rate)?,
            None => unknowns,
        };
        let fit = Fit::of(&data, windowed, &measured, how.method)?;
        let of_machine = match added_decay {
            Some(rate) => fit.estimate.without_added_decay(rate, unknowns.clone())?,
            None => fit.estimate.clone(),
        };
        Ok((fit, of_machine, before_spectral_fit(&data, windowed)?))
    };
    let unknowns = how.structure.apply(how.mass.unknowns(data.dof())?)?;
    let ((fit, of_machine, before), unscaled) = Unscaled::or_fitted(&unknowns, &driven, fit)?;
    let mut findings: Vec<(When, Option<String>, Finding)> =
        before.into_iter().map(|finding| (When::Before, None, finding)).collect();
    for (table, measured) in tables.iter().zip(&measured) {
        let name = (tables.len() > 1).then(|| table.file.clone());
        for (when, finding) in measured.findings(&fit.estimate, data.len())? {
            findings.push((when, name.clone(), finding));
        }
    }
    adjust_p_values(findings.iter_mut().map(|(_, _, finding)| finding));
    let row = |(when, name, finding): (When, Option<String>, Finding)| {
        CheckRow::new(when, name, &finding, &Channels::default())
    };
    let checks = findings.into_iter().map(row).collect();
    let estimate = &of_machine;
    let system = estimate.system()?;
    let each = estimate.residual_nrmse();
    let hz = |rows: &mut dyn Iterator<Item = f64>| rows.map(|omega| omega / TAU).collect();
    let frequencies: Vec<f64> = hz(&mut first.data.omega().iter().copied());
    let summary = ResponseSummary {
        files: tables.iter().map(|table| table.file.clone()).collect(),
        estimator: fit.name,
        quantity: data.measured().to_string(),
        points: first.points.clone(),
        forces: first.driven.iter().map(|dof| first.points[*dof].clone()).collect(),
        frequencies: FrequencyRow {
            count: first.data.len() / first.driven.len(),
            first_hz: frequencies.iter().copied().fold(f64::INFINITY, f64::min),
            last_hz: frequencies.iter().copied().fold(0.0, f64::max),
        },
        confidence: CONFIDENCE,
        parameters: parameters(estimate, unscaled.as_ref())?,
        proportional_damping: ProportionalDamping::of(estimate)?,
        modes: ShapedMode::all(&estimate.modes()?, false)?,
        fit: FitRow {
            nrmse: (each.iter().map(|e| e * e).sum::<f64>() / each.len() as f64).sqrt(),
            unexplained_motion: unexplained_motion(&data, &fit.estimate.system()?)?,
            misfit_ratio: fit.misfit.map(|misfit| misfit.ratio),
            noise: fit.noise.clone(),
            force_noise: Vec::new(),
            sinusoids: Vec::new(),
            condition_number: estimate.condition(),
            equations: 2 * data.len(),
            unknowns: estimate.unknowns().independent(),
        },
        fitted_lines: None,
        checks,
        remarks: unscaled
            .iter()
            .map(Unscaled::to_string)
            .chain(tables.iter().flat_map(|table| table.remarks.iter().cloned()))
            .chain(added_decay.map(|rate| {
                format!(
                    "an exponential window adds {} 1/s to the decay of every mode of the table: it was taken off \
                     damping and stiffness",
                    significant(rate, 4)
                )
            }))
            .chain(fit.misfit.map(|misfit| misfit.to_string()))
            .chain(of_covariance(estimate))
            .collect(),
        system: unscaled.is_none().then(|| SystemMatrices::from(&system)),
        covariance: carries_covariance(estimate).then(|| covariance(estimate, unscaled.as_ref())),
        unscaled,
        analysis: how.clone(),
    };
    Ok(IdentifiedResponses { estimate: of_machine, fitted: fit.estimate, data, summary })
}

/// A machine identified from tables of frequency responses.
///
/// [`Display`](fmt::Display) gives the result as a person reads it, `serde` the same for programs.
#[derive(Debug)]
pub struct IdentifiedResponses {
    estimate: Estimate,
    fitted: Estimate,
    data: FrequencyData,
    summary: ResponseSummary,
}

/// Result of an identification from frequency responses: numbers, checks and remarks.
#[derive(Debug, Serialize)]
pub struct ResponseSummary {
    /// The tables.
    pub files: Vec<String>,
    /// Name of the estimator.
    pub estimator: &'static str,
    /// Measured quantity of the responses.
    pub quantity: String,
    /// Points of the responses, one per degree of freedom.
    pub points: Vec<String>,
    /// Points of the forces.
    pub forces: Vec<String>,
    /// Frequencies of the first table.
    pub frequencies: FrequencyRow,
    /// Level of the confidence intervals, a pure number such as 0.95.
    pub confidence: f64,
    /// Parameters, one each, but for those of [`unscaled`](Self::unscaled) equations.
    pub parameters: Vec<ParameterRow>,
    /// Equations of motion without scale, whose parameters do not follow from the data.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unscaled: Option<Unscaled>,
    /// Factors of proportional damping, if it was to be such.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub proportional_damping: Option<ProportionalDamping>,
    /// Modes, by rising frequency.
    pub modes: Vec<ShapedMode>,
    /// Quality of the fit.
    pub fit: FitRow,
    /// Every line of the fit, if they were asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fitted_lines: Option<Vec<FittedLine>>,
    /// Checks before and after the fit.
    pub checks: Vec<CheckRow>,
    /// Remarks to read before using the numbers.
    pub remarks: Vec<String>,
    /// M, C and K, as `mechid force --system` and others read them back; `None` where equations have no scale.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub system: Option<SystemMatrices>,
    /// Covariance of the parameters that were estimated, for what is derived from them; `None` for more than
    /// 2,000 of them, for which [`IdentifiedResponses::covariance`] has it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub covariance: Option<ParameterCovariance>,
    /// The settings, which repeat the analysis.
    pub analysis: IdentifyResponses,
}

/// Frequencies that were used.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct FrequencyRow {
    /// Number of frequencies.
    pub count: usize,
    /// Lowest frequency, in Hz.
    pub first_hz: f64,
    /// Highest frequency, in Hz.
    pub last_hz: f64,
}

impl IdentifiedResponses {
    /// Returns the estimate of M, C and K with its covariance; where equations have no scale
    /// ([`ResponseSummary::unscaled`]), of one of the systems with the same modes.
    pub fn estimate(&self) -> &Estimate {
        &self.estimate
    }

    /// Returns the identified system.
    ///
    /// # Errors
    /// [`AnalysisError::Estimate`] if the data leave a parameter undetermined, [`AnalysisError::Unscaled`] if
    /// they give its modes alone.
    pub fn system(&self) -> Result<SecondOrderSystem, AnalysisError> {
        self.check_scale()?;
        Ok(self.estimate.system()?)
    }

    fn check_scale(&self) -> Result<(), AnalysisError> {
        Unscaled::check(self.summary.unscaled.as_ref())
    }

    /// Returns the covariance of the parameters that were estimated, whatever their number.
    pub fn covariance(&self) -> ParameterCovariance {
        covariance(&self.estimate, self.summary.unscaled.as_ref())
    }

    /// Returns the estimate that was fitted to [`IdentifiedResponses::data`]: [`IdentifiedResponses::estimate`]
    /// with the decay that an exponential window adds.
    pub fn fitted(&self) -> &Estimate {
        &self.fitted
    }

    /// Returns the frequency responses that were fitted: unit forces and displacements, with the noise
    /// of the latter.
    pub fn data(&self) -> &FrequencyData {
        &self.data
    }

    /// Returns the numbers, checks and remarks.
    pub fn summary(&self) -> &ResponseSummary {
        &self.summary
    }

    /// Adds every line of the fit to [`IdentifiedResponses::summary`]: measured and fitted responses with
    /// their standard errors, and the residual.
    ///
    /// # Errors
    /// [`AnalysisError::Model`] if the identified system has no response at a line.
    pub fn add_fitted_lines(&mut self) -> Result<(), AnalysisError> {
        self.summary.fitted_lines = Some(FittedLine::all(&self.data, &self.fitted)?);
        Ok(())
    }

    /// Returns the identified system with the covariance of its parameters.
    ///
    /// # Errors
    /// As [`IdentifiedResponses::system`].
    pub fn machine(&self) -> Result<Machine, AnalysisError> {
        self.check_scale()?;
        Machine::of_estimate(&self.estimate)
    }
}

impl Serialize for IdentifiedResponses {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.summary.serialize(serializer)
    }
}

impl fmt::Display for IdentifiedResponses {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let s = &self.summary;
        let [low, high] = [s.frequencies.first_hz, s.frequencies.last_hz].map(|hz| compact(hz, 5));
        writeln!(
            f,
            "{}: {} at {} per force at {}\n{}; {}, {low} to {high} Hz\n",
            s.files.join(", "),
            s.quantity,
            s.points.join(", "),
            s.forces.join(", "),
            s.estimator,
            match s.frequencies.count {
                1 => "1 frequency".to_owned(),
                count => format!("{count} frequencies"),
            },
        )?;
        if !s.parameters.is_empty() {
            let factors = s.proportional_damping.iter().flat_map(ProportionalDamping::rows);
            writeln!(f, "{}", parameter_table(&s.parameters, factors))?;
        }
        writeln!(f, "{}", mode_table("mode", &ShapedMode::rows(&s.modes)))?;
        if s.unscaled.is_some() {
            writeln!(f, "{}", shape_table(&s.modes, |at| s.points[at].clone()))?;
        }
        writeln!(f, "{}", s.fit.lines("linear model"))?;
        f.write_str(&verdict(&s.checks))?;
        f.write_str(&paragraph(s.remarks.iter().map(|remark| format!("note: {remark}"))))
    }
}

/// A fit, and what it leaves against the noise.
struct Fit {
    name: &'static str,
    estimate: Estimate,
    misfit: Option<Misfit>,
    noise: Vec<NoiseModel>,
}

impl Fit {
    fn of(
        data: &FrequencyData,
        unknowns: &Unknowns,
        measured: &[Tabulated],
        method: Option<Method>,
    ) -> Result<Self, AnalysisError> {
        if method == Some(Method::Instrumental) {
            return Err(AnalysisError::InstrumentalResponses);
        }
        if method == Some(Method::LeastSquares) {
            let name = "least squares on frequency responses, all alike";
            let estimate = equation_error(data, unknowns)?;
            return Ok(Self { name, estimate, misfit: None, noise: Vec::new() });
        }
        let fit = output_error_pooling(data, unknowns, Pooling::AllLines)?;
        let noise = measured[0].noise;
        let name = match noise {
            Noise::Stated => {
                "maximum likelihood on frequency responses, weighted by their standard errors"
            }
            Noise::Coherence => {
                "maximum likelihood on frequency responses, weighted by their coherence"
            }
            Noise::Unknown => {
                "maximum likelihood on frequency responses, with noise as the residual has it"
            }
        };
        let misfit = noise.source().map(|noise| Misfit { ratio: fit.misfit_ratio, noise });
        Ok(Self { name, estimate: fit.estimate, misfit, noise: fit.noise })
    }
}

/// Noise as a table states it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Noise {
    Stated,
    Coherence,
    Unknown,
}

impl Noise {
    /// Returns where the noise is known from, in words.
    fn source(self) -> Option<&'static str> {
        match self {
            Noise::Stated => Some("that follows from the standard errors"),
            Noise::Coherence => Some("that follows from the coherence"),
            Noise::Unknown => None,
        }
    }
}

/// A table as the estimators take it.
struct Tabulated {
    points: Vec<String>,
    /// Degrees of freedom with a force, counted from 0.
    driven: Vec<usize>,
    noise: Noise,
    data: FrequencyData,
    /// Responses with their coherence, to be checked, and the degrees of freedom of their forces.
    coherent: Vec<(Frf, Vec<usize>)>,
}

impl Tabulated {
    fn of(table: &FrequencyResponses, how: &IdentifyResponses) -> Result<Self, AnalysisError> {
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
    fn findings(
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
