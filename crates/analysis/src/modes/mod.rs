//! Modes of a structure from records under measured forces, from tables of frequency responses,
//! from free decays, and from ambient records.

mod ambient;
mod averaged;
mod checks;
mod comparison;
mod decays;
mod diagrams;
mod forced;
mod halves;
mod initial_motion;
mod mode_set;
mod prediction;
mod properties;
pub(crate) mod resonances;
pub(crate) mod rows;
mod saved;
mod settings;
mod sources;
mod summary;
mod synthesis;
mod system;
mod tables;
mod validation;

use std::fmt;

use mechid_io::FrequencyResponses;
use serde::{Serialize, Serializer};

pub use self::comparison::{DifferenceRow, LoneRow, ModeComparison, PairRow, compare_modes};
use self::diagrams::DiagramData;
pub use self::diagrams::{Diagrams, ModeIndicator, StabilisationRows};
use self::forced::Test;
pub(crate) use self::initial_motion::basis as free_motion_basis;
pub use self::mode_set::ModeSet;
pub use self::prediction::predict_with_modes;
pub use self::properties::Properties;
pub use self::saved::{
    SavedBackbone, SavedCandidate, SavedCheck, SavedMode, SavedModes, SavedRecord, SavedResponse,
};
pub(crate) use self::saved::{SavedValue, saved_errors};
pub use self::settings::{ModalTest, ModesSettings, Places};
use self::sources::Recorded;
pub(crate) use self::sources::{all_responses, driven_band, other_places};
pub use self::summary::{
    DroppedRow, HarmonicRow, ModalCheck, ModalModeRow, ModesSummary, OutputRow, RecordRow,
    SegmentsRow, TableRow,
};
pub use self::system::ModalSystem;
use self::tables::Tables;
use crate::identify::counts::memory_of_tables;
use crate::measurement::Measurement;
use crate::{AnalysisError, time_limit};

/// Modes of a structure with their uncertainty, and their fit to the records.
#[derive(Debug)]
pub struct Modes {
    summary: ModesSummary,
    spectrum: ModesSpectrum,
    source: DiagramData,
}

/// Measured and modelled responses over frequency: the root of the sum of squares over all
/// responses, each divided by its RMS in the band.
#[derive(Debug, Clone, Default)]
pub struct ModesSpectrum {
    /// Frequencies of the lines of the first record or force, in Hz.
    pub frequency_hz: Vec<f64>,
    /// Measured response, a ratio, one for each frequency.
    pub measured: Vec<f64>,
    /// Response of modes and residual terms, a ratio, one for each frequency.
    pub modelled: Vec<f64>,
    /// Difference of measured and modelled response, a ratio, one for each frequency.
    pub residual: Vec<f64>,
}

/// Identifies the modes of a structure from the records of one test, all together.
///
/// With measured forces any number of forces and responses, of any kinds, is possible: one or
/// several shakers, a hammer at one point or at a different point in each record. Frequencies,
/// damping ratios and shapes are maximum-likelihood estimates from the spectral lines of the open
/// records, without a window; the model includes the transients of the records, unmeasured forces
/// and modes outside the band. Free decays have no forces: each record has its own initial state,
/// and all have the same modes ([`decay`](crate::decay()) is for a single one). The forces of an
/// ambient record are assumed to be white over the band.
///
/// # Errors
/// [`AnalysisError::NoRecord`], [`AnalysisError::NoForce`], [`AnalysisError::NoMotion`],
/// [`AnalysisError::Setting`] for places that do not match the columns, [`AnalysisError::Modal`] or
/// [`AnalysisError::Ambient`] if the fit fails, and an error if a file cannot be read.
///
/// # Source
/// Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed. (2012),
/// chapters 9 and 12; Golub & Pereyra (1973), SIAM Journal on Numerical Analysis 10, 413–432.
pub fn modes(
    measurements: &[Measurement],
    settings: &ModesSettings,
) -> Result<Modes, AnalysisError> {
    settings.check()?;
    let memory = measurements.iter().map(Measurement::memory).sum();
    time_limit::bounded(memory, || {
        let mut modes = modes_of_records(measurements, settings)?;
        modes.summary.checks.extend(time_limit::check_of_modes());
        Ok(modes)
    })
}

fn modes_of_records(
    measurements: &[Measurement],
    settings: &ModesSettings,
) -> Result<Modes, AnalysisError> {
    let hits = match &settings.test {
        ModalTest::Forced { hits } => hits,
        ModalTest::Decay { from_s, to_s } => {
            return decays::modes(measurements, settings, [*from_s, *to_s]);
        }
        ModalTest::Ambient { without_hz, without_harmonics } => {
            return ambient::modes(measurements, settings, without_hz, *without_harmonics);
        }
    };
    let recorded = Recorded::from_forced(measurements, hits.as_ref(), &settings.places)?;
    let driven_hz = recorded.driven_band()?;
    let band_hz = settings.band_hz.unwrap_or(driven_hz);
    let records = measurements.iter().map(|measurement| {
        let block = measurement.whole_block()?;
        Ok(RecordRow::from_block(&block))
    });
    let records = records.collect::<Result<Vec<_>, AnalysisError>>()?;
    let checks = checks::channel_checks(measurements)?;
    let is_one_point = settings.places.forces.is_empty() && recorded.inputs.len() == 1;
    let struck_apart = (is_one_point && measurements.len() > 1)
        .then(|| Recorded::with_first_force_separate(measurements, hits.as_ref()))
        .transpose()?;
    Test { recorded, struck_apart, band_hz }.modes(records, checks, settings)
}

/// Identifies the modes of a structure from tables of its frequency responses, all together, with
/// any number of points and references.
///
/// If a table states that its responses are averages over segments, the window correlates the
/// errors of neighbouring lines, and lines with such errors are excluded. The bias of the window is
/// computed from the identified modes and subtracted, in several iterations. The decay of an
/// exponential window is subtracted, too.
///
/// # Errors
/// As [`modes`], and [`AnalysisError::MissingResponse`] if a response is missing.
///
/// # Source
/// As [`modes`].
pub fn modes_of_responses(
    tables: &[FrequencyResponses],
    settings: &ModesSettings,
) -> Result<Modes, AnalysisError> {
    settings.check()?;
    let memory = memory_of_tables(tables);
    let tables = Tables::new(tables, settings.quantity)?;
    let band_hz = settings.band_hz.unwrap_or_else(|| tables.range_hz());
    time_limit::bounded(memory, || {
        let mut modes = forced::modes_of_tables(&tables, band_hz, settings)?;
        modes.summary.checks.extend(time_limit::check_of_modes());
        Ok(modes)
    })
}

impl Modes {
    /// Returns the numbers, checks and notes.
    pub fn summary(&self) -> &ModesSummary {
        &self.summary
    }

    /// Computes the stabilisation diagram and the mode indicator. This takes less time than the
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

    /// Returns the measured and modelled responses over frequency.
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
