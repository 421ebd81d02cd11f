//! Excitation, sampling and measures, judged by closed forms.
//!
//! One program of many modules: each test program of its own would compile nalgebra anew.

mod crest;
mod excitation;
mod measures;
mod multisine;
mod resample;
