//! Chosen spectral lines of whole periods, with the transform prepared once.

use std::fmt;
use std::sync::Arc;

use mechid_signal::transform::{self, RealToComplex};
use mechid_signal::{Record, Sampling};
use nalgebra::{Complex, DMatrix};

use crate::SpectraError;
use crate::limits::LINE_ROUNDING;

/// Spectral lines to be read from records with one time axis; the transform is planned once.
///
/// Line n is at n·ω0 of the record. Line 0 (the mean) and, for an even length, the line at half the
/// sampling rate have no phase and cannot be chosen.
#[derive(Clone)]
pub struct Lines {
    sampling: Sampling,
    lines: Vec<usize>,
    plan: Arc<dyn RealToComplex<f64>>,
}

impl fmt::Debug for Lines {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Lines")
            .field("sampling", &self.sampling)
            .field("lines", &self.lines)
            .finish_non_exhaustive()
    }
}

impl Lines {
    /// Chooses lines of records with this time axis, in the given order.
    ///
    /// # Errors
    /// [`SpectraError::NoExcitedLine`] if no line is given, [`SpectraError::LineOutOfRange`] for a
    /// line that does not exist or has no phase.
    pub fn new(
        sampling: Sampling,
        lines: impl IntoIterator<Item = usize>,
    ) -> Result<Self, SpectraError> {
        let last = last_line(sampling);
        let lines: Vec<usize> = lines.into_iter().collect();
        if lines.is_empty() {
            return Err(SpectraError::NoExcitedLine);
        }
        if let Some(&line) = lines.iter().find(|&&line| line == 0 || line > last) {
            return Err(SpectraError::LineOutOfRange { line, last });
        }
        let plan = transform::forward(sampling.len());
        Ok(Self { sampling, lines, plan })
    }

    /// Chooses the lines on which the amplitude of at least one force channel is at least
    /// `threshold` (a pure number) times the largest amplitude of this channel.
    ///
    /// The lines of a multisine are much stronger than the noise between the lines: a threshold of
    /// 0.1 separates lines and noise.
    ///
    /// # Errors
    /// [`SpectraError::NoExcitedLine`] if the force is zero on all usable lines.
    ///
    /// # Source
    /// Ours.
    pub fn excited(force: &Record, threshold: f64) -> Result<Self, SpectraError> {
        let candidates = Self::new(force.sampling(), 1..=last_line(force.sampling()))?;
        let amplitudes = candidates.read(force)?.map(|z| z.norm());
        // Rounding gives even a constant force small amplitudes on all lines.
        let rounding = |c: usize| LINE_ROUNDING * force.column(c).amax();
        let largest = amplitudes.column_iter().map(|c| c.max()).enumerate();
        let largest: Vec<f64> =
            largest.map(|(c, max)| if max > rounding(c) { max } else { 0.0 }).collect();
        let lines: Vec<usize> = amplitudes
            .row_iter()
            .enumerate()
            .filter(|(_, row)| {
                row.iter().zip(&largest).any(|(a, max)| *max > 0.0 && *a >= threshold * max)
            })
            .map(|(n, _)| n + 1)
            .collect();
        if lines.is_empty() {
            return Err(SpectraError::NoExcitedLine);
        }
        Ok(Self { lines, ..candidates })
    }

    /// Returns the time axis of the records that contain these lines.
    pub fn sampling(&self) -> Sampling {
        self.sampling
    }

    /// Returns the chosen lines, in their order.
    pub fn as_slice(&self) -> &[usize] {
        &self.lines
    }

    /// Returns the angular frequencies of the chosen lines, in rad/s.
    pub fn omega(&self) -> Vec<f64> {
        let omega0 = self.sampling.omega0();
        self.lines.iter().map(|&n| n as f64 * omega0).collect()
    }

    /// Returns the complex amplitudes of a record at these lines, in its unit: lines × channels,
    /// scaled as in [`mechid_signal::spectrum`].
    ///
    /// # Errors
    /// [`SpectraError::Signal`] if the record has another time axis.
    pub fn read(&self, record: &Record) -> Result<DMatrix<Complex<f64>>, SpectraError> {
        check_sampling(self.sampling, record.sampling())?;
        Ok(self.read_window(record, 0))
    }

