//! Smooth noise spectrum with bumps, estimated from few periods.

mod bump;

use std::ops::Range;

use mechid_numerics::products::weighted_gram;
use nalgebra::{Cholesky, DMatrix, DVector, DVectorView, Dyn};
use rayon::prelude::*;

pub(crate) use self::bump::Bump;
use self::bump::{most_conspicuous, widths};
use crate::limits::{
    BUMP_REMAINDER, END_LEVERAGE, HESSIAN_REUSED, LINES_PER_ORDER, MAX_BUMPS, MAX_ORDER,
    QUIET_DEVIATIONS, SMOOTH_COMPARED, SMOOTH_FLOOR, SMOOTH_SEARCHED, SMOOTH_STEPS,
    SMOOTH_TOLERANCE,
};

/// Form of a noise spectrum: the logarithm of the power is a polynomial in the logarithm of the
/// frequency, plus bumps.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Form {
    /// Order of the polynomial.
    pub(crate) order: usize,
    /// Bumps, by indices of lines in rising order of frequency; they may overlap.
    pub(crate) bumps: Vec<Bump>,
}

impl Form {
    /// Returns this form for a line spacing that is smaller by the factor `times`; the bumps are
    /// converted to this spacing.
    fn finer(&self, times: f64) -> Self {
        Self { order: self.order, bumps: self.bumps.iter().map(|bump| bump.finer(times)).collect() }
    }

    /// Returns the number of unknowns of each channel.
    pub(crate) fn terms(&self) -> usize {
        self.order + 1 + self.bumps.len()
    }

    /// Returns the bands of the bumps, by indices of `lines` lines; bands that overlap or touch are
    /// joined.
    pub(crate) fn bands(&self, lines: usize) -> Vec<Range<usize>> {
        let mut bands: Vec<Range<usize>> = self.bumps.iter().map(|b| b.band(lines)).collect();
        bands.sort_by_key(|band| band.start);
        let mut joined: Vec<Range<usize>> = Vec::new();
        for band in bands {
            match joined.last_mut() {
                Some(last) if band.start <= last.end => last.end = last.end.max(band.end),
                _ => joined.push(band),
            }
        }
        joined
    }

    /// Returns orthonormal columns that span all log powers of this form.
    fn basis(&self, omega: &[f64]) -> DMatrix<f64> {
        let ends = (omega.first().copied(), omega.last().copied());
        let (least, most) = (ends.0.unwrap_or(1.0), ends.1.unwrap_or(1.0));
        let span = f64::max((most / least).ln(), f64::MIN_POSITIVE);
        let mut columns = DMatrix::from_element(omega.len(), self.terms(), 1.0);
        for (line, omega) in omega.iter().enumerate() {
            let t = (2.0 * (omega / least).ln() / span - 1.0).clamp(-1.0, 1.0);
            // The first columns are Chebyshev polynomials in the logarithm of the frequency.
            let (mut before, mut polynomial) = (t, 1.0);
            for column in 0..=self.order {
                columns[(line, column)] = polynomial;
                (before, polynomial) = (polynomial, 2.0 * t * polynomial - before);
            }
            for (at, bump) in self.bumps.iter().enumerate() {
                columns[(line, self.order + 1 + at)] = bump.at(line);
            }
        }
        columns.qr().q()
    }
}

/// Raises notches of a spectrum: levels that are lower than the levels on both sides within this
/// many lines (morphological closing).
fn fill_notches(log_power: &mut DVector<f64>, lines: usize) {
    let half = lines / 2;
    let around = |at: usize| at.saturating_sub(half)..(at + half + 1).min(log_power.len());
    let extreme = |of: &DVector<f64>, pick: fn(f64, f64) -> f64| {
        DVector::from_fn(of.len(), |at, _| {
            of.rows_range(around(at)).iter().copied().reduce(pick).unwrap_or(of[at])
        })
    };
    let closed = extreme(&extreme(log_power, f64::max), f64::min);
    *log_power = closed;
}

