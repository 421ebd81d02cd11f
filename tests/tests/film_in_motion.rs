//! A rig test simulated on the nonlinear film of a short bearing, with the truth known from the
//! geometry: at small amplitudes the coefficients are those of the film, at large ones they are not.

use mechid::analysis::bearing::Coefficients;
use mechid::analysis::{IdentifiedBearing, IdentifyBearing};
use mechid::bearing::{Conditions, ShortBearing, ShortFilm};
use mechid::integrate::{ForceFunction, RungeKutta4, SystemWithForces, periodic_orbit};
use mechid::model::{InitialState, OilFilm, SecondOrderSystem};
use mechid::signal::{Multisine, Phases, Record, Sampling, noise};
use mechid::{Acceleration, BearingData, Displacement, Measurement, identify_bearing};
use nalgebra::{DMatrix, DVector, Matrix2};

const CONDITIONS: Conditions =
    Conditions { diameter: 0.05, length: 0.0125, clearance: 50e-6, viscosity: 0.02, omega: 300.0 };
/// Static load, in N; the eccentricity is 0.35.
const LOAD: f64 = 16.0;
/// Mass of the housing, in kg.
const MASS: f64 = 2.0;
const PERIOD: usize = 2048;

fn sampling() -> Sampling {
    Sampling::from_rate_hz(8192.0, PERIOD).unwrap()
}

/// Coefficients from the geometry, and the place of rest.
fn geometry() -> (OilFilm, [f64; 2]) {
    let bearing = ShortBearing::new(CONDITIONS.length_over_diameter().unwrap()).unwrap();
    let found = bearing.equilibrium(CONDITIONS.sommerfeld_number(LOAD).unwrap()).unwrap();
    let film = CONDITIONS.film(found.coefficients(), LOAD).unwrap();
    (film, found.position().map(|x| x * CONDITIONS.clearance))
}

/// One period of the steady motion under a multisine in direction `along`, `amplitude` N a line: force,
/// displacement and acceleration.
fn orbit(along: usize, amplitude: f64) -> [Record; 3] {
    let film = ShortFilm::new(CONDITIONS).unwrap();
    let zero = DMatrix::zeros(2, 2);
    let housing =
        SecondOrderSystem::new(DMatrix::identity(2, 2) * MASS, zero.clone(), zero).unwrap();
    let carried = ForceFunction::new(vec![0, 1], move |_, x: &[f64], v: &[f64], g: &mut [f64]| {
        let force = film.force([x[0], x[1]], [v[0], v[1]]).map_or([f64::NAN; 2], |at| at.force);
        (g[0], g[1]) = (-force[0] - LOAD, -force[1]);
    });
    let system = SystemWithForces::new(&housing).with(carried).unwrap();
    let lines = (2..=25).collect::<Vec<usize>>();
    let shaken = Multisine::flat(lines, amplitude, Phases::Schroeder).unwrap();
    let shaken = shaken.sample(sampling()).unwrap();
    let mut force = DMatrix::zeros(PERIOD, 2);
    force.column_mut(along).copy_from(&shaken.column(0));
    let force = Record::new(sampling(), force).unwrap();
    let rest = geometry().1;
    let start = InitialState::new(DVector::from_row_slice(&rest), DVector::zeros(2)).unwrap();
    let orbit = periodic_orbit(&RungeKutta4::LINEAR, &system, &force, &start, 1).unwrap();
    let response = orbit.response();
    [force, response.displacement().clone(), response.acceleration().clone()]
}

fn settings() -> IdentifyBearing {
    let coefficients = Coefficients::Eight;
    IdentifyBearing { stator_mass: MASS, coefficients, ..IdentifyBearing::default() }
}

/// What a linear test finds at an amplitude of so many N a line, with noise of a part of the motion.
fn identified(amplitude: f64, part: f64) -> IdentifiedBearing {
    let test = |along: usize| {
        let repeats = if part > 0.0 { 8 } else { 1 };
        let [force, x, a] = orbit(along, amplitude).map(|r| r.repeated(repeats).unwrap());
        let noisy = |record: &Record, seed: u64| {
            let rms = record.without_mean().data().norm() / (2.0 * record.len() as f64).sqrt();
            let drawn = noise::white(record.sampling(), 2, part * rms, seed).unwrap();
            Record::new(record.sampling(), record.data() + drawn.data()).unwrap()
        };
        let (x, a) = match part > 0.0 {
            true => (noisy(&x, along as u64), noisy(&a, 10 + along as u64)),
            false => (x, a),
        };
        let responses = [(Displacement, &x), (Acceleration, &a)];
        Measurement::from_records(&force, &responses).unwrap().period(PERIOD).unwrap()
    };
    let data = BearingData::of_records(&[test(0), test(1)], &settings()).unwrap();
    identify_bearing(&data, None, &settings()).unwrap()
}

/// Largest errors of K and C over their largest entries.
fn errors(found: &IdentifiedBearing) -> [f64; 2] {
    let film = geometry().0;
    let k = Matrix2::new(film.kxx, film.kxy, film.kyx, film.kyy);
    let c = Matrix2::new(film.cxx, film.cxy, film.cyx, film.cyy);
    [(found.stiffness() - k).amax() / k.amax(), (found.damping() - c).amax() / c.amax()]
}

#[test]
fn a_test_at_small_amplitude_finds_the_coefficients_of_the_geometry() {
    let found = identified(0.02, 0.05);
    let OilFilm { kxx, kxy, kyx, kyy, cxx, cxy, cyx, cyy } = geometry().0;
    let truth = [kxx, kxy, kyx, kyy, cxx, cxy, cyx, cyy];
    assert!(found.summary().amplitude.unwrap().largest_displacement < 0.01 * CONDITIONS.clearance);
    for (row, exact) in found.summary().coefficients.iter().zip(truth) {
        // Eight intervals of 99.9 %.
        let error = row.estimate.standard_error.unwrap();
        assert!((row.estimate.value - exact).abs() < 3.3 * error, "{row:?}, exactly {exact}");
        let largest = if row.name.starts_with('k') { kxy } else { cxx };
        assert!(error < 0.01 * largest, "{row:?}");
    }
}

/// The table of `theory/bearing.md` of the book: what a linear fit finds at larger amplitudes.
#[test]
fn the_bias_over_amplitude_is_what_the_book_says() {
    let page = include_str!("../../docs/book/src/theory/bearing.md");
    let mut table = String::from("| Amplitude over clearance | K, % | C, % |\n|---|---|---|\n");
    let mut last = 0.0;
    for amplitude in [0.1, 0.4, 0.8, 1.6, 3.2] {
        let found = identified(amplitude, 0.0);
        let part = found.summary().amplitude.unwrap().largest_displacement / CONDITIONS.clearance;
        let [k, c] = errors(&found);
        table += &format!("| {part:.3} | {:.1} | {:.1} |\n", 100.0 * k, 100.0 * c);
        assert!(k.max(c) > last, "{table}");
        last = k.max(c);
    }
    assert!(page.contains(&table), "the page should have\n{table}");
}
