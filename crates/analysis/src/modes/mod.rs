//! Modes of a structure from records under measured forces, from tables of frequency responses, and
//! from ambient records.

mod ambient;
mod averaged;
mod checks;
mod comparison;
mod diagrams;
mod forced;
mod mode_set;
pub(crate) mod resonances;
mod rows;
mod settings;
mod sources;
mod summary;
mod synthesis;
mod tables;
mod validation;

use std::fmt;

use mechid_io::FrequencyResponses;
use serde::{Serialize, Serializer};

pub use self::comparison::{DifferenceRow, LoneRow, ModeComparison, PairRow, compare_modes};
use self::diagrams::DiagramData;
pub use self::diagrams::{Diagrams, ModeIndicator, StabilisationRows};
use self::forced::Test;
pub use self::mode_set::ModeSet;
pub use self::settings::{ModalTest, ModesSettings, Places};
use self::sources::Recorded;
pub(crate) use self::sources::driven_band;
pub use self::summary::{
    DroppedRow, HarmonicRow, ModalCheck, ModalModeRow, ModesSummary, OutputRow, RecordRow,
    SegmentsRow, TableRow,
};
use self::tables::Tables;
use crate::AnalysisError;
use crate::measurement::Measurement;

/// Modes of a structure with their uncertainty, and how well they explain the records.
#[derive(Debug)]
pub struct Modes {
    summary: ModesSummary,
    spectrum: ModesSpectrum,
    source: DiagramData,
}

/// Responses over frequency, measured and explained: root of the sum over all responses, each over its
/// own RMS in the band.
#[derive(Debug, Clone, Default)]
pub struct ModesSpectrum {
    /// Frequencies of the lines of the first record or force, in Hz.
    pub frequency_hz: Vec<f64>,
    /// Measured, a ratio, one for each frequency.
    pub measured: Vec<f64>,
    /// Explained by modes and residual terms, a ratio, one for each frequency.
    pub modelled: Vec<f64>,
    /// Difference of the two, a ratio, one for each frequency.
    pub residual: Vec<f64>,
}

/// Finds the modes of a structure from records of one test, which are fitted together.
///
/// With measured forces any number of forces and responses, of any kinds, is possible: a shaker, several
/// of them, a hammer at one point or at a different one in each record. Frequencies, damping ratios and
/// shapes are those of maximum likelihood on the spectral lines of the open records, without a window;
/// what the ends of the records add is part of the model, and so are unmeasured forces and the modes
/// outside of the band. Of an ambient record the forces are taken as white over the band.
///
/// # Errors
/// [`AnalysisError::NoRecord`], [`AnalysisError::NoForce`], [`AnalysisError::NoMotion`],
/// [`AnalysisError::Setting`] for places that do not belong to the columns,
/// [`AnalysisError::Modal`] or [`AnalysisError::Ambient`] if nothing can be fitted, and if a file
/// cannot be read.
///
/// # Source
/// Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed. (2012), chapters 9
/// and 12; Golub & Pereyra (1973), SIAM Journal on Numerical Analysis 10, 413–432.
pub fn modes(
    measurements: &[Measurement],
    settings: &ModesSettings,
) -> Result<Modes, AnalysisError> {
    settings.check()?;
    let hits = match &settings.test {
        ModalTest::Forced { hits } => hits,
        ModalTest::Ambient { without_hz, without_harmonics } => {
            return ambient::modes(measurements, settings, without_hz, *without_harmonics);
        }
    };
    let recorded = Recorded::from_forced(measurements, hits.as_ref(), &settings.places)?;
    let band_hz = settings.band_hz.unwrap_or_else(|| recorded.driven_band());
    let records = measurements.iter().map(|measurement| {
        let block = measurement.whole_block()?;
        Ok(RecordRow::of_block(&block))
    });
    let records = records.collect::<Result<Vec<_>, AnalysisError>>()?;
    let checks = checks::of_channels(measurements)?;
    Test { recorded, band_hz }.modes(records, checks, settings)
}

/// Finds the modes of a structure from tables of its frequency responses, which are fitted together;
/// any number of points and references is possible.
///
/// Of averages over segments that a table states, lines whose errors are tied by the window are left
/// out, and what the window blunts is subtracted by the modes themselves, round by round; the decay of an
/// exponential window is subtracted, too.
///
/// # Errors
/// As [`modes`], and [`AnalysisError::MissingResponse`] if a response is missing.
///
/// # Source
/// That of [`modes`].
pub fn modes_of_responses(
    tables: &[FrequencyResponses],
    settings: &ModesSettings,
) -> Result<Modes, AnalysisError> {
    settings.check()?;
    let tables = Tables::new(tables, settings.quantity)?;
    let band_hz = settings.band_hz.unwrap_or_else(|| tables.range_hz());
    forced::of_tables(&tables, band_hz, settings)
}

impl Modes {
    /// Returns the numbers, checks and notes.
    pub fn summary(&self) -> &ModesSummary {
        &self.summary
    }

    /// Returns the stabilisation diagram and the mode indicator, which take a part of the time of the
    /// identification.
    ///
    /// # Errors
    /// [`AnalysisError::Modal`] and [`AnalysisError::Indicator`] if a decomposition fails.
    pub fn diagrams(&self) -> Result<Diagrams, AnalysisError> {
        self.source.diagrams()
    }

    /// Adds the diagrams to the summary.
    ///
    /// # Errors
    /// As [`Modes::diagrams`].
    pub fn add_diagrams(&mut self) -> Result<(), AnalysisError> {
        self.summary.diagrams = Some(self.diagrams()?);
        Ok(())
    }

    /// Returns the responses over frequency, measured and explained.
    pub fn spectrum(&self) -> &ModesSpectrum {
        &self.spectrum
    }
}

impl fmt::Display for Modes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.summary.fmt(f)
    }
}

impl Serialize for Modes {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.summary.serialize(serializer)
    }
}
