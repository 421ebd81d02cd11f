//! Limits on the memory that work on a record takes.
//!
//! The work is refused before its memory is taken: where the numbers that it holds, times the bytes
//! that it takes for each, exceed the memory allowed for a file of this size
//! ([`mechid_io::Limits::memory`]). A setting `memory_gb` allows more.

use crate::AnalysisError;
use crate::measurement::Reading;

/// Bytes that an inspection takes for each number of a record: the column, its spectrum and its
/// lags, of several columns at a time.
pub const INSPECT_BYTES: usize = 96;

/// Bytes that work on a stretch of a record takes for each number of it: the identification from
/// spectra, sample by sample, and frequency responses.
pub const STRETCH_BYTES: usize = 256;

/// Bytes that work which needs a window as a whole takes for each number of it: nonlinear terms,
/// the separation of hits, derivatives of a whole period.
pub const WHOLE_BYTES: usize = 640;

/// Bytes that a prediction, or the fit of a free decay, takes for each number of its window.
pub const PREDICT_BYTES: usize = 800;

/// Bytes that the covariances of the noise take for each line and pair of channels: eight copies of a complex number, the
/// most that were measured (periods of 500 forces and 500 responses).
pub const PAIR_BYTES: usize = 128;

/// Number of channels up to which the noise of the spectra takes no more than [`STRETCH_BYTES`] for each sample of each: lines
/// are half of the samples.
pub const FEW_CHANNELS: usize = 2 * STRETCH_BYTES / PAIR_BYTES;

/// Relative error of the standard errors from which a fit says so: that of 12 equations to spare.
pub(crate) const UNCERTAIN_ERROR: f64 = 0.2;

/// Number of bytes in the unit of the setting `memory_gb`.
const GIGABYTE: f64 = 1e9;

/// Refuses work on `numbers` numbers, of `bytes` bytes each, that takes more memory than `allowed` bytes.
pub(crate) fn check_memory(
    file: &str,
    numbers: usize,
    bytes: usize,
    allowed: usize,
) -> Result<(), AnalysisError> {
    let needed = numbers.saturating_mul(bytes);
    if needed <= allowed {
        return Ok(());
    }
    let [needed_gb, allowed_gb] = [needed, allowed].map(|bytes| bytes as f64 / GIGABYTE);
    Err(AnalysisError::Memory { file: file.into(), numbers, needed_gb, allowed_gb })
}

/// Returns the setting `memory_gb` in bytes.
pub(crate) fn memory_bytes(reading: &Reading) -> Option<usize> {
    // A float that no address space has becomes the largest integer, NaN and less than nothing 0.
    reading.memory_gb.map(|gb| (gb * GIGABYTE) as usize)
}

/// Largest number of degrees of freedom of a machine of elements whose modes are a part of its result; of
/// more, `modes` finds them.
pub(crate) const LISTED_MODES_DOF: usize = 30;

/// Share of the information on a parameter from its prior above which the result says so.
pub(crate) const PRIOR_SHARE: f64 = 0.5;

/// Relative difference up to which two frequencies of tables are one: tables are printed with some digits.
pub(crate) const SAME_FREQUENCY: f64 = 1e-6;
