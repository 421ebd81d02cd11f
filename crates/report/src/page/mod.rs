//! The HTML page of an identification, in one file without dependencies.

mod alone;
mod checks;
mod elements;
mod figures;
mod modes;
pub(crate) mod results;
mod sections;
mod tables;
#[cfg(feature = "parquet")]
mod trends;

use maud::{DOCTYPE, Markup, PreEscaped, html};
use mechid_io::Geometry;
use mechid_plot::{content_policy, figure_style, script};

use mechid_analysis::identify::Identified;
use mechid_analysis::identify::rows::ModeRow;
use mechid_analysis::modal::ShapedMode;
use mechid_analysis::review::{RecordReview, Review, judgement};
use mechid_analysis::text::significant;

pub use self::alone::figure_page;
pub use self::elements::elements_page;
use self::figures::Drawn;
pub use self::modes::modes_page;
pub use self::results::{comparison_page, comparison_svg};
use self::tables::Table;
#[cfg(feature = "parquet")]
pub use self::trends::trends_page;
use crate::ReportError;

/// Style sheet, included in the page so that it needs no other file.
const STYLE: &str = include_str!("style.css");

/// Returns the head of a page. Its content security policy ensures that the page loads no other
/// file and runs only the script of the figures, even if a name in a record contains HTML.
fn head(title: &str) -> Markup {
    html! {
        head {
            meta charset="utf-8";
            meta name="viewport" content="width=device-width, initial-scale=1";
            meta http-equiv="Content-Security-Policy" content=(content_policy());
            meta name="color-scheme" content="light dark";
            meta name="generator" content={ "mechid " (env!("CARGO_PKG_VERSION")) };
            title { (title) }
            style { (PreEscaped(figure_style())) (PreEscaped(STYLE)) }
        }
    }
}

/// Returns the script of the figures, which contains no text from a record.
fn figure_script() -> Markup {
    html! { script { (PreEscaped(script())) } }
}

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

/// Texts of a page that are not part of the identification.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PageSettings {
    /// Heading; `None`: the name of the record.
    pub title: Option<String>,
    /// `true` to reconstruct the force with the identified system and compare it with the measured
    /// force.
    pub reconstruct_force: bool,
    /// Command that writes the page again; `None`: only the saved settings are shown.
    pub command: Option<String>,
    /// Names and values of further information on the page, such as sensors, operator, date, place
    /// and comment.
    pub about: Vec<(String, String)>,
    /// Points of the channels, at which the mode shapes are drawn; if `None`, the names of the
    /// channels determine a row or a grid of points.
    pub geometry: Option<Geometry>,
}

/// Contents of the page.
struct Contents<'a> {
    title: String,
    review: &'a Review<'a>,
    command: Option<&'a str>,
    about: &'a [(String, String)],
    geometry: Option<&'a Geometry>,
}

/// Returns a page with all results of an identification, as HTML that loads no other file and runs
/// only the script of its figures.
///
/// # Errors
/// [`ReportError::Analysis`] if a record cannot be read again or the force cannot be reconstructed,
/// [`ReportError::Plot`].
pub fn page(identified: &Identified, settings: &PageSettings) -> Result<String, ReportError> {
    let review = Review::new(identified, settings.reconstruct_force)?;
    let default_title = || {
        let records = identified.summary().records.iter();
        let files: Vec<String> = records.map(|record| record.file.clone()).collect();
        format!("Identification of {}", short_names(&files))
    };
    html(&Contents {
        title: settings.title.clone().unwrap_or_else(default_title),
        review: &review,
        command: settings.command.as_deref(),
        about: &settings.about,
        geometry: settings.geometry.as_ref(),
    })
}

/// Identifiers and captions of the figures of a record.
trait Captions {
    /// Returns the identifier of a figure of this record.
    fn id(&self, figure: &str) -> String;

    /// Returns the caption of a figure of the buffered samples, with the first and the last sample
    /// number if not all samples are buffered.
    fn buffered_caption(&self, caption: &str) -> String;

    /// Returns the caption of a figure of [`RecordReview::period`], with the first and the last
    /// sample number if the figure does not cover all samples.
    fn period_caption(&self, caption: &str) -> String;
}

