//! Cross-spectra of force and response, averaged over segments of records of any length.

use mechid_model::ResponseQuantity;
use mechid_numerics::{NumericsError, check_size};
use mechid_signal::Record;
use nalgebra::DMatrix;

use super::cross_spectra::CrossSpectra;
use super::scatter::Scatter;
use super::segments::weigh;
use super::{ComplexMatrix, Crosstalk, Frf, FrfEstimator, Segments};
use crate::SpectraError;
use crate::limits::{
    AVERAGE_IDLE, AVERAGE_PEAK, AVERAGE_STRETCH, AVERAGE_WEAK, LARGEST_EVIDENCE, MEAN_EVIDENCE,
};
use crate::lines::{Lines, check_sampling};

/// Sums for the estimation of frequency responses, added segment by segment; the memory does not
/// grow with the record.
#[derive(Debug, Clone)]
pub struct FrfAverage {
    lines: Lines,
    pub(super) inputs: usize,
    outputs: usize,
    measured: ResponseQuantity,
    segments: Segments,
    weights: Option<Vec<f64>>,
    pub(super) pieces: usize,
    /// Sums of cross-spectra, one entry per line.
    pub(super) sums: Vec<CrossSpectra>,
}

impl FrfAverage {
    /// Creates an average without segments, for this many forces and responses; `lines` are the
    /// lines of a segment.
    ///
    /// # Errors
    /// [`SpectraError::Hop`], and [`NumericsError::Size`] if the lines belong to records of another
    /// length than a segment.
    pub fn new(
        lines: Lines,
        [inputs, outputs]: [usize; 2],
        measured: ResponseQuantity,
        segments: Segments,
    ) -> Result<Self, SpectraError> {
        let (expected, got) = (segments.samples(), lines.sampling().len());
        check_size("samples of a segment", expected, got)?;
        let weights = segments.weights()?;
        let sums = vec![CrossSpectra::new(inputs, outputs); lines.as_slice().len()];
        Ok(Self { lines, inputs, outputs, measured, segments, weights, pieces: 0, sums })
    }

    /// Adds every whole segment of a part of the records of force (N) and response; the first
    /// segment begins at the first sample of the part. The next part must begin with the next
    /// segment: [`Segments::hop`] samples after the beginning of the last whole segment.
    ///
    /// # Errors
    /// [`SpectraError::Signal`] if the time axes of the records differ or their time step differs
    /// from the time step of the lines, [`NumericsError::Size`] for another number of channels.
    ///
    /// # Source
    /// Welch (1967), IEEE Trans. Audio Electroacoustics 15, 70–73.
    pub fn push(&mut self, force: &Record, motion: &Record) -> Result<(), SpectraError> {
        force.check_same_sampling(motion)?;
        check_size("channels of the force", self.inputs, force.channels())?;
        check_size("channels of the motion", self.outputs, motion.channels())?;
        let len = self.segments.samples();
        if force.len() < len {
            return Ok(());
        }
        check_sampling(self.lines.sampling(), force.sampling().with_len(len)?)?;
        let mut reader = self.lines.reader();
        let amplitudes = |channels| ComplexMatrix::zeros(self.sums.len(), channels);
        let (mut forces, mut motions) = (amplitudes(self.inputs), amplitudes(self.outputs));
        for piece in 0..=(force.len() - len) / self.segments.hop() {
            let start = piece * self.segments.hop();
            for (record, amplitudes) in [(force, &mut forces), (motion, &mut motions)] {
                for (channel, mut column) in amplitudes.column_iter_mut().enumerate() {
                    let samples = &record.channel(channel)[start..start + len];
                    let weights = self.weights.as_deref();
                    reader.read(|input| weigh(samples, weights, input), column.iter_mut());
                }
            }
            for (line, sum) in self.sums.iter_mut().enumerate() {
                sum.add(&forces.row(line), &motions.row(line));
            }
            self.pieces += 1;
        }
        Ok(())
    }