/// Parametric spectrum that was fitted to sample variances.
#[derive(Debug, Clone)]
pub struct Smooth {
    pub(crate) form: Form,
    /// Orthonormal columns, pure numbers, that span the log powers of the form, lines × terms.
    pub basis: DMatrix<f64>,
    /// Logarithm of the power in the unit of the variances, lines × channels.
    pub log_power: DMatrix<f64>,
    /// Bayesian information criterion of the chosen form.
    pub(crate) cost: f64,
}

/// Returns the spectrum with the highest likelihood, given sample variances (lines × channels,
/// positive). The lines are in rising order of `omega` (rad/s); each variance is the mean of `nu`
/// squared magnitudes.
///
/// Order and bumps minimise the Bayesian information criterion; bumps are added one by one, the
/// bump with the largest gain first. The positions of the bumps count as unknowns, too. With more
/// than 4,096 lines, the form is chosen from means of neighbouring lines, and is afterwards fitted
/// to all lines.
///
/// # Source
/// McCullagh & Nelder, *Generalized Linear Models* (1989), chapter 8 (variances with a logarithmic
/// link); Schwarz (1978), Annals of Statistics 6, 461–464; Kooperberg, Stone & Truong (1995),
/// Journal of Time Series Analysis 16, 389–401 (log spectra of few terms with lines on them, chosen
/// one by one).
pub fn choose(omega: &[f64], variances: &DMatrix<f64>, nu: f64) -> Smooth {
    let group = omega.len().div_ceil(SMOOTH_SEARCHED);
    if group <= 1 {
        return searched(omega, variances, nu);
    }
    let groups = omega.len() / group;
    // Groups have equal sizes, so the last lines that do not fill a group are ignored.
    let mean = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / group as f64;
    let few: Vec<f64> = (0..groups)
        .map(|at| mean(&mut omega[group * at..group * (at + 1)].iter().copied()))
        .collect();
    let means = DMatrix::from_fn(groups, variances.ncols(), |at, channel| {
        mean(&mut variances.column(channel).rows(group * at, group).iter().copied())
    });
    let coarse = searched(&few, &means, nu * group as f64);
    let fitted = fit(coarse.form.finer(group as f64), omega, variances, nu);
    Smooth { cost: coarse.cost, ..fitted }
}

/// Returns the better of two spectra: a smooth spectrum, and a spectrum whose ratio to the
/// `relative` powers (lines × channels) is smooth. Also returns `true` if the better one is the
/// second spectrum.
pub(crate) fn choose_beside(
    omega: &[f64],
    variances: &DMatrix<f64>,
    nu: f64,
    relative: &DMatrix<f64>,
) -> (Smooth, bool) {
    let log = relative.map(f64::ln);
    if !log.iter().all(|log| log.is_finite()) {
        return (choose(omega, variances, nu), false);
    }
    // A common factor of the relative powers has no effect. It is removed, so that the ratios have
    // the size of the variances.
    let mean = log.row_mean();
    let log = DMatrix::from_fn(log.nrows(), log.ncols(), |line, at| log[(line, at)] - mean[at]);
    let ratios = variances.zip_map(&log, |v, log| v * (-log).exp());
    let (smooth, mut relative_smooth) =
        rayon::join(|| choose(omega, variances, nu), || choose(omega, &ratios, nu));
    // The logarithms of the relative powers of each channel have the mean zero, so that the
    // likelihoods can be compared.
    if relative_smooth.cost >= smooth.cost {
        return (smooth, false);
    }
    relative_smooth.log_power += log;
    (relative_smooth, true)
}

