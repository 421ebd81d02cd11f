//! Lists of checks with their verdicts.

use maud::{Markup, html};
use mechid_analysis::identify::checks::{CheckRow, When};

use super::Contents;

/// Returns the checks before or after the fit, with their verdicts.
pub fn list(contents: &Contents<'_>, when: When) -> Markup {
    let checks: Vec<&CheckRow> = contents
        .review
        .identified
        .summary()
        .checks
        .iter()
        .filter(|check| check.when == when)
        .collect();
    html! {
        @if !checks.is_empty() {
            ul.checks {
                @for check in checks {
                    li { strong class={ "verdict " (check.verdict) } { (check.verdict) } " " (check.subject) ": " (check.sentence()) }
                }
            }
        }
    }
}
