//! The page of the results of many records.

use maud::{DOCTYPE, PreEscaped, html};
use mechid_analysis::fleet::Trends;
use mechid_analysis::text::significant;
use mechid_plot::Figure;

use super::figures::drawn;
use super::tables::Table;
use super::{STYLE, figure};
use crate::ReportError;
use crate::figures::trends::{DRAWN, panel};

/// Returns a page of the results of many records: what failed, every quantity over the records, and
/// outliers; HTML that loads nothing and runs nothing.
///
/// # Errors
/// [`ReportError::Plot`] if a figure cannot be drawn.
pub fn trends_page(trends: &Trends, title: &str) -> Result<String, ReportError> {
    let mut figures = Vec::new();
    for (number, series) in (1..).zip(&trends.series) {
        let all = series.points.len();
        let thinned =
            if all > DRAWN { format!("; some of {all} values are drawn") } else { String::new() };
        let caption = format!("{} with 95 % intervals{thinned}", series.name);
        let one = Figure::new(series.name.as_str()).panel(panel(series, trends.over));
        figures.push(drawn(format!("series-{number}"), one, caption)?);
    }
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
    let header = ["quantity", "unit", "median", "spread", "standard error", "outliers", "records"];
    let quantities = Table {
        caption: "Quantities",
        header: &header,
        numbers_from: 2,
        rows: quantities.collect(),
    };
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
    let header = ["record", "quantity", "value", "unit", "spreads from the median"];
    let outliers =
        Table { caption: "Outliers", header: &header, numbers_from: 2, rows: outliers.collect() };
    let failures = trends.failures.iter().map(|failure| {
        vec![
            failure.code.clone(),
            failure.record.clone(),
            failure.message.clone(),
            failure.records.to_string(),
        ]
    });
    let header = ["code", "first record", "its failure", "records"];
    let failures =
        Table { caption: "Failures", header: &header, numbers_from: 3, rows: failures.collect() };
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                // Nothing is loaded and nothing runs, whatever a name in the table says.
                meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'unsafe-inline'";
                meta name="color-scheme" content="light";
                meta name="generator" content={ "mechid " (env!("CARGO_PKG_VERSION")) };
                title { (title) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                header {
                    h1 { (title) }
                    dl.summary {
                        div { dt { "Records" } dd { (trends.records) } }
                        div { dt { "Without a result" } dd { (trends.failed) } }
                        @if trends.without_number > 0 {
                            div { dt { "Left out, no number in the name" } dd { (trends.without_number) } }
                        }
                    }
                    @if trends.analyses > 1 {
                        p.note { "The rows come from " (trends.analyses) " analyses or versions, which may not be comparable." }
                    }
                }
                main {
                    section id="quantities" aria-labelledby="quantities-heading" {
                        h2 id="quantities-heading" { "Quantities" }
                        (quantities.html())
                        p.note { "Spread: 1.4826 times the median distance from the median, the standard deviation of normal values. Where it is larger than the standard error, the machine changes from record to record, or the standard errors are too small." }
                        div.figures { @for one in &figures { (figure(one)) } }
                    }
                    @if !outliers.rows.is_empty() {
                        section id="outliers" aria-labelledby="outliers-heading" {
                            h2 id="outliers-heading" { "Outliers" }
                            (outliers.html())
                        }
                    }
                    @if !failures.rows.is_empty() {
                        section id="failures" aria-labelledby="failures-heading" {
                            h2 id="failures-heading" { "Records without a result" }
                            (failures.html())
                        }
                    }
                }
            }
        }
    };
    Ok(page.into_string() + "\n")
}
