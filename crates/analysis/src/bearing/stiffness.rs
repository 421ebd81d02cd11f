//! Dynamic stiffness line by line, without a model.

use std::f64::consts::TAU;

use nalgebra::{Complex, DVector, Matrix2, Vector2};
use serde::Serialize;

use super::BearingData;
use super::film::Film;
use crate::AnalysisError;

/// Dynamic stiffness H of a film at one frequency; entries xx, xy, yx, yy.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct StiffnessLine {
    /// Frequency, in Hz.
    pub frequency_hz: f64,
    /// Re H = K − ω² M, in N/m.
    pub real: [f64; 4],
    /// Im H = ω C, in N/m.
    pub imaginary: [f64; 4],
    /// Standard errors of the real parts, in N/m; `None` if the noise is not known.
    pub standard_error_real: Option<[f64; 4]>,
    /// Standard errors of the imaginary parts, in N/m; `None` if the noise is not known.
    pub standard_error_imaginary: Option<[f64; 4]>,
}

type Complex2 = Matrix2<Complex<f64>>;

/// Minimum sine of the angle between two displacements whose directions count as independent.
const INDEPENDENT: f64 = 0.1;

/// Maximum relative difference of two frequencies that count as equal.
const SAME: f64 = 1e-9;

/// Returns the dynamic stiffness H that solves G = H D, with the film forces G and the
/// displacements D. Where several tests share a frequency, these tests give H at this frequency.
/// Otherwise two neighbouring lines give H at the frequency midway between them; the fitted film
/// interpolates both lines to this frequency. The fitted baseline is subtracted from H.
pub(super) fn lines(tests: &BearingData, film: &Film) -> Result<Vec<StiffnessLine>, AnalysisError> {
    let omega = tests.data.omega();
    let mut rows: Vec<usize> = (0..omega.len()).collect();
    rows.sort_by(|a, b| omega[*a].total_cmp(&omega[*b]));
    let same = |a: &usize, b: &usize| omega[*b] - omega[*a] <= SAME * omega[*b];
    let groups: Vec<&[usize]> = rows.chunk_by(same).collect();
    let (mut lines, mut next) = (Vec::new(), 0);
    while let Some(group) = groups.get(next) {
        next += 1;
        if group.len() > 1 {
            lines.extend(line(tests, film, group));
        } else if let Some(other) = groups.get(next).filter(|other| other.len() == 1)
            && let Some(measured) = line(tests, film, &[group[0], other[0]])
        {
            lines.push(measured);
            next += 1;
        }
    }
    Ok(lines)
}

/// Returns H from rows at nearly the same frequency; `None` if their displacements have the same
/// direction.
fn line(tests: &BearingData, film: &Film, rows: &[usize]) -> Option<StiffnessLine> {
    let data = &tests.data;
    let middle = rows.iter().map(|row| data.omega()[*row]).sum::<f64>() / rows.len() as f64;
    let two = |matrix: &nalgebra::DMatrix<Complex<f64>>, row: usize| {
        Vector2::new(matrix[(row, 0)], matrix[(row, 1)])
    };
    let at_middle = modelled(&film.rig, middle);
    let (mut forces, mut power) = (Complex2::zeros(), Complex2::zeros());
    for row in rows {
        let d = two(data.displacement(), *row);
        let bridge = at_middle - modelled(&film.rig, data.omega()[*row]);
        let force = two(data.force(), *row) + bridge * d;
        forces += force * d.adjoint();
        power += d * d.adjoint();
    }
    // For two rows with displacements d₁ and d₂, the square root of det(d₁d₁ᴴ + d₂d₂ᴴ) is |det D|,
    // where D has the columns d₁ and d₂. Divided by the mean of |d₁|² and |d₂|², it is at most the
    // sine of the angle between d₁ and d₂.
    let lengths = power[(0, 0)].re + power[(1, 1)].re;
    if power.determinant().norm().sqrt() < INDEPENDENT * 0.5 * lengths {
        return None;
    }
    let inverse = power.lu().solve(&Complex2::identity())?;
    let mut h = forces * inverse;
    let mut variance = data.noise().map(|noise| {
        let mut variance = [[0.0; 4]; 2];
        for row in rows {
            let weight = (two(data.displacement(), *row).adjoint() * inverse).transpose();
            let powers = error_powers(noise.covariance(*row), &h);
            for (at, (a, b)) in [(0, 0), (0, 1), (1, 0), (1, 1)].into_iter().enumerate() {
                let power = 0.5 * powers[a] * weight[b].norm_sqr();
                variance[0][at] += power;
                variance[1][at] += power;
            }
        }
        variance
    });
    if let Some((baseline, covariance)) = &film.baseline {
        h -= modelled(baseline, middle);
        let square = middle * middle;
        for (at, (real, imaginary)) in
            variance.iter_mut().flat_map(|[re, im]| re.iter_mut().zip(im)).enumerate()
        {
            *real += covariance[(at, at)] + square * square * covariance[(8 + at, 8 + at)]
                - 2.0 * square * covariance[(at, 8 + at)];
            *imaginary += square * covariance[(4 + at, 4 + at)];
        }
    }
    let entries = [h[(0, 0)], h[(0, 1)], h[(1, 0)], h[(1, 1)]];
    let root = |variance: [f64; 4]| variance.map(|v| v.max(0.0).sqrt());
    Some(StiffnessLine {
        frequency_hz: middle / TAU,
        real: entries.map(|z| z.re),
        imaginary: entries.map(|z| z.im),
        standard_error_real: variance.map(|[real, _]| root(real)),
        standard_error_imaginary: variance.map(|[_, imaginary]| root(imaginary)),
    })
}

/// Returns the powers of both components of ΔG − H ΔD, from the covariance of displacement D and
/// film force G at a line.
fn error_powers(covariance: &nalgebra::DMatrix<Complex<f64>>, h: &Complex2) -> [f64; 2] {
    let block = |i: usize, j: usize| -> Complex2 {
        covariance.fixed_view::<2, 2>(2 * i, 2 * j).into_owned()
    };
    let error =
        block(1, 1) - h * block(0, 1) - block(1, 0) * h.adjoint() + h * block(0, 0) * h.adjoint();
    [error[(0, 0)].re.max(0.0), error[(1, 1)].re.max(0.0)]
}

/// Returns K − ω² M + iω C for twelve coefficients.
pub(super) fn modelled(coefficients: &DVector<f64>, omega: f64) -> Complex2 {
    let entry = |at: usize| {
        let (k, c, m) = (coefficients[at], coefficients[4 + at], coefficients[8 + at]);
        Complex::new(k - omega * omega * m, omega * c)
    };
    Complex2::new(entry(0), entry(1), entry(2), entry(3))
}
