//! Checks of spectral fits and of residuals, and predictions of records that were not fitted.

use mechid_checks as checks;
use mechid_checks::CrossCorrelation;
use mechid_checks::{
    Finding, Subject, Verdict, after_fit, before_equation_of_motion, before_spectral_fit,
    fitted_band, steady_periods,
};
use mechid_estimate::frequency_domain::equation_error;
use mechid_estimate::{
    EstimateError, StartFit, Unknowns, fit_percent, fitted_start, predict, predict_periodic,
};
use mechid_model::{Discretisation, InitialState, KyxSign, ResponseQuantity, SecondOrderSystem};
use mechid_numerics::NumericsError;
use mechid_problems::{dissertation_bearing, exact_foh, exact_harmonic_periodic};
use mechid_signal::{Extent, Multisine, NoiseLevel, Phases, Record, Sampling, noise};
use mechid_spectra::frf::Frf;
use mechid_spectra::{FrequencyData, Lines, RepeatedPeriods};
use nalgebra::{DMatrix, DVector};

fn bearing() -> SecondOrderSystem {
    dissertation_bearing(KyxSign::Minus).system()
}

/// Returns two forces: multisines with random phases on these `lines` of one period.
fn force(dt: f64, samples: usize, lines: std::ops::RangeInclusive<usize>) -> Record {
    let sampling = Sampling::new(dt, samples).unwrap();
    let channel = |seed| {
        let multisine = Multisine::flat(lines.clone(), 20.0, Phases::Random { seed }).unwrap();
        multisine.sample(sampling).unwrap().channel(0).to_vec()
    };
    Record::from_channels(sampling, &[channel(1), channel(2)]).unwrap()
}

fn of(checks: &[Finding], subject: Subject) -> &Finding {
    checks.iter().find(|c| c.subject() == subject).unwrap()
}

/// The checks before a fit report too few lines, a wrong period and large noise. They accept the
/// good record, whose lines extend beyond the highest mode, at 1.8 rad/s.
#[test]
fn trouble_with_spectra_is_seen_before_the_fit() {
    let system = bearing();
    let unknowns = Unknowns::known_mass(system.mass()).unwrap();
    let look = |dt: f64, lines: std::ops::RangeInclusive<usize>, period: usize, noisy: f64| {
        let one = force(dt, 512, lines.clone());
        let motion = exact_harmonic_periodic(&system, &one).unwrap();
        let three = motion.displacement().repeated(3).unwrap();
        let three = noise::add_white(&three, NoiseLevel::FractionOfRms(noisy), 1).unwrap();
        let lines = Lines::new(one.sampling().with_len(period).unwrap(), lines).unwrap();
        let force = one.repeated(3).unwrap();
        let measured = ResponseQuantity::Displacement;
        let data = RepeatedPeriods::new(&lines, &force, &three, measured).unwrap().mean().unwrap();
        let mut findings = before_spectral_fit(&data, &unknowns).unwrap();
        findings.extend(steady_periods(&force, &three, period).unwrap());
        findings
    };
    let good = look(0.2, 1..=60, 512, 0.01);
    assert_eq!(good.iter().map(|c| c.verdict()).max(), Some(Verdict::Good), "{good:?}");
    assert_eq!(of(&good, Subject::Excitation).value(), 60.0);
    // The periods differ by the noise of 1 % only. The value is the largest deviation of the three
    // periods from their mean.
    assert!((0.007..0.011).contains(&of(&good, Subject::Periodicity).value()));

    // One line gives two equations for four unknowns, which is too few; two lines give four
    // equations, as many as unknowns, and the check must warn.
    let poor = look(0.2, 5..=5, 512, 0.0);
    assert_eq!((poor[0].verdict(), poor[1].subject()), (Verdict::Bad, Subject::Periodicity));
    let tight = look(0.2, 5..=6, 512, 0.0);
    assert_eq!(of(&tight, Subject::Excitation).verdict(), Verdict::Doubtful);

    assert_eq!(of(&look(0.2, 1..=60, 500, 0.0), Subject::Periodicity).verdict(), Verdict::Bad);
    assert_eq!(of(&look(0.2, 1..=60, 512, 0.2), Subject::Periodicity).verdict(), Verdict::Doubtful);
}

