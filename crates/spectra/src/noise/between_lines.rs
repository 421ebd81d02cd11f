//! Noise on the lines between the lines of a period, if several periods are taken as one record. A
//! periodic signal is zero on these lines.

use mechid_signal::transform;
use nalgebra::{Complex, DMatrix, DVector};

use crate::limits::{MAX_BUFFERED, MAX_PERIODS, MIN_PERIODS};

/// Consecutive periods, buffered until their spectrum can be taken as the spectrum of one record.
///
/// The spectrum of B periods has B − 1 lines between two lines of one period. On these lines, noise
/// with a long correlation time (an unmeasured force through a resonance) has the same level as on
/// the lines of the mean over the periods. The scatter of single periods is larger, because it also
/// contains the transients of the periods; these transients nearly cancel in the mean.
#[derive(Debug, Clone)]
pub(crate) struct BetweenLines {
    /// Number of samples in a period.
    period: usize,
    /// Number of periods taken as one record; with one period there are no lines between its lines.
    periods: usize,
    /// Number of buffered periods.
    buffered: usize,
    /// Buffered samples × channels; empty if one period is taken as one record.
    samples: DMatrix<f64>,
}

/// Returns the number of periods to be taken as one record, if `remaining` are expected.
///
/// The groups have nearly equal sizes; a group is as large as the buffer allows.
pub(crate) fn periods_as_one(remaining: usize, period: usize, channels: usize) -> usize {
    let most = (MAX_BUFFERED / (period * channels).max(1)).min(MAX_PERIODS);
    if most.min(remaining) < MIN_PERIODS {
        return 1;
    }
    let parts = remaining.div_ceil(most);
    match remaining.div_ceil(parts) {
        few if few < MIN_PERIODS => 1,
        one => one,
    }
}

impl BetweenLines {
    pub(crate) fn new(periods: usize, period: usize, channels: usize) -> Self {
        let samples = if periods > 1 { periods * period } else { 0 };
        Self { period, periods, buffered: 0, samples: DMatrix::zeros(samples, channels) }
    }

    /// Buffers the next period, its channels in their order.
    pub(crate) fn buffer<'a>(&mut self, channels: impl Iterator<Item = &'a [f64]>) {
        let start = self.buffered * self.period;
        self.buffered += 1;
        if self.periods == 1 {
            return;
        }
        for (mut column, samples) in self.samples.column_iter_mut().zip(channels) {
            column.rows_mut(start, self.period).copy_from_slice(samples);
        }
    }

    /// Returns the number of buffered periods if all periods of the group are buffered; otherwise
    /// `None`.
    pub(crate) fn complete(&self) -> Option<usize> {
        (self.buffered == self.periods).then_some(self.periods)
    }

    /// Adds B Σ z zᴴ to the scatter of each line of a period, where z are the amplitudes between
    /// the lines, from B periods. The expected value is that of the scatter of B periods about
    /// their mean.
    ///
    /// Each line of a period uses the lines that are nearest to it. A line in the middle between
    /// two lines of a period is used for the lower line, so that each line between is used once.
    pub(crate) fn add_scatter(&self, lines: &[usize], scatter: &mut [DMatrix<Complex<f64>>]) {
        if self.periods == 1 {
            return;
        }
        let plan = transform::forward(self.samples.nrows());
        let mut input = plan.make_input_vec();
        let mut spectrum = |samples: &[f64]| {
            let mut output = plan.make_output_vec();
            input.copy_from_slice(samples);
            plan.process(&mut input, &mut output).expect("buffers come from the plan");
            output
        };
        let spectra: Vec<Vec<Complex<f64>>> =
            self.samples.column_iter().map(|column| spectrum(column.as_slice())).collect();
        let periods = self.periods;
        let scale = 2.0 / self.samples.nrows() as f64;
        let mut z = DVector::zeros(spectra.len());
        for (&line, scatter) in lines.iter().zip(scatter) {
            for away in 1..=periods / 2 {
                // A line of a period is neither at zero nor at half the sampling rate, so that both
                // lines exist.
                let below = (2 * away != periods).then_some(periods * line - away);
                for at in below.into_iter().chain([periods * line + away]) {
                    for (z, spectrum) in z.iter_mut().zip(&spectra) {
                        *z = spectrum[at] * scale;
                    }
                    scatter.gerc(Complex::from(periods as f64), &z, &z, Complex::from(1.0));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_as_large_as_may_be_held() {
        for (periods, expected) in [
            (1, vec![1]),
            (2, vec![1, 1]),
            (3, vec![3]),
            (8, vec![8]),
            (16, vec![16]),
            (31, vec![16, 15]),
        ] {
            let (mut parts, mut remaining) = (Vec::new(), periods);
            while remaining > 0 {
                parts.push(periods_as_one(remaining, 100, 2));
                remaining -= parts[parts.len() - 1];
            }
            assert_eq!(parts, expected, "{periods}");
        }
        // A period has as many samples as the buffer, half as many, or a third as many.
        assert_eq!([1, 2, 3].map(|parts| periods_as_one(6, MAX_BUFFERED / parts, 1)), [1, 1, 3]);
    }
}
