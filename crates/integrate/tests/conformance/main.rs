//! Requirements on every scheme.

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