/// The check after a fit reports a mode above the fitted lines, and a mode above the Nyquist
/// frequency. The highest mode of the machine is at 1.8 rad/s.
#[test]
fn a_mode_beyond_the_lines_or_the_sampling_is_seen_after_the_fit() {
    let system = bearing();
    let unknowns = Unknowns::known_mass(system.mass()).unwrap();
    let fastest = system.modes().unwrap().iter().map(|m| m.natural_frequency()).fold(0.0, f64::max);
    let look = |dt: f64, lines: std::ops::RangeInclusive<usize>| {
        let force = force(dt, 512, lines.clone());
        let exact = exact_harmonic_periodic(&system, &force).unwrap();
        let lines = Lines::new(force.sampling(), lines).unwrap();
        let kind = ResponseQuantity::Displacement;
        let data = FrequencyData::read(&lines, &force, exact.displacement(), kind).unwrap();
        let estimate = equation_error(&data, &unknowns).unwrap();
        fitted_band(&estimate, &lines).unwrap().unwrap()
    };
    let good = look(0.2, 1..=60);
    assert_eq!((good.subject(), good.verdict()), (Subject::Step, Verdict::Good));
    let samples = std::f64::consts::TAU / (fastest * 0.2);
    assert!((good.value() / samples - 1.0).abs() < 1e-6, "{good} {samples}");
    // Line 20 of a record of 102.4 s is at 1.23 rad/s. The highest mode, at 1.8 rad/s, is above the
    // fitted lines, and the check must warn.
    assert_eq!(look(0.2, 1..=20).verdict(), Verdict::Doubtful);
    assert_eq!(look(2.0, 1..=250).verdict(), Verdict::Bad);
}

#[test]
fn trouble_with_samples_is_seen_before_the_equation_of_motion_is_fitted() {
    let system = bearing();
    let unknowns = Unknowns::unknown_mass(2).unwrap();
    let look = |lines: std::ops::RangeInclusive<usize>, dt: f64| {
        let force = force(dt, 512, lines);
        let motion = exact_harmonic_periodic(&system, &force).unwrap();
        before_equation_of_motion(&[(&motion, &force)], &unknowns).unwrap()
    };
    let good = look(1..=60, 0.2);
    assert_eq!(good.len(), 4);
    assert_eq!(good.iter().map(|c| c.verdict()).max(), Some(Verdict::Good), "{good:?}");
    // A force with two lines is persistently exciting of order four only, but each equation has six
    // unknowns.
    let poor = look(5..=6, 0.2);
    assert_eq!(of(&poor, Subject::Excitation).verdict(), Verdict::Bad);
    assert_eq!(of(&poor, Subject::Conditioning).verdict(), Verdict::Bad);
    assert_eq!(of(&look(1..=250, 2.0), Subject::Step).verdict(), Verdict::Bad);
}

#[test]
fn trouble_with_responses_is_seen_before_they_are_fitted() {
    let system = bearing();
    let unknowns = Unknowns::known_mass(system.mass()).unwrap();
    let look = |lines: usize, coherence: f64| {
        let omega: Vec<f64> = (1..=lines).map(|n| 0.1 * n as f64).collect();
        let response = omega.iter().map(|w| system.receptance(*w).unwrap()).collect();
        let coherence = DMatrix::from_element(lines, 2, coherence);
        let frf =
            Frf::new(omega, response, coherence, 20.0, ResponseQuantity::Displacement).unwrap();
        let mut findings = before_spectral_fit(&frf.data(&[0, 1]).unwrap(), &unknowns).unwrap();
        findings.extend(checks::coherence(&frf));
        findings
    };
    let good = look(30, 0.99);
    assert!(good.iter().all(|c| c.verdict() == Verdict::Good), "{good:?}");
    assert_eq!(of(&good, Subject::Coherence).value(), 0.99);
    assert_eq!(of(&look(30, 0.7), Subject::Coherence).verdict(), Verdict::Doubtful);
    assert_eq!(of(&look(30, 0.3), Subject::Coherence).verdict(), Verdict::Bad);
    // One frequency and two forces give four equations for four unknowns: no equation to spare, and
    // the check must warn.
    assert_eq!(of(&look(1, 0.99), Subject::Excitation).verdict(), Verdict::Doubtful);
}

