//! Instants that are rounded to the digits with which they are printed.

/// Maximum rounding error of the instants, in steps; above it, a missing sample could not be
/// distinguished from rounding.
const COARSEST: f64 = 1.0;

/// Maximum rounding error, in steps, of fewer than [`FEW`] instants, because almost any spacing
/// agrees with a few instants.
const COARSEST_OF_FEW: f64 = 0.5;

/// Minimum number of instants with which rounding can be distinguished from uneven steps.
const FEW: usize = 16;

/// Maximum deviation of instants from equal spacing, in addition to their rounding, in steps.
const SLACK: f64 = 0.01;

/// Maximum number of corners of an envelope. If there are more corners, the instants are on a
/// curve, because rounding creates few corners: their number grows with the cube root of the number
/// of instants.
const MOST_CORNERS: usize = 1 << 16;

/// Number of digits of a double; rounding to more digits is not visible.
const DOUBLE_DIGITS: i32 = 17;

/// Number of instants at the beginning of a record that are stored, and checked once their digits
/// are known.
const BEGINNING: usize = 1024;

/// Test whether instants, passed one by one, are equally spaced except for rounding.
///
/// The unit of the last digit is determined from the numbers themselves: the largest numbers of
/// decimal places and of significant digits so far. The true value of each instant is within half a
/// unit of the printed value; the instants are equally spaced as long as a straight line passes
/// through all of these intervals. Such a line exists if the concave envelope of the lower ends
/// lies below the convex envelope of the upper ends. This test needs one pass and few corners.
#[derive(Debug)]
pub(super) struct PrintedInstants {
    count: usize,
    first: f64,
    last: f64,
    /// Largest number of decimal places so far; `digits` is the largest number of significant
    /// digits.
    decimals: i32,
    digits: i32,
    /// `true` if all instants are single-precision numbers.
    is_single: bool,
    /// `true` if the difference between any instant and the first one overflows.
    overflows: bool,
    /// Rounding unit of the instants in the current decade.
    decade: Decade,
    beginning: Vec<f64>,
    /// Intervals of the instants after those in `beginning`.
    intervals: Intervals,
}

/// Intervals that contain the true values of the instants. For equally spaced instants, a straight
/// line passes through all intervals, plotted over the numbers of the instants.
#[derive(Debug, Clone, Default)]
struct Intervals {
    /// Corners of the concave envelope of the lower ends of the intervals.
    lower_ends: Vec<Corner>,
    /// Corners of the convex envelope of the upper ends of the intervals, with the opposite sign.
    upper_ends: Vec<Corner>,
    /// `true` if there are more corners than rounding creates.
    is_curved: bool,
}

/// Corner of an envelope: number of the interval, and value of its end.
type Corner = (f64, f64);

impl Intervals {
    /// Appends the interval `middle` ± `half` after all others.
    fn push(&mut self, number: f64, middle: f64, half: f64) {
        if self.is_curved {
            return;
        }
        add_corner(&mut self.lower_ends, (number, middle - half));
        add_corner(&mut self.upper_ends, (number, -(middle + half)));
        if self.lower_ends.len().max(self.upper_ends.len()) > MOST_CORNERS {
            *self = Self { is_curved: true, ..Self::default() };
        }
    }

    /// Adds the intervals of `others`, which follow the intervals of `self`.
    fn append(&mut self, others: &Self) {
        self.is_curved |= others.is_curved;
        others.lower_ends.iter().for_each(|corner| add_corner(&mut self.lower_ends, *corner));
        others.upper_ends.iter().for_each(|corner| add_corner(&mut self.upper_ends, *corner));
    }

    /// Returns by how much each interval would have to be longer for one straight line to pass
    /// through all intervals; zero or less if such a line already exists.
    fn overlap(&self) -> f64 {
        if self.is_curved {
            return f64::INFINITY;
        }
        // The sum of two concave, piecewise linear envelopes is largest at a corner of one of them.
        let at_corners = |corners: &[Corner], others: &[Corner]| {
            let mut from = 0;
            let mut largest = f64::NEG_INFINITY;
            for (number, end) in corners {
                while from + 2 < others.len() && others[from + 1].0 < *number {
                    from += 1;
                }
                let (a, b) = (others[from], others[(from + 1).min(others.len() - 1)]);
                let part = if b.0 > a.0 { (number - a.0) / (b.0 - a.0) } else { 0.0 };
                largest = largest.max(end + a.1 + part * (b.1 - a.1));
            }
            largest
        };
        let (lower, upper) = (&self.lower_ends, &self.upper_ends);
        at_corners(lower, upper).max(at_corners(upper, lower))
    }
}

/// Adds a point after all corners of a concave envelope.
fn add_corner(corners: &mut Vec<Corner>, point: Corner) {
    while let [.., a, b] = corners[..] {
        // The middle point is a corner only if it is above the line through its neighbours.
        if (b.1 - a.1) * (point.0 - a.0) > (point.1 - a.1) * (b.0 - a.0) {
            break;
        }
        corners.pop();
    }
    corners.push(point);
}

