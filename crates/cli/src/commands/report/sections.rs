//! The sections of the report.

use maud::{Markup, html};
use mechid::estimate::checks::{Correlation, Verdict};

use super::channels::Channel;
use super::excitation::DROP_DB;
use super::page::figure;
use super::residual::{ChannelResidual, Residual};
use super::tables::Table;
use super::{Contents, figures};
use crate::commands::identify::report::{Report, Uncertain};
use crate::error::CliError;
use crate::text_table::{compact, significant};

/// Noise has a larger statistic than this often; below, a correlation is taken as real.
const UNLIKELY: f64 = 0.01;

fn percent(share: f64) -> String {
    format!("{} %", significant(100.0 * share, 3))
}

fn or_dash(value: Option<String>) -> String {
    value.unwrap_or_else(|| "–".into())
}

fn pair(name: &str, value: impl Into<String>) -> Vec<String> {
    vec![name.into(), value.into()]
}

/// What is in the record.
pub fn data(contents: &Contents<'_>) -> Result<Markup, CliError> {
    let window = &contents.found.report.window;
    let rate = window.sample_rate_hz;
    let samples = window.last_sample + 1 - window.first_sample;
    let mut facts = vec![
        pair("File", &contents.found.report.file),
        pair("Samples used", format!("{} to {}", window.first_sample, window.last_sample)),
        pair("Sample rate", format!("{} Hz", compact(rate, 8))),
        pair("Duration", format!("{} s", compact(samples as f64 / rate, 6))),
    ];
    if contents.found.report.lines.is_some() {
        let length = format!("{} of {} samples", window.periods, window.period_samples);
        facts.push(pair("Periods", length));
        let spacing = rate / window.period_samples as f64;
        facts.push(pair("Line spacing", format!("{} Hz", compact(spacing, 6))));
    }
    let header =
        ["column", "what it is", "unit", "mean", "RMS", "peak", "crest factor", "not repeated"];
    let rows = contents.channels.iter().map(channel_row).collect();
    let drawn = figures::data(contents.found)?;
    Ok(html! {
        div.tables {
            (Table { caption: "The record", header: &[], numbers_from: 9, rows: facts }.html())
            (Table { caption: "Channels over the window", header: &header, numbers_from: 3, rows }.html())
        }
        p.note { "Crest factor: peak over RMS. Not repeated: RMS of what differs from period to period over RMS of what repeats." }
        div.figures { @for drawn in &drawn { (figure(drawn)) } }
    })
}

fn channel_row(channel: &Channel) -> Vec<String> {
    let mut row = vec![
        channel.column.clone(),
        match channel.dof {
            Some(dof) => format!("{} {dof}", channel.quantity),
            None => channel.quantity.into(),
        },
        channel.unit.into(),
    ];
    row.extend([channel.mean, channel.rms, channel.peak].map(|value| significant(value, 4)));
    row.push(or_dash(channel.crest_factor.map(|factor| significant(factor, 3))));
    row.push(or_dash(channel.scatter.map(percent)));
    row
}

/// Whether the force suits.
pub fn excitation(contents: &Contents<'_>) -> Markup {
    let header = [
        "force",
        "crest factor",
        "peak factor",
        "excited lines",
        "from … to (Hz)",
        "flatness",
        "persistence (order)",
    ];
    let row = |e: &super::Excitation| {
        let band = e.band.map(|b| format!("{} to {}", compact(b.low_hz, 5), compact(b.high_hz, 5)));
        vec![
            e.dof.to_string(),
            significant(e.crest_factor, 3),
            or_dash(e.peak_factor.map(|factor| significant(factor, 3))),
            e.lines.to_string(),
            or_dash(band),
            or_dash(e.flatness.map(|flatness| significant(flatness, 3))),
            e.order.to_string(),
        ]
    };
    let rows = contents.excitations.iter().map(row).collect();
    html! {
        (Table { caption: "Quality of the excitation", header: &header, numbers_from: 1, rows }.html())
        p.note {
            "Peak factor: half the range over √2 times the RMS, 1 for a sine. Excited lines are those within "
            (DROP_DB) " dB of the strongest; their flatness is 1 if all are equal. The order of persistent \
             excitation is the number of parameters that they can tell apart."
        }
        @if !contents.checks.is_empty() {
            ul.checks { @for check in &contents.checks { li { (verdict(check.verdict)) " " (check.text) } } }
        }
    }
}

