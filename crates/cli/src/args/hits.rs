//! Arguments of hammer tests.

use clap::Args;
use mechid::analysis::{Channels, HitRule};

use super::at_least_one;
use crate::error::CliError;

/// Rule for the detection of hammer hits.
#[derive(Debug, Args)]
#[command(next_help_heading = "Hammer tests")]
pub struct HitRuleArgs {
    /// The records are hammer tests: the hits are found in the force, and bad ones (double hits,
    /// overloads, weak hits, hits with too few samples around them) are excluded.
    /// --hits=trigger=0.5,double=5,… changes the rule. Each setting is given here with its default:
    /// trigger (force that begins a hit, in per cent of the largest of the record; 0.5), double
    /// (smallest second peak of a double hit, in per cent of the first; 5), weak (smallest peak of
    /// a good hit, in per cent of the median of all peaks that reach a tenth of the largest; 25),
    /// bounce (time after the trigger within which a force belongs to the same hit, in s; 0.1),
    /// before (number of samples before the pulse; twice the length of the pulse), samples (number
    /// of samples of a hit, including those before the pulse; all up to the next hit)
    #[arg(long, value_name = "RULE", num_args = 0..=1, require_equals = true, default_missing_value = "")]
    hits: Option<HitRule>,
}

/// Hits of a hammer, and the degrees of freedom that it strikes.
#[derive(Debug, Args)]
#[command(next_help_heading = "Hammer tests")]
pub struct HitArgs {
    #[command(flatten)]
    rule: HitRuleArgs,
    /// Degree of freedom that is struck in each record, counted from 1, if all records have the
    /// same --force column
    #[arg(long, value_name = "DOF,…", value_delimiter = ',', value_parser = at_least_one)]
    struck: Vec<usize>,
}

impl HitArgs {
    /// Returns the columns of each record, with the force at the struck degree of freedom.
    pub fn channels_of(
        &self,
        channels: &Channels,
        records: usize,
    ) -> Result<Vec<Channels>, CliError> {
        if self.struck.is_empty() {
            return Ok(vec![channels.clone(); records]);
        }
        Ok(channels.struck(&self.struck, records)?)
    }

    /// Returns the rule for the detection of hits, if the records are hammer tests.
    pub fn rule(&self) -> Option<HitRule> {
        self.rule.rule()
    }
}

impl HitRuleArgs {
    /// Returns the rule for the detection of hits, if the records are hammer tests.
    pub fn rule(&self) -> Option<HitRule> {
        self.hits.clone()
    }
}
