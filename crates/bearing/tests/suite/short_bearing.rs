//! Comparison of the short bearing with published formulas, numerical integration and finite
//! differences.

use std::f64::consts::PI;

use mechid_bearing::{BearingError, Conditions, ShortBearing, ShortFilm};

const CONDITIONS: Conditions =
    Conditions { diameter: 0.05, length: 0.0125, clearance: 50e-6, viscosity: 0.02, omega: 300.0 };

/// Returns the eight coefficients from the formulas in books on rotor dynamics (Friswell et al.,
/// Dynamics of Rotating Machines, 2010, section 5.5.1). The formulas have u across the load and v
/// along the load, upwards; the result has the axes x and y of this crate.
fn printed(e: f64) -> ([[f64; 2]; 2], [[f64; 2]; 2]) {
    let (s, p) = (e * e, PI * PI);
    let g = 1.0 - s;
    let h = (p * g + 16.0 * s).powf(-1.5);
    let uu = h * 4.0 * (p * (2.0 - s) + 16.0 * s);
    let uv = h * PI * (p * g * g - 16.0 * s * s) / (e * g.sqrt());
    let vu = -h * PI * (p * g * (1.0 + 2.0 * s) + 32.0 * s * (1.0 + s)) / (e * g.sqrt());
    let vv = h * 4.0 * (p * (1.0 + 2.0 * s) + 32.0 * s * (1.0 + s) / g);
    let buu = h * 2.0 * PI * g.sqrt() * (p * (1.0 + 2.0 * s) - 16.0 * s) / e;
    let buv = -h * 8.0 * (p * (1.0 + 2.0 * s) - 16.0 * s);
    let bvv = h * 2.0 * PI * (p * g * g + 48.0 * s) / (e * g.sqrt());
    // In this crate, x is along the load, downwards, and the journal rotates from x to y.
    ([[vv, -vu], [-uv, uu]], [[bvv, -buv], [-buv, buu]])
}

#[test]
fn coefficients_are_those_of_the_books() {
    let bearing = ShortBearing::new(0.25).unwrap();
    for e in [0.01, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99] {
        let found = bearing.at_eccentricity(e).unwrap();
        let (stiffness, damping) = printed(e);
        for (ours, theirs) in
            [(found.coefficients().stiffness, stiffness), (found.coefficients().damping, damping)]
        {
            let largest = theirs.as_flattened().iter().fold(0.0_f64, |a, b| a.max(b.abs()));
            for (a, b) in ours.as_flattened().iter().zip(theirs.as_flattened()) {
                assert!((a - b).abs() < 1e-11 * largest, "{e}: {ours:?} {theirs:?}");
            }
        }
        let tangent = PI * (1.0 - e * e).sqrt() / (4.0 * e);
        assert!((found.attitude().tan() / tangent - 1.0).abs() < 1e-12);
    }
}

#[test]
fn sommerfeld_number_and_eccentricity_lead_to_one_another() {
    let bearing = ShortBearing::new(0.4).unwrap();
    for e in [1e-9, 1e-3, 0.2, 0.8, 0.999, 1.0 - 1e-9] {
        let there = bearing.at_eccentricity(e).unwrap();
        let again = bearing.equilibrium(there.sommerfeld_number()).unwrap();
        // S decreases as (1 − ε)², so that 1 − ε has the relative accuracy of S.
        let error = (again.eccentricity() - e).abs();
        assert!(error < 1e-12 * e && error < 1e-6 * (1.0 - e), "{e}: {again:?}");
    }
    let extreme = bearing.equilibrium(1e60);
    assert!(matches!(extreme, Err(BearingError::Parameter { .. })), "{extreme:?}");
}

/// Force by Simpson's rule over the half of the film with positive pressure.
fn by_quadrature(position: [f64; 2], velocity: [f64; 2]) -> [f64; 2] {
    let Conditions { diameter, length, clearance, viscosity, omega } = CONDITIONS;
    let scale = viscosity * diameter / 2.0 * length.powi(3);
    let intervals = 400_000;
    let step = 2.0 * PI / f64::from(intervals);
    let mut sum = [0.0; 2];
    for k in 0..intervals {
        let (sin, cos) = (f64::from(k) * step).sin_cos();
        let h = clearance - position[0] * cos - position[1] * sin;
        let change = omega / 2.0 * (position[0] * sin - position[1] * cos)
            - velocity[0] * cos
            - velocity[1] * sin;
        let line = scale * (change / h.powi(3)).min(0.0) * step;
        sum[0] += line * cos;
        sum[1] += line * sin;
    }
    sum
}

