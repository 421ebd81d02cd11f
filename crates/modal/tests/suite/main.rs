//! Tests of the modal estimator on records with known modes.

mod forced;
mod generator;
mod score;
