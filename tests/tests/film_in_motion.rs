//! A rig test simulated on the nonlinear film of a short bearing; the true coefficients follow from
//! the geometry. At small amplitudes the test finds the coefficients of the linear film, at large
//! amplitudes it does not. A rotor on this film whirls if its mass exceeds the critical mass.

use std::f64::consts::TAU;
use std::path::Path;

use mechid::analysis::bearing::Coefficients;
use mechid::analysis::{IdentifiedBearing, IdentifyBearing};
use mechid::bearing::{Conditions, ShortBearing, ShortFilm, Threshold};
use mechid::integrate::{ForceFunction, RungeKutta4, SystemWithForces, integrate, periodic_orbit};
use mechid::model::{InitialState, OilFilm, SecondOrderSystem};
use mechid::plot::{Axis, Color, Curve, Dash, Figure, Panel, Reference};
use mechid::signal::{Multisine, Phases, Record, Sampling, noise};
use mechid::{Acceleration, BearingData, Displacement, Measurement, identify_bearing};
use nalgebra::{DMatrix, DVector, Matrix2, dmatrix};

const CONDITIONS: Conditions =
    Conditions { diameter: 0.05, length: 0.0125, clearance: 50e-6, viscosity: 0.02, omega: 300.0 };
/// Static load, in N; the eccentricity is 0.163.
const LOAD: f64 = 16.0;
/// Mass of the housing, in kg.
const MASS: f64 = 2.0;
const PERIOD: usize = 2048;

/// All spectral lines from 8 to 100 Hz, 4 Hz apart.
fn all() -> Vec<usize> {
    (2..=25).collect()
}

/// Odd spectral lines only: sums and differences of two of them are even, so quadratic distortion
/// does not fall on them.
fn odd() -> Vec<usize> {
    (3..=25).step_by(2).collect()
}

fn sampling() -> Sampling {
    Sampling::from_rate_hz(8192.0, PERIOD).unwrap()
}

/// Coefficients of the film from the geometry, and the static equilibrium position of the journal.
fn geometry() -> (OilFilm, [f64; 2]) {
    let bearing = ShortBearing::new(CONDITIONS.length_over_diameter().unwrap()).unwrap();
    let found = bearing.equilibrium(CONDITIONS.sommerfeld_number(LOAD).unwrap()).unwrap();
    assert!((found.eccentricity() - 0.163).abs() < 5e-4, "{}", found.eccentricity());
    let film = CONDITIONS.film(found.coefficients(), LOAD).unwrap();
    (film, found.position().map(|x| x * CONDITIONS.clearance))
}

/// A mass on the film, which carries the static load: a floating housing on its shaft or,
/// equivalently, a rigid rotor in its bearing.
fn on_the_film(mass: &SecondOrderSystem) -> SystemWithForces<'_> {
    let film = ShortFilm::new(CONDITIONS).unwrap();
    let carried = ForceFunction::new(vec![0, 1], move |_, x: &[f64], v: &[f64], g: &mut [f64]| {
        let force = film.force([x[0], x[1]], [v[0], v[1]]).map_or([f64::NAN; 2], |at| at.force);
        (g[0], g[1]) = (-force[0] - LOAD, -force[1]);
    });
    SystemWithForces::new(mass).with(carried).unwrap()
}

fn free(mass: f64) -> SecondOrderSystem {
    let zero = DMatrix::zeros(2, 2);
    SecondOrderSystem::new(DMatrix::identity(2, 2) * mass, zero.clone(), zero).unwrap()
}

/// One period of the steady motion under a multisine in direction `along` with `amplitude` newtons
/// per line: force, displacement and acceleration.
fn orbit(lines: &[usize], along: usize, amplitude: f64) -> [Record; 3] {
    let shaken = Multisine::flat(lines.to_vec(), amplitude, Phases::Schroeder).unwrap();
    let shaken = shaken.sample(sampling()).unwrap();
    let mut force = DMatrix::zeros(PERIOD, 2);
    force.column_mut(along).copy_from(&shaken.column(0));
    let force = Record::new(sampling(), force).unwrap();
    let rest = geometry().1;
    let start = InitialState::new(DVector::from_row_slice(&rest), DVector::zeros(2)).unwrap();
    let housing = free(MASS);
    let system = on_the_film(&housing);
    let orbit = periodic_orbit(&RungeKutta4::LINEAR, &system, &force, &start, 1).unwrap();
    let response = orbit.response();
    [force, response.displacement().clone(), response.acceleration().clone()]
}

