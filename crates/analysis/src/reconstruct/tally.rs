//! Levels of a force that is reconstructed in chunks.

use std::ops::Range;

use mechid_force::IdentifiedForce;
use mechid_signal::{RunningStatistics, Sampling};

use super::ForceChunk;
use super::peak_line::PeakLine;
use super::summary::ForceRow;
use crate::AnalysisError;

/// Levels and strongest line of a force that need not be buffered.
pub struct Tally<'a> {
    sampling: Sampling,
    levels: Vec<Level>,
    strongest: PeakLine,
    /// Callback for the reconstructed samples.
    take: &'a mut Take<'a>,
}

/// Callback for a chunk of the force.
pub type Take<'a> = dyn FnMut(&ForceChunk<'_>) -> Result<(), AnalysisError> + 'a;

/// Levels of one channel.
#[derive(Default)]
struct Level {
    force: RunningStatistics,
    /// Standard errors; `None` if they are unknown.
    error: Option<RunningStatistics>,
}

impl<'a> Tally<'a> {
    /// Creates the levels of a force with this time axis, before its first sample.
    pub fn new(
        sampling: Sampling,
        dofs: usize,
        periodic: bool,
        take: &'a mut Take<'a>,
    ) -> Result<Self, AnalysisError> {
        let levels = (0..dofs).map(|_| Level::default()).collect();
        let strongest = PeakLine::new(sampling, dofs, periodic)?;
        Ok(Self { sampling, levels, strongest, take })
    }

    /// Adds all samples; `counts_noise` states whether the standard error includes the noise of the
    /// record.
    pub fn push_all(
        &mut self,
        force: &IdentifiedForce,
        counts_noise: bool,
    ) -> Result<(), AnalysisError> {
        let all_samples = 0..force.record().len();
        self.push_samples(force, all_samples.clone(), counts_noise)?;
        if self.strongest.pieces() == 1 {
            self.strongest.add(force.spectrum());
        } else {
            self.strongest.push(force.record(), all_samples)?;
        }
        Ok(())
    }

    /// Adds the samples with the indices `kept` of the force reconstructed from a chunk.
    pub fn push(
        &mut self,
        force: &IdentifiedForce,
        kept: Range<usize>,
        counts_noise: bool,
    ) -> Result<(), AnalysisError> {
        self.push_samples(force, kept.clone(), counts_noise)?;
        self.strongest.push(force.record(), kept)
    }

    fn push_samples(
        &mut self,
        force: &IdentifiedForce,
        kept: Range<usize>,
        counts_noise: bool,
    ) -> Result<(), AnalysisError> {
        let (record, error) = (force.record(), force.standard_error());
        for (dof, level) in self.levels.iter_mut().enumerate() {
            level.force.push(&record.channel(dof)[kept.clone()])?;
            if let Some(error) = error {
                level.error.get_or_insert_default().push(&error.channel(dof)[kept.clone()])?;
            }
        }
        (self.take)(&ForceChunk { sampling: self.sampling, force, samples: kept, counts_noise })
    }

    /// Returns the level of each force by its name; `forced` are the degrees of freedom with a
    /// requested force.
    pub fn forces(&self, names: &[String], forced: &[usize]) -> Vec<ForceRow> {
        self.levels
            .iter()
            .zip(names)
            .enumerate()
            .map(|(dof, (level, name))| {
                let (strongest_hz, strongest_amplitude) = self.strongest.line(dof);
                ForceRow {
                    dof: dof + 1,
                    name: name.clone(),
                    // The equations of motion give a force on every degree of freedom, whether
                    // requested or not.
                    sought: level.force.peak() > 0.0 || forced.contains(&dof),
                    rms: level.force.rms(),
                    peak: level.force.peak(),
                    standard_error: level.error.map(|error| error.rms()),
                    strongest_hz,
                    strongest_amplitude,
                }
            })
            .collect()
    }

    /// Returns the remark on how the strongest line was determined; `None` if no remark is
    /// necessary.
    pub fn remark(&self) -> Option<String> {
        self.strongest.remark()
    }
}
