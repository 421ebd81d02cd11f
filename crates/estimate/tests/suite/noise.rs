//! Noise spectra from repeated periods, and their effect on maximum likelihood.

use mechid_estimate::frequency_domain::{
    OutputErrorFit, equation_error, instrumental_variables, output_error,
};
use mechid_estimate::{EstimateError, Unknowns};
use mechid_model::{Matrix, ResponseQuantity, SecondOrderSystem};
use mechid_numerics::NumericsError;
use mechid_signal::{NoiseLevel, Record, Sampling, noise};
use mechid_spectra::SpectraError;
use mechid_spectra::{FrequencyData, Lines, NoiseSpectrum, Pooling, RepeatedPeriods};
use nalgebra::{Complex, DMatrix};
use rayon::prelude::*;

use crate::common::{bearing, displacements, forces, oscillator, relative_error, synthesise};

/// Records of several periods of a steady state, with the response in the quantity `measured`.
struct Setup {
    lines: Lines,
    force: Record,
    motion: Record,
    measured: ResponseQuantity,
}

fn setup(system: &SecondOrderSystem, periods: usize, measured: ResponseQuantity) -> Setup {
    let fastest = system.modes().unwrap().last().unwrap().natural_frequency();
    let sampling = Sampling::new(0.3 / fastest, 128).unwrap();
    let lines = Lines::new(sampling, 1..=40).unwrap();
    let force = forces(lines.as_slice(), system.dof(), 50.0);
    let motion = displacements(system, &lines.omega(), &force);
    let repeat = |amplitudes: &DMatrix<Complex<f64>>, quantity| {
        let one = synthesise(sampling, lines.as_slice(), amplitudes, quantity);
        let len = sampling.len();
        let all = DMatrix::from_fn(len * periods, system.dof(), |k, c| one.data()[(k % len, c)]);
        Record::new(sampling.with_len(len * periods).unwrap(), all).unwrap()
    };
    let (force, motion) =
        (repeat(&force, ResponseQuantity::Displacement), repeat(&motion, measured));
    Setup { lines, force, motion, measured }
}

impl Setup {
    fn measure(&self, motion: f64, force: f64, seed: u64) -> RepeatedPeriods {
        let noisy = |record: &Record, level: f64, seed| {
            noise::add_white(record, NoiseLevel::FractionOfRms(level), seed).unwrap()
        };
        let motion = noisy(&self.motion, motion, 2 * seed);
        let force = noisy(&self.force, force, 2 * seed + 1);
        RepeatedPeriods::new(&self.lines, &force, &motion, self.measured).unwrap()
    }

    fn rms(record: &Record, channel: usize) -> f64 {
        record.column(channel).norm() / (record.len() as f64).sqrt()
    }
}

#[test]
fn the_scatter_of_the_periods_is_the_noise_that_was_added() {
    let setup = setup(&bearing(), 400, ResponseQuantity::Acceleration);
    let periods = setup.measure(0.05, 0.02, 7);
    assert_eq!(periods.count(), 400);
    let motion: Vec<f64> = (0..2).map(|c| 0.05 * Setup::rms(&setup.motion, c)).collect();
    let force: Vec<f64> = (0..2).map(|c| 0.02 * Setup::rms(&setup.force, c)).collect();
    let known = NoiseSpectrum::white(
        setup.lines.sampling(),
        setup.lines.as_slice(),
        ResponseQuantity::Acceleration,
        &motion,
        &force,
    )
    .unwrap();
    for (pooling, averages) in [
        (Pooling::PerLine, 399.0),
        (Pooling::Neighbours(4), 9.0 * 399.0),
        (Pooling::AllLines, 40.0 * 399.0),
    ] {
        let found = periods.noise(pooling).unwrap();
        assert_eq!(found.degrees_of_freedom(), averages);
        for row in 0..40 {
            // The known noise is that of one period; the estimated noise is that of the mean of 400
            // periods.
            let expected = known.covariance(row) / Complex::from(400.0);
            for i in 0..4 {
                let variance = expected[(i, i)].re;
                let error = found.covariance(row)[(i, i)].re / variance - 1.0;
                // Sample variances of `averages` complex numbers scatter by 1/√averages.
                assert!(error.abs() < 5.0 / f64::sqrt(averages), "{pooling:?} {row} {i} {error}");
            }
        }
    }
}

