//! Checks on data with and without the fault that they detect.

mod before;
mod channels;
mod responses;
mod validation;
