//! Evidence for and against the identified values.

use mechid_checks::{Subject, Verdict};

use super::Review;
use crate::identify::checks::CheckRow;
use crate::identify::summary::least_squares_remark;
use crate::text::significant;

/// Minimum ratio of the residual power to its expectation; below it, the standard errors are too
/// large by more than a factor of √2.
const OVERSTATED: f64 = 0.5;

/// Minimum fit of a good prediction of another record, in per cent.
const POOR_FIT: f64 = 50.0;

/// Returns sentences with the evidence against the identified values, the worst first.
pub fn doubts(contents: &Review<'_>) -> Vec<String> {
    let report = &contents.identified.summary();
    let mut doubts = sentences_with(&report.checks, Verdict::Bad);
    doubts.extend(report.doubts());
    // The checks report a residual that is too large, but not one that is too small.
    if let Some(misfit) =
        contents.identified.fitted().misfit.filter(|misfit| misfit.ratio < OVERSTATED)
    {
        let why = "the assumed noise is larger than the real noise, and the standard errors are too large";
        doubts.push(format!("{misfit}: {why}"));
    }
    doubts.extend(predicted(contents).filter(|(fit, _)| !is_predicted(*fit)).map(|(_, text)| text));
    doubts.extend(sentences_with(&report.checks, Verdict::Doubtful));
    doubts.extend(least_squares_remark(contents.identified.fitted(), &report.checks));
    doubts
}

/// Returns the checks with this verdict, one sentence for each subject.
fn sentences_with(checks: &[CheckRow], verdict: Verdict) -> Vec<String> {
    let mut sentences: Vec<(Subject, String)> = Vec::new();
    for check in checks.iter().filter(|check| check.verdict == verdict) {
        let subject = check.subject;
        if sentences.iter().any(|(reported, _)| *reported == subject) {
            continue;
        }
        let of_subject = || checks.iter().filter(|check| check.subject == subject);
        let count = of_subject().filter(|check| check.verdict == verdict).count();
        let total = of_subject().count();
        sentences.push((
            subject,
            match count {
                1 => format!("{subject}: {}", check.sentence()),
                _ => format!("{subject}: {count} of {total} checks, such as {}", check.sentence()),
            },
        ));
    }
    sentences.into_iter().map(|(_, sentence)| sentence).collect()
}

/// Returns sentences with the evidence that supports the identified values.
pub fn merits(contents: &Review<'_>) -> Vec<String> {
    let report = &contents.identified.summary();
    let good = report.checks.iter().filter(|check| !check.is_conspicuous());
    let mut subjects: Vec<Subject> = Vec::new();
    for check in good.clone() {
        if !subjects.contains(&check.subject) {
            subjects.push(check.subject);
        }
    }
    let mut merits = Vec::new();
    if !subjects.is_empty() {
        merits.push(format!(
            "{} of {} checks of data and fit are good: {}",
            good.clone().count(),
            report.checks.len(),
            subjects.iter().map(Subject::to_string).collect::<Vec<_>>().join(", ")
        ));
    }
    let explained = good.clone().any(|check| check.subject == Subject::Misfit);
    let misfit = contents.identified.fitted().misfit.filter(|misfit| misfit.ratio >= OVERSTATED);
    if let Some(misfit) = misfit.filter(|_| explained) {
        merits.push(format!("{misfit}; 1 is expected"));
    }
    if !was_fitted(contents) {
        merits.extend(
            predicted(contents).filter(|(fit, _)| is_predicted(*fit)).map(|(_, text)| text),
        );
    }
    merits
}

fn is_predicted(fit_percent: f64) -> bool {
    fit_percent >= POOR_FIT
}

/// Returns whether the fit used samples that are also predicted; such a prediction is weak evidence
/// for the values.
pub fn was_fitted(contents: &Review<'_>) -> bool {
    let report = &contents.identified.summary();
    report.validation.iter().any(|predicted| {
        let overlaps = |first: usize, last: usize| {
            first <= predicted.last_sample && predicted.first_sample <= last
        };
        report.records.iter().any(|record| {
            let window = &record.window;
            record.file == predicted.file && overlaps(window.first_sample, window.last_sample)
        })
    })
}

/// Returns how well another record is predicted: the poorest channel, in per cent and in words.
fn predicted(contents: &Review<'_>) -> impl Iterator<Item = (f64, String)> {
    let validation = contents.identified.summary().validation.iter();
    validation.filter_map(|validation| {
        let fits = validation.channels.iter().map(|share| share.fit_percent);
        let least = fits.min_by(f64::total_cmp)?;
        let (first, last) = (validation.first_sample, validation.last_sample);
        Some((
            least,
            format!(
                "{}, samples {first} to {last}: at least {} % of every response is predicted",
                validation.file,
                significant(least, 3)
            ),
        ))
    })
}
