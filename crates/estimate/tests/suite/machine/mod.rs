//! Machines of named elements, compared with separate generators: exact receptances line by line.

mod agreement;
mod chain;
mod delay;
mod entries;
mod frame;
mod generator;
mod joint;
mod judge;
mod long_chain;
mod open;
mod pulses;
mod rotor;
mod structures;
