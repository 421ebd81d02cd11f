//! Checks before and after a fit, predictions for validation, and sweeps.

use mechid_checks::WrongPeriod;
use mechid_checks::{
    Finding, PeriodFault, Subject, Verdict, before_fit, claimed_period, steady_periods,
};
use mechid_estimate::time_domain::TimeDomain;
use mechid_estimate::{Estimate, EstimateError, Unknowns, fit_percent, predict, sweep};
use mechid_model::{Discretisation, InitialState, KyxSign, Response, npi_sampling};
use mechid_problems::{
    dissertation_bearing, dissertation_sdof, exact_foh, exact_foh_periodic, exact_zoh,
    exact_zoh_periodic,
};
use mechid_signal::correlation::{cross_correlation, whiteness, whiteness_beyond};
use mechid_signal::{Extent, Multisine, NoiseLevel, Phases, Record, Sampling, noise};
use nalgebra::DVector;

fn force(sampling: Sampling, lines: std::ops::RangeInclusive<usize>) -> Record {
    let channel = |seed| {
        let multisine = Multisine::flat(lines.clone(), 20.0, Phases::Random { seed }).unwrap();
        multisine.sample(sampling).unwrap().channel(0).to_vec()
    };
    Record::from_channels(sampling, &[channel(1), channel(2)]).unwrap()
}

fn verdict(method: TimeDomain, motion: &Response, force: &Record, subject: Subject) -> Verdict {
    let states = [motion.displacement(), motion.velocity(), force];
    let mut checks = before_fit(method, &[states]).unwrap();
    if method.extent() == Extent::WholePeriod {
        checks.extend(steady_periods(force, motion.displacement(), force.len()).unwrap());
    }
    checks.iter().filter(|c| c.subject() == subject).map(Finding::verdict).max().unwrap()
}

#[test]
fn trouble_is_seen_before_the_fit() {
    let system = dissertation_bearing(KyxSign::Minus).system();
    let sampling = Sampling::new(0.1, 512).unwrap();
    let held = TimeDomain::new(Discretisation::ZeroOrderHold, Extent::WholePeriod);
    let euler = TimeDomain::new(Discretisation::Euler, Extent::WholePeriod);

    let rich = force(sampling, 1..=60);
    let motion = exact_zoh_periodic(&system, &rich).unwrap();
    for subject in [Subject::Excitation, Subject::Conditioning, Subject::Periodicity, Subject::Step]
    {
        assert_eq!(verdict(held, &motion, &rich, subject), Verdict::Good, "{subject:?}");
    }
    assert!(verdict(euler, &motion, &rich, Subject::Step) > Verdict::Good);

    let poor = force(sampling, 3..=4);
    let poor_motion = exact_zoh_periodic(&system, &poor).unwrap();
    assert_eq!(verdict(held, &poor_motion, &poor, Subject::Excitation), Verdict::Bad);
    assert_eq!(verdict(held, &poor_motion, &poor, Subject::Conditioning), Verdict::Bad);

    // A motion from rest is not periodic with the claimed period.
    let transient = exact_zoh(&system, &rich, &InitialState::rest(2)).unwrap();
    assert_eq!(verdict(held, &transient, &rich, Subject::Periodicity), Verdict::Bad);

    // With this sampling, the mode at 1.8 rad/s has only 1.7 samples per period; at least two are
    // needed.
    let slow = force(Sampling::new(2.0, 512).unwrap(), 1..=250);
    let aliased = exact_zoh_periodic(&system, &slow).unwrap();
    assert_eq!(verdict(held, &aliased, &slow, Subject::Step), Verdict::Bad);
}

