//! The page of modes: of a test, a free decay, an ambient record, a machine, or a saved result.

use std::f64::consts::TAU;

use maud::{Markup, html};
use mechid_analysis::modal::ShapedMode;
use mechid_analysis::modes::{SavedBackbone, SavedMode, SavedModes, SavedRecord, SavedResponse};
use mechid_analysis::text::{compact, significant};
use mechid_plot::Figure;
use mechid_signal::message;

use super::alone::shape_figures;
use super::figures::{drawn, drawn_large};
use super::sections::{pair, percent, polar};
use super::tables::Table;
use super::{
    PageSettings, about, base_name, document, figure, figures_of, mode_remark, remarks, short_names,
};
use crate::ReportError;
use crate::figures::backbone;
use crate::figures::modes::diagrams;
use crate::figures::shapes::ModeShapes;

/// Returns a page of a result with modes, as HTML that loads no other file and runs only the script
/// of its figures. The page shows the mode shapes and, if there is one, the figure of the result.
///
/// # Errors
/// [`ReportError::Plot`] if a figure cannot be drawn.
pub fn modes_page(
    modes: &SavedModes,
    result: Option<Figure>,
    shapes: Option<&ModeShapes>,
    settings: &PageSettings,
) -> Result<String, ReportError> {
    let title = settings.title.clone().unwrap_or_else(|| default_title(modes));
    let warnings = modes.checks.iter().filter(|check| check.is_conspicuous());
    let doubts: Vec<String> =
        warnings.map(|check| check.text.clone()).chain(modes.notes.iter().cloned()).collect();
    let heading = html! {
        header {
            h1 { (title) }
            p.subtitle { (subtitle(modes)) }
            (about(&settings.about))
            (remarks(&doubts, &merits(modes)))
            (mode_table(modes))
            p.note { "± is one standard error." }
        }
    };
    let bodies = [
        ("fit", "Response", fit(modes, result)?),
        ("shape", "Mode shapes", shape(modes, shapes)),
        ("amplitude", "Frequency over amplitude", amplitude(modes)?),
        ("data", "Data", data(modes)),
        ("checks", "Checks and candidates", checks(modes)),
    ];
    let present: Vec<_> =
        bodies.into_iter().filter_map(|(id, name, body)| Some((id, name, body?))).collect();
    let files: Vec<String> = modes.records.iter().map(|record| record.file.clone()).collect();
    Ok(document(&title, &heading, &present, settings.command.as_deref(), &files))
}

/// Returns a title with the name of the first file, without its folder.
fn default_title(modes: &SavedModes) -> String {
    let files: Vec<String> = modes.records.iter().map(|record| record.file.clone()).collect();
    let files = if files.is_empty() { vec![modes.name.clone()] } else { files };
    format!("Modes of {}", short_names(&files))
}

fn subtitle(modes: &SavedModes) -> String {
    let mut parts = vec![modes.name.split(", ").map(base_name).collect::<Vec<_>>().join(", ")];
    if !modes.inputs.is_empty() {
        parts.push(message::count(modes.inputs.len(), "force"));
    }
    if !modes.responses().is_empty() {
        parts.push(message::count(modes.responses().len(), "response"));
    }
    if let Some(band) = modes.band_hz {
        let [low, high] = band.map(|hz| compact(hz, 5));
        parts.push(format!("{low} to {high} Hz"));
    }
    parts.join(" · ")
}

fn merits(modes: &SavedModes) -> Vec<String> {
    let good = modes.checks.iter().filter(|check| !check.is_conspicuous());
    let mut subjects: Vec<String> = good.map(|check| check.subject()).collect();
    let count = subjects.len();
    if count == 0 {
        return Vec::new();
    }
    subjects.dedup();
    let total = modes.checks.len();
    vec![format!("{count} of {total} checks of data and fit are good: {}", subjects.join(", "))]
}