#[test]
fn without_noise_every_estimator_is_exact() {
    for system in [oscillator(), bearing()] {
        for measured in [
            ResponseQuantity::Displacement,
            ResponseQuantity::Velocity,
            ResponseQuantity::Acceleration,
        ] {
            let setup = setup(&system, 2, measured);
            let periods =
                RepeatedPeriods::new(&setup.lines, &setup.force, &setup.motion, measured).unwrap();
            let unknowns = Unknowns::unknown_mass(system.dof()).unwrap();
            let fit = output_error(&periods.mean().unwrap(), &unknowns).unwrap();
            let (first, second) = periods.halves().unwrap();
            let instrumental = instrumental_variables(&first, &second, &unknowns).unwrap();
            for found in [fit.estimate, instrumental] {
                let error = relative_error(&found.stiffness(), system.stiffness());
                assert!(error < 1e-10, "{measured}: {error:e}");
                assert!(relative_error(&found.damping(), system.damping()) < 1e-10);
            }
        }
    }
}

/// Returns for each parameter the share of 95 % intervals that contain the truth, and the mean
/// error divided by the standard deviation.
fn judge(
    system: &SecondOrderSystem,
    runs: u64,
    fit: impl Fn(u64, &Unknowns) -> OutputErrorFit + Sync,
) -> (Vec<f64>, Vec<f64>, f64) {
    let unknowns = Unknowns::known_mass(system.mass()).unwrap();
    let truth: Vec<f64> =
        unknowns.free().iter().map(|p| system.matrix(p.matrix())[(p.row(), p.column())]).collect();
    let fits: Vec<OutputErrorFit> =
        (0..runs).into_par_iter().map(|seed| fit(seed, &unknowns)).collect();
    let count = runs as f64;
    let (mut coverage, mut bias) = (Vec::new(), Vec::new());
    for (at, truth) in truth.iter().enumerate() {
        let found: Vec<_> = fits.iter().map(|f| f.estimate.parameters().nth(at).unwrap()).collect();
        let held = found.iter().filter(|p| {
            let [low, high] = p.interval(0.95).unwrap();
            (low..=high).contains(truth)
        });
        coverage.push(held.count() as f64 / count);
        let mean = found.iter().map(|p| p.value - truth).sum::<f64>() / count;
        let power = found.iter().map(|p| (p.value - truth - mean).powi(2)).sum::<f64>() / count;
        bias.push(mean / power.sqrt());
    }
    (coverage, bias, fits.iter().map(|f| f.misfit_ratio).sum::<f64>() / count)
}

#[test]
fn noise_on_the_force_is_allowed_for() {
    let system = oscillator();
    let setup = setup(&system, 16, ResponseQuantity::Displacement);
    let fit = |seed, unknowns: &Unknowns| {
        let data = setup.measure(0.05, 0.1, seed).mean_with_noise(Pooling::AllLines).unwrap();
        assert!(data.noise().unwrap().has_force());
        output_error(&data, unknowns).unwrap()
    };
    let (coverage, bias, misfit) = judge(&system, 1000, fit);
    for (coverage, bias) in coverage.iter().zip(&bias) {
        // In 1,000 runs, a share of 95 % has a standard deviation of 0.7 %. The mean of 1,000
        // errors of unit variance has a standard deviation of 1/√1000 = 0.03.
        assert!((0.925..=0.975).contains(coverage), "{coverage}");
        assert!(bias.abs() < 0.12, "{bias}");
    }
    assert!((misfit - 1.0).abs() < 0.02, "{misfit}");
}

#[test]
fn weights_of_few_periods_widen_the_intervals_as_they_should() {
    let system = bearing();
    let setup = setup(&system, 8, ResponseQuantity::Acceleration);
    let fit = |seed, unknowns: &Unknowns| {
        let noise = setup.measure(0.02, 0.0, seed);
        output_error(&noise.mean_with_noise(Pooling::PerLine).unwrap(), unknowns).unwrap()
    };
    let (coverage, bias, misfit) = judge(&system, 1000, fit);
    // The mean coverage is 96.5 %, because the correction for uncertain weights is a little too
    // large. The coverage of each parameter scatters by 0.6 %.
    let mean = coverage.iter().sum::<f64>() / coverage.len() as f64;
    assert!((0.94..=0.97).contains(&mean), "{mean}");
    for (coverage, bias) in coverage.iter().zip(&bias) {
        assert!((0.935..=0.985).contains(coverage), "{coverage}");
        assert!(bias.abs() < 0.12, "{bias}");
    }
    assert!((misfit - 1.0).abs() < 0.03, "{misfit}");
}

#[test]
fn one_period_is_weighted_by_its_own_residual() {
    let system = bearing();
    let setup = setup(&system, 1, ResponseQuantity::Acceleration);
    let fit = |seed, unknowns: &Unknowns| {
        output_error(&setup.measure(0.02, 0.0, seed).mean().unwrap(), unknowns).unwrap()
    };
    let (coverage, bias, _) = judge(&system, 1000, fit);
    for (coverage, bias) in coverage.iter().zip(&bias) {
        assert!((0.925..=0.975).contains(coverage), "{coverage}");
        assert!(bias.abs() < 0.12, "{bias}");
    }
}

