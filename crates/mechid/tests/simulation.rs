//! Responses of described experiments, against closed forms.

use std::f64::consts::{FRAC_1_PI, FRAC_PI_2, PI};

use mechid::io::Experiment;
use mechid::model::exact_periodic;
use mechid::simulate;
use mechid::simulation::{Multiplier, SimulateError, Simulation};

/// Returns the largest displacement error of a scheme (as JSON), relative to the response from the
/// receptance.
fn error(scheme: &str, samples: usize) -> f64 {
    let text = format!(
        r#"{{ "system": {{ "mass": 10, "damping": 180, "stiffness": 5000 }},
             "sampling": {{ "samples": {samples}, "rate_hz": {samples} }},
             "excitation": [{{ "lines": "1:5", "amplitude": 5 }}],
             "scheme": {scheme} }}"#
    );
    let simulation = simulate(&Experiment::parse("test.json", &text).unwrap()).unwrap();
    let truth = exact_periodic(simulation.system.dense().unwrap(), &simulation.force).unwrap();
    let (truth, found) = (truth.displacement().data(), simulation.response.displacement().data());
    (found - truth).amax() / truth.amax()
}

/// Reference: for the force F of this test, x = cos 2t is a solution of ẍ + 2 ẋ + x + x³ = F. The
/// damping is so large that no other periodic response exists.
#[test]
fn a_nonlinear_machine_goes_round_its_orbit() {
    let simulated = |scheme: &str, response: &str| {
        let text = format!(
            r#"{{ "system": {{ "mass": 1, "damping": 2, "stiffness": 1 }},
                 "nonlinear": {{ "terms": "k3: x1^3", "coefficients": [1] }},
                 "sampling": {{ "samples": 400, "rate_hz": {} }},
                 "excitation": [
                   {{ "kind": "harmonic", "amplitude": 2.25, "frequency_hz": {hz}, "phase_rad": {half} }},
                   {{ "kind": "harmonic", "amplitude": 4, "frequency_hz": {hz}, "phase_rad": {quarter} }},
                   {{ "kind": "harmonic", "amplitude": 0.25, "frequency_hz": {} }}],
                 "scheme": {scheme}, "response": {response} }}"#,
            400.0 * FRAC_1_PI,
            3.0 * FRAC_1_PI,
            hz = FRAC_1_PI,
            half = PI,
            quarter = FRAC_PI_2,
        );
        simulate(&Experiment::parse("test.json", &text).unwrap())
    };
    let error = |simulation: &Simulation| {
        let x = simulation.response.displacement();
        let each = x.sampling().times().zip(x.channel(0));
        each.map(|(t, x)| (x - (2.0 * t).cos()).abs()).fold(0.0, f64::max)
    };
    let start = r#"{ "from": { "displacement": 1 } }"#;
    for response in [r#""periodic""#, start] {
        let newmark = simulated(r#"{ "name": "newmark" }"#, response).unwrap();
        assert!(error(&newmark) < 1e-3, "{response}: {:e}", error(&newmark));
        let fourth = r#"{ "name": "runge-kutta-4", "load": "exact" }"#;
        let fourth = simulated(fourth, response).unwrap();
        assert!(error(&fourth) < 1e-7, "{response}: {:e}", error(&fourth));
        assert_eq!(fourth.nonlinear.unwrap().coefficients, [1.0]);
    }
    let exact = simulated(r#"{ "name": "exact" }"#, r#""periodic""#);
    assert!(matches!(exact, Err(SimulateError::ExactNonlinear)));
}

/// Reference: at the equilibrium x = 0 of ẍ + 1.5 ẋ − x + x³ = 0 the characteristic equation λ² +
/// 1.5 λ − 1 = 0 has the root λ = 1/2, so that a disturbance grows by e^(λT) in a period T, and the
/// response is refused. With + x instead of − x, the disturbance decays, and the response is
/// accepted.
#[test]
fn an_orbit_that_no_machine_stays_on_is_refused() {
    let simulated = |stiffness: f64| {
        let text = format!(
            r#"{{ "system": {{ "mass": 1, "damping": 1.5, "stiffness": {stiffness} }},
                 "nonlinear": {{ "terms": "k3: x1^3", "coefficients": [1] }},
                 "sampling": {{ "samples": 200, "rate_hz": 100 }}, "excitation": [],
                 "scheme": {{ "name": "runge-kutta-4", "load": "linear" }},
                 "response": "periodic" }}"#
        );
        simulate(&Experiment::parse("test.json", &text).unwrap())
    };
    let refused = simulated(-1.0).unwrap_err();
    let SimulateError::UnstableOrbit { multiplier } = refused else { panic!("{refused}") };
    assert!((multiplier - std::f64::consts::E).norm() < 1e-6, "{multiplier}");
    assert!(refused.to_string().contains("a disturbance by 2.7183 "), "{refused}");
    // The roots of λ² + 1.5 λ + 1 = 0 have the real part −3/4. A period of 2 s therefore multiplies
    // a disturbance by e^(−1.5).
    let stable = simulated(1.0).unwrap();
    let Multiplier { value, error, scheme_error } = stable.multiplier.unwrap();
    let missed = (value.norm() - (-1.5_f64).exp()).abs();
    assert!(missed < 1e-6 && error < 1e-6, "{value}");
    let by_step = scheme_error.unwrap();
    assert!(missed <= by_step && by_step < 1e-4, "{missed:e} {by_step:e}");
    let told = stable.summary().unwrap().to_string();
    assert!(
        told.contains("multiplies a disturbance of the response by at most 0.2231 ± "),
        "{told}"
    );
    assert!(told.contains("the response is stable"), "{told}");
}

