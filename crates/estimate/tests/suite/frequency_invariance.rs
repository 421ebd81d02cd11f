//! Changes that must not affect the result: units, the order of the degrees of freedom, the
//! direction of the axes, a second copy of the data.

use mechid_estimate::frequency_domain::{equation_error, instrumental_variables, output_error};
use mechid_estimate::{Estimate, Unknowns};
use mechid_model::ResponseQuantity;
use mechid_spectra::{FrequencyData, NoiseSpectrum};
use nalgebra::{Complex, DMatrix, dmatrix};
use proptest::prelude::*;

use crate::common::{bearing, displacements, forces};

const LINES: usize = 40;

/// Returns the angular frequencies, forces and displacements of a measurement of the bearing, with
/// noise on the displacements.
fn measurement(seed: u64) -> (Vec<f64>, DMatrix<Complex<f64>>, DMatrix<Complex<f64>>) {
    let lines: Vec<usize> = (1..=LINES).collect();
    let omega: Vec<f64> = lines.iter().map(|n| *n as f64 * 0.1).collect();
    let force = forces(&lines, 2, 1.0);
    let mut motion = displacements(&bearing(), &omega, &force);
    let size = 1e-3 * motion.norm();
    for (at, x) in motion.iter_mut().enumerate() {
        let turn = (at as f64 + 0.5) * (seed as f64 + 1.7);
        *x += Complex::from_polar(size * (1.3 * turn).sin(), turn * turn);
    }
    (omega, force, motion)
}

/// Returns the data of the measurement with forces P F and displacements Q X.
fn data(seed: u64, p: &DMatrix<f64>, q: &DMatrix<f64>) -> FrequencyData {
    let (omega, force, motion) = measurement(seed);
    let turned =
        |rows: DMatrix<Complex<f64>>, by: &DMatrix<f64>| rows * by.transpose().map(Complex::from);
    let mut covariance = DMatrix::zeros(4, 4);
    covariance.view_mut((0, 0), (2, 2)).copy_from(&(q * q.transpose()).map(Complex::from));
    let noise = NoiseSpectrum::new(omega.clone(), vec![covariance; LINES]).unwrap();
    let (force, motion) = (turned(force, p), turned(motion, q));
    FrequencyData::from_amplitudes(omega, force, motion, ResponseQuantity::Displacement)
        .unwrap()
        .with_noise(noise)
        .unwrap()
}

fn estimates(p: &DMatrix<f64>, q: &DMatrix<f64>) -> [Estimate; 3] {
    let (first, second) = (data(1, p, q), data(2, p, q));
    let unknowns = Unknowns::unknown_mass(2).unwrap();
    [
        equation_error(&first, &unknowns).unwrap(),
        instrumental_variables(&first, &second, &unknowns).unwrap(),
        output_error(&first, &unknowns).unwrap().estimate,
    ]
}

/// Returns the matrix, 12 × 12, that maps the entries of M, C and K to the entries of P M Q⁻¹, P C
/// Q⁻¹ and P K Q⁻¹.
fn map(p: &DMatrix<f64>, q: &DMatrix<f64>) -> DMatrix<f64> {
    let inverse = q.clone().lu().solve(&DMatrix::identity(2, 2)).unwrap();
    DMatrix::from_fn(12, 12, |to, from| {
        if to / 4 != from / 4 {
            return 0.0;
        }
        let (i, j, k, l) = (to % 4 / 2, to % 2, from % 4 / 2, from % 2);
        p[(i, k)] * inverse[(l, j)]
    })
}

/// Returns random changes P of the forces and Q of the displacements: scales of force and length,
/// an exchange of the directions, and a rotation of the axes.
fn change() -> impl Strategy<Value = (DMatrix<f64>, DMatrix<f64>)> {
    let scale = || (-3.0..3.0f64).prop_map(|e| 10f64.powf(e));
    (scale(), scale(), any::<bool>(), -3.2..3.2f64).prop_map(|(force, length, exchange, angle)| {
        let (sin, cos) = angle.sin_cos();
        let mut turn = dmatrix![cos, -sin; sin, cos];
        if exchange {
            turn.swap_rows(0, 1);
        }
        (&turn * force, turn * length)
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn units_order_and_axes_do_not_matter((p, q) in change()) {
        let one = DMatrix::identity(2, 2);
        let map = map(&p, &q);
        for (before, after) in estimates(&one, &one).iter().zip(&estimates(&p, &q)) {
            let values = |e: &Estimate| {
                DMatrix::from_iterator(12, 1, e.parameters().map(|p| p.value))
            };
            let expected = &map * values(before);
            let covariance = &map * before.covariance() * map.transpose();
            for at in 0..12 {
                // The error is in standard errors. The search ends within 1e-5 standard errors of
                // the minimum; rounding is far smaller.
                let error = (values(after)[at] - expected[at]).abs();
                prop_assert!(error < 1e-4 * covariance[(at, at)].sqrt());
                for other in 0..12 {
                    let size = (covariance[(at, at)] * covariance[(other, other)]).sqrt();
                    let error = (after.covariance()[(at, other)] - covariance[(at, other)]).abs();
                    prop_assert!(error < 1e-4 * size);
                }
            }
        }
    }
}

#[test]
fn a_second_copy_of_the_data_halves_the_variance() {
    let one = DMatrix::identity(2, 2);
    let single = data(1, &one, &one);
    let double = single.and(&single).unwrap();
    let unknowns = Unknowns::known_mass(bearing().mass()).unwrap();
    let [before, after] =
        [&single, &double].map(|data| output_error(data, &unknowns).unwrap().estimate);
    for (p, q) in before.parameters().zip(after.parameters()) {
        assert!((p.value - q.value).abs() < 1e-4 * p.standard_error);
        let ratio = (p.standard_error / q.standard_error).powi(2);
        assert!((ratio - 2.0).abs() < 1e-4, "{ratio}");
    }
}