fn settings() -> IdentifyBearing {
    let coefficients = Coefficients::Eight;
    IdentifyBearing { stator_mass: MASS, coefficients, ..IdentifyBearing::default() }
}

/// Bearing that the linear fit identifies from a rig test with a force of `amplitude` newtons per
/// line; `part` is the ratio of the RMS of the noise to that of the motion.
fn identified(lines: &[usize], amplitude: f64, part: f64) -> IdentifiedBearing {
    let test = |along: usize| {
        let repeats = if part > 0.0 { 8 } else { 1 };
        let [force, x, a] = orbit(lines, along, amplitude).map(|r| r.repeated(repeats).unwrap());
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
    let data = BearingData::from_records(&[test(0), test(1)], &settings()).unwrap();
    identify_bearing(&data, None, &settings()).unwrap()
}

/// Largest errors of stiffness K and damping C, each divided by the largest entry of the matrix.
fn errors(found: &IdentifiedBearing) -> [f64; 2] {
    let film = geometry().0;
    let k = Matrix2::new(film.kxx, film.kxy, film.kyx, film.kyy);
    let c = Matrix2::new(film.cxx, film.cxy, film.cyx, film.cyy);
    [(found.stiffness() - k).amax() / k.amax(), (found.damping() - c).amax() / c.amax()]
}

#[test]
fn a_test_at_small_amplitude_finds_the_coefficients_of_the_geometry() {
    let found = identified(&all(), 0.02, 0.05);
    let OilFilm { kxx, kxy, kyx, kyy, cxx, cxy, cyx, cyy } = geometry().0;
    let truth = [kxx, kxy, kyx, kyy, cxx, cxy, cyx, cyy];
    assert!(found.summary().amplitude.unwrap().largest_displacement < 0.01 * CONDITIONS.clearance);
    for (row, exact) in found.summary().coefficients.iter().zip(truth) {
        // Each of the eight coefficients may deviate by 3.3 standard errors, the bound of a 99.9 %
        // interval.
        let error = row.estimate.standard_error.unwrap();
        assert!((row.estimate.value - exact).abs() < 3.3 * error, "{row:?}, exactly {exact}");
        let largest = if row.name.starts_with('k') { kxy } else { cxx };
        assert!(error < 0.01 * largest, "{row:?}");
    }
}

/// Amplitude divided by the clearance, and the errors of K and C in per cent, of a test without
/// noise.
fn bias(lines: &[usize], amplitude: f64) -> [f64; 3] {
    let found = identified(lines, amplitude, 0.0);
    let largest = found.summary().amplitude.unwrap().largest_displacement;
    let [k, c] = errors(&found);
    [largest / CONDITIONS.clearance, 100.0 * k, 100.0 * c]
}

/// Checks that the picture `name` of `theory/bearing.md` is the one drawn here; the numbers may
/// differ by half a pixel. With `MECHID_BLESS=1` the picture is written first.
fn assert_is_in_the_book(name: &str, figure: &Figure) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../docs/book/src/theory/film_in_motion")
        .join(name);
    let drawn = figure.to_svg().unwrap();
    if std::env::var_os("MECHID_BLESS").is_some() {
        std::fs::write(&path, &drawn).unwrap();
    }
    let kept = std::fs::read_to_string(&path).unwrap_or_default();
    let pieces = |text: &str| -> Vec<String> {
        let is_end = |c: char| c.is_whitespace() || "\",MLZ<>".contains(c);
        text.split(is_end).map(str::to_owned).collect()
    };
    let (drawn, kept) = (pieces(&drawn), pieces(&kept));
    assert_eq!(drawn.len(), kept.len(), "{name} is another picture: MECHID_BLESS=1 writes it");
    for (a, b) in drawn.iter().zip(&kept) {
        let same = match (a.parse::<f64>(), b.parse::<f64>()) {
            (Ok(a), Ok(b)) => (a - b).abs() < 0.5,
            _ => a == b,
        };
        assert!(same, "{name}: {a} instead of {b}; MECHID_BLESS=1 writes it");
    }
}

