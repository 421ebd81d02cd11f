//! Nonlinear terms, judged by exact steady states, seeded experiments and the Silverbox.

mod exact;
mod gap;
mod open;
mod periods;
mod silverbox;
mod stepped;
mod study;
