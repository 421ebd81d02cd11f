//! Bumps on a smooth spectrum, and the search for the bump with the largest gain.

use std::ops::Range;

use nalgebra::DMatrix;

use crate::limits::{
    BEST_WIDTHS, BUMP_GROUP, BUMP_HIGHER, BUMP_HIGHEST, BUMP_PEAK, BUMP_VARIATIONS, BUMP_WIDER,
    HEIGHT_STEPS, HEIGHT_TOLERANCE, PEAK_REACH, QUIET_DEVIATIONS, SMOOTH_FLOOR,
};

/// Shape of a bump around a line. The shape times an unknown height is added to the log powers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Bump {
    shape: Shape,
    /// Middle of the bump, as an index of lines; it may be between two lines.
    middle: f64,
    /// Distance from the middle of the bump to each of its ends, in lines.
    reach: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Shape {
    /// Equal height on all lines of the bump.
    Flat,
    /// Height that decreases linearly from the middle to both ends.
    Tent,
    /// Height ln(1 + A/(1 + x²)) divided by its maximum ln(1 + A), which is `top`. A is
    /// `above_floor`, and x is 1 at a distance of `half_width` lines. This is the shape of a
    /// resonance on a floor.
    Peak { above_floor: f64, half_width: f64, top: f64 },
}

impl Bump {
    fn flat(band: &Range<usize>) -> Self {
        let middle = 0.5 * (band.start + band.end - 1) as f64;
        Self { shape: Shape::Flat, middle, reach: 0.5 * band.len() as f64 }
    }

    fn tent(middle: f64, reach: f64) -> Self {
        Self { shape: Shape::Tent, middle, reach }
    }

    fn peak(middle: f64, half_width: f64, above_floor: f64) -> Self {
        let reach = PEAK_REACH * half_width * above_floor.sqrt();
        let top = above_floor.ln_1p();
        Self { shape: Shape::Peak { above_floor, half_width, top }, middle, reach }
    }

    /// Returns this bump converted to a line spacing that is smaller by the factor `times`.
    pub(super) fn finer(&self, times: f64) -> Self {
        let shape = match self.shape {
            Shape::Peak { above_floor, half_width, top } => {
                Shape::Peak { above_floor, half_width: times * half_width, top }
            }
            other => other,
        };
        let middle = times * (self.middle + 0.5) - 0.5;
        Self { shape, middle, reach: times * self.reach }
    }

    /// Returns other shapes that may fit better than the flat bump of a band.
    fn about(band: &Range<usize>) -> [Self; 3] {
        let Self { middle, reach, .. } = Self::flat(band);
        [
            Self::tent(middle, 2.0 * reach),
            Self::peak(middle, 0.5 * reach, BUMP_PEAK),
            Self::peak(middle, reach, BUMP_PEAK),
        ]
    }

    /// Returns variations of this bump: moved a little, wider, narrower, higher or lower. A flat
    /// bump has no variations, because all positions of flat bumps are tried.
    fn varied(&self) -> Vec<Self> {
        let middle = self.middle;
        match self.shape {
            Shape::Flat => Vec::new(),
            Shape::Tent => {
                let by = 0.25 * self.reach;
                vec![
                    Self::tent(middle - by, self.reach),
                    Self::tent(middle + by, self.reach),
                    Self::tent(middle, self.reach - by),
                    Self::tent(middle, self.reach + by),
                ]
            }
            Shape::Peak { above_floor, half_width, .. } => vec![
                Self::peak(middle - 0.5 * half_width, half_width, above_floor),
                Self::peak(middle + 0.5 * half_width, half_width, above_floor),
                Self::peak(middle, half_width / BUMP_WIDER, above_floor),
                Self::peak(middle, half_width * BUMP_WIDER, above_floor),
                Self::peak(middle, half_width * BUMP_HIGHER.sqrt(), above_floor / BUMP_HIGHER),
                Self::peak(middle, half_width / BUMP_HIGHER.sqrt(), above_floor * BUMP_HIGHER),
            ],
        }
    }

    pub(super) fn at(&self, line: usize) -> f64 {
        self.height_at(line as f64)
    }

    fn height_at(&self, place: f64) -> f64 {
        let away = (place - self.middle).abs();
        match self.shape {
            Shape::Flat => f64::from(u8::from(away < self.reach)),
            Shape::Tent => (1.0 - away / self.reach).max(0.0),
            Shape::Peak { .. } if away > self.reach => 0.0,
            Shape::Peak { above_floor, half_width, top } => {
                (1.0 + above_floor / (1.0 + (away / half_width).powi(2))).ln() / top
            }
        }
    }

