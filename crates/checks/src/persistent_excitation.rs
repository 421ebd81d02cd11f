//! Persistent excitation of each force.

use std::fmt::{self, Formatter};

use mechid_signal::Record;
use mechid_signal::Spectrum;
use mechid_signal::measures::persistent_excitation_order;

use super::finding::{Check, Finding, Names};
use super::limits::EXCITED_LINE;
use super::{Subject, Verdict};

/// Order of persistent excitation of a force, compared with the order that the unknowns need.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct PersistentExcitation {
    /// Channel of the force.
    #[cfg_attr(feature = "serde", serde(serialize_with = "crate::serialised::from_one"))]
    pub force: usize,
    /// Order of persistent excitation; 0 for a channel of zeros.
    pub order: usize,
    /// Order needed.
    pub needed: usize,
}

/// Returns a finding for each force: its highest order of persistent excitation in any of the
/// records, compared with the `needed` order, which is the number of states and inputs or the
/// number of unknowns.
pub(super) fn excitation<'a>(
    records: impl Iterator<Item = &'a Record>,
    needed: usize,
) -> Vec<Finding> {
    let mut orders: Vec<usize> = Vec::new();
    for force in records {
        let spectrum = Spectrum::from_record(force);
        orders.resize(orders.len().max(force.channels()), 0);
        for (channel, order) in orders.iter_mut().enumerate() {
            let excited = persistent_excitation_order(&spectrum, channel, EXCITED_LINE);
            *order = (*order).max(excited.unwrap_or(0));
        }
    }
    let finding = |(force, order)| {
        Finding::PersistentExcitation(PersistentExcitation { force, order, needed })
    };
    orders.into_iter().enumerate().map(finding).collect()
}

impl Check for PersistentExcitation {
    fn subject(&self) -> Subject {
        Subject::Excitation
    }

    fn verdict(&self) -> Verdict {
        match self.order {
            0 => Verdict::Doubtful,
            order if order < self.needed => Verdict::Bad,
            _ => Verdict::Good,
        }
    }

    fn value(&self) -> f64 {
        self.order as f64
    }

    fn sentence(&self, names: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        let (force, order, needed) = (names.force(self.force), self.order, self.needed);
        if order == 0 {
            return write!(
                f,
                "{force} is zero: this force is excluded, and no mass can be identified from it"
            );
        }
        let more = if order < needed { "; excite more lines" } else { "" };
        write!(
            f,
            "{force} is persistently exciting of order {order} (order {needed} is needed){more}"
        )
    }
}
