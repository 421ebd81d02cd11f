//! Fast Fourier transforms of real samples, planned once for each length.
//!
//! Every crate that uses a planner compiles all algorithms of the planner again; with these
//! functions they are compiled only in this crate.

use std::sync::Arc;

use realfft::RealFftPlanner;
pub use realfft::{ComplexToReal, RealToComplex};

/// Plans the transform of `len` samples to their `len / 2 + 1` lines, without scaling.
///
/// # Source
/// The crates `realfft` and `rustfft`.
#[inline(never)]
pub fn forward(len: usize) -> Arc<dyn RealToComplex<f64>> {
    RealFftPlanner::new().plan_fft_forward(len)
}

/// Plans the transform of `len / 2 + 1` lines to `len` samples, without scaling: [`forward`]
/// followed by this transform multiplies the samples by `len`.
///
/// # Source
/// The crates `realfft` and `rustfft`.
#[inline(never)]
pub fn inverse(len: usize) -> Arc<dyn ComplexToReal<f64>> {
    RealFftPlanner::new().plan_fft_inverse(len)
}
