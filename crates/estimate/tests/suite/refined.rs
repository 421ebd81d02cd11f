//! Fits to records with intermediate points: standard errors compared with the scatter of
//! experiments, and error rates of the checks of the residual.

use mechid_checks::{Verdict, after_fit};
use mechid_estimate::time_domain::{TimeDomain, Transitions};
use mechid_estimate::{Unknowns, missing_force};
use mechid_model::{Discretisation, InitialState, Response, SecondOrderSystem};
use mechid_problems::{dissertation_sdof, exact_foh_periodic, exact_harmonic_periodic, exact_zoh};
use mechid_signal::Extent;
use mechid_signal::resample::refine;
use mechid_signal::{Interpolation, Multisine, Phases, Record, Sampling, noise};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

const SAMPLES: usize = 256;

/// An oscillator in its steady state, disturbed at random at every sample.
struct Experiment {
    force: Record,
    course: Response,
    /// Φ of the free motion from sample to sample.
    transition: DMatrix<f64>,
}

impl Experiment {
    fn new() -> Self {
        Self::driven(|system, force| exact_harmonic_periodic(system, force).unwrap())
    }

    fn driven(course: impl Fn(&SecondOrderSystem, &Record) -> Response) -> Self {
        let system = dissertation_sdof().system();
        let sampling = Sampling::new(0.02, SAMPLES).unwrap();
        // Thirteen samples per cycle at the highest line: the interpolations are accurate.
        let force = Multisine::flat(1..=20, 20.0, Phases::Schroeder).unwrap();
        let force = force.sample(sampling).unwrap();
        let course = course(&system, &force);
        let still = Record::from_channel(sampling, vec![0.0; SAMPLES]).unwrap();
        let column = |x: f64, v: f64| {
            let [x, v] = [x, v].map(|value| DVector::from_element(1, value));
            let start = InitialState::new(x, v).unwrap();
            let free = exact_zoh(&system, &still, &start).unwrap();
            DVector::from_vec(vec![
                free.displacement().channel(0)[1],
                free.velocity().channel(0)[1],
            ])
        };
        let transition = DMatrix::from_columns(&[column(1.0, 0.0), column(0.0, 1.0)]);
        Self { force, course, transition }
    }

    /// Returns displacement and velocity of the experiment with this seed. Both are periodic, as is
    /// the random disturbance.
    fn measure(&self, seed: u64) -> [Record; 2] {
        let sampling = self.force.sampling();
        let push = noise::white(sampling, 2, 1.0, seed).unwrap();
        let push = |k: usize| {
            let [x, v] = [push.channel(0)[k], push.channel(1)[k]];
            DVector::from_vec(vec![1e-4 * x, 4e-3 * v])
        };
        let from_rest = (0..SAMPLES).fold(DVector::zeros(2), |z, k| &self.transition * z + push(k));
        let closing = DMatrix::identity(2, 2) - self.transition.pow(SAMPLES as u32);
        let mut state = closing.lu().solve(&from_rest).unwrap();
        let mut data = DMatrix::zeros(SAMPLES, 2);
        for k in 0..SAMPLES {
            data.set_row(k, &state.transpose());
            state = &self.transition * state + push(k);
        }
        data.column_mut(0).axpy(1.0, &self.course.displacement().column(0), 1.0);
        data.column_mut(1).axpy(1.0, &self.course.velocity().column(0), 1.0);
        [0, 1].map(|c| Record::new(sampling, data.columns(c, 1).into_owned()).unwrap())
    }
}

