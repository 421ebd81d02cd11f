//! A rigid rotor on the nonlinear film, integrated in time: comparison of the oil whirl with the
//! linear threshold.

use std::f64::consts::TAU;

use mechid_bearing::{Conditions, ShortBearing, ShortFilm, Threshold};

const CONDITIONS: Conditions =
    Conditions { diameter: 0.05, length: 0.0125, clearance: 50e-6, viscosity: 0.02, omega: 300.0 };
/// Static load, in N; the eccentricity is 0.163.
const LOAD: f64 = 16.0;

struct Rotor {
    film: ShortFilm,
    mass: f64,
}

/// Position and velocity, in m and m/s.
type State = [f64; 4];

impl Rotor {
    fn new(mass: f64) -> Self {
        Self { film: ShortFilm::new(CONDITIONS).unwrap(), mass }
    }

    fn equilibrium() -> State {
        let bearing = ShortBearing::new(CONDITIONS.length_over_diameter().unwrap()).unwrap();
        let found = bearing.equilibrium(CONDITIONS.sommerfeld_number(LOAD).unwrap()).unwrap();
        let [x, y] = found.position().map(|x| x * CONDITIONS.clearance);
        [x, y, 0.0, 0.0]
    }

    fn slope(&self, [x, y, u, v]: State) -> State {
        let [fx, fy] = self.film.force([x, y], [u, v]).unwrap().force;
        [u, v, (fx + LOAD) / self.mass, fy / self.mass]
    }

    /// Returns the state after a step of the fourth-order Runge–Kutta method.
    fn step(&self, state: State, dt: f64) -> State {
        let moved = |by: State, h: f64| std::array::from_fn(|i| state[i] + h * by[i]);
        let a = self.slope(state);
        let b = self.slope(moved(a, dt / 2.0));
        let c = self.slope(moved(b, dt / 2.0));
        let d = self.slope(moved(c, dt));
        std::array::from_fn(|i| state[i] + dt / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]))
    }

    /// Returns the growth rate (1/s) of the amplitude of a small whirl at `omega_w`, from the
    /// powers in two consecutive intervals of whole periods.
    fn growth(&self, omega_w: f64) -> f64 {
        let rest = Self::equilibrium();
        let (steps, periods) = (200, 10);
        let dt = TAU / omega_w / f64::from(steps);
        let mut state = rest;
        state[0] += 1e-5 * CONDITIONS.clearance;
        let mut power = |periods: i32| -> f64 {
            let mut sum = 0.0;
            for _ in 0..periods * steps {
                state = self.step(state, dt);
                sum += (state[0] - rest[0]).powi(2) + (state[1] - rest[1]).powi(2);
            }
            sum
        };
        // During these periods, the other motions of the rotor decay.
        power(periods);
        let (before, after) = (power(periods), power(periods));
        (after / before).ln() / (2.0 * f64::from(periods) * TAU / omega_w)
    }
}

fn threshold() -> Threshold {
    let bearing = ShortBearing::new(CONDITIONS.length_over_diameter().unwrap()).unwrap();
    let found = bearing.equilibrium(CONDITIONS.sommerfeld_number(LOAD).unwrap()).unwrap();
    Threshold::new(&CONDITIONS.film(found.coefficients(), LOAD).unwrap(), CONDITIONS.omega).unwrap()
}

/// A small whirl of the nonlinear rotor neither grows nor decays at the critical mass of the
/// linearised film.
#[test]
fn small_whirl_has_the_linear_threshold() {
    let threshold = threshold();
    let critical = threshold.critical_mass().unwrap();
    let omega_w = threshold.whirl_frequency_ratio().unwrap() * CONDITIONS.omega;
    let [below, above] = [0.99, 1.01].map(|part| Rotor::new(part * critical).growth(omega_w));
    assert!(below < 0.0 && above > 0.0, "{below} {above}");
    let crossing = 0.99 + 0.02 * below / (below - above);
    assert!((crossing - 1.0).abs() < 2e-4, "{crossing}");
}

/// The whirl of a rotor heavier than the critical mass grows until the film limits the amplitude;
/// the frequency of this whirl is about half the frequency of rotation. A lighter rotor returns to
/// rest.
#[test]
fn whirl_of_an_unstable_rotor_stays_within_the_clearance() {
    let critical = threshold().critical_mass().unwrap();
    let rest = Rotor::equilibrium();
    let dt = TAU / CONDITIONS.omega / 200.0;
    let turns = 120;
    let run = |mass: f64| {
        let rotor = Rotor::new(mass);
        let mut state = rest;
        state[0] += 0.02 * CONDITIONS.clearance;
        let (mut largest, mut last, mut angle) = (0.0_f64, f64::NAN, 0.0);
        for k in 0..turns * 200 {
            state = rotor.step(state, dt);
            let [x, y] = [state[0] - rest[0], state[1] - rest[1]];
            // Only the last quarter of the run is evaluated.
            if k > turns * 150 {
                largest = largest.max(x.hypot(y) / CONDITIONS.clearance);
                let now = y.atan2(x);
                let turned = now - last;
                if turned.is_finite() {
                    angle += turned - TAU * (turned / TAU).round();
                }
                last = now;
            }
        }
        (largest, angle / (f64::from(turns) / 4.0 * TAU))
    };
    let (amplitude, frequency) = run(1.2 * critical);
    assert!(amplitude > 0.2 && amplitude < 2.0, "{amplitude}");
    assert!((frequency - 0.5).abs() < 0.05, "{frequency}");
    let (amplitude, _) = run(0.8 * critical);
    assert!(amplitude < 0.005, "{amplitude}");
}
