//! The discretised equation, compared with responses in closed form.

use crate::common::{Oscillator, mixed, response};
use mechid_force::{
    ForceError, channel_errors, discretised, discretised_by_taylor, relative_error,
};
use mechid_model::{Discretisation, SecondOrderSystem};
use mechid_signal::{Extent, Record, Sampling};
use nalgebra::dmatrix;

const MACHINE: Oscillator = Oscillator { m: 10.0, c: 180.0, k: 5000.0 };

fn machine() -> SecondOrderSystem {
    SecondOrderSystem::new(dmatrix![10.0], dmatrix![180.0], dmatrix![5000.0]).unwrap()
}

/// Returns a force with a mean value and the frequencies 7 and 19.3 rad/s; it is not periodic in
/// the record.
fn wobble(t: f64) -> f64 {
    40.0 * (7.0 * t).sin() + 25.0 * (19.3 * t + 0.4).cos() - 10.0
}

fn samples(dt: f64, len: usize) -> (Sampling, Vec<f64>) {
    let sampling = Sampling::new(dt, len).unwrap();
    (sampling, sampling.times().map(wobble).collect())
}

fn as_record(sampling: Sampling, force: &[f64]) -> Record {
    Record::from_channel(sampling, force.to_vec()).unwrap()
}

/// Tolerance for rounding, relative to the force. The relative rounding error of the state, 1e-16,
/// is amplified by M/Δt; it remains below 1e-10 of the force at these steps.
const ROUNDING: f64 = 1e-10;

#[test]
fn the_exact_held_form_returns_the_held_force() {
    for (dt, len) in [(0.001, 3000), (0.02, 300), (0.2, 40)] {
        let (sampling, force) = samples(dt, len);
        let (x, v) = MACHINE.run((0.01, -0.3), &force, dt, false);
        let found = discretised(
            &machine(),
            &response(sampling, x, v),
            Discretisation::ZeroOrderHold,
            Extent::Open,
        )
        .unwrap();
        let truth = as_record(sampling, &force).window(0, len - 1).unwrap();
        let error = relative_error(found.record(), &truth).unwrap();
        assert!(error < ROUNDING, "dt {dt}: {error:.1e}");
    }
}

#[test]
fn the_exact_linear_form_returns_the_linear_force() {
    // The displacement rows have the factor 6M/Δt²: with a step ten times as long, the rounding
    // error is a hundred times smaller.
    for (dt, len, tolerance) in [(0.002, 1500, 1e-8), (0.02, 300, ROUNDING), (0.1, 40, ROUNDING)] {
        let (sampling, force) = samples(dt, len);
        let (x, v) = MACHINE.run((0.01, -0.3), &force, dt, true);
        // The last step would lead to a sample that does not exist, so it is not used.
        let found = discretised(
            &machine(),
            &response(sampling, x, v),
            Discretisation::FirstOrderHold,
            Extent::Open,
        )
        .unwrap();
        let error = relative_error(found.record(), &as_record(sampling, &force)).unwrap();
        assert!(error < tolerance, "dt {dt}: {error:.1e}");
    }
}

#[test]
fn a_whole_period_wraps_around() {
    // e^(−ζ ωn T) is e^−50 over this period: the second period is the steady state to rounding.
    let len = 256;
    let sampling = Sampling::new(20.0 * std::f64::consts::TAU / (len as f64 * 22.36), len).unwrap();
    let (dt, w) = (sampling.dt(), sampling.omega0());
    let period: Vec<f64> = sampling
        .times()
        .map(|t| (1..100).map(|n| (w * n as f64 * t + (n * n) as f64).cos()).sum())
        .collect();
    let twice = [period.clone(), period.clone()].concat();
    for (linear, form) in
        [(false, Discretisation::ZeroOrderHold), (true, Discretisation::FirstOrderHold)]
    {
        let (x, v) = MACHINE.run((0.0, 0.0), &twice, dt, linear);
        let steady = response(sampling, x[len..].to_vec(), v[len..].to_vec());
        let found = discretised(&machine(), &steady, form, Extent::WholePeriod).unwrap();
        assert_eq!(found.record().len(), len);
        let error = relative_error(found.record(), &as_record(sampling, &period)).unwrap();
        assert!(error < ROUNDING, "{form:?}: {error:.1e}");
    }
}

#[test]
fn coupled_machines_with_full_matrices_are_told_apart() {
    let machine = mixed();
    let (sampling, first) = samples(0.03, 200);
    let second: Vec<f64> = sampling.times().map(|t| 8.0 * (5.0 * t).cos() + t).collect();
    for (linear, form) in
        [(false, Discretisation::ZeroOrderHold), (true, Discretisation::FirstOrderHold)]
    {
        let (force, motion) = machine.run([&first, &second], 0.03, linear);
        let found = discretised(&machine.system(), &motion, form, Extent::Open).unwrap();
        let len = found.record().len();
        let errors = channel_errors(found.record(), &force.window(0, len).unwrap()).unwrap();
        assert!(errors.iter().all(|e| e.unwrap() < ROUNDING), "{form:?}: {errors:?}");
    }
}

