//! Modes of identified matrices: a published case, derivatives, and the coverage of intervals.

use mechid_checks::Instability;
use mechid_checks::{Finding, Verdict, instability};
use mechid_estimate::frequency_domain::equation_error;
use mechid_estimate::{Estimate, Unknowns, identified_modes};
use mechid_model::{Matrix, Mode, Parameter, ResponseQuantity, SecondOrderSystem, UncertainSystem};
use mechid_problems::steffen_rade;
use mechid_spectra::FrequencyData;
use nalgebra::{Complex, DMatrix, DVector, dmatrix};
use rayon::prelude::*;

use crate::common::monte_carlo::{Estimator, Experiment};
use crate::common::{bearing, displacements, forces, oscillator};

/// Equation-error estimate of all entries from a steady state. Each displacement has an error of
/// `noise` times the norm of all displacements.
fn identified(system: &SecondOrderSystem, noise: f64) -> Estimate {
    let lines: Vec<usize> = (1..=60).collect();
    let fastest = system.modes().unwrap().last().unwrap().natural_frequency();
    let omega: Vec<f64> = lines.iter().map(|n| *n as f64 * fastest / 30.0).collect();
    let force = forces(&lines, system.dof(), 1.0);
    let mut motion = displacements(system, &omega, &force);
    let size = motion.norm();
    for (at, x) in motion.iter_mut().enumerate() {
        *x += Complex::from_polar(noise * size, (at * at) as f64);
    }
    let data = FrequencyData::from_amplitudes(omega, force, motion, ResponseQuantity::Displacement)
        .unwrap();
    equation_error(&data, &Unknowns::unknown_mass(system.dof()).unwrap()).unwrap()
}

/// The computed modes agree with Appendix E of the dissertation. In this appendix the two damping
/// ratios are interchanged, and the column of mode shapes with the heading y1/y2 contains y2/y1.
#[test]
fn the_system_of_steffen_and_rade_has_its_published_modes() {
    let modes = identified(&steffen_rade(), 0.0).modes().unwrap();
    assert_eq!(modes.len(), 2);
    for (mode, (frequency, damping, ratio)) in modes.iter().zip([
        (3.1157, 0.1869, Complex::new(1.1567, 0.3474)),
        (3.9384, 0.4275, Complex::new(-0.6821, 0.2752)),
    ]) {
        // The tolerance is a unit of the last printed digit, because some digits are truncated
        // instead of rounded.
        assert!((mode.damped_frequency_hz.value - frequency).abs() < 1e-4);
        assert!((mode.damping_ratio.value - damping).abs() < 1e-4);
        let shape = mode.mode.shape();
        let found = shape[1] / shape[0];
        // The eigenvalue with positive imaginary part may belong to the conjugate shape.
        let off = (found - ratio).norm().min((found - ratio.conj()).norm());
        assert!(off < 1e-4, "{found}");
        assert!(mode.damping_ratio.standard_error < 1e-9);
    }
}

/// Returns the index of the entry of a mode shape that is 1 because of its scaling.
fn one(shape: &DVector<Complex<f64>>) -> usize {
    shape.iter().position(|z| *z == Complex::from(1.0)).unwrap()
}

/// Returns the modes of slightly changed matrices, with shapes scaled in the same way.
fn modes_of(
    unknowns: &Unknowns,
    theta: &[f64],
    largest: &[usize],
) -> Vec<(Mode, DVector<Complex<f64>>)> {
    let [m, c, k] = unknowns.assemble(theta);
    let modes = SecondOrderSystem::new(m, c, k).unwrap().modes().unwrap();
    let scaled = |(mode, at): (Mode, &usize)| {
        let shape = mode.shape() / mode.shape()[*at];
        (mode, shape)
    };
    modes.into_iter().zip(largest).map(scaled).collect()
}

