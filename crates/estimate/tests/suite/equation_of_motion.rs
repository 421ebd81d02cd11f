//! The linear fit of the equation of motion, compared with explicit normal equations and with
//! values computed by hand.

use mechid_estimate::{EquationOfMotion, EstimateError, Unknowns};
use mechid_model::Matrix;
use mechid_numerics::NumericsError;
use mechid_numerics::least_squares::LeastSquares;
use nalgebra::{DMatrix, dmatrix};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

struct Data {
    a: DMatrix<f64>,
    v: DMatrix<f64>,
    x: DMatrix<f64>,
    f: DMatrix<f64>,
}

impl Data {
    /// Draws random motions, which need not be motions of the system, and computes the forces that
    /// cause these motions. Noise is added to the forces.
    fn new(mck: [&DMatrix<f64>; 3], rows: usize, noise: f64, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let n = mck[0].nrows();
        let mut draw = || DMatrix::from_fn(rows, n, |_, _| random.random_range(-1.0..1.0));
        let (a, v, x, e) = (draw(), draw(), draw(), draw());
        let f = &a * mck[0].transpose() + &v * mck[1].transpose() + &x * mck[2].transpose();
        Self { a, v, x, f: f + noise * e }
    }

    fn push(&self, rows: &mut EquationOfMotion) {
        rows.push_rows(self.a.as_view(), self.v.as_view(), self.x.as_view(), self.f.as_view())
            .unwrap();
    }

    fn rows(&self) -> EquationOfMotion {
        let mut rows = EquationOfMotion::new(self.f.ncols());
        self.push(&mut rows);
        rows
    }
}

fn film() -> [DMatrix<f64>; 3] {
    [
        dmatrix![14.8, 0.0; 0.0, 14.8],
        dmatrix![2.0e3, -1.0e3; -1.5e3, 4.0e3],
        dmatrix![1.0e6, 2.0e6; -3.0e6, 4.0e6],
    ]
}

#[test]
fn every_pattern_of_unknowns_gives_the_system_back() {
    let [m, c, k] = &film();
    let data = Data::new([m, c, k], 400, 0.0, 1);
    let partly = Unknowns::unknown_mass(2)
        .and_then(|u| u.fix(Matrix::Mass, 0, 1, 0.0))
        .and_then(|u| u.fix(Matrix::Damping, 1, 0, c[(1, 0)]))
        .unwrap();
    for unknowns in [Unknowns::known_mass(m).unwrap(), Unknowns::unknown_mass(2).unwrap(), partly] {
        let found = data.rows().solve(&unknowns).unwrap();
        // The columns are well conditioned: only rounding errors of forces of 4e6 N remain.
        for (got, true_) in [(found.mass(), m), (found.damping(), c), (found.stiffness(), k)] {
            assert!((got - true_).abs().max() < 1e-7, "{found}");
        }
        assert!(found.residual_nrmse().iter().all(|e| *e < 1e-14));
        assert!(found.condition() < 2.0);
        assert_eq!(found.system().unwrap().dof(), 2);
    }
}

#[test]
fn covariance_is_that_of_the_normal_equations() {
    let [m, c, k] = &film();
    let data = Data::new([m, c, k], 300, 50.0, 2);
    let found = data.rows().solve(&Unknowns::known_mass(m).unwrap()).unwrap();
    let mut regressors = DMatrix::zeros(300, 4);
    regressors.columns_mut(0, 2).copy_from(&data.v);
    regressors.columns_mut(2, 2).copy_from(&data.x);
    let targets = &data.f - &data.a * m.transpose();
    let gram = regressors.tr_mul(&regressors).cholesky().unwrap();
    let theta = gram.solve(&regressors.tr_mul(&targets));
    let e = &targets - &regressors * &theta;
    let s = e.tr_mul(&e) / 296.0;
    let inverse = gram.inverse();
    // The parameters are c11 c12 c21 c22 k11 k12 k21 k22. `at` returns the equation of a parameter
    // and its column of the regressors.
    let at = |p: usize| (p % 4 / 2, 2 * (p / 4) + p % 2);
    for p in 0..8 {
        for q in 0..8 {
            let ((i, a), (j, b)) = (at(p), at(q));
            let expected = s[(i, j)] * inverse[(a, b)];
            let scale = (s[(i, i)] * s[(j, j)]).sqrt() * inverse.max();
            // Residuals of 30 N are differences of forces of 4e6 N. Their relative rounding error
            // is ε·4e6/30 = 3e-11 and adds up over the rows.
            assert!((found.covariance()[(p, q)] - expected).abs() < 1e-9 * scale, "{p} {q}");
        }
    }
    assert_eq!(found.degrees_of_freedom(), 296);
}

