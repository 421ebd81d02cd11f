//! Means of the covariances of neighbouring lines.

use std::ops::Range;

use nalgebra::{Complex, DMatrix, DVector};

use super::{Covariances, independent_cost, is_diagonal, sample_cost, window};

/// Covariances of lines in rising order of frequency, prepared for sums over neighbours.
pub(super) struct Neighbours {
    /// Entries of each covariance, entries × lines: all entries, or only those of the diagonals if
    /// no channels are correlated.
    samples: DMatrix<Complex<f64>>,
    channels: usize,
}

impl Neighbours {
    pub(super) fn new(covariance: &[DMatrix<Complex<f64>>]) -> Self {
        let channels = covariance.first().map_or(0, DMatrix::nrows);
        let is_diagonal = covariance.iter().all(is_diagonal);
        let entries = if is_diagonal { channels } else { channels * channels };
        let mut samples = DMatrix::zeros(entries, covariance.len());
        for (mut column, one) in samples.column_iter_mut().zip(covariance) {
            if is_diagonal {
                column.copy_from(&one.diagonal());
            } else {
                column.copy_from_slice(one.as_slice());
            }
        }
        Self { samples, channels }
    }

    /// Returns minus the log-likelihood, per complex deviation, of the covariance with the entries
    /// `model`, given the sample covariance of a line; `None` if the model is singular.
    fn cost_of(&self, model: DVector<Complex<f64>>, line: usize) -> Option<f64> {
        let sample = self.samples.column(line);
        if self.samples.nrows() == self.channels {
            let pairs =
                model.iter().zip(sample.iter()).map(|(model, sample)| (model.re, sample.re));
            return independent_cost(pairs);
        }
        sample_cost(&self.matrix(model), &self.matrix(sample.into_owned()))
    }

    /// Returns, for each line, the sum of `count` consecutive covariances, beginning with the
    /// covariance of this line. The sums are combined from sums of 1, 2, 4 … lines according to the
    /// binary digits of `count`, because the subtraction of running sums would lose digits.
    fn sums(&self, count: usize) -> DMatrix<Complex<f64>> {
        let lines = self.samples.ncols();
        let mut total = DMatrix::zeros(self.samples.nrows(), lines + 1 - count);
        let (mut some, mut width, mut from) = (self.samples.clone(), 1, 0);
        while width <= count {
            if count & width != 0 {
                total += some.columns(from, total.ncols());
                from += width;
            }
            if 2 * width <= count {
                let lines_with_next = some.ncols() - width;
                some = some.columns(0, lines_with_next) + some.columns(width, lines_with_next);
            }
            width *= 2;
        }
        total
    }

    /// Returns, for each line, the mean over the [`window`] of the line, with `half_width` lines on
    /// either side.
    pub(super) fn means(&self, half_width: usize) -> Covariances {
        let lines = self.samples.ncols();
        let windows = (0..lines).map(|line| window(line, half_width, lines));
        let sums = self.sums(window(0, half_width, lines).len());
        let mean = |window: Range<usize>| {
            self.matrix(sums.column(window.start).unscale(window.len() as f64))
        };
        windows.map(mean).collect()
    }

    /// Returns the cost of prediction, summed over all lines: the covariance of each line is
    /// predicted by the mean covariance of the other lines in its window. `None` if a predicted
    /// covariance is singular.
    ///
    /// # Source
    /// Stone (1974), Journal of the Royal Statistical Society B 36, 111–147.
    pub(super) fn cost(&self, half_width: usize) -> Option<f64> {
        let lines = self.samples.ncols();
        let width = window(0, half_width, lines).len();
        let (sums, first) = (self.sums(half_width), self.ends(0..width));
        let last = self.ends(lines - width..lines);
        let mut cost = 0.0;
        for line in 0..lines {
            let window = window(line, half_width, lines);
            let other_lines = match window.start {
                start if start + half_width == line => sums.column(start) + sums.column(line + 1),
                0 => first[0].column(line) + first[1].column(line + 1),
                start => last[0].column(line - start) + last[1].column(line + 1 - start),
            };
            cost += self.cost_of(other_lines.unscale((window.len() - 1) as f64), line)?;
        }
        Some(cost)
    }

