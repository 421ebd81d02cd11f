//! Frequency response functions: against the closed-form receptance, and what noise does to them.

mod common;

use common::{bearing, displacements, forces, oscillator, relative_error, synthesise};
use mechid_estimate::frequency_domain::{Motion, output_error};
use mechid_estimate::{EstimateError, Frf, FrfEstimator, Segments, Unknowns};
use mechid_problems::exact_harmonic_periodic;
use mechid_signal::{NoiseLevel, Record, Sampling, noise};
use nalgebra::{Complex, DMatrix};

const ALL: [FrfEstimator; 3] = [FrfEstimator::H1, FrfEstimator::H2, FrfEstimator::Hv];

/// `periods` periods of the oscillator's or the bearing's steady state, each period with its own
/// phases when there are several forces, so that these act independently.
fn steady(
    system: &mechid_model::SecondOrderSystem,
    periods: usize,
) -> (Record, Record, Vec<usize>) {
    let lines: Vec<usize> = (1..=30).collect();
    let fastest = system.modes().unwrap().last().unwrap().natural_frequency();
    let sampling = Sampling::new(0.3 / fastest, 128).unwrap();
    let omega: Vec<f64> = lines.iter().map(|n| *n as f64 * sampling.omega0()).collect();
    let n = system.dof();
    let whole = sampling.with_len(128 * periods).unwrap();
    let (mut f, mut x) = (DMatrix::zeros(whole.len(), n), DMatrix::zeros(whole.len(), n));
    for p in 0..periods {
        let mut force = forces(&lines, n, 50.0);
        if n > 1 {
            for (at, z) in force.iter_mut().enumerate() {
                *z *= Complex::from_polar(1.0, ((p + 2) * (at + 3) * (at + p)) as f64);
            }
        }
        let motion = displacements(system, &omega, &force);
        for (whole, part) in [(&mut f, &force), (&mut x, &motion)] {
            let record = synthesise(sampling, &lines, part, Motion::Displacement);
            whole.rows_mut(128 * p, 128).copy_from(record.data());
        }
    }
    (Record::new(whole, f).unwrap(), Record::new(whole, x).unwrap(), lines)
}

#[test]
fn exact_steady_states_have_the_closed_form_receptance() {
    for system in [oscillator(), bearing()] {
        let (force, motion, lines) = steady(&system, 4);
        for estimator in ALL {
            let frf = Frf::estimate(
                &force,
                &motion,
                Motion::Displacement,
                Segments::Periods(128),
                lines.iter().copied(),
                estimator,
            )
            .unwrap();
            for (at, &omega) in frf.omega().iter().enumerate() {
                let expected = system.receptance(omega).unwrap();
                let error = (frf.response(at) - &expected).norm() / expected.norm();
                // Cross-spectra square the condition of the forces, and Hv takes the root of rounding.
                let tolerance = if estimator == FrfEstimator::Hv { 1e-6 } else { 1e-10 };
                assert!(error < tolerance, "{estimator:?} {omega}: {error:e}");
            }
            assert!(frf.coherence().iter().all(|c| (c - 1.0).abs() < 1e-10));
        }
    }
}

