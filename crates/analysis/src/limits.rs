//! Limits on the memory and the work of an analysis, and limits that decide about the modes of a
//! test.
//!
//! An analysis is refused before it allocates memory if its numbers, times the bytes for each, need
//! more than the memory allowed for a file of this size ([`mechid_io::Limits::memory`]). The
//! setting `memory_gb` allows more.

use crate::AnalysisError;
use crate::measurement::Reading;

/// Bytes of memory per number of a record for an inspection: the column, its spectrum and, for the
/// search of a period, its mismatch at every lag; for several columns at a time.
pub const INSPECT_BYTES: usize = 96;

/// Bytes of memory per number of a section of a record: for the identification from spectra or
/// sample by sample, and for frequency responses.
pub const STRETCH_BYTES: usize = 256;

/// Bytes of memory per number of a window that is analysed as a whole, for example for nonlinear
/// terms, for the separation of hits, or for derivatives of a whole period.
pub const WHOLE_BYTES: usize = 640;

/// Minimum number of bytes of memory per number of a record whose transient is fitted: one force
/// and one response took 920 bytes.
pub const OPEN_BYTES: usize = 1100;

/// Bytes of memory per number and degree of freedom of a record whose transient is fitted. The
/// sensitivities of a line grow with the number of unknowns: 3, 4 and 10 degrees of freedom took
/// 620, 630 and 650 bytes.
pub const OPEN_DOF_BYTES: usize = 650;

/// Number of degrees of freedom above which the memory per number of a record no longer grows,
/// because the largest sensitivities are not computed.
pub const OPEN_DOF: usize = 10;

/// Bytes of memory per number of the window for a prediction, or the fit of a free decay.
pub const PREDICT_BYTES: usize = 800;

/// Bytes of memory per line and pair of channels for the covariances of the noise: eight copies of
/// a complex number. This is the largest use that was measured (periods of 500 forces and 500
/// responses).
pub const PAIR_BYTES: usize = 128;

/// Bytes of memory per number (line, force and response) of a table of frequency responses whose
/// machine is identified: 1 to 3 degrees of freedom took 2,400 to 6,000 bytes per number, with the
/// sensitivities.
pub const TABLE_BYTES: usize = 3000;

/// Additional bytes of memory for each number of a table of frequency responses, per degree of
/// freedom: the receptance of a line and the covariance of its noise. 20 and 40 degrees of freedom
/// took 400 bytes.
pub const TABLE_DOF_BYTES: usize = 400;

/// Bytes of memory for each number (line, force and response) of a table of frequency responses,
/// per unknown: three copies of the sensitivities of the real and the imaginary part.
pub const TABLE_SENSITIVITY_BYTES: usize = 48;

/// Largest memory of the sensitivities of a table of frequency responses, in bytes; larger
/// sensitivities are not computed.
pub const TABLE_SENSITIVITIES: usize = 3 << 27;

/// Bytes of memory per pair of unknowns of a fit: the normal equations, their factor and the
/// covariance of the unknowns. The search, which needs no covariance, took 16 bytes per pair with
/// 4800 unknowns.
pub const UNKNOWN_PAIR_BYTES: usize = 32;

/// Bytes of memory per number of a table whose modes are identified: 1, 64 and 400 responses took
/// 3,200, 2,300 and 1,300 bytes.
pub const MODAL_TABLE_BYTES: usize = 3200;

/// Bytes of memory per pair of unknowns of a fit of modes: 40 and 51 modes of 40 and 60 points took
/// 24 and 36 bytes.
pub const MODAL_PAIR_BYTES: usize = 40;

/// Number of operations of the searches of an analysis for each byte of memory that its files may
/// use, without a time limit. With a wrong model, records of 0.7 to 1 MB then end after 10 to 30 s
/// on two processors.
pub const OPERATIONS_PER_BYTE: f64 = 30.0;

/// Additional operations for the search for the cause of a bad fit, relative to the limit of the
/// operations of the analysis.
pub const CAUSE_OPERATIONS: f64 = 0.5;

/// Maximum number of initial estimates of modes. The check of the memory first assumes this number
/// of modes. It determines the actual number only if the assumed number needs too much memory.
pub(crate) const MANY_MODES: usize = 72;