    /// Adds all segments of another average with the same lines, channels and segment settings,
    /// such as that of another record of the same system.
    ///
    /// # Errors
    /// [`NumericsError::Size`] if the other average has other channels or lines.
    ///
    /// # Source
    /// As [`FrfAverage::push`].
    pub fn merge(&mut self, other: &Self) -> Result<(), SpectraError> {
        let size = check_size;
        size("channels of the force", self.inputs, other.inputs)?;
        size("channels of the motion", self.outputs, other.outputs)?;
        size("lines of a segment", self.sums.len(), other.sums.len())?;
        for (sum, other) in self.sums.iter_mut().zip(&other.sums) {
            sum.merge(other);
        }
        self.pieces += other.pieces;
        Ok(())
    }

    /// Number of segments so far.
    pub fn pieces(&self) -> usize {
        self.pieces
    }

    /// Returns the force channels, counted from 0, that contain only noise: they are weaker than a
    /// tenth of the strongest force, and are not coherent with another force or a response on any
    /// line. Such channels come from shakers or points without a force; if they were used as
    /// forces, they would seem to have no effect: the responses to them would be biased towards
    /// zero.
    ///
    /// # Source
    /// Goodman (1957), *On the joint estimation of the spectra, cospectrum and quadrature spectrum
    /// of a two-dimensional stationary Gaussian process*, for the distribution of a coherence
    /// without a signal; the limits are ours.
    pub fn idle_inputs(&self) -> Vec<usize> {
        let averages = self.averages();
        if self.inputs < 2 || averages <= self.inputs as f64 {
            return Vec::new();
        }
        let powers: Vec<f64> = (0..self.inputs).map(|input| self.power(input)).collect();
        let strongest = powers.iter().copied().fold(0.0, f64::max);
        let is_weak = |input: &usize| powers[*input] < AVERAGE_IDLE * AVERAGE_IDLE * strongest;
        (0..self.inputs).filter(is_weak).filter(|input| self.is_idle(*input, averages)).collect()
    }

    /// Returns the force channels that are coherent with a stronger force: the independent part of
    /// such a channel is weaker than a tenth of the strongest force, and no response is coherent
    /// with this part. The records cannot separate the effect of such a channel from the effect of
    /// the stronger force; the estimated responses to it would be responses to the noise of the
    /// channel.
    ///
    /// # Source
    /// As [`FrfAverage::idle_inputs`].
    pub fn following_inputs(&self) -> Vec<Crosstalk> {
        let mut acting: Vec<usize> = (0..self.inputs).collect();
        let mut following = Vec::new();
        while acting.len() > 1 && self.averages() > acting.len() as f64 {
            let average = self.with_inputs(&acting);
            let Some(weakest) = average.weakest_follower() else { break };
            let force = acting.remove(weakest);
            following.push(self.crosstalk(force, &acting));
        }
        following
    }

    /// Returns the force with the weakest independent part, if this part is weak and no response is
    /// coherent with the part.
    fn weakest_follower(&self) -> Option<usize> {
        let (averages, mut own) = (self.averages(), vec![0.0; self.inputs]);
        for sum in &self.sums {
            let inverse = sum.inverse_force(0.0).ok()?;
            own.iter_mut().enumerate().for_each(|(i, own)| *own += inverse[(i, i)].re.recip());
        }
        let weakest = (0..self.inputs).min_by(|i, j| own[*i].total_cmp(&own[*j]))?;
        let strongest = (0..self.inputs).map(|input| self.power(input)).fold(0.0, f64::max);
        let evidence = |sum: &CrossSpectra| sum.evidence_of_motion(weakest, averages);
        let is_weak = own[weakest] < AVERAGE_IDLE * AVERAGE_IDLE * strongest;
        (is_weak && shows_nothing(self.sums.iter().map(evidence))).then_some(weakest)
    }