    /// Returns the lines on which the bump has at least half its height.
    pub(super) fn band(&self, lines: usize) -> Range<usize> {
        let half = match self.shape {
            Shape::Flat => self.reach - 0.5,
            Shape::Tent => 0.5 * self.reach,
            // At this distance, the logarithm of the peak has half of its largest value.
            Shape::Peak { above_floor, half_width, .. } => half_width * above_floor.powf(0.25),
        };
        // The band has at least the line nearest to the middle.
        let nearest = (self.middle.round().max(0.0) as usize).min(lines.saturating_sub(1));
        let first = (self.middle - half).ceil().max(0.0) as usize;
        let last = (self.middle + half).floor().max(0.0) as usize;
        first.min(nearest)..(last.max(nearest) + 1).min(lines)
    }

    /// Returns the lines on which the bump is not zero.
    fn support(&self, lines: usize) -> Range<usize> {
        let first = (self.middle - self.reach).ceil().max(0.0) as usize;
        first..((self.middle + self.reach).floor() as usize + 1).min(lines)
    }

    /// Returns groups of neighbouring lines on which the bump is not zero. The groups are so narrow
    /// that the height of the bump hardly changes within a group.
    fn groups(&self, lines: usize) -> Vec<Range<usize>> {
        let scale = match self.shape {
            Shape::Flat | Shape::Tent => self.reach,
            Shape::Peak { half_width, .. } => half_width,
        };
        let support = self.support(lines);
        let mut groups = Vec::new();
        let mut start = support.start;
        while start < support.end {
            let away = (start as f64 - self.middle).abs();
            let width = ((BUMP_GROUP * away.max(scale)) as usize).max(1);
            let end = (start + width).min(support.end);
            groups.push(start..end);
            start = end;
        }
        groups
    }
}

/// Returns the widths of the bands that are tried: 1, 2, 3, 4, 6, 8, 12 …, up to a third of the
/// lines.
pub(super) fn widths(lines: usize) -> impl Iterator<Item = usize> {
    let powers = (0..usize::BITS).map(|power| 1usize << power);
    let all_widths = powers.flat_map(|p| if p == 1 { vec![1] } else { vec![p, p + p / 2] });
    all_widths.take_while(move |width| *width <= (lines / 3).max(1))
}

/// Returns the bump with the highest likelihood, given the variances, and its height for each
/// channel. The candidates are all flat bumps and, around the best flat bumps, other shapes.
pub(super) fn most_conspicuous(
    variances: &DMatrix<f64>,
    log_power: &DMatrix<f64>,
    nu: f64,
) -> Option<(Bump, Vec<f64>)> {
    let (lines, channels) = variances.shape();
    let levels = variances.zip_map(log_power, |v, log| v * (-log).exp());
    let gains = FlatGains::new(&levels, nu);
    let mut flat: Vec<(f64, Range<usize>)> =
        widths(lines).filter_map(|width| gains.best_of_width(width)).collect();
    flat.sort_by(|a, b| b.0.total_cmp(&a.0));
    flat.truncate(BEST_WIDTHS);
    let best = |of: &mut dyn Iterator<Item = Gained>| of.max_by(|a, b| a.gain.total_cmp(&b.gain));
    let (of_flat, band) = flat.first()?;
    let none = vec![0.0; channels];
    let shapes = flat.iter().flat_map(|(_, band)| Bump::about(band));
    let fit = |bump: Bump, start: &[f64]| Gained::fit(bump, start, &gains);
    let mut fitted = best(&mut shapes.map(|bump| fit(bump, &none)))?;
    for _ in 0..BUMP_VARIATIONS {
        let varied = fitted.bump.varied().into_iter();
        let inside = varied.filter(|bump| (0.0..lines as f64).contains(&bump.middle));
        let with_gain = |bump: Bump| fit(bump, &fitted.heights);
        match best(&mut inside.map(with_gain)).filter(|varied| varied.gain > fitted.gain) {
            Some(varied) => fitted = varied,
            None => break,
        }
    }
    if *of_flat >= fitted.gain {
        fitted = Gained { gain: *of_flat, ..fit(Bump::flat(band), &none) };
    }
    (fitted.gain > 0.0).then_some((fitted.bump, fitted.heights))
}

/// Gains of flat bumps, as reductions of Σ log p + v/p with the fitted power p and the variance v.
struct FlatGains {
    /// Cumulative sums of the levels v/p, (lines + 1) × channels. The mean of any band follows from
    /// them.
    below: DMatrix<f64>,
    nu: f64,
}

