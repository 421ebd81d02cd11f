//! Positions and labels of ticks.

use crate::axis::Scale;

/// Ticks of one axis.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Ticks {
    /// Labelled positions.
    pub(crate) major: Vec<(f64, String)>,
    /// Positions without a label.
    pub(crate) minor: Vec<f64>,
    /// Common factor of the labels, such as `×10⁻³`.
    pub(crate) factor: Option<String>,
}

/// Returns ticks on `low..=high`, about `wanted` of them; `step` sets the distance on a linear
/// axis.
pub(crate) fn ticks(scale: Scale, low: f64, high: f64, wanted: f64, step: Option<f64>) -> Ticks {
    match scale {
        Scale::Linear => linear(low, high, wanted, step),
        Scale::Log10 => logarithmic(low, high, wanted),
    }
}

fn linear(low: f64, high: f64, wanted: f64, step: Option<f64>) -> Ticks {
    // A step that gives more than forty labels, or only one label, is ignored.
    let step = step
        .filter(|step| *step > 0.0 && step.is_finite() && (high - low) / step <= 40.0)
        .filter(|step| multiples(low, high, *step).1 > 1)
        .unwrap_or_else(|| {
            let usual = step_of_two_ticks(low, high, nice_step((high - low) / wanted));
            step_to_the_ends(low, high, wanted, usual)
        });
    let exponent = common_exponent(low.abs().max(high.abs()));
    let unit = 10f64.powi(exponent);
    let decimals = decimals(step / unit);
    let (first, count) = multiples(low, high, step);
    let major = (0..count.min(200))
        .map(|index| {
            let value = (first + index as f64) * step;
            (value, plain(value / unit, decimals))
        })
        .collect();
    let factor = (exponent != 0).then(|| format!("×{}", power(exponent)));
    Ticks { major, minor: Vec::new(), factor }
}

/// Returns the factor of the first multiple of `step` on `low..=high`, and the number of multiples.
fn multiples(low: f64, high: f64, step: f64) -> (f64, usize) {
    let first = (low / step - 1e-9).ceil();
    let last = (high / step + 1e-9).floor();
    (first, (last - first).max(-1.0) as usize + 1)
}

/// Returns `step`, or a finer step if `step` gives fewer than two ticks: a single tick does not
/// show the scale of the axis.
fn step_of_two_ticks(low: f64, high: f64, step: f64) -> f64 {
    let finer = std::iter::successors(Some(step), |step| Some(nice_step(step / 2.6)));
    finer.take(3).find(|step| multiples(low, high, *step).1 >= 2).unwrap_or(step)
}

/// Maximum fraction of an axis beyond its last tick, at either end; above it, finer steps are
/// tried.
const END: f64 = 0.1;

/// Maximum ratio of the number of ticks to the wanted number. A finer step that exceeds it is not
/// used, even if its ticks are nearer to the ends of the axis.
const CROWDED: f64 = 1.6;

/// Returns `step`, or a finer one whose ticks are nearer to the ends of the axis, if there is space
/// for them.
fn step_to_the_ends(low: f64, high: f64, wanted: f64, step: f64) -> f64 {
    let near = |step: &f64| {
        let (first, count) = multiples(low, high, *step);
        let last = (first + count as f64 - 1.0) * step;
        count > 0 && (first * step - low).max(high - last) <= END * (high - low)
    };
    let finer = std::iter::successors(Some(step), |step| Some(nice_step(step / 2.6)));
    let mut finer = finer
        .take(3)
        .filter(|fine| *fine == step || multiples(low, high, *fine).1 as f64 <= CROWDED * wanted);
    finer.find(near).unwrap_or(step)
}

/// Returns the smallest of 1, 2, 5 × 10ⁿ that is not below `rough`.
fn nice_step(rough: f64) -> f64 {
    let decade = 10f64.powf(rough.log10().floor());
    let mantissa = rough / decade;
    let nice = [1.0, 2.0, 5.0].into_iter().find(|nice| mantissa <= nice * (1.0 + 1e-9));
    decade * nice.unwrap_or(10.0)
}

/// Returns the engineering exponent, a multiple of three, for labels that would otherwise be long.
fn common_exponent(largest: f64) -> i32 {
    let exponent = largest.log10().floor();
    if largest == 0.0 || (-2.0..5.0).contains(&exponent) {
        0
    } else {
        3 * (exponent / 3.0).floor() as i32
    }
}

/// Returns the number of decimals, at most twelve, with which every multiple of `step` is exact
/// (steps have at most two digits).
fn decimals(step: f64) -> usize {
    (0..12)
        .find(|&digits| {
            let scaled = step * 10f64.powi(digits);
            (scaled - scaled.round()).abs() < 1e-6 * scaled
        })
        .unwrap_or(12) as usize
}

