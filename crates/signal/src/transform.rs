//! Fast Fourier transforms of real samples, planned once for many of one length.
//!
//! Every crate that names a planner compiles all of its algorithms anew; through these functions they are
//! compiled with this crate only.

use std::sync::Arc;

use realfft::RealFftPlanner;
pub use realfft::{ComplexToReal, RealToComplex};

/// Plan from `len` samples to their `len / 2 + 1` lines, not scaled.
///
/// # Source
/// The crates `realfft` and `rustfft`.
#[inline(never)]
pub fn forward(len: usize) -> Arc<dyn RealToComplex<f64>> {
    RealFftPlanner::new().plan_fft_forward(len)
}

/// Plan from `len / 2 + 1` lines to `len` samples, not scaled: [`forward`] and back multiplies by `len`.
///
/// # Source
/// The crates `realfft` and `rustfft`.
#[inline(never)]
pub fn inverse(len: usize) -> Arc<dyn ComplexToReal<f64>> {
    RealFftPlanner::new().plan_fft_inverse(len)
}