/// Chooses the form with a search over all lines.
fn searched(omega: &[f64], variances: &DMatrix<f64>, nu: f64) -> Smooth {
    let (lines, channels) = (omega.len(), variances.ncols() as f64);
    let per_term = (nu * lines as f64).max(2.0).ln();
    // The position of a bump counts, in the information criterion, as the logarithm of the number
    // of bands that are tried.
    let per_position = ((lines * widths(lines).count()).max(2) as f64).ln();
    let cost = |trial: &Trial| {
        2.0 * nu * trial.misfit
            + channels * trial.form.terms() as f64 * per_term
            + 2.0 * trial.form.bumps.len() as f64 * per_position
    };
    let of_order = |order: usize| {
        let mut trial = Trial::new(order, omega, variances);
        let mut least = cost(&trial);
        while trial.form.bumps.len() < MAX_BUMPS && 4 * (trial.form.terms() + 1) <= lines {
            let next = trial.next_bump(variances, nu);
            let more = next.and_then(|(bump, heights)| trial.with(bump, &heights, variances));
            let Some(more) = more else { break };
            let now = cost(&more);
            if now >= least {
                break;
            }
            (trial, least) = (more, now);
        }
        (least, trial.form)
    };
    let orders = (0..=MAX_ORDER.min(lines / LINES_PER_ORDER)).into_par_iter();
    let of_orders: Vec<(f64, Form)> = orders.map(of_order).collect();
    // The lower of two orders with equal costs is chosen.
    let best = of_orders.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
    let white = || (f64::INFINITY, Form { order: 0, bumps: Vec::new() });
    let (cost, form) = best.unwrap_or_else(white);
    Smooth { cost, ..fit(form, omega, variances, nu) }
}

/// Form whose cost is compared with the costs of other forms.
struct Trial {
    form: Form,
    /// Orthonormal columns that span all log powers of the form.
    basis: DMatrix<f64>,
    /// Most likely log powers, lines × channels.
    log_power: DMatrix<f64>,
    /// Sum of log p + v/p over lines and channels, with the power p and the sample variance v:
    /// minus the log likelihood divided by the degrees of freedom.
    misfit: f64,
}

impl Trial {
    /// Fits a polynomial without bumps.
    fn new(order: usize, omega: &[f64], variances: &DMatrix<f64>) -> Self {
        let form = Form { order, bumps: Vec::new() };
        let basis = form.basis(omega);
        let initial = DMatrix::from_columns(&initial_log_powers(&basis, variances));
        Self::fitted(form, basis, initial, variances)
    }

    /// Returns the fit with one more bump; the search starts from the present fit and from
    /// `heights`, the height of the bump for each channel. `None` if the form already contains the
    /// bump.
    fn with(&self, bump: Bump, heights: &[f64], variances: &DMatrix<f64>) -> Option<Self> {
        let mut form = self.form.clone();
        form.bumps.push(bump);
        let mut column = DVector::from_fn(self.basis.nrows(), |line, _| bump.at(line));
        let mut initial = self.log_power.clone();
        for (at, height) in heights.iter().enumerate() {
            initial.column_mut(at).axpy(*height, &column, 1.0);
            let ratios = variances.column(at).zip_map(&initial.column(at), |v, l| v * (-l).exp());
            initial.column_mut(at).add_scalar_mut(ratios.mean().max(f64::MIN_POSITIVE).ln());
        }
        let length = column.norm();
        // The second pass removes the components that rounding leaves after the first.
        for _ in 0..2 {
            column -= &self.basis * self.basis.tr_mul(&column);
        }
        let remaining = column.norm();
        if remaining.is_nan() || remaining <= BUMP_REMAINDER * length {
            return None;
        }
        let at = self.basis.ncols();
        let mut basis = self.basis.clone().insert_column(at, 0.0);
        basis.set_column(at, &(column / remaining));
        Some(Self::fitted(form, basis, initial, variances))
    }

    fn fitted(
        form: Form,
        basis: DMatrix<f64>,
        mut log_power: DMatrix<f64>,
        variances: &DMatrix<f64>,
    ) -> Self {
        let mut misfit = 0.0;
        for (mut column, channel) in log_power.column_iter_mut().zip(variances.column_iter()) {
            let (channel, initial) = (channel.into_owned(), column.clone_owned());
            let (most, least) = most_likely(&basis, &channel, initial, SMOOTH_COMPARED);
            column.copy_from(&most);
            misfit += least;
        }
        Self { form, basis, log_power, misfit }
    }

