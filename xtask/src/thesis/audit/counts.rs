//! Number of printed values that are reproduced, table by table.

use super::super::cells::Judged;
use super::super::published::{Cell, Method};
use super::super::verdict::Verdict;
use super::evidence::Evidence;
use super::markdown::table;

/// Numbers by verdict.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts {
    verdicts: [usize; 4],
}

impl Counts {
    /// Counts judged numbers, and `unstated` numbers whose settings the text does not state; the
    /// latter count as unexplained.
    fn from_judged<'a>(judged: impl Iterator<Item = &'a Judged>, unstated: usize) -> Self {
        let mut counts = Self::default();
        counts.verdicts[Verdict::Unexplained as usize] = unstated;
        for j in judged.filter(|j| !j.printed.is_empty()) {
            counts.verdicts[j.verdict as usize] += 1;
        }
        counts
    }

    /// Returns how many numbers have this verdict.
    pub fn with(&self, verdict: Verdict) -> usize {
        self.verdicts[verdict as usize]
    }

    /// All numbers.
    pub fn total(&self) -> usize {
        self.verdicts.iter().sum()
    }

    fn plus(mut self, other: Self) -> Self {
        for (sum, more) in self.verdicts.iter_mut().zip(other.verdicts) {
            *sum += more;
        }
        self
    }

    fn cells(&self) -> Vec<String> {
        let shown = |n: usize| if n == 0 { "·".to_owned() } else { n.to_string() };
        self.verdicts.iter().copied().map(shown).collect()
    }
}

/// Returns the counts of estimates, of errors and of mean rows, in one table.
pub fn for_table(evidence: &Evidence, table: &str) -> [Counts; 3] {
    let (rows, means) = (evidence.rows(table), evidence.means(table));
    let unstated = |printed: fn(&Cell) -> &str| {
        let cells = evidence.published.table(table);
        cells.filter(|c| c.method == Method::Unspecified && !printed(c).is_empty()).count()
    };
    [
        Counts::from_judged(rows.iter().map(|r| &r.estimate), unstated(|c| &c.estimate)),
        Counts::from_judged(rows.iter().map(|r| &r.error), unstated(|c| &c.error_percent)),
        Counts::from_judged(means.iter().map(|m| &m.printed), 0),
    ]
}

/// Returns the counts of estimates, of errors and of mean rows, in all tables.
pub fn in_all(evidence: &Evidence) -> [Counts; 3] {
    evidence
        .tables
        .iter()
        .map(|t| for_table(evidence, t))
        .fold([Counts::default(); 3], |sum, more| std::array::from_fn(|i| sum[i].plus(more[i])))
}

/// Returns the section of the audit page on the number of reproduced values.
pub fn section(evidence: &Evidence) -> String {
    let row = |name: &str, counts: [Counts; 3]| {
        let numbers = counts.iter().flat_map(Counts::cells);
        std::iter::once(name.to_owned()).chain(numbers).collect()
    };
    let tables = evidence.tables.iter().map(|t| (t.as_str(), for_table(evidence, t)));
    let identified = tables.filter(|(_, counts)| counts[0].total() > 0);
    let rows: Vec<Vec<String>> = identified
        .map(|(t, counts)| row(t, counts))
        .chain([row("**all**", in_all(evidence))])
        .collect();
    let [estimates, ..] = in_all(evidence);
    format!(
        "## How many printed numbers come out\n\n\
         A number comes out *to the digit* when rounding or cutting ours to the printed decimals \
         gives the printed string. *Rounding* is one unit in the last place, from rounding twice or \
         from computing with other printed numbers. A *misprint* is believed only where the number \
         that should stand there is the one we compute. What is *unexplained* stands in Appendix B, \
         which names neither the integrator nor what was interpolated.\n\n\
         Of {} printed estimates {} are reproduced to the last digit, {} within a rounding, {} are misprints \
         and {} are unexplained. Each group of four columns reads: to the digit, \
         rounding, misprint, unexplained; first for the estimates, then for their errors in \
         per cent, then for the mean-error row.\n\n{}",
        estimates.total(),
        estimates.with(Verdict::ToTheDigit),
        estimates.with(Verdict::Rounding),
        estimates.with(Verdict::Misprint),
        estimates.with(Verdict::Unexplained),
        table(
            &[
                "Table",
                "est. ✓",
                "≈",
                "misprint",
                "?",
                "error ✓",
                "≈",
                "misprint",
                "?",
                "mean ✓",
                "≈",
                "misprint",
                "?",
            ],
            rows
        )
    )
}
