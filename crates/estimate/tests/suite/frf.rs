//! Frequency response functions, compared with the closed-form receptance, and the effect of noise
//! on them.

use mechid_estimate::frequency_domain::{equation_error, output_error};
use mechid_estimate::{Unknowns, output_error_of_responses};
use mechid_model::ResponseQuantity;
use mechid_numerics::NumericsError;
use mechid_problems::exact_harmonic_periodic;
use mechid_signal::Window;
use mechid_signal::{NoiseLevel, Record, Sampling, noise};
use mechid_spectra::Lines;
use mechid_spectra::SpectraError;
use mechid_spectra::frf::{Frf, FrfAverage, FrfEstimator, Segments};
use nalgebra::{Complex, DMatrix};

use crate::common::{bearing, displacements, forces, oscillator, relative_error, synthesise};

const ALL: [FrfEstimator; 3] = [FrfEstimator::H1, FrfEstimator::H2, FrfEstimator::Hv];

/// Returns `periods` periods of the steady state of the oscillator or the bearing. If several
/// forces act, each period has its own phases, which makes the forces independent.
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
            let record = synthesise(sampling, &lines, part, ResponseQuantity::Displacement);
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
                ResponseQuantity::Displacement,
                Segments::Periods(128),
                lines.iter().copied(),
                estimator,
            )
            .unwrap();
            for (at, &omega) in frf.omega().iter().enumerate() {
                let expected = system.receptance(omega).unwrap();
                let error = (frf.response(at) - &expected).norm() / expected.norm();
                // Cross-spectra square the condition number of the forces, and the error of Hv is
                // the square root of the rounding error.
                let tolerance = if estimator == FrfEstimator::Hv { 1e-6 } else { 1e-10 };
                assert!(error < tolerance, "{estimator:?} {omega}: {error:e}");
            }
            assert!(frf.coherence().iter().all(|c| (c - 1.0).abs() < 1e-10));
        }
    }
}

/// Noise on the force multiplies H1 by S/(S+N), and noise on the motion multiplies H2 by (S+N)/S.
/// The coherence is the ratio H1/H2, and Hv is the geometric mean of H1 and H2.
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
            ResponseQuantity::Displacement,
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
        // White noise with the standard deviation s on N samples has E|X_n|² = 4 s²/N.
        let force_share = 1.0 / (1.0 + 4.0 * 100f64.powi(2) / 128.0 / 2500.0);
        let motion_share = 1.0 / (1.0 + 4.0 * 0.002f64.powi(2) / 128.0 / amplitude.powi(2));
        let [low, high, mean] = [&h1, &h2, &hv].map(|h| h.response(at)[(0, 0)]);
        // With 2,000 averages and a coherence above 0.4 the scatter is below 3 %.
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
            ResponseQuantity::Displacement,
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

/// The stated variance of H2 agrees with the scatter of 2,000 measurements with noise on the force.
/// This noise affects 1/H2 in the same way as noise on the motion affects H1.
#[test]
fn the_stated_variance_of_h2_is_that_of_repeated_measurements() {
    let system = oscillator();
    let (force, motion, _) = steady(&system, 16);
    let runs = 2000;
    let (mut power, mut stated, mut mean) = (0.0, 0.0, Complex::from(0.0));
    let mut found = Vec::new();
    for seed in 0..runs {
        // On each line of 128 samples, noise with the standard deviation s = 170 N has the power 4
        // s²/128. The force has the power 50² N², so the coherence is 0.74.
        let level = NoiseLevel::StandardDeviation(170.0);
        let noisy = noise::add_white(&force, level, seed).unwrap();
        let segments = Segments::Periods(128);
        let quantity = ResponseQuantity::Displacement;
        let frf =
            Frf::estimate(&noisy, &motion, quantity, segments, [7], FrfEstimator::H2).unwrap();
        found.push(frf.response(0)[(0, 0)]);
        stated += frf.variance(0)[(0, 0)] / runs as f64;
    }
    found.iter().for_each(|h| mean += h / runs as f64);
    found.iter().for_each(|h| power += (h - mean).norm_sqr() / runs as f64);
    // The ratio of the stated variance to the observed variance is 1 to first order in the relative
    // error of H2, which is 0.15. The mean of 2,000 squares scatters by 2.2 %. With the formula of
    // H1 the ratio would be 0.55.
    assert!((0.85..1.15).contains(&(stated / power)), "{}", stated / power);
}