/// Rounding unit of numbers between two powers of ten.
#[derive(Debug, Clone, Copy)]
struct Decade {
    from: f64,
    to: f64,
    unit: f64,
}

impl Decade {
    /// A decade that contains no number.
    const NONE: Self = Self { from: 1.0, to: 0.0, unit: 1.0 };
}

impl Default for PrintedInstants {
    fn default() -> Self {
        Self {
            count: 0,
            first: 0.0,
            last: 0.0,
            decimals: 0,
            digits: 1,
            is_single: true,
            overflows: false,
            decade: Decade::NONE,
            beginning: Vec::new(),
            intervals: Intervals::default(),
        }
    }
}

impl PrintedInstants {
    /// Adds the next instant.
    pub fn push(&mut self, time: f64) {
        self.is_single = self.is_single && f64::from(time as f32) == time;
        if self.count == 0 {
            self.first = time;
        }
        let mut unit = self.unit(time);
        if !is_multiple(time, unit) {
            let (decimals, digits) = printed(time);
            self.decimals = self.decimals.max(decimals);
            self.digits = self.digits.max(digits);
            self.decade = Decade::NONE;
            unit = self.unit(time);
        }
        if self.count < BEGINNING {
            self.beginning.push(time);
        } else {
            let half = self.rounding(time, unit);
            self.intervals.push(self.count as f64, time - self.first, half);
        }
        self.overflows |= !(time - self.first).is_finite();
        self.last = time;
        self.count += 1;
    }

    /// Returns whether the instants are equally spaced except for rounding by less than a step.
    pub fn are_uniform(&self) -> bool {
        let mut intervals = Intervals::default();
        for (k, time) in self.beginning.iter().enumerate() {
            let unit = decimal_unit(*time, self.decimals, self.digits);
            intervals.push(k as f64, time - self.first, self.rounding(*time, unit));
        }
        intervals.append(&self.intervals);
        let step = (self.last - self.first) / self.count.saturating_sub(1) as f64;
        let unit = decimal_unit(self.last, self.decimals, self.digits);
        let coarsest = if self.count < FEW { COARSEST_OF_FEW } else { COARSEST };
        step > 0.0
            && !self.overflows
            && self.coarser(self.last, unit) < coarsest * step
            && intervals.overlap() <= SLACK * step
    }

    /// Returns the largest possible rounding error of a printed instant.
    fn rounding(&self, time: f64, unit: f64) -> f64 {
        0.5 * self.coarser(time, unit) + f64::EPSILON * (time.abs() + self.first.abs())
    }

    /// Returns the rounding unit of an instant: `unit`, or the rounding unit of single precision if
    /// it is larger and all instants are single-precision numbers.
    fn coarser(&self, time: f64, unit: f64) -> f64 {
        if self.is_single { unit.max(single_unit(time)) } else { unit }
    }

    /// Returns the unit to which an instant was rounded.
    fn unit(&mut self, time: f64) -> f64 {
        let size = time.abs();
        if !(self.decade.from..self.decade.to).contains(&size) {
            let unit = decimal_unit(time, self.decimals, self.digits);
            let Some(exponent) = magnitude(time) else { return unit };
            self.decade =
                Decade { from: 10_f64.powi(exponent), to: 10_f64.powi(exponent + 1), unit };
        }
        self.decade.unit
    }
}

/// Returns the exponent of ten of a number; `None` for zero.
fn magnitude(value: f64) -> Option<i32> {
    let exponent = value.abs().log10();
    exponent.is_finite().then(|| exponent.floor() as i32)
}

/// Returns the place value of the last digit of a number that is printed with at most this many
/// decimal places and significant digits.
fn decimal_unit(value: f64, decimals: i32, digits: i32) -> f64 {
    let exponent = magnitude(value).map_or(-decimals, |m| (m + 1 - digits).max(-decimals));
    10_f64.powi(exponent)
}

/// Returns the distance from a number to the next one in single precision.
fn single_unit(value: f64) -> f64 {
    let single = value.abs() as f32;
    f64::from(single.next_up()) - f64::from(single)
}

/// Returns whether a number is a multiple of a unit, to the accuracy of a double.
fn is_multiple(value: f64, unit: f64) -> bool {
    let multiple = value / unit;
    let tolerance = 1e-6 + 4.0 * f64::EPSILON * multiple.abs();
    (multiple - multiple.round()).abs() <= tolerance
}

