//! Comparison of two independent exact responses of one degree of freedom: by the matrix
//! exponential of this crate, and by the divided differences of the closed forms in `mechid-model`.

use mechid_model::{InitialState, Response, Sdof};
use mechid_problems::{
    dissertation_sdof, exact_foh, exact_foh_periodic, exact_harmonic, exact_harmonic_periodic,
    exact_zoh,
};
use mechid_signal::{Record, Sampling};
use nalgebra::{Complex, DMatrix, dvector};
use proptest::prelude::*;

fn gap(p: &Response, q: &Response) -> f64 {
    let relative = |a: &Record, b: &Record| (a.data() - b.data()).amax() / b.data().amax();
    relative(p.displacement(), q.displacement())
        .max(relative(p.velocity(), q.velocity()))
        .max(relative(p.acceleration(), q.acceleration()))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn sampled_forces_have_one_answer(
        // The systems are undamped to heavily overdamped, with 1 to 1,000 samples per natural
        // period.
        log_zeta in -4.0..2.0f64, log_period in 0.0..3.0f64,
        force in prop::collection::vec(-10.0..10.0f64, 2..80),
        x0 in -0.1..0.1f64, v0 in -1.0..1.0f64,
    ) {
        let zeta = if log_zeta < -3.0 { 0.0 } else { 10f64.powf(log_zeta) };
        let sdof = Sdof::from_modal(3.0, zeta, 20.0).unwrap();
        let dt = std::f64::consts::TAU / 20.0 / 10f64.powf(log_period);
        let force = Record::from_channel(Sampling::new(dt, force.len()).unwrap(), force).unwrap();
        let start = InitialState::new(dvector![x0], dvector![v0]).unwrap();
        // ẍ = (F − c ẋ − k x)/m suffers from cancellation; with ζ = 100 it loses two or three more
        // digits.
        let tolerance = 1e-12 * (1.0 + 10.0 * zeta);
        let held = sdof.held_force_response(&force, x0, v0).unwrap();
        prop_assert!(gap(&held, &exact_zoh(&sdof.system(), &force, &start).unwrap()) < tolerance);
        let linear = sdof.linear_force_response(&force, x0, v0).unwrap();
        prop_assert!(gap(&linear, &exact_foh(&sdof.system(), &force, &start).unwrap()) < tolerance);
    }
}

#[test]
fn a_cosine_through_the_spectrum_is_the_closed_form() {
    let sdof = dissertation_sdof();
    let sampling = Sampling::new(0.01, 200).unwrap();
    let (omega, amplitude) = (7.0 * sampling.omega0(), Complex::from_polar(50.0, 0.4));
    let cosine = sampling.times().map(|t| 50.0 * (omega * t + 0.4).cos()).collect();
    let force = Record::from_channel(sampling, cosine).unwrap();
    let steady = sdof.harmonic_steady_state(sampling, amplitude, omega).unwrap();
    assert!(gap(&exact_harmonic_periodic(&sdof.system(), &force).unwrap(), &steady) < 1e-13);
    let start = InitialState::new(dvector![0.02], dvector![-1.0]).unwrap();
    let whole = sdof.harmonic_response(sampling, amplitude, omega, 0.02, -1.0).unwrap();
    assert!(gap(&exact_harmonic(&sdof.system(), &force, &start).unwrap(), &whole) < 1e-13);
}

#[test]
fn a_periodic_motion_is_where_the_recurrence_settles() {
    let sdof = dissertation_sdof();
    let period: Vec<f64> = (0..100).map(|k| ((k * k % 23) as f64) - 11.0).collect();
    let sampling = Sampling::new(0.02, 100).unwrap();
    let force = Record::from_channel(sampling, period.clone()).unwrap();
    let many = Record::from_channel(Sampling::new(0.02, 500).unwrap(), period.repeat(5)).unwrap();
    // After four periods, e^{−9·8} ≈ 5e-32 of the transient remains.
    let settled = sdof.linear_force_response(&many, 0.3, 0.0).unwrap();
    let last = DMatrix::from_fn(100, 1, |k, _| settled.displacement().channel(0)[400 + k]);
    let periodic = exact_foh_periodic(&sdof.system(), &force).unwrap();
    assert!((periodic.displacement().data() - &last).amax() < 1e-13 * last.amax());
}
