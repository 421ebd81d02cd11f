//! Lists of checks with their verdicts.

use maud::{Markup, html};
use mechid_analysis::identify::checks::{CheckRow, When};

/// Returns a sentence for each conspicuous check. A conspicuous check makes the results doubtful.
pub fn conspicuous(checks: &[CheckRow]) -> Vec<String> {
    let doubtful = checks.iter().filter(|check| check.is_conspicuous());
    doubtful.map(|check| format!("{}: {}", check.subject, check.sentence())).collect()
}

/// Returns a sentence with the number of good checks and their subjects; none if no check is good.
pub fn merits(checks: &[CheckRow]) -> Vec<String> {
    let good = checks.iter().filter(|check| !check.is_conspicuous());
    let (count, all) = (good.clone().count(), checks.len());
    let mut subjects: Vec<String> = Vec::new();
    for subject in good.map(|check| check.subject.to_string()) {
        if !subjects.contains(&subject) {
            subjects.push(subject);
        }
    }
    if count == 0 {
        return Vec::new();
    }
    vec![format!("{count} of {all} checks of data and fit are good: {}", subjects.join(", "))]
}

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