fn verdict(verdict: Verdict) -> Markup {
    let word = match verdict {
        Verdict::Good => "good",
        Verdict::Doubtful => "doubtful",
        Verdict::Bad => "bad",
    };
    html! { strong class={ "verdict " (word) } { (word) } }
}

fn uncertain(name: String, value: &Uncertain, unit: &str) -> Vec<String> {
    let mut row = vec![name];
    row.extend(value.cells());
    row.push(unit.into());
    row
}

/// Parameters and modes.
pub fn machine(contents: &Contents<'_>) -> Markup {
    let report = &contents.found.report;
    let interval = format!("{} % interval", compact(100.0 * report.confidence, 3));
    let header = |what| [what, "value", "standard error", &interval, "unit"];
    let parameters =
        report.parameters.iter().map(|p| uncertain(p.name.clone(), &p.estimate, p.unit)).collect();
    let mut modes = Vec::new();
    for (number, mode) in (1..).zip(&report.modes) {
        let name = |what: &str| format!("{number} {what}");
        modes.push(uncertain(name("natural frequency"), &mode.natural_frequency_hz, "Hz"));
        modes.push(uncertain(name("damped frequency"), &mode.damped_frequency_hz, "Hz"));
        modes.push(uncertain(name("damping ratio"), &mode.damping_ratio, "–"));
    }
    html! {
        div.tables {
            (Table { caption: "Parameters", header: &header("parameter"), numbers_from: 1, rows: parameters }.html())
            (Table { caption: "Modes", header: &header("mode"), numbers_from: 1, rows: modes }.html())
            (Table { caption: "The fit", header: &[], numbers_from: 9, rows: fit_rows(report) }.html())
        }
    }
}

fn fit_rows(report: &Report) -> Vec<Vec<String>> {
    let fit = &report.fit;
    let mut rows = vec![pair("Estimator", report.estimator)];
    if let Some(lines) = &report.lines {
        let [low, high] = [lines.first_hz, lines.last_hz].map(|hz| compact(hz, 5));
        let (count, first, last) = (lines.count, lines.first, lines.last);
        let text = format!("{count}, between {first} and {last} ({low} to {high} Hz)");
        rows.push(pair("Lines", text));
    }
    rows.push(pair("Residual of the fit (NRMSE)", percent(fit.nrmse)));
    if let Some(part) = fit.unexplained_motion {
        rows.push(pair("Motion the linear model leaves unexplained", percent(part)));
    }
    rows.push(pair("Condition number", significant(fit.condition_number, 3)));
    let equations = format!("{} for {} unknowns", fit.equations, fit.unknowns);
    rows.push(pair("Equations for each degree of freedom", equations));
    rows
}

/// The frequency response, and the motion in time.
pub fn response(contents: &Contents<'_>) -> Result<Markup, CliError> {
    let receptance = match figures::receptance(contents.found) {
        Err(reason @ (CliError::NothingToDraw | CliError::NoSpectra)) => Err(reason),
        drawn => Ok(drawn?),
    };
    let fit = contents.residual.as_ref().ok().map(|residual| figures::fit(contents, residual));
    let fit = fit.transpose()?;
    Ok(html! {
        @if let Err(reason) = &receptance { p.note { "No receptance: " (why(reason)) } }
        div.figures {
            @if let Ok(drawn) = &receptance { (figure(drawn)) }
            @if let Some(drawn) = &fit { (figure(drawn)) }
        }
    })
}

fn why(reason: &CliError) -> &'static str {
    match reason {
        CliError::NothingToDraw => {
            "on every line several forces act, so the record shows no single one."
        }
        _ => "the fit was done in the time domain, sample by sample.",
    }
}

