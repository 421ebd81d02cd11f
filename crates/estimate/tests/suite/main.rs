//! The estimators, compared with closed forms, exact discretisations and seeded experiments.
//!
//! All modules are in one test program, because every further test program would compile nalgebra
//! again.

mod common;
mod derivatives;
mod equation_error;
mod equation_of_motion;
mod extremes;
mod force_noise;
mod frequency_invariance;
mod frf;
mod line_correlation;
mod machine;
mod modal;
mod monte_carlo;
mod noise;
mod noise_colour;
mod open_record;
mod pulse_noise;
mod refined;
mod related;
mod search_start;
mod silverbox;
mod sinusoids;
mod time_domain;
mod time_domain_invariance;
mod time_domain_study;
