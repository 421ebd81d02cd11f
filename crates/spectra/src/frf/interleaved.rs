//! Responses to forces on interleaved lines, corrected for the crosstalk of the other forces.

use mechid_numerics::check_size;
use nalgebra::{Complex, DVector};
use statrs::distribution::{Beta, ContinuousCDF};

use super::{Frf, FrfAverage, FrfEstimator};
use crate::SpectraError;
use crate::limits::{INTERLEAVED_CHANCE, INTERLEAVED_ROUNDING, INTERLEAVED_ROUNDS};

/// Frequency responses to forces that excite interleaved lines.
#[derive(Debug, Clone, PartialEq)]
pub struct InterleavedResponses {
    /// Responses to each force, responses × 1, on the lines that this force excites.
    pub responses: Vec<Frf>,
    /// Crosstalk that was estimated and subtracted.
    pub crosstalk: Vec<Crosstalk>,
}

/// Amplitude of a force on the lines of another force.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crosstalk {
    /// Force that acts on the lines of the other force, counted from 0.
    pub force: usize,
    /// Force that excites the lines on which `force` also acts, counted from 0.
    pub driver: usize,
    /// Ratio of the amplitude of `force` to the amplitude of `driver` (RMS over the lines of
    /// `driver`), a pure number.
    pub share: f64,
}

impl InterleavedResponses {
    /// Estimates the responses from averages of all forces: one average for each force, over the
    /// lines that this force excites.
    ///
    /// The force that excites the lines is their driver. If another force is more coherent with the
    /// driver than channel noise can be, this force also acts on these lines. The response to it is
    /// interpolated between the lines that it excites, and subtracted. The possible interpolation
    /// error is added to the variance.
    ///
    /// # Errors
    /// [`NumericsError::Size`](mechid_numerics::NumericsError::Size) unless there is one average of
    /// all forces for each force, and the errors of [`FrfAverage::frf`].
    ///
    /// # Source
    /// Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed. (2012),
    /// section 2.7 (multisines on interleaved lines); Goodman (1957) for the coherence without a
    /// signal; the limits are ours.
    pub fn from_averages(
        averages: &[FrfAverage],
        estimator: FrfEstimator,
    ) -> Result<Self, SpectraError> {
        let (mut raw, mut crosstalk, mut couplings) = (Vec::new(), Vec::new(), Vec::new());
        for (driver, average) in averages.iter().enumerate() {
            check_size("channels of the force", averages.len(), average.inputs)?;
            raw.push(average.with_inputs(&[driver]).frf(estimator)?);
            for force in (0..averages.len()).filter(|force| *force != driver) {
                if let Some(coupling) = Coupling::estimate(average, force, driver) {
                    crosstalk.push(Crosstalk { force, driver, share: coupling.share() });
                    couplings.push(coupling);
                }
            }
        }
        let mut responses = raw.clone();
        for _ in 0..INTERLEAVED_ROUNDS {
            let mut next = raw.clone();
            for coupling in &couplings {
                coupling.subtract(&responses[coupling.force], &mut next[coupling.driver]);
            }
            responses = next;
        }
        if !couplings.is_empty() {
            // The covariances between lines are those before the subtraction, and are not valid any
            // more.
            responses.iter_mut().for_each(|frf| frf.scatter = None);
        }
        Ok(Self { responses, crosstalk })
    }
}

/// Crosstalk of a force on the lines of another force.
struct Coupling {
    force: usize,
    driver: usize,
    /// Ratio of the amplitude of the force to the amplitude of the driver, on each line.
    ratio: Vec<Complex<f64>>,
}