#[test]
fn residuals_are_told_from_noise() {
    let sampling = Sampling::new(0.1, 2000).unwrap();
    let mut rejected = 0;
    for seed in 0..200 {
        let white = noise::white(sampling, 2, 1.0, seed).unwrap();
        let (e, u) = (white.channel(0), white.channel(1));
        rejected += usize::from(whiteness(e, 20).unwrap().p_value < 0.05);
        rejected += usize::from(cross_correlation(e, u, 10).unwrap().p_value < 0.05);
    }
    // At a level of 5 %, 20 of 400 tests reject on average, with a standard deviation of 4.4.
    assert!((5..=35).contains(&rejected), "{rejected}");

    let white = noise::white(sampling, 1, 1.0, 1).unwrap();
    let u = white.channel(0);
    // The residual contains the input two samples late, and the previous value of the residual.
    let mut e = vec![0.0; 2000];
    for k in 2..2000 {
        e[k] = 0.5 * e[k - 1] + 0.3 * u[k - 2];
    }
    assert!(whiteness(&e, 20).unwrap().p_value < 1e-6);
    let cross = cross_correlation(&e, u, 5).unwrap();
    assert!(cross.p_value < 1e-6);
    let largest = cross.coefficients.iter().cloned().fold(0.0, f64::max);
    // At lags −5 … 5 the delay of two samples is entry 7. Its coefficient is √(1 − 0.25).
    assert_eq!(cross.coefficients[7], largest);
    assert!((largest - 0.866).abs() < 0.05);
    assert!(whiteness(&e, 0).is_err() && whiteness(&e[..10], 9).is_err());
}

/// White noise seems correlated with a slow input no more often than with a fast one. The 51
/// coefficients of a slow input are correlated with one another: if they counted as independent,
/// their squares would exceed the limit of 1 % in one record of ten.
#[test]
fn a_slow_input_is_no_more_often_found_in_noise_than_a_fast_one() {
    let sampling = Sampling::new(1.0 / 128.0, 512).unwrap();
    let slow = Multisine::flat((6..=60).step_by(2), 2.0, Phases::Schroeder).unwrap();
    let slow = slow.sample(sampling).unwrap();
    let fast = noise::white(sampling, 1, 1.0, 9999).unwrap();
    for input in [slow, fast] {
        let p = |seed| {
            let white = noise::white(sampling, 1, 1.0, seed).unwrap();
            cross_correlation(white.channel(0), input.channel(0), 25).unwrap().p_value
        };
        let p: Vec<f64> = (0..2000).map(p).collect();
        let share = |level: f64| p.iter().filter(|p| **p < level).count();
        // Of the p-values of 2000 records of noise, 20 are expected below 0.01 and 100 below 0.05,
        // with standard deviations of 4.4 and 9.7.
        let (few, more) = (share(0.01), share(0.05));
        assert!((5..=38).contains(&few) && (61..=139).contains(&more), "{few} {more}");
    }
}

/// Differences of white noise are correlated at lag 1, and the test must find no correlation at
/// longer lags. At these lags, the coefficients of the differences scatter √1.5 times as much as
/// the coefficients of white noise.
#[test]
fn noise_of_a_known_span_has_nothing_beyond_it() {
    let sampling = Sampling::new(0.1, 2001).unwrap();
    let p = |seed, left: f64| {
        let white = noise::white(sampling, 1, 1.0, seed).unwrap();
        let w = white.channel(0);
        let e: Vec<f64> = (2..w.len()).map(|k| w[k] - w[k - 1] + left * w[k - 2]).collect();
        let [all, beyond] = [whiteness(&e, 25), whiteness_beyond(&e, 1, 25)];
        [all, beyond].map(|found| found.unwrap().p_value)
    };
    let rejected = |left, level: f64| {
        let found: Vec<[f64; 2]> = (0..1000).map(|seed| p(seed, left)).collect();
        [0, 1].map(|at| found.iter().filter(|p| p[at] < level).count())
    };
    let [all, beyond] = rejected(0.0, 0.05);
    // On average, the test at lags above 1 rejects 50 of 1000 records, with a standard deviation of
    // 7.
    assert!(all == 1000 && (22..=78).contains(&beyond), "{all} {beyond}");
    let [_, beyond] = rejected(0.6, 0.01);
    assert!(beyond > 900, "{beyond}");
}

