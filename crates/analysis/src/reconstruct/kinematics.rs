//! Consistency of velocity with the rate of displacement, and of acceleration with the rate of
//! velocity.

use mechid_force::{Channel, Measurement};
use mechid_model::ResponseQuantity;

use crate::text::significant;

/// Two channels and their running sums; one channel should be the rate of the other.
#[derive(Debug)]
struct Pair {
    motion: usize,
    rate: usize,
    /// Sums over the steps from sample to sample: the measured change of the first channel times
    /// the integral of its rate, and the squares of the change (`changes`) and of the integral
    /// (`by_rate`).
    product: f64,
    changes: f64,
    by_rate: f64,
}

/// Consistency of displacement, velocity and acceleration channels of a record.
#[derive(Debug)]
pub struct KinematicConsistency(Vec<Pair>);

/// Minimum correlation for a comparison of magnitudes; below it noise may explain a difference.
const MIN_CORRELATION: f64 = 0.7;

/// Ratio of the integrated rate to the measured change, or its inverse, above which a remark is
/// made; the error of the trapezoidal rule alone gives such a ratio only with fewer than 2.4
/// samples per cycle.
const ANOTHER_UNIT: f64 = 3.0;

impl KinematicConsistency {
    /// Creates the pairs among these channels.
    pub fn new(channels: &[Channel]) -> Self {
        let find = |dof: usize, quantity: ResponseQuantity| {
            channels.iter().position(|c| *c == Channel { dof, quantity })
        };
        let pair = |(motion, channel): (usize, &Channel)| {
            let rate = match channel.quantity {
                ResponseQuantity::Displacement => find(channel.dof, ResponseQuantity::Velocity)?,
                ResponseQuantity::Velocity => find(channel.dof, ResponseQuantity::Acceleration)?,
                ResponseQuantity::Acceleration => return None,
            };
            Some(Pair { motion, rate, product: 0.0, changes: 0.0, by_rate: 0.0 })
        };
        Self(channels.iter().enumerate().filter_map(pair).collect())
    }

    /// Adds the steps between samples to the sums of each pair: the measured change x(k+1) − x(k)
    /// and the integrated change Δt (ẋ(k) + ẋ(k+1))/2.
    pub fn push(&mut self, measured: &Measurement) {
        let (record, half) = (measured.record(), 0.5 * measured.sampling().dt());
        for pair in &mut self.0 {
            let motion = record.channel(pair.motion).windows(2).map(|w| w[1] - w[0]);
            let rate = record.channel(pair.rate).windows(2).map(|w| half * (w[0] + w[1]));
            for (change, by_rate) in motion.zip(rate) {
                pair.product += change * by_rate;
                pair.changes += change * change;
                pair.by_rate += by_rate * by_rate;
            }
        }
    }

    /// Returns a remark for each inconsistent pair.
    pub fn remarks(&self, columns: &[String]) -> Vec<String> {
        let mismatch = |pair: &Pair| {
            let correlation = pair.product / (pair.changes * pair.by_rate).sqrt();
            let ratio = (pair.by_rate / pair.changes).sqrt() * correlation.signum();
            let right = (1.0 / ANOTHER_UNIT..ANOTHER_UNIT).contains(&ratio);
            (correlation.abs() > MIN_CORRELATION && !right).then(|| {
                format!(
                    "{} is {} times the rate of {}: one of them has a wrong unit or \
                     sign, or is the wrong column",
                    columns[pair.rate],
                    significant(ratio, 3),
                    columns[pair.motion]
                )
            })
        };
        self.0.iter().filter_map(mismatch).collect()
    }
}