impl Coupling {
    /// Estimates the part of a force that is coherent with the driver, on the lines of the driver;
    /// `None` if this part may be noise.
    fn estimate(average: &FrfAverage, force: usize, driver: usize) -> Option<Self> {
        let (mut common, mut left) = (0.0, 0.0);
        let mut ratio = Vec::with_capacity(average.sums.len());
        for sum in &average.sums {
            let ratio_on_line = sum.force_ratio(force, driver);
            let shared = ratio_on_line.norm_sqr() * sum.force_power(driver);
            common += shared;
            left += (sum.force_power(force) - shared).max(0.0);
            ratio.push(ratio_on_line);
        }
        let coupling = Self { force, driver, ratio };
        let (lines, spare) = (average.sums.len() as f64, average.pieces.saturating_sub(1) as f64);
        // If there is only noise, the coherent fraction has a beta distribution.
        let by_chance = Beta::new(lines, lines * spare).ok()?.sf(common / (common + left));
        (by_chance < INTERLEAVED_CHANCE && coupling.share() > INTERLEAVED_ROUNDING)
            .then_some(coupling)
    }

    fn share(&self) -> f64 {
        let sum: f64 = self.ratio.iter().map(|ratio| ratio.norm_sqr()).sum();
        (sum / self.ratio.len() as f64).sqrt()
    }

    /// Subtracts the response to the force from the responses to the driver.
    fn subtract(&self, of_force: &Frf, of_driver: &mut Frf) {
        for (at, ratio) in self.ratio.iter().enumerate() {
            let there = Between::at(of_force, of_driver.lines[at]);
            let response = &mut of_driver.response[at];
            let variance = &mut of_driver.variance[at];
            for motion in 0..response.nrows() {
                response[(motion, 0)] -= ratio * there.response[motion];
                let missed = there.variance[motion] + there.interpolation_error[motion].powi(2);
                variance[(motion, 0)] += ratio.norm_sqr() * missed;
            }
        }
    }
}

/// Responses to a force, interpolated between its lines.
struct Between {
    response: DVector<Complex<f64>>,
    variance: DVector<f64>,
    /// Possible interpolation error. The line before and the line after are each interpolated
    /// between their neighbours, over twice the distance; the larger of the two errors is used. If
    /// there is a resonance between the two lines, this error has the size of the actual
    /// interpolation error; otherwise it is four times the actual error.
    interpolation_error: DVector<f64>,
}

impl Between {
    /// Interpolates linearly between the neighbouring lines; outside their range, uses the nearest
    /// line.
    fn at(frf: &Frf, line: usize) -> Self {
        let (lines, value) = (&frf.lines, |at: usize| frf.response[at].column(0));
        let last = lines.len() - 1;
        let after = lines.partition_point(|own| *own < line);
        let variance = |at: usize| frf.variance[at].column(0).into_owned();
        let lengths = |vector: DVector<Complex<f64>>| vector.map(|z| z.norm());
        if last == 0 {
            let response = value(0).into_owned();
            return Self {
                interpolation_error: lengths(response.clone()),
                response,
                variance: variance(0),
            };
        }
        if after == 0 || after > last {
            let (end, next) = if after == 0 { (0, 1) } else { (last, last - 1) };
            return Self {
                response: value(end).into_owned(),
                variance: variance(end),
                interpolation_error: lengths(value(end) - value(next)),
            };
        }
        let straight = |from: usize, to: usize, line: usize| {
            let part = (line - lines[from]) as f64 / (lines[to] - lines[from]) as f64;
            value(from).map(|z| z.scale(1.0 - part)) + value(to).map(|z| z.scale(part))
        };
        let before = after - 1;
        let apart = |middle: usize| {
            lengths(straight(middle - 1, middle + 1, lines[middle]) - value(middle))
        };
        let inside = [before, after].into_iter().filter(|at| (1..last).contains(at));
        let interpolation_error = inside.map(apart).reduce(|a, b| a.sup(&b));
        Self {
            response: straight(before, after, line),
            variance: variance(before).sup(&variance(after)),
            interpolation_error: interpolation_error
                .unwrap_or_else(|| lengths(value(after) - value(before))),
        }
    }
}
