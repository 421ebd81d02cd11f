//! The dissertation's claims, each compared with the printed tables and with the corrected
//! computation.

mod forces_bearing;
mod forces_sdof;
mod frequency_bearing;
mod frequency_sdof;
mod general;
mod time_bearing;
mod time_bearing_reruns;
mod time_sdof;

use rayon::prelude::*;

use super::super::published::Method;
use super::evidence::{Evidence, View};
use super::markdown::table;

/// Verdict on a claim.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Holds {
    /// All tests of the claim pass.
    Yes,
    /// More than half of the tests pass.
    Mostly,
    /// At most half of the tests pass, but at least one.
    Hardly,
    /// No test passes.
    No,
}

impl Holds {
    /// Returns the word for the verdict on the audit page.
    pub fn word(self) -> &'static str {
        match self {
            Holds::Yes => "holds",
            Holds::Mostly => "mostly",
            Holds::Hardly => "hardly",
            Holds::No => "fails",
        }
    }
}

/// Numbers of passed tests and of all tests of a claim.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Tally {
    held: usize,
    of: usize,
}

impl Tally {
    fn and(self, other: Self) -> Self {
        Self { held: self.held + other.held, of: self.of + other.of }
    }

    fn holds(self) -> Holds {
        match self.held {
            0 => Holds::No,
            n if n == self.of => Holds::Yes,
            n if 2 * n > self.of => Holds::Mostly,
            _ => Holds::Hardly,
        }
    }
}

impl FromIterator<bool> for Tally {
    fn from_iter<I: IntoIterator<Item = bool>>(tests: I) -> Self {
        let one = |held: bool| Self { held: usize::from(held), of: 1 };
        tests.into_iter().map(one).fold(Self::default(), Self::and)
    }
}

/// Results of the tests of a claim.
#[derive(Debug, Clone)]
pub struct Finding {
    /// Numbers of passed tests and of all tests.
    pub tally: Tally,
    /// Numbers behind the verdict, in words.
    pub numbers: String,
}

impl Finding {
    fn new(tests: impl IntoIterator<Item = bool>, numbers: impl Into<String>) -> Self {
        Self { tally: tests.into_iter().collect(), numbers: numbers.into() }
    }

    /// Returns whether the claim holds.
    pub fn holds(&self) -> Holds {
        self.tally.holds()
    }

    fn words(&self) -> String {
        let Tally { held, of } = self.tally;
        format!("**{}** ({held} of {of}). {}", self.holds().word(), self.numbers)
    }
}

type Judge = fn(&View) -> Result<Finding, String>;

/// Support that the dissertation offers for a claim.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Support {
    /// Tables: the printed numbers are judged.
    Tables,
    /// Figures without numbers: the computation with every slip replayed is judged.
    Figures,
    /// No printed evidence: the computation with every slip replayed is judged.
    Nothing,
}

/// A claim of the dissertation.
#[derive(Clone, Copy)]
pub struct Claim {
    /// Running number.
    pub number: u8,
    /// Section that makes the claim.
    pub section: &'static str,
    /// Statement of the claim.
    pub statement: &'static str,
    /// Question that each counted test of the claim answers.
    pub test: &'static str,
    /// Kind of evidence that the dissertation gives for the claim.
    pub support: Support,
    judge: Judge,
}

/// A claim with both verdicts.
pub struct Judged {
    /// The claim.
    pub claim: Claim,
    /// Verdict from the printed numbers, including the slips.
    pub printed: Finding,
    /// Verdict from the computation without slips.
    pub corrected: Finding,
}

/// The groups of claims, in the order of the text.
const GROUPS: [(&str, &[Claim]); 8] = [
    ("One degree of freedom, time domain (5.2)", time_sdof::CLAIMS),
    ("One degree of freedom, frequency domain (5.3)", frequency_sdof::CLAIMS),
    ("Forces, one degree of freedom (5.4, 5.5)", forces_sdof::CLAIMS),
    ("Bearing, time domain (5.6)", time_bearing::CLAIMS),
    ("Bearing, time domain, continued (5.6)", time_bearing_reruns::CLAIMS),
    ("Bearing, frequency domain (5.7, Appendix A)", frequency_bearing::CLAIMS),
    ("Forces, bearing (5.8, 5.9 and the papers)", forces_bearing::CLAIMS),
    ("Appendices B and E, general conclusions (6.1)", general::CLAIMS),
];