#[test]
fn an_unexcited_parameter_is_named_and_the_others_stay_right() {
    let [m, c, k] = &film();
    let mut data = Data::new([m, c, k], 300, 0.0, 3);
    // The velocity of the second direction is proportional to that of the first: ẋ2 = 0.5 ẋ1.
    for row in 0..300 {
        data.v[(row, 1)] = 0.5 * data.v[(row, 0)];
    }
    data.f = &data.a * m.transpose() + &data.v * c.transpose() + &data.x * k.transpose();
    let found = data.rows().solve(&Unknowns::known_mass(m).unwrap()).unwrap();
    assert!((found.stiffness() - k).abs().max() < 1e-6);
    assert_eq!(found.undetermined().len(), 2);
    assert!(found.parameter("c12").unwrap().value.is_nan());
    assert_eq!(found.parameter("c12").unwrap().standard_error, f64::INFINITY);
    assert_eq!(found.undetermined()[0].to_string(), "c11 − 2.000·c12");
    let Err(EstimateError::Undetermined { parameters, .. }) = found.system() else { panic!() };
    assert_eq!(parameters, "c11, c12, c21, c22");

    data.v.column_mut(1).fill(0.0);
    data.f = &data.a * m.transpose() + &data.v * c.transpose() + &data.x * k.transpose();
    let found = data.rows().solve(&Unknowns::known_mass(m).unwrap()).unwrap();
    assert!((found.parameter("c11").unwrap().value - c[(0, 0)]).abs() < 1e-8);
    assert_eq!(found.undetermined()[1].to_string(), "c22");
}

#[test]
fn hopeless_data_are_refused_in_words() {
    let [m, c, k] = &film();
    let mut data = Data::new([m, c, k], 3, 0.0, 4);
    let unknown = Unknowns::unknown_mass(2).unwrap();
    assert_eq!(
        data.rows().solve(&unknown).unwrap_err(),
        EstimateError::Numerics(NumericsError::TooFewRows { rows: 3, unknowns: 6 })
    );
    data = Data::new([m, c, k], 30, 0.0, 4);
    data.f.column_mut(1).fill(0.0);
    let message = data.rows().solve(&unknown).unwrap_err().to_string();
    assert!(message.contains("degree of freedom 2") && message.contains("m21, m22, c21"));
    data.x[(4, 1)] = f64::NAN;
    let mut rows = EquationOfMotion::new(2);
    let refused =
        rows.push_rows(data.a.as_view(), data.v.as_view(), data.x.as_view(), data.f.as_view());
    assert!(matches!(
        refused,
        Err(EstimateError::Numerics(NumericsError::NotFinite { what: "displacement", row: 4, .. }))
    ));
    assert_eq!(rows.rows(), 0);
    data.x[(4, 1)] = 1e200;
    let refused =
        rows.push_rows(data.a.as_view(), data.v.as_view(), data.x.as_view(), data.f.as_view());
    assert_eq!((refused, rows.rows()), (Err(EstimateError::Numerics(NumericsError::Overflow)), 0));
}