/// Whether what is left is noise.
pub fn residual(contents: &Contents<'_>) -> Result<Markup, CliError> {
    let residual = match &contents.residual {
        Ok(residual) => residual,
        Err(reason) => return Ok(html! { p.note { "There is no residual to judge: " (reason) } }),
    };
    let drawn =
        [figures::residual_spectrum(contents.found, residual)?, figures::correlations(residual)?];
    let header = ["motion", "residual / motion", "test", "outside 95 %", "p-value", "verdict"];
    let rows = residual_rows(residual);
    Ok(html! {
        p { "The residual is the measured " (residual.kind) " less the one that the identified machine has under the measured force." }
        (Table { caption: "Is the residual noise?", header: &header, numbers_from: 9, rows }.html())
        p.note {
            "The p-value is the share of records of white noise that show as much correlation. The test against a \
             force takes the residual as white and the force as broad. In white noise 5 % of the lags lie outside the bounds."
        }
        div.figures { @for drawn in &drawn { (figure(drawn)) } }
    })
}

fn residual_rows(residual: &Residual) -> Vec<Vec<String>> {
    let mut rows = Vec::new();
    for (number, channel) in (1..).zip(&residual.channels) {
        let tests = std::iter::once(("whiteness".to_owned(), &channel.whiteness)).chain(
            channel.forces.iter().map(|(force, c)| (format!("against force {}", force + 1), c)),
        );
        for (test, found) in tests {
            rows.push(vec![
                number.to_string(),
                percent(channel.share),
                test,
                format!("{} of {} lags", found.outside(), found.coefficients.len()),
                if found.p_value < 1e-3 { "< 0.001".into() } else { significant(found.p_value, 2) },
                judged(channel, found).into(),
            ]);
        }
    }
    rows
}

fn judged(channel: &ChannelResidual, found: &Correlation) -> &'static str {
    match found.p_value {
        _ if channel.is_rounding() => "rounding only",
        p if p < UNLIKELY => "correlated",
        _ => "as noise",
    }
}

/// What the residual gives cause to doubt.
pub fn residual_doubts(contents: &Contents<'_>) -> Vec<String> {
    let Ok(residual) = &contents.residual else { return Vec::new() };
    let mut doubts = Vec::new();
    for (number, channel) in (1..).zip(&residual.channels).filter(|(_, c)| !c.is_rounding()) {
        let unlikely = |found: &Correlation| found.p_value < UNLIKELY;
        if unlikely(&channel.whiteness) {
            doubts.push(format!(
                "the residual of motion {number} is not white: the model misses something, the \
                 noise is coloured, or the estimator leaves a part of a resonance behind"
            ));
        }
        for (force, _) in channel.forces.iter().filter(|(_, found)| unlikely(found)) {
            doubts.push(format!(
                "the residual of motion {number} is correlated with force {}: there is motion left \
                 that the force explains and the model does not; where the motion is noisy, least \
                 squares leaves more of it than --method maximum-likelihood",
                force + 1
            ));
        }
    }
    doubts
}

/// The force found from the motion.
pub fn reconstruction(contents: &Contents<'_>) -> Result<Option<Markup>, CliError> {
    let Some(found) = &contents.reconstruction else { return Ok(None) };
    let drawn = figures::force(found)?;
    let rms = |record: &mechid::signal::Record, dof: usize| {
        significant(mechid::signal::measures::rms(record.channel(dof)), 4)
    };
    let rows = found
        .forced
        .iter()
        .map(|&dof| {
            vec![
                (dof + 1).to_string(),
                rms(&found.measured, dof),
                rms(found.found.record(), dof),
                or_dash(found.found.standard_error().map(|error| {
                    significant(mechid::signal::measures::rms(error.channel(dof)), 2)
                })),
                or_dash(found.errors[dof].map(percent)),
            ]
        })
        .collect();
    let header =
        ["force", "measured, RMS (N)", "found, RMS (N)", "standard error (N)", "difference"];
    let lines = if found.lines.is_some() { ", on the lines of the fit" } else { "" };
    Ok(Some(html! {
        p {
            "Found from the measured motion with the identified machine: " (found.method) (lines)
            ". The machine was fitted to the same record, so agreement says that the fit is consistent, not that \
             another record would do as well."
        }
        (Table { caption: "Force found and force measured", header: &header, numbers_from: 1, rows }.html())
        div.figures { (figure(&drawn)) }
    }))
}