    /// Reads the lines as [`Lines::read`] does, from a window of a longer record; the window begins
    /// at sample `start`.
    pub(crate) fn read_window(&self, record: &Record, start: usize) -> DMatrix<Complex<f64>> {
        let mut amplitudes = DMatrix::zeros(self.lines.len(), record.channels());
        let mut reader = self.reader();
        for (channel, mut column) in amplitudes.column_iter_mut().enumerate() {
            let samples = &record.channel(channel)[start..start + self.sampling.len()];
            reader.read(|input| input.copy_from_slice(samples), column.iter_mut());
        }
        amplitudes
    }

    /// Returns a reader whose buffers are used for one window after another.
    pub(crate) fn reader(&self) -> LineReader<'_> {
        let plan = &self.plan;
        LineReader {
            lines: self,
            input: plan.make_input_vec(),
            output: plan.make_output_vec(),
            scratch: plan.make_scratch_vec(),
        }
    }
}

/// Transform of chosen lines with its buffers.
pub(crate) struct LineReader<'a> {
    lines: &'a Lines,
    input: Vec<f64>,
    output: Vec<Complex<f64>>,
    scratch: Vec<Complex<f64>>,
}

impl LineReader<'_> {
    /// Reads the amplitudes, one per line, of the samples that `fill` writes.
    pub(crate) fn read<'z>(
        &mut self,
        fill: impl FnOnce(&mut [f64]),
        into: impl Iterator<Item = &'z mut Complex<f64>>,
    ) {
        let Self { lines, input, output, scratch } = self;
        let scale = 2.0 / input.len() as f64;
        fill(input);
        lines
            .plan
            .process_with_scratch(input, output, scratch)
            .expect("buffers come from the plan");
        for (z, &line) in into.zip(&lines.lines) {
            *z = output[line] * scale;
        }
    }
}

/// Returns the last line below half the sampling rate.
fn last_line(sampling: Sampling) -> usize {
    (sampling.len() - 1) / 2
}

/// Returns an error unless two time axes are equal up to rounding.
///
/// # Errors
/// [`SpectraError::Signal`].
pub fn check_sampling(left: Sampling, right: Sampling) -> Result<(), SpectraError> {
    // Time steps that are read from files may differ by rounding.
    if left.len() == right.len() && (left.dt() - right.dt()).abs() <= 1e-9 * left.dt() {
        return Ok(());
    }
    Err(mechid_signal::SignalError::SamplingMismatch {
        left_len: left.len(),
        left_dt: left.dt(),
        right_len: right.len(),
        right_dt: right.dt(),
    }
    .into())
}

#[cfg(test)]
mod tests {
    use mechid_signal::Spectrum;

    use super::*;

    fn record(len: usize) -> Record {
        let sampling = Sampling::new(0.01, len).unwrap();
        let omega0 = sampling.omega0();
        let x = sampling
            .times()
            .map(|t| 2.0 + (2.0 * omega0 * t).cos() - 3.0 * (3.0 * omega0 * t).sin())
            .collect();
        Record::from_channel(sampling, x).unwrap()
    }

    #[test]
    fn chosen_lines_are_those_of_the_whole_spectrum() {
        for len in [15, 16] {
            let r = record(len);
            let lines = Lines::new(r.sampling(), [3, 1, 7]).unwrap();
            let (read, all) = (lines.read(&r).unwrap(), Spectrum::from_record(&r));
            for (row, &n) in lines.as_slice().iter().enumerate() {
                assert!((read[(row, 0)] - all.line(n, 0)).norm() < 1e-14);
            }
        }
    }

    #[test]
    fn only_lines_with_a_phase_can_be_chosen() {
        let s = Sampling::new(0.01, 16).unwrap();
        for line in [0, 8, 99] {
            let e = Lines::new(s, [1, line]).unwrap_err();
            assert_eq!(e, SpectraError::LineOutOfRange { line, last: 7 });
        }
        assert_eq!(Lines::new(s, []).unwrap_err(), SpectraError::NoExcitedLine);
    }

    #[test]
    fn excited_lines_are_found() {
        assert_eq!(Lines::excited(&record(16), 0.1).unwrap().as_slice(), [2, 3]);
        assert_eq!(Lines::excited(&record(16), 0.5).unwrap().as_slice(), [3]);
        let still = Record::from_channel(Sampling::new(0.1, 7).unwrap(), vec![0.1; 7]).unwrap();
        assert_eq!(Lines::excited(&still, 0.1).unwrap_err(), SpectraError::NoExcitedLine);
    }
}
