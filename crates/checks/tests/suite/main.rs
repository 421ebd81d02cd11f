//! Checks on data with and without the fault that they look for.

mod before;
mod channels;
mod responses;
mod validation;