/// Checks the table and the first figure of `theory/bearing.md`, which show the bias of a linear
/// fit at larger amplitudes.
#[test]
fn the_bias_over_amplitude_is_what_the_book_says() {
    let page = include_str!("../../docs/book/src/theory/bearing.md");
    let mut table = String::from(
        "| Amplitude over clearance | K, % | C, % | odd lines alone | K, % | C, % |\n\
         |---|---|---|---|---|---|\n",
    );
    let [mut of_all, mut of_odd] = [(); 2].map(|()| Vec::<[f64; 3]>::new());
    for amplitude in [0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2] {
        // Only half of the lines are odd; the factor √2 of their amplitudes gives the same total
        // power as that of all lines.
        let (a, b) = (bias(&all(), amplitude), bias(&odd(), 2_f64.sqrt() * amplitude));
        let [[at, k, c], [odd_at, odd_k, odd_c]] = [a, b];
        table +=
            &format!("| {at:.3} | {k:.2} | {c:.2} | {odd_at:.3} | {odd_k:.2} | {odd_c:.2} |\n");
        of_all.push(a);
        of_odd.push(b);
    }
    assert!(page.contains(&table), "the page should have\n{table}");
    // With all lines, the bias grows with the amplitude; with odd lines, with the square of the
    // amplitude.
    let order = |from: [f64; 3], to: [f64; 3]| (to[1] / from[1]).ln() / (to[0] / from[0]).ln();
    let (first, second) = (order(of_all[1], of_all[3]), order(of_odd[1], of_odd[3]));
    assert!((first - 1.0).abs() < 0.1 && (second - 2.0).abs() < 0.3, "{first} {second}");

    let mut panel = Panel::new(
        Axis::log10("Amplitude over clearance", ""),
        Axis::log10("Error over largest entry", "%"),
    );
    for (slot, (of, lines)) in
        [(&of_all, "all lines"), (&of_odd, "odd lines")].into_iter().enumerate()
    {
        let column = |at: usize| of.iter().map(|row| row[at]).collect::<Vec<f64>>();
        let (k, c) = (format!("K, {lines}"), format!("C, {lines}"));
        panel = panel
            .curve(Curve::marked_line(k, &column(0), &column(1)).slot(slot).dash(Dash::Solid))
            .curve(Curve::marked_line(c, &column(0), &column(2)).slot(slot).dash(Dash::Dashed));
    }
    let panel = panel.reference(Reference::vertical("0.05", 0.05));
    assert_is_in_the_book("bias.svg", &Figure::new("Bias of linear identification").panel(panel));
}

/// Motion of a rotor of `masses` times the critical mass, released at a distance of `beside`
/// clearances from its equilibrium, with 200 steps per turn of the shaft.
fn released_orbit(masses: f64, beside: f64, turns: usize) -> Record {
    let rotor = free(masses * critical().0);
    let system = on_the_film(&rotor);
    let mut start = geometry().1;
    start[0] += beside * CONDITIONS.clearance;
    let start = InitialState::new(DVector::from_row_slice(&start), DVector::zeros(2)).unwrap();
    let sampling = Sampling::new(TAU / CONDITIONS.omega / 200.0, 200 * turns).unwrap();
    let none = Record::new(sampling, DMatrix::zeros(200 * turns, 2)).unwrap();
    let response = integrate(&RungeKutta4::LINEAR, &system, &none, &start).unwrap();
    response.displacement().clone()
}

/// Critical mass, in kg, and whirl frequency ratio of the linear film.
fn critical() -> (f64, f64) {
    let threshold = Threshold::new(&geometry().0, CONDITIONS.omega).unwrap();
    (threshold.critical_mass().unwrap(), threshold.whirl_frequency_ratio().unwrap())
}

/// Growth rate, in 1/s, of a small whirl of a rotor on the nonlinear film, from two successive
/// sections of ten whirl periods each. The rotor has `masses` times the critical mass.
fn growth(masses: f64) -> f64 {
    let x = released_orbit(masses, 1e-5, 60);
    let rest = geometry().1;
    let stretch = (10.0 * 200.0 / critical().1).round() as usize;
    let power = |from: usize| -> f64 {
        let rows = x.data().rows(from, stretch);
        rows.row_iter().map(|row| (row[0] - rest[0]).powi(2) + (row[1] - rest[1]).powi(2)).sum()
    };
    let seconds = stretch as f64 * x.sampling().dt();
    (power(2 * stretch) / power(stretch)).ln() / (2.0 * seconds)
}

