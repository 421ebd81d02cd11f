//! Whether what a fit of spectra leaves is as large as the noise that the measurement shows.

use nalgebra::{Complex, DMatrix};

use super::after::{SIGNIFICANT, counted, p_told};
use super::correlation::{Correlation, correlated, share_above_of};
use super::{Check, Subject, Verdict};
use crate::frequency_domain::{FrequencyData, in_units_of_noise};
use crate::{Estimate, EstimateError, Frf};

/// Periods that scatter by less than this part of the motion, and coherences that are closer to 1,
/// show rounding.
const ROUNDING: f64 = 1e-10;

/// Distances between lines at which residuals are multiplied, at most.
const DISTANCES: usize = 12;

/// The farthest of them as a part of all lines: beyond, few pairs are left, and their products are
/// not normally distributed.
const SHARE: usize = 8;

/// Pairs of lines that a distance takes at least.
const PAIRS: usize = 8;

/// Whether what an estimate leaves of the mean of several periods is as large as the noise that their
/// scatter shows; `data` carry that noise ([`RepeatedPeriods::mean_with_noise`]). Nothing if there is
/// no noise in them.
///
/// `fitted` is the number (a pure number) of parameters that were fitted to these data: all, or of several records
/// fitted together the share of this one.
///
/// [`RepeatedPeriods::mean_with_noise`]: crate::frequency_domain::RepeatedPeriods::mean_with_noise
///
/// # Source
/// Hotelling's T² with a covariance sampled from complex numbers: Pintelon & Schoukens, *System
/// Identification: A Frequency Domain Approach*, the chapter on the sample maximum likelihood.
pub fn after_spectral_fit(data: &FrequencyData, estimate: &Estimate, fitted: f64) -> Option<Check> {
    let noise = data.noise()?;
    let own = |row: usize| (0..data.dof()).map(|c| noise.covariance(row)[(c, c)].re).sum::<f64>();
    let scatter: f64 = (0..data.len()).map(own).sum();
    if scatter < ROUNDING * ROUNDING * data.displacement().norm_squared() {
        return None;
    }
    let left = in_units_of_noise(data, estimate)?;
    let (n, rows) = (data.dof() as f64, data.len() as f64);
    let nu = noise.degrees_of_freedom();
    // Rows with one covariance between them are one statistic.
    let groups = noise.groups();
    let each = rows / groups;
    let spare = 1.0 - fitted / (2.0 * n * rows);
    let (mean, variance) = if nu.is_infinite() {
        (n * rows, n * rows)
    } else {
        if nu <= n + 1.0 {
            return None;
        }
        let mean = n * each * nu / (nu - n);
        let square = n * each * (n * each + 1.0) * nu * nu / ((nu - n) * (nu - n - 1.0));
        (groups * mean, groups * (square - mean * mean))
    };
    let power = left.map(|r| r.norm_sqr()).sum();
    let expected = Expected { mean: mean * spare, variance: variance * spare };
    Some(expected.check(power, "the noise of the periods"))
}

/// Whether what an estimate leaves of frequency responses is as large as their coherence says, and
/// whether it has nothing in common from line to line beyond what the window ties together. The
/// forces act at the degrees of freedom `force_dof`, as for [`Frf::data`]; `fitted`, a pure number, as
/// for [`after_spectral_fit`].
///
/// Both allow for lines that the window and the overlap of the segments correlate; of responses
/// measured elsewhere the lines are taken as independent. The size is judged if the averages are
/// worth more than two beyond the forces.
///
/// # Errors
/// As [`Frf::data`].
///
/// # Source
/// Welch (1967), IEEE Trans. Audio Electroacoustics 15, 70–73, for the correlation of the lines;
/// Box (1954), Annals of Mathematical Statistics 25, 290–302, for the distribution of a sum of
/// correlated squares.
pub fn after_response_fit(
    frf: &Frf,
    force_dof: &[usize],
    estimate: &Estimate,
    fitted: f64,
) -> Result<Vec<Check>, EstimateError> {
    let data = frf.data(force_dof)?;
    let mut coherence: Vec<f64> = frf.coherence().iter().copied().collect();
    coherence.sort_by(f64::total_cmp);
    if 1.0 - coherence[coherence.len() / 2] < ROUNDING {
        return Ok(Vec::new());
    }
    let Some(left) = in_units_of_noise(&data, estimate) else { return Ok(Vec::new()) };
    let series = Series::of(&left, frf);
    let mut checks = Vec::from_iter(series.size(frf.averages() - force_dof.len() as f64, fitted));
    for (at, own) in series.each.iter().enumerate() {
        let (motion, force) = (at % left.ncols() + 1, force_dof[at / left.ncols()] + 1);
        let name = format!("response of motion {motion} to force {force}");
        checks.extend(series.line_to_line(own, &name));
    }
    Ok(checks)
}

/// Mean and variance of a weighted sum of squares if only noise is left.
struct Expected {
    mean: f64,
    variance: f64,
}

impl Expected {
    fn check(&self, power: f64, of: &str) -> Check {
        let p_value = share_above_of(power, self.mean, 0.5 * self.variance);
        let value = power / self.mean;
        let (verdict, meaning) = match p_value < SIGNIFICANT {
            false => (Verdict::Good, "no more than noise leaves"),
            true => (
                Verdict::Doubtful,
                "more than noise leaves: the estimate is biased, the machine is another (not linear, \
                 a degree of freedom more, a wrong known mass), or force and motion leak",
            ),
        };
        let times = if value < 1e4 { format!("{value:.3}") } else { format!("{value:.1e}") };
        let text = format!(
            "the residual has {times} times the power that {of} explains, {}; {meaning}",
            p_told(p_value)
        );
        Check { subject: Subject::Misfit, verdict, value, text }
    }
}

