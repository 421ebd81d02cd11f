//! Noise of measured lines: its spectrum, how it is pooled and smoothed, and its level beside a known part.

pub(crate) mod between_lines;
pub mod level;
pub mod pooling;
pub mod pulse;
pub mod smooth;
pub mod spectrum;
