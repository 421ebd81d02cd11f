//! Values and sizes far beyond those of measurements: the result is correct, or an error names the
//! cause.

use mechid_estimate::derivatives::SavitzkyGolay;
use mechid_estimate::{EquationOfMotion, EstimateError, Unknowns};
use mechid_numerics::NumericsError;
use mechid_numerics::least_squares::LeastSquares;
use mechid_signal::SignalError;
use mechid_signal::correlation::{cross_correlation, whiteness};
use nalgebra::DMatrix;

fn noise(seed: usize) -> Vec<f64> {
    (0..200).map(|k| ((k * k * 7 + k * seed) as f64).sin()).collect()
}

#[test]
fn correlations_do_not_depend_on_the_unit() {
    let (e, u) = (noise(3), noise(5));
    let (white, cross) = (whiteness(&e, 20).unwrap(), cross_correlation(&e, &u, 20).unwrap());
    for power in [-1070, -500, -30, 0, 30, 500, 1000] {
        let scaled =
            |x: &[f64]| -> Vec<f64> { x.iter().map(|v| v * f64::from(power).exp2()).collect() };
        // Numbers below 2⁻¹⁰²² have fewer digits.
        let tolerance = if power == -1070 { 0.3 } else { 0.0 };
        for (found, expected) in [
            (whiteness(&scaled(&e), 20).unwrap(), &white),
            (cross_correlation(&scaled(&e), &scaled(&u), 20).unwrap(), &cross),
        ] {
            let gap = (found.statistic / expected.statistic - 1.0).abs();
            assert!(gap <= tolerance, "2^{power}: {gap}");
        }
    }
    let mut broken = e;
    broken[7] = f64::NAN;
    assert!(matches!(whiteness(&broken, 20), Err(SignalError::NotFinite { sample: 7, .. })));
}

/// Returns k from m ẍ + c ẋ + k x = F at random instants, with these units of the response and of
/// the force.
fn equations(response_unit: f64, force_unit: f64) -> Result<f64, EstimateError> {
    let motion = [3, 5, 8].map(|seed| DMatrix::from_iterator(200, 1, noise(seed)));
    let force = (&motion[0] * 2.0 + &motion[1] * 0.3 + &motion[2] * 50.0) * force_unit;
    let [a, v, x] = motion.map(|column| column * response_unit);
    let mut rows = EquationOfMotion::new(1);
    rows.push_rows(a.as_view(), v.as_view(), x.as_view(), force.as_view())?;
    let estimate = rows.solve(&Unknowns::unknown_mass(1)?)?;
    Ok(estimate.system()?.stiffness()[(0, 0)] * response_unit / force_unit)
}

#[test]
fn data_too_small_or_too_large_to_be_squared_are_told_as_such() {
    for (response, force) in [(1.0, 1.0), (1e-60, 1e-60), (1e60, 1e60), (1e-9, 1e9)] {
        let k = equations(response, force).unwrap();
        assert!((k / 50.0 - 1.0).abs() < 1e-12, "{k}");
    }
    for (response, force, told) in
        [(1.0, 1e-310, "force"), (1e-310, 1.0, "acceleration"), (1e-155, 1e-155, "acceleration")]
    {
        match equations(response, force) {
            Err(EstimateError::Numerics(NumericsError::Underflow { what, column: 0, .. })) => {
                assert_eq!(what, told)
            }
            other => panic!("{response} {force}: {other:?}"),
        }
    }
    assert_eq!(equations(1e155, 1e155), Err(EstimateError::Numerics(NumericsError::Overflow)));
    // The sum of the squares of either set of rows is finite, but the sum of both overflows.
    let mut rows = LeastSquares::new(1, 1);
    let large = DMatrix::from_element(1, 1, 1.2e154);
    rows.push_rows(large.as_view(), large.as_view()).unwrap();
    assert_eq!(rows.merge(&rows.clone()), Err(NumericsError::Overflow));
    assert_eq!(rows.rows(), 1);
}

#[test]
fn nothing_to_solve_for_is_an_error() {
    let mut rows = LeastSquares::new(0, 2);
    assert_eq!(rows.solve(), Err(NumericsError::NothingUnknown));
    rows.push_rows(DMatrix::zeros(4, 0).as_view(), DMatrix::zeros(4, 2).as_view()).unwrap();
    assert_eq!(rows.solve(), Err(NumericsError::NothingUnknown));
}

#[test]
fn windows_of_absurd_size_are_refused_before_they_are_built() {
    for (half_width, order) in [(99_999_999_999, 4), (usize::MAX, 2), (30, 21)] {
        let refused = SavitzkyGolay::new(half_width, order);
        assert_eq!(refused, Err(EstimateError::WindowTooLarge { half_width, order }));
    }
}

#[test]
fn sizes_that_no_memory_holds_are_refused_where_rows_come() {
    let mut rows = LeastSquares::new(usize::MAX, 2);
    let error = rows.push_rows(DMatrix::zeros(3, 2).as_view(), DMatrix::zeros(3, 2).as_view());
    assert!(matches!(error, Err(NumericsError::Size { expected: usize::MAX, got: 2, .. })));
    let needed = NumericsError::TooFewRows { rows: 0, unknowns: usize::MAX };
    assert_eq!(rows.solve().unwrap_err(), needed);
    assert_eq!(LeastSquares::new(0, 1).solve().unwrap_err(), NumericsError::NothingUnknown);
    let nothing = EquationOfMotion::new(1).solve(&Unknowns::unknown_mass(1).unwrap());
    let needed = NumericsError::TooFewRows { rows: 0, unknowns: 3 };
    assert_eq!(nothing.unwrap_err(), needed.into());
}
