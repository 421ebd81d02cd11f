//! Strongest spectral line of a force; the force may have any number of samples.

use std::ops::Range;

use mechid_signal::{Record, Sampling, Spectrum};
use nalgebra::DMatrix;

use crate::AnalysisError;
use crate::measurement::{CHUNK_SAMPLES, IN_MEMORY_SAMPLES};

/// Spectrum of a force: of the whole force, or the mean power of segments of a long open record.
///
/// The segments are spaced evenly from the first sample to the last and cover all samples.
pub struct PeakLine {
    /// Samples of the force.
    samples: usize,
    /// Time axis of a segment.
    piece: Sampling,
    pieces: usize,
    /// Number of processed segments.
    done: usize,
    /// Samples of each channel for the next segments, beginning with sample `first`.
    held: Vec<Vec<f64>>,
    first: usize,
    /// Sum of squared amplitudes: lines × channels.
    power: DMatrix<f64>,
}

impl PeakLine {
    /// Creates an empty spectrum for a force with this time axis and number of channels.
    pub fn new(sampling: Sampling, channels: usize, periodic: bool) -> Result<Self, AnalysisError> {
        let samples = sampling.len();
        let pieces = if periodic { 1 } else { samples.div_ceil(IN_MEMORY_SAMPLES) };
        let piece = if pieces == 1 { sampling } else { sampling.with_len(IN_MEMORY_SAMPLES)? };
        let (held, power) = (vec![Vec::new(); channels], DMatrix::zeros(piece.lines(), channels));
        Ok(Self { samples, piece, pieces, done: 0, held, first: 0, power })
    }

    /// Returns the number of segments in the averaged spectrum.
    pub fn pieces(&self) -> usize {
        self.pieces
    }

    /// Adds the next samples.
    pub fn push(&mut self, force: &Record, kept: Range<usize>) -> Result<(), AnalysisError> {
        let mut next = kept.start;
        while next < kept.end {
            let upto = kept.end.min(next + CHUNK_SAMPLES);
            for (dof, held) in self.held.iter_mut().enumerate() {
                held.extend_from_slice(&force.channel(dof)[next..upto]);
            }
            next = upto;
            self.look()?;
        }
        Ok(())
    }

    /// Processes the complete segments, and drops the samples that no later segment needs.
    fn look(&mut self) -> Result<(), AnalysisError> {
        let samples = self.piece.len();
        while self.done < self.pieces {
            let spread = self.samples - samples;
            let start = (self.done * spread).checked_div(self.pieces - 1).unwrap_or(0);
            let there = self.first + self.held.first().map_or(0, Vec::len);
            let passed = start.min(there) - self.first;
            self.held.iter_mut().for_each(|held| drop(held.drain(..passed)));
            self.first += passed;
            if there < start + samples {
                break;
            }
            let mut piece = DMatrix::zeros(samples, self.held.len());
            for (mut column, held) in piece.column_iter_mut().zip(&self.held) {
                column.copy_from_slice(&held[..samples]);
            }
            self.add(&Spectrum::from_record(&Record::new(self.piece, piece)?));
        }
        Ok(())
    }

    /// Adds the power of a segment.
    pub fn add(&mut self, piece: &Spectrum) {
        for (power, line) in self.power.iter_mut().zip(piece.lines()) {
            let amplitude = line.norm();
            *power += amplitude * amplitude;
        }
        self.done += 1;
    }

    /// Returns frequency, in Hz, and amplitude, in N, of the strongest line of a channel.
    pub fn line(&self, channel: usize) -> (f64, f64) {
        let column = self.power.column(channel);
        let by_power = column.iter().enumerate().max_by(|(_, a), (_, b)| a.total_cmp(b));
        let (line, power) = by_power.unwrap_or((0, &0.0));
        (line as f64 * self.piece.line_spacing_hz(), (power / self.pieces as f64).sqrt())
    }

    /// Returns the remark on the strongest line of a long open record.
    pub fn remark(&self) -> Option<String> {
        (self.pieces > 1).then(|| {
            format!(
                "the strongest line is that of the mean power spectrum of {} pieces of {} samples each",
                self.pieces,
                self.piece.len()
            )
        })
    }
}
