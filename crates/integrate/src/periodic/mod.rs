//! Responses that repeat with the force.

pub(crate) mod linear;
pub(crate) mod orbit;
pub(crate) mod period_map;
pub(crate) mod shooting;
pub(crate) mod sparse_steady_state;