/// Returns for each parameter the RMS of the stated standard errors divided by the scatter of the
/// estimates.
fn stated_over_scatter(factor: usize, interpolation: Interpolation) -> Vec<f64> {
    let experiment = Experiment::new();
    let unknowns = Unknowns::unknown_mass(1).unwrap();
    let linear = TimeDomain::new(Discretisation::FirstOrderHold, Extent::WholePeriod);
    let runs = 400;
    let found: Vec<Vec<(f64, f64)>> = (0..runs)
        .into_par_iter()
        .map(|seed| {
            let [x, v] = experiment.measure(seed);
            let records = [&x, &v, &experiment.force];
            let fit = linear.fit_refined(records, &unknowns, factor, interpolation).unwrap();
            fit.estimate().parameters().map(|p| (p.value, p.standard_error)).collect()
        })
        .collect();
    let ratio = |at: usize| {
        let mean = |value: &dyn Fn(&(f64, f64)) -> f64| {
            found.iter().map(|run| value(&run[at])).sum::<f64>() / runs as f64
        };
        let middle = mean(&|(value, _)| *value);
        let scatter = mean(&|(value, _)| (value - middle).powi(2)).sqrt();
        mean(&|(_, error)| error * error).sqrt() / scatter
    };
    (0..3).map(ratio).collect()
}

/// The stated standard errors agree with the scatter of 400 runs, with and without intermediate
/// points; a standard deviation of 400 runs has an uncertainty of 3.5 %. The error of the
/// interpolation adds to the residual, so the standard errors may be somewhat too large. If the
/// intermediate points counted as measurements, the standard errors would be too small by a factor
/// of √8.
#[test]
fn intermediate_points_do_not_make_an_estimate_look_better() {
    let measured = stated_over_scatter(1, Interpolation::NotAKnotSpline);
    for interpolation in [Interpolation::NotAKnotSpline, Interpolation::BandLimited] {
        let refined = stated_over_scatter(8, interpolation);
        for (measured, refined) in measured.iter().zip(&refined) {
            assert!((0.85..1.2).contains(measured), "{measured}");
            assert!((0.9..1.4).contains(refined), "{interpolation:?}: {refined}");
        }
    }
}

/// Standard errors do not become smaller with more intermediate points, because intermediate points
/// have no new information.
#[test]
fn standard_errors_settle_as_points_are_added() {
    let experiment = Experiment::new();
    let unknowns = Unknowns::unknown_mass(1).unwrap();
    let [x, v] = experiment.measure(1);
    let linear = TimeDomain::new(Discretisation::FirstOrderHold, Extent::WholePeriod);
    let fit = |factor, interpolation| {
        let records = [&x, &v, &experiment.force];
        linear.fit_refined(records, &unknowns, factor, interpolation).unwrap().into_estimate()
    };
    let once = linear.fit(&x, &v, &experiment.force, &unknowns).unwrap().into_estimate();
    assert_eq!(fit(1, Interpolation::BandLimited).degrees_of_freedom(), once.degrees_of_freedom());
    // Only measured samples count as rows: two refined records have 2 × `SAMPLES` rows, without the
    // intermediate points.
    let mut rows = Transitions::new(1, 0.02 / 4.0).unwrap();
    for _ in 0..2 {
        let records = [&x, &v, &experiment.force];
        rows.push_refined(records, Extent::WholePeriod, 4, Interpolation::BandLimited).unwrap();
    }
    assert_eq!(rows.rows(), 2 * SAMPLES);
    let [four, sixteen] =
        [4, 16].map(|factor| fit(factor, Interpolation::BandLimited).parameter("k").unwrap());
    assert_eq!(four.degrees_of_freedom, once.degrees_of_freedom());
    // Without the correction, the standard errors would be halved by four times as many points.
    assert!((sixteen.standard_error / four.standard_error - 1.0).abs() < 0.1);
}

/// Interpolations to refine a record. `of_way` returns an experiment for which the interpolation is
/// correct between the samples.
const WAYS: [Interpolation; 3] =
    [Interpolation::Linear, Interpolation::NotAKnotSpline, Interpolation::BandLimited];

fn of_way(way: Interpolation) -> Experiment {
    match way {
        Interpolation::Linear => Experiment::driven(|s, f| exact_foh_periodic(s, f).unwrap()),
        _ => Experiment::new(),
    }
}

