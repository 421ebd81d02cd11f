//! Motions from one measured quantity, compared with closed forms.

use mechid_estimate::derivatives::{
    SavitzkyGolay, spectral_from_acceleration, spectral_from_displacement,
};
use mechid_estimate::time_domain::equation_of_motion;
use mechid_estimate::{Estimate, EstimateError, Unknowns};
use mechid_model::{InitialState, KyxSign, SecondOrderSystem};
use mechid_problems::{dissertation_bearing, exact_harmonic, exact_harmonic_periodic};
use mechid_signal::SignalError;
use mechid_signal::{Multisine, Phases, Record, Sampling};

/// Forces on lines 1 … 20 of a period of 40 s, with different phases in the two directions.
fn force(samples: usize) -> Record {
    let sampling = Sampling::new(40.0 / samples as f64, samples).unwrap();
    let channel = |seed| {
        let multisine = Multisine::flat(1..=20, 5.0, Phases::Random { seed }).unwrap();
        multisine.sample(sampling).unwrap().channel(0).to_vec()
    };
    Record::from_channels(sampling, &[channel(1), channel(2)]).unwrap()
}

fn bearing() -> SecondOrderSystem {
    dissertation_bearing(KyxSign::Minus).system()
}

fn error(found: &Estimate) -> f64 {
    let system = bearing();
    let pairs = [
        (found.mass(), system.mass()),
        (found.damping(), system.damping()),
        (found.stiffness(), system.stiffness()),
    ];
    pairs.iter().map(|(a, b)| (a - *b).amax() / b.amax()).fold(0.0, f64::max)
}

#[test]
fn a_periodic_displacement_or_acceleration_is_enough() {
    let force = force(256);
    let motion = exact_harmonic_periodic(&bearing(), &force).unwrap();
    let unknowns = Unknowns::unknown_mass(2).unwrap();
    let from_x = spectral_from_displacement(motion.displacement()).unwrap();
    assert!(error(&equation_of_motion(&from_x, &force, &unknowns).unwrap()) < 1e-10);
    let from_a = spectral_from_acceleration(motion.acceleration()).unwrap();
    let found = equation_of_motion(&from_a, &force.without_mean(), &unknowns).unwrap();
    assert!(error(&found) < 1e-10);
}

#[test]
fn polynomials_are_differentiated_exactly_up_to_the_ends() {
    let sampling = Sampling::new(0.1, 30).unwrap();
    let value = |t: f64| 2.0 - t + 0.5 * t.powi(2) - 0.3 * t.powi(4);
    let record = Record::from_fn(sampling, value).unwrap();
    let filter = SavitzkyGolay::new(4, 4).unwrap();
    let expected: [fn(f64) -> f64; 3] = [
        |t| 2.0 - t + 0.5 * t.powi(2) - 0.3 * t.powi(4),
        |t| -1.0 + t - 1.2 * t.powi(3),
        |t| 1.0 - 3.6 * t.powi(2),
    ];
    for (times, expected) in expected.iter().enumerate() {
        let got = filter.differentiate(&record, times).unwrap();
        for (t, y) in sampling.times().zip(got.channel(0)) {
            // The error is the rounding of values of about 20, divided by the square of the step.
            assert!((y - expected(t)).abs() < 1e-10, "derivative {times} at {t}");
        }
    }
}

#[test]
fn the_published_coefficients_come_out() {
    // Savitzky & Golay (1964), quadratic, five points: smoothing (−3 12 17 12 −3)/35, first
    // derivative (−2 −1 0 1 2)/10, second (2 −1 −2 −1 2)/7.
    let filter = SavitzkyGolay::new(2, 2).unwrap();
    let sampling = Sampling::new(1.0, 5).unwrap();
    let published = [
        [-3.0, 12.0, 17.0, 12.0, -3.0].map(|c| c / 35.0),
        [-2.0, -1.0, 0.0, 1.0, 2.0].map(|c| c / 10.0),
        [2.0, -1.0, -2.0, -1.0, 2.0].map(|c| c / 7.0),
    ];
    for (times, coefficients) in published.iter().enumerate() {
        for (at, coefficient) in coefficients.iter().enumerate() {
            let mut pulse = vec![0.0; 5];
            pulse[at] = 1.0;
            let record = Record::from_channel(sampling, pulse).unwrap();
            let got = filter.differentiate(&record, times).unwrap().channel(0)[2];
            assert!((got - coefficient).abs() < 1e-14, "derivative {times}, sample {at}");
        }
    }
}

/// The error of the d-th derivative by the centred window of order p is of order Δt^(p+1−d) or
/// better. Half the step must therefore reduce the error of the identified matrices by a factor of
/// at least 2³ for order 4 and d = 2.
#[test]
fn an_open_record_is_identified_as_well_as_its_step_allows() {
    let unknowns = Unknowns::unknown_mass(2).unwrap();
    let filter = SavitzkyGolay::new(4, 4).unwrap();
    let errors = [800, 1600, 3200].map(|samples| {
        let force = force(samples);
        let motion = exact_harmonic(&bearing(), &force, &InitialState::rest(2)).unwrap();
        let from_x = filter.motion(motion.displacement()).unwrap();
        let by_x = error(&equation_of_motion(&from_x, &force, &unknowns).unwrap());
        let (twice, force) = filter.twice_differentiated(motion.acceleration(), &force).unwrap();
        let by_a = error(&equation_of_motion(&twice, &force, &unknowns).unwrap());
        [by_x, by_a]
    });
    for pair in errors.windows(2) {
        for (coarse, fine) in pair[0].iter().zip(&pair[1]) {
            assert!(fine * 7.0 < *coarse, "{errors:?}");
        }
    }
    assert!(errors[2].iter().all(|e| *e < 1e-3), "{errors:?}");
}

#[test]
fn impossible_windows_are_refused() {
    assert_eq!(SavitzkyGolay::new(2, 5), Err(EstimateError::Window { samples: 5, order: 5 }));
    let filter = SavitzkyGolay::new(3, 1).unwrap();
    let short = Record::from_channel(Sampling::new(0.1, 6).unwrap(), vec![0.0; 6]).unwrap();
    assert_eq!(
        filter.differentiate(&short, 1),
        Err(EstimateError::Signal(SignalError::TooShort { samples: 6, needed: 7 }))
    );
    let long = short.repeated(2).unwrap();
    assert!(matches!(filter.motion(&long), Err(EstimateError::Window { .. })));
}