#[test]
fn residuals_are_judged_channel_by_channel() {
    let sampling = Sampling::new(0.1, 2000).unwrap();
    let white = noise::white(sampling, 2, 1.0, 3).unwrap();
    let force = noise::white(sampling, 2, 1.0, 4).unwrap();
    let fitted = noise::white(sampling, 2, 100.0, 5).unwrap();
    let checks = after_fit(&white, &fitted, &force, 20, 0).unwrap();
    // Each of the two residuals has three tests: whiteness, and correlation with each of the two
    // forces.
    assert_eq!(checks.len(), 6);
    assert!(checks.iter().all(|c| c.verdict() == Verdict::Good), "{checks:?}");

    // The first residual contains the second force one sample late; the second residual is
    // coloured.
    let data = DMatrix::from_fn(2000, 2, |k, channel| match (k, channel) {
        (0, _) => 0.0,
        (_, 0) => white.data()[(k, 0)] + 0.5 * force.data()[(k - 1, 1)],
        _ => white.data()[(k, 1)] + 0.7 * white.data()[(k - 1, 1)],
    });
    let residual = Record::new(sampling, data).unwrap();
    let checks = after_fit(&residual, &fitted, &force, 20, 0).unwrap();
    let doubtful: Vec<usize> =
        (0..6).filter(|at| checks[*at].verdict() == Verdict::Doubtful).collect();
    assert_eq!(doubtful, [2, 3], "{checks:?}");
    assert!(
        matches!(
            checks[2],
            Finding::CrossCorrelation(CrossCorrelation { residual: 0, force: 1, .. })
        ),
        "{checks:?}"
    );

    // Relative to a far larger fitted signal, the same residual is only rounding. A constant force
    // is not tested.
    let large = Record::new(sampling, fitted.data() * 1e10).unwrap();
    let still = Record::new(sampling, DMatrix::from_element(2000, 1, 3.0)).unwrap();
    let checks = after_fit(&residual, &large, &still, 20, 0).unwrap();
    assert_eq!(checks.len(), 2);
    assert!(checks.iter().all(|c| c.verdict() == Verdict::Good));
    let other = fitted.window(0, 100).unwrap();
    assert!(matches!(after_fit(&residual, &other, &force, 20, 0), Err(EstimateError::Signal(_))));
}

/// The predicted steady state equals the closed form of the simulated problems, which does not use
/// the estimators.
#[test]
fn the_steady_state_is_predicted_line_by_line() {
    let system = bearing();
    let force = force(0.2, 511, 1..=200);
    let expected = exact_harmonic_periodic(&system, &force).unwrap();
    let got = predict_periodic(&system, &force).unwrap();
    for (a, b) in [
        (expected.displacement(), got.displacement()),
        (expected.velocity(), got.velocity()),
        (expected.acceleration(), got.acceleration()),
    ] {
        assert!(fit_percent(a, b).unwrap().iter().all(|fit| *fit > 100.0 - 1e-9));
    }
    let one = Record::from_channel(force.sampling(), force.channel(0).to_vec()).unwrap();
    assert!(matches!(
        predict_periodic(&system, &one),
        Err(EstimateError::Numerics(NumericsError::Size { got: 1, .. }))
    ));
}