/// Returns the table of all modes. An optional column is present only if at least one mode has a
/// value for it.
fn mode_table(modes: &SavedModes) -> Markup {
    type Cell = fn(&SavedMode) -> Option<String>;
    let optional: [(&str, Cell); 6] = [
        ("driven, %", |mode| mode.driven_share.map(|share| significant(100.0 * share, 4))),
        ("energy, %", |mode| mode.energy_share.map(|share| significant(100.0 * share, 3))),
        ("modal mass, kg", |mode| mode.modal_mass.map(|mass| significant(mass, 4))),
        ("± (modal mass), kg", |mode| {
            mode.modal_mass_standard_error.map(|error| significant(error, 2))
        }),
        ("collinearity", |mode| mode.phase_collinearity.map(|value| significant(value, 4))),
        ("remark", |mode| mode_remark(&mode.mode.row)),
    ];
    let present: Vec<_> = optional
        .into_iter()
        .filter(|(_, cell)| modes.modes.iter().any(|mode| cell(mode).is_some()))
        .collect();
    let mut header = vec!["mode", "natural frequency, Hz", "±", "damping ratio, %", "±"];
    header.extend(present.iter().map(|(name, _)| *name));
    let row = |(number, mode): (usize, &SavedMode)| {
        let row = &mode.mode.row;
        let is_pair = row.oscillates || row.is_rigid_body || row.partner.is_some();
        let [frequency, frequency_error, _] = row.natural_frequency_hz.cells();
        let [damping, damping_error, _] = row.damping_ratio.percent().cells();
        let numbers = [frequency, frequency_error, damping, damping_error];
        let numbers = numbers.map(|cell| if is_pair { cell } else { "–".into() });
        let others = present.iter().map(|(_, cell)| cell(mode).unwrap_or_default());
        std::iter::once(number.to_string()).chain(numbers).chain(others).collect()
    };
    let rows = (1..).zip(&modes.modes).map(row).collect();
    Table { caption: "Modes", header: &header, numbers_from: 1, rows }.sortable()
}

/// Returns the figure of the result; the backbone of a machine has a section of its own.
fn fit(modes: &SavedModes, result: Option<Figure>) -> Result<Option<Markup>, ReportError> {
    let has_backbone =
        matches!(&modes.backbone, Some(SavedBackbone::Machine(rows)) if !rows.is_empty());
    let saved = || modes.diagrams.as_ref().and_then(|saved| diagrams(&modes.name, saved));
    let is_saved = result.is_none();
    let Some(result) = result.or_else(saved).filter(|_| !has_backbone) else { return Ok(None) };
    let what = if is_saved {
        "poles of models of rising order, and the mode indicator if it was saved"
    } else if modes.responses().is_empty() {
        "response per unit force, with the natural frequencies"
    } else {
        "measured and fitted responses, and their difference"
    };
    let caption = format!("{}.", what.replacen(|_: char| true, &what[..1].to_uppercase(), 1));
    let drawn = drawn_large("result".into(), vec![(String::new(), result)], caption)?;
    Ok(Some(html! { div.figures { (figure(&drawn)) } }))
}

fn shape(modes: &SavedModes, shapes: Option<&ModeShapes>) -> Option<Markup> {
    let (shaped, points) = modes.shapes();
    let oscillating: Vec<(usize, &ShapedMode)> =
        (1..).zip(&shaped).filter(|(_, mode)| mode.row.oscillates).collect();
    if points.len() < 2 || oscillating.is_empty() {
        return None;
    }
    let name = |(number, mode): &(usize, &ShapedMode)| {
        let [re, im] = mode.eigenvalue;
        format!("mode {number}, {} Hz", significant(re.hypot(im) / TAU, 4))
    };
    let names: Vec<String> = oscillating.iter().map(name).collect();
    let header: Vec<&str> =
        std::iter::once("point").chain(names.iter().map(String::as_str)).collect();
    let row = |(at, point): (usize, &String)| {
        let cell = |(_, mode): &(usize, &ShapedMode)| {
            let [re, im] = mode.shape.get(at).map_or([f64::NAN; 2], |entry| entry.value);
            polar(re, im)
        };
        std::iter::once(point.clone()).chain(oscillating.iter().map(cell)).collect()
    };
    let rows = points.iter().enumerate().map(row).collect();
    let caption = "Mode shapes, modulus and phase at each point; the largest entry is 1";
    let table = Table { caption, header: &header, numbers_from: 1, rows };
    let drawn = shapes.map(shape_figures);
    Some(html! {
        @if let Some(drawn) = &drawn { (figures_of(drawn)) }
        (table.html())
    })
}

