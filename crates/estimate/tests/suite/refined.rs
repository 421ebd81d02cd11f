//! Standard errors of fits to records with intermediate points, against the scatter of experiments.

use mechid_estimate::Unknowns;
use mechid_estimate::time_domain::{Discretisation, Extent, TimeDomain, Transitions};
use mechid_model::{InitialState, Response};
use mechid_problems::{dissertation_sdof, exact_harmonic_periodic, exact_zoh};
use mechid_signal::{Interpolation, Multisine, Phases, Record, Sampling, noise};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

const SAMPLES: usize = 256;

/// An oscillator in its steady state, pushed off course at random at every sample.
struct Experiment {
    force: Record,
    course: Response,
    /// Φ of the free motion from sample to sample.
    transition: DMatrix<f64>,
}

impl Experiment {
    fn new() -> Self {
        let system = dissertation_sdof().system();
        let sampling = Sampling::new(0.02, SAMPLES).unwrap();
        // Thirteen samples a cycle at the highest line: the interpolations are right.
        let force = Multisine::flat(1..=20, 20.0, Phases::Schroeder).unwrap();
        let force = force.sample(sampling).unwrap();
        let course = exact_harmonic_periodic(&system, &force).unwrap();
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

    /// Displacement and velocity of experiment number `seed`, periodic like the push.
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

/// Root mean square of the standard errors stated, over the scatter of the values, per parameter.
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

/// A scatter of 400 runs is known to 3.5 %; what the interpolation misses adds to the residual, so
/// that the errors stated may be somewhat too large. Counted as measurements, the intermediate
/// points would make them too small by √8.
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

/// The points in between say nothing new, however many they are.
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
    // Two records count twice, and no more.
    let mut rows = Transitions::new(1, 0.02 / 4.0).unwrap();
    for _ in 0..2 {
        let records = [&x, &v, &experiment.force];
        rows.push_refined(records, Extent::WholePeriod, 4, Interpolation::BandLimited).unwrap();
    }
    assert_eq!(rows.rows(), 2 * SAMPLES);
    let [four, sixteen] =
        [4, 16].map(|factor| fit(factor, Interpolation::BandLimited).parameter("k").unwrap());
    assert_eq!(four.degrees_of_freedom, once.degrees_of_freedom());
    // Uncorrected they would halve.
    assert!((sixteen.standard_error / four.standard_error - 1.0).abs() < 0.1);
}
