//! The estimators, judged by closed forms, exact discretisations and seeded experiments.
//!
//! One program of many modules: each test program of its own would compile nalgebra anew.

mod channel_checks;
mod checks;
mod common;
mod decay;
mod derivatives;
mod equation_error;
mod equation_of_motion;
mod extremes;
mod free_decay;
mod frequency_invariance;
mod frf;
mod machine;
mod modal;
mod monte_carlo;
mod noise;
mod noise_colour;
mod nonlinear_exact;
mod nonlinear_silverbox;
mod nonlinear_study;
mod open_record;
mod pulse_noise;
mod refined;
mod related;
mod response_checks;
mod search_start;
mod silverbox;
mod sinusoids;
mod time_domain;
mod time_domain_invariance;
mod time_domain_study;
mod validation;
