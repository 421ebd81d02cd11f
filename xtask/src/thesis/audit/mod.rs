//! The audit page: what was checked in the dissertation, what came out, what one learns.

mod appendices;
pub mod claims;
mod counts;
mod evidence;
pub mod markdown;
pub mod misprints;
mod rerun;
mod slips;

use evidence::Evidence;

use super::published::Published;
use super::results::Results;

/// The audit page, in Markdown, from what is printed and what is computed.
///
/// # Errors
/// The words of the first computation that fails.
pub fn page(published: &Published, results: &Results) -> Result<String, String> {
    let evidence = Evidence::new(published, results);
    let sections = [
        "# Audit of the dissertation\n".to_owned(),
        counts::section(&evidence),
        slips::section(&evidence)?,
        misprints::section(&evidence)?,
        claims::section(&claims::judge_all(&evidence)?),
    ];
    Ok(sections.join("\n"))
}
