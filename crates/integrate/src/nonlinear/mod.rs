//! Nonlinear forces, and the equation of a step with nonlinear forces.

pub(crate) mod force;
pub(crate) mod local_newton;
pub(crate) mod system_with_forces;
pub(crate) mod term_forces;
