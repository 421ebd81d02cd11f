//! Times, and the power of the size with which they grow.

use std::hint::black_box;
use std::time::Instant;

/// Growth of a time with the size of its task.
#[derive(Debug, Clone)]
pub struct Growth {
    /// Name of the task.
    pub name: &'static str,
    /// Sizes, pure numbers.
    pub sizes: Vec<f64>,
    /// Shortest time at each size, in s.
    pub seconds: Vec<f64>,
}

impl Growth {
    pub fn new(name: &'static str) -> Self {
        Self { name, sizes: Vec::new(), seconds: Vec::new() }
    }

    pub fn push(&mut self, size: usize, seconds: f64) {
        self.sizes.push(size as f64);
        self.seconds.push(seconds);
    }

    /// Returns the exponent p of the time, which grows as size^p, by least squares on the
    /// logarithms. Only the larger half of the sizes is used, but at least three: at small sizes,
    /// other costs dominate.
    pub fn slope(&self) -> f64 {
        let from = self.sizes.len() - (self.sizes.len() / 2 + 1).max(3).min(self.sizes.len());
        let logs = |values: &[f64]| values[from..].iter().map(|v| v.ln()).collect::<Vec<_>>();
        let (x, y) = (logs(&self.sizes), logs(&self.seconds));
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let (x_mean, y_mean) = (mean(&x), mean(&y));
        let square: f64 = x.iter().map(|x| (x - x_mean).powi(2)).sum();
        let product: f64 = x.iter().zip(&y).map(|(x, y)| (x - x_mean) * (y - y_mean)).sum();
        product / square
    }

    /// The growth as a power, such as `n^1.0`.
    pub fn power(&self) -> String {
        format!("n^{:.1}", self.slope())
    }
}

/// Returns the time of the shortest of several runs, in s. The runs are repeated for about
/// `seconds`, but at least three times.
pub fn shortest<T>(seconds: f64, mut run: impl FnMut() -> T) -> f64 {
    let begin = Instant::now();
    let mut shortest = f64::INFINITY;
    for turn in 0..10_000 {
        let start = Instant::now();
        black_box(run());
        shortest = shortest.min(start.elapsed().as_secs_f64());
        if turn >= 2 && begin.elapsed().as_secs_f64() > seconds {
            break;
        }
    }
    shortest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slope_is_that_of_the_larger_sizes() {
        let mut growth = Growth::new("a cube with a constant cost");
        for size in [1, 10, 100, 1000, 10_000] {
            growth.push(size, 1.0 + 1e-3 * (size as f64).powi(3));
        }
        assert!((growth.slope() - 3.0).abs() < 1e-3);
        assert_eq!(growth.power(), "n^3.0");
    }
}
