//! Limits that decide something in this crate, each with what happens on either side.

/// Maximum number of Gauss–Newton steps of a search; more of them mean that the start was not near a minimum.
pub(crate) const SEARCH_STEPS: usize = 60;