/// Returns the results of the checks of whiteness and of cross-correlation after a fit of eight
/// steps per interval, with M known or unknown; `true` if the verdict is good.
fn checked([x, v, force]: [&Record; 3], mass: Option<f64>, way: Interpolation) -> [bool; 2] {
    let mass = mass.map(|mass| DMatrix::from_element(1, 1, mass));
    let unknowns = match mass {
        Some(mass) => Unknowns::known_mass(&mass).unwrap(),
        None => Unknowns::unknown_mass(1).unwrap(),
    };
    let (linear, extent) = (Discretisation::FirstOrderHold, Extent::WholePeriod);
    let records = [x, v, force];
    let fit = TimeDomain::new(linear, extent).fit_refined(records, &unknowns, 8, way).unwrap();
    let [missing, inertia] =
        missing_force(fit.estimate(), records, linear, extent, Some((8, way))).unwrap();
    let force = force.window(0, missing.len()).unwrap();
    let checks = after_fit(&missing, &inertia, &force, 25, 1).unwrap();
    [0, 1].map(|at| checks[at].verdict() == Verdict::Good)
}

/// Returns two shares of `runs` experiments: those in which the check of whiteness reports a fault,
/// and those in which the check of cross-correlation reports a fault.
fn faulted(runs: u64, check: impl Fn(u64) -> [bool; 2] + Sync + Send) -> [f64; 2] {
    let found: Vec<[bool; 2]> = (0..runs).into_par_iter().map(check).collect();
    [0, 1].map(|at| found.iter().filter(|good| !good[at]).count() as f64 / runs as f64)
}

/// The checks report a correct machine in fewer than 5 % of 400 runs. Their level is 1 %, but in a
/// record of 256 samples the statistic of 25 lags exceeds its limit somewhat more often (Ljung and
/// Box, 1978, section 4). 5 % of 400 runs would be eight standard deviations above 1 %. If every
/// intermediate sample counted as measured, the checks would report every run.
#[test]
fn checks_of_refined_fits_seldom_find_fault_with_a_right_machine() {
    for way in WAYS {
        let experiment = of_way(way);
        for mass in [None, Some(10.0)] {
            let rates = faulted(400, |seed| {
                let [x, v] = experiment.measure(seed);
                checked([&x, &v, &experiment.force], mass, way)
            });
            assert!(rates.iter().all(|rate| *rate < 0.05), "{way:?}, {mass:?}: {rates:?}");
        }
    }
}

/// Noise on the motion affects two successive intervals: the residual is reported as not white, but
/// not as correlated with the force.
#[test]
fn noise_on_the_motion_is_told_from_a_wrong_machine() {
    let experiment = Experiment::new();
    let way = Interpolation::BandLimited;
    let noisy = |seed: u64| {
        let noise = noise::white(experiment.force.sampling(), 2, 1.0, seed).unwrap();
        let add = |record: &Record, at: usize, level: f64| {
            let data = record.data() + noise.data().columns(at, 1) * level;
            Record::new(record.sampling(), data).unwrap()
        };
        let course = &experiment.course;
        [add(course.displacement(), 0, 3e-5), add(course.velocity(), 1, 1e-3)]
    };
    let rates = faulted(400, |seed| {
        let [x, v] = noisy(seed);
        checked([&x, &v, &experiment.force], None, way)
    });
    assert!(rates[0] > 0.95 && rates[1] < 0.05, "{rates:?}");
}

