//! Periodograms of the lines of a band, pooled where the spectrum hardly changes from line to line.

use std::ops::Range;

use nalgebra::{Complex, DMatrix};
use rayon::prelude::*;

use super::likelihood::{noise, positive_factor};
use super::limits::MAX_POOLING_CHANGE;
use super::parameters::{Parameters, Span};
use super::spectrum::Coefficients;
use super::transient::Transient;

/// Maximum width of pooled lines, as a fraction of the band. Far from the poles this limit is
/// needed because the noise varies with frequency.
const WIDEST: f64 = 0.02;

/// Lines of one record in a band, without the excluded lines.
#[derive(Debug, Clone)]
pub(super) struct BandLines {
    /// Angular frequencies, in rad/s.
    pub omega: Vec<f64>,
    /// Amplitudes of the unitary Fourier transform, lines × outputs, each output divided by its RMS
    /// value in the band.
    pub amplitudes: DMatrix<Complex<f64>>,
    /// RMS value of each output in the band.
    pub scale: Vec<f64>,
    /// Time axis of the record; its duration is infinite if the transient was subtracted.
    pub span: Span,
    /// Remaining uncertainty of the transient, if it was subtracted.
    pub transient: Option<Transient>,
}

/// Neighbouring lines with their mean periodogram.
#[derive(Debug, Clone)]
pub(super) struct PooledLines {
    /// Mean angular frequency, in rad/s.
    pub omega: f64,
    /// Number of lines.
    pub count: f64,
    /// Values of the Chebyshev polynomials of the noise at this frequency.
    pub terms: Vec<f64>,
    /// Mean of Y Yᴴ.
    pub periodogram: DMatrix<Complex<f64>>,
}

impl BandLines {
    pub fn outputs(&self) -> usize {
        self.amplitudes.ncols()
    }

    /// Returns the distance between two lines, in rad/s.
    pub fn spacing(&self) -> f64 {
        std::f64::consts::TAU / self.span.duration
    }

    /// Returns the values of the Chebyshev polynomials over the band at `omega`.
    pub fn noise_terms(&self, omega: f64, count: usize) -> Vec<f64> {
        let (first, last) = (self.omega[0], self.omega[self.omega.len() - 1]);
        let x = if last > first { 2.0 * (omega - first) / (last - first) - 1.0 } else { 0.0 };
        let mut terms = vec![1.0, x];
        while terms.len() < count {
            terms.push(2.0 * x * terms[terms.len() - 1] - terms[terms.len() - 2]);
        }
        terms.truncate(count);
        terms
    }

    /// Pools lines over the fraction `part` of their distance to the nearest of the `poles`, or to
    /// zero frequency. At zero frequency the spectrum of an acceleration has a zero: with little
    /// noise, the spectrum changes there by orders of magnitude from line to line.
    pub fn pooled(
        &self,
        poles: &[Complex<f64>],
        part: f64,
        noise_terms: usize,
    ) -> Vec<PooledLines> {
        let ranges = self.ranges(poles, part).into_iter();
        ranges.map(|range| self.pool(range, noise_terms)).collect()
    }

    /// Pools lines as [`Self::pooled`] does, but divides a group in halves while the spectrum of
    /// the parameters changes too much in the group.
    ///
    /// A change that is small relative to the resonances can be large relative to the noise.
    pub fn pooled_evenly(&self, parameters: &Parameters, part: f64) -> Vec<PooledLines> {
        let coefficients = Coefficients::new(parameters);
        let terms = parameters.layout.noise_terms;
        let divided = |range: Range<usize>| {
            let mut open = vec![range];
            let mut even = Vec::new();
            while let Some(range) = open.pop() {
                if range.len() == 1 || self.is_even(&range, parameters, &coefficients) {
                    even.push(range);
                } else {
                    let middle = range.start + range.len() / 2;
                    open.push(middle..range.end);
                    open.push(range.start..middle);
                }
            }
            even.into_iter().map(|range| self.pool(range, terms)).collect::<Vec<_>>()
        };
        self.ranges(&parameters.poles(), part).into_par_iter().flat_map_iter(divided).collect()
    }

    /// Returns whether the mean spectrum of a group of lines is close to the spectrum at the centre
    /// of the group, also in the directions in which the spectrum is smallest.
    fn is_even(
        &self,
        range: &Range<usize>,
        parameters: &Parameters,
        coefficients: &Coefficients,
    ) -> bool {
        let [first, last] = [self.omega[range.start], self.omega[range.end - 1]];
        let [first, centre, last] = [first, 0.5 * (first + last), last].map(|omega| {
            let terms = self.noise_terms(omega, parameters.layout.noise_terms);
            let kernels = coefficients.kernels(omega, self.span);
            coefficients.spectrum(&kernels, &noise(parameters, &terms))
        });
        // Mean of a parabola over n points, as a fraction of its change from the centre to the
        // ends.
        let count = range.len() as f64;
        let share = (count + 1.0) / (3.0 * (count - 1.0));
        let change = ((first + last) * Complex::from(0.5) - &centre) * Complex::from(share);
        let Some(lower) = positive_factor(centre).map(|factor| factor.unpack()) else {
            return false;
        };
        let whitened = lower
            .solve_lower_triangular(&change)
            .and_then(|half| lower.solve_lower_triangular(&half.adjoint()));
        whitened.is_some_and(|whitened| whitened.norm() < MAX_POOLING_CHANGE)
    }

    /// Returns groups of neighbouring lines, see [`Self::pooled`].
    fn ranges(&self, poles: &[Complex<f64>], part: f64) -> Vec<Range<usize>> {
        let whole = self.omega[self.omega.len() - 1] - self.omega[0];
        let distance = |omega: f64| {
            let to = |pole: &Complex<f64>| (Complex::new(0.0, omega) - pole).norm();
            poles.iter().map(to).fold(omega.min(whole), f64::min)
        };
        let mut ranges = Vec::new();
        let mut first = 0;
        while first < self.omega.len() {
            let width = (part * distance(self.omega[first])).min(WIDEST * whole);
            let ahead = self.omega[first..].iter().take_while(|w| **w - self.omega[first] < width);
            let count = ahead.count().max(1);
            ranges.push(first..first + count);
            first += count;
        }
        ranges
    }

    fn pool(&self, range: Range<usize>, noise_terms: usize) -> PooledLines {
        let count = range.len();
        let rows = self.amplitudes.rows(range.start, count);
        let total = rows.transpose() * rows.conjugate();
        let omega = self.omega[range].iter().sum::<f64>() / count as f64;
        let mut periodogram = total / Complex::from(count as f64);
        if let Some(transient) = &self.transient {
            periodogram += transient.power(omega);
        }
        PooledLines {
            omega,
            count: count as f64,
            terms: self.noise_terms(omega, noise_terms),
            periodogram,
        }
    }
}
