//! The page of an identified machine of named elements.

use maud::{Markup, html};
use mechid_analysis::IdentifiedElements;
use mechid_analysis::elements::{CandidateRow, ElementSummary};
use mechid_analysis::identify::checks::When;
use mechid_analysis::text::{compact, significant};
use mechid_signal::message;

use super::sections::{pair, percent};
use super::tables::Table;
use super::{
    PageSettings, about, checks, document, figure, figures, modes_found, names_of, remarks,
    short_names,
};
use crate::ReportError;
use crate::figures::elements as sensors;

/// Returns a page with all results of the identification of a machine of named elements, as HTML
/// that loads no other file and runs only the script of its figures.
///
/// # Errors
/// [`ReportError::Plot`].
pub fn elements_page(
    identified: &IdentifiedElements,
    settings: &PageSettings,
) -> Result<String, ReportError> {
    let summary = identified.summary();
    let files: Vec<String> = summary.tests.iter().map(|test| test.file.clone()).collect();
    let default_title = || format!("Identification of {}", short_names(&files));
    let title = settings.title.clone().unwrap_or_else(default_title);
    let mut doubts = checks::conspicuous(&summary.checks);
    doubts.extend(summary.combinations.iter().map(|row| row.text.clone()));
    let heading = html! {
        header {
            h1 { (title) }
            p.subtitle { (names_of(&files)) " · maximum likelihood" }
            (about(&settings.about))
            (remarks(&doubts, &checks::merits(&summary.checks)))
            (modes_found(&summary.modes))
        }
    };
    let sections = [
        ("data", "Data", data(summary)),
        ("machine", "Machine", machine(identified)),
        ("response", "Response and fit", response(identified)?),
        ("residual", "Residual", residual(summary)),
    ];
    Ok(document(&title, &heading, &sections, settings.command.as_deref(), &files))
}

fn data(found: &ElementSummary) -> Markup {
    let [low, high] = found.band_hz.map(|hz| compact(hz, 5));
    let facts = vec![
        pair("Degrees of freedom", found.points.join(", ")),
        pair("Inputs", found.inputs.join(", ")),
        pair("Lines", format!("{}, from {low} to {high} Hz", found.lines)),
        pair("Noise", &found.noise),
    ];
    let tests = found.tests.iter().map(|test| pair(&test.file, test.words())).collect();
    html! {
        div.tables {
            (Table { caption: "The data", header: &[], numbers_from: 9, rows: facts }.html())
            (Table { caption: "Tests", header: &["file", "what was used"], numbers_from: 9, rows: tests }.html())
        }
        @for hit in found.hits.iter().filter(|hit| !hit.used) { p.note { (hit.record) ", " (hit) "." } }
        (checks::list(&found.checks, When::Before))
    }
}

/// Returns tables of the unknowns, of the fit and of possible additional measurements, and the
/// notes.
fn machine(identified: &IdentifiedElements) -> Markup {
    let summary = identified.summary();
    let interval = format!("{} % interval", compact(100.0 * summary.confidence, 3));
    let header = ["unknown", "value", "±", &interval, "unit", "from its prior"];
    let rows = summary.parameters.iter().map(|row| {
        let [value, error, interval] = row.cells();
        let share = row.estimate.prior.map(|prior| percent(prior.share));
        let unit = row.unit.to_owned();
        vec![row.estimate.name.clone(), value, error, interval, unit, share.unwrap_or_default()]
    });
    let has_priors = summary.parameters.iter().any(|row| row.estimate.prior.is_some());
    let columns = if has_priors { 6 } else { 5 };
    let rows: Vec<Vec<String>> = rows.map(|row| row[..columns].to_vec()).collect();
    let best = summary.minima.first().map_or(0, |minimum| minimum.searches);
    let fit = vec![
        pair(
            "Searches that ended at the highest likelihood",
            format!("{best} of {}", summary.searches),
        ),
        pair("Minima found", summary.minima.len().to_string()),
        pair("Logarithm of the likelihood", significant(summary.log_likelihood, 6)),
        pair("Condition number", significant(summary.condition_number, 3)),
        pair(
            "Equations",
            format!("{} for {}", summary.equations, message::count(rows.len(), "unknown")),
        ),
    ];
    html! {
        div.tables {
            (Table { caption: "Unknowns", header: &header[..columns], numbers_from: 1, rows }.html())
            (Table { caption: "The fit", header: &[], numbers_from: 9, rows: fit }.html())
        }
        p.note { "± is one standard error." }
        (candidates(summary))
        @for note in &summary.notes { p.note { (note) "." } }
    }
}

fn candidates(found: &ElementSummary) -> Markup {
    let row = |row: &CandidateRow| {
        let gain = row.information_gain.map_or("∞".into(), |gain| significant(gain, 3));
        let reduction = found.reduction(row).map_or("–".into(), |share| significant(share, 3));
        vec![row.name.clone(), gain, row.newly_determined.to_string(), reduction]
    };
    let header = ["to add", "information", "newly determined", "mean reduction of ±, %"];
    let rows: Vec<Vec<String>> = found.candidates.iter().map(row).collect();
    html! {
        @if !rows.is_empty() {
            (Table { caption: "Possible additional measurements", header: &header, numbers_from: 1, rows }.html())
            p.note {
                "Information: natural logarithm of a ratio. The ratio is the volume of the confidence region of \
                 all unknowns without the measurement, divided by the volume with the measurement."
            }
        }
    }
}

fn response(identified: &IdentifiedElements) -> Result<Markup, ReportError> {
    let caption =
        "Amplitude of every sensor over frequency, on the lines of the first test: measured, \
                   computed with the identified machine, and their difference."
            .to_owned();
    let drawn = figures::drawn_set("sensors".into(), sensors::set(identified), caption)?;
    Ok(html! { div.figures { (figure(&drawn)) } })
}

fn residual(found: &ElementSummary) -> Markup {
    let row = |sensor: &mechid_analysis::elements::SensorRow| {
        pair(&sensor.name, percent(sensor.relative_residual))
    };
    let rows = found.sensors.iter().map(row).collect();
    let misfit = found.misfit_ratio.map(|ratio| significant(ratio, 4));
    html! {
        (Table { caption: "Residual of the response", header: &["sensor", "residual, of RMS"], numbers_from: 1, rows }.html())
        @if let Some(ratio) = misfit {
            p { "Power of the residual / power of the noise: " strong { (ratio) } "; 1 is expected." }
        }
        (checks::list(&found.checks, When::After))
    }
}