/// Returns the numbers of decimal places and significant digits of the shortest text of this
/// number.
fn printed(value: f64) -> (i32, i32) {
    let text = format!("{value:e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let digits = mantissa.bytes().filter(u8::is_ascii_digit).count() as i32;
    let exponent: i32 = exponent.parse().unwrap_or(0);
    ((digits - 1 - exponent).max(0), digits.min(DOUBLE_DIGITS))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn uniform(times: impl IntoIterator<Item = f64>) -> bool {
        let mut instants = PrintedInstants::default();
        times.into_iter().for_each(|t| instants.push(t));
        instants.are_uniform()
    }

    /// Returns `count` instants at `rate` Hz, each printed by `print` and read back.
    fn read(rate: f64, count: usize, print: impl Fn(f64) -> String) -> Vec<f64> {
        (0..count).map(|k| print(k as f64 / rate).parse().unwrap()).collect()
    }

    #[test]
    fn rounded_instants_are_uniform() {
        for (rate, decimals) in
            [(25_600.0, 5), (51_200.0, 5), (96_000.0, 5), (51_200.0, 6), (48_000.0, 6), (3.0, 2)]
        {
            assert!(
                uniform(read(rate, 300_000, |t| format!("{t:.decimals$}"))),
                "{rate} {decimals}"
            );
            // The instants are also uniform with another first instant.
            assert!(uniform(read(rate, 9_000, |t| format!("{:.decimals$}", t + 7.123_456_7))));
        }
        // With seven significant digits, the number of decimal places decreases with time.
        assert!(uniform(read(25_600.0, 300_000, |t| format!("{t:.6e}"))));
        // Single precision.
        assert!(uniform((0..300_000).map(|k| f64::from((f64::from(k) / 25_600.0) as f32))));
    }

    /// Returns instants at `rate` Hz from a random start, with random jitter of `jitter` steps,
    /// rounded to `decimals` decimal places.
    fn printed_with_jitter(rate: f64, decimals: usize, jitter: f64, seed: u64) -> Vec<f64> {
        let sampling = mechid_signal::Sampling::from_rate_hz(rate, 4096).unwrap();
        let off = mechid_signal::noise::white(sampling, 1, jitter.max(1e-12), seed).unwrap();
        let start = (seed as f64 * 0.618_034).fract();
        let time = |(k, off): (usize, &f64)| start + (k as f64 + off) / rate;
        let print = |t: f64| format!("{t:.decimals$}").parse().unwrap();
        off.channel(0).iter().enumerate().map(time).map(print).collect()
    }

    /// Tests 100 seeded records of each kind: all records with rounded instants are accepted; all
    /// records with jitter or with a missing sample are refused.
    #[test]
    fn rounding_is_told_from_jitter_and_from_a_gap() {
        for (rate, decimals) in [(51_200.0, 5), (25_600.0, 6), (96_000.0, 5)] {
            let accepted = |jitter: f64, lost: Option<usize>| {
                let one = |seed: &u64| {
                    let mut times = printed_with_jitter(rate, decimals, jitter, *seed);
                    lost.map(|sample| times.remove(sample));
                    uniform(times)
                };
                (0..100).filter(one).count()
            };
            assert_eq!(accepted(0.0, None), 100, "{rate} {decimals}");
            for jitter in [0.02, 0.05, 0.2] {
                assert_eq!(accepted(jitter, None), 0, "{rate} {decimals} jitter {jitter}");
            }
            // Near the ends of a record, coarse rounding can hide a missing sample, so no sample is
            // removed there.
            for lost in [64, 100, 2048, 4000] {
                assert_eq!(accepted(0.0, Some(lost)), 0, "{rate} {decimals} without {lost}");
            }
        }
    }

    #[test]
    fn gaps_and_drift_are_no_rounding() {
        let good = read(25_600.0, 100_000, |t| format!("{t:.6}"));
        for gap in [1, 10, 1000, 50_000, 99_990] {
            let mut times = good.clone();
            times.remove(gap);
            assert!(!uniform(times), "{gap}");
        }
        let coarse = read(25_600.0, 100_000, |t| format!("{t:.5}"));
        for gap in [100, 1000, 50_000, 99_900] {
            let mut times = coarse.clone();
            times.remove(gap);
            assert!(!uniform(times), "{gap}");
        }
        // In the second half, each step is longer by 0.01 %, so the instants are not equally
        // spaced.
        let drift = |k: usize| (k as f64 + 1e-4 * k.saturating_sub(50_000) as f64) / 25_600.0;
        assert!(!uniform((0..100_000).map(|k| format!("{:.6}", drift(k)).parse().unwrap())));
        // Instants with four decimal places are too coarse to distinguish a missing sample from
        // rounding.
        assert!(!uniform(read(25_600.0, 1000, |t| format!("{t:.4}"))));
        assert!(!uniform([0.0, 0.0, 0.0]));
        assert!(!uniform([2.0, 1.0, 0.0]));
        assert!(!uniform([0.0, 1.0, 2.0, 3.5, 4.75]));
        assert!(!uniform([-1.7e308, 1.7e308, 0.0]));
    }
}