#[test]
fn taylor_forms_converge_at_their_order() {
    for order in 1..=8 {
        // The steps are short enough for the leading error term to dominate, and long enough for
        // the error of order 8 to exceed rounding.
        let errors: Vec<f64> = [0.02, 0.01]
            .iter()
            .map(|&dt| {
                let (sampling, force) = samples(dt, (2.4 / dt) as usize);
                let (x, v) = MACHINE.run((0.0, 0.0), &force, dt, false);
                let motion = response(sampling, x, v);
                let found =
                    discretised_by_taylor(&machine(), &motion, order, Extent::Open).unwrap();
                let truth = as_record(sampling, &force).window(0, sampling.len() - 1).unwrap();
                relative_error(found.record(), &truth).unwrap()
            })
            .collect();
        let observed = (errors[0] / errors[1]).log2();
        // The second term of the error is ωn Δt / (p + 2) times the leading term: at most a third
        // at these steps.
        assert!((observed - order as f64).abs() < 0.4, "order {order}: {observed:.2} {errors:?}");
    }
}

#[test]
fn euler_is_the_first_taylor_form_and_the_printed_equation() {
    let (sampling, force) = samples(0.01, 100);
    let (x, v) = MACHINE.run((0.0, 0.0), &force, 0.01, false);
    let motion = response(sampling, x.clone(), v.clone());
    let euler = discretised(&machine(), &motion, Discretisation::Euler, Extent::Open).unwrap();
    let taylor = discretised_by_taylor(&machine(), &motion, 1, Extent::Open).unwrap();
    assert_eq!(euler, taylor);
    for (k, f) in euler.record().channel(0).iter().enumerate() {
        let printed = 10.0 / 0.01 * (v[k + 1] - v[k]) + 180.0 * v[k] + 5000.0 * x[k];
        assert!((f - printed).abs() < 1e-9, "sample {k}: {f} {printed}");
    }
}

#[test]
fn eulers_dispersion_is_its_transfer_ratio() {
    // On a band-limited motion x = e^(iωt) the printed equation returns, instead of −ω²M + iωC + K,
    // the dynamic stiffness M iω(e^(iωΔt) − 1)/Δt + C iω + K.
    let sampling = Sampling::new(0.01, 128).unwrap();
    for line in [1, 9, 40, 63] {
        let omega = line as f64 * sampling.omega0();
        let x = sampling.times().map(|t| (omega * t).cos()).collect();
        let v = sampling.times().map(|t| -omega * (omega * t).sin()).collect();
        let motion = response(sampling, x, v);
        let found =
            discretised(&machine(), &motion, Discretisation::Euler, Extent::WholePeriod).unwrap();
        let i_omega = nalgebra::Complex::new(0.0, omega);
        let forward = ((i_omega * 0.01).exp() - 1.0) / 0.01;
        let expected = i_omega * forward * 10.0 + i_omega * 180.0 + 5000.0;
        let line_error = (found.spectrum().line(line, 0) - expected).norm() / expected.norm();
        assert!(line_error < 1e-10, "line {line}: {line_error:.1e}");
    }
}

#[test]
fn bad_input_is_refused_with_its_numbers() {
    let one = response(Sampling::new(0.1, 1).unwrap(), vec![1.0], vec![0.0]);
    let held = Discretisation::ZeroOrderHold;
    assert_eq!(
        discretised(&machine(), &one, held, Extent::Open),
        Err(ForceError::TooShort { samples: 1, needed: 2 })
    );
    let motion = response(Sampling::new(0.1, 3).unwrap(), vec![0.0; 3], vec![0.0; 3]);
    for order in [0, 9] {
        assert_eq!(
            discretised_by_taylor(&machine(), &motion, order, Extent::Open),
            Err(ForceError::TaylorOrder { order })
        );
    }
    assert_eq!(
        discretised(&mixed().system(), &motion, held, Extent::Open),
        Err(ForceError::Dof { system: 2, response: 1 })
    );
    // The system is undamped, and a step is one whole period: a held force causes no motion.
    let undamped = SecondOrderSystem::new(dmatrix![1.0], dmatrix![0.0], dmatrix![1.0]).unwrap();
    let sampling = Sampling::new(std::f64::consts::TAU, 3).unwrap();
    let motion = response(sampling, vec![0.0; 3], vec![0.0; 3]);
    assert!(matches!(
        discretised(&undamped, &motion, held, Extent::Open),
        Err(ForceError::StepTooLong { reciprocal_condition, .. }) if reciprocal_condition < 1e-12
    ));
}