fn logarithmic(low: f64, high: f64, wanted: f64) -> Ticks {
    let (first, last) = (low.log10().floor() as i32, high.log10().ceil() as i32);
    let inside = |value: f64| value >= low * (1.0 - 1e-9) && value <= high * (1.0 + 1e-9);
    let decades: Vec<i32> = (first..=last).filter(|&n| inside(10f64.powi(n))).collect();
    if decades.len() < 2 {
        return short_logarithmic(low, high, wanted, &inside, first..=last);
    }
    let stride = (decades.len() as f64 / wanted).ceil().max(1.0) as i32;
    let words = decades.iter().all(|n| (-2..=4).contains(n));
    let label = |n: i32| {
        if words { plain(10f64.powi(n), (-n).max(0) as usize) } else { power(n) }
    };
    let (mut major, mut minor) = (Vec::new(), Vec::new());
    let span = (high / low).log10();
    if stride == 1 && 2.0 * span <= wanted {
        let label = |value: f64| {
            let n = (value * (1.0 + 1e-9)).log10().floor() as i32;
            match (value / 10f64.powi(n)).round() as i32 {
                1 => label(n),
                _ if words => plain(value, (-n).max(0) as usize),
                digit => format!("{digit}×{}", power(n)),
            }
        };
        let labelled = subdivisions(first..=last, &[1, 2, 5]).filter(|value| inside(*value));
        let mut labelled: Vec<f64> = labelled.collect();
        // Only the powers of ten, the first value and the last value are labelled if there is no
        // space for all labels.
        if labelled.len() as f64 > wanted {
            let ends = [labelled.first().copied(), labelled.last().copied()];
            let is_decade = |value: f64| decades.iter().any(|n| is_same(value, 10f64.powi(*n)));
            labelled.retain(|value| ends.contains(&Some(*value)) || is_decade(*value));
        }
        let unlabelled = subdivisions(first..=last, &[1, 2, 3, 4, 5, 6, 7, 8, 9]).filter(|value| {
            inside(*value) && !labelled.iter().any(|other| is_same(*other, *value))
        });
        minor.extend(unlabelled);
        major.extend(labelled.iter().map(|value| (*value, label(*value))));
        return Ticks { major, minor, factor: None };
    }
    // One tick does not show the scale: if fewer than two decades are multiples of the stride, the
    // labels begin at the first decade.
    let is_multiple = |n: &&i32| n.rem_euclid(stride) == 0;
    let origin = if decades.iter().filter(is_multiple).count() < 2 { decades[0] } else { 0 };
    for &n in &decades {
        if (n - origin).rem_euclid(stride) == 0 {
            major.push((10f64.powi(n), label(n)));
        } else {
            minor.push(10f64.powi(n));
        }
    }
    if stride == 1 {
        minor.extend(
            subdivisions(first..=last, &[2, 3, 4, 5, 6, 7, 8, 9]).filter(|value| inside(*value)),
        );
    }
    Ticks { major, minor, factor: None }
}

/// Returns whether two ticks are equal up to rounding.
fn is_same(a: f64, b: f64) -> bool {
    (a / b - 1.0).abs() < 1e-6
}

/// Returns the ticks of a logarithmic axis that contains at most one power of ten: labels at 1, 2
/// and 5 times powers of ten, or the ticks of a linear axis if these labels are fewer than three.
fn short_logarithmic(
    low: f64,
    high: f64,
    wanted: f64,
    inside: &dyn Fn(f64) -> bool,
    decades: std::ops::RangeInclusive<i32>,
) -> Ticks {
    let labelled: Vec<f64> =
        subdivisions(decades.clone(), &[1, 2, 5]).filter(|value| inside(*value)).collect();
    if labelled.len() < 3 {
        return linear(low, high, wanted, None);
    }
    let exponent = common_exponent(high);
    let unit = 10f64.powi(exponent);
    let major = labelled
        .into_iter()
        .map(|value| {
            let scaled = value / unit;
            (value, plain(scaled, (-(scaled * (1.0 + 1e-9)).log10().floor()).max(0.0) as usize))
        })
        .collect();
    let minor = subdivisions(decades, &[3, 4, 6, 7, 8, 9]).filter(|value| inside(*value)).collect();
    Ticks { major, minor, factor: (exponent != 0).then(|| format!("×{}", power(exponent))) }
}

fn subdivisions(
    decades: std::ops::RangeInclusive<i32>,
    digits: &[i32],
) -> impl Iterator<Item = f64> + use<'_> {
    decades.flat_map(move |n| digits.iter().map(move |&digit| f64::from(digit) * 10f64.powi(n)))
}

