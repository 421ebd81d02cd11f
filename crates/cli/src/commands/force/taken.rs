//! A force as it is found, taken some samples at a time.

use std::ops::Range;
use std::path::PathBuf;

use mechid::force::IdentifiedForce;
use mechid::io::{BegunFile, CsvFile};
use mechid::signal::Sampling;

use super::report::{Force, columns};
use super::strongest::Strongest;
use crate::error::CliError;

/// What is told and written of a force, whose samples need not be held.
pub struct Taken {
    sampling: Sampling,
    levels: Vec<Level>,
    strongest: Strongest,
    /// Where its rows go.
    path: Option<PathBuf>,
    rows: Option<CsvFile>,
}

/// Sums over one channel.
#[derive(Default)]
struct Level {
    squares: f64,
    peak: f64,
    /// Squared standard errors; nothing where they are not known.
    errors: Option<f64>,
}

impl Taken {
    /// Nothing yet of a force with this time axis, on so many degrees of freedom.
    pub fn new(
        sampling: Sampling,
        dofs: usize,
        periodic: bool,
        path: Option<PathBuf>,
    ) -> Result<Self, CliError> {
        let levels = (0..dofs).map(|_| Level::default()).collect();
        let strongest = Strongest::new(sampling, dofs, periodic)?;
        Ok(Self { sampling, levels, strongest, path, rows: None })
    }

    /// All of it, and whether its standard error counts the noise of the record.
    pub fn push_all(
        &mut self,
        force: &IdentifiedForce,
        counts_noise: bool,
    ) -> Result<(), CliError> {
        let all = 0..force.record().len();
        self.push_samples(force, all.clone(), counts_noise)?;
        if self.strongest.pieces() == 1 {
            self.strongest.add(force.spectrum());
        } else {
            self.strongest.push(force.record(), all)?;
        }
        Ok(())
    }

    /// Some samples of what was found of a stretch, likewise.
    pub fn push(
        &mut self,
        force: &IdentifiedForce,
        kept: Range<usize>,
        counts_noise: bool,
    ) -> Result<(), CliError> {
        self.push_samples(force, kept.clone(), counts_noise)?;
        self.strongest.push(force.record(), kept)
    }

    fn push_samples(
        &mut self,
        force: &IdentifiedForce,
        kept: Range<usize>,
        counts_noise: bool,
    ) -> Result<(), CliError> {
        let (record, error) = (force.record(), force.standard_error());
        for (dof, level) in self.levels.iter_mut().enumerate() {
            let values = record.column(dof);
            let values = values.rows_range(kept.clone());
            level.squares += values.norm_squared();
            level.peak = level.peak.max(values.amax());
            if let Some(error) = error {
                let squares = error.column(dof).rows_range(kept.clone()).norm_squared();
                *level.errors.get_or_insert(0.0) += squares;
            }
        }
        self.write(&columns(force, counts_noise), kept)
    }

    fn write(&mut self, columns: &[(String, &[f64])], kept: Range<usize>) -> Result<(), CliError> {
        let Some(path) = &self.path else { return Ok(()) };
        let mut rows = match self.rows.take() {
            Some(rows) => rows,
            None => {
                let names: Vec<&str> = columns.iter().map(|(name, _)| name.as_str()).collect();
                CsvFile::begin(path, self.sampling, &names)?
            }
        };
        let values: Vec<&[f64]> = columns.iter().map(|(_, column)| &column[kept.clone()]).collect();
        rows.append(&values)?;
        self.rows = Some(rows);
        Ok(())
    }

    /// What it is on each degree of freedom; `forced` are those where it was sought.
    pub fn forces(&self, forced: &[usize]) -> Vec<Force> {
        let size = (self.sampling.len() as f64).sqrt();
        let levels = self.levels.iter().enumerate();
        levels
            .map(|(dof, level)| {
                let (strongest_hz, strongest_amplitude) = self.strongest.line(dof);
                Force {
                    dof: dof + 1,
                    // The equations of motion give a force everywhere, asked for or not.
                    sought: level.peak > 0.0 || forced.contains(&dof),
                    rms: level.squares.sqrt() / size,
                    peak: level.peak,
                    standard_error: level.errors.map(|squares| squares.sqrt() / size),
                    strongest_hz,
                    strongest_amplitude,
                }
            })
            .collect()
    }

    /// How the strongest line was found, where that needs saying.
    pub fn remark(&self) -> Option<String> {
        self.strongest.remark()
    }

    /// The file, complete.
    pub fn finish(self) -> Result<Option<BegunFile>, CliError> {
        Ok(self.rows.map(CsvFile::finish).transpose()?)
    }
}
