//! The dissertation, reproduced and audited.

pub mod audit;
pub mod case;
pub mod cells;
pub mod estimates;
pub mod misprints;
pub mod published;
pub mod results;
pub mod simulate;
pub mod slips;
pub mod verdict;
