//! Scatter of the periods of a channel.

/// Scatter of the periods of a channel about their mean.
#[derive(Debug, Clone, Copy)]
pub struct Scatter {
    /// Standard deviation, in the SI unit of the channel.
    pub deviation: f64,
    /// Correlation between successive samples of the scatter; 0 for white noise.
    pub correlation: f64,
}

/// Running sums over the periods of a channel.
#[derive(Debug, Clone, Default)]
pub struct Sums {
    squares: f64,
    /// Sum of the products of successive samples of a period.
    products: f64,
    last: f64,
}

impl Sums {
    /// Adds the next samples, all of one period.
    pub fn push(&mut self, samples: impl Iterator<Item = f64>, begins_period: bool) {
        if begins_period {
            self.last = 0.0;
        }
        for value in samples {
            self.squares += value * value;
            self.products += self.last * value;
            self.last = value;
        }
    }

    /// Returns the scatter about the mean of `periods` periods.
    pub fn about(&self, mean: &[f64], periods: usize) -> Scatter {
        let count = periods as f64;
        let in_mean: f64 = mean.iter().map(|m| m * m).sum();
        let beside: f64 = mean.windows(2).map(|w| w[0] * w[1]).sum();
        let squares = (self.squares - count * in_mean).max(0.0);
        let freedom = ((periods - 1) * mean.len()) as f64;
        Scatter {
            deviation: (squares / freedom).sqrt(),
            correlation: (self.products - count * beside) / squares,
        }
    }
}