#[test]
fn responses_without_noise_give_the_machine_weighted_by_their_coherence() {
    for system in [oscillator(), bearing()] {
        let (force, motion, lines) = steady(&system, 4);
        let driven: Vec<usize> = (0..system.dof()).collect();
        let (quantity, segments) = (ResponseQuantity::Displacement, Segments::Periods(128));
        for estimator in [FrfEstimator::H1, FrfEstimator::H2] {
            let lines = lines.iter().copied();
            let frf = Frf::estimate(&force, &motion, quantity, segments, lines, estimator).unwrap();
            let unknowns = Unknowns::unknown_mass(system.dof()).unwrap();
            let found = output_error(&frf.data(&driven).unwrap(), &unknowns).unwrap().estimate;
            assert!(relative_error(&found.mass(), system.mass()) < 1e-10);
            assert!(relative_error(&found.damping(), system.damping()) < 1e-10);
            assert!(relative_error(&found.stiffness(), system.stiffness()) < 1e-10);
        }
    }
}

/// For 100 noisy records with a hum on three lines, the fit with weights from the coherence has
/// less than half the error of a fit without the coherence.
#[test]
fn weights_by_coherence_leave_less_error() {
    let system = oscillator();
    let (force, motion, lines) = steady(&system, 16);
    let unknowns = Unknowns::unknown_mass(1).unwrap();
    let [mut weighted, mut alike, mut least_squares] = [0.0; 3];
    for seed in 0..100 {
        let noisy = noise::add_white(&motion, NoiseLevel::FractionOfRms(0.1), seed).unwrap();
        let hum = |k: usize| {
            let turn = std::f64::consts::TAU * (k as f64 / 128.0);
            // The phase of the hum changes from period to period.
            let phase = ((k / 128) as f64 * 2.4 + seed as f64).sin() * 9.0;
            [3.0, 6.0, 9.0].iter().map(|n| 0.02 * (n * turn + phase * n).cos()).sum::<f64>()
        };
        let data = DMatrix::from_fn(noisy.len(), 1, |k, _| noisy.data()[(k, 0)] + hum(k));
        let noisy = Record::new(noisy.sampling(), data).unwrap();
        let (quantity, segments) = (ResponseQuantity::Displacement, Segments::Periods(128));
        let frf = Frf::estimate(
            &force,
            &noisy,
            quantity,
            segments,
            lines.iter().copied(),
            FrfEstimator::H1,
        )
        .unwrap();
        let data = frf.data(&[0]).unwrap();
        let bare = mechid_spectra::FrequencyData::from_amplitudes(
            data.omega().to_vec(),
            data.force().clone(),
            data.displacement().clone(),
            quantity,
        )
        .unwrap();
        let error = |k: f64| (k / 5000.0 - 1.0).powi(2) / 100.0;
        weighted += error(output_error(&data, &unknowns).unwrap().estimate.stiffness()[0]);
        alike += error(output_error(&bare, &unknowns).unwrap().estimate.stiffness()[0]);
        least_squares += error(equation_error(&bare, &unknowns).unwrap().stiffness()[0]);
    }
    let [weighted, alike, least_squares] = [weighted, alike, least_squares].map(f64::sqrt);
    assert!(weighted < 0.5 * alike, "{weighted} {alike}");
    assert!(weighted < 0.5 * least_squares, "{weighted} {least_squares}");
}

/// The caller chooses window and overlap. The reference for the number of averages is Welch's
/// formula with explicit values of the autocorrelation of the window.
#[test]
fn windows_and_overlap_are_the_callers() {
    let sampling = Sampling::new(0.02, 4096).unwrap();
    let force = noise::white(sampling, 1, 100.0, 5).unwrap();
    let motion = exact_harmonic_periodic(&oscillator(), &force).unwrap();
    let frf = |hop, window| {
        let segments = Segments::Windowed { len: 256, hop, window };
        let quantity = ResponseQuantity::Displacement;
        let estimator = FrfEstimator::H1;
        Frf::estimate(&force, motion.displacement(), quantity, segments, 5..60, estimator)
    };
    // Without overlap, all segments are independent. The normalised autocorrelation of Hann's
    // window is 0.65915 at a shift of a quarter of its length, 1/6 at half and 0.00751 at three
    // quarters.
    assert_eq!(frf(256, Window::Rectangular).unwrap().averages(), 16.0);
    let count = 61.0;
    let lost: f64 = [(1.0, 0.659_155), (2.0, 1.0 / 6.0), (3.0, 0.007_512)]
        .map(|(apart, share): (f64, f64)| (1.0 - apart / count) * share * share)
        .iter()
        .sum();
    let averages = frf(64, Window::Hann).unwrap().averages();
    assert!((averages - count / (1.0 + 2.0 * lost)).abs() < 1e-3, "{averages}");
    // Far above the resonance, a window with less leakage gives a frequency response closer to the
    // receptance.
    let worst = |window| {
        let frf = frf(64, window).unwrap();
        let error = |at: usize| {
            let exact = oscillator().receptance(frf.omega()[at]).unwrap()[(0, 0)];
            (frf.response(at)[(0, 0)] / exact - 1.0).norm()
        };
        (30..55).map(error).fold(0.0, f64::max)
    };
    let [hann, none] = [Window::Hann, Window::Rectangular].map(worst);
    assert!(hann < 0.1 && none > 2.0 * hann, "{hann} {none}");
    assert!(worst(Window::Hamming) < none && worst(Window::Blackman) < none);
    for hop in [0, 257] {
        assert_eq!(frf(hop, Window::Hann), Err(SpectraError::Hop { len: 256, hop }));
    }
}

