//! The spectrum of noise of which few periods are known: smooth, with bands of their own level.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

/// Highest order of log power in log frequency.
const MAX_ORDER: usize = 6;
/// Minimum number of lines per order.
const LINES_PER_ORDER: usize = 8;
/// Maximum number of bands.
const MAX_BANDS: usize = 24;
/// Complex deviations that a level below those beside it is made of at least: few lines may be quiet by
/// chance, and would then have all the weight.
const QUIET_DEVIATIONS: f64 = 12.0;
/// Steps of the search for the log power.
const STEPS: usize = 200;
/// Change of the log power (RMS) below which it is found.
const TOLERANCE: f64 = 1e-9;
/// Smallest power, relative to the mean over the lines, at which the search starts.
const FLOOR: f64 = 1e-9;

/// Form of a noise spectrum: the logarithm of the power is a polynomial in the logarithm of the frequency,
/// and a constant is added to it in each of some bands.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Form {
    /// Order of the polynomial.
    pub(crate) order: usize,
    /// Bands, as places of lines by rising frequency; they may overlap.
    pub(crate) bands: Vec<Range<usize>>,
}

impl Form {
    /// Number of unknowns of each channel.
    pub(crate) fn terms(&self) -> usize {
        self.order + 1 + self.bands.len()
    }

