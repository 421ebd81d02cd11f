//! Detection of a second excitation during a decay.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::autoregression::Autoregression;
use super::fit::{Data, Fit};
use super::limits::{FALSE_DECAY, RESTART_SAMPLES};
use super::poles::linear_columns;
use super::select::Search;

/// Returns the first sample of a second excitation, counted from 0, and the decrease of the
/// Bayesian information criterion if the amplitudes before and after this sample are independent.
/// `None` if no sample lowers the criterion.
///
/// # Source
/// Bai & Perron (1998), Econometrica 66, 47–78 (changes of coefficients at unknown times); Schwarz
/// (1978), Annals of Statistics 6, 461–464.
pub(super) fn restart(data: &Data, fit: &Fit) -> Option<(usize, f64)> {
    let len = data.len();
    let coarse = (len / RESTART_SAMPLES).max(1);
    let (_, sample) = best(data, fit, (coarse..len).step_by(coarse).collect())?;
    let around = sample.saturating_sub(coarse) + 1..(sample + coarse).min(len);
    let fine = (around.len() / RESTART_SAMPLES).max(1);
    let (gain, sample) = best(data, fit, around.step_by(fine).collect())?;
    let unknowns = linear_columns(&fit.poles, data.constant) * data.channels() + 1;
    let decrease = gain - unknowns as f64 * (len as f64).ln();
    (decrease > 0.0).then_some((sample, decrease))
}

/// Returns the sample of a second excitation, counted from 0, and the p-value of the prediction
/// errors at this sample. The function is for a response that coloured noise describes better than
/// decays. `None` if no prediction error is larger than chance allows, or if the response after
/// this sample is not a decay.
///
/// Without an excitation, the free response predicts the next sample from the preceding ones, as an
/// autoregression does. A hit is an error of this prediction at one sample.
///
/// # Source
/// Fox (1972), Journal of the Royal Statistical Society B 34, 350–363 (innovation outliers), with
/// Bonferroni's bound for the number of samples.
pub(super) fn shock(data: &Data, fit: &Fit) -> Option<(usize, f64)> {
    let residual = data.residual(fit);
    let first = fit.noise.iter().map(Autoregression::order).max()?;
    if first == 0 {
        return None;
    }
    let mut energies = vec![0.0; data.len().checked_sub(first)?];
    for (column, noise) in residual.column_iter().zip(&fit.noise) {
        let errors = noise.whitened(column.clone_owned().as_slice(), 0, 0);
        let errors = &errors[first..];
        let variance = errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64;
        energies.iter_mut().zip(errors).for_each(|(energy, e)| *energy += e * e / variance);
    }
    let (at, largest) = energies.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1))?;
    let distribution = ChiSquared::new(data.channels() as f64).ok()?;
    let p_value = (energies.len() as f64 * distribution.sf(*largest)).min(1.0);
    let sample = first + at;
    let later = data.samples.rows_range(sample..).into_owned();
    let later = Data { samples: later, constant: data.constant };
    let decays = || Some(!Search::new(&later).best(1)?.best.fit.poles.is_empty());
    (p_value < FALSE_DECAY && decays()?).then_some((sample, p_value))
}

/// Returns the largest decrease of minus twice the log-likelihood that a second excitation at a
/// candidate sample causes, and this sample.
fn best(data: &Data, fit: &Fit, candidates: Vec<usize>) -> Option<(f64, usize)> {
    let sums = sums(data, fit, &candidates);
    let (gram, products) = sums.last()?;
    let squares: Vec<f64> = data.samples.column_iter().map(|x| x.norm_squared()).collect();
    let whole = explained(gram, products)?;
    let len = data.len() as f64;
    let gain = |(at, sample): (usize, &usize)| {
        let (before, of_before) = &sums[at];
        let first = explained(before, of_before)?;
        let second = explained(&(gram - before), &(products - of_before))?;
        let parts = (0..squares.len()).map(|c| {
            let ratio = (squares[c] - first[c] - second[c]) / (squares[c] - whole[c]);
            -len * ratio.max(f64::MIN_POSITIVE).ln()
        });
        Some((parts.sum::<f64>(), *sample)).filter(|(gain, _)| gain.is_finite())
    };
    candidates.iter().enumerate().filter_map(gain).max_by(|a, b| a.0.total_cmp(&b.0))
}

/// Returns BᵀB and BᵀX for the rows before each candidate sample, with the columns B of the poles
/// and the record X; the last entry is for all rows.
fn sums(data: &Data, fit: &Fit, candidates: &[usize]) -> Vec<(DMatrix<f64>, DMatrix<f64>)> {
    let linear = linear_columns(&fit.poles, data.constant);
    let mut gram = DMatrix::zeros(linear, linear);
    let mut products = DMatrix::zeros(linear, data.channels());
    let (mut sums, mut first, mut next) = (Vec::new(), 0, 0);
    for basis in data.chunks(&fit.poles) {
        let end = first + basis.nrows();
        let mut row = first;
        while row < end {
            let stop = candidates.get(next).copied().unwrap_or(end).min(end);
            let part = basis.view((row - first, 0), (stop - row, linear));
            gram += part.tr_mul(&part);
            products += part.tr_mul(&data.samples.rows(row, stop - row));
            row = stop;
            while candidates.get(next) == Some(&row) {
                sums.push((gram.clone(), products.clone()));
                next += 1;
            }
        }
        first = end;
    }
    sums.push((gram, products));
    sums
}

/// Returns, for each channel, the part of its sum of squares that the columns of the poles explain.
fn explained(gram: &DMatrix<f64>, products: &DMatrix<f64>) -> Option<Vec<f64>> {
    let scale: DVector<f64> = gram.diagonal().map(|g| if g > 0.0 { g.sqrt().recip() } else { 0.0 });
    let scaling = DMatrix::from_diagonal(&scale);
    let scaled = &scaling * gram * &scaling;
    let right = &scaling * products;
    let solution = scaled.cholesky()?.solve(&right);
    Some((0..products.ncols()).map(|c| solution.column(c).dot(&right.column(c))).collect())
}