/// Returns the third period of the solution of m ẍ + c ẋ + k x + `cubic` x³ = F by the classic
/// Runge–Kutta method, with sixteen steps per sample.
fn hardening(force: &Record, cubic: f64) -> Response {
    let fine = refine(force, 32, Interpolation::BandLimited).unwrap();
    let (f, h) = (fine.channel(0), force.sampling().dt() / 16.0);
    let rate =
        |[x, v]: [f64; 2], f: f64| [v, (f - 180.0 * v - 5000.0 * x - cubic * x.powi(3)) / 10.0];
    let along = |z: [f64; 2], d: [f64; 2], h: f64| [z[0] + h * d[0], z[1] + h * d[1]];
    let (mut z, mut motion) = ([0.0; 2], DMatrix::zeros(SAMPLES, 2));
    for at in 0..3 * 16 * SAMPLES {
        if at.is_multiple_of(16) {
            motion.set_row(at / 16 % SAMPLES, &nalgebra::RowVector2::new(z[0], z[1]));
        }
        let f = |half: usize| f[(2 * at + half) % f.len()];
        let k1 = rate(z, f(0));
        let k2 = rate(along(z, k1, 0.5 * h), f(1));
        let k3 = rate(along(z, k2, 0.5 * h), f(1));
        let k4 = rate(along(z, k3, h), f(2));
        z = [0, 1].map(|c| z[c] + h / 6.0 * (k1[c] + 2.0 * (k2[c] + k3[c]) + k4[c]));
    }
    response_from_columns(force, &motion)
}

/// Creates a response from the two columns of `motion`, displacement and velocity. The acceleration
/// is not needed and is zero.
fn response_from_columns(force: &Record, motion: &DMatrix<f64>) -> Response {
    let record = |data| Record::new(force.sampling(), data).unwrap();
    let [x, v] = [0, 1].map(|c| record(motion.columns(c, 1).into_owned()));
    let none = record(DMatrix::zeros(force.len(), 1));
    Response::new(x, v, none).unwrap()
}

/// Returns the response of the first of two masses. The second mass, a tenth of the first, is not
/// measured; it is attached to the first mass by a spring, with a natural frequency of 20 rad/s.
fn with_a_second_mass(force: &Record) -> Response {
    let of = |a: f64, b: f64, c: f64| DMatrix::from_row_slice(2, 2, &[a, b, b, c]);
    let system =
        SecondOrderSystem::new(of(10.0, 0.0, 1.0), of(180.0, -2.0, 2.0), of(5400.0, -400.0, 400.0));
    let zeros = vec![0.0; force.len()];
    let both = Record::from_channels(force.sampling(), &[force.channel(0), &zeros]).unwrap();
    let motion = exact_harmonic_periodic(&system.unwrap(), &both).unwrap();
    let first = |record: &Record| record.column(0).into_owned();
    let data = DMatrix::from_columns(&[first(motion.displacement()), first(motion.velocity())]);
    response_from_columns(force, &data)
}

/// A wrong mass, a cubic spring and a second mode are each reported in more than 95 % of the
/// experiments. The random disturbance has the same size as in the other tests of this file.
#[test]
fn a_wrong_machine_is_found_out_after_a_refined_fit() {
    let way = Interpolation::BandLimited;
    let right = Experiment::new();
    let rates = faulted(100, |seed| {
        let [x, v] = right.measure(seed);
        checked([&x, &v, &right.force], Some(10.5), way)
    });
    assert!(rates[1] > 0.95, "a mass wrong by 5 %: {rates:?}");

    let largest = right.course.displacement().data().amax();
    // At the largest displacement the spring is stiffer by a fifth.
    let cubic = 0.2 * 5000.0 / largest.powi(2);
    let hard = Experiment::driven(|_, force| hardening(force, cubic));
    let double = Experiment::driven(|_, force| with_a_second_mass(force));
    for (name, experiment) in [("a cubic spring", &hard), ("a second mode", &double)] {
        for mass in [None, Some(10.0)] {
            let rates = faulted(100, |seed| {
                let [x, v] = experiment.measure(seed);
                checked([&x, &v, &experiment.force], mass, way)
            });
            assert!(rates.iter().any(|rate| *rate > 0.95), "{name}, {mass:?}: {rates:?}");
        }
    }
}
