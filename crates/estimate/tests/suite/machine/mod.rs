//! Machines of named elements, identified from simulated data. Separate generators compute the
//! exact receptances line by line.

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