#[test]
fn a_start_is_found_from_any_kind_of_motion() {
    let system = bearing();
    let force = force(0.2, 400, 1..=90);
    let truth =
        InitialState::new(DVector::from_vec(vec![0.5, -0.2]), DVector::from_vec(vec![0.3, 0.4]));
    let truth = truth.unwrap();
    let motion = exact_foh(&system, &force, &truth).unwrap();
    let hold = Discretisation::FirstOrderHold;
    for measured in [
        vec![(ResponseQuantity::Displacement, motion.displacement())],
        vec![(ResponseQuantity::Acceleration, motion.acceleration())],
        vec![
            (ResponseQuantity::Displacement, motion.displacement()),
            (ResponseQuantity::Velocity, motion.velocity()),
        ],
    ] {
        let found = fitted_start(&system, &force, hold, &measured).unwrap();
        assert!((found.displacement() - truth.displacement()).amax() < 1e-9);
        assert!((found.velocity() - truth.velocity()).amax() < 1e-9);
        // Segments that share a sample give the same result.
        let mut fit = StartFit::new(&system, hold).unwrap();
        for (start, len) in [(0, 7), (6, 2), (7, 393)] {
            let part = |record: &Record| record.window(start, len).unwrap();
            let parts = measured.iter().map(|(kind, record)| (*kind, part(record)));
            let parts: Vec<(ResponseQuantity, Record)> = parts.collect();
            let parts: Vec<_> = parts.iter().map(|(kind, record)| (*kind, record)).collect();
            fit.push(&part(&force), &parts).unwrap();
        }
        let joined = fit.start().unwrap();
        assert!((joined.displacement() - truth.displacement()).amax() < 1e-9);
        assert!((joined.velocity() - truth.velocity()).amax() < 1e-9);
        let predicted = predict(&system, &force, hold, Extent::Open, &found).unwrap();
        let fit = fit_percent(motion.velocity(), predicted.velocity()).unwrap();
        assert!(fit.iter().all(|fit| *fit > 100.0 - 1e-6));
    }
    // The fit averages the noise over all samples. The error of the initial displacement must
    // therefore be less than the noise of a single sample, 10 % of the RMS of the motion.
    let noisy = noise::add_white(motion.displacement(), NoiseLevel::FractionOfRms(0.1), 8).unwrap();
    let found =
        fitted_start(&system, &force, hold, &[(ResponseQuantity::Displacement, &noisy)]).unwrap();
    let rms = motion.displacement().data().norm() / (2.0f64 * 400.0).sqrt();
    assert!((found.displacement() - truth.displacement()).amax() < 0.1 * rms);

    let nothing = StartFit::new(&system, hold).unwrap().start();
    assert!(matches!(
        nothing,
        Err(EstimateError::Numerics(NumericsError::TooFewRows { rows: 0, .. }))
    ));

    // The acceleration of a free mass depends on neither its position nor its velocity; the fit
    // must set both initial values to zero.
    let one = |value: f64| DMatrix::from_element(1, 1, value);
    let free = SecondOrderSystem::new(one(2.0), one(0.0), one(0.0)).unwrap();
    let push = Record::from_channel(force.sampling(), force.channel(0).to_vec()).unwrap();
    let moved = exact_foh(&free, &push, &InitialState::rest(1)).unwrap();
    let kind = [(ResponseQuantity::Acceleration, moved.acceleration())];
    let found = fitted_start(&free, &push, hold, &kind).unwrap();
    assert_eq!((found.displacement()[0], found.velocity()[0]), (0.0, 0.0));
}

/// A known mass of 1e300 kg is refused, because its square exceeds the largest floating-point
/// number.
#[test]
fn a_mass_beyond_all_reason_is_refused() {
    let force = force(0.02, 100, 1..=40);
    let force = Record::from_channel(force.sampling(), force.channel(0).to_vec()).unwrap();
    let system = mechid_problems::dissertation_sdof().system();
    let motion = exact_harmonic_periodic(&system, &force).unwrap();
    let unknowns = Unknowns::known_mass(&DMatrix::from_element(1, 1, 1e300)).unwrap();
    let found = mechid_estimate::time_domain::equation_of_motion(&motion, &force, &unknowns);
    assert_eq!(found, Err(EstimateError::Unbounded { parameter: "c".into() }));
    let held = mechid_estimate::time_domain::TimeDomain::new(
        Discretisation::ZeroOrderHold,
        Extent::WholePeriod,
    );
    let found = held.fit(motion.displacement(), motion.velocity(), &force, &unknowns);
    assert_eq!(found, Err(EstimateError::Unbounded { parameter: "c".into() }));
}
