//! What every scheme must do: the suite that defines the word.

mod bad_input;
mod charts;
mod common;
mod definitions;
mod invariances;
mod modes;
mod nonlinear;
mod orbit;
mod order;
mod periodic;
mod random_stability;
mod sparse;
mod stability_at_scale;
