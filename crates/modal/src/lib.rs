//! Modes of a structure from any set of sensors and any number of forces.
