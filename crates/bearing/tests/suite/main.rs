//! Bearings compared with published tables, closed forms, quadrature and a naive solver.

mod bad_input;
mod limits;
mod naive;
mod published;
mod short_bearing;
mod threshold;
mod whirl;