/// The parameters agree with the truth within 2 % under a random force. This force has no period,
/// so leakage causes an error of some per cent of the frequency response near the resonance.
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
        ResponseQuantity::Displacement,
        Segments::hann(1024),
        20..200,
        FrfEstimator::H1,
    )
    .unwrap();
    // Under Hann's window, 127 segments with an overlap of one half are equivalent to 120
    // independent segments (Welch, 1967).
    assert!((frf.averages() - 120.3).abs() < 0.5, "{}", frf.averages());
    let found = output_error(&frf.data(&[0]).unwrap(), &Unknowns::unknown_mass(1).unwrap());
    let found = found.unwrap().estimate;
    for (name, exact) in [("m", 10.0), ("c", 180.0), ("k", 5000.0)] {
        let value = found.parameter(name).unwrap().value;
        assert!((value / exact - 1.0).abs() < 0.02, "{name} = {value}");
    }
}

/// The data are responses and coherences, as an analyser exports them. Lines with a low coherence
/// have a small weight in the fit.
#[test]
fn coherence_weighs_the_lines() {
    let system = bearing();
    let omega: Vec<f64> = (1..=60).map(|n| 0.05 * n as f64).collect();
    let exact: Vec<_> = omega.iter().map(|w| system.receptance(*w).unwrap()).collect();
    let averages = 50.0;
    // Every third line has a coherence of 0.05, the others have 0.98.
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
        Frf::new(omega, measured.collect(), coherence, averages, ResponseQuantity::Displacement)
            .unwrap();
    let unknowns = Unknowns::unknown_mass(2).unwrap();
    let weighted = output_error(&frf.data(&[0, 1]).unwrap(), &unknowns).unwrap().estimate;
    assert!(relative_error(&weighted.stiffness(), system.stiffness()) < 0.05);
    for (p, exact) in weighted.parameters().zip(crate::common::all_entries(&system).iter()) {
        assert!((p.value - exact).abs() < 4.0 * p.standard_error, "{p}, exactly {exact}");
    }
}

#[test]
fn what_cannot_be_estimated_is_refused() {
    let system = bearing();
    let (force, motion, lines) = steady(&system, 4);
    let estimate = |force: &Record, motion: &Record, line: usize, estimator| {
        let segments = Segments::Periods(128);
        Frf::estimate(force, motion, ResponseQuantity::Displacement, segments, [line], estimator)
    };
    let line = lines[3];
    let short = |r: &Record| r.window(0, 256).unwrap();
    assert_eq!(
        estimate(&short(&force), &short(&motion), line, FrfEstimator::H1),
        Err(SpectraError::TooFewAverages { got: 2, needed: 3 })
    );
    let same =
        Record::from_channels(force.sampling(), &[force.channel(0), force.channel(0)]).unwrap();
    assert!(matches!(
        estimate(&same, &motion, line, FrfEstimator::H1),
        Err(SpectraError::DependentForces { .. })
    ));
    let zero = Record::from_channel(force.sampling(), vec![0.0; force.len()]).unwrap();
    assert!(matches!(
        estimate(&zero, &motion, line, FrfEstimator::H1),
        Err(SpectraError::DependentForces { reciprocal_condition: 0.0, .. })
    ));
    let one = Record::from_channel(motion.sampling(), motion.channel(0).to_vec()).unwrap();
    assert!(matches!(
        estimate(&force, &one, line, FrfEstimator::H2),
        Err(SpectraError::Numerics(NumericsError::Size { expected: 2, got: 1, .. }))
    ));
    assert!(matches!(
        estimate(&force, &motion, 64, FrfEstimator::H1),
        Err(SpectraError::LineOutOfRange { line: 64, last: 63 })
    ));
    let frf = estimate(&force, &motion, line, FrfEstimator::H1).unwrap();
    assert!(matches!(
        frf.data(&[0]),
        Err(SpectraError::Numerics(NumericsError::Size { expected: 2, got: 1, .. }))
    ));
    assert!(matches!(
        frf.data(&[0, 2]),
        Err(SpectraError::Numerics(NumericsError::Size { expected: 1, got: 2, .. }))
    ));
    let coherence = |value| {
        let response = vec![DMatrix::from_element(1, 1, Complex::from(1.0))];
        let coherence = DMatrix::from_element(1, 1, value);
        Frf::new(vec![1.0], response, coherence, 10.0, ResponseQuantity::Displacement)
    };
    assert!(coherence(1.0).is_ok());
    for value in [0.0, 1.1] {
        assert_eq!(coherence(value), Err(SpectraError::Coherence { value }));
    }
}

