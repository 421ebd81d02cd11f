//! Comparison of derivatives with finite differences, and of the likelihood with its definition.

use mechid_model::{Matrix, ResponseQuantity};
use mechid_numerics::linear_algebra::singular_values;
use nalgebra::dmatrix;

use super::super::normal_equations::Coordinates;
use super::*;

/// Frequencies, in rad/s, of data of two degrees of freedom; no matrix is symmetric, and the data
/// do not satisfy the equation of motion.
const OMEGA: [f64; 10] = [1.0, 1.7, 2.5, 3.1, 4.0, 5.2, 5.9, 6.3, 7.0, 7.6];
const RESIDUALS: usize = 4 * OMEGA.len();

fn data() -> FrequencyData {
    let z = |seed: usize| {
        let turn = (seed * seed) as f64 * 0.7;
        Complex::from_polar(1.0 + 0.3 * (1.3 * seed as f64).sin(), turn)
    };
    let force = DMatrix::from_fn(OMEGA.len(), 2, |l, c| z(2 * l + c));
    let motion = DMatrix::from_fn(OMEGA.len(), 2, |l, c| z(31 + 2 * l + c) * 0.1);
    FrequencyData::from_amplitudes(OMEGA.to_vec(), force, motion, ResponseQuantity::Displacement)
        .unwrap()
}

/// Returns noise with full, positive definite covariances.
fn noise() -> NoiseSpectrum {
    let covariance = (0..OMEGA.len()).map(|row| {
        let root = DMatrix::from_fn(4, 4, |i: usize, j: usize| {
            let size = if i < 2 { 0.01 } else { 0.05 };
            let other = Complex::new(0.3 * (i + 2 * j + row) as f64, 0.5 - 0.2 * i as f64);
            if i == j { Complex::new(size * 3.0, 0.0) } else { other * size }
        });
        &root * root.adjoint()
    });
    NoiseSpectrum::new(OMEGA.to_vec(), covariance.collect()).unwrap()
}

/// Returns two sets of unknowns: in the first, one equation has fewer unknowns than the other; in
/// the second, all entries are unknown.
fn unknowns() -> [(Unknowns, DVector<f64>); 2] {
    let all = Unknowns::unknown_mass(2).unwrap();
    let theta = vec![1.0, -0.2, 0.1, 1.5, 0.4, 0.1, -0.3, 0.6, 9.0, -3.0, -2.0, 7.0];
    let mut fewer = theta.clone();
    fewer.remove(1);
    [(all.clone().fix(Matrix::Mass, 0, 1, 0.1).unwrap(), fewer.into()), (all, theta.into())]
}

/// Returns the cases of the tests, each with data, unknowns and parameters. Every set of unknowns
/// occurs twice: with data of periods, and with data of an open record with transient loads.
fn cases() -> Vec<(FrequencyData, Unknowns, DVector<f64>)> {
    let all = unknowns().into_iter().flat_map(|(unknowns, theta)| {
        let loads: Vec<f64> = (0..12).map(|at| 0.1 * (2.3 * f64::from(at)).sin()).collect();
        let with_loads: Vec<f64> = theta.iter().chain(&loads).copied().collect();
        let open = data().as_open_record(Sampling::new(0.1, 64).unwrap());
        [(data(), unknowns.clone(), theta), (open, unknowns, with_loads.into())]
    });
    all.collect()
}

fn cost(misfit: &mut Misfit<'_>, theta: &DVector<f64>) -> f64 {
    let cost = misfit.try_at(theta).unwrap();
    misfit.accept();
    cost
}

/// Returns the residuals √2·L⁻¹e at the parameters `theta`, as real numbers.
fn residuals(misfit: &mut Misfit<'_>, theta: &DVector<f64>) -> DVector<f64> {
    cost(misfit, theta);
    let white = misfit.white();
    let pairs = white.iter().flat_map(|z| [z.re, z.im]);
    DVector::from_iterator(RESIDUALS, pairs.map(|part| std::f64::consts::SQRT_2 * part))
}

/// Returns dv/dθ, one column for every unknown.
fn transformation(coordinates: &Coordinates, unknowns: usize) -> DMatrix<f64> {
    let unit = |at| DVector::from_fn(unknowns, |i, _| f64::from(u8::from(i == at)));
    DMatrix::from_columns(
        &(0..unknowns).map(|at| coordinates.transform(&unit(at))).collect::<Vec<_>>(),
    )
}