impl Captions for RecordReview<'_> {
    fn id(&self, figure: &str) -> String {
        match self.index {
            0 => figure.into(),
            index => format!("{figure}-{}", index + 1),
        }
    }

    fn buffered_caption(&self, caption: &str) -> String {
        match self.held().held_to() {
            Some(last) => format!("{caption}, samples {} to {last}", self.held().first_sample),
            None => caption.into(),
        }
    }

    fn period_caption(&self, caption: &str) -> String {
        match self.lines {
            Some(_) => caption.into(),
            None => self.buffered_caption(caption),
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
    let summary = contents.review.identified.summary();
    let files = summary.records.iter().map(|record| record.file.clone());
    let validation = summary.validation.iter().map(|validation| validation.file.clone());
    let files: Vec<String> = files.chain(validation).collect();
    Ok(document(&contents.title, &heading(contents), &present, contents.command, &files))
}

/// Returns a document with a heading, its sections (identifier, name, body) and the command that
/// writes the document again. Names of files have no folders, except in the command.
fn document(
    title: &str,
    heading: &Markup,
    present: &[(&str, &str, Markup)],
    command: Option<&str>,
    files: &[String],
) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            (head(title))
            body {
                (without_folders(heading, files))
                nav aria-label="Sections" { ul {
                    @for (id, name, _) in present { li { a href={ "#" (id) } { (name) } } }
                    li { a href="#repeat" { "How to repeat it" } }
                } }
                main {
                    @for (id, name, body) in present {
                        section id=(id) aria-labelledby={ (id) "-heading" } {
                            h2 id={ (id) "-heading" } { (name) }
                            (without_folders(body, files))
                        }
                    }
                    (repeat(command))
                }
                (figure_script())
            }
        }
    };
    page.into_string() + "\n"
}

/// Removes the folders from the names of files in a part of a page. Files with the same name in
/// different folders keep their folders.
fn without_folders(part: &Markup, files: &[String]) -> Markup {
    let escaped = |text: &str| html! { (text) }.into_string();
    let is_alone = |file: &&String| {
        let has_its_name = |other: &String| base_name(other) == base_name(file);
        files.iter().all(|other| other == *file || !has_its_name(other))
    };
    let short = files
        .iter()
        .filter(is_alone)
        .fold(part.0.clone(), |text, file| text.replace(&escaped(file), &escaped(base_name(file))));
    PreEscaped(short)
}

/// Returns the name of a file without its folder.
fn base_name(file: &str) -> &str {
    file.rsplit(['/', '\\']).next().unwrap_or(file)
}

/// Returns the names of files without their folders.
fn names_of(files: &[String]) -> String {
    files.iter().map(|file| base_name(file)).collect::<Vec<_>>().join(", ")
}

/// Returns the name of the first file without its folder, and the number of further files.
pub(crate) fn short_names(files: &[String]) -> String {
    let name = files.first().map_or("", |file| base_name(file));
    match files.len() {
        0 | 1 => name.to_owned(),
        count => format!("{name} and {} more", count - 1),
    }
}

/// Returns figures side by side; a figure that fills a row has a block of its own, so that a page
/// may break after it.
fn figures_of(all: &[Drawn]) -> Markup {
    html! {
        @for block in all.chunk_by(|a, b| !a.is_wide && !b.is_wide) {
            div.figures { @for one in block { (figure(one)) } }
        }
    }
}

/// Returns a figure with its caption.
pub(crate) fn figure(drawn: &Drawn) -> Markup {
    html! {
        figure id={ "figure-" (drawn.id) } class=[drawn.is_wide.then_some("wide")] {
            // The SVG comes from `mechid-plot`, which escapes the text in it.
            (PreEscaped(&drawn.svg))
            @if !drawn.map.is_empty() {
                div.map {
                    @for (name, svg) in &drawn.map {
                        button type="button" { (PreEscaped(svg)) (name) }
                    }
                }
            }
            @if !drawn.caption.is_empty() { figcaption { (drawn.caption) } }
        }
    }
}

fn heading(contents: &Contents<'_>) -> Markup {
    let report = contents.review.identified.summary();
    html! {
        header {
            h1 { (contents.title) }
            p.subtitle { (files(contents)) " · " (report.estimator) }
            (about(contents.about))
            (remarks(&judgement::doubts(contents.review), &judgement::merits(contents.review)))
            (modes_found(&ShapedMode::rows(&report.modes)))
            @if let Some(part) = report.fit.unexplained_motion {
                p.note { "Unexplained motion: " strong { (significant(100.0 * part, 3)) " %" } }
            }
        }
    }
}

