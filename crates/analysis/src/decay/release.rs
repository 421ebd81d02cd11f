//! The beginning of a free decay.

use mechid_signal::Record;

/// Part of the largest sum of squares at which the decay begins.
const LEVEL: f64 = 0.8;
/// Part of the record, at its end, over which the constants are averaged.
const REST: usize = 4;

/// Returns the last sample, counted from 0, at which the squares of all channels, each over its own power, sum
/// up to [`LEVEL`] of their largest sum or more.
///
/// That is after a pull that is let go, after the last cycles of a shaker and at the peak that an impact
/// leaves. Squares are those about the mean of the last quarter.
pub(super) fn release(record: &Record) -> usize {
    let len = record.len();
    let mut sums = vec![0.0; len];
    for channel in 0..record.channels() {
        let x = record.channel(channel);
        let largest = x.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
        if largest == 0.0 {
            continue;
        }
        let rest = &x[len - len.div_ceil(REST)..];
        let mean = rest.iter().map(|x| x / largest).sum::<f64>() / rest.len() as f64;
        let squares = || x.iter().map(|x| (x / largest - mean).powi(2));
        let power: f64 = squares().sum();
        if power > 0.0 {
            sums.iter_mut().zip(squares()).for_each(|(sum, square)| *sum += square / power);
        }
    }
    let largest = sums.iter().copied().fold(0.0, f64::max);
    sums.iter().rposition(|sum| *sum > 0.0 && *sum >= LEVEL * largest).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use mechid_signal::Sampling;

    use super::*;

    fn release_of(value: impl Fn(f64) -> f64) -> f64 {
        let sampling = Sampling::new(1e-3, 4000).unwrap();
        release(&Record::from_fn(sampling, value).unwrap()) as f64 * 1e-3
    }

    /// A decay of 10 Hz and 2 % that begins at 1 s.
    fn after(t: f64) -> f64 {
        (-0.02 * TAU * 10.0 * (t - 1.0)).exp() * (TAU * 10.0 * (t - 1.0)).cos()
    }

    #[test]
    fn the_decay_begins_where_the_response_is_let_go() {
        // At rest before, pulled before, and driven before.
        let at_rest = release_of(|t| 5.0 + if t < 1.0 { 0.0 } else { after(t) });
        let pulled = release_of(|t| if t < 1.0 { 1.0 } else { after(t) });
        let driven = release_of(|t| if t < 1.0 { (TAU * 10.0 * t).cos() } else { after(t) });
        for found in [at_rest, pulled, driven] {
            assert!((1.0..1.1).contains(&found), "{found}");
        }
        assert_eq!(release_of(|_| 0.0), 0.0);
    }
}
