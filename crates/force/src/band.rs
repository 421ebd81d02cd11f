//! The part of a force within a band of frequencies.

use mechid_signal::{Extent, Record, Sampling, Spectrum};
use nalgebra::DMatrix;

use crate::error::ForceError;
use crate::limits;

/// Returns the part of a record between two frequencies in Hz, including the ends: samples ×
/// channels, in the unit of the record.
///
/// For a whole period, the lines in the band are kept and all others are zero. An open record is
/// extended by its mirror image, so that its ends match; the lines of the extended record are half
/// as far apart.
///
/// Methods that estimate a force in a band ([`Measurement::in_band`]) return this part; compare
/// their result with this part of the reference force.
///
/// # Errors
/// [`ForceError::NoBand`] if the lower end is not below the upper end, or an end is not finite.
///
/// [`Measurement::in_band`]: crate::Measurement::in_band
///
/// ```
/// use mechid_force::within_band;
/// use mechid_signal::{Extent, Multisine, Phases, Sampling};
///
/// let period = Sampling::new(0.01, 200)?;
/// let wave = |lines: &[usize]| Multisine::flat(lines.to_vec(), 3.0, Phases::Zero)?.sample(period);
/// // Lines 0.5 Hz apart: of 2, 10 and 30 Hz the middle one remains.
/// let inside = within_band(&wave(&[4, 20, 60])?, [5.0, 20.0], Extent::WholePeriod)?;
/// assert!((inside.data() - wave(&[20])?.data()).amax() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn within_band(
    record: &Record,
    band_hz: [f64; 2],
    extent: Extent,
) -> Result<Record, ForceError> {
    check_band(band_hz)?;
    let columns: Vec<_> = record.data().column_iter().map(|c| c.as_slice().to_vec()).collect();
    let len = record.len();
    let filter = BandFilter { sampling: record.sampling(), band_hz, extent };
    let channels = columns.iter().map(|c| filter.apply(c)).collect::<Result<Vec<_>, _>>()?;
    let data = DMatrix::from_fn(len, channels.len(), |k, c| channels[c][k]);
    Ok(Record::new(record.sampling(), data)?)
}

/// Returns an error unless the frequencies are finite, at least 0 Hz and in ascending order.
pub(crate) fn check_band([low_hz, high_hz]: [f64; 2]) -> Result<(), ForceError> {
    if low_hz >= 0.0 && low_hz < high_hz && high_hz.is_finite() {
        return Ok(());
    }
    Err(ForceError::NoBand { low_hz, high_hz })
}

/// Returns whether a frequency is in a band, up to rounding.
pub(crate) fn is_within([low_hz, high_hz]: [f64; 2], frequency_hz: f64, spacing_hz: f64) -> bool {
    let slack = limits::BAND_TOLERANCE * spacing_hz;
    (low_hz - slack..=high_hz + slack).contains(&frequency_hz)
}

/// Returns the error for a band that contains no spectral line of a period.
pub(crate) fn empty_band([low_hz, high_hz]: [f64; 2], sampling: Sampling) -> ForceError {
    let spacing_hz = sampling.line_spacing_hz();
    let last_hz = (sampling.lines() - 1) as f64 * spacing_hz;
    ForceError::EmptyBand { low_hz, high_hz, spacing_hz, last_hz }
}

/// Projection of a record onto a band; a second application has no effect.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BandFilter {
    pub sampling: Sampling,
    pub band_hz: [f64; 2],
    pub extent: Extent,
}

impl BandFilter {
    pub fn apply(&self, values: &[f64]) -> Result<Vec<f64>, ForceError> {
        let len = values.len();
        let mut mirrored = values.to_vec();
        if self.extent == Extent::Open {
            mirrored.extend(values.iter().rev());
        }
        let spectrum = Spectrum::from_record(&Record::from_channel(
            self.sampling.with_len(mirrored.len())?,
            mirrored,
        )?);
        let spacing = spectrum.sampling().line_spacing_hz();
        let mut lines = spectrum.lines().clone();
        for (n, mut line) in lines.row_iter_mut().enumerate() {
            if !is_within(self.band_hz, n as f64 * spacing, spacing) {
                line.fill(nalgebra::Complex::ZERO);
            }
        }
        let filtered = Spectrum::from_lines(spectrum.sampling(), lines)?.to_record()?;
        Ok(filtered.channel(0)[..len].to_vec())
    }
}
