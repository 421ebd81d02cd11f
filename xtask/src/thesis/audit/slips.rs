//! The slips by name, each with the number of printed estimates that needs it.

use super::super::cells;
use super::super::misprints;
use super::super::slips::Slip;
use super::super::verdict::Verdict;
use super::evidence::Evidence;
use super::markdown::table;

/// Returns the number of printed estimates that are reproduced with all slips, but not without this
/// one.
///
/// # Errors
/// The message of the first estimation that fails.
pub fn needed_for(slip: Slip, evidence: &Evidence) -> Result<usize, String> {
    if slip == Slip::LostSigns {
        return Ok(evidence.all().filter(|r| sign_is_lost(r)).count());
    }
    let without = evidence.results.undone(slip)?;
    let lost = |t: &String| {
        let rows = cells::rows(t, evidence.published, &without);
        let pairs = evidence.rows(t).iter().zip(rows);
        pairs.filter(|(with, without)| explained(with) && !explained(without)).count()
    };
    Ok(evidence.tables.iter().map(lost).sum())
}

fn explained(row: &cells::Row) -> bool {
    row.estimate.verdict != Verdict::Unexplained
}

/// Returns whether the misprint of a cell is a lost sign: a misprint that is listed for the whole
/// column.
fn sign_is_lost(row: &cells::Row) -> bool {
    let misprint =
        misprints::find(&row.cell.table, row.cell.method, row.cell.npi, misprints::Field::Estimate);
    row.estimate.verdict == Verdict::Misprint && misprint.is_some_and(|m| m.npi.is_none())
}

/// Returns the section of the audit page on the slips.
///
/// # Errors
/// The message of the first estimation that fails.
pub fn section(evidence: &Evidence) -> Result<String, String> {
    let row = |slip: &Slip| {
        let needed = needed_for(*slip, evidence)?.to_string();
        let name = format!("**{}**", slip.name());
        let words =
            [slip.printed_numbers(), slip.original_computation(), slip.required_computation()]
                .map(str::to_owned);
        Ok([vec![name], words.to_vec(), vec![needed]].concat())
    };
    let rows: Result<Vec<Vec<String>>, String> = Slip::ALL.iter().map(row).collect();
    Ok(format!(
        "## Where the original programs left their own equations\n\n\
         The library computes what the equations ask for. The printed numbers come out only when \
         these named slips are applied to its output. The last column counts the printed estimates \
         that no longer come out when that slip alone is undone.\n\n{}",
        table(&["Slip", "Where", "What was done", "What is right", "Needed for"], rows?)
    ))
}