#[test]
fn intervals_follow_students_t() {
    let data = Data::new([&dmatrix![1.0], &dmatrix![2.0], &dmatrix![3.0]], 12, 0.1, 5);
    let found = data.rows().solve(&Unknowns::known_mass(&dmatrix![1.0]).unwrap()).unwrap();
    let k = found.parameter("k").unwrap();
    // Student's t, ten degrees of freedom, 97.5 % quantile: 2.228139 (any statistics table).
    let [low, high] = k.interval(0.95).unwrap();
    assert!(((high - low) / (2.0 * k.standard_error) - 2.228139).abs() < 1e-6);
    assert_eq!(k.interval(1.0), Err(NumericsError::Level { level: 1.0 }));
    assert!(matches!(found.parameter("k11"), Err(EstimateError::NoSuchParameter { .. })));
    let exact = Data::new([&dmatrix![1.0], &dmatrix![2.0], &dmatrix![3.0]], 2, 0.0, 6);
    let found = exact.rows().solve(&Unknowns::known_mass(&dmatrix![1.0]).unwrap()).unwrap();
    assert_eq!(found.parameter("k").unwrap().interval(0.9).unwrap()[1], f64::INFINITY);
}

/// The regressors are a Vandermonde block with a (scaled) condition number of 1e10. The solution is
/// accurate, although normal equations cannot resolve this block.
#[test]
fn ill_conditioned_rows_keep_the_accuracy_normal_equations_lose() {
    let t = |row: usize| 1.0 + 1e-3 * row as f64 / 2000.0;
    let regressors = DMatrix::from_fn(2000, 4, |row, column| t(row).powi(column as i32));
    let targets = regressors.column_sum();
    let mut rows = LeastSquares::new(4, 1);
    rows.push_rows(regressors.as_view(), targets.as_view()).unwrap();
    let solution = rows.solve().unwrap();
    assert!(solution.condition > 1e10 && solution.undetermined.is_empty());
    // The error is about the condition number × ε × √rows; the right-hand side is also rounded.
    let bound = solution.condition * f64::EPSILON * 50.0;
    assert!(solution.coefficients.iter().all(|c| (c - 1.0).abs() < bound), "{solution:?}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    /// If all rows occur twice, the values do not change, and the variance is halved, apart from
    /// the change in the number of degrees of freedom.
    #[test]
    fn a_duplicated_record_halves_the_variance(seed in 0u64..1000, rows in 20usize..300) {
        let [m, c, k] = &film();
        let data = Data::new([m, c, k], rows, 100.0, seed);
        let unknowns = Unknowns::unknown_mass(2).unwrap();
        let once = data.rows();
        let mut twice = once.clone();
        twice.merge(&data.rows()).unwrap();
        let (once, twice) = (once.solve(&unknowns).unwrap(), twice.solve(&unknowns).unwrap());
        let spare = |n: usize| (n - 6) as f64;
        let ratio = 0.5 * (2.0 * spare(rows)) / spare(2 * rows);
        for (a, b) in once.parameters().zip(twice.parameters()) {
            prop_assert!((a.value - b.value).abs() < 1e-9 * a.standard_error);
            let got = (b.standard_error / a.standard_error).powi(2);
            prop_assert!((got / ratio - 1.0).abs() < 1e-9);
        }
    }

    /// Other units change only the scale of values and standard errors.
    #[test]
    fn units_do_not_matter(seed in 0u64..1000, length in -9..9i32, time in -6..6i32) {
        let (length, time) = (10f64.powi(length), 10f64.powi(time));
        let [m, c, k] = &film();
        let mut data = Data::new([m, c, k], 100, 100.0, seed);
        let unknowns = Unknowns::unknown_mass(2).unwrap();
        let before = data.rows().solve(&unknowns).unwrap();
        data.x *= length;
        data.v *= length / time;
        data.a *= length / (time * time);
        let after = data.rows().solve(&unknowns).unwrap();
        for (a, b) in before.parameters().zip(after.parameters()) {
            let unit = match a.parameter.matrix() {
                Matrix::Mass => time * time / length,
                Matrix::Damping => time / length,
                Matrix::Stiffness => 1.0 / length,
            };
            prop_assert!((b.value / unit - a.value).abs() < 1e-9 * a.standard_error);
            prop_assert!((b.standard_error / unit / a.standard_error - 1.0).abs() < 1e-9);
        }
    }
}
