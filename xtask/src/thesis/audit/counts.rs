//! How many printed numbers come out, table by table.

use super::super::cells::Judged;
use super::super::published::{Cell, Method};
use super::super::verdict::Verdict;
use super::evidence::Evidence;
use super::markdown::table;

/// Numbers by verdict, and those whose settings the text does not state.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts {
    verdicts: [usize; 4],
    open: usize,
}

impl Counts {
    fn of<'a>(judged: impl Iterator<Item = &'a Judged>, open: usize) -> Self {
        let mut counts = Self { open, ..Self::default() };
        for j in judged.filter(|j| !j.printed.is_empty()) {
            counts.verdicts[j.verdict as usize] += 1;
        }
        counts
    }

    /// Numbers of one verdict.
    pub fn with(&self, verdict: Verdict) -> usize {
        self.verdicts[verdict as usize]
    }

    /// All numbers.
    pub fn total(&self) -> usize {
        self.verdicts.iter().sum::<usize>() + self.open
    }

    fn plus(mut self, other: Self) -> Self {
        for (sum, more) in self.verdicts.iter_mut().zip(other.verdicts) {
            *sum += more;
        }
        self.open += other.open;
        self
    }

    fn cells(&self) -> Vec<String> {
        let shown = |n: usize| if n == 0 { "·".to_owned() } else { n.to_string() };
        self.verdicts.iter().copied().chain([self.open]).map(shown).collect()
    }
}

/// Estimates, errors and mean rows of one table.
pub fn of_table(evidence: &Evidence, table: &str) -> [Counts; 3] {
    let (rows, means) = (evidence.rows(table), evidence.means(table));
    let open = |printed: fn(&Cell) -> &str| {
        let cells = evidence.published.table(table);
        cells.filter(|c| c.method == Method::Unspecified && !printed(c).is_empty()).count()
    };
    [
        Counts::of(rows.iter().map(|r| &r.estimate), open(|c| &c.estimate)),
        Counts::of(rows.iter().map(|r| &r.error), open(|c| &c.error_percent)),
        Counts::of(means.iter().map(|m| &m.printed), 0),
    ]
}

/// Estimates, errors and mean rows of all tables.
pub fn in_all(evidence: &Evidence) -> [Counts; 3] {
    evidence
        .tables
        .iter()
        .map(|t| of_table(evidence, t))
        .fold([Counts::default(); 3], |sum, more| std::array::from_fn(|i| sum[i].plus(more[i])))
}

/// The section of the page.
pub fn section(evidence: &Evidence) -> String {
    let row = |name: &str, counts: [Counts; 3]| {
        let numbers = counts.iter().flat_map(Counts::cells);
        std::iter::once(name.to_owned()).chain(numbers).collect()
    };
    let tables = evidence.tables.iter().map(|t| (t.as_str(), of_table(evidence, t)));
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
         that should stand there is the one we compute. *Open* are numbers whose settings the \
         dissertation does not state (Appendix B names no integrator).\n\n\
         Of {} printed estimates {} come out to the digit, {} within a rounding, {} are misprints, \
         {} are unexplained and {} are open. Each group of five columns reads: to the digit, \
         rounding, misprint, unexplained, open; first for the estimates, then for their errors in \
         per cent, then for the mean-error row.\n\n{}",
        estimates.total(),
        estimates.with(Verdict::ToTheDigit),
        estimates.with(Verdict::Rounding),
        estimates.with(Verdict::Misprint),
        estimates.with(Verdict::Unexplained),
        estimates.open,
        table(
            &[
                "Table",
                "est. ✓",
                "≈",
                "misprint",
                "?",
                "open",
                "error ✓",
                "≈",
                "misprint",
                "?",
                "open",
                "mean ✓",
                "≈",
                "misprint",
                "?",
                "open",
            ],
            rows
        )
    )
}