/// Returns a decimal number with a true minus sign.
fn plain(value: f64, decimals: usize) -> String {
    let text = format!("{:.decimals$}", value.abs());
    let is_zero = text.bytes().all(|byte| byte == b'0' || byte == b'.');
    if value < 0.0 && !is_zero { format!("−{text}") } else { text }
}

/// Returns a power of ten in the notation of [`Canvas::text`](crate::Canvas::text).
fn power(exponent: i32) -> String {
    let sign = if exponent < 0 { "−" } else { "" };
    format!("10^{{{sign}{}}}", exponent.abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(ticks: &Ticks) -> Vec<&str> {
        ticks.major.iter().map(|(_, label)| label.as_str()).collect()
    }

    #[test]
    fn linear_labels_are_round_and_short() {
        assert_eq!(
            labels(&linear(0.0, 1.0, 5.0, None)),
            ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]
        );
        assert_eq!(
            labels(&linear(-180.0, 0.0, 5.0, Some(45.0))),
            ["−180", "−135", "−90", "−45", "0"]
        );
        assert_eq!(
            labels(&linear(1.9, 4.1, 11.0, None)),
            ["2.0", "2.2", "2.4", "2.6", "2.8", "3.0", "3.2", "3.4", "3.6", "3.8", "4.0"]
        );
        // With steps of 50, the last tick would be at 200, far from the end of the axis at 249, so
        // the steps are finer.
        let to_the_end = linear(0.0, 249.0, 11.0, None);
        assert_eq!(to_the_end.major.last().unwrap().1, "240");
        // A narrow axis has no space for finer steps.
        assert_eq!(labels(&linear(0.0, 249.0, 4.0, None)), ["0", "100", "200"]);
        // ±50 is outside the axis, and 0 alone would not show its scale.
        assert_eq!(labels(&linear(-44.7, 44.7, 2.0, None)), ["−40", "−20", "0", "20", "40"]);
        let small = linear(-2.1e-4, 2.1e-4, 4.0, None);
        assert_eq!(labels(&small), ["−200", "0", "200"]);
        assert_eq!(small.factor.as_deref(), Some("×10^{−6}"));
        let large = linear(0.0, 2.0e6, 4.0, None);
        assert_eq!(
            (labels(&large), large.factor.as_deref()),
            (vec!["0.0", "0.5", "1.0", "1.5", "2.0"], Some("×10^{6}"))
        );
    }

    #[test]
    fn every_axis_has_two_labels() {
        for low in [0.0, 0.03, 0.1, 0.99, 7.0, 63.0] {
            for length in [1e-4, 0.013, 0.37, 1.0, 1.9, 4.0, 11.0, 300.0] {
                for wanted in [2.0, 3.0, 6.0, 12.0] {
                    for step in [None, Some(45.0)] {
                        let count = linear(low, low + length, wanted, step).major.len();
                        assert!(count > 1, "{low} to {}, {wanted}, {step:?}", low + length);
                    }
                    let (low, high) = (1e-9 + low, 1e-9 + low + length);
                    let count = logarithmic(low, high, wanted).major.len();
                    assert!(count > 1, "logarithmic, {low} to {high}, {wanted}");
                }
            }
        }
    }

    #[test]
    fn short_logarithmic_axes_are_labelled_to_their_ends() {
        let lifted = logarithmic(1.8e-5, 6e-3, 6.0);
        assert_eq!(labels(&lifted), ["2×10^{−5}", "10^{−4}", "10^{−3}", "5×10^{−3}"]);
        // Each tick is drawn once, labelled or not.
        assert_eq!(lifted.major.len() + lifted.minor.len(), 8 + 9 + 6);
        assert_eq!(
            labels(&logarithmic(20.0, 2e4, 12.0)),
            ["20", "50", "100", "200", "500", "1000", "2000", "5000", "10000", "20000"]
        );
    }

    #[test]
    fn logarithmic_labels_are_decades_or_one_two_five() {
        assert_eq!(labels(&logarithmic(0.05, 200.0, 6.0)), ["0.1", "1", "10", "100"]);
        assert_eq!(
            labels(&logarithmic(1e-6, 1e-3, 6.0)),
            ["10^{−6}", "10^{−5}", "10^{−4}", "10^{−3}"]
        );
        assert_eq!(
            labels(&logarithmic(1e-12, 1.0, 5.0)),
            ["10^{−12}", "10^{−9}", "10^{−6}", "10^{−3}", "10^{0}"]
        );
        assert_eq!(labels(&logarithmic(1.5, 60.0, 6.0)), ["2", "5", "10", "20", "50"]);
        assert_eq!(labels(&logarithmic(2.4, 155.0, 11.0)), ["5", "10", "20", "50", "100"]);
        assert_eq!(labels(&logarithmic(5.1, 5.9, 5.0)), ["5.2", "5.4", "5.6", "5.8"]);
    }
}
