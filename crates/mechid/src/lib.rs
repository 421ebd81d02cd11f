//! Measure a force and a response, get the machine: the rooms of the workspace under one roof.

pub use mechid_estimate as estimate;
pub use mechid_force as force;
pub use mechid_integrate as integrate;
pub use mechid_io as io;
pub use mechid_model as model;
pub use mechid_plot as plot;
pub use mechid_signal as signal;
