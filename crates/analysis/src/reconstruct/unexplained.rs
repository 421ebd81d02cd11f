//! The part of the measured response that the identified forces do not explain.

use mechid_force::{Rule, Start, Unexplained};
use serde::Serialize;

use super::method::Request;
use super::motion::Recorded;
use crate::text::significant;

/// A measured channel with the part that the reconstructed forces do not explain.
#[derive(Debug, Serialize)]
pub struct Measured {
    /// Number of the channel, counted from 1.
    pub channel: usize,
    /// Name of the column.
    pub column: String,
    /// Ratio of the RMS of the unexplained part to the RMS of the response; `None` if there are as
    /// many forces as measured channels, or if the method gives no residual.
    pub unexplained: Option<f64>,
    /// Expected unexplained ratio due to noise and the uncertainty of the machine; `None` if the
    /// noise is known only from the fit.
    pub expected: Option<f64>,
}

/// Minimum ratio of the unexplained part to its expectation for a remark. One complex line of noise
/// exceeds three times its level with probability e⁻⁹, several lines even more rarely.
const REMARKED_RATIO: f64 = 3.0;

/// Maximum unexplained share without a remark; its effect on the force is negligible against the
/// uncertainty of any machine.
const MAX_SHARE: f64 = 0.01;

/// Maximum unexplained share without a remark if the noise of a sensor is unknown.
const MAX_SHARE_UNKNOWN_NOISE: f64 = 0.1;

impl Measured {
    /// Creates the row of every measured channel.
    pub(crate) fn all(recorded: &Recorded, unexplained: Option<&[Unexplained]>) -> Vec<Self> {
        let columns = recorded.columns().iter().enumerate();
        columns
            .map(|(at, column)| {
                let residual = unexplained.map(|all| &all[at]);
                Self {
                    channel: at + 1,
                    column: column.clone(),
                    unexplained: residual.map(Unexplained::share),
                    expected: residual.and_then(expected),
                }
            })
            .collect()
    }

    /// Returns the channel as a line of text.
    pub fn text(&self) -> Option<String> {
        let share = percent(self.unexplained?);
        let expected = self.expected.map(|share| format!(", expected {}", percent(share)));
        let expected = expected.unwrap_or_default();
        Some(format!("channel {} ({}) unexplained: {share}{expected}", self.channel, self.column))
    }
}

/// Returns the expected unexplained share of the response due to noise and the uncertainty of the
/// machine.
fn expected(unexplained: &Unexplained) -> Option<f64> {
    let level = unexplained.noise?.hypot(unexplained.system.unwrap_or(0.0));
    (unexplained.motion > 0.0).then_some(level / unexplained.motion)
}

fn is_too_much(unexplained: &Unexplained) -> bool {
    let system = unexplained.system.unwrap_or(0.0);
    let known =
        unexplained.residual > REMARKED_RATIO * unexplained.noise.unwrap_or(0.0).hypot(system);
    known
        && unexplained.share()
            > if unexplained.noise.is_some() { MAX_SHARE } else { MAX_SHARE_UNKNOWN_NOISE }
}

fn percent(share: f64) -> String {
    format!("{} %", significant(100.0 * share, 2))
}

/// Returns a remark if the unexplained part of a channel exceeds the part that is expected from the
/// noise and the uncertainty of the machine.
pub fn remark(
    measured: &[Measured],
    unexplained: Option<&[Unexplained]>,
    request: &Request,
    dofs: usize,
) -> Option<String> {
    let channels = measured.iter().zip(unexplained?);
    let excessive: Vec<&Measured> =
        channels.filter(|(_, unexplained)| is_too_much(unexplained)).map(|m| m.0).collect();
    if excessive.is_empty() {
        return None;
    }
    let named = excessive.iter().map(|m| {
        let share = percent(m.unexplained.unwrap_or_default());
        let expected = m.expected.map(|share| format!("; expected {}", percent(share)));
        let expected = expected.unwrap_or_default();
        format!("{share} of channel {} ({}{expected})", m.channel, m.column)
    });
    let unless = if excessive.iter().any(|m| m.expected.is_none()) {
        "if this is not noise (`noise` states its level), "
    } else {
        ""
    };
    Some(format!(
        "the identified force leaves {} unexplained: {unless}{}; the standard error of the force is not reliable",
        listed(&named.collect::<Vec<_>>()),
        causes(request, dofs).join(", or ")
    ))
}

/// Returns the possible causes of an unexplained response.
fn causes(request: &Request, dofs: usize) -> Vec<String> {
    let mut causes = Vec::new();
    if request.forced.len() < dofs {
        let forced: Vec<String> = request.forced.iter().map(|dof| (dof + 1).to_string()).collect();
        let forced = listed(&forced);
        causes.push(format!("a force acts on a degree of freedom other than {forced} (`forced`)"));
    }
    if matches!(request.rule, Rule::Given(_)) {
        causes.push("`parameter` suppresses too much of the force".into());
    }
    if !request.periodic && request.start == Start::FromRest {
        causes.push("the record does not begin at rest".into());
    }
    causes.push(
        "a sensor is dead, two sensors are interchanged, or a column has the wrong unit".into(),
    );
    causes.push("the machine differs from the given model".into());
    causes
}

fn listed(items: &[String]) -> String {
    match items {
        [] => String::new(),
        [one] => one.clone(),
        [some @ .., last] => format!("{} and {last}", some.join(", ")),
    }
}