/// Largest real part of the eigenvalues of the linear film with the rotor, in 1/s.
fn linear_growth(masses: f64) -> f64 {
    let OilFilm { kxx, kxy, kyx, kyy, cxx, cxy, cyx, cyy } = geometry().0;
    let mass = DMatrix::identity(2, 2) * (masses * critical().0);
    let (c, k) = (dmatrix![cxx, cxy; cyx, cyy], dmatrix![kxx, kxy; kyx, kyy]);
    let eigenvalues = SecondOrderSystem::new(mass, c, k).unwrap().eigenvalues().unwrap();
    eigenvalues.iter().map(|value| value.re).fold(f64::NEG_INFINITY, f64::max)
}

/// Checks that the second figure of `theory/bearing.md` is the one computed here: orbits of a rig
/// test, the whirl of rotors above the threshold, and the growth rate of a small whirl.
#[test]
fn the_film_in_motion_is_what_the_book_shows() {
    let across = || Axis::linear("y / c", "").range(-1.05, 1.05);
    let along = || Axis::linear("−x / c", "").range(-1.05, 1.05);
    let path = |label: String, x: &Record, from: usize, every: usize| {
        let kept = (from..x.len()).step_by(every).collect::<Vec<usize>>();
        let column = |at: usize, sign: f64| -> Vec<f64> {
            kept.iter().map(|row| sign * x.data()[(*row, at)] / CONDITIONS.clearance).collect()
        };
        Curve::line(label, &column(1, 1.0), &column(0, -1.0)).dash(Dash::Solid)
    };
    let clearance = || {
        let [y, x] = [f64::cos, f64::sin]
            .map(|f| (0..=90).map(|k| f(f64::from(k) * TAU / 90.0)).collect::<Vec<f64>>());
        Curve::line("clearance", &y, &x).color(Color::GREY)
    };
    let mut tests = Panel::new(across(), along()).title("rig test").curve(clearance());
    for (label, amplitude) in [("0.36 c", 3.2), ("0.04 c", 0.4)] {
        tests = tests.curve(path(label.into(), &orbit(&all(), 0, amplitude)[1], 0, 8));
    }
    let mut whirl = Panel::new(across(), along()).title("oil whirl").curve(clearance());
    for masses in [1.2, 1.05] {
        // The last eight turns of the shaft, during which the rotor whirls four times.
        let x = released_orbit(masses, 0.02, 200);
        let last = x.len() - 8 * 200;
        let orbit = path(format!("mass {masses}"), &x, last, 8);
        let [low, high] = [f64::min, f64::max].map(|f| orbit.y().iter().copied().fold(0.0, f));
        assert!(high - low > 0.2, "a rotor of {masses} critical masses whirls: {low} to {high}");
        whirl = whirl.curve(orbit);
    }
    let masses: Vec<f64> = (0..=8).map(|k| 0.8 + 0.05 * f64::from(k)).collect();
    let nonlinear: Vec<f64> = masses.iter().map(|m| growth(*m)).collect();
    let linear: Vec<f64> = masses.iter().map(|m| linear_growth(*m)).collect();
    let largest = linear.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
    for ((mass, a), b) in masses.iter().zip(&nonlinear).zip(&linear) {
        assert!((a - b).abs() < 0.01 * largest, "{mass}: {a}, of the linear film {b}");
    }
    let grows =
        Panel::new(Axis::linear("Mass over critical mass", ""), Axis::linear("Growth", "1/s"))
            .title("small whirl")
            .curve(Curve::points("nonlinear film", &masses, &nonlinear))
            .curve(Curve::line("linear film", &masses, &linear).dash(Dash::Solid))
            .reference(Reference::horizontal("", 0.0))
            .reference(Reference::vertical("", 1.0));
    let figure =
        [tests, whirl, grows].into_iter().fold(Figure::new("The film in motion"), Figure::panel);
    assert_is_in_the_book("motion.svg", &figure.columns(3).size(1080.0, 447.0));
}