    /// Returns the bump that would raise the likelihood most, and its height for each channel.
    fn next_bump(&self, variances: &DMatrix<f64>, nu: f64) -> Option<(Bump, Vec<f64>)> {
        if self.form.bumps.is_empty() {
            return most_conspicuous(variances, &self.log_power, nu);
        }
        let mut filled = self.log_power.clone();
        for column in 0..filled.ncols() {
            let mut log_power = filled.column(column).into_owned();
            fill_notches(&mut log_power, (QUIET_DEVIATIONS / nu) as usize);
            filled.set_column(column, &log_power);
        }
        most_conspicuous(variances, &filled, nu)
    }
}

/// Returns the spectrum of a given form.
pub(crate) fn fit(form: Form, omega: &[f64], variances: &DMatrix<f64>, nu: f64) -> Smooth {
    let basis = form.basis(omega);
    let initial = initial_log_powers(&basis, variances);
    let of_channel = |(channel, initial): (usize, DVector<f64>)| {
        let variances = variances.column(channel).into_owned();
        let (mut log_power, _) = most_likely(&basis, &variances, initial, SMOOTH_TOLERANCE);
        if !form.bumps.is_empty() {
            fill_notches(&mut log_power, (QUIET_DEVIATIONS / nu) as usize);
        }
        log_power
    };
    let of_channels: Vec<_> = initial.into_par_iter().enumerate().map(of_channel).collect();
    let mut log_power = DMatrix::from_columns(&of_channels);
    let mut leverage: Vec<f64> = basis.row_iter().map(|row| row.norm_squared()).collect();
    for bump in &form.bumps {
        let band = bump.band(omega.len());
        let of_bump = (band.len() as f64).recip();
        leverage[band].iter_mut().for_each(|leverage| *leverage -= of_bump);
    }
    let ends = leverage.iter().enumerate().filter(|(_, leverage)| **leverage > END_LEVERAGE * nu);
    let ends: Vec<usize> = ends.map(|(line, _)| line).collect();
    if form.order > 0 && !ends.is_empty() {
        let lower = Form { order: form.order - 1, bumps: form.bumps.clone() };
        let lower = fit(lower, omega, variances, nu).log_power;
        for line in ends {
            for (own, lower) in log_power.row_mut(line).iter_mut().zip(lower.row(line).iter()) {
                *own = own.max(*lower);
            }
        }
    }
    Smooth { form, basis, log_power, cost: f64::INFINITY }
}

/// Returns log powers of each channel that are in the span of the basis and near the logarithms of
/// the sample variances.
fn initial_log_powers(basis: &DMatrix<f64>, variances: &DMatrix<f64>) -> Vec<DVector<f64>> {
    let initial = |variances: DVectorView<'_, f64>| {
        let floor = (SMOOTH_FLOOR * variances.mean()).max(f64::MIN_POSITIVE);
        let logarithms = variances.map(|v| v.max(floor).ln());
        let mut log_power = basis * basis.tr_mul(&logarithms);
        // The mean of v/p is the factor on the power p that maximises the likelihood.
        let level = variances.zip_map(&log_power, |v, log| v * (-log).exp()).mean();
        log_power.add_scalar_mut(level.max(f64::MIN_POSITIVE).ln());
        log_power
    };
    variances.column_iter().map(initial).collect()
}

/// Returns two results for the sample variances v of a channel: the maximum-likelihood log power
/// log p in a basis, and Σ log p + v/p. The search ends if a step is at most `tolerance` (RMS).
fn most_likely(
    basis: &DMatrix<f64>,
    variances: &DVector<f64>,
    mut log_power: DVector<f64>,
    tolerance: f64,
) -> (DVector<f64>, f64) {
    let mut ratio = DVector::zeros(variances.len());
    let mut misfit = deviance(&log_power, variances, &mut ratio);
    let tolerance = tolerance * (variances.len() as f64).sqrt();
    let mut next_ratio = ratio.clone();
    let mut factors: Option<Cholesky<f64, Dyn>> = None;
    let mut previous = f64::INFINITY;
    for _ in 0..SMOOTH_STEPS {
        let slope = basis.tr_mul(&ratio.add_scalar(-1.0));
        let reused = factors.as_ref().map(|factors| factors.solve(&slope));
        // The Hessian of an earlier step is used as long as each step is much shorter than the step
        // before it.
        let mut step = match reused.filter(|step| step.norm() <= HESSIAN_REUSED * previous) {
            Some(step) => step,
            None => {
                factors = weighted_gram(basis.as_view(), ratio.as_slice()).cholesky();
                // If the Hessian is not positive definite, the expected information, which is the
                // identity matrix, replaces it in Newton's step.
                factors.as_ref().map_or_else(|| slope.clone(), |factors| factors.solve(&slope))
            }
        };
        previous = step.norm();
        while step.norm() > tolerance {
            let next = &log_power + basis * &step;
            let lower = deviance(&next, variances, &mut next_ratio);
            if lower < misfit {
                (log_power, misfit) = (next, lower);
                std::mem::swap(&mut ratio, &mut next_ratio);
                break;
            }
            step *= 0.5;
        }
        if step.norm() <= tolerance {
            break;
        }
    }
    (log_power, misfit)
}