/// Force noise makes H1 too small by S/(S+N), motion noise H2 too large by (S+N)/S; the
/// coherence is their ratio and Hv their mean.
#[test]
fn the_estimators_err_to_their_sides() {
    let system = oscillator();
    let (force, motion, lines) = steady(&system, 2000);
    let add = |r: &Record, level, seed| {
        noise::add_white(r, NoiseLevel::StandardDeviation(level), seed).unwrap()
    };
    let (noisy_force, noisy_motion) = (add(&force, 100.0, 1), add(&motion, 0.002, 2));
    let frf = |estimator| {
        Frf::estimate(
            &noisy_force,
            &noisy_motion,
            Motion::Displacement,
            Segments::Periods(128),
            lines.iter().copied(),
            estimator,
        )
        .unwrap()
    };
    let [h1, h2, hv] = ALL.map(frf);
    for at in 0..lines.len() {
        let exact = system.receptance(h1.omega()[at]).unwrap()[(0, 0)];
        let amplitude = 50.0 * exact.norm();
        // E|X_n|² of white noise on the samples is 4 s²/N.
        let force_share = 1.0 / (1.0 + 4.0 * 100f64.powi(2) / 128.0 / 2500.0);
        let motion_share = 1.0 / (1.0 + 4.0 * 0.002f64.powi(2) / 128.0 / amplitude.powi(2));
        let [low, high, mean] = [&h1, &h2, &hv].map(|h| h.response(at)[(0, 0)]);
        // 2,000 averages: a scatter below 3 % at coherences above 0.4.
        assert!((low / exact - force_share).norm() < 0.1, "{at} {low} {exact}");
        assert!((high / exact * motion_share - 1.0).norm() < 0.1 / motion_share, "{at}");
        assert!((h1.coherence()[(at, 0)] - force_share * motion_share).abs() < 0.1);
        assert!((low / high - h1.coherence()[(at, 0)]).norm() < 1e-10);
        assert!((mean.norm() - (low.norm() * high.norm()).sqrt()).abs() < 1e-6 * mean.norm());
        assert!((mean / low).im.abs() < 1e-6 * (mean / low).norm());
    }
}

#[test]
fn the_stated_variance_is_that_of_repeated_measurements() {
    let system = oscillator();
    let (force, motion, _) = steady(&system, 16);
    let exact = |omega| system.receptance(omega).unwrap()[(0, 0)];
    let runs = 2000;
    let (mut power, mut stated) = (0.0, 0.0);
    for seed in 0..runs {
        let noisy = noise::add_white(&motion, NoiseLevel::FractionOfRms(0.2), seed).unwrap();
        let frf = Frf::estimate(
            &force,
            &noisy,
            Motion::Displacement,
            Segments::Periods(128),
            [7],
            FrfEstimator::H1,
        )
        .unwrap();
        power += (frf.response(0)[(0, 0)] - exact(frf.omega()[0])).norm_sqr() / runs as f64;
        stated += frf.variance(0)[(0, 0)] / runs as f64;
    }
    // A mean of 2,000 exponentially distributed squares scatters by 2.2 %.
    assert!((stated / power - 1.0).abs() < 0.1, "{}", stated / power);
}

/// A random force has no period: the window's leakage leaves some per cent near resonance.
#[test]
fn random_excitation_is_averaged_under_a_window() {
    let system = oscillator();
    let sampling = Sampling::new(0.02, 1 << 16).unwrap();
    let force = noise::white(sampling, 1, 100.0, 5).unwrap();
    let response = exact_harmonic_periodic(&system, &force).unwrap();
    let motion =
        noise::add_white(response.displacement(), NoiseLevel::FractionOfRms(0.05), 6).unwrap();
    let frf = Frf::estimate(
        &force,
        &motion,
        Motion::Displacement,
        Segments::Hann(1024),
        20..200,
        FrfEstimator::H1,
    )
    .unwrap();
    // 127 half-overlapping segments under Hann's window are worth 120 (Welch, 1967).
    assert!((frf.averages() - 120.3).abs() < 0.5, "{}", frf.averages());
    let found = output_error(&frf.data(&[0]).unwrap(), &Unknowns::unknown_mass(1).unwrap());
    let found = found.unwrap().estimate;
    for (name, exact) in [("m", 10.0), ("c", 180.0), ("k", 5000.0)] {
        let value = found.parameter(name).unwrap().value;
        assert!((value / exact - 1.0).abs() < 0.02, "{name} = {value}");
    }
}

