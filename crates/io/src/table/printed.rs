//! Instants that were rounded to the digits with which they are printed.

/// Part of a step that the rounding may be: beyond it a missing sample could pass for rounding.
const COARSEST: f64 = 1.0 / 3.0;

/// Digits of a double, beyond which no decimal rounding shows.
const DOUBLE_DIGITS: i32 = 17;

/// Number of instants, the first ones, that are looked at once their digits are known.
const BEGINNING: usize = 1024;

/// A test whether instants, taken one by one, are equally spaced but for rounding.
///
/// The unit of the last digit is taken from the numbers themselves: the largest numbers of decimal
/// places and of significant digits seen. Each instant leaves an interval for the step of a straight
/// line through the first one; the instants are equally spaced as long as these intervals have a step
/// in common.
#[derive(Debug)]
pub(super) struct PrintedInstants {
    count: usize,
    first: f64,
    last: f64,
    /// Largest number of decimal places and of significant digits so far.
    decimals: i32,
    digits: i32,
    /// Whether all are single precision.
    is_single: bool,
    /// Rounding unit of the first instant, and of those within a decade.
    first_unit: f64,
    decade: Decade,
    beginning: Vec<f64>,
    /// Steps that fit the instants behind the beginning.
    steps: Interval,
}

/// Steps between two bounds.
#[derive(Debug, Clone, Copy)]
struct Interval {
    shortest: f64,
    longest: f64,
}

impl Interval {
    /// Keeps the steps that take an instant to where it is, to within `rounding`.
    fn meet(&mut self, elapsed: f64, rounding: f64, steps: usize) {
        let per_step = (steps as f64).recip();
        self.shortest = self.shortest.max((elapsed - rounding) * per_step);
        self.longest = self.longest.min((elapsed + rounding) * per_step);
    }
}

/// The rounding unit of numbers between two powers of ten.
#[derive(Debug, Clone, Copy)]
struct Decade {
    from: f64,
    to: f64,
    unit: f64,
}

impl Decade {
    /// One that holds no number.
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
            first_unit: 1.0,
            decade: Decade::NONE,
            beginning: Vec::new(),
            steps: Interval { shortest: 0.0, longest: f64::INFINITY },
        }
    }
}

impl PrintedInstants {
    /// Takes the next instant.
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
            self.first_unit = decimal_unit(self.first, self.decimals, self.digits);
        }
        if self.count < BEGINNING {
            self.beginning.push(time);
        } else {
            self.steps.meet(time - self.first, self.rounding(time, unit), self.count);
        }
        self.last = time;
        self.count += 1;
    }

    /// Whether the instants are equally spaced but for rounding that is small against the step.
    pub fn are_uniform(&self) -> bool {
        let mut steps = self.steps;
        for (k, time) in self.beginning.iter().enumerate().skip(1) {
            let unit = decimal_unit(*time, self.decimals, self.digits);
            steps.meet(time - self.first, self.rounding(*time, unit), k);
        }
        let unit = decimal_unit(self.last, self.decimals, self.digits);
        steps.longest.is_finite()
            && steps.shortest <= steps.longest
            && self.coarser(self.last, unit) <= COARSEST * steps.longest
    }

    /// Largest distance of an instant from the line: the first one and itself are rounded by half a
    /// unit at most.
    fn rounding(&self, time: f64, unit: f64) -> f64 {
        let units = self.coarser(self.first, self.first_unit) + self.coarser(time, unit);
        0.5 * units + f64::EPSILON * time.abs()
    }

    /// The unit of an instant, or that of single precision if it is larger.
    fn coarser(&self, time: f64, unit: f64) -> f64 {
        if self.is_single { unit.max(single_unit(time)) } else { unit }
    }

    /// The unit to which an instant was rounded.
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

/// Exponent of ten of a number; `None` for zero.
fn magnitude(value: f64) -> Option<i32> {
    let exponent = value.abs().log10();
    exponent.is_finite().then(|| exponent.floor() as i32)
}

/// The unit of a number that is printed with so many decimal places and significant digits at most.
fn decimal_unit(value: f64, decimals: i32, digits: i32) -> f64 {
    let exponent = magnitude(value).map_or(-decimals, |m| (m + 1 - digits).max(-decimals));
    10_f64.powi(exponent)
}

/// The distance from a number to the next one in single precision.
fn single_unit(value: f64) -> f64 {
    let single = value.abs() as f32;
    f64::from(single.next_up()) - f64::from(single)
}

/// Whether a number is a multiple of a unit, as far as a double can tell.
fn is_multiple(value: f64, unit: f64) -> bool {
    let multiple = value / unit;
    let tolerance = 1e-6 + 4.0 * f64::EPSILON * multiple.abs();
    (multiple - multiple.round()).abs() <= tolerance
}

/// Decimal places and significant digits of the shortest text that is this number.
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

    /// Instants at a rate in Hz as a program prints them.
    fn read(rate: f64, count: usize, print: impl Fn(f64) -> String) -> Vec<f64> {
        (0..count).map(|k| print(k as f64 / rate).parse().unwrap()).collect()
    }

    #[test]
    fn rounded_instants_are_uniform() {
        for (rate, decimals) in
            [(25_600.0, 5), (25_600.0, 6), (51_200.0, 6), (48_000.0, 6), (3.0, 2), (1024.0, 4)]
        {
            assert!(
                uniform(read(rate, 300_000, |t| format!("{t:.decimals$}"))),
                "{rate} {decimals}"
            );
            // From another instant on.
            assert!(uniform(read(rate, 9_000, |t| format!("{:.decimals$}", t + 7.123_456_7))));
        }
        // Seven significant digits, of which fewer and fewer are decimal places.
        assert!(uniform(read(25_600.0, 300_000, |t| format!("{t:.6e}"))));
        // Single precision.
        assert!(uniform((0..300_000).map(|k| f64::from((f64::from(k) / 25_600.0) as f32))));
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
        // A clock that runs a hundredth of a per cent faster in the second half.
        let drift = |k: usize| (k as f64 + 1e-4 * k.saturating_sub(50_000) as f64) / 25_600.0;
        assert!(!uniform((0..100_000).map(|k| format!("{:.6}", drift(k)).parse().unwrap())));
        // Too coarse to tell.
        assert!(!uniform(read(25_600.0, 1000, |t| format!("{t:.4}"))));
        assert!(!uniform([0.0, 0.0, 0.0]));
        assert!(!uniform([2.0, 1.0, 0.0]));
        assert!(!uniform([0.0, 1.0, 2.0, 3.5, 4.75]));
        assert!(!uniform([-1.7e308, 1.7e308, 0.0]));
    }
}