#[test]
fn the_gradient_is_that_of_the_sum_of_squares() {
    for (data, unknowns, theta) in cases() {
        for noise in [noise(), noise().with_exact_force()] {
            let mut misfit = Misfit::new(&data, &unknowns, &noise).unwrap();
            cost(&mut misfit, &theta);
            let equations = misfit.linearise().unwrap();
            let to = transformation(&equations.coordinates, theta.len());
            let gradient = to.tr_mul(&equations.gradient) * 2.0;
            for at in 0..theta.len() {
                let mut near = |step: f64| {
                    let mut theta = theta.clone();
                    theta[at] += step;
                    cost(&mut misfit, &theta)
                };
                let difference = (near(1e-5) - near(-1e-5)) / 2e-5;
                // Relative errors of central differences: 1e-16/1e-5 due to rounding, 1e-10 due to
                // curvature.
                let error = (gradient[at] - difference).abs();
                assert!(error < 1e-8 * gradient.norm(), "{at}: {error:e}");
            }
        }
    }
}

#[test]
fn the_gram_matrix_and_its_inverse_are_those_of_the_jacobian() {
    let noise = noise().with_exact_force();
    for (data, unknowns, theta) in cases() {
        let mut misfit = Misfit::new(&data, &unknowns, &noise).unwrap();
        let columns: Vec<_> = (0..theta.len())
            .map(|at| {
                let mut near = |step: f64| {
                    let mut theta = theta.clone();
                    theta[at] += step;
                    residuals(&mut misfit, &theta)
                };
                (near(1e-5) - near(-1e-5)) / 2e-5
            })
            .collect();
        let mut jacobian = DMatrix::from_columns(&columns);
        cost(&mut misfit, &theta);
        let equations = misfit.linearise().unwrap();
        let to = transformation(&equations.coordinates, theta.len());
        let gram = to.tr_mul(&(&equations.gram * &to));
        let expected = jacobian.tr_mul(&jacobian);
        assert!((&gram - &expected).norm() < 1e-8 * expected.norm());
        assert!(equations.gram.diagonal().iter().all(|v| (v - 1.0).abs() < 1e-12));

        let (covariance, condition) = equations.covariance().unwrap();
        // Each column is scaled to unit length, because the powers of s differ by orders of
        // magnitude.
        let lengths = gram.diagonal().map(f64::sqrt);
        let (to, back) = (DMatrix::from_diagonal(&lengths), lengths.map(f64::recip));
        let back = DMatrix::from_diagonal(&back);
        let product = (&to * &covariance * &to) * (&back * &gram * &back);
        let gap = (product - DMatrix::identity(theta.len(), theta.len())).norm();
        assert!(gap < 1e-14 * condition * condition, "{gap:e}, condition {condition:e}");
        jacobian.column_iter_mut().for_each(|mut column| column /= column.norm());
        let singular = singular_values(jacobian).unwrap();
        let expected = singular.max() / singular.min();
        assert!((condition / expected - 1.0).abs() < 1e-6, "{condition} {expected}");

        // The inverse transformation returns the same unknowns.
        let back = equations.coordinates.unknowns(&equations.coordinates.transform(&theta));
        assert!((back - &theta).norm() < 1e-12 * theta.norm());
    }
}

#[test]
fn the_curvature_is_the_second_derivative_along_a_step() {
    let noise = noise().with_exact_force();
    for (data, unknowns, theta) in cases() {
        let mut misfit = Misfit::new(&data, &unknowns, &noise).unwrap();
        let step = DVector::from_fn(theta.len(), |at, _| (1.7 * at as f64).cos());
        let mut near = |along: f64| residuals(&mut misfit, &(&theta + &step * along));
        let second = (near(1e-4) + near(-1e-4) - near(0.0) * 2.0) / 1e-8;
        let slope = |misfit: &mut Misfit<'_>, at: usize| {
            let mut near = |along: f64| {
                let mut theta = theta.clone();
                theta[at] += along;
                residuals(misfit, &theta)
            };
            ((near(1e-5) - near(-1e-5)) / 2e-5).dot(&second)
        };
        let expected = DVector::from_fn(theta.len(), |at, _| slope(&mut misfit, at));
        cost(&mut misfit, &theta);
        let equations = misfit.linearise().unwrap();
        let curvature = misfit.curvature(&equations, &step).unwrap();
        let to = transformation(&equations.coordinates, theta.len());
        let error = (to.tr_mul(&curvature) - &expected).norm() / expected.norm();
        // Rounding error of second differences: 1e-16/1e-8.
        assert!(error < 1e-6, "{error:e}");
    }
}