/// From responses and coherences as an analyser gives them.
#[test]
fn coherence_weighs_the_lines() {
    let system = bearing();
    let omega: Vec<f64> = (1..=60).map(|n| 0.05 * n as f64).collect();
    let exact: Vec<_> = omega.iter().map(|w| system.receptance(*w).unwrap()).collect();
    let averages = 50.0;
    // Bad lines: every third has a coherence of 0.05, the others of 0.98.
    let gamma = |at: usize| if at.is_multiple_of(3) { 0.05 } else { 0.98 };
    let measured = exact.iter().enumerate().map(|(at, h)| {
        let size = ((1.0 / gamma(at) - 1.0) / (averages - 2.0f64)).sqrt();
        h.map_with_location(|i, j, z| {
            let turn = (7 * at + 3 * i + 5 * j) as f64;
            z + Complex::from_polar(size * h.row(i).norm() * turn.sin(), turn * turn)
        })
    });
    let coherence = DMatrix::from_fn(60, 2, |at, _| gamma(at));
    let frf =
        Frf::new(omega, measured.collect(), coherence, averages, Motion::Displacement).unwrap();
    let unknowns = Unknowns::unknown_mass(2).unwrap();
    let weighted = output_error(&frf.data(&[0, 1]).unwrap(), &unknowns).unwrap().estimate;
    assert!(relative_error(&weighted.stiffness(), system.stiffness()) < 0.05);
    for (p, exact) in weighted.parameters().zip(common::all_entries(&system).iter()) {
        assert!((p.value - exact).abs() < 4.0 * p.standard_error, "{p}, exactly {exact}");
    }
}

#[test]
fn what_cannot_be_estimated_is_refused() {
    let system = bearing();
    let (force, motion, lines) = steady(&system, 4);
    let estimate = |force: &Record, motion: &Record, line: usize, estimator| {
        let segments = Segments::Periods(128);
        Frf::estimate(force, motion, Motion::Displacement, segments, [line], estimator)
    };
    let line = lines[3];
    let short = |r: &Record| r.window(0, 256).unwrap();
    assert_eq!(
        estimate(&short(&force), &short(&motion), line, FrfEstimator::H1),
        Err(EstimateError::TooFewAverages { got: 2, needed: 3 })
    );
    let same =
        Record::from_channels(force.sampling(), &[force.channel(0), force.channel(0)]).unwrap();
    assert!(matches!(
        estimate(&same, &motion, line, FrfEstimator::H1),
        Err(EstimateError::DependentForces { .. })
    ));
    let zero = Record::from_channel(force.sampling(), vec![0.0; force.len()]).unwrap();
    assert!(matches!(
        estimate(&zero, &motion, line, FrfEstimator::H1),
        Err(EstimateError::DependentForces { reciprocal_condition: 0.0, .. })
    ));
    let one = Record::from_channel(motion.sampling(), motion.channel(0).to_vec()).unwrap();
    assert!(matches!(
        estimate(&force, &one, line, FrfEstimator::H2),
        Err(EstimateError::Size { expected: 2, got: 1, .. })
    ));
    assert!(matches!(
        estimate(&force, &motion, 64, FrfEstimator::H1),
        Err(EstimateError::LineOutOfRange { line: 64, last: 63 })
    ));
    let frf = estimate(&force, &motion, line, FrfEstimator::H1).unwrap();
    assert!(matches!(frf.data(&[0]), Err(EstimateError::Size { expected: 2, got: 1, .. })));
    assert!(matches!(frf.data(&[0, 2]), Err(EstimateError::Size { expected: 1, got: 2, .. })));
    let coherence = |value| {
        let response = vec![DMatrix::from_element(1, 1, Complex::from(1.0))];
        let coherence = DMatrix::from_element(1, 1, value);
        Frf::new(vec![1.0], response, coherence, 10.0, Motion::Displacement)
    };
    assert!(coherence(1.0).is_ok());
    for value in [0.0, 1.1] {
        assert_eq!(coherence(value), Err(EstimateError::Coherence { value }));
    }
}
