//! The page around the sections: head, heading, contents, summary, what to know first, the end.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::figures::Drawn;
use super::{Contents, judgement, sections};
use crate::error::CliError;
use crate::text_table::significant;

/// Inline, for the file stands alone.
const STYLE: &str = include_str!("style.css");

/// Identifier and heading of each section.
const SECTIONS: [(&str, &str); 7] = [
    ("data", "Data"),
    ("excitation", "Excitation"),
    ("machine", "Machine"),
    ("response", "Frequency response and fit"),
    ("residual", "Residual"),
    ("validation", "Another record"),
    ("reconstruction", "Identified force"),
];

/// The whole document.
pub fn html(contents: &Contents<'_>) -> Result<String, CliError> {
    let bodies = [
        Some(sections::data(contents)?),
        Some(sections::excitation(contents)?),
        Some(sections::machine(contents)),
        Some(sections::response(contents)?),
        Some(sections::residual(contents)?),
        sections::validation(contents)?,
        sections::reconstruction(contents)?,
    ];
    let present: Vec<(&str, &str, Markup)> = SECTIONS
        .into_iter()
        .zip(bodies)
        .filter_map(|((id, name), body)| Some((id, name, body?)))
        .collect();
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                // Nothing is loaded and nothing runs, whatever a name in the record says.
                meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'unsafe-inline'";
                meta name="color-scheme" content="light";
                meta name="generator" content={ "mechid " (env!("CARGO_PKG_VERSION")) };
                title { (contents.title) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                (heading(contents))
                nav aria-label="Sections" { ul {
                    @for (id, name, _) in &present { li { a href={ "#" (id) } { (name) } } }
                    li { a href="#repeat" { "How to repeat it" } }
                } }
                main {
                    (remarks(contents))
                    @for (id, name, body) in &present {
                        section id=(id) aria-labelledby={ (id) "-heading" } {
                            h2 id={ (id) "-heading" } { (name) }
                            (body)
                        }
                    }
                    (repeat(contents))
                }
            }
        }
    };
    Ok(page.into_string() + "\n")
}

/// A picture with its caption.
pub fn figure(drawn: &Drawn) -> Markup {
    html! {
        figure id={ "figure-" (drawn.id) } {
            // Made by `mechid-plot`, which escapes the words in it.
            (PreEscaped(&drawn.svg))
            figcaption { (drawn.caption) }
        }
    }
}

fn heading(contents: &Contents<'_>) -> Markup {
    let report = &contents.found.report;
    let modes = report.modes.iter().take(4).enumerate();
    html! {
        header {
            h1 { (contents.title) }
            p.subtitle { (files(contents)) " · " (report.estimator) }
            dl.summary {
                @for (at, mode) in modes {
                    @let [hz, hz_error, _] = mode.natural_frequency_hz.cells();
                    @let [ratio, ratio_error, _] = mode.damping_ratio.cells();
                    div { dt { "Mode " (at + 1) ", natural frequency" } dd { (hz) " Hz" small { "± " (hz_error) " Hz" } } }
                    div { dt { "Mode " (at + 1) ", damping ratio" } dd { (ratio) small { "± " (ratio_error) } } }
                }
                @if let Some(part) = report.fit.unexplained_motion {
                    div { dt { "Motion left unexplained" } dd { (significant(100.0 * part, 3)) " %" } }
                }
            }
            @if !report.modes.is_empty() {
                p.note { "± is one standard error; 95 % intervals are in the section on the machine." }
            }
        }
    }
}

fn files(contents: &Contents<'_>) -> String {
    let names: Vec<&str> = contents.found.records.iter().map(|r| r.held.file.as_str()).collect();
    names.join(", ")
}

/// What speaks against the numbers, and what for them.
fn remarks(contents: &Contents<'_>) -> Markup {
    let (doubts, merits) = (judgement::doubts(contents), judgement::merits(contents));
    html! {
        @if !doubts.is_empty() {
            aside.remarks aria-labelledby="doubts-heading" {
                h2 id="doubts-heading" { "Before you believe the numbers" }
                ul { @for doubt in &doubts { li { (doubt) } } }
            }
        }
        @if !merits.is_empty() {
            aside.remarks.good aria-labelledby="merits-heading" {
                h2 id="merits-heading" { "What speaks for the numbers" }
                ul { @for merit in &merits { li { (merit) } } }
            }
        }
    }
}

fn repeat(contents: &Contents<'_>) -> Markup {
    html! {
        section id="repeat" aria-labelledby="repeat-heading" {
            h2 id="repeat-heading" { "How to repeat it" }
            p { "With mechid " (env!("CARGO_PKG_VERSION")) ", in the folder from which the record is named as above:" }
            div.scroll role="region" tabindex="0" aria-label="The command" { pre { code { (contents.command) } } }
        }
    }
}