#[test]
fn predictions_are_exact_for_their_kind_of_force() {
    let system = dissertation_bearing(KyxSign::Plus).system();
    let force = force(Sampling::new(0.3, 200).unwrap(), 1..=90);
    let start =
        InitialState::new(DVector::from_vec(vec![0.1, -0.2]), DVector::from_vec(vec![0.3, 0.4]))
            .unwrap();
    let cases = [
        (Discretisation::ZeroOrderHold, Extent::Open, exact_zoh(&system, &force, &start)),
        (Discretisation::FirstOrderHold, Extent::Open, exact_foh(&system, &force, &start)),
        (Discretisation::ZeroOrderHold, Extent::WholePeriod, exact_zoh_periodic(&system, &force)),
        (Discretisation::FirstOrderHold, Extent::WholePeriod, exact_foh_periodic(&system, &force)),
    ];
    for (method, extent, expected) in cases {
        let (expected, got) =
            (expected.unwrap(), predict(&system, &force, method, extent, &start).unwrap());
        for (a, b) in [
            (expected.displacement(), got.displacement()),
            (expected.velocity(), got.velocity()),
            (expected.acceleration(), got.acceleration()),
        ] {
            assert!(fit_percent(a, b).unwrap().iter().all(|fit| *fit > 100.0 - 1e-9));
        }
    }
}

#[test]
fn a_fit_is_validated_on_another_record() {
    let system = dissertation_bearing(KyxSign::Minus).system();
    let sampling = Sampling::new(0.2, 500).unwrap();
    let known = Unknowns::known_mass(system.mass()).unwrap();
    let fitted = force(sampling, 1..=100);
    let motion = exact_zoh_periodic(&system, &fitted).unwrap();
    let percent = |method| {
        let fit = TimeDomain::new(method, Extent::WholePeriod)
            .fit(motion.displacement(), motion.velocity(), &fitted, &known)
            .unwrap();
        let other = force(sampling, 1..=40);
        let measured = exact_zoh_periodic(&system, &other).unwrap();
        let noisy =
            noise::add_white(measured.displacement(), NoiseLevel::FractionOfRms(0.1), 5).unwrap();
        let found = fit.estimate().system().unwrap();
        let hold = Discretisation::ZeroOrderHold;
        let rest = InitialState::rest(2);
        let predicted = predict(&found, &other, hold, Extent::WholePeriod, &rest);
        predicted.map(|p| fit_percent(&noisy, p.displacement()).unwrap())
    };
    // Only the noise of 10 % is not predicted.
    for fit in percent(Discretisation::ZeroOrderHold).unwrap() {
        assert!((fit - 90.0).abs() < 1.5, "{fit}");
    }
    // At this step, Euler's rule gives a system with negative damping, or a bad prediction.
    assert!(percent(Discretisation::Euler).map_or(true, |fits| fits.iter().all(|f| *f < 80.0)));
}

#[test]
fn residuals_of_a_right_model_are_rounding() {
    let system = dissertation_sdof().system();
    let sampling = Sampling::new(0.02, 200).unwrap();
    let force = noise::white(sampling, 1, 20.0, 4).unwrap();
    let motion = exact_foh(&system, &force, &InitialState::rest(1)).unwrap();
    let known = Unknowns::known_mass(system.mass()).unwrap();
    let [x, v] = [motion.displacement(), motion.velocity()];
    let fit = |method| TimeDomain::new(method, Extent::Open).fit(x, v, &force, &known).unwrap();
    let right = fit(Discretisation::FirstOrderHold);
    let residual = right.one_step_errors(x, v, &force, Extent::Open).unwrap();
    assert_eq!(residual.shape(), (199, 2));
    assert!(residual.column(1).amax() < 1e-13 * v.data().amax().max(1.0));
    assert!(right.kinematic_error() < 1e-9);
    let wrong = fit(Discretisation::ZeroOrderHold);
    let residual = wrong.one_step_errors(x, v, &force, Extent::Open).unwrap();
    // The zero-order hold ignores the force of the next sample; this error appears as a correlation
    // at lag −1.
    let column: Vec<f64> = residual.column(1).iter().copied().collect();
    let cross = cross_correlation(&column, &force.channel(0)[..199], 3).unwrap();
    assert!(cross.p_value < 1e-6 && cross.coefficients[2].abs() > 0.5, "{cross:?}");
}

