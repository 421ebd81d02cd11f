//! The computed content of a report page.

pub mod channels;
pub mod excitation;
pub mod judgement;
pub mod receptance;
pub mod reconstruction;
pub mod residual;
pub mod whole;

use self::channels::Channel;
use self::excitation::Excitation;
use self::receptance::Receptance;
use self::reconstruction::Reconstruction;
use self::residual::Residual;
use self::whole::Whole;
use crate::AnalysisError;
use crate::identify::Identified;
use crate::identify::lines::{LineChoice, choose_lines};
use crate::identify::prediction::{Compared, Prediction};
use crate::measurement::{Block, Windowed};

/// Computed content of a page.
pub struct Review<'a> {
    /// The identification.
    pub identified: &'a Identified,
    /// Content for each of the fitted records.
    pub records: Vec<RecordReview<'a>>,
    /// Measured receptance of the records, or the reason why there is none.
    pub receptance: Result<Receptance, String>,
    /// Measured and predicted responses of a record that was not fitted.
    pub validation: Vec<Compared>,
}

/// Computed content of a page for one record.
pub struct RecordReview<'a> {
    /// The record.
    pub recorded: &'a Windowed,
    /// Levels, histories and mean period, computed from all samples of the window.
    pub whole: Whole,
    /// Name of the record; `None` with one record.
    pub name: Option<&'a str>,
    /// Index of the record, counted from 0.
    pub index: usize,
    /// Spectral lines of the period that were fitted; `None` if the fit did not use the lines of a
    /// period.
    pub lines: Option<Vec<usize>>,
    /// Levels of the columns used.
    pub channels: Vec<Channel>,
    /// Measures of the forces that act.
    pub excitations: Vec<Excitation>,
    /// Measured and predicted responses, or the reason why there are none.
    pub residual: Result<Residual, String>,
    /// The force reconstructed with the identified machine.
    pub reconstruction: Option<Reconstruction>,
}

impl<'a> Review<'a> {
    /// Computes the content of a page; `reconstruct_force` adds the force reconstructed with the
    /// identified machine.
    ///
    /// # Errors
    /// If a file cannot be read again, and if the force cannot be reconstructed.
    pub fn new(identified: &'a Identified, reconstruct_force: bool) -> Result<Self, AnalysisError> {
        let records = (0..identified.records().len())
            .map(|at| RecordReview::new(identified, at, reconstruct_force))
            .collect::<Result<Vec<_>, _>>()?;
        let validation = match identified.validated() {
            Some(other) => identified.prediction().predict(&identified.fitted().model()?, other)?,
            None => Vec::new(),
        };
        let receptance = Receptance::new(identified, &records).map_err(|reason| reason.to_string());
        Ok(Self { identified, receptance, records, validation })
    }

    /// Returns the buffered samples of the record that was not fitted.
    pub fn validated(&self) -> Option<&'a Block> {
        self.identified.validated()
    }
}

impl<'a> RecordReview<'a> {
    fn new(
        identified: &'a Identified,
        at: usize,
        reconstruct_force: bool,
    ) -> Result<Self, AnalysisError> {
        let recorded = &identified.records()[at];
        let buffered = &recorded.held;
        let lines = match identified.spectra() {
            // Segments have other lines than the whole record, so the lines of the record are
            // chosen here.
            Some(_) if identified.prediction() == Prediction::Steady => {
                let lines = identified.summary().analysis.source.lines();
                let choice = lines.map_or(&LineChoice::Driven, |lines| &lines.choice);
                Some(choose_lines(&buffered.force, buffered.period, choice)?)
            }
            _ => None,
        };
        let whole = Whole::new(recorded)?;
        let mean = whole.mean.as_ref().filter(|_| lines.is_some());
        let period = mean.unwrap_or(buffered);
        let reconstruction = if reconstruct_force {
            Some(Reconstruction::new(identified, period, lines.clone())?)
        } else {
            None
        };
        Ok(Self {
            recorded,
            name: (identified.records().len() > 1).then_some(buffered.file.as_str()),
            index: at,
            channels: channels::channels(buffered, &whole, &buffered.names),
            excitations: excitation::excitations(&period.force)?,
            residual: Residual::new(identified, at, mean).map_err(|reason| reason.to_string()),
            reconstruction,
            lines,
            whole,
        })
    }

    /// Returns the buffered samples of the record.
    pub fn held(&self) -> &Block {
        &self.recorded.held
    }

    /// Returns the samples used for spectra: the mean period if lines of periods were fitted,
    /// otherwise the buffered samples.
    pub fn period(&self) -> &Block {
        match self.lines {
            Some(_) => self.whole.period(self.held()),
            None => self.held(),
        }
    }
}
