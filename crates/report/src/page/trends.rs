//! Page of the results of many records.

use maud::{DOCTYPE, Markup, html};
use mechid_analysis::fleet::{SIGNIFICANT, Trends};
use mechid_analysis::text::significant;
use mechid_plot::Figure;

use super::figures::drawn;
use super::tables::Table;
use super::{Drawn, PageSettings, about, figure, figure_script, head, repeat};
use crate::ReportError;
use crate::figures::trends::{DRAWN, panel};

/// Returns an HTML page of the results of many records: failures, every quantity over the records,
/// and outliers. The heading, the details and the command come from the settings. The page loads no
/// other file and runs only the script of its figures.
///
/// # Errors
/// [`ReportError::Plot`] if a figure cannot be drawn.
pub fn trends_page(trends: &Trends, settings: &PageSettings) -> Result<String, ReportError> {
    let title = settings.title.as_deref().unwrap_or("Trends");
    let figures = figures(trends)?;
    let categories: Vec<String> = trends.series.iter().map(|one| one.category().into()).collect();
    let (quantities, changes) = (quantities(trends), changes(trends));
    let (outliers, failures) = (outliers(trends), failures(trends));
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            (head(title))
            body {
                header {
                    h1 { (title) }
                    (about(&settings.about))
                    (counts(trends))
                    @if trends.analyses > 1 {
                        p.note { "The rows come from " (trends.analyses) " analyses or versions, which may not be comparable." }
                    }
                }
                main {
                    @if !changes.rows.is_empty() {
                        section id="changes" aria-labelledby="changes-heading" {
                            h2 id="changes-heading" { "Steps and drifts" }
                            (changes.sortable())
                            p.note {
                                "p is the probability of a change at least as large if the order of the records is \
                                 random (permutation test of the ranks), multiplied by the number of quantities; \
                                 a change with p below "
                                (SIGNIFICANT) " is reported." }
                        }
                    }
                    section id="quantities" data-filter aria-labelledby="quantities-heading" {
                        h2 id="quantities-heading" { "Quantities" }
                        (quantities.html_with_categories(&categories))
                        p.note { "Spread: 1.4826 times the median distance from the median; for normally \
                                  distributed values it is the standard deviation. If the spread is larger than \
                                  the standard error, the machine changes from record to record, or the standard \
                                  errors are too small." }
                        div.figures { @for (one, category) in figures.iter().zip(&categories) { div data-category=(category) { (figure(one)) } } }
                    }
                    @if !outliers.rows.is_empty() {
                        section id="outliers" aria-labelledby="outliers-heading" {
                            h2 id="outliers-heading" { "Outliers" }
                            (outliers.sortable())
                        }
                    }
                    @if !failures.rows.is_empty() {
                        section id="failures" aria-labelledby="failures-heading" {
                            h2 id="failures-heading" { "Records without a result" }
                            (failures.html())
                        }
                    }
                    (repeat(settings.command.as_deref()))
                }
                (figure_script())
            }
        }
    };
    Ok(page.into_string() + "\n")
}

/// Lists the numbers of records.
fn counts(trends: &Trends) -> Markup {
    html! {
        dl.summary {
            div { dt { "Records" } dd { (trends.records) } }
            div { dt { "Without a result" } dd { (trends.failed) } }
            @if trends.without_number > 0 {
                div { dt { "Left out: records without a number in the name" } dd { (trends.without_number) } }
            }
        }
    }
}

/// Draws every quantity over the records.
fn figures(trends: &Trends) -> Result<Vec<Drawn>, ReportError> {
    let figures = (1..).zip(&trends.series).map(|(number, series)| {
        let count = series.points.len();
        let thinned = if count > DRAWN {
            format!("; some of {count} values are drawn")
        } else {
            String::new()
        };
        let caption = format!("{} with 95 % intervals{thinned}", series.name);
        let one = Figure::new(series.name.as_str()).panel(panel(series, trends.over));
        drawn(format!("series-{number}"), one, caption)
    });
    figures.collect()
}

/// Returns the table of the quantities.
fn quantities(trends: &Trends) -> Table<'static> {
    let quantities = trends.series.iter().map(|series| {
        let error = series.standard_error.map_or_else(|| "–".into(), |error| significant(error, 2));
        vec![
            series.name.clone(),
            series.unit.clone(),
            significant(series.median, 6),
            significant(series.spread, 2),
            error,
            series.outliers().count().to_string(),
            series.points.len().to_string(),
        ]
    });
    Table {
        caption: "Quantities",
        header: &["quantity", "unit", "median", "spread", "standard error", "outliers", "records"],
        numbers_from: 2,
        rows: quantities.collect(),
    }
}

/// Returns the table of steps and drifts.
fn changes(trends: &Trends) -> Table<'static> {
    let changes = trends.changes().map(|(series, change)| {
        vec![
            series.name.clone(),
            change.kind.name().into(),
            change.record.clone(),
            significant(change.size, 3),
            series.unit.clone(),
            change.p().trim_start_matches("= ").to_owned(),
        ]
    });
    Table {
        caption: "Steps and drifts",
        header: &["quantity", "change", "begins with", "size", "unit", "p"],
        numbers_from: 3,
        rows: changes.collect(),
    }
}

/// Returns the table of the outliers.
fn outliers(trends: &Trends) -> Table<'static> {
    let outliers = trends.series.iter().flat_map(|series| {
        series.outliers().map(|point| {
            let away = (point.value - series.median) / series.spread;
            vec![
                point.record.clone(),
                series.name.clone(),
                significant(point.value, 6),
                series.unit.clone(),
                significant(away, 3),
            ]
        })
    });
    Table {
        caption: "Outliers",
        header: &["record", "quantity", "value", "unit", "spreads from the median"],
        numbers_from: 2,
        rows: outliers.collect(),
    }
}

/// Returns the table of the records without a result.
fn failures(trends: &Trends) -> Table<'static> {
    let failures = trends.failures.iter().map(|failure| {
        vec![
            failure.code.clone(),
            failure.record.clone(),
            failure.message.clone(),
            failure.records.to_string(),
        ]
    });
    Table {
        caption: "Failures",
        header: &["code", "first record", "its failure", "records"],
        numbers_from: 3,
        rows: failures.collect(),
    }
}
