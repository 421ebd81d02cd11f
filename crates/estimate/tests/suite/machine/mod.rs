//! Machines of named elements, judged by generators of their own: exact receptances line by line.

mod agreement;
mod chain;
mod entries;
mod generator;
mod judge;
mod open;
mod rotor;
mod structures;