fn amplitude(modes: &SavedModes) -> Result<Option<Markup>, ReportError> {
    let Some(saved) = &modes.backbone else { return Ok(None) };
    let (curves, header, rows) = match saved {
        SavedBackbone::Machine(rows) if rows.is_empty() => return Ok(None),
        SavedBackbone::Machine(rows) => {
            let cells = rows.iter().map(|row| {
                let [value, error, interval] = row.frequency_hz.cells();
                let amplitude = significant(row.amplitude, 3);
                vec![row.mode.to_string(), amplitude, value, error, interval]
            });
            let header =
                ["mode", "amplitude, m", "frequency, Hz", "±", "interval"].map(String::from);
            (backbone::of_machine("", rows), header.to_vec(), cells.collect())
        }
        SavedBackbone::Decay(row) => {
            let unit = modes.unit.as_deref().unwrap_or("");
            let cells = row.points.iter().map(|point| {
                let [frequency, frequency_error, _] = point.frequency_hz.cells();
                let [damping, damping_error, _] = point.damping_ratio.percent().cells();
                let [amplitude, time] = [point.amplitude, point.time_s].map(|v| significant(v, 3));
                vec![amplitude, time, frequency, frequency_error, damping, damping_error]
            });
            let amplitude = format!("amplitude, {unit}");
            let header = [&amplitude, "time, s", "frequency, Hz", "±", "damping ratio, %", "±"];
            (backbone::of_decay("", row, unit), header.map(String::from).to_vec(), cells.collect())
        }
    };
    let caption = "Frequency against amplitude (backbone), with confidence intervals.";
    let drawn = drawn("backbone".into(), curves, caption.into())?;
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    let caption = "Values over amplitude";
    Ok(Some(html! {
        div.figures { (figure(&drawn)) }
        (Table { caption, header: &header, numbers_from: 0, rows }.html())
    }))
}

fn data(modes: &SavedModes) -> Option<Markup> {
    let record = |record: &SavedRecord| {
        let what = match (record.first_sample, record.last_sample, record.sample_rate_hz) {
            (Some(first), Some(last), Some(rate)) => {
                format!("samples {first} to {last}, {} Hz", compact(rate, 6))
            }
            _ => record.frequencies.map_or_else(String::new, |n| message::count(n, "frequency")),
        };
        pair(&record.file, what)
    };
    let records: Vec<Vec<String>> = modes.records.iter().map(record).collect();
    type Share = fn(&SavedResponse) -> Option<f64>;
    let shares: [(&str, Share); 3] = [
        ("explained", |response| response.explained),
        ("predicted", |response| response.predicted),
        ("noise", |response| response.noise_share),
    ];
    let stated: Vec<_> = shares
        .into_iter()
        .filter(|(_, share)| modes.responses().iter().any(|response| share(response).is_some()))
        .collect();
    let response = |response: &SavedResponse| {
        let cell = |(_, share): &(&str, Share)| share(response).map_or_else(|| "–".into(), percent);
        std::iter::once(response.column.clone()).chain(stated.iter().map(cell)).collect()
    };
    let responses: Vec<Vec<String>> = modes.responses().iter().map(response).collect();
    let header: Vec<&str> =
        std::iter::once("response").chain(stated.iter().map(|(name, _)| *name)).collect();
    if records.is_empty() && responses.is_empty() {
        return None;
    }
    Some(html! {
        div.tables {
            @if !records.is_empty() {
                (Table { caption: "Records", header: &["file", "what was used"], numbers_from: 9, rows: records }.html())
            }
            @if !responses.is_empty() {
                (Table { caption: "Responses, shares of their variance", header: &header, numbers_from: 1, rows: responses }.html())
            }
        }
    })
}

fn checks(modes: &SavedModes) -> Option<Markup> {
    // A check that passed has no sentence in the table; the heading names this check.
    let shown: Vec<_> =
        modes.checks.iter().filter_map(|check| Some((check, check.text_to_show()?))).collect();
    if shown.is_empty() && modes.dropped.is_empty() {
        return None;
    }
    let rows: Vec<Vec<String>> = modes
        .dropped
        .iter()
        .map(|row| {
            let (hz, ratio) = (significant(row.frequency_hz, 5), percent(row.damping_ratio));
            vec![hz, ratio, row.reason.clone()]
        })
        .collect();
    Some(html! {
        @if !shown.is_empty() {
            ul.checks {
                @for (check, text) in &shown {
                    li {
                        strong class={ "verdict " (check.verdict()) } { (check.verdict()) }
                        " " (check.subject()) ": " (text)
                    }
                }
            }
        }
        @if !rows.is_empty() {
            (Table { caption: "Candidates that are not modes", header: &["frequency, Hz", "damping ratio", "why"], numbers_from: 9, rows }.html())
        }
    })
}