/// Minimum number of equations per unknown in the tables with fewer lines to which other models are
/// fitted first. A model that does not explain these lines far better than the fitted model is not
/// fitted to all lines.
pub(crate) const TRIED_EQUATIONS: usize = 40;

/// Minimum number of lines of each table on which other models are tried first; fewer lines would
/// miss resonances.
pub(crate) const TRIED_LINES: usize = 100;

/// Number of lines of a table that decide whether it has more resonances than responses. More lines
/// would show weaker resonances, but the search takes a time that grows with the number of lines.
pub(crate) const SURPLUS_LINES: usize = 2000;

/// Largest ratio of the number of all lines of a table to the number of lines that are used to try
/// other models.
pub(crate) const THINNED_STEP: usize = 10;

/// Maximum number of channels for which the noise covariances need at most [`STRETCH_BYTES`] per
/// sample and channel. A spectrum has half as many lines as the record has samples.
pub const FEW_CHANNELS: usize = 2 * STRETCH_BYTES / PAIR_BYTES;

/// Decay of the slowest mode, as a natural logarithm, during the zeros that are appended to the
/// forces of a prediction: the part of the response that wraps around to the beginning is below
/// 0.1 % of the response at the end of the record.
pub const REST_DECAY: f64 = 7.0;

/// Maximum number of zeros that are appended to the forces of a prediction by modes, as a multiple
/// of the number of samples of the record. This limits the memory.
pub const REST_RECORDS: usize = 8;

/// Relative uncertainty of the standard errors above which a remark reports it; 12 degrees of
/// freedom give about 20 %.
pub(crate) const UNCERTAIN_ERROR: f64 = 0.2;
/// Minimum share of the variance of a response that the modes of a test must explain and, in a
/// validation, predict. With a smaller share, most of the response has another cause, and the
/// entries of the shapes at this response are unreliable.
pub const LEAST_EXPLAINED: f64 = 0.5;

/// Minimum share of the samples in the smaller of two parts of a test, if the test is divided into
/// two parts between two records. With a smaller share, this part determines the modes so badly
/// that the comparison of the two parts has little power; the longest record is then divided at its
/// middle instead.
pub const SMALLER_HALF: f64 = 0.25;

/// Minimum number of modes within one half-width ζf that indicates a spectral peak of the
/// unmeasured forces of an ambient record. Two such modes may be a close pair of the structure, for
/// example of a symmetric tower. A spectral peak gives one mode for each independent force.
pub const CROWDED_MODES: usize = 3;

/// Minimum ratio of the power of a force, averaged over [`DRIVEN_LINES`] lines, to its largest
/// power, for lines of the default band. At −40 dB the response to the force is below the noise of
/// usual sensors (60 to 80 dB below their range); a lower limit would include lines of noise alone.
pub const DRIVEN_POWER: f64 = 1e-4;

/// Number of lines in the mean power that decides whether a force excites them. The power of a
/// random force on one line has a standard deviation of 100 %, the mean of 16 lines 25 %; many more
/// lines would blur the edges of the band.
pub const DRIVEN_LINES: usize = 16;

/// Maximum share of a record that the fit may exclude for its validation. With a larger share, the
/// fit to the small remainder is not representative of the fit to all data.
pub const MOST_VALIDATED: f64 = 0.8;

/// Minimum share of unmeasured forces in the motion of a mode for a note about this mode. Smaller
/// shares are listed only in the table.
pub const NOTED_UNMEASURED: f64 = 0.01;

/// Maximum correlation of the errors of two lines of averaged responses in the same fit: neighbours
/// under a Hann window have 0.44, second neighbours 0.03. A smaller limit would discard lines; with
/// a larger limit, smooth noise would appear as modes.
pub const LINE_CORRELATION: f64 = 0.1;

/// Minimum half-power bandwidth of a mode, in lines of a segment, for a correction of its window
/// bias: the response of a narrower mode between the averaged lines is not determined.
pub const LEAST_SHARPENED_LINES: f64 = 0.5;

/// Maximum product of the samples of a segment and the number of segments that overlap it, for a
/// table that states segments. For a larger product the weights of the window would take minutes,
/// and the stated segments are ignored.
pub const MOST_SEGMENT_WORK: usize = 1 << 22;