/// With negligible noise on the force, the weights for noisy forces and the weights for exact
/// forces give the same sum of squares and Gram matrix.
#[test]
fn errors_in_variables_contain_output_error() {
    let exact = noise().with_exact_force();
    // The noise of the force is negligible, but not zero.
    let next_to_none = NoiseSpectrum::new(
        OMEGA.to_vec(),
        (0..OMEGA.len())
            .map(|row| {
                let mut covariance = exact.covariance(row).clone();
                covariance[(3, 3)] += Complex::from(1e-30);
                covariance
            })
            .collect(),
    );
    let next_to_none = next_to_none.unwrap();
    assert!(!exact.has_force() && next_to_none.has_force());
    for (unknowns, theta) in unknowns() {
        let data = data();
        let mut output = Misfit::new(&data, &unknowns, &exact).unwrap();
        let mut both = Misfit::new(&data, &unknowns, &next_to_none).unwrap();
        let (left, right) = (cost(&mut output, &theta), cost(&mut both, &theta));
        assert!((left / right - 1.0).abs() < 1e-12);
        let [left, right] = [output, both].map(|mut m| m.linearise().unwrap());
        assert!((&left.gram - right.gram).norm() < 1e-12 * left.gram.norm());
        assert!((&left.gradient - right.gradient).norm() < 1e-12 * left.gradient.norm());
    }
}

/// The sum of squares is the smallest distance of the measured forces and displacements from forces
/// and displacements that satisfy the equation of motion. The covariance of the noise defines the
/// metric of this distance.
#[test]
fn the_true_force_is_eliminated() {
    let (data, noise) = (data(), noise());
    for (unknowns, theta) in unknowns() {
        let mut misfit = Misfit::new(&data, &unknowns, &noise).unwrap();
        let sum = cost(&mut misfit, &theta);
        let [m, c, k] = unknowns.assemble(theta.as_slice());
        let system = mechid_model::SecondOrderSystem::new(m, c, k).unwrap();
        let mut distance = 0.0;
        for (row, omega) in OMEGA.into_iter().enumerate() {
            let receptance = system.receptance(omega).unwrap();
            // z ≈ [G; I] F, whitened by the Cholesky factor of its whole covariance.
            let mut tall = DMatrix::identity(4, 2);
            tall.rows_mut(0, 2).copy_from(&receptance);
            tall.rows_mut(2, 2).fill_with_identity();
            let mut measured = DMatrix::zeros(4, 1);
            measured.rows_mut(0, 2).tr_copy_from(&data.displacement().row(row));
            measured.rows_mut(2, 2).tr_copy_from(&data.force().row(row));
            let lower = lower_factor(noise.covariance(row).clone()).unwrap().lower_triangle();
            lower.solve_lower_triangular_mut(&mut tall);
            lower.solve_lower_triangular_mut(&mut measured);
            let force = (tall.adjoint() * &tall).lu().solve(&(tall.adjoint() * &measured)).unwrap();
            distance += 2.0 * (measured - tall * force).norm_squared();
        }
        assert!((sum / distance - 1.0).abs() < 1e-10);
    }
}

#[test]
fn only_positive_definite_covariances_weigh() {
    let z = Complex::from;
    assert!(lower_factor(dmatrix![z(1.0), z(2.0); z(2.0), z(1.0)]).is_none());
    assert!(lower_factor(dmatrix![z(0.0)]).is_none());
    let lower = lower_factor(dmatrix![z(4.0), z(2.0); z(2.0), z(5.0)]).unwrap();
    assert_eq!(lower.lower_triangle(), dmatrix![z(2.0), z(0.0); z(1.0), z(2.0)]);
}