/// Returns every claim with both verdicts.
///
/// # Errors
/// The message of the first rerun that fails.
pub fn judge_all(evidence: &Evidence) -> Result<Vec<Judged>, String> {
    let claims: Vec<Claim> = GROUPS.iter().flat_map(|(_, claims)| claims.iter().copied()).collect();
    claims
        .into_par_iter()
        .map(|claim| {
            let judge = |view: View| {
                (claim.judge)(&view).map_err(|e| format!("claim {}: {e}", claim.number))
            };
            let (printed, corrected) = (judge(evidence.printed())?, judge(evidence.corrected())?);
            Ok(Judged { claim, printed, corrected })
        })
        .collect()
}

/// Returns the section of the audit page on the claims.
pub fn section(judged: &[Judged]) -> String {
    let count = |of: fn(&Judged) -> &Finding, holds| {
        judged.iter().filter(|j| of(j).holds() == holds).count()
    };
    let line = |name: &str, of: fn(&Judged) -> &Finding| {
        let counts =
            [Holds::Yes, Holds::Mostly, Holds::Hardly, Holds::No].map(|h| count(of, h).to_string());
        std::iter::once(name.to_owned()).chain(counts).collect()
    };
    let mut text = format!(
        "## The claims, one by one\n\n\
         Each claim is broken into tests that a computer can answer; the counts in brackets say how \
         many of them pass. It *holds* if all do, holds *mostly* if more than half do, *hardly* if at \
         most half do, and *fails* if none does. \"As printed\" is judged on \
         the printed numbers; where there are only figures, or nothing, on the computation with \
         every slip replayed. \"Corrected\" is the same estimator and scheme on the same data \
         without slips. Errors are in per cent of the true value; a mean is over the NPI of a \
         table.\n\n{}\nWhat the correction makes of them:\n\n{}",
        table(
            &["", "holds", "mostly", "hardly", "fails"],
            [line("as printed", |j| &j.printed), line("corrected", |j| &j.corrected)]
        ),
        table(&["as printed", "corrected", "claims"], changes(judged))
    );
    let mut remaining = judged.iter();
    for (title, claims) in GROUPS {
        let rows = remaining.by_ref().take(claims.len()).map(row);
        text += &format!(
            "\n### {title}\n\n{}",
            table(&["No.", "Claim and test", "As printed", "Corrected"], rows)
        );
    }
    text
}

/// Lists the claims that change from one verdict to another.
fn changes(judged: &[Judged]) -> Vec<Vec<String>> {
    let verdicts = [Holds::Yes, Holds::Mostly, Holds::Hardly, Holds::No];
    let pairs = verdicts.iter().flat_map(|from| verdicts.iter().map(move |to| (*from, *to)));
    pairs
        .filter_map(|(from, to)| {
            let numbers: Vec<String> = judged
                .iter()
                .filter(|j| j.printed.holds() == from && j.corrected.holds() == to)
                .map(|j| format!("[{0}](#claim-{0})", j.claim.number))
                .collect();
            let words = [from.word(), to.word()].map(str::to_owned).to_vec();
            (!numbers.is_empty()).then(|| [words, vec![numbers.join(", ")]].concat())
        })
        .collect()
}

fn row(judged: &Judged) -> Vec<String> {
    let claim = judged.claim;
    let support = match claim.support {
        Support::Tables => "",
        Support::Figures => "(figures only; replayed) ",
        Support::Nothing => "(no numbers; replayed) ",
    };
    vec![
        format!("<a id=\"claim-{0}\"></a>{0}", claim.number),
        format!("{} *({})*<br>Test: {}.", claim.statement, claim.section, claim.test),
        format!("{support}{}", judged.printed.words()),
        judged.corrected.words(),
    ]
}

/// Tests that each mean of the list is below the next.
fn in_order(view: &View, table: &str, methods: &[Method]) -> Vec<bool> {
    methods.windows(2).map(|pair| view.mean(table, pair[0]) < view.mean(table, pair[1])).collect()
}

/// Tests that the mean of one method is below the means of the others.
fn below(view: &View, table: &str, method: Method, others: &[Method]) -> Vec<bool> {
    others.iter().map(|other| view.mean(table, method) < view.mean(table, *other)).collect()
}

/// NPI at which the error of a column is smallest.
fn best_npi(series: &[(f64, f64)]) -> f64 {
    let smaller = |a: &(f64, f64), b: &(f64, f64)| a.1.total_cmp(&b.1);
    series.iter().copied().min_by(smaller).map_or(f64::NAN, |(npi, _)| npi)
}

/// The direct methods.
const DIRECT: [Method; 4] =
    [Method::Newmark, Method::CentralDifference, Method::Houbolt, Method::WilsonTheta];
