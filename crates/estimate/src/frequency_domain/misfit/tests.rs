//! Derivatives against differences, and the likelihood against its definition.

use mechid_model::ResponseQuantity;
use nalgebra::dmatrix;

use super::*;

/// Two degrees of freedom, nothing symmetric, at three frequencies, off the truth.
fn data() -> FrequencyData {
    let z = |seed: usize| {
        let turn = (seed * seed) as f64 * 0.7;
        Complex::from_polar(1.0 + 0.3 * (1.3 * seed as f64).sin(), turn)
    };
    let force = DMatrix::from_fn(3, 2, |l, c| z(2 * l + c));
    let motion = DMatrix::from_fn(3, 2, |l, c| z(11 + 2 * l + c) * 0.1);
    let omega = vec![1.0, 2.5, 4.0];
    FrequencyData::from_amplitudes(omega, force, motion, ResponseQuantity::Displacement).unwrap()
}

/// Positive definite, every entry of it in use.
fn noise() -> NoiseSpectrum {
    let covariance = (0..3).map(|row| {
        let root = DMatrix::from_fn(4, 4, |i: usize, j: usize| {
            let size = if i < 2 { 0.01 } else { 0.05 };
            let other = Complex::new(0.3 * (i + 2 * j + row) as f64, 0.5 - 0.2 * i as f64);
            if i == j { Complex::new(size * 3.0, 0.0) } else { other * size }
        });
        &root * root.adjoint()
    });
    NoiseSpectrum::new(vec![1.0, 2.5, 4.0], covariance.collect()).unwrap()
}

fn unknowns() -> Unknowns {
    Unknowns::unknown_mass(2).unwrap().fix(Matrix::Mass, 0, 1, 0.1).unwrap()
}

fn theta() -> DVector<f64> {
    DVector::from_vec(vec![1.0, -0.2, 1.5, 0.4, 0.1, -0.3, 0.6, 9.0, -3.0, -2.0, 7.0])
}

#[test]
fn derivatives_agree_with_differences() {
    let (data, unknowns, noise) = (data(), unknowns(), noise());
    let output = Noise::Output(output_weights(&noise).unwrap());
    for weights in [output, Noise::Both(&noise)] {
        let mut misfit = Misfit::new(&data, &unknowns, weights);
        let mut jacobian = DMatrix::zeros(12, 11);
        assert!(misfit.residual(&theta(), &mut DVector::zeros(12)));
        misfit.jacobian(&mut jacobian);
        for parameter in 0..11 {
            let mut at = |step: f64| {
                let (mut theta, mut residual) = (theta(), DVector::zeros(12));
                theta[parameter] += step;
                assert!(misfit.residual(&theta, &mut residual));
                residual
            };
            let difference = (at(1e-5) - at(-1e-5)) / 2e-5;
            // Central differences: rounding 1e-16/1e-5 and curvature 1e-10, both relative.
            let error = (jacobian.column(parameter) - difference).norm();
            assert!(error < 1e-8 * jacobian.norm(), "{parameter}: {error:e}");
        }
    }
}

/// Without noise on the force the two kinds of weighting are one.
#[test]
fn errors_in_variables_contain_output_error() {
    let (data, unknowns) = (data(), unknowns());
    let noise = noise().with_exact_force();
    let mut output = Misfit::new(&data, &unknowns, Noise::Output(output_weights(&noise).unwrap()));
    let mut both = Misfit::new(&data, &unknowns, Noise::Both(&noise));
    assert!(!noise.has_force());
    let (mut a, mut b) = (DVector::zeros(12), DVector::zeros(12));
    assert!(output.residual(&theta(), &mut a) && both.residual(&theta(), &mut b));
    assert!((&a - &b).norm() < 1e-12 * a.norm());
    let difference = output.sensitivity() - both.sensitivity();
    assert!(difference.norm() < 1e-12 * output.sensitivity().norm());
}

/// The sum of squares is the least distance, in the metric of the noise, between the
/// measured forces and displacements and any that satisfy the equation of motion.
#[test]
fn the_true_force_is_eliminated() {
    let (data, unknowns, noise) = (data(), unknowns(), noise());
    let mut misfit = Misfit::new(&data, &unknowns, Noise::Both(&noise));
    let mut residual = DVector::zeros(12);
    assert!(misfit.residual(&theta(), &mut residual));
    let [m, c, k] = unknowns.assemble(theta().as_slice());
    let system = mechid_model::SecondOrderSystem::new(m, c, k).unwrap();
    let mut distance = 0.0;
    for row in 0..3 {
        let receptance = system.receptance(data.omega()[row]).unwrap();
        // z ≈ [G; I] F, whitened by the Cholesky factor of its whole covariance.
        let mut tall = DMatrix::identity(4, 2);
        tall.rows_mut(0, 2).copy_from(&receptance);
        tall.rows_mut(2, 2).fill_with_identity();
        let mut measured = DMatrix::zeros(4, 1);
        measured.rows_mut(0, 2).tr_copy_from(&data.displacement().row(row));
        measured.rows_mut(2, 2).tr_copy_from(&data.force().row(row));
        let lower = cholesky(noise.covariance(row).clone()).unwrap();
        lower.solve_lower_triangular_mut(&mut tall);
        lower.solve_lower_triangular_mut(&mut measured);
        let force = (tall.adjoint() * &tall).lu().solve(&(tall.adjoint() * &measured)).unwrap();
        distance += 2.0 * (measured - tall * force).norm_squared();
    }
    assert!((residual.norm_squared() / distance - 1.0).abs() < 1e-10);
}

#[test]
fn only_positive_definite_covariances_weigh() {
    let z = Complex::from;
    assert!(cholesky(dmatrix![z(1.0), z(2.0); z(2.0), z(1.0)]).is_none());
    assert!(cholesky(dmatrix![z(0.0)]).is_none());
    let lower = cholesky(dmatrix![z(4.0), z(2.0); z(2.0), z(5.0)]).unwrap();
    assert_eq!(lower, dmatrix![z(2.0), z(0.0); z(1.0), z(2.0)]);
}
