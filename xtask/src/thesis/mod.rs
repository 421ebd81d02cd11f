//! The dissertation, reproduced and audited.

pub mod audit;
pub mod case;
pub mod cells;
pub mod committed;
pub mod estimates;
pub mod golden;
pub mod interpolated;
pub mod misprints;
pub mod modal_tables;
pub mod published;
pub mod reproduce;
pub mod results;
pub mod sheet;
pub mod simulate;
pub mod slips;
pub mod tables;
pub mod verdict;
