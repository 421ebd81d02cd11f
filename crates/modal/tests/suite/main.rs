//! Tests of the crate through its public interface.

mod ambient;
mod ambient_generator;
mod constraints;
mod forced;
mod generator;
mod measured;
mod parts;
mod refusals;
mod responses;
mod scatter;
mod score;
mod sources;