/// Residuals of responses from line to line, in units of their noise.
struct Series<'a> {
    /// One for each force and, within, each motion.
    each: Vec<Vec<Complex<f64>>>,
    /// Numbers of the lines, sorted, and where in `each` they stand.
    lines: Vec<(usize, usize)>,
    /// Of the noise of two lines so far apart.
    correlation: &'a [f64],
}

impl<'a> Series<'a> {
    fn of(left: &DMatrix<Complex<f64>>, frf: &'a Frf) -> Self {
        let count = frf.omega().len();
        let inputs = left.nrows() / count;
        let one = |(input, motion): (usize, usize)| {
            left.column(motion).rows(input * count, count).iter().copied().collect()
        };
        let all = (0..inputs).flat_map(|input| (0..left.ncols()).map(move |o| (input, o)));
        let mut lines: Vec<_> = frf.lines().iter().copied().zip(0..).collect();
        lines.sort_unstable();
        Self { each: all.map(one).collect(), lines, correlation: frf.line_correlation() }
    }

    /// Places of the lines that stand so far apart.
    fn pairs(&self, apart: usize) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.lines.iter().filter_map(move |(number, at)| {
            let other = self.lines.binary_search_by_key(&(number + apart), |line| line.0).ok()?;
            Some((*at, self.lines[other].1))
        })
    }

    /// With variances that are themselves of `nu` independent complex numbers each, and correlated
    /// from line to line like the squares of the residuals.
    fn size(&self, nu: f64, fitted: f64) -> Option<Check> {
        if nu <= 2.0 {
            return None;
        }
        let terms = (self.each.len() * self.lines.len()) as f64;
        let mut lines = 0.0;
        for (apart, c) in self.correlation.iter().enumerate() {
            let pairs = self.pairs(apart).count() * if apart == 0 { 1 } else { 2 };
            lines += pairs as f64 * (c * c + c * (1.0 + c * c) / (nu - 2.0));
        }
        let channels: f64 =
            self.each.iter().map(|a| self.each.iter().map(|b| common(a, b)).sum::<f64>()).sum();
        let (unit, spare) = (nu / (nu - 1.0), 1.0 - fitted / (2.0 * terms));
        let power = self.each.iter().flatten().map(|r| r.norm_sqr()).sum();
        let variance = spare * unit * unit * lines * channels;
        let expected = Expected { mean: spare * unit * terms, variance };
        Some(expected.check(power, "the coherence"))
    }

    /// Σ r̄(n) r(n + d) at distances d beyond those that the window ties together.
    fn line_to_line(&self, own: &[Complex<f64>], name: &str) -> Option<Check> {
        let (count, tied) = (own.len() as f64, self.correlation.len());
        let apart: Vec<usize> = (tied..self.lines.len() / SHARE)
            .filter(|apart| self.pairs(*apart).count() >= PAIRS)
            .take(DISTANCES)
            .collect();
        if apart.is_empty() {
            return None;
        }
        let there: Vec<f64> =
            (0..tied).map(|d| self.correlation[d] * self.pairs(d).count() as f64 / count).collect();
        let span = apart[apart.len() - 1] - apart[0] + 1;
        let together = correlated(&there, self.correlation, span);
        let square: f64 = apart
            .iter()
            .map(|a| apart.iter().map(|b| together[a.abs_diff(*b)].powi(2)).sum::<f64>())
            .sum();
        let power: f64 = own.iter().map(|r| r.norm_sqr()).sum();
        let (mut coefficients, mut sum) = (Vec::new(), 0.0);
        for d in &apart {
            let product: Complex<f64> = self.pairs(*d).map(|(l, m)| own[l].conj() * own[m]).sum();
            let coefficient = product / power;
            coefficients.extend([coefficient.re, coefficient.im]);
            sum += coefficient.norm_sqr() * count * count / self.pairs(*d).count() as f64;
        }
        let mean = apart.len() as f64 * together[0];
        // Real and imaginary part have half of the variance each.
        let p_value = share_above_of(sum, mean, 0.5 * square);
        let bound = 1.96 * (0.5 * together[0] / count).sqrt();
        let found = Correlation { coefficients, bound, statistic: sum, p_value };
        Some(told(&found, name, apart[0]))
    }
}

fn told(found: &Correlation, name: &str, first: usize) -> Check {
    let (verdict, meaning) = match found.p_value < SIGNIFICANT {
        false => (Verdict::Good, "nothing goes on from line to line"),
        true => (
            Verdict::Doubtful,
            "what is left goes on from line to line: a mode more, another error of the model, or \
             segments too short for the damping",
        ),
    };
    let text = format!(
        "residual of the {name}: {}, of lines {first} and more apart; {meaning}",
        counted(found)
    );
    Check { subject: Subject::Whiteness, verdict, value: found.p_value, text }
}

/// The share of power that the noise of two series has in common, less what chance has.
fn common(a: &[Complex<f64>], b: &[Complex<f64>]) -> f64 {
    let power = |a: &[Complex<f64>]| a.iter().map(|r| r.norm_sqr()).sum::<f64>();
    let product: Complex<f64> = a.iter().zip(b).map(|(a, b)| a.conj() * b).sum();
    let share = product.norm_sqr() / (power(a) * power(b));
    let chance = 1.0 / a.len() as f64;
    ((share - chance) / (1.0 - chance)).max(0.0)
}