/// Maximum number of corrections of the window bias of modes from averaged responses. Each removes
/// most of the remaining bias; two lines per resonance and little noise need about ten.
pub const SHARPENING_ROUNDS: usize = 20;

/// Change of a frequency or damping ratio, in standard errors, that ends the corrections of the
/// window bias.
pub const SHARPENING_SETTLED: f64 = 0.1;

/// Maximum number of delays that a note lists one by one.
pub(crate) const LISTED_DELAYS: usize = 6;

/// Maximum p-value, adjusted for the number of tests, of a failed check of the modes.
pub const MODAL_SIGNIFICANCE: f64 = 0.01;

/// Number of bytes in the unit of the setting `memory_gb`.
const GIGABYTE: f64 = 1e9;

/// Refuses an analysis of `numbers` numbers, of `bytes` bytes each, if it needs more than `allowed`
/// bytes.
pub(crate) fn check_memory(
    file: &str,
    numbers: usize,
    bytes: usize,
    allowed: usize,
) -> Result<(), AnalysisError> {
    check_bytes(file, numbers, numbers.saturating_mul(bytes), allowed)
}

/// Refuses an analysis of `numbers` numbers if it needs more than `allowed` bytes.
pub(crate) fn check_bytes(
    file: &str,
    numbers: usize,
    needed: usize,
    allowed: usize,
) -> Result<(), AnalysisError> {
    if needed <= allowed {
        return Ok(());
    }
    let [needed_gb, allowed_gb] = [needed, allowed].map(|bytes| bytes as f64 / GIGABYTE);
    Err(AnalysisError::Memory { file: file.into(), numbers, needed_gb, allowed_gb })
}

/// Returns the setting `memory_gb` in bytes.
pub(crate) fn memory_bytes(reading: &Reading) -> Option<usize> {
    // The conversion saturates: a huge number becomes the largest integer; NaN and negative numbers
    // become 0.
    reading.memory_gb.map(|gb| (gb * GIGABYTE) as usize)
}

/// Maximum number of degrees of freedom of a machine of elements whose modes the result lists. The
/// modes of a larger machine are computed with `modes`.
pub(crate) const LISTED_MODES_DOF: usize = 30;

/// Share of the prior in the information about a parameter above which a remark reports it.
pub(crate) const PRIOR_SHARE: f64 = 0.5;

/// Maximum relative difference of two frequencies that count as equal, because tables give
/// frequencies with few digits.
pub(crate) const SAME_FREQUENCY: f64 = 1e-6;

/// Largest 1 − coherence (median over the lines) of a table that states no noise: a smaller value
/// is rounding of the file, or the coherence was not computed.
pub const COHERENCE_OF_ONE: f64 = 1e-6;

/// Maximum number of fits with a force that is held or linear between its samples.
pub const ACQUISITION_ROUNDS: usize = 8;

/// Change of a parameter, in standard errors, that ends the fits with a force that is held or
/// linear between its samples.
pub const ACQUISITION_SETTLED: f64 = 0.02;

/// Maximum number of effects of the noise of pulses (lines × patterns × outputs, real and imaginary
/// parts) that the fit of a machine stores: 256 MiB. Up to this number, hits without a gap are
/// joined into one record. With more effects, every hit is a separate record with its own
/// transient; this loses up to half of the information about light damping.
pub(crate) const PULSE_EFFECTS: usize = 1 << 25;

/// Number of periods of the slowest mode, at each end of a record, that decide whether the record
/// begins and ends at rest.
pub(crate) const REST_PERIODS: f64 = 2.0;

/// Maximum number of samples, at each end of a record, that decide whether it begins and ends at
/// rest. A larger number takes more time and shows little more: the faster modes already show a
/// motion in these samples.
pub(crate) const REST_SAMPLES: usize = 4096;

/// Maximum RMS, about the mean, of a channel that counts as at rest at an end of a record, relative
/// to the largest magnitude of the channel in the whole record; such small values are rounding.
pub(crate) const REST_DIGITS: f64 = 1e-9;

/// P-value of the correlations of the prediction errors of a force model; below it, a remark says
/// that the standard error of the force is not reliable.
pub const INNOVATION_LEVEL: f64 = 1e-3;
