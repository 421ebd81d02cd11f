//! Excitation, sampling and measures, judged by closed forms.
//!
//! All modules form one test program, because every further test program would have to compile
//! nalgebra again.

mod crest;
mod excitation;
mod measures;
mod multisine;
mod resample;