    /// Returns two sums of covariances for each line of a range: over the lines of the range before
    /// this line, and over this line and the lines after it.
    fn ends(&self, range: Range<usize>) -> [DMatrix<Complex<f64>>; 2] {
        let (count, samples) = (range.len(), self.samples.columns_range(range));
        let [mut before, mut from] = [(); 2].map(|()| DMatrix::zeros(samples.nrows(), count + 1));
        for line in 0..count {
            let sum = before.column(line) + samples.column(line);
            before.set_column(line + 1, &sum);
            let line = count - 1 - line;
            let sum = from.column(line + 1) + samples.column(line);
            from.set_column(line, &sum);
        }
        [before, from]
    }

    fn matrix(&self, entries: DVector<Complex<f64>>) -> DMatrix<Complex<f64>> {
        if entries.len() == self.channels {
            return DMatrix::from_diagonal(&entries);
        }
        DMatrix::from_column_slice(self.channels, self.channels, entries.as_slice())
    }
}

#[cfg(test)]
mod tests {
    use super::super::mean;
    use super::*;

    /// Means over windows, and the cost of prediction, agree with sums that are computed separately
    /// for each line, although the powers of the lines differ by twelve decades.
    #[test]
    fn neighbours_are_added_as_by_definition() {
        let vary = |k: usize| (0.618_033_988_75 * k as f64).fract();
        let covariance: Covariances = (0..41)
            .map(|line| {
                let z = DVector::from_fn(4, |k, _| {
                    Complex::new(vary(8 * line + 2 * k) - 0.5, vary(8 * line + 2 * k + 1) - 0.5)
                });
                let floor = DMatrix::identity(4, 4) * Complex::from(0.1);
                let level = 10_f64.powf(12.0 * (vary(line) - 0.5));
                (&z * z.adjoint() + floor) * Complex::from(level)
            })
            .collect();
        let neighbours = Neighbours::new(&covariance);
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12 * b.abs();
        for half_width in 1..=20 {
            let each = neighbours.means(half_width).into_iter().enumerate();
            let mut cost = 0.0;
            for (line, found) in each {
                let window = window(line, half_width, covariance.len());
                let all = mean(&covariance, window.clone());
                assert!((&found - &all).norm() < 1e-12 * all.norm(), "{half_width} {line}");
                let others = window.clone().filter(|other| *other != line);
                let sum = others.fold(DMatrix::zeros(4, 4), |sum, other| sum + &covariance[other]);
                let predicted = sum.unscale((window.len() - 1) as f64);
                cost += sample_cost(&predicted, &covariance[line]).unwrap();
            }
            let found = neighbours.cost(half_width).unwrap();
            assert!(near(found, cost), "{half_width}: {found} {cost}");
        }
    }

    /// The cost of uncorrelated channels equals the sum of log det S + tr(S⁻¹Ŝ) of full matrices,
    /// computed with determinants and LU factors.
    #[test]
    fn uncorrelated_channels_have_the_cost_of_full_matrices() {
        let vary = |k: usize| (0.618_033_988_75 * k as f64).fract();
        let variances =
            |line: usize| DVector::from_fn(3, |k, _| Complex::from(0.1 + vary(3 * line + k)));
        let covariance: Covariances =
            (0..23).map(|line| DMatrix::from_diagonal(&variances(line + 1))).collect();
        let neighbours = Neighbours::new(&covariance);
        for half_width in 1..=11 {
            let by_definition = |line: usize| {
                let window = window(line, half_width, covariance.len());
                let count = (window.len() - 1) as f64;
                let others = window.filter(|other| *other != line);
                let sum = others.fold(DMatrix::zeros(3, 3), |sum, other| sum + &covariance[other]);
                let predicted = sum.unscale(count);
                let solved = predicted.clone().lu().solve(&covariance[line]).unwrap();
                predicted.determinant().re.ln() + solved.trace().re
            };
            let expected: f64 = (0..covariance.len()).map(by_definition).sum();
            let cost = neighbours.cost(half_width).unwrap();
            assert!((cost - expected).abs() < 1e-12 * expected.abs(), "{half_width}: {cost}");
        }
    }
}