/// Reference: the free response of each mass of a chain grows at the rate −c / 2m = 0.1 1/s, for
/// 0.64 s.
#[test]
fn a_large_machine_that_grows_has_no_periodic_response() {
    let simulated = |damping: f64, scheme: &str| {
        let n = 200;
        let diagonal = |value: f64| {
            let at: Vec<usize> = (1..=n).collect();
            let values = vec![value; n];
            format!(r#"{{ "size": {n}, "rows": {at:?}, "columns": {at:?}, "values": {values:?} }}"#)
        };
        let [m, c, k] = [2.0, damping, 800.0].map(diagonal);
        let text = format!(
            r#"{{ "system": {{ "mass": {m}, "damping": {c}, "stiffness": {k} }},
                 "sampling": {{ "samples": 64, "rate_hz": 100 }},
                 "excitation": [{{ "lines": "1:5", "amplitude": 5 }}], "outputs": [1],
                 "scheme": {{ "name": "{scheme}" }} }}"#
        );
        simulate(&Experiment::parse("test.json", &text).unwrap())
    };
    for scheme in ["newmark", "exact"] {
        let refused = simulated(-0.4, scheme).unwrap_err();
        let SimulateError::UnstableOrbit { multiplier } = refused else { panic!("{refused}") };
        assert!((multiplier.re - 0.064_f64.exp()).abs() < 1e-3, "{multiplier}");
        assert!(simulated(0.4, scheme).is_ok());
    }
}

#[test]
fn runge_kutta_is_of_fourth_order_where_it_knows_the_force_at_mid_step() {
    let exact = r#"{ "name": "runge-kutta-4", "load": "exact" }"#;
    let linear = r#"{ "name": "runge-kutta-4", "load": "linear" }"#;
    let order = |scheme: &str| (error(scheme, 128) / error(scheme, 256)).log2();
    assert!((order(exact) - 4.0).abs() < 0.2, "{}", order(exact));
    assert!((order(linear) - 2.0).abs() < 0.2, "{}", order(linear));
}
fn unstable(response: &str, samples: usize) -> Result<Simulation, SimulateError> {
    let text = format!(
        r#"{{ "system": {{ "mass": 2, "damping": -0.4, "stiffness": 800 }},
             "sampling": {{ "samples": {samples}, "rate_hz": 100 }},
             "excitation": [{{ "lines": "1:5", "amplitude": 5 }}],
             "scheme": {{ "name": "newmark" }}, "response": "{response}" }}"#
    );
    simulate(&Experiment::parse("test.json", &text).unwrap())
}

/// An unstable machine has no periodic response, and the message states the growth of its free
/// response. Reference: the free response grows at the rate −c / 2m = 0.1 1/s.
#[test]
fn an_unstable_machine_has_no_periodic_response_and_is_told() {
    let refused = unstable("periodic", 64).unwrap_err();
    let SimulateError::UnstablePeriodic { instability } = refused else { panic!("{refused}") };
    assert!((instability.growth_rate() - 0.1).abs() < 1e-12);
    let found = unstable("from-rest", 64).unwrap().instability.unwrap();
    assert!((found.doubling_time() - 2f64.ln() / 0.1).abs() < 1e-9, "{found}");
    // e^(0.1 t) exceeds 1e308 at 7090 s.
    let refused = unstable("from-rest", 1 << 20).unwrap_err();
    assert!(matches!(refused, SimulateError::UnstableOverflow { .. }), "{refused}");
    assert!(refused.to_string().contains("doubles every 6.931 s"), "{refused}");
}

fn simulated(scheme: &str, response: &str) -> Result<Simulation, SimulateError> {
    let text = format!(
        r#"{{ "system": {{ "mass": 2, "damping": 0, "stiffness": 8 }},
             "sampling": {{ "samples": 64, "rate_hz": 100 }},
             "excitation": [],
             "scheme": {scheme}, "response": {response} }}"#
    );
    simulate(&Experiment::parse("test.json", &text).unwrap())
}

/// A free motion starts with the displacement x0 and the velocity v0 of the description. Reference:
/// x = x0 cos ωt + v0/ω sin ωt with ω = 2.
#[test]
fn a_free_motion_starts_where_it_is_told_to() {
    let from = r#"{ "from": { "displacement": 0.5, "velocity": -3 } }"#;
    let truth = |t: f64| 0.5 * (2.0 * t).cos() - 1.5 * (2.0 * t).sin();
    let given = format!(
        r#"{{ "name": "houbolt", "start": {{ "given": {{ "at_dt": {}, "at_2dt": {} }} }} }}"#,
        truth(0.01),
        truth(0.02)
    );
    for scheme in [r#"{ "name": "newmark" }"#, &given] {
        let simulation = simulated(scheme, from).unwrap();
        let x = simulation.response.displacement();
        for (k, t) in x.sampling().times().enumerate() {
            // The error is of second order: (ωΔt)² = 4e-4, times the duration of 0.64 s and the
            // amplitude of 1.6 m, whose product is about 1.
            assert!((x.channel(0)[k] - truth(t)).abs() < 4e-4, "{scheme} at {t} s");
        }
    }
    let x = simulated(&given, from).unwrap();
    assert!((x.response.displacement().channel(0)[2] - truth(0.02)).abs() < 1e-15);
    assert!(matches!(simulated(r#"{ "name": "exact" }"#, from), Err(SimulateError::ExactFromRest)));
    let periodic = simulated(&given, r#""periodic""#);
    assert!(matches!(periodic, Err(SimulateError::GivenStartPeriodic)));
}
