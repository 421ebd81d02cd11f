//! Means of the covariances of neighbouring lines.

use std::ops::Range;

use nalgebra::{Complex, DMatrix, DVector};

use super::{Covariances, misfit, window};

/// Covariances of lines by rising frequency, of which neighbours are added.
pub(super) struct Neighbours {
    /// Entries of each covariance, entries × lines.
    samples: DMatrix<Complex<f64>>,
    channels: usize,
}

impl Neighbours {
    pub(super) fn new(covariance: &[DMatrix<Complex<f64>>]) -> Self {
        let channels = covariance.first().map_or(0, DMatrix::nrows);
        let mut samples = DMatrix::zeros(channels * channels, covariance.len());
        for (mut column, one) in samples.column_iter_mut().zip(covariance) {
            column.copy_from_slice(one.as_slice());
        }
        Self { samples, channels }
    }

    /// Sums of `count` covariances in a row, from each line on that has so many: of one, two, four … lines, as
    /// many as `count` is made of, so that nothing is taken away again.
    fn sums(&self, count: usize) -> DMatrix<Complex<f64>> {
        let lines = self.samples.ncols();
        let mut all = DMatrix::zeros(self.samples.nrows(), lines + 1 - count);
        let (mut some, mut width, mut from) = (self.samples.clone(), 1, 0);
        while width <= count {
            if count & width != 0 {
                all += some.columns(from, all.ncols());
                from += width;
            }
            if 2 * width <= count {
                let left = some.ncols() - width;
                some = some.columns(0, left) + some.columns(width, left);
            }
            width *= 2;
        }
        all
    }

    /// Means over each line and `half_width` lines to either side, in a window as [`window`] has it.
    pub(super) fn means(&self, half_width: usize) -> Covariances {
        let lines = self.samples.ncols();
        let windows = (0..lines).map(|line| window(line, half_width, lines));
        let sums = self.sums(window(0, half_width, lines).len());
        let mean = |window: Range<usize>| {
            self.matrix(sums.column(window.start).unscale(window.len() as f64))
        };
        windows.map(mean).collect()
    }

    /// Sum of what every line costs when the mean of the others around it predicts it.
    ///
    /// # Source
    /// Stone (1974), Journal of the Royal Statistical Society B 36, 111–147.
    pub(super) fn misfit(&self, half_width: usize) -> Option<f64> {
        let lines = self.samples.ncols();
        let width = window(0, half_width, lines).len();
        let (sums, first) = (self.sums(half_width), self.ends(0..width));
        let last = self.ends(lines - width..lines);
        let mut cost = 0.0;
        for line in 0..lines {
            let window = window(line, half_width, lines);
            let others = match window.start {
                start if start + half_width == line => sums.column(start) + sums.column(line + 1),
                0 => first[0].column(line) + first[1].column(line + 1),
                start => last[0].column(line - start) + last[1].column(line + 1 - start),
            };
            let mean = self.matrix(others.unscale((window.len() - 1) as f64));
            cost += misfit(&mean, &self.matrix(self.samples.column(line).into_owned()))?;
        }
        Some(cost)
    }

    /// Sums of the covariances of some lines before each of them, and from each of them on.
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
        DMatrix::from_column_slice(self.channels, self.channels, entries.as_slice())
    }
}

#[cfg(test)]
mod tests {
    use super::super::mean;
    use super::*;

    /// Judge: sums by definition, line by line, over powers that differ by twelve decades.
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
                cost += misfit(&predicted, &covariance[line]).unwrap();
            }
            let found = neighbours.misfit(half_width).unwrap();
            assert!(near(found, cost), "{half_width}: {found} {cost}");
        }
    }
}