#[test]
fn a_sweep_is_the_same_on_any_number_of_threads_and_finds_the_best() {
    let machine = dissertation_sdof();
    let system = machine.system();
    let known = Unknowns::known_mass(system.mass()).unwrap();
    let settings: Vec<f64> = (1..=20).map(|npi| f64::from(npi) * 4.0).collect();
    let run = |npi: &f64| -> Result<Estimate, EstimateError> {
        let sampling = npi_sampling(*npi, 128, machine.natural_frequency())?;
        let force = noise::white(sampling, 1, 20.0, 4)?;
        let motion = exact_zoh_periodic(&system, &force).expect("damped");
        let motion_noisy =
            noise::add_white(motion.displacement(), NoiseLevel::FractionOfRms(1e-3), 3)?;
        let method = TimeDomain::new(Discretisation::ZeroOrderHold, Extent::WholePeriod);
        Ok(method.fit(&motion_noisy, motion.velocity(), &force, &known)?.into_estimate())
    };
    let count = std::sync::atomic::AtomicUsize::new(0);
    let tick = |_| {
        count.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
    };
    let found = sweep(&settings, Some(&system), run, tick);
    assert_eq!(count.into_inner(), settings.len());
    let single = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let again = single.install(|| sweep(&settings, Some(&system), run, |_| {}));
    assert_eq!(found, again);
    let best = found.best().unwrap();
    let smallest = found.points().iter().filter_map(|p| p.error).fold(f64::INFINITY, f64::min);
    assert_eq!(best.error, Some(smallest));
    // Without a reference system, the standard errors determine the best point.
    assert!(sweep(&settings, None, run, |_| {}).best().is_some());
    // Failed runs are points of the sweep, too, with the error as their outcome.
    let failing = sweep(&[1.0, 2.0], None, |_| Err::<Estimate, _>(EstimateError::NoDof), |_| {});
    assert_eq!(failing.best(), None);
    assert_eq!(failing.points()[1].outcome, Err(EstimateError::NoDof));
}

/// The force contradicts a wrong period, but not a right one. The forces are multisines over the
/// whole band and over its lowest hundredth, without noise and with the noise of a load cell.
#[test]
fn a_wrong_period_is_found_out_by_the_force_and_a_right_one_is_not() {
    let sampling = Sampling::new(0.01, 1024).unwrap();
    let wide = || Multisine::flat((5..400).step_by(5), 2.0, Phases::Random { seed: 3 });
    let slow = || Multisine::flat(1..=5, 2.0, Phases::Schroeder);
    for (name, force) in [("wide", wide()), ("slow", slow())] {
        let force = force.unwrap().sample(sampling).unwrap().repeated(4).unwrap();
        for (share, seeds) in [(0.0, 1), (0.01, 100)] {
            for seed in 0..seeds {
                let force = match share {
                    0.0 => force.clone(),
                    _ => noise::add_white(&force, NoiseLevel::FractionOfRms(share), seed).unwrap(),
                };
                let look = |period: usize| {
                    let whole = force.len() / period * period;
                    claimed_period(&force.window(0, whole).unwrap(), period)
                };
                for right in [1024, 2048, 4096] {
                    let said = look(right);
                    assert!(said.is_none(), "{name} {share} {seed} {right}: {said:?}");
                }
                for wrong in [1023, 1025, 1022, 1536, 1365, 700, 1800] {
                    let found = look(wrong).unwrap_or_else(|| panic!("{name} {share} {wrong}"));
                    assert_eq!(found.verdict(), Verdict::Bad);
                    // The wide force repeats five times in 1024 samples; 205 samples, rounded, is
                    // therefore the shortest period that the check may report.
                    assert!(found.value() > 200.0, "{name} {wrong}: {found}");
                }
            }
        }
    }
    // The claimed period contains one and a half true periods. The force also repeats five times in
    // a true period, but a fifth of this period is not a whole number of samples.
    let force = wide().unwrap().sample(sampling).unwrap().repeated(2).unwrap();
    let found = claimed_period(&force.window(0, 1536).unwrap(), 1536).unwrap();
    let Finding::WrongPeriod(WrongPeriod { claimed: 1536, fault }) = found else {
        panic!("{found:?}")
    };
    let PeriodFault::Other { period: 1024, samples: 1536, .. } = fault else {
        panic!("{fault:?}");
    };
}