    /// Returns the force among `others` with which a force is most coherent.
    fn crosstalk(&self, force: usize, others: &[usize]) -> Crosstalk {
        let shared = |driver: usize| -> f64 {
            let of_line = |sum: &CrossSpectra| {
                sum.force_ratio(force, driver).norm_sqr() * sum.force_power(driver)
            };
            self.sums.iter().map(of_line).sum()
        };
        let most = others.iter().copied().max_by(|i, j| shared(*i).total_cmp(&shared(*j)));
        let driver = most.unwrap_or(force);
        Crosstalk { force, driver, share: (shared(driver) / self.power(driver)).sqrt() }
    }

    fn power(&self, input: usize) -> f64 {
        self.sums.iter().map(|sum| sum.force_power(input)).sum()
    }

    /// Returns whether a force is coherent with no response and no other force.
    fn is_idle(&self, input: usize, averages: f64) -> bool {
        shows_nothing(self.sums.iter().map(|sum| {
            let of_forces = sum.evidence_of_forces(input, averages)?;
            let mut evidence = sum.evidence_of_motion(input, averages)?;
            evidence.push(of_forces);
            Some(evidence)
        }))
    }

    /// Returns the indices of the excited lines, counted from 0.
    ///
    /// A line counts as not excited if two conditions are met: the power of every force on this
    /// line is less than a hundredth of the power on the strongest line of the same force, and no
    /// response is coherent with a force on eight neighbouring lines. On such lines the force
    /// channels contain only noise, and the estimated responses would be responses to noise. The
    /// whole range of weak lines around these eight lines is excluded. Because of leakage, a few
    /// further lines on either side are excluded, too: half the width of the peak of a window. If
    /// no line would remain, all lines are returned.
    /// # Source
    /// The coherence is the same as in [`FrfAverage::idle_inputs`]; the limits are ours.
    pub fn driven(&self) -> Vec<usize> {
        let (count, averages) = (self.sums.len(), self.averages());
        let all_lines = || (0..count).collect();
        if averages <= self.inputs as f64 {
            return all_lines();
        }
        let strongest =
            |input: usize| self.sums.iter().map(|sum| sum.force_power(input)).fold(0.0, f64::max);
        let limits: Vec<f64> =
            (0..self.inputs).map(|input| AVERAGE_WEAK * strongest(input)).collect();
        let is_weak = |sum: &CrossSpectra| {
            limits.iter().enumerate().all(|(input, limit)| sum.force_power(input) < *limit)
        };
        let weak: Vec<bool> = self.sums.iter().map(is_weak).collect();
        let evidence = |place: usize| -> (f64, f64) {
            let of = |input| self.sums[place].evidence_of_motion(input, averages);
            let values = (0..self.inputs).filter_map(of).flatten();
            values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0))
        };
        let shown: Vec<(f64, f64)> =
            (0..count).map(|at| if weak[at] { evidence(at) } else { (0.0, 0.0) }).collect();
        let mut undriven = vec![false; count];
        for first in 0..(count + 1).saturating_sub(AVERAGE_STRETCH) {
            let stretch = first..first + AVERAGE_STRETCH;
            let (sum, number) = shown[stretch.clone()]
                .iter()
                .fold((0.0, 0.0), |total, one| (total.0 + one.0, total.1 + one.1));
            if weak[stretch.clone()].iter().all(|weak| *weak) && sum <= MEAN_EVIDENCE * number {
                undriven[stretch].fill(true);
            }
        }
        let mut left_out = vec![false; count];
        let mut first = 0;
        for run in weak.chunk_by(|a, b| a == b) {
            let run = first..first + run.len();
            first = run.end;
            if undriven[run.clone()].contains(&true) {
                left_out
                    [run.start.saturating_sub(AVERAGE_PEAK)..(run.end + AVERAGE_PEAK).min(count)]
                    .fill(true);
            }
        }
        let driven: Vec<usize> = (0..count).filter(|at| !left_out[*at]).collect();
        if driven.is_empty() { all_lines() } else { driven }
    }

    /// Returns the same average restricted to some of the lines, given by their indices, counted
    /// from 0.
    ///
    /// # Errors
    /// As [`Lines::new`].
    ///
    /// # Panics
    /// If there is no such line.
    pub fn at(&self, places: &[usize]) -> Result<Self, SpectraError> {
        let lines = places.iter().map(|at| self.lines.as_slice()[*at]);
        let lines = Lines::new(self.lines.sampling(), lines)?;
        let sums = places.iter().map(|at| self.sums[*at].clone()).collect();
        Ok(Self { lines, sums, ..self.clone() })
    }

    /// Returns the lines of a segment.
    pub fn lines(&self) -> &Lines {
        &self.lines
    }

    /// Returns whether any response is coherent with any force, for this number of independent
    /// averages (a pure number).
    pub fn response_follows(&self, averages: f64) -> bool {
        let follows = |input: usize| {
            let values =
                self.sums.iter().filter_map(|s| s.evidence_of_motion(input, averages)).flatten();
            let (sum, count) =
                values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
            sum > MEAN_EVIDENCE * count
        };
        averages > self.inputs as f64 && (0..self.inputs).any(follows)
    }

    /// Returns the same average restricted to some of the force channels, counted from 0.
    ///
    /// # Panics
    /// If there is no such channel.
    #[must_use]
    pub fn with_inputs(&self, inputs: &[usize]) -> Self {
        let sums = self.sums.iter().map(|sum| sum.select_inputs(inputs)).collect();
        Self { inputs: inputs.len(), sums, ..self.clone() }
    }

    /// Returns the equivalent number of independent segments.
    fn averages(&self) -> f64 {
        self.segments.averages_under(self.weights.as_deref(), self.pieces)
    }

    /// Returns the frequency responses from all segments so far.
    ///
    /// # Errors
    /// As [`Frf::estimate`].
    ///
    /// # Source
    /// Bendat & Piersol, *Random Data*, 4th ed. (2010), chapters 6, 7 and 9; Welch (1967).
    pub fn frf(&self, estimator: FrfEstimator) -> Result<Frf, SpectraError> {
        let (inputs, outputs) = (self.inputs, self.outputs);
        if estimator == FrfEstimator::H2 && inputs > 1 && inputs != outputs {
            let what = "channels of the motion, for H2";
            return Err(NumericsError::Size { what, expected: inputs, got: outputs }.into());
        }
        if self.pieces <= inputs {
            return Err(SpectraError::TooFewAverages { got: self.pieces, needed: inputs + 1 });
        }
        let omega = self.lines.omega();
        let mut frf = Frf {
            line_correlation: self.segments.line_correlation(self.pieces),
            lines: self.lines.as_slice().to_vec(),
            response: Vec::with_capacity(omega.len()),
            coherence: DMatrix::zeros(omega.len(), outputs),
            variance: Vec::with_capacity(omega.len()),
            omega,
            measured: self.measured,
            averages: self.averages(),
            scatter: None,
        };
        let (mut unexplained, mut inverse) = (Vec::new(), Vec::new());
        for (line, sum) in self.sums.iter().enumerate() {
            let [left, of_force] = frf.push_line(line, &sum.mean(self.pieces), estimator)?;
            unexplained.push(left);
            inverse.push(of_force);
        }
        frf.scatter = Some(Scatter::new(&frf, unexplained, inverse, self.segments));
        Ok(frf)
    }
}

/// Returns whether the mean and the largest of the values −ln p are plausible without coherence;
/// `false` if a value is unknown. Without coherence each value is exponentially distributed.
fn shows_nothing(evidence: impl Iterator<Item = Option<Vec<f64>>>) -> bool {
    let (mut sum, mut largest, mut count) = (0.0, 0.0_f64, 0.0);
    for of_line in evidence {
        let Some(of_line) = of_line else { return false };
        for value in of_line {
            sum += value;
            largest = largest.max(value);
            count += 1.0;
        }
    }
    sum <= MEAN_EVIDENCE * count && largest <= LARGEST_EVIDENCE + f64::ln(count)
}
