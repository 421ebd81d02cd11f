//! Lists of checks with their verdicts.

use maud::{Markup, html};
use mechid_analysis::identify::checks::{CheckRow, When};

/// Returns the checks before or after the fit, with their verdicts.
pub fn list(checks: &[CheckRow], when: When) -> Markup {
    let checks: Vec<&CheckRow> = checks.iter().filter(|check| check.when == when).collect();
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
