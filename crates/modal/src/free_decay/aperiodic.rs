//! Decays without oscillation (overdamped responses).

use nalgebra::{DMatrix, DVector};

use super::backbone::inverse;
use super::fit::Data;
use super::limits::{FASTEST_DECAY, FREE_DECAY_SURE, RATE_REFINEMENTS, SLOWEST_RETURN};

/// Rates of decays without oscillation, their standard errors, and the information criterion of the
/// fit.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Aperiodic {
    /// Decay rates, in rising order, each with its standard error, in nepers per sample.
    pub rates: Vec<[f64; 2]>,
    /// Bayesian information criterion of the decays with white noise.
    pub criterion: f64,
}

/// Returns one or two decays without oscillation: the number with the lower Bayesian information
/// criterion. `None` if no decay lowers the criterion, or if the data do not determine a rate.
///
/// # Source
/// Schwarz (1978), Annals of Statistics 6, 461–464; Golub & Pereyra (1973), SIAM Journal on
/// Numerical Analysis 10, 413–432.
pub(super) fn aperiodic(data: &Data) -> Option<Aperiodic> {
    let without_decay = criterion(data, &[])?;
    let one = searched(data, Vec::new())?;
    let criterion_of_one = criterion(data, &one)?;
    let two = searched(data, one.clone());
    let criterion_of_two =
        two.as_ref().and_then(|two| criterion(data, two)).unwrap_or(f64::INFINITY);
    let (rates, criterion) = if criterion_of_two < criterion_of_one {
        (two?, criterion_of_two)
    } else {
        (one, criterion_of_one)
    };
    if criterion >= without_decay {
        return None;
    }
    let errors = errors(data, &rates)?;
    let mut rates: Vec<[f64; 2]> =
        rates.into_iter().zip(errors).map(|(rate, error)| [rate, error]).collect();
    // The rates are undetermined if two decays coincide or a decay only fits noise.
    if rates.iter().any(|[rate, error]| FREE_DECAY_SURE * error > *rate || error.is_nan()) {
        return None;
    }
    rates.sort_by(|a, b| a[0].total_cmp(&b[0]));
    Some(Aperiodic { rates, criterion })
}

/// Returns the Bayesian information criterion of a fit from the sums of squares of its residual and
/// its number of unknowns.
pub(super) fn information(data: &Data, squares: impl Iterator<Item = f64>, unknowns: usize) -> f64 {
    let len = data.len() as f64;
    let level = |square: f64| len * (square / len).max(f64::MIN_POSITIVE).ln();
    squares.map(level).sum::<f64>() + unknowns as f64 * len.ln()
}

fn criterion(data: &Data, rates: &[f64]) -> Option<f64> {
    let unknowns = rates.len() * (1 + data.channels());
    let residual = residual(data, rates)?;
    Some(information(data, residual.column_iter().map(|e| e.norm_squared()), unknowns))
}

/// Returns the residual of the samples after a least-squares fit of decays with these `rates`, and
/// of a constant if `data` includes one.
fn residual(data: &Data, rates: &[f64]) -> Option<DMatrix<f64>> {
    let columns = rates.len() + usize::from(data.constant);
    if columns == 0 {
        return Some(data.samples.clone());
    }
    let basis = DMatrix::from_fn(data.len(), columns, |row, column| match rates.get(column) {
        Some(rate) => (-rate * row as f64).exp(),
        None => 1.0,
    });
    let solution = basis.tr_mul(&basis).cholesky()?.solve(&basis.tr_mul(&data.samples));
    Some(&data.samples - basis * solution)
}

/// Adds the best further rate from a grid to `rates`, and afterwards refines all rates in turn.
fn searched(data: &Data, rates: Vec<f64>) -> Option<Vec<f64>> {
    let slowest = SLOWEST_RETURN / data.len() as f64;
    let steps = ((FASTEST_DECAY / slowest).ln() / 0.5).ceil() as i32;
    let grid = (0..=steps).map(|step| slowest * (0.5 * f64::from(step)).exp());
    let extended = grid.map(|rate| [rates.as_slice(), &[rate]].concat());
    let cost = |rates: &Vec<f64>| criterion(data, rates).unwrap_or(f64::INFINITY);
    let mut best = extended.min_by(|a, b| cost(a).total_cmp(&cost(b)))?;
    let (mut least, mut log_step) = (cost(&best), 0.5);
    for _ in 0..RATE_REFINEMENTS {
        let mut improved = false;
        for at in 0..best.len() {
            for sign in [-1.0, 1.0] {
                let mut moved = best.clone();
                moved[at] = (moved[at] * f64::exp(sign * log_step)).clamp(slowest, FASTEST_DECAY);
                let moved_cost = cost(&moved);
                if moved_cost < least {
                    (best, least, improved) = (moved, moved_cost, true);
                }
            }
        }
        if !improved {
            log_step *= 0.5;
        }
    }
    least.is_finite().then_some(best)
}

/// Returns the standard errors of the rates from the derivatives of the residual.
fn errors(data: &Data, rates: &[f64]) -> Option<Vec<f64>> {
    let residuals = residual(data, rates)?;
    let unknowns = rates.len() + usize::from(data.constant);
    let freedom = data.len().checked_sub(unknowns + 1)? as f64;
    let mut information = DMatrix::zeros(rates.len(), rates.len());
    let slopes = |at: usize| {
        let moved = |step: f64| {
            let mut moved = rates.to_vec();
            moved[at] *= 1.0 + step;
            residual(data, &moved)
        };
        Some((moved(1e-4)? - moved(-1e-4)?) / (2e-4 * rates[at]))
    };
    let slopes = (0..rates.len()).map(slopes).collect::<Option<Vec<DMatrix<f64>>>>()?;
    for channel in 0..data.channels() {
        let variance = residuals.column(channel).norm_squared() / freedom;
        let columns: Vec<DVector<f64>> =
            slopes.iter().map(|slope| slope.column(channel).into_owned()).collect();
        let jacobian = DMatrix::from_columns(&columns);
        information += jacobian.tr_mul(&jacobian) / variance.max(f64::MIN_POSITIVE);
    }
    let covariance = inverse(&information)?;
    Some(covariance.diagonal().iter().map(|variance| variance.max(0.0).sqrt()).collect())
}
