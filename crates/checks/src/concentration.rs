//! Lines with most of the misfit of a fit of spectra.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};

use super::limits::{CONCENTRATED, DISTURBED_ALONE, MOST_DISTURBED, SIGNIFICANCE};
use super::limits::{LINES_PER_DISTURBED, SAME_LINE};
use super::misfit::Concentration;

/// Weighted residual of one record.
pub(super) struct Part<'a> {
    /// Angular frequency of each line, in rad/s.
    pub omega: &'a [f64],
    /// Number of channels.
    pub dof: usize,
    /// Residuals: for each line and channel real and imaginary part.
    pub values: &'a DVector<f64>,
    /// Rows of the matrix Q for this record; the residuals of all records together have the
    /// covariance I − QQᵀ.
    pub explained: &'a DMatrix<f64>,
    /// Expected square of a residual.
    pub unit: f64,
}

/// Line at one frequency: the index of each record that has this line, and the row of its first
/// residual.
struct Line {
    omega: f64,
    rows: Vec<(usize, usize)>,
}

/// Finds the few lines that cause the misfit: at most [`MOST_DISTURBED`] lines, and at most an
/// eighth of all lines, with at least the share [`CONCENTRATED`] of the excess power (residual
/// power minus noise power). `None` if there are no such lines, or if the other lines have more
/// than [`DISTURBED_ALONE`] times the noise power: a wrong model, too, has its largest errors on
/// few lines, near a resonance.
///
/// Lines are removed from the linearised fit one by one, each time the line with the largest
/// residual. This also removes the effect of the line on the residuals of the other lines.
///
/// # Source
/// Cook & Weisberg, *Residuals and Influence in Regression* (1982), deletion of several cases.
pub(super) fn concentration(parts: &[Part<'_>]) -> Option<Concentration> {
    let lines = lines(parts);
    let parameters = parts.first()?.explained.ncols();
    let power = |values: &[DVector<f64>]| -> f64 { values.iter().map(DVector::norm_squared).sum() };
    let count: f64 = parts.iter().map(|part| part.values.len() as f64).sum();
    let noise: f64 = parts.iter().map(|part| part.unit * part.values.len() as f64).sum();
    let expected = |remaining: f64| noise / count * (remaining - parameters as f64);
    let start: Vec<DVector<f64>> = parts.iter().map(|part| part.values.clone()).collect();
    let excess = power(&start) - expected(count);
    if excess <= 0.0 {
        return None;
    }
    let (mut values, mut chosen): (_, Vec<usize>) = (start.clone(), Vec::new());
    // `information` is I − Q_Sᵀ Q_S and `moved` is Q_Sᵀ e_S, with the rows Q_S and the residuals
    // e_S of the removed lines S.
    let mut information = DMatrix::identity(parameters, parameters);
    let mut moved = DVector::zeros(parameters);
    let (mut remaining, mut share, mut ratio) = (count, 0.0, f64::INFINITY);
    for _ in 0..MOST_DISTURBED.min(lines.len() / LINES_PER_DISTURBED) {
        let of_line = |line: &Line| -> f64 {
            let powers = line.rows.iter().map(|(record, row)| {
                values[*record].rows(*row, 2 * parts[*record].dof).norm_squared()
            });
            powers.sum()
        };
        let candidates = (0..lines.len()).filter(|at| !chosen.contains(at));
        let (next, _) =
            candidates.map(|at| (at, of_line(&lines[at]))).max_by(|a, b| a.1.total_cmp(&b.1))?;
        chosen.push(next);
        for (record, row) in &lines[next].rows {
            let rows = 2 * parts[*record].dof;
            let q = parts[*record].explained.rows(*row, rows);
            information -= q.tr_mul(&q);
            moved += q.tr_mul(&start[*record].rows(*row, rows));
            remaining -= rows as f64;
        }
        values.clone_from(&start);
        if parameters > 0 {
            let step = information.clone().lu().solve(&moved)?;
            for (part, values) in parts.iter().zip(&mut values) {
                *values += part.explained * &step;
            }
        }
        for (record, row) in chosen.iter().flat_map(|at| &lines[*at].rows) {
            values[*record].rows_mut(*row, 2 * parts[*record].dof).fill(0.0);
        }
        let candidates = power(&values);
        share = 1.0 - ((candidates - expected(remaining)) / excess).max(0.0);
        ratio = candidates / expected(remaining);
        if share >= 0.99 {
            break;
        }
    }
    let mut frequencies_hz: Vec<f64> = chosen.iter().map(|at| lines[*at].omega / TAU).collect();
    frequencies_hz.sort_by(f64::total_cmp);
    let alone = share >= CONCENTRATED && ratio <= DISTURBED_ALONE;
    let all_hz: Vec<f64> = lines.iter().map(|line| line.omega / TAU).collect();
    let multiples_of_hz = common_divisor(&frequencies_hz, &all_hz);
    alone.then_some(Concentration { frequencies_hz, share, multiples_of_hz })
}

/// Returns the frequency whose multiples are near all `chosen` lines: the distance is less than the
/// spacing of the lines in `all`. `None` if this agreement may be due to chance, or if there is
/// only one line in `chosen` or in `all`.
///
/// The candidates are the lowest chosen frequency divided by 1, 2, 3, … The hypergeometric
/// distribution gives the probability that all lines of a random choice are multiples of one
/// candidate. This probability is multiplied by the number of candidates.
fn common_divisor(chosen: &[f64], all: &[f64]) -> Option<f64> {
    let spacing = all.windows(2).map(|pair| pair[1] - pair[0]).reduce(f64::min)?;
    let lowest = *chosen.first().filter(|_| chosen.len() > 1)?;
    let near = |hz: f64, base: f64| (hz - (hz / base).round().max(1.0) * base).abs() < spacing;
    let candidates: Vec<f64> = (1_u32..)
        .map(|part| lowest / f64::from(part))
        .take_while(|base| *base > 2.0 * spacing)
        .collect();
    let (probability, divisor) = candidates
        .iter()
        .map(|base| refined(chosen, *base))
        .filter(|base| chosen.iter().all(|hz| near(*hz, *base)))
        .map(|base| {
            let multiples = all.iter().filter(|hz| near(**hz, base)).count();
            // Probability that all draws without replacement are multiples: c/n · (c − 1)/(n − 1) …
            let draws = (0..chosen.len())
                .map(|drawn| (multiples - drawn) as f64 / (all.len() - drawn) as f64);
            (draws.product::<f64>(), base)
        })
        .min_by(|a, b| a.0.total_cmp(&b.0))?;
    (probability * candidates.len() as f64 <= SIGNIFICANCE).then_some(divisor)
}

/// Returns the frequency whose multiples are nearest to the `chosen` lines, by least squares. The
/// order of each line is taken from the estimate `first`.
fn refined(chosen: &[f64], first: f64) -> f64 {
    let orders = chosen.iter().map(|hz| (hz / first).round().max(1.0));
    let (products, squares) = chosen
        .iter()
        .zip(orders)
        .fold((0.0, 0.0), |sums, (hz, order)| (sums.0 + hz * order, sums.1 + order * order));
    products / squares
}

/// Returns the lines of all records by rising frequency.
fn lines(parts: &[Part<'_>]) -> Vec<Line> {
    let rows = parts.iter().enumerate().flat_map(|(record, part)| {
        let line = move |(at, omega): (usize, &f64)| (*omega, record, 2 * part.dof * at);
        part.omega.iter().enumerate().map(line)
    });
    let mut rows: Vec<(f64, usize, usize)> = rows.collect();
    rows.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut lines: Vec<Line> = Vec::new();
    for (omega, record, row) in rows {
        match lines.last_mut() {
            Some(last) if omega - last.omega <= SAME_LINE * omega => last.rows.push((record, row)),
            _ => lines.push(Line { omega, rows: vec![(record, row)] }),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn multiples_of_a_rotation_are_named_and_chance_is_not() {
        let all: Vec<f64> = (6..=64).map(|line| 4.0 * f64::from(line)).collect();
        // The lines are 4 Hz apart. The frequency of rotation, 50 Hz, lies between two lines; its
        // multiple 100 Hz is a line.
        let of_rotation = [48.0, 52.0, 100.0, 148.0, 152.0, 200.0];
        let divisor = common_divisor(&of_rotation, &all).unwrap();
        assert!((divisor - 50.0).abs() < 0.5, "{divisor}");
        assert_eq!(common_divisor(&[48.0, 100.0], &all), None);
        assert_eq!(common_divisor(&[60.0, 104.0, 172.0, 236.0], &all), None);
        assert_eq!(common_divisor(&[60.0], &all), None);
        assert_eq!(common_divisor(&[60.0], &[60.0]), None);
    }
}
