//! Symmetry of the mass matrix, and of damping and stiffness but for gains.

use mechid_estimate::Estimate;
use mechid_model::{Matrix, Parameter};
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::finding::{Finding, PValue};
use super::thresholds::{ASYMMETRY, GAIN_AGREES, GAIN_NEAR, GAIN_SHOWS};

/// Tells how far the estimated mass matrix is from a symmetric one; `None` where no two masses could differ.
///
/// The kinetic energy ½ ẋᵀMẋ has a symmetric M, whatever bearings, gyroscopic forces and controls make of C and K: an M
/// that is not symmetric says that forces and displacements are not those of the same points and directions.
///
/// The p-value is the probability that one pair m_ij, m_ji of a symmetric M differs by as many standard errors:
/// two-sided, Student's t times the number of pairs.
///
/// # Source
/// Meirovitch, *Fundamentals of Vibrations* (2001), section 4.4 (the kinetic energy); the test is ours.
pub fn mass_symmetry(estimate: &Estimate) -> Option<Finding> {
    let (n, unknowns) = (estimate.dof(), estimate.unknowns());
    let freedom = estimate.degrees_of_freedom();
    if unknowns.is_symmetric(Matrix::Mass) || freedom == 0 {
        return None;
    }
    let mut places = vec![None; n * n];
    for (at, p) in unknowns.free().iter().enumerate().filter(|(_, p)| p.matrix() == Matrix::Mass) {
        places[p.row() * n + p.column()] = Some(at);
    }
    let (mass, spread) = (estimate.mass(), estimate.spread());
    let student = StudentsT::new(0.0, 1.0, freedom as f64).expect("positive degrees of freedom");
    let mut pairs = 0;
    let mut worst: Option<(f64, Finding)> = None;
    for (i, j) in (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j))) {
        let free = [places[i * n + j], places[j * n + i]];
        let variance = match free {
            [None, None] => continue,
            [Some(one), None] | [None, Some(one)] => spread.of(one),
            [Some(p), Some(q)] => spread.of(p) + spread.of(q) - 2.0 * spread.between(p, q),
        };
        let difference = mass[(i, j)] - mass[(j, i)];
        let standard_error = variance.max(0.0).sqrt();
        if !(difference.is_finite() && standard_error.is_finite()) {
            continue;
        }
        pairs += 1;
        let scale = (mass[(i, i)] * mass[(j, j)]).abs().sqrt();
        let alone = match difference.abs() / standard_error {
            _ if difference.abs() <= ASYMMETRY * scale => 1.0,
            ratio if ratio.is_finite() => 2.0 * student.sf(ratio),
            _ => 0.0,
        };
        if worst.as_ref().is_none_or(|(least, _)| alone < *least) {
            let finding = Finding::MassSymmetry {
                row: i,
                column: j,
                above: mass[(i, j)],
                below: mass[(j, i)],
                standard_error,
                p_value: PValue::of(alone),
            };
            worst = Some((alone, finding));
        }
    }
    let (alone, mut finding) = worst?;
    if let Some(p_value) = finding.p_value_mut() {
        *p_value = PValue::of((alone * f64::from(pairs)).min(1.0));
    }
    Some(finding)
}

/// Tells of a pair of degrees of freedom between which damping and stiffness are symmetric but for one factor, the same
/// in both; `None` where there is none. Of several it is the one that is known best.
///
/// A response or a force that is read g times too large multiplies a column or a row of C and K alike, and makes
/// c_ij/c_ji = k_ij/k_ji = g of symmetric matrices, while a diagonal M stays symmetric. Bearings and gyroscopic forces,
/// which make C and K not symmetric, have another ratio in each. The factor has to show in both by itself.
///
/// # Source
/// Ours: each ratio has its error by the delta method.
pub fn gain_symmetry(estimate: &Estimate) -> Option<Finding> {
    let n = estimate.dof();
    let free = estimate.unknowns().free();
    let place = |matrix: Matrix, row: usize, column: usize| {
        let is_it = |p: &Parameter| (p.matrix(), p.row(), p.column()) == (matrix, row, column);
        free.iter().position(is_it)
    };
    let spread = estimate.spread();
    // Logarithm of the ratio of two entries, and its variance.
    let ratio = |matrix: Matrix, i: usize, j: usize| -> Option<[f64; 2]> {
        let all = match matrix {
            Matrix::Mass => estimate.mass(),
            Matrix::Damping => estimate.damping(),
            Matrix::Stiffness => estimate.stiffness(),
        };
        let (above, below) = (all[(i, j)], all[(j, i)]);
        let (p, q) = (place(matrix, i, j)?, place(matrix, j, i)?);
        let variance = spread.of(p) / above.powi(2) + spread.of(q) / below.powi(2)
            - 2.0 * spread.between(p, q) / (above * below);
        let log = (above / below).ln();
        (log.is_finite() && variance > 0.0 && log * log > GAIN_SHOWS.powi(2) * variance)
            .then_some([log, variance])
    };
    let pairs = (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j)));
    let found = pairs.filter_map(|(i, j)| {
        let [of_c, variance_c] = ratio(Matrix::Damping, i, j)?;
        let [of_k, variance_k] = ratio(Matrix::Stiffness, i, j)?;
        let apart = (of_c - of_k).powi(2);
        let noise = GAIN_AGREES.powi(2) * (variance_c + variance_k);
        let weight = [variance_c.recip(), variance_k.recip()];
        let log = (weight[0] * of_c + weight[1] * of_k) / (weight[0] + weight[1]);
        let standard_error = (weight[0] + weight[1]).sqrt().recip();
        (apart < noise.max((GAIN_NEAR * of_k).powi(2))).then_some((i, j, log, standard_error))
    });
    let (i, j, log, standard_error) = found.max_by(|a, b| {
        let shows = |(.., log, error): &(usize, usize, f64, f64)| (log / error).abs();
        shows(a).total_cmp(&shows(b))
    })?;
    let (row, column, log) = if log >= 0.0 { (i, j, log) } else { (j, i, -log) };
    Some(Finding::Gain { row, column, ratio: log.exp(), standard_error })
}
