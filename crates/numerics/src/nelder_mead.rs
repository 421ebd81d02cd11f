//! Minimum of a function of a few variables, without derivatives.

use crate::time_limit;

/// Returns the best point from a search at `start`, with an initial simplex of edge `step`. The
/// search ends after `rounds` rounds, or earlier if the values at the corners of the simplex differ
/// by at most `settled` or the [time limit](crate::time_limit) is over. A point is a list of
/// coordinates, which all have the same unit.
///
/// # Source
/// Nelder & Mead (1965), with the usual coefficients 1, 2, ½, ½.
pub fn minimise(
    cost: impl Fn(&[f64]) -> f64,
    start: &[f64],
    step: f64,
    settled: f64,
    rounds: usize,
) -> Vec<f64> {
    let n = start.len();
    let mut simplex: Vec<(f64, Vec<f64>)> = (0..=n)
        .map(|i| {
            let mut point = start.to_vec();
            if i > 0 {
                point[i - 1] += step;
            }
            (cost(&point), point)
        })
        .collect();
    for _ in 0..rounds {
        simplex.sort_by(|a, b| a.0.total_cmp(&b.0));
        if simplex[n].0 - simplex[0].0 < settled || time_limit::is_over() {
            break;
        }
        let centre: Vec<f64> =
            (0..n).map(|j| simplex[..n].iter().map(|v| v.1[j]).sum::<f64>() / n as f64).collect();
        let along = |by: f64| -> (f64, Vec<f64>) {
            let worst = &simplex[n].1;
            let point: Vec<f64> = centre.iter().zip(worst).map(|(c, w)| c + by * (c - w)).collect();
            (cost(&point), point)
        };
        let reflected = along(1.0);
        let next = if reflected.0 < simplex[0].0 {
            let expanded = along(2.0);
            if expanded.0 < reflected.0 { expanded } else { reflected }
        } else if reflected.0 < simplex[n - 1].0 {
            reflected
        } else {
            let inner = along(if reflected.0 < simplex[n].0 { 0.5 } else { -0.5 });
            if inner.0 < simplex[n].0.min(reflected.0) { inner } else { (f64::NAN, Vec::new()) }
        };
        if next.0.is_nan() {
            shrink(&mut simplex, &cost);
        } else {
            simplex[n] = next;
        }
    }
    simplex.sort_by(|a, b| a.0.total_cmp(&b.0));
    simplex.swap_remove(0).1
}

/// Moves all other corners of the simplex half-way towards its best point.
fn shrink(simplex: &mut [(f64, Vec<f64>)], cost: impl Fn(&[f64]) -> f64) {
    let best = simplex[0].1.clone();
    for vertex in &mut simplex[1..] {
        for (x, b) in vertex.1.iter_mut().zip(&best) {
            *x = 0.5 * (*x + b);
        }
        vertex.0 = cost(&vertex.1);
    }
}

#[cfg(test)]
mod tests {
    use super::minimise;

    #[test]
    fn finds_the_bottom_of_rosenbrocks_valley() {
        let valley = |p: &[f64]| 100.0 * (p[1] - p[0] * p[0]).powi(2) + (1.0 - p[0]).powi(2);
        let found = minimise(valley, &[-1.2, 1.0], 0.5, 1e-14, 500);
        assert!((found[0] - 1.0).abs() < 1e-5 && (found[1] - 1.0).abs() < 1e-5, "{found:?}");
    }
}