#[test]
fn a_model_that_is_wrong_shows_in_the_misfit() {
    // The bearing has two degrees of freedom, but the fitted model has one.
    let system = bearing();
    let setup = setup(&system, 8, ResponseQuantity::Displacement);
    let one = |r: &Record| Record::from_channel(r.sampling(), r.channel(0).to_vec()).unwrap();
    let motion = noise::add_white(&one(&setup.motion), NoiseLevel::FractionOfRms(0.01), 1).unwrap();
    let periods =
        RepeatedPeriods::new(&setup.lines, &one(&setup.force), &motion, setup.measured).unwrap();
    let data = periods.mean_with_noise(Pooling::AllLines).unwrap();
    let fit = output_error(&data, &Unknowns::unknown_mass(1).unwrap()).unwrap();
    assert!(fit.misfit_ratio > 100.0, "{}", fit.misfit_ratio);
}

/// All estimators find a single unknown, a stiffness in the first equation; the second equation has
/// no unknowns.
#[test]
fn a_single_unknown_is_found_by_all() {
    let system = bearing();
    let setup = setup(&system, 4, ResponseQuantity::Displacement);
    let periods = setup.measure(0.001, 0.0, 3);
    let (first, second) = periods.halves().unwrap();
    let mut unknowns = Unknowns::known_mass(system.mass()).unwrap();
    for matrix in [Matrix::Damping, Matrix::Stiffness] {
        for at in 0..4 {
            let value = system.matrix(matrix)[(at / 2, at % 2)];
            unknowns = unknowns.fix(matrix, at / 2, at % 2, value).unwrap();
        }
    }
    unknowns = unknowns.release(Matrix::Stiffness, 0, 1).unwrap();
    for found in [
        equation_error(&first, &unknowns).unwrap(),
        instrumental_variables(&first, &second, &unknowns).unwrap(),
        output_error(&first, &unknowns).unwrap().estimate,
    ] {
        let k12 = found.parameter("k12").unwrap();
        assert!((k12.value - 50.0).abs() < 4.0 * k12.standard_error, "{k12}");
        assert!((k12.value - 50.0).abs() < 0.5, "{k12}");
    }
}

#[test]
fn parameters_that_are_not_excited_are_named() {
    // The second mass does not move: the data do not determine its columns of C and K.
    let setup = setup(&oscillator(), 2, ResponseQuantity::Displacement);
    let still = |r: &Record| {
        let zero = vec![0.0; r.len()];
        Record::from_channels(r.sampling(), &[r.channel(0), &zero[..]]).unwrap()
    };
    let (force, motion) = (still(&setup.force), still(&setup.motion));
    let periods =
        RepeatedPeriods::new(&setup.lines, &force, &motion, ResponseQuantity::Displacement)
            .unwrap();
    let unknowns = Unknowns::known_mass(&DMatrix::from_diagonal_element(2, 2, 10.0)).unwrap();
    // No force acts on the second mass. Without this known entry, which multiplies the acceleration
    // of the first mass, the second equation would read 0 = 0.
    let unknowns = unknowns.fix(Matrix::Mass, 1, 0, 1.0).unwrap();
    let (first, second) = periods.halves().unwrap();
    let refused = [
        output_error(&periods.mean().unwrap(), &unknowns).unwrap_err(),
        instrumental_variables(&first, &second, &unknowns).unwrap_err(),
    ];
    for e in refused {
        let EstimateError::Undetermined { parameters, .. } = e else { panic!("{e}") };
        assert_eq!(parameters, "c12, c22, k12, k22");
    }
}

