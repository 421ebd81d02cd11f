//! Sections of the report.

use std::f64::consts::TAU;

use maud::{Markup, html};
use mechid_analysis::Channels;
use mechid_analysis::identify::checks::When;
use mechid_analysis::identify::rows::{ModeRow, ParameterRow, ProportionalDamping, Uncertain};
use mechid_analysis::identify::summary::IdentificationSummary;
use mechid_analysis::identify::validation::{Share, Validation};
use mechid_analysis::modal::ShapedMode;
use mechid_analysis::review::channels::Channel;
use mechid_analysis::review::excitation::{DROP_DB, Excitation};
use mechid_analysis::review::reconstruction::Reconstruction;
use mechid_analysis::review::residual::{Residual, sizes};
use mechid_analysis::review::{RecordReview, judgement};
use mechid_analysis::text::{compact, significant};
use mechid_model::ResponseQuantity;
use mechid_signal::message;

use super::tables::Table;
use super::{Captions as _, Contents, Drawn, checks, figure, figures, figures_of};
use crate::ReportError;

pub fn percent(share: f64) -> String {
    format!("{} %", significant(100.0 * share, 3))
}

fn or_dash(value: Option<String>) -> String {
    value.unwrap_or_else(|| "–".into())
}

/// Returns the modulus and the phase as text; the phase is −179.9° to 180.0°.
pub fn polar(re: f64, im: f64) -> String {
    let tenths = (10.0 * im.atan2(re).to_degrees()).round();
    let tenths = if tenths == -1800.0 { 1800.0 } else { tenths + 0.0 };
    format!("{} ∠ {:.1}°", significant(re.hypot(im), 4), tenths / 10.0)
}

pub fn pair(name: &str, value: impl Into<String>) -> Vec<String> {
    vec![name.into(), value.into()]
}

