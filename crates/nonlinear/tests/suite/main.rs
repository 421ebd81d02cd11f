//! Nonlinear terms, compared with exact steady states, seeded experiments and the measured
//! Silverbox.

mod exact;
mod gap;
mod open;
mod periods;
mod silverbox;
mod stepped;
mod study;