#[test]
fn standard_errors_follow_from_differences_of_the_modes() {
    for system in [oscillator(), bearing(), steffen_rade()] {
        let estimate = identified(&system, 1e-4);
        let modes = estimate.modes().unwrap();
        let theta: Vec<f64> = estimate.parameters().map(|p| p.value).collect();
        let largest: Vec<usize> = modes.iter().map(|m| one(m.mode.shape())).collect();
        let moved = |at: usize, sign: f64| {
            let mut theta = theta.clone();
            let size = theta.iter().fold(0.0f64, |a, b| a.max(b.abs()));
            let step = 1e-6 * theta[at].abs().max(1e-2 * size);
            theta[at] += sign * step;
            (modes_of(estimate.unknowns(), &theta, &largest), step)
        };
        let count = theta.len();
        let n = system.dof();
        // Central differences give the gradients of each mode: its two frequencies, its damping
        // ratio, and the real and imaginary parts of its shape.
        let mut gradients = vec![DMatrix::zeros(3 + 2 * n, count); modes.len()];
        for at in 0..count {
            let ((up, step), (down, _)) = (moved(at, 1.0), moved(at, -1.0));
            for (gradient, ((p, ps), (q, qs))) in gradients.iter_mut().zip(up.iter().zip(&down)) {
                let slope = |f: &dyn Fn(&Mode) -> f64| (f(p) - f(q)) / (2.0 * step);
                let tau = std::f64::consts::TAU;
                gradient[(0, at)] = slope(&|m| m.damped_frequency_hz());
                gradient[(1, at)] = slope(&|m| m.natural_frequency() / tau);
                gradient[(2, at)] = slope(&|m| m.damping_ratio());
                for i in 0..n {
                    let d = (ps[i] - qs[i]) / (2.0 * step);
                    (gradient[(3 + 2 * i, at)], gradient[(4 + 2 * i, at)]) = (d.re, d.im);
                }
            }
        }
        for (mode, gradient) in modes.iter().zip(&gradients) {
            let expected = (gradient * estimate.covariance() * gradient.transpose()).diagonal();
            let mut found = vec![
                mode.damped_frequency_hz.standard_error,
                mode.natural_frequency_hz.standard_error,
                mode.damping_ratio.standard_error,
            ];
            found.extend(mode.shape_standard_error.iter().flat_map(|z| [z.re, z.im]));
            let scale = expected.max().sqrt();
            for (found, expected) in found.iter().zip(expected.iter()) {
                // The errors of differences with a relative step of 1e-6 are about 1e-7 of the
                // largest gradient.
                assert!((found - expected.sqrt()).abs() < 1e-5 * scale, "{found} {expected}");
            }
        }
    }
}

#[test]
fn modes_that_do_not_oscillate_have_a_frequency_of_zero_without_error() {
    let heavy = SecondOrderSystem::new(dmatrix![1.0], dmatrix![5.0], dmatrix![4.0]).unwrap();
    let modes = identified(&heavy, 1e-4).modes().unwrap();
    assert_eq!(modes.len(), 2);
    for mode in &modes {
        assert_eq!(mode.damped_frequency_hz.value, 0.0);
        assert_eq!(mode.damped_frequency_hz.standard_error, 0.0);
        // The pair of real poles has ζ = c / (2 √(km)).
        assert!((mode.damping_ratio.value - 1.25).abs() < 1e-3, "{mode:?}");
        assert!(mode.natural_frequency_hz.standard_error > 0.0);
    }
    assert_eq!((modes[0].partner, modes[1].partner), (Some(1), Some(0)));
}

/// Returns a machine whose m, c and k have independent errors.
fn uncertain(values: [f64; 3], errors: [f64; 3]) -> UncertainSystem {
    let system =
        SecondOrderSystem::new(dmatrix![values[0]], dmatrix![values[1]], dmatrix![values[2]]);
    let matrices = [Matrix::Mass, Matrix::Damping, Matrix::Stiffness];
    let parameters = matrices.map(|matrix| Parameter::new(matrix, 0, 0, 1).unwrap()).to_vec();
    let covariance = DMatrix::from_diagonal(&DVector::from_row_slice(&errors).map(|e| e * e));
    UncertainSystem::new(system.unwrap(), parameters, covariance).unwrap()
}