/// Positions in clearances, and velocities in clearances per radian of rotation.
const STATES: [([f64; 2], [f64; 2]); 7] = [
    ([0.3, 0.4], [0.0, 0.0]),
    ([0.3, 0.4], [0.2, -0.5]),
    ([-0.6, 0.1], [-0.1, 0.3]),
    ([0.0, -0.85], [0.4, 0.1]),
    ([0.0, 0.0], [0.1, 0.2]),
    ([0.2, -0.1], [2.0, 1.0]),
    ([-0.3, -0.3], [0.15, -0.1]),
];

#[test]
fn the_force_is_the_integral_of_the_pressure_at_any_state() {
    let film = ShortFilm::new(CONDITIONS).unwrap();
    for (position, velocity) in STATES {
        let position = position.map(|x| x * CONDITIONS.clearance);
        let velocity = velocity.map(|v| v * CONDITIONS.clearance * CONDITIONS.omega);
        let ours = film.force(position, velocity).unwrap().force;
        let expected = by_quadrature(position, velocity);
        let size = expected[0].hypot(expected[1]);
        for axis in 0..2 {
            let error = (ours[axis] - expected[axis]).abs();
            // The integrand has a kink where the pressure begins; therefore the error of the
            // quadrature is of second order in the step.
            assert!(error < 1e-8 * size, "{position:?} {ours:?} {expected:?}");
        }
    }
}

#[test]
fn tangents_are_the_derivatives_of_the_force() {
    let film = ShortFilm::new(CONDITIONS).unwrap();
    let (clearance, omega) = (CONDITIONS.clearance, CONDITIONS.omega);
    for (position, velocity) in STATES {
        let position = position.map(|x| x * clearance);
        let velocity = velocity.map(|v| v * clearance * omega);
        let t = film.force(position, velocity).unwrap().tangent;
        let stiffness = [[t.kxx, t.kxy], [t.kyx, t.kyy]];
        let damping = [[t.cxx, t.cxy], [t.cyx, t.cyy]];
        for k in 0..2 {
            let of = |dx: f64, dv: f64| {
                let (mut position, mut velocity) = (position, velocity);
                position[k] += dx;
                velocity[k] += dv;
                film.force(position, velocity).unwrap().force
            };
            for i in 0..2 {
                let step = 1e-6 * clearance;
                let by_x = (of(-step, 0.0)[i] - of(step, 0.0)[i]) / (2.0 * step);
                let largest = stiffness.as_flattened().iter().fold(0.0_f64, |a, b| a.max(b.abs()));
                assert!((stiffness[i][k] - by_x).abs() < 1e-7 * largest, "{position:?}");
                let step = 1e-6 * clearance * omega;
                let by_v = (of(0.0, -step)[i] - of(0.0, step)[i]) / (2.0 * step);
                let largest = damping.as_flattened().iter().fold(0.0_f64, |a, b| a.max(b.abs()));
                assert!((damping[i][k] - by_v).abs() < 1e-7 * largest, "{velocity:?}");
            }
        }
    }
}

/// If position and velocity are turned by an angle, the force turns by the same angle.
#[test]
fn the_film_turns_with_the_axes() {
    let film = ShortFilm::new(CONDITIONS).unwrap();
    let (clearance, omega) = (CONDITIONS.clearance, CONDITIONS.omega);
    let (sin, cos) = 0.7_f64.sin_cos();
    let turn = |[x, y]: [f64; 2]| [cos * x - sin * y, sin * x + cos * y];
    for (position, velocity) in STATES {
        let position = position.map(|x| x * clearance);
        let velocity = velocity.map(|v| v * clearance * omega);
        let expected = turn(film.force(position, velocity).unwrap().force);
        let turned = film.force(turn(position), turn(velocity)).unwrap().force;
        let size = expected[0].hypot(expected[1]);
        for axis in 0..2 {
            assert!((turned[axis] - expected[axis]).abs() < 1e-12 * size);
        }
    }
}

/// If the journal whirls at half the speed of rotation, the film has no pressure, at any
/// eccentricity. For this reason oil whirl has half the frequency of rotation.
#[test]
fn whirl_at_half_the_speed_meets_no_force() {
    let film = ShortFilm::new(CONDITIONS).unwrap();
    let at = |share: f64| {
        let position = [0.3 * CONDITIONS.clearance, -0.4 * CONDITIONS.clearance];
        let speed = share * CONDITIONS.omega;
        let velocity = [-speed * position[1], speed * position[0]];
        let [x, y] = film.force(position, velocity).unwrap().force;
        x.hypot(y)
    };
    assert!(at(0.5) < 1e-12 * at(0.0), "{} {}", at(0.5), at(0.0));
}
