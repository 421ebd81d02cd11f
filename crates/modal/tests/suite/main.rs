//! Tests of the modal estimator on records with known modes.

mod forced;
mod generator;
mod score;
//! Tests of the crate through its public interface.
mod ambient;
mod ambient_generator;