/// Returns names and values of further information.
fn about(about: &[(String, String)]) -> Markup {
    html! {
        @if !about.is_empty() {
            dl.about { @for (name, value) in about { div { dt { (name) } dd { (value) } } } }
        }
    }
}

/// Returns what is special about a mode; `None` for an oscillation that decays.
fn mode_remark(mode: &ModeRow) -> Option<String> {
    match (&mode.pole, &mode.growth_rate) {
        (_, Some(rate)) => Some(format!("unstable: grows at {} 1/s", significant(rate.value, 3))),
        (Some(pole), _) => {
            Some(format!("does not oscillate: pole {} 1/s", significant(pole.value, 4)))
        }
        _ if mode.is_rigid_body => Some("rigid body".into()),
        _ => None,
    }
}

/// Returns all modes in a sortable table.
fn modes_found(modes: &[ModeRow]) -> Markup {
    let row = |(number, mode): (usize, &ModeRow)| {
        let [frequency, error, _] = mode.natural_frequency_hz.cells();
        let [ratio, ratio_error, _] = mode.damping_ratio.percent().cells();
        let is_pair = mode.oscillates || mode.is_rigid_body || mode.partner.is_some();
        let dash = |text: String| if is_pair { text } else { "–".into() };
        vec![
            number.to_string(),
            dash(frequency),
            dash(error),
            dash(ratio),
            dash(ratio_error),
            mode_remark(mode).unwrap_or_default(),
        ]
    };
    let rows: Vec<Vec<String>> = (1..).zip(modes).map(row).collect();
    let header = ["mode", "natural frequency, Hz", "±", "damping ratio, %", "±", "remark"];
    let has_remarks = rows.iter().any(|row| !row[5].is_empty());
    let columns = if has_remarks { 6 } else { 5 };
    let rows: Vec<Vec<String>> = rows.into_iter().map(|row| row[..columns].to_vec()).collect();
    html! {
        @if !rows.is_empty() {
            (Table { caption: "Modes found", header: &header[..columns], numbers_from: 1, rows }.sortable())
            p.note { "± is one standard error; 95 % intervals are in the section on the machine." }
        }
    }
}

fn files(contents: &Contents<'_>) -> String {
    let records = contents.review.records.iter();
    names_of(&records.map(|record| record.held().file.clone()).collect::<Vec<_>>())
}

/// Returns the section of warnings, and of the information that supports the numbers.
fn remarks(doubts: &[String], merits: &[String]) -> Markup {
    html! {
        @if !doubts.is_empty() {
            aside.remarks aria-labelledby="doubts-heading" {
                h2 id="doubts-heading" { "Before you believe the numbers" }
                ul { @for doubt in doubts { li { (doubt) } } }
            }
        }
        @if !merits.is_empty() {
            aside.remarks.good aria-labelledby="merits-heading" {
                h2 id="merits-heading" { "Evidence for the numbers" }
                ul { @for merit in merits { li { (merit) } } }
            }
        }
    }
}

fn repeat(command: Option<&str>) -> Markup {
    html! {
        section id="repeat" aria-labelledby="repeat-heading" {
            h2 id="repeat-heading" { "How to repeat it" }
            @if let Some(command) = command {
                p { "With mechid " (env!("CARGO_PKG_VERSION")) ": run this command in the folder to which the file names are relative." }
                div.scroll role="region" tabindex="0" aria-label="The command" { pre { code { (command) } } }
            } @else {
                p { "With mechid " (env!("CARGO_PKG_VERSION")) "." }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_have_no_folders_unless_their_names_are_equal() {
        let part = html! { p { "a/x & y.csv: late; a/1.csv, b/1.csv: clipped" } };
        let files = ["a/x & y.csv", "a/1.csv", "b/1.csv"].map(String::from);
        let short = without_folders(&part, &files).into_string();
        assert_eq!(short, "<p>x &amp; y.csv: late; a/1.csv, b/1.csv: clipped</p>");
        // The same file in two records counts as one file.
        let twice = ["a/1.csv", "a/1.csv"].map(String::from);
        assert!(!without_folders(&part, &twice).into_string().contains("a/1.csv"));
    }
}