#[test]
fn segments_may_come_a_few_at_a_time() {
    let (force, motion, _) = steady(&bearing(), 9);
    for (segments, hop) in [
        (Segments::Periods(128), 128),
        (Segments::hann(128), 64),
        (Segments::Windowed { len: 128, hop: 50, window: Window::Blackman }, 50),
    ] {
        let all = 1..=20;
        let estimate = |f, x| {
            let h1 = FrfEstimator::H1;
            Frf::estimate(f, x, ResponseQuantity::Displacement, segments, all.clone(), h1).unwrap()
        };
        let whole = estimate(&force, &motion);
        let lines = Lines::new(force.sampling().with_len(128).unwrap(), all.clone()).unwrap();
        let mut average =
            FrfAverage::new(lines, [2, 2], ResponseQuantity::Displacement, segments).unwrap();
        // The record is pushed three segments at a time; the last piece ends with the record.
        for start in (0..force.len()).step_by(3 * hop) {
            let len = (2 * hop + 128).min(force.len() - start);
            let [f, x] = [&force, &motion].map(|record| record.window(start, len).unwrap());
            average.push(&f, &x).unwrap();
        }
        assert_eq!(average.frf(FrfEstimator::H1).unwrap(), whole);
        assert_ne!(
            estimate(&force.window(0, 900).unwrap(), &motion.window(0, 900).unwrap()),
            whole
        );
    }
    let lines = Lines::new(force.sampling(), [3]).unwrap();
    let average =
        FrfAverage::new(lines, [2, 2], ResponseQuantity::Displacement, Segments::hann(128));
    assert!(matches!(
        average,
        Err(SpectraError::Numerics(NumericsError::Size { expected: 128, got: 1152, .. }))
    ));
}

#[test]
fn some_responses_are_those_estimated_on_their_lines_alone() {
    let (force, motion, lines) = steady(&bearing(), 5);
    let motion = noise::add_white(&motion, NoiseLevel::FractionOfRms(0.1), 4).unwrap();
    let on = |lines: Vec<usize>| {
        let segments = Segments::Periods(128);
        Frf::estimate(
            &force,
            &motion,
            ResponseQuantity::Displacement,
            segments,
            lines,
            FrfEstimator::H1,
        )
        .unwrap()
    };
    let places = [2, 3, lines.len() - 1];
    let some = on(lines.clone()).at(&places);
    assert_eq!(some, on(places.map(|at| lines[at]).to_vec()));
    assert_eq!(some.data(&[0, 1]).unwrap().len(), 2 * places.len());
}

