//! Responses to forces that have lines of their own, on which the others act a little.

use mechid_numerics::check_size;
use nalgebra::{Complex, DVector};
use statrs::distribution::{Beta, ContinuousCDF};

use super::{Frf, FrfAverage, FrfEstimator};
use crate::SpectraError;
use crate::limits::{INTERLEAVED_CHANCE, INTERLEAVED_ROUNDING, INTERLEAVED_ROUNDS};

/// Frequency responses to forces each of which has lines of its own.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnLines {
    /// Responses to each force, motions × 1, on the lines that it drives.
    pub responses: Vec<Frf>,
    /// Crosstalk that was found, and taken off.
    pub crosstalk: Vec<Crosstalk>,
}

/// Amplitude of a force on the lines of another one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crosstalk {
    /// Force that acts on lines of another one, counted from 0.
    pub force: usize,
    /// Force that drives these lines, counted from 0.
    pub driver: usize,
    /// Root mean square of the ratio of their amplitudes, a pure number.
    pub share: f64,
}

impl OwnLines {
    /// Responses from averages of all forces, one average over the lines of each force in turn.
    ///
    /// Another force that has more in common with the driver of a line than noise of its channel might acts on the
    /// machine there: its part of the response is taken off, with the responses to it interpolated between its own
    /// lines. The error that the interpolation may have is added to the variance.
    ///
    /// # Errors
    /// [`NumericsError::Size`](mechid_numerics::NumericsError::Size) unless there is an average of all forces for each of them, and as [`FrfAverage::frf`].
    ///
    /// # Source
    /// Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed. (2012), section 2.7
    /// (multisines on interleaved lines); Goodman (1957) for the coherence of no signal; the limits are ours.
    pub fn of(own: &[FrfAverage], estimator: FrfEstimator) -> Result<Self, SpectraError> {
        let (mut raw, mut crosstalk, mut couplings) = (Vec::new(), Vec::new(), Vec::new());
        for (driver, average) in own.iter().enumerate() {
            check_size("channels of the force", own.len(), average.inputs)?;
            raw.push(average.of_inputs(&[driver]).frf(estimator)?);
            for force in (0..own.len()).filter(|force| *force != driver) {
                if let Some(coupling) = Coupling::found(average, force, driver) {
                    crosstalk.push(Crosstalk { force, driver, share: coupling.share() });
                    couplings.push(coupling);
                }
            }
        }
        let mut responses = raw.clone();
        for _ in 0..INTERLEAVED_ROUNDS {
            let mut next = raw.clone();
            for coupling in &couplings {
                coupling.take_off(&responses[coupling.force], &mut next[coupling.driver]);
            }
            responses = next;
        }
        if !couplings.is_empty() {
            // The covariances of all lines together are those of the responses before.
            responses.iter_mut().for_each(|frf| frf.scatter = None);
        }
        Ok(Self { responses, crosstalk })
    }
}

/// A force on the lines of another one.
struct Coupling {
    force: usize,
    driver: usize,
    /// Ratio of the amplitudes on each line.
    ratio: Vec<Complex<f64>>,
}

impl Coupling {
    /// Finds what a force has in common with the driver of the lines; `None` if it may be noise.
    fn found(average: &FrfAverage, force: usize, driver: usize) -> Option<Self> {
        let (mut common, mut left) = (0.0, 0.0);
        let mut ratio = Vec::with_capacity(average.sums.len());
        for sum in &average.sums {
            let of_line = sum.force_ratio(force, driver);
            let shared = of_line.norm_sqr() * sum.force_power(driver);
            common += shared;
            left += (sum.force_power(force) - shared).max(0.0);
            ratio.push(of_line);
        }
        let found = Self { force, driver, ratio };
        let (lines, spare) = (average.sums.len() as f64, average.pieces.saturating_sub(1) as f64);
        // The part that noise has in common with the driver is a beta variate.
        let by_chance = Beta::new(lines, lines * spare).ok()?.sf(common / (common + left));
        (by_chance < INTERLEAVED_CHANCE && found.share() > INTERLEAVED_ROUNDING).then_some(found)
    }

    fn share(&self) -> f64 {
        let sum: f64 = self.ratio.iter().map(|ratio| ratio.norm_sqr()).sum();
        (sum / self.ratio.len() as f64).sqrt()
    }

    /// Takes the part of the force off the responses to the driver.
    fn take_off(&self, of_force: &Frf, of_driver: &mut Frf) {
        for (at, ratio) in self.ratio.iter().enumerate() {
            let there = Between::at(of_force, of_driver.lines[at]);
            let response = &mut of_driver.response[at];
            let variance = &mut of_driver.variance[at];
            for motion in 0..response.nrows() {
                response[(motion, 0)] -= ratio * there.response[motion];
                let missed = there.variance[motion] + there.missed[motion].powi(2);
                variance[(motion, 0)] += ratio.norm_sqr() * missed;
            }
        }
    }
}

/// Responses at a line between those of a force.
struct Between {
    response: DVector<Complex<f64>>,
    variance: DVector<f64>,
    /// Error that the interpolation may have: that of a line twice as long between neighbours of those here, which
    /// is as large where the machine resonates between two lines, and four times as large elsewhere.
    missed: DVector<f64>,
}

impl Between {
    /// A straight line between the neighbours; beyond the ends the nearest.
    fn at(frf: &Frf, line: usize) -> Self {
        let (lines, value) = (&frf.lines, |at: usize| frf.response[at].column(0));
        let last = lines.len() - 1;
        let after = lines.partition_point(|own| *own < line);
        let variance = |at: usize| frf.variance[at].column(0).into_owned();
        let lengths = |vector: DVector<Complex<f64>>| vector.map(|z| z.norm());
        if last == 0 {
            let response = value(0).into_owned();
            return Self { missed: lengths(response.clone()), response, variance: variance(0) };
        }
        if after == 0 || after > last {
            let (end, next) = if after == 0 { (0, 1) } else { (last, last - 1) };
            return Self {
                response: value(end).into_owned(),
                variance: variance(end),
                missed: lengths(value(end) - value(next)),
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
        let missed = inside.map(apart).reduce(|a, b| a.sup(&b));
        Self {
            response: straight(before, after, line),
            variance: variance(before).sup(&variance(after)),
            missed: missed.unwrap_or_else(|| lengths(value(after) - value(before))),
        }
    }
}