/// Returns Σ log p + v/p of the power p and the variances v, and writes each v/p into `ratio`.
fn deviance(log_power: &DVector<f64>, variances: &DVector<f64>, ratio: &mut DVector<f64>) -> f64 {
    let lines = ratio.iter_mut().zip(log_power.iter().zip(variances.iter()));
    let terms = lines.map(|(ratio, (log, v))| {
        *ratio = v * (-log).exp();
        log + *ratio
    });
    terms.sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A band whose noise power is a hundred times the power of the other lines must be found at
    /// the same frequencies with 20,000 lines as with 2,000 lines.
    #[test]
    fn many_lines_show_the_band_that_few_do() {
        let deviation = |line: usize| -(1.0 - (0.618_033_988_75 * line as f64).fract()).ln();
        let bands = [2_000, 20_000].map(|lines: usize| {
            let omega: Vec<f64> = (1..=lines).map(|line| line as f64 / lines as f64).collect();
            let inside = 3 * lines / 10..4 * lines / 10;
            let level = |line: usize| if inside.contains(&line) { 100.0 } else { 1.0 };
            let variances = DMatrix::from_fn(lines, 1, |line, _| level(line) * deviation(line + 1));
            let smooth = choose(&omega, &variances, 1.0);
            let band = smooth.form.bands(lines)[0].clone();
            let middle = smooth.log_power[(35 * lines / 100, 0)];
            assert!((middle - 100_f64.ln()).abs() < 0.2, "{middle}");
            [band.start, band.end].map(|place| omega[place])
        });
        for (few, many) in bands[0].iter().zip(&bands[1]) {
            assert!((few - many).abs() < 0.005, "{bands:?}");
        }
    }

    /// The noise has a 1/f spectrum and one complex deviation per line. If the deviation of the
    /// first line is small by chance, the fitted power of this line is still at least a tenth of
    /// the true power.
    #[test]
    fn a_line_at_the_end_that_is_quiet_by_chance_has_not_all_the_weight() {
        let omega: Vec<f64> = (1..=100).map(f64::from).collect();
        // The deviations are a fixed sequence with an exponential distribution, which is that of
        // the squares of complex normal numbers.
        let deviation = |line: usize| -(1.0 - (0.618_033_988_75 * line as f64).fract()).ln();
        let mut variances = DMatrix::from_fn(100, 1, |line, _| deviation(line + 1) / omega[line]);
        for quiet in [1e-2, 1e-4, 1e-6] {
            variances[(0, 0)] = quiet;
            for order in 1..=MAX_ORDER {
                let form = Form { order, bumps: Vec::new() };
                let smooth = fit(form, &omega, &variances, 1.0);
                let first = smooth.log_power[(0, 0)].exp();
                assert!(first > 0.1, "order {order}: {first}");
            }
        }
        // With eight deviations per line, the fitted power at the end of the band must be as low as
        // the sample variance.
        let falling = DMatrix::from_fn(100, 1, |line, _| omega[line].powi(3));
        let smooth = fit(Form { order: 3, bumps: Vec::new() }, &omega, &falling, 8.0);
        assert!(smooth.log_power[(0, 0)].abs() < 1e-3, "{}", smooth.log_power[(0, 0)]);
    }
}