impl FlatGains {
    fn new(levels: &DMatrix<f64>, nu: f64) -> Self {
        let (lines, channels) = levels.shape();
        let mut below = DMatrix::<f64>::zeros(lines + 1, channels);
        for channel in 0..channels {
            for line in 0..lines {
                below[(line + 1, channel)] = below[(line, channel)] + levels[(line, channel)];
            }
        }
        Self { below, nu }
    }

    /// Returns the largest gain of all bands of one width, and the band with this gain.
    fn best_of_width(&self, width: usize) -> Option<(f64, Range<usize>)> {
        let bounds = self.bounds(width);
        let highest = (0..bounds.len()).max_by(|a, b| bounds[*a].total_cmp(&bounds[*b]));
        let mut best = highest.map(|start| (self.gain(start, width), start));
        for (start, bound) in bounds.into_iter().enumerate() {
            let least = best.map_or(f64::NEG_INFINITY, |(gain, _)| gain);
            // The upper bound excludes most bands, so the gain with its logarithms is computed for
            // few bands only.
            if bound >= least {
                let gain = Some(self.gain(start, width)).filter(|gain| *gain >= least);
                best = gain.map(|gain| (gain, start)).or(best);
            }
        }
        best.map(|(gain, start)| (gain, start..start + width))
    }

    /// Returns an upper bound of the gain of each band of one width; it follows from ln x ≤ x − 1.
    fn bounds(&self, width: usize) -> Vec<f64> {
        let lines = self.below.nrows() - 1;
        let mut bounds = vec![0.0; lines + 1 - width];
        for below in self.below.as_slice().chunks_exact(lines + 1) {
            let levels = Levels::new(below, width, self.nu);
            for ((bound, first), last) in bounds.iter_mut().zip(below).zip(&below[width..]) {
                *bound += levels.bound(last - first);
            }
        }
        bounds
    }

    /// Returns the gain of a band.
    fn gain(&self, start: usize, width: usize) -> f64 {
        let lines = self.below.nrows() - 1;
        let gains = self.below.as_slice().chunks_exact(lines + 1).map(|below| {
            let levels = Levels::new(below, width, self.nu);
            let [inside, other] = levels.ratios(below[start + width] - below[start]);
            levels.count * inside.ln() + levels.others * other.ln()
        });
        gains.sum()
    }
}

/// Levels of a channel for bands of one width.
struct Levels {
    /// Number of lines of a band.
    count: f64,
    /// Number of all other lines.
    others: f64,
    /// Sum of the levels v/p over all lines.
    total: f64,
    mean: f64,
    /// `true` if the band has enough complex deviations for a level below that of the other lines.
    may_be_quiet: bool,
}

impl Levels {
    fn new(below: &[f64], width: usize, nu: f64) -> Self {
        let lines = below.len() - 1;
        let (count, total) = (width as f64, below[lines]);
        Self {
            count,
            others: (lines - width) as f64,
            total,
            mean: (total / lines as f64).max(SMOOTH_FLOOR),
            may_be_quiet: count * nu >= QUIET_DEVIATIONS,
        }
    }

    /// Returns an upper bound of the gain of a band whose sum is `inside`: the gain with x − 1
    /// instead of ln x.
    #[inline]
    fn bound(&self, inside: f64) -> f64 {
        let Self { count, others, mean, .. } = *self;
        let other = (self.total - inside).max(others * SMOOTH_FLOOR);
        let inside = inside.max(count * SMOOTH_FLOOR);
        let bound = mean * (count * count / inside + others * others / other) - (count + others);
        let counts = self.may_be_quiet | (inside * others > other * count);
        if counts { bound } else { 0.0 }
    }

    /// Returns the ratios of the mean of all lines to the mean of a band whose sum is `inside`, and
    /// to the mean of the other lines. Both ratios are 1 if the band is quiet but too narrow.
    #[inline]
    fn ratios(&self, inside: f64) -> [f64; 2] {
        let other = ((self.total - inside) / self.others).max(SMOOTH_FLOOR);
        let inside = (inside / self.count).max(SMOOTH_FLOOR);
        let counts = self.may_be_quiet | (inside > other);
        [inside, other].map(|level| if counts { self.mean / level } else { 1.0 })
    }
}

/// Bump with its most likely heights.
struct Gained {
    bump: Bump,
    /// Reduction of Σ log p + v/p by the bump, with the power p and the sample variance v.
    gain: f64,
    /// Height for each channel, in the logarithm of the power.
    heights: Vec<f64>,
}