    /// Bands that do not overlap or touch, as places of lines.
    pub(crate) fn joined_bands(&self) -> Vec<Range<usize>> {
        let mut bands = self.bands.clone();
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

    /// Raises what is quieter than both its sides, and of too few lines to be sure of that, to the quieter
    /// of them.
    fn fill_notches(&self, log_power: &mut DVector<f64>, nu: f64) {
        let lines = log_power.len();
        let mut edges: Vec<usize> = self.bands.iter().flat_map(|b| [b.start, b.end]).collect();
        edges.extend([0, lines]);
        edges.sort_unstable();
        edges.dedup();
        for cell in edges.windows(2).map(|pair| pair[0]..pair[1]) {
            if cell.len() as f64 * nu >= QUIET_DEVIATIONS || cell.len() == lines {
                continue;
            }
            let beside = [cell.start.checked_sub(1), Some(cell.end)];
            let beside = beside.into_iter().flatten().filter_map(|line| log_power.get(line));
            let least = beside.copied().fold(f64::INFINITY, f64::min);
            log_power.rows_range_mut(cell).apply(|log| *log = log.max(least));
        }
    }

    /// Orthonormal columns that span all log powers of this form.
    fn basis(&self, omega: &[f64]) -> DMatrix<f64> {
        let ends = (omega.first().copied(), omega.last().copied());
        let (least, most) = (ends.0.unwrap_or(1.0), ends.1.unwrap_or(1.0));
        let span = f64::max((most / least).ln(), f64::MIN_POSITIVE);
        let columns = DMatrix::from_fn(omega.len(), self.terms(), |line, column| {
            match column.checked_sub(self.order + 1) {
                None => {
                    // Chebyshev polynomials.
                    let t = 2.0 * (omega[line] / least).ln() / span - 1.0;
                    (column as f64 * t.clamp(-1.0, 1.0).acos()).cos()
                }
                Some(band) => f64::from(u8::from(self.bands[band].contains(&line))),
            }
        });
        columns.qr().q()
    }
}

/// A spectrum of a form that was fitted to sample variances.
#[derive(Debug, Clone)]
pub(crate) struct Smooth {
    pub(crate) form: Form,
    /// Logarithm of the power, lines × channels.
    pub(crate) log_power: DMatrix<f64>,
    /// Σ log p + v/p over lines and channels: minus the log likelihood over the degrees of freedom.
    pub(crate) misfit: f64,
}

/// The spectrum that makes sample variances (lines × channels, positive) most likely, by rising `omega`
/// (rad/s), each variance a mean of `nu` squares of complex numbers.
///
/// Order and bands are those of least Bayesian information criterion; bands are added one by one, each the
/// one that gains most, and their edges count as unknowns, too.
///
/// # Source
/// McCullagh & Nelder, *Generalized Linear Models* (1989), chapter 8 (variances with a logarithmic link);
/// Schwarz (1978), Annals of Statistics 6, 461–464; Olshen, Venkatraman, Lucito & Wigler (2004),
/// Biostatistics 5, 557–572 (bands found by a scan over all intervals).
pub(crate) fn choose(omega: &[f64], variances: &DMatrix<f64>, nu: f64) -> Smooth {
    let (lines, channels) = (omega.len(), variances.ncols() as f64);
    let per_term = (nu * lines as f64).max(2.0).ln();
    // Intervals that are looked at.
    let per_place = ((lines * widths(lines).count()).max(2) as f64).ln();
    let cost = |found: &Smooth| {
        2.0 * nu * found.misfit
            + channels * found.form.terms() as f64 * per_term
            + 2.0 * found.form.bands.len() as f64 * per_place
    };
    let mut best: Option<(f64, Smooth)> = None;
    for order in 0..=MAX_ORDER.min(lines / LINES_PER_ORDER) {
        let mut found = fit(Form { order, bands: Vec::new() }, omega, variances, nu);
        let mut least = cost(&found);
        while found.form.bands.len() < MAX_BANDS && 4 * (found.form.terms() + 1) <= lines {
            let Some(band) = most_conspicuous(variances, &found.log_power, nu) else { break };
            let mut form = found.form.clone();
            form.bands.push(band);
            let more = fit(form, omega, variances, nu);
            let now = cost(&more);
            if now >= least {
                break;
            }
            (found, least) = (more, now);
        }
        if best.as_ref().is_none_or(|(before, _)| least < *before) {
            best = Some((least, found));
        }
    }
    let white = || fit(Form { order: 0, bands: Vec::new() }, omega, variances, nu);
    best.map_or_else(white, |(_, found)| found)
}

/// The spectrum of a given form.
pub(crate) fn fit(form: Form, omega: &[f64], variances: &DMatrix<f64>, nu: f64) -> Smooth {
    let basis = form.basis(omega);
    let mut log_power = variances.clone();
    let mut misfit = 0.0;
    for (mut column, own) in log_power.column_iter_mut().zip(variances.column_iter()) {
        let (mut found, least) = most_likely(&basis, &own.into_owned());
        form.fill_notches(&mut found, nu);
        column.copy_from(&found);
        misfit += least;
    }
    Smooth { form, log_power, misfit }
}

/// Widths of the bands that are looked at: 1, 2, 3, 4, 6, 8, 12 …, to a third of the lines.
fn widths(lines: usize) -> impl Iterator<Item = usize> {
    let powers = (0..usize::BITS).map(|power| 1usize << power);
    let all = powers.flat_map(|p| if p == 1 { vec![1] } else { vec![p, p + p / 2] });
    all.take_while(move |width| *width <= (lines / 3).max(1))
}

/// The band whose own level makes the variances most likely.
fn most_conspicuous(
    variances: &DMatrix<f64>,
    log_power: &DMatrix<f64>,
    nu: f64,
) -> Option<Range<usize>> {
    let (lines, channels) = variances.shape();
    // Sums of the levels below each line.
    let mut below = DMatrix::<f64>::zeros(lines + 1, channels);
    for channel in 0..channels {
        for line in 0..lines {
            let level = variances[(line, channel)] * (-log_power[(line, channel)]).exp();
            below[(line + 1, channel)] = below[(line, channel)] + level;
        }
    }
    let mut best: Option<(f64, Range<usize>)> = None;
    for width in widths(lines) {
        let count = width as f64;
        for start in 0..=lines - width {
            let mut gain = 0.0;
            for channel in 0..channels {
                let sum: f64 = below[(start + width, channel)] - below[(start, channel)];
                let level = sum / count;
                if level > 1.0 {
                    gain += count * (level - 1.0 - level.ln());
                } else if count * nu >= QUIET_DEVIATIONS {
                    gain += count * (level - 1.0 - level.max(FLOOR).ln());
                }
            }
            if best.as_ref().is_none_or(|(most, _)| gain > *most) {
                best = Some((gain, start..start + width));
            }
        }
    }
    best.filter(|(gain, _)| *gain > 0.0).map(|(_, band)| band)
}

/// The log power within a basis of which the variances of a channel are samples, by maximum likelihood, and
/// Σ log p + v/p.
fn most_likely(basis: &DMatrix<f64>, variances: &DVector<f64>) -> (DVector<f64>, f64) {
    let floor = (FLOOR * variances.mean()).max(f64::MIN_POSITIVE);
    let logarithms = variances.map(|v| v.max(floor).ln());
    let mut log_power = basis * basis.tr_mul(&logarithms);
    // The level follows from the sum of the likelihood.
    let level = variances.zip_map(&log_power, |v, log| v * (-log).exp()).mean();
    log_power.add_scalar_mut(level.max(f64::MIN_POSITIVE).ln());
    let mut misfit = deviance(&log_power, variances);
    let tolerance = TOLERANCE * (variances.len() as f64).sqrt();
    for _ in 0..STEPS {
        let excess = variances.zip_map(&log_power, |v, log| v * (-log).exp() - 1.0);
        // The expected information is the identity.
        let mut step = basis.tr_mul(&excess);
        while step.norm() > tolerance {
            let next = &log_power + basis * &step;
            let lower = deviance(&next, variances);
            if lower < misfit {
                (log_power, misfit) = (next, lower);
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

fn deviance(log_power: &DVector<f64>, variances: &DVector<f64>) -> f64 {
    log_power.iter().zip(variances.iter()).map(|(log, v)| log + v * (-log).exp()).sum()
}
