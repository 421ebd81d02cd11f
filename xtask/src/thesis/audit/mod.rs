//! The audit page: the checks of the dissertation, their results and the lessons.

mod appendices;
pub mod claims;
mod counts;
pub mod evidence;
pub mod markdown;
pub mod misprints;
mod rerun;
mod slips;
mod story;
mod suggestions;

use evidence::Evidence;

use super::published::Published;
use super::results::Results;

/// The audit page, in Markdown, from what is printed and what is computed.
///
/// # Errors
/// The message of the first computation that fails.
pub fn page(published: &Published, results: &Results) -> Result<String, String> {
    let evidence = Evidence::new(published, results);
    let judged = claims::judge_all(&evidence)?;
    let sections = [
        story::section(&evidence, &judged)?,
        counts::section(&evidence),
        slips::section(&evidence)?,
        claims::section(&judged),
        suggestions::section()?,
        misprints::section(&evidence)?,
    ];
    Ok(sections.join("\n"))
}

/// Every claim with both verdicts.
///
/// # Errors
/// The message of the first rerun that fails.
pub fn verdicts(published: &Published, results: &Results) -> Result<Vec<claims::Judged>, String> {
    claims::judge_all(&Evidence::new(published, results))
}