impl Gained {
    /// Fits the heights of a bump, one for each channel, to levels v/p (sample variance divided by
    /// power) whose cumulative sums are `sums`. The search begins with the heights `start`.
    fn fit(bump: Bump, start: &[f64], sums: &FlatGains) -> Self {
        let lines = sums.below.nrows() - 1;
        let groups = bump.groups(lines);
        let parts: Vec<Part> = groups.iter().map(|group| Part::new(&bump, group)).collect();
        let mut levels = vec![0.0; groups.len()];
        let mut heights = start.to_vec();
        let channels = heights.iter_mut().zip(sums.below.column_iter());
        let gains = channels.map(|(height, below)| {
            for (level, group) in levels.iter_mut().zip(&groups) {
                *level = below[group.end] - below[group.start];
            }
            let inside: f64 = levels.iter().sum();
            raised(&parts, &levels, below[lines] - inside, lines as f64, height, sums.nu)
        });
        let gain = gains.sum();
        Self { bump, gain, heights }
    }
}

/// Group of lines on which the height of a bump is nearly constant.
struct Part {
    /// Ratio of the height on this group to the height in the middle of the bump.
    height: f64,
    lines: f64,
}

impl Part {
    fn new(bump: &Bump, group: &Range<usize>) -> Self {
        let middle = 0.5 * (group.start + group.end - 1) as f64;
        Self { height: bump.height_at(middle), lines: group.len() as f64 }
    }
}

/// Fits the height of a bump that consists of `parts`, and returns the reduction of Σ log p + v/p.
/// `inside` has the sum of the levels v/p of each part, `outside` is the sum over all other lines.
fn raised(
    parts: &[Part],
    inside: &[f64],
    outside: f64,
    lines: f64,
    height: &mut f64,
    nu: f64,
) -> f64 {
    let area: f64 = parts.iter().map(|part| part.height * part.lines).sum();
    let total = outside + inside.iter().sum::<f64>();
    let (mut least, mut most) = (-BUMP_HIGHEST, BUMP_HIGHEST);
    let mut gain = 0.0;
    for _ in 0..HEIGHT_STEPS {
        let (mut sum, mut first, mut second) = (outside, 0.0, 0.0);
        for (part, level) in parts.iter().zip(inside) {
            let scaled_level = level * f64::exp(-*height * part.height);
            sum += scaled_level;
            first += part.height * scaled_level;
            second += part.height * part.height * scaled_level;
        }
        // The cost lines · log Σ v/p + height · area is convex in the height, so Newton's method
        // with bisection finds its minimum.
        let slope = area - lines * first / sum;
        let curvature = lines * (second / sum - (first / sum).powi(2));
        if slope < 0.0 {
            least = *height
        } else {
            most = *height
        }
        gain = lines * (total / sum).ln() - *height * area;
        let next = *height - slope / curvature;
        let newton = next > least && next < most;
        let step = if newton { next } else { 0.5 * (least + most) } - *height;
        *height += step;
        if step.abs() <= HEIGHT_TOLERANCE {
            // The gain was computed before the last step of Newton's method. This term is the gain
            // of that step, up to third order.
            gain += if newton { 0.5 * slope * slope / curvature } else { 0.0 };
            break;
        }
    }
    if *height <= 0.0 && area * nu < QUIET_DEVIATIONS {
        return 0.0;
    }
    gain
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The gain that follows from groups of lines agrees with the largest gain of the exact
    /// likelihood of all lines over a grid of heights. The peaks have half widths from 0.5 to 150
    /// of 2,000 lines.
    #[test]
    fn gains_of_grouped_lines_are_those_of_all_lines() {
        let (lines, nu) = (2000, 1.0);
        let deviation = |line: usize| -(1.0 - (0.618_033_988_75 * line as f64).fract()).ln();
        for (half_width, above_floor) in [(0.5, 100.0), (4.0, 30.0), (20.0, 1000.0), (150.0, 9.0)] {
            let truth = Bump::peak(900.3, half_width, above_floor);
            let level = |line: usize| deviation(line + 1) * (2.5 * truth.at(line)).exp();
            let levels = DMatrix::from_fn(lines, 1, |line, _| level(line));
            let total = levels.sum();
            for tried in truth.varied().into_iter().chain([truth]) {
                let of_height = |height: f64| {
                    let raised = |line: usize| levels[line] * (-height * tried.at(line)).exp();
                    let sum: f64 = (0..lines).map(raised).sum();
                    let area: f64 = (0..lines).map(|line| tried.at(line)).sum();
                    lines as f64 * (total / sum).ln() - height * area
                };
                let exact = (0..=4000).map(|step| of_height(0.001 * f64::from(step)));
                let exact = exact.fold(f64::NEG_INFINITY, f64::max);
                let found = Gained::fit(tried, &[0.0], &FlatGains::new(&levels, nu));
                let off = (found.gain - exact).abs();
                assert!(off < 0.05 + 1e-3 * exact, "{tried:?}: {} for {exact}", found.gain);
            }
        }
    }
}
