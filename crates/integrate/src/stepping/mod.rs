//! Stepping: one prepared step, and the loop over all samples of a force.

pub(crate) mod collocations;
pub(crate) mod effective_matrix;
pub(crate) mod fixed_size;
pub(crate) mod function_samples;
pub(crate) mod sampled_force;
pub(crate) mod selected_dofs;
pub(crate) mod simulation;
pub(crate) mod stepper;
pub(crate) mod time_loop;
pub(crate) mod transition;
