//! The HTML page of an identification: one file that needs nothing else.

mod checks;
mod figures;
mod sections;
mod tables;
#[cfg(feature = "parquet")]
mod trends;

use std::path::PathBuf;

use maud::{DOCTYPE, Markup, PreEscaped, html};

use mechid_analysis::identify::Identified;
use mechid_analysis::identify::rows::ModeRow;
use mechid_analysis::modal::ShapedMode;
use mechid_analysis::review::{RecordReview, Review, judgement};
use mechid_analysis::text::significant;

use self::figures::Drawn;
#[cfg(feature = "parquet")]
pub use self::trends::trends_page;
use crate::ReportError;

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

/// Words of a page that the identification itself does not give.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct PageSettings {
    /// Heading; `None`: the name of the record.
    pub title: Option<String>,
    /// `true` to reconstruct the force with the identified machine and compare it.
    pub reconstruct_force: bool,
    /// Command that writes the page again; `None`: only the saved settings are shown.
    pub command: Option<String>,
}

/// Contents of the page.
struct Contents<'a> {
    title: String,
    review: &'a Review<'a>,
    command: Option<&'a str>,
}

/// Returns a page with everything that an identification has to show, as HTML that loads nothing and
/// runs nothing.
///
/// # Errors
/// [`ReportError::Analysis`] if a record cannot be read again or the force cannot be reconstructed,
/// [`ReportError::Plot`].
pub fn page(identified: &Identified, settings: &PageSettings) -> Result<String, ReportError> {
    let review = Review::of(identified, settings.reconstruct_force)?;
    let name = PathBuf::from(&identified.summary().file);
    let name = name.file_name().unwrap_or_default().to_string_lossy();
    html(&Contents {
        title: settings.title.clone().unwrap_or_else(|| format!("Identification of {name}")),
        review: &review,
        command: settings.command.as_deref(),
    })
}

/// Identifiers and captions of what is shown of a record.
trait Captions {
    /// Returns the identifier of a figure of this record.
    fn id(&self, figure: &str) -> String;

    /// Returns a caption of what is told of the samples held, with their numbers where these are not
    /// all.
    fn of_held(&self, caption: &str) -> String;

    /// Returns the same for what is told of [`RecordReview::period`].
    fn of_period(&self, caption: &str) -> String;
}

impl Captions for RecordReview<'_> {
    fn id(&self, figure: &str) -> String {
        match self.index {
            0 => figure.into(),
            index => format!("{figure}-{}", index + 1),
        }
    }

    fn of_held(&self, caption: &str) -> String {
        match self.held().held_to() {
            Some(last) => format!("{caption}, samples {} to {last}", self.held().first_sample),
            None => caption.into(),
        }
    }

    fn of_period(&self, caption: &str) -> String {
        match self.lines {
            Some(_) => caption.into(),
            None => self.of_held(caption),
        }
    }
}

/// Returns the whole document.
fn html(contents: &Contents<'_>) -> Result<String, ReportError> {
    let bodies = [
        Some(sections::data(contents)?),
        Some(sections::excitation(contents)?),
        Some(sections::machine(contents)?),
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
pub(crate) fn figure(drawn: &Drawn) -> Markup {
    html! {
        figure id={ "figure-" (drawn.id) } {
            // Made by `mechid-plot`, which escapes the words in it.
            (PreEscaped(&drawn.svg))
            figcaption { (drawn.caption) }
        }
    }
}

/// Number of frequencies and damping ratios in the heading.
const SUMMARISED: usize = 8;

fn heading(contents: &Contents<'_>) -> Markup {
    let report = contents.review.identified.summary();
    let modes =
        ModeRow::quantities(&ShapedMode::rows(&report.modes), false).into_iter().take(SUMMARISED);
    html! {
        header {
            h1 { (contents.title) }
            p.subtitle { (files(contents)) " · " (report.estimator) }
            dl.summary {
                @for (name, value, unit) in modes {
                    @let [number, error, _] = value.cells();
                    @let unit = if unit == "–" { String::new() } else { format!(" {unit}") };
                    div { dt { "Mode " (name) } dd { (number) (unit) small { "± " (error) (unit) } } }
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
    let names: Vec<&str> = contents.review.records.iter().map(|r| r.held().file.as_str()).collect();
    names.join(", ")
}

/// Section of warnings, and of what supports the numbers.
fn remarks(contents: &Contents<'_>) -> Markup {
    let (doubts, merits) = (judgement::doubts(contents.review), judgement::merits(contents.review));
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
            @if let Some(command) = contents.command {
                p { "With mechid " (env!("CARGO_PKG_VERSION")) ", in the folder from which the record is named as above:" }
                div.scroll role="region" tabindex="0" aria-label="The command" { pre { code { (command) } } }
            } @else {
                p { "With mechid " (env!("CARGO_PKG_VERSION")) "." }
            }
        }
    }
}