/// The reference is ζ = c / (2 √(km)), ω₀ = √(k/m), λ = (−c ± √(c² − 4km)) / 2m and their
/// derivatives by hand, below and above critical damping.
#[test]
fn poles_and_damping_ratio_are_those_of_the_closed_form_above_critical_damping_too() {
    let (m, k) = (2.0f64, 800.0f64);
    let [em, ec, ek] = [0.02, 0.5, 6.0];
    for c in [-3.0, 4.0, 76.0, 84.0, 400.0, 4000.0] {
        let modes = identified_modes(&uncertain([m, c, k], [em, ec, ek]), 1000).unwrap();
        let (ratio, omega) = (c / (2.0 * (k * m).sqrt()), (k / m).sqrt());
        let ratio_error =
            ratio.abs() * (0.25 * ((em / m).powi(2) + (ek / k).powi(2)) + (ec / c).powi(2)).sqrt();
        let omega_error = 0.5 * omega * ((em / m).powi(2) + (ek / k).powi(2)).sqrt();
        let near = |found: mechid_numerics::Uncertain, value: f64, error: f64| {
            assert!((found.value - value).abs() < 1e-9 * value.abs(), "{c}: {found:?} {value}");
            assert!((found.standard_error / error - 1.0).abs() < 1e-7, "{c}: {found:?} {error}");
        };
        for mode in &modes {
            near(mode.damping_ratio, ratio, ratio_error);
            let tau = std::f64::consts::TAU;
            near(mode.natural_frequency_hz, omega / tau, omega_error / tau);
            assert!(!mode.is_rigid_body);
        }
        let root = c * c - 4.0 * k * m;
        if root < 0.0 {
            assert_eq!((modes.len(), modes[0].partner), (1, None));
            near(
                modes[0].growth_rate,
                -c / (2.0 * m),
                (ec.powi(2) + (em * c / m).powi(2)).sqrt() / (2.0 * m),
            );
            continue;
        }
        assert_eq!((modes.len(), modes[0].partner, modes[1].partner), (2, Some(1), Some(0)));
        for (mode, sign) in modes.iter().zip([1.0, -1.0]) {
            // The slow pole, computed without cancellation.
            let pole = match sign > 0.0 {
                true => -2.0 * k / (c + root.sqrt()),
                false => -(c + root.sqrt()) / (2.0 * m),
            };
            // dλ = −(λ² dm + λ dc + dk) / (2mλ + c).
            let slope = 2.0 * m * pole + c;
            let error = ((pole * pole * em).powi(2) + (pole * ec).powi(2) + ek * ek).sqrt();
            near(mode.growth_rate, pole, error / slope.abs());
        }
    }
}

/// Free–free chains of two and three masses, with the mass known and all other entries estimated:
/// the stiffness is singular within its error, so the rigid-body mode is recognised. The elastic
/// modes are not reported as rigid-body modes.
#[test]
fn a_rigid_body_mode_is_called_one_and_its_interval_contains_zero() {
    let chains = [
        (dmatrix![2.0, 0.0; 0.0, 3.0], dmatrix![1.0, -1.0; -1.0, 1.0]),
        (
            DMatrix::from_diagonal(&DVector::from_row_slice(&[2.0, 3.0, 1.0])),
            dmatrix![1.0, -1.0, 0.0; -1.0, 2.0, -1.0; 0.0, -1.0, 1.0],
        ),
    ];
    let (mut called, mut runs) = (0, 0);
    for (mass, chain) in chains {
        let system = SecondOrderSystem::new(mass.clone(), &chain * 2.0, &chain * 5000.0).unwrap();
        let unknowns = Unknowns::known_mass(&mass).unwrap();
        let elastic: Vec<f64> = system.modes().unwrap()[2..]
            .iter()
            .map(|mode| mode.natural_frequency() / std::f64::consts::TAU)
            .collect();
        let experiment = Experiment::new(system, unknowns, 4, 0.02);
        for seed in 0..25 {
            let periods = experiment.measure(40_000 + seed);
            let modes = experiment.estimate(&periods, Estimator::MaximumLikelihood).modes();
            let modes = modes.unwrap();
            runs += 1;
            let rigid: Vec<_> = modes.iter().filter(|mode| mode.is_rigid_body).collect();
            called += usize::from(!rigid.is_empty());
            for mode in rigid {
                let [low, high] = mode.natural_frequency_interval_hz(0.95).unwrap();
                assert!(low == 0.0 && high > 0.0 && high < 0.5 * elastic[0], "{mode:?}");
            }
            let others: Vec<_> = modes
                .iter()
                .filter(|mode| mode.natural_frequency_hz.value > 0.5 * elastic[0])
                .collect();
            assert_eq!(others.len(), elastic.len());
            assert!(others.iter().all(|mode| !mode.is_rigid_body));
        }
    }
    // On average, an interval of 95 % does not contain zero in 2.5 of 50 runs.
    assert!(called + 7 >= runs, "{called} of {runs}");
}