/// A channel with noise only is reported as unexcited; a weak force and a force with crosstalk from
/// the first force are not. The reference is the generator of the channels, in which independent
/// forces act on both degrees of freedom.
#[test]
fn a_channel_of_noise_is_idle_and_a_weak_force_is_not() {
    let system = bearing();
    for (seed, periods) in [(1, 4), (2, 8), (3, 16)] {
        let (force, motion, lines) = steady(&system, periods);
        let (of_first, of_second) = {
            let alone = |dof: usize, part: f64| {
                let mut force = force.data().clone();
                force.column_mut(1 - dof).fill(0.0);
                force.column_mut(dof).scale_mut(part);
                Record::new(motion.sampling(), force).unwrap()
            };
            // Each period is a separate steady state, which is computed line by line.
            let response = |force: &Record| {
                let mut x = DMatrix::zeros(force.len(), 2);
                for p in 0..periods {
                    let part = force.window(128 * p, 128).unwrap();
                    let one = exact_harmonic_periodic(&system, &part).unwrap();
                    x.rows_mut(128 * p, 128).copy_from(one.displacement().data());
                }
                x
            };
            (response(&alone(0, 1.0)), response(&alone(1, 1.0)))
        };
        let noisy = |x: DMatrix<f64>, seed| {
            let x = Record::new(force.sampling(), x).unwrap();
            noise::add_white(&x, NoiseLevel::FractionOfRms(0.01), seed).unwrap()
        };
        let with_second = |second: DMatrix<f64>| {
            let mut data = force.data().clone();
            data.set_column(1, &second.column(0));
            Record::new(force.sampling(), data).unwrap()
        };
        let idle = |force: &Record, motion: &Record| {
            let period = force.sampling().with_len(128).unwrap();
            let lines = Lines::new(period, lines.iter().copied()).unwrap();
            let quantity = ResponseQuantity::Displacement;
            let mut average =
                FrfAverage::new(lines, [2, 2], quantity, Segments::Periods(128)).unwrap();
            average.push(force, motion).unwrap();
            average.idle_inputs()
        };
        let zero = Record::new(force.sampling(), DMatrix::zeros(force.len(), 1)).unwrap();
        let level = 0.003 * force.column(0).norm() / (force.len() as f64).sqrt();
        let cell =
            |seed| noise::add_white(&zero, NoiseLevel::StandardDeviation(level), seed).unwrap();
        let noise_alone = with_second(cell(10 * seed).into_data());
        assert_eq!(idle(&noise_alone, &noisy(of_first.clone(), seed)), [1], "{periods} periods");
        let weak = with_second(force.data().columns(1, 1) * 0.03);
        let motion = noisy(&of_first + &of_second * 0.03, seed);
        assert!(idle(&weak, &motion).is_empty(), "{periods} periods");
        let crosstalk = cell(20 * seed).into_data() + force.data().columns(0, 1) * 0.02;
        let motion = noisy(of_first, seed);
        assert!(idle(&with_second(crosstalk), &motion).is_empty(), "{periods} periods");
    }
}

/// Averaged frequency responses that are read from a table, with or without standard errors, give
/// the same fit as the averages of the record.
#[test]
fn averages_measured_elsewhere_are_fitted_as_their_record() {
    let sampling = Sampling::new(0.02, 4096).unwrap();
    let force = noise::white(sampling, 1, 100.0, 5).unwrap();
    let exact = exact_harmonic_periodic(&oscillator(), &force).unwrap();
    let motion =
        noise::add_white(exact.displacement(), NoiseLevel::FractionOfRms(0.01), 6).unwrap();
    let segments = Segments::hann(256);
    let quantity = ResponseQuantity::Displacement;
    let frf = Frf::estimate(&force, &motion, quantity, segments, 3..=60, FrfEstimator::H1).unwrap();
    let unknowns = Unknowns::unknown_mass(1).unwrap();
    let own = output_error_of_responses(&[(frf.clone(), vec![0])], &unknowns).unwrap();
    assert!(own.blunted > 1.0, "{}", own.blunted);
    let lines = Lines::new(force.sampling().with_len(256).unwrap(), 3..=60).unwrap();
    let response = (0..58).map(|at| frf.response(at).clone()).collect::<Vec<_>>();
    let errors: Vec<_> = (0..58).map(|at| frf.variance(at).map(|v| (0.5 * v).sqrt())).collect();
    let count = (force.len() - 256) / 128 + 1;
    for errors in [Some(&errors[..]), None] {
        let read = Frf::from_segments(
            &lines,
            response.clone(),
            frf.coherence().clone(),
            errors,
            (segments, count),
            quantity,
        );
        let read = read.unwrap();
        assert!((read.averages() / frf.averages() - 1.0).abs() < 1e-12);
        let fit = output_error_of_responses(&[(read, vec![0])], &unknowns).unwrap();
        for (p, own) in fit.fit.estimate.parameters().zip(own.fit.estimate.parameters()) {
            assert!((p.value / own.value - 1.0).abs() < 1e-9, "{p} {own}");
            assert!((p.standard_error / own.standard_error - 1.0).abs() < 1e-9, "{p} {own}");
        }
    }
}