/// Returns a part of the page for every record, below the record's name if there are several.
fn for_each_record(
    contents: &Contents<'_>,
    show: impl Fn(&RecordReview<'_>) -> Result<Markup, ReportError>,
) -> Result<Markup, ReportError> {
    let shown: Vec<Markup> = contents.review.records.iter().map(show).collect::<Result<_, _>>()?;
    Ok(html! {
        @for (part, shown) in contents.review.records.iter().zip(&shown) {
            @if let Some(name) = part.name { h3 { (name) } }
            (shown)
        }
    })
}

/// Returns the section about the records.
pub fn data(contents: &Contents<'_>) -> Result<Markup, ReportError> {
    let records = for_each_record(contents, |part| {
        let header =
            ["column", "what it is", "unit", "mean", "RMS", "peak", "crest factor", "not repeated"];
        let rows = part.channels.iter().map(channel_row).collect();
        let drawn = figures::data(part)?;
        Ok(html! {
            div.tables {
                (Table { caption: "The record", header: &[], numbers_from: 9, rows: facts(contents, part) }.html())
                (Table { caption: "Channels over the window", header: &header, numbers_from: 3, rows }.html())
            }
            @for remark in &part.held().unit_remarks { p.note { (remark) "." } }
            @if let Some(note) = buffered_part(part) { p.note { (note) } }
            (figures_of(&drawn))
        })
    })?;
    Ok(html! {
        (records)
        p.note { "Crest factor: peak divided by RMS. Not repeated: RMS of the part that differs from period to period, divided by the RMS of the part that repeats." }
    })
}

/// Returns a sentence that says, for a long record, which statements refer to all samples and which
/// to a part.
fn buffered_part(part: &RecordReview<'_>) -> Option<String> {
    let (first, last) = (part.held().first_sample, part.held().held_to()?);
    Some(format!(
        "The record is long: levels, time histories and averages over periods or segments are those of \
         all samples used. Results for single samples (the residual in time, its correlations and its checks) \
         are those of samples {first} to {last}. If another figure shows only these samples, its caption says so."
    ))
}

fn facts(contents: &Contents<'_>, part: &RecordReview<'_>) -> Vec<Vec<String>> {
    let measured = part.held();
    let (first, last) = (measured.first_sample, measured.last_sample());
    let (samples, rate) = (last + 1 - first, measured.force.sampling().rate_hz());
    let mut facts = vec![
        pair("File", &measured.file),
        pair("Samples used", format!("{first} to {last}")),
        pair("Sample rate", format!("{} Hz", compact(rate, 8))),
        pair("Duration", format!("{} s", compact(samples as f64 / rate, 6))),
    ];
    if let Some((lines, _)) = &contents.review.identified.fitted().frequency {
        let len = lines.sampling().len();
        facts.push(match part.lines {
            Some(_) => pair(
                "Periods",
                format!("{} of {}", measured.periods, message::count(len, "sample")),
            ),
            None => pair("Segments", format!("of {}", message::count(len, "sample"))),
        });
        let spacing = lines.sampling().line_spacing_hz();
        facts.push(pair("Line spacing", format!("{} Hz", compact(spacing, 6))));
    }
    facts
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

/// Returns the section about the suitability of the force.
pub fn excitation(contents: &Contents<'_>) -> Result<Markup, ReportError> {
    let header = [
        "force",
        "crest factor",
        "peak factor",
        "excited lines",
        "from … to (Hz)",
        "flatness",
        "persistence (order)",
    ];
    let records = for_each_record(contents, |part| {
        let names = &part.held().names;
        let rows = part.excitations.iter().map(|e| excitation_row(e, names)).collect();
        let caption = part.period_caption("Quality of the excitation");
        Ok(Table { caption: &caption, header: &header, numbers_from: 1, rows }.html())
    })?;
    Ok(html! {
        (records)
        p.note {
            "Peak factor: half the range divided by √2 times the RMS; it is 1 for a sine. Excited lines are \
             those within "
            (DROP_DB) " dB of the strongest; their flatness is 1 if all are equal. The order of \
             persistent excitation is the number of parameters that these lines can determine."
        }
        (checks::list(&contents.review.identified.summary().checks, When::Before))
    })
}

fn excitation_row(e: &Excitation, names: &Channels) -> Vec<String> {
    let band = e.band.map(|b| format!("{} to {}", compact(b.low_hz, 5), compact(b.high_hz, 5)));
    vec![
        names.force_name(e.dof - 1),
        significant(e.crest_factor, 3),
        or_dash(e.peak_factor.map(|factor| significant(factor, 3))),
        e.lines.to_string(),
        or_dash(band),
        or_dash(e.flatness.map(|flatness| significant(flatness, 3))),
        e.order.to_string(),
    ]
}

fn uncertain(name: String, value: &Uncertain, unit: &str) -> Vec<String> {
    let mut row = vec![name];
    row.extend(value.cells());
    row.push(unit.into());
    row
}

/// Maximum number of parameters in one table; with more parameters, each matrix has its own table,
/// so that tables side by side have similar lengths.
const TOGETHER: usize = 12;

/// Returns the tables of the parameters of a machine and of its modes; `terms` are the rows of
/// parameters that are not entries of M, C or K.
pub fn machine_tables(
    parameters: &[ParameterRow],
    terms: Vec<Vec<String>>,
    (modes_of, modes): (&str, &[ShapedMode]),
    confidence: f64,
) -> Vec<Markup> {
    let interval = format!("{} % interval", compact(100.0 * confidence, 3));
    let table = |caption: &str, what: &str, rows: Vec<Vec<String>>| {
        let header = [what, "value", "±", &interval, "unit"];
        Table { caption, header: &header, numbers_from: 1, rows }.html()
    };
    let row = |p: &ParameterRow| uncertain(p.name.clone(), &p.estimate, p.unit);
    let mut groups: Vec<(String, Vec<Vec<String>>)> = vec![("Parameters".into(), Vec::new())];
    if parameters.len() + terms.len() > TOGETHER {
        let of_matrix = |rows: &[ParameterRow]| {
            let matrix = rows.first().map_or("", |row| row.matrix.as_str());
            (format!("Parameters of {matrix}"), rows.iter().map(row).collect())
        };
        groups = parameters.chunk_by(|a, b| a.matrix == b.matrix).map(of_matrix).collect();
        groups.push(("Further parameters".into(), terms));
    } else {
        groups[0].1.extend(parameters.iter().map(row).chain(terms));
    }
    let groups = groups.into_iter().filter(|(_, rows)| !rows.is_empty());
    let mut tables: Vec<Markup> =
        groups.map(|(caption, rows)| table(&caption, "parameter", rows)).collect();
    let modes = ModeRow::quantities(&ShapedMode::rows(modes), true).into_iter();
    let modes = modes.map(|(name, value, unit)| uncertain(name, &value, unit)).collect();
    tables.push(table(modes_of, "mode", modes));
    tables
}

/// Returns the tables of parameters and modes of an identification.
pub fn identified_tables(report: &IdentificationSummary) -> Vec<Markup> {
    let factors = report.proportional_damping.iter().flat_map(ProportionalDamping::rows);
    let terms = report.nonlinear.iter().flat_map(|nonlinear| &nonlinear.parameters);
    let terms = terms.map(|p| uncertain(p.name.clone(), &p.estimate, &p.unit));
    let modes_of = if report.nonlinear.is_some() { "Modes of the linear part" } else { "Modes" };
    let terms = factors.chain(terms).collect();
    machine_tables(&report.parameters, terms, (modes_of, &report.modes), report.confidence)
}

/// Returns parameters, matrices, modes and their shapes.
///
/// # Errors
/// [`ReportError::Analysis`] if the modes cannot be computed.
pub fn machine(contents: &Contents<'_>) -> Result<Markup, ReportError> {
    let report = contents.review.identified.summary();
    let restoring = figures::restoring(contents.review.identified)?;
    let matrices = matrices(&report.parameters);
    let dofs = contents.review.identified.estimate().dof();
    let names = &report.channels;
    let kind = names.first_response().unwrap_or(ResponseQuantity::Displacement);
    let shapes = shapes(&report.modes, |dof| names.response_name(kind, dof));
    let shapes_drawn = figures::shapes(contents, kind);
    let drawn: Vec<Drawn> =
        restoring.into_iter().chain(shapes_drawn.into_iter().flatten()).collect();
    let numbered: Vec<String> = (1..=dofs).map(|dof| dof.to_string()).collect();
    let columns: Vec<&str> =
        std::iter::once("").chain(numbered.iter().map(String::as_str)).collect();
    Ok(html! {
        div.tables {
            @for table in identified_tables(report) { (table) }
            (Table { caption: "The fit", header: &[], numbers_from: 9, rows: fit_rows(contents) }.html())
        }
        @if dofs > 1 {
            div.tables {
                @for (caption, rows) in matrices {
                    (Table { caption: &caption, header: &columns, numbers_from: 1, rows }.html())
                }
                (shapes)
            }
        }
        @if let Some(unscaled) = &report.unscaled { p.note { (unscaled) "." } }
        @if !drawn.is_empty() {
            (figures_of(&drawn))
        }
        @for remark in &contents.review.identified.fitted().remarks { p.note { "How it was done: " (remark) "." } }
    })
}

/// Returns a caption and the table cells for each of M, C and K; the cells have values with
/// standard errors.
fn matrices(parameters: &[ParameterRow]) -> Vec<(String, Vec<Vec<String>>)> {
    let of_one = |entries: &[ParameterRow]| {
        let unit = entries.first().map_or("", |entry| entry.unit);
        let name = entries.first().map_or("", |entry| entry.matrix.as_str());
        let rows = entries.chunk_by(|a, b| a.row == b.row).map(|row| {
            let number = row.first().map_or(0, |entry| entry.row);
            let cells = row.iter().map(|entry| {
                let [value, error, _] = entry.estimate.cells();
                match entry.estimate.standard_error {
                    Some(_) => format!("{value} ± {error}"),
                    None => value,
                }
            });
            std::iter::once(number.to_string()).chain(cells).collect()
        });
        (format!("Matrix of {name}, {unit}"), rows.collect())
    };
    parameters.chunk_by(|a, b| a.matrix == b.matrix).map(of_one).collect()
}

/// Returns the table of the mode shapes, with modulus and phase of each response; `channel` returns
/// the name of a response.
pub fn shapes(modes: &[ShapedMode], channel: impl Fn(usize) -> String) -> Markup {
    let name = |(number, mode): (usize, &ShapedMode)| {
        let [re, im] = mode.eigenvalue;
        format!("mode {number}, {} Hz", significant(re.hypot(im) / TAU, 4))
    };
    let names: Vec<String> = (1..).zip(modes).map(name).collect();
    let header: Vec<&str> = std::iter::once("").chain(names.iter().map(String::as_str)).collect();
    let row = |dof: usize| -> Vec<String> {
        let cells = modes.iter().map(|mode| {
            let [re, im] = mode.shape[dof].value;
            polar(re, im)
        });
        std::iter::once(channel(dof)).chain(cells).collect()
    };
    let rows = (0..modes.first().map_or(0, |mode| mode.shape.len())).map(row).collect();
    let caption = "Mode shapes, modulus and phase of each response; the largest entry is 1";
    Table { caption, header: &header, numbers_from: 1, rows }.html()
}

fn fit_rows(contents: &Contents<'_>) -> Vec<Vec<String>> {
    let report: &IdentificationSummary = contents.review.identified.summary();
    let fit = &report.fit;
    let mut rows = vec![pair("Estimator", report.estimator)];
    if let Some(lines) = &report.lines {
        let [low, high] = [lines.first_hz, lines.last_hz].map(|hz| compact(hz, 5));
        let (count, first, last) = (lines.count, lines.first, lines.last);
        let text = format!("{count}, between {first} and {last} ({low} to {high} Hz)");
        rows.push(pair("Lines", text));
    }
    let residual = fit.residual_name();
    rows.extend(residual.map(|name| pair(&name.replacen('r', "R", 1), percent(fit.nrmse))));
    if let Some(part) = fit.unexplained_motion {
        rows.push(pair("Motion not explained by the linear model", percent(part)));
    }
    if let Some(misfit) = &contents.review.identified.fitted().misfit {
        let what = format!("Power of the residual / power of the noise ({})", misfit.noise);
        rows.push(pair(&what, significant(misfit.ratio, 4)));
    }
    rows.push(pair("Condition number", significant(fit.condition_number, 3)));
    let equations = format!("{} for {} unknowns", fit.equations, fit.unknowns);
    rows.push(pair("Equations for each degree of freedom", equations));
    rows
}

/// Returns the section about the frequency response, and the response over time.
pub fn response(contents: &Contents<'_>) -> Result<Markup, ReportError> {
    let mut drawn = Vec::new();
    let mut reason = None;
    match &contents.review.receptance {
        Err(why) => reason = Some(why),
        Ok(measured) => drawn.push(figures::receptance(contents.review.identified, measured)?),
    }
    for part in &contents.review.records {
        if let Ok(residual) = &part.residual {
            drawn.push(figures::fit(part, &residual.compared[0])?);
        }
    }
    Ok(html! {
        @if let Some(reason) = reason { p.note { "No receptance: " (reason) "." } }
        (figures_of(&drawn))
    })
}

/// Returns the section that tests whether the residual is noise.
pub fn residual(contents: &Contents<'_>) -> Result<Markup, ReportError> {
    let records = for_each_record(contents, |part| match &part.residual {
        Ok(residual) => residual_of(part, residual),
        Err(reason) => Ok(html! { p.note { "There is no residual to judge: " (reason) } }),
    })?;
    Ok(html! {
        p { "The residual is the measured response minus the response of the identified machine to the measured force." }
        (records)
        (checks::list(&contents.review.identified.summary().checks, When::After))
        @if contents.review.identified.summary().checks.iter().any(|check| check.when == When::After) {
            p.note {
                "p is the probability that pure noise gives a result at least as bad, adjusted for the number of \
                 tests; a p below 0.01 is a warning. For pure noise, 5 % of the stems are outside the bounds."
            }
        }
    })
}

fn residual_of(part: &RecordReview<'_>, residual: &Residual) -> Result<Markup, ReportError> {
    let mut drawn = vec![figures::residual_spectrum(part, residual)?];
    if !residual.correlations.is_empty() {
        drawn.push(figures::correlations(part, &residual.correlations)?);
    }
    let header = ["motion", "unit", "RMS", "residual, RMS", "residual / motion"];
    let mut rows = Vec::new();
    for compared in &residual.compared {
        for (channel, name) in compared.names.iter().enumerate() {
            let (size, rest) = sizes(compared, channel);
            rows.push(vec![
                name.clone(),
                compared.kind.unit().into(),
                significant(size, 4),
                significant(rest, 4),
                or_dash((size > 0.0).then(|| percent(rest / size))),
            ]);
        }
    }
    Ok(html! {
        (Table { caption: &part.buffered_caption("Residual of the response"), header: &header, numbers_from: 2, rows }.html())
        (figures_of(&drawn))
    })
}

/// Returns how well each response of a record that was not fitted is predicted.
pub fn predicted(validation: &Validation) -> Markup {
    let row = |share: &Share| pair(&share.name, format!("{} %", significant(share.fit_percent, 4)));
    let rows = validation.channels.iter().map(row).collect();
    let header = ["motion", "fit"];
    Table { caption: "Prediction of the responses", header: &header, numbers_from: 1, rows }.html()
}

/// Returns the section about a record that was not fitted.
pub fn validation(contents: &Contents<'_>) -> Result<Option<Markup>, ReportError> {
    let identified = contents.review.identified;
    let (Some(validation), Some(source), Some(first)) = (
        &identified.summary().validation,
        contents.review.validated(),
        contents.review.validation.first(),
    ) else {
        return Ok(None);
    };
    let drawn = figures::validation(source, first)?;
    let (first_sample, last_sample) = (validation.first_sample, validation.last_sample);
    Ok(Some(html! {
        p {
            "The response of the identified machine to the force of " (validation.file) ", samples " (first_sample) " to " (last_sample)
            ", compared with the measured response."
            @if judgement::was_fitted(contents.review) { " The machine was fitted to some of these samples, so agreement proves little." }
        }
        (predicted(validation))
        p.note { "Fit: 100 % minus the RMS of the difference, in per cent of the RMS of the motion about its mean; at \
                  0 % the prediction is no better than this mean." }
        div.figures { (figure(&drawn)) }
    }))
}

/// Returns the section about the force reconstructed from the response.
pub fn reconstruction(contents: &Contents<'_>) -> Result<Option<Markup>, ReportError> {
    if contents.review.records.iter().all(|part| part.reconstruction.is_none()) {
        return Ok(None);
    }
    let records = for_each_record(contents, |part| match &part.reconstruction {
        Some(reconstruction) => reconstruction_of(part, reconstruction),
        None => Ok(html! {}),
    })?;
    Ok(Some(html! {
        (records)
        p.note {
            "The machine was fitted to the same record, so agreement shows that the fit is consistent, not that \
             the model would predict another record equally well."
        }
    }))
}

fn reconstruction_of(
    part: &RecordReview<'_>,
    reconstruction: &Reconstruction,
) -> Result<Markup, ReportError> {
    let drawn = figures::force(part, reconstruction)?;
    let rms = |record: &mechid_signal::Record, dof: usize| {
        significant(mechid_signal::measures::rms(record.channel(dof)), 4)
    };
    let row = |&dof: &usize| {
        vec![
            part.held().names.force_name(dof),
            rms(&reconstruction.measured, dof),
            rms(reconstruction.force.record(), dof),
            or_dash(
                reconstruction
                    .force
                    .standard_error()
                    .map(|error| significant(mechid_signal::measures::rms(error.channel(dof)), 2)),
            ),
            or_dash(reconstruction.errors[dof].map(percent)),
        ]
    };
    let rows = reconstruction.forced.iter().map(row).collect();
    let header =
        ["force", "measured, RMS (N)", "found, RMS (N)", "standard error (N)", "difference"];
    let lines = if part.lines.is_some() { ", on the lines of the fit" } else { "" };
    Ok(html! {
        p { "Computed from the measured motion with the identified machine: " (reconstruction.method) (lines) "." }
        (Table { caption: &part.period_caption("Computed and measured force"), header: &header, numbers_from: 1, rows }.html())
        div.figures { (figure(&drawn)) }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns table rows for the entries of M, C and K of a machine with `dofs` degrees of
    /// freedom.
    fn entries(dofs: usize) -> Vec<ParameterRow> {
        let estimate =
            Uncertain { value: 4e7, standard_error: Some(1e-3), interval: Some([3e7, 5e7]) };
        let of_matrix = |matrix: &'static str| {
            (0..dofs * dofs).map(move |at| ParameterRow {
                name: format!("{matrix} {at}"),
                matrix: matrix.into(),
                row: at / dofs + 1,
                column: at % dofs + 1,
                unit: "N/m",
                known: false,
                estimate,
            })
        };
        ["mass", "damping", "stiffness"].into_iter().flat_map(of_matrix).collect()
    }

    #[test]
    fn many_parameters_have_a_table_for_each_matrix() {
        for (dofs, tables) in [(1, 1), (2, 1), (3, 3)] {
            let all = machine_tables(&entries(dofs), Vec::new(), ("Modes", &[]), 0.95);
            assert_eq!(all.len(), tables + 1, "{dofs}");
            let rows = |table: &Markup| table.0.matches("<tr>").count() - 1;
            assert!(all.iter().all(|table| rows(table) <= TOGETHER));
        }
        let long = &machine_tables(&entries(3), Vec::new(), ("Modes", &[]), 0.95)[2];
        assert!(long.0.contains("<td class=\"number\">4.00000000000e7</td>"), "{}", long.0);
    }
}