/// If the claimed period is wrong by four samples, the neighbouring periods are wrong, too: the
/// check names the right period and no period in between, also with noise on the force.
#[test]
fn a_period_some_samples_off_is_replaced_by_the_right_one_only() {
    let sampling = Sampling::new(0.01, 256).unwrap();
    for seed in 0..20 {
        for lines in [1..=100, 1..=20] {
            let force = Multisine::flat(lines, 2.0, Phases::Random { seed }).unwrap();
            let force = force.sample(sampling).unwrap().repeated(16).unwrap();
            let force = noise::add_white(&force, NoiseLevel::FractionOfRms(0.05), seed).unwrap();
            for claimed in [252, 253, 259, 260, 261] {
                let whole = 4096 / claimed * claimed;
                let found = claimed_period(&force.window(0, whole).unwrap(), claimed).unwrap();
                assert_eq!((found.verdict(), found.value()), (Verdict::Bad, 256.0), "{found}");
            }
        }
    }
}

/// The check reports an interruption if rows are missing from a record, or if rows of a second run
/// follow. The samples before and after a gap also agree at other lags, but this is no evidence of
/// another period.
#[test]
fn a_gap_in_the_record_is_no_other_period() {
    let sampling = Sampling::new(0.01, 256).unwrap();
    let force = Multisine::flat(1..=60, 2.0, Phases::Random { seed: 3 }).unwrap();
    let force = force.sample(sampling).unwrap().repeated(8).unwrap();
    for (gap, missing) in [(1000, 3), (1000, 100), (700, 1), (400, 255), (1300, 17)] {
        for share in [1e-9, 0.01, 0.05] {
            let force = noise::add_white(&force, NoiseLevel::FractionOfRms(share), 5).unwrap();
            let samples = force.channel(0);
            let broken = [&samples[..gap], &samples[gap + missing..]].concat();
            let sampling = sampling.with_len(7 * 256).unwrap();
            let broken = Record::from_channel(sampling, broken[..7 * 256].to_vec()).unwrap();
            let found = claimed_period(&broken, 256).unwrap();
            assert_eq!((found.verdict(), found.value()), (Verdict::Bad, 256.0), "{found}");
            let Finding::WrongPeriod(WrongPeriod {
                fault: PeriodFault::Interruption { sample, .. },
                ..
            }) = found
            else {
                panic!("{found:?}");
            };
            // One or two samples after the gap may agree by chance with the samples one period
            // earlier.
            assert!((gap..gap + 7).contains(&sample), "{gap} {missing}: {sample}");
        }
    }
}

/// The check reports no period for a random force, a constant force, a force that is zero most of
/// the time, and a ramp.
#[test]
fn nothing_is_said_of_a_force_that_does_not_repeat() {
    let sampling = Sampling::new(0.01, 1000).unwrap();
    for seed in 0..50 {
        let random = noise::white(sampling, 1, 1.0, seed).unwrap();
        for period in [1000, 500, 333] {
            let window = random.window(0, 1000 / period * period).unwrap();
            assert_eq!(claimed_period(&window, period), None, "{seed} {period}");
        }
    }
    let of = |values: Vec<f64>| Record::from_channel(sampling, values).unwrap();
    let still = of(vec![0.1; 1000]);
    let hit = of((0..1000).map(|k| f64::from((600..605).contains(&k))).collect());
    let ramp = of((0..1000).map(f64::from).collect());
    for force in [still, hit, ramp] {
        assert_eq!(claimed_period(&force, 1000), None);
    }
}