fn warnings(damping: f64, noise: f64, runs: u64) -> (usize, usize) {
    let system = SecondOrderSystem::new(dmatrix![10.0], dmatrix![damping], dmatrix![5000.0]);
    let experiment = Experiment::new(system.unwrap(), Unknowns::unknown_mass(1).unwrap(), 4, noise);
    let found: Vec<Option<Finding>> = (0..runs)
        .into_par_iter()
        .map(|seed| {
            let periods = experiment.measure(70_000 + seed);
            instability(
                &experiment.estimate(&periods, Estimator::MaximumLikelihood).modes().unwrap(),
            )
        })
        .collect();
    let found: Vec<Finding> = found.into_iter().flatten().collect();
    let warned = found.iter().filter(|finding| finding.verdict() > Verdict::Good);
    for finding in found.iter() {
        let Finding::Instability(Instability { growth_rate, standard_error, .. }) = finding else {
            panic!()
        };
        assert!((growth_rate + damping / 20.0).abs() < 5.0 * standard_error, "{finding}");
    }
    (found.len(), warned.count())
}

/// The reference is the growth rate −c / 2m. If the free response neither grows nor decays, 1.5 ±
/// 1.2 of 150 estimates give a false alarm at a level of 1 %.
#[test]
fn growth_is_told_where_noise_does_not_explain_it() {
    let (growing, warned) = warnings(1e-6, 0.05, 150);
    assert!((51..=99).contains(&growing), "{growing}");
    assert!(warned <= 6, "{warned}");
    // A lightly damped oscillator: ζ is 0.1 %.
    let (_, warned) = warnings(0.447, 0.01, 60);
    assert_eq!(warned, 0);
    assert_eq!(warnings(-9.0, 0.01, 20), (20, 20));
}

#[test]
fn intervals_of_frequency_and_damping_hold() {
    let system = bearing();
    let unknowns = Unknowns::known_mass(system.mass()).unwrap();
    let experiment = Experiment::new(system.clone(), unknowns, 2, 0.01);
    let truth = system.modes().unwrap();
    let runs = 1000u64;
    let held: Vec<Vec<bool>> = (0..runs)
        .into_par_iter()
        .map(|seed| {
            let periods = experiment.measure(10_000 + seed);
            let modes =
                experiment.estimate(&periods, Estimator::MaximumLikelihood).modes().unwrap();
            let within = |found: mechid_numerics::Uncertain, truth: f64| {
                let [low, high] = found.interval(0.95).unwrap();
                low <= truth && truth <= high
            };
            modes
                .iter()
                .zip(&truth)
                .flat_map(|(found, truth)| {
                    [
                        within(found.damped_frequency_hz, truth.damped_frequency_hz()),
                        within(found.damping_ratio, truth.damping_ratio()),
                    ]
                })
                .collect()
        })
        .collect();
    for quantity in 0..4 {
        let coverage = held.iter().filter(|h| h[quantity]).count() as f64 / runs as f64;
        // The share has a standard deviation of 0.7 %; the limits are about three standard
        // deviations from 95 %.
        assert!((0.93..=0.97).contains(&coverage), "{quantity}: {coverage}");
    }
}