#[test]
fn noise_that_cannot_weigh_is_refused() {
    let setup = setup(&bearing(), 3, ResponseQuantity::Displacement);
    let periods = setup.measure(0.01, 0.0, 1);
    let unknowns = Unknowns::unknown_mass(2).unwrap();
    let data = periods.mean_with_noise(Pooling::PerLine).unwrap();
    assert!(matches!(
        output_error(&data, &unknowns),
        Err(EstimateError::Spectra(SpectraError::TooFewAverages { got: 3, needed: 5 }))
    ));
    let one = RepeatedPeriods::new(
        &setup.lines,
        &setup.force.window(0, 128).unwrap(),
        &setup.motion.window(0, 128).unwrap(),
        ResponseQuantity::Displacement,
    )
    .unwrap();
    let refused = SpectraError::TooFewAverages { got: 1, needed: 2 };
    assert_eq!(one.noise(Pooling::AllLines), Err(refused.clone()));
    assert_eq!(one.halves().unwrap_err(), refused);

    let mean = periods.mean().unwrap();
    let zero = NoiseSpectrum::new(mean.omega().to_vec(), vec![DMatrix::zeros(4, 4); 40]).unwrap();
    let exact = mean.clone().with_noise(zero).unwrap();
    assert!(matches!(output_error(&exact, &unknowns), Err(EstimateError::SingularNoise { .. })));

    let other = NoiseSpectrum::new(vec![1.0; 40], vec![DMatrix::identity(4, 4); 40]).unwrap();
    let e = mean.with_noise(other).unwrap_err();
    assert!(matches!(e, SpectraError::FrequencyMismatch { row: 0, right: 1.0, .. }));
    let mut negative = DMatrix::<Complex<f64>>::identity(2, 2);
    negative[(1, 1)] = Complex::from(-1.0);
    let e = NoiseSpectrum::new(vec![1.0], vec![negative]).unwrap_err();
    assert_eq!(e, SpectraError::NoiseVariance { row: 0, column: 1, value: -1.0 });

    // Both measurements must have the same lines.
    let short = FrequencyData::from_amplitudes(
        vec![1.0],
        DMatrix::from_element(1, 2, Complex::from(1.0)),
        DMatrix::from_element(1, 2, Complex::from(1.0)),
        ResponseQuantity::Displacement,
    )
    .unwrap();
    let e = instrumental_variables(&short, &periods.mean().unwrap(), &unknowns).unwrap_err();
    let EstimateError::Spectra(SpectraError::Numerics(size)) = &e else { panic!("{e:?}") };
    assert!(matches!(size, NumericsError::Size { expected: 1, got: 40, .. }), "{size:?}");
}

/// Periods that are added in several parts give the same result as one record. The reference for
/// the noise is the spectrum of all seven periods, at the lines between the lines of one period.
#[test]
fn periods_may_come_a_few_at_a_time() {
    let setup = setup(&bearing(), 7, ResponseQuantity::Velocity);
    let add = |record: &Record, seed| {
        noise::add_white(record, NoiseLevel::FractionOfRms(0.03), seed).unwrap()
    };
    let (force, motion) = (add(&setup.force, 1), add(&setup.motion, 2));
    let whole = RepeatedPeriods::new(&setup.lines, &force, &motion, setup.measured).unwrap();
    let mut parts = RepeatedPeriods::expecting(&setup.lines, 2, setup.measured, 7);
    for (start, len) in [(0, 1), (1, 3), (4, 1), (5, 2)] {
        assert!(parts.halves().is_err());
        let part = |record: &Record| record.window(128 * start, 128 * len).unwrap();
        parts.push(&part(&force), &part(&motion)).unwrap();
    }
    assert_eq!(parts.count(), 7);
    assert_eq!(parts.mean().unwrap(), whole.mean().unwrap());
    assert_eq!(parts.halves().unwrap(), whole.halves().unwrap());
    let noise = parts.noise(Pooling::PerLine).unwrap();
    assert_eq!(noise, whole.noise(Pooling::PerLine).unwrap());

    let all = Lines::new(force.sampling(), 1..=300).unwrap();
    let [f, v] = [&force, &motion].map(|record| all.read(record).unwrap());
    for (line, place) in setup.lines.as_slice().iter().enumerate().step_by(17) {
        // The spectrum of all periods together has lines between the lines of one period. The
        // velocities at these lines are divided by iω of the nearest line of one period.
        let per_displacement = Complex::new(0.0, setup.lines.omega()[line]);
        let z = |at: usize| {
            DMatrix::from_fn(4, 1, |i, _| match i {
                0 | 1 => v[(at - 1, i)] / per_displacement,
                _ => f[(at - 1, i - 2)],
            })
        };
        let between = (7 * place - 3..=7 * place + 3).filter(|at| *at != 7 * place);
        let products = between.map(|at| z(at) * z(at).adjoint());
        let expected = products.sum::<DMatrix<_>>().unscale(6.0);
        let error = (noise.covariance(line) - &expected).norm() / expected.norm();
        assert!(error < 1e-12, "line {line}: {error:e}");
    }
}

#[test]
fn halves_need_all_periods_that_were_expected() {
    let setup = setup(&oscillator(), 4, ResponseQuantity::Displacement);
    let mut periods = RepeatedPeriods::expecting(&setup.lines, 1, setup.measured, 6);
    assert_eq!(periods.mean().unwrap_err(), SpectraError::TooFewAverages { got: 0, needed: 1 });
    periods.push(&setup.force, &setup.motion).unwrap();
    let missing = SpectraError::TooFewAverages { got: 4, needed: 6 };
    assert_eq!(periods.halves().unwrap_err(), missing);
    periods.push(&setup.force, &setup.motion).unwrap();
    assert!(periods.halves().is_ok());
    let short = setup.force.window(0, 100).unwrap();
    assert!(matches!(periods.push(&short, &short), Err(SpectraError::Signal(_))));
}
