//! Arguments of hammer tests.

use clap::Args;
use mechid::analysis::{Channels, HitRule};

use super::at_least_one;
use crate::error::CliError;

/// Rule by which hits of a hammer are found.
#[derive(Debug, Args)]
#[command(next_help_heading = "Hammer tests")]
pub struct HitRuleArgs {
    /// The records are hammer tests: the hits are found in the force, and bad ones (double hits, overloads,
    /// weak hits, too little room) are left out
    #[arg(long)]
    hits: bool,
    /// Force that begins a hit, in per cent of the largest force of the record [default: 0.5]
    #[arg(long, value_name = "PERCENT", requires = "hits", allow_negative_numbers = true)]
    trigger_percent: Option<f64>,
    /// Least second peak of a double hit, in per cent of the first [default: 5]
    #[arg(long, value_name = "PERCENT", requires = "hits", allow_negative_numbers = true)]
    double_percent: Option<f64>,
    /// Least peak of a hit, in per cent of the median of all peaks that are a tenth of the largest or more
    /// [default: 25]
    #[arg(long, value_name = "PERCENT", requires = "hits", allow_negative_numbers = true)]
    weak_percent: Option<f64>,
    /// Time after the trigger within which a force belongs to the same hit, in s [default: 0.1]
    #[arg(long, value_name = "SECONDS", requires = "hits", allow_negative_numbers = true)]
    bounce_s: Option<f64>,
    /// Samples of a hit before its pulse [default: twice those of the pulse]
    #[arg(long, value_name = "SAMPLES", requires = "hits")]
    before_hit: Option<usize>,
    /// Samples of a hit, those before it included [default: up to the next hit]
    #[arg(long, value_name = "SAMPLES", value_parser = at_least_one, requires = "hits")]
    hit_samples: Option<usize>,
}

/// Hits of a hammer, and where it strikes.
#[derive(Debug, Args)]
#[command(next_help_heading = "Hammer tests")]
pub struct HitArgs {
    #[command(flatten)]
    rule: HitRuleArgs,
    /// Degree of freedom that is struck in each record, counted from 1, where one --force column serves
    /// them all
    #[arg(long, value_name = "DOF,…", value_delimiter = ',', value_parser = at_least_one)]
    struck: Vec<usize>,
}

impl HitArgs {
    /// Returns the columns of each of some records, with the force where it is struck.
    pub fn channels_of(
        &self,
        channels: &Channels,
        records: usize,
    ) -> Result<Vec<Channels>, CliError> {
        let of_records = match self.struck.is_empty() {
            true => vec![channels.clone(); records],
            false => channels.struck(&self.struck, records)?,
        };
        of_records.iter().try_for_each(Channels::check_pairs)?;
        Ok(of_records)
    }

    /// Returns whether the hammer struck another point in each record.
    pub fn is_struck(&self) -> bool {
        !self.struck.is_empty()
    }

    /// Returns the rule by which hits are found, if the records are hammer tests.
    pub fn rule(&self) -> Option<HitRule> {
        self.rule.rule()
    }
}

impl HitRuleArgs {
    /// Returns the rule by which hits are found, if the records are hammer tests.
    pub fn rule(&self) -> Option<HitRule> {
        let usual = HitRule::default();
        self.hits.then(|| HitRule {
            trigger_percent: self.trigger_percent.unwrap_or(usual.trigger_percent),
            double_percent: self.double_percent.unwrap_or(usual.double_percent),
            weak_percent: self.weak_percent.unwrap_or(usual.weak_percent),
            bounce_s: self.bounce_s.unwrap_or(usual.bounce_s),
            before: self.before_hit,
            samples: self.hit_samples,
        })
    }
}
