//! Limits on the memory that work on a record takes, and numbers that decide about the modes of a
//! test.
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
/// Least share of the variance of a response that the modes of a test must explain. Below it, most
/// of the response is something else, and the entries of the shapes there mean little.
pub const LEAST_EXPLAINED: f64 = 0.5;

/// Power of a force over its largest, in the mean of [`DRIVEN_LINES`] lines, below which these lines
/// are not part of the default band. At −40 dB the response to the force drowns in the noise of
/// usual sensors (60 to 80 dB below their range); a lower value would take in lines of noise alone.
pub const DRIVEN_POWER: f64 = 1e-4;

/// Number of lines whose mean power decides whether a force drives them. The power of a random force
/// on one line scatters by its own size, on 16 by a quarter; many more would blur the band's edges.
pub const DRIVEN_LINES: usize = 16;

/// Largest share of a record that may be kept out of the fit for its validation. Beyond it, the fit
/// is to so little that it says nothing of the fit to all.
pub const MOST_VALIDATED: f64 = 0.8;

/// Share of the motion of a mode that unmeasured forces drive, above which a note says so. Below
/// it, the share is in the table alone.
pub const NOTED_UNMEASURED: f64 = 0.01;

/// Largest correlation of the errors of two lines of averaged responses that may both be used:
/// neighbours under a Hann window have 0.44, second neighbours 0.03. A smaller one would give away
/// lines; with a larger one, smooth noise passes for modes.
pub const LINE_CORRELATION: f64 = 0.1;

/// Half-power bandwidth, in lines of a segment, below which what a window blunts of a mode is not
/// subtracted: between lines, the response of a narrower one is larger than its averages tell.
pub const LEAST_SHARPENED_LINES: f64 = 0.5;

/// Largest number of samples of a segment times the number of segments that overlap it, of a table that
/// states segments. Beyond it, the weights of its window take minutes, and the statement is not used.
pub const MOST_SEGMENT_WORK: usize = 1 << 22;

/// Largest number of rounds in which modes are fitted to averaged responses less what their window
/// blunts of these modes. Each takes most of what is left; at two lines a resonance and little noise
/// some ten are needed.
pub const SHARPENING_ROUNDS: usize = 20;

/// Change of a frequency or damping ratio in a round, in standard errors, below which the rounds end.
pub const SHARPENING_SETTLED: f64 = 0.1;

/// Probability below which a check of the modes by a test fails, after adjustment for all of them.
pub const MODAL_SIGNIFICANCE: f64 = 0.01;

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

/// 1 − coherence (median over the lines) below which a table states no noise: the digits of a file, or a coherence that
/// was never computed.
pub const COHERENCE_OF_ONE: f64 = 1e-6;

/// Maximum number of fits with a force that is held or linear between its samples.
pub const ACQUISITION_ROUNDS: usize = 8;

/// Change of a parameter, in standard errors, that ends these fits.
pub const ACQUISITION_SETTLED: f64 = 0.02;
