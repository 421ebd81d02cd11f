//! Excitation by the force.

use mechid_signal::measures::{self, Band};
use mechid_signal::{Record, Spectrum};

use crate::AnalysisError;

/// Maximum difference of an excited line from the strongest line, in dB: the lines of a multisine
/// are far above the noise between them.
pub const DROP_DB: f64 = 20.0;

/// Measures of one acting force.
pub struct Excitation {
    /// Degree of freedom, counted from 1.
    pub dof: usize,
    /// Peak over RMS, a ratio.
    pub crest_factor: f64,
    /// Peak factor: half of the range (maximum − minimum), divided by √2 times the RMS; a ratio.
    /// `None` for a force that does not vary.
    pub peak_factor: Option<f64>,
    /// Number of excited lines.
    pub lines: usize,
    /// Band of the excited lines.
    pub band: Option<Band>,
    /// Spectral flatness of the excited lines, a ratio from 0 to 1.
    pub flatness: Option<f64>,
    /// Order of persistent excitation.
    pub order: usize,
}

/// Returns the measures of every force that is not zero throughout, in one period.
///
/// # Errors
/// [`AnalysisError::Signal`] if a measure cannot be computed.
///
/// # Source
/// See [`mechid_signal::measures`].
pub(crate) fn excitations(force: &Record) -> Result<Vec<Excitation>, AnalysisError> {
    let spectrum = Spectrum::from_record(force);
    let floor = 10f64.powf(-DROP_DB / 20.0);
    let acting = (0..force.channels()).filter(|c| force.column(*c).amax() > 0.0);
    acting
        .map(|c| {
            let amplitude = |n: &usize| spectrum.line(*n, c).norm();
            let strongest = (1..spectrum.len()).map(|n| amplitude(&n)).fold(0.0, f64::max);
            let driven = |n: &usize| strongest > 0.0 && amplitude(n) >= floor * strongest;
            let lines: Vec<usize> = (1..spectrum.len()).filter(driven).collect();
            Ok(Excitation {
                dof: c + 1,
                crest_factor: measures::crest_factor(force, c)?,
                peak_factor: measures::relative_peak_factor(force, c).ok(),
                lines: lines.len(),
                band: measures::effective_band(&spectrum, c, DROP_DB).ok(),
                flatness: measures::spectral_flatness(&spectrum, c, lines).ok(),
                order: measures::persistent_excitation_order(&spectrum, c, floor)?,
            })
        })
        .collect()
}
