//! Force identification, judged by closed forms and seeded experiments.
//!
//! All modules are in one test program, because every further test program would compile nalgebra
//! again.

mod accelerations;
mod common;
mod discretised;
mod dissertation;
mod frequency_domain;
mod intermittent;
mod kalman;
mod linearity;
mod motion_noise;
mod noise_study;
mod regularised;
#[allow(dead_code, reason = "the example uses the rest")]
mod study;
mod uncertainty;
mod unexplained;
mod unstable;
