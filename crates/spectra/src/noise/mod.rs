//! Noise of measured lines: its spectrum, pooling and smoothing over lines, and its level in
//! addition to a known part.

pub(crate) mod between_lines;
pub mod level;
pub mod pooling;
pub mod pulse;
pub mod smooth;
pub mod spectrum;
