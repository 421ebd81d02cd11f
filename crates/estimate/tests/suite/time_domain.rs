//! Time-domain estimators on exact responses to forces that are held or linear between samples.

use mechid_estimate::time_domain::{TimeDomain, Transitions, equation_of_motion};
use mechid_estimate::{Estimate, EstimateError, Unknowns};
use mechid_model::{
    Discretisation, InitialState, KyxSign, Matrix, Response, Sdof, SecondOrderSystem, npi_sampling,
};
use mechid_numerics::NumericsError;
use mechid_numerics::logarithm::logarithm;
use mechid_problems::{
    dissertation_bearing, dissertation_sdof, exact_foh, exact_foh_periodic,
    exact_harmonic_periodic, exact_zoh, exact_zoh_periodic, random_stable,
};
use mechid_signal::{Extent, Interpolation, Multisine, Phases, Record, Sampling};
use nalgebra::{DMatrix, dmatrix};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use Discretisation::{Euler, FirstOrderHold, ZeroOrderHold};

/// Returns white forces on all degrees of freedom.
fn white(sampling: Sampling, dof: usize, seed: u64) -> Record {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let data = DMatrix::from_fn(sampling.len(), dof, |_, _| random.random_range(-50.0..50.0));
    Record::new(sampling, data).unwrap()
}

fn fit(
    method: Discretisation,
    extent: Extent,
    motion: &Response,
    force: &Record,
    unknowns: &Unknowns,
) -> Estimate {
    TimeDomain::new(method, extent)
        .fit(motion.displacement(), motion.velocity(), force, unknowns)
        .unwrap()
        .into_estimate()
}

/// Largest error of M, C or K, relative to the largest entry of that matrix.
fn error(found: &Estimate, system: &SecondOrderSystem) -> f64 {
    let pairs = [
        (found.mass(), system.mass()),
        (found.damping(), system.damping()),
        (found.stiffness(), system.stiffness()),
    ];
    pairs.iter().map(|(a, b)| (a - *b).amax() / b.amax()).fold(0.0, f64::max)
}

/// Returns systems with their names and time steps (s): ten to twenty samples per period of the
/// fastest mode.
fn machines() -> Vec<(&'static str, SecondOrderSystem, f64)> {
    let bearing = |sign| dissertation_bearing(sign).system();
    vec![
        ("single oscillator", dissertation_sdof().system(), 0.02),
        ("bearing, Kyx minus", bearing(KyxSign::Minus), 0.2),
        ("bearing, Kyx plus", bearing(KyxSign::Plus), 0.2),
        ("five masses", random_stable(5, 7), 0.005),
        ("five other masses", random_stable(5, 8), 0.005),
    ]
}

/// Maximum relative error of an estimate that counts as exact in these tests.
const EXACT: f64 = 1e-8;

#[test]
fn held_and_linear_forces_give_the_machine_back_exactly() {
    for (name, system, dt) in machines() {
        let sampling = Sampling::new(dt, 512).unwrap();
        let force = white(sampling, system.dof(), 1);
        let rest = InitialState::rest(system.dof());
        let cases = [
            (ZeroOrderHold, Extent::WholePeriod, exact_zoh_periodic(&system, &force).unwrap()),
            (ZeroOrderHold, Extent::Open, exact_zoh(&system, &force, &rest).unwrap()),
            (FirstOrderHold, Extent::WholePeriod, exact_foh_periodic(&system, &force).unwrap()),
            (FirstOrderHold, Extent::Open, exact_foh(&system, &force, &rest).unwrap()),
        ];
        let known = Unknowns::known_mass(system.mass()).unwrap();
        let unknown = Unknowns::unknown_mass(system.dof()).unwrap();
        for (method, extent, motion) in &cases {
            for unknowns in [&known, &unknown] {
                let found = fit(*method, *extent, motion, &force, unknowns);
                let got = error(&found, &system);
                assert!(got < EXACT, "{name}, {method:?}, {extent:?}: {got:e}");
                assert!(found.undetermined().is_empty());
            }
        }
    }
}

#[test]
fn entries_that_are_known_are_held() {
    let system = dissertation_bearing(KyxSign::Minus).system();
    let force = white(Sampling::new(0.2, 400).unwrap(), 2, 3);
    let motion = exact_zoh_periodic(&system, &force).unwrap();
    // The masses are unknown, the mass matrix is diagonal, and one coupling of the damping is
    // known.
    let unknowns = Unknowns::unknown_mass(2)
        .and_then(|u| u.fix(Matrix::Mass, 0, 1, 0.0))
        .and_then(|u| u.fix(Matrix::Mass, 1, 0, 0.0))
        .and_then(|u| u.fix(Matrix::Damping, 0, 1, 10.0))
        .unwrap();
    let found = fit(ZeroOrderHold, Extent::WholePeriod, &motion, &force, &unknowns);
    assert!(error(&found, &system) < EXACT);
    assert_eq!(found.parameters().len(), 2 + 3 + 4);
}

#[test]
fn a_force_that_is_zero_is_left_out() {
    let system = dissertation_bearing(KyxSign::Minus).system();
    let mut data = white(Sampling::new(0.2, 400).unwrap(), 2, 3).into_data();
    data.column_mut(0).fill(0.0);
    let force = Record::new(Sampling::new(0.2, 400).unwrap(), data).unwrap();
    let motion = exact_foh_periodic(&system, &force).unwrap();
    let known = Unknowns::known_mass(system.mass()).unwrap();
    let found = fit(FirstOrderHold, Extent::WholePeriod, &motion, &force, &known);
    assert!(error(&found, &system) < EXACT);
    // No force acts in the first direction. If the mass is unknown, the equation of motion in this
    // direction is determined only up to a factor, and the fit returns an error.
    let estimator = TimeDomain::new(FirstOrderHold, Extent::WholePeriod);
    let unknown = Unknowns::unknown_mass(2).unwrap();
    let refused = estimator.fit(motion.displacement(), motion.velocity(), &force, &unknown);
    assert!(matches!(refused, Err(EstimateError::OnlyRatios { dof: 1, .. })), "{refused:?}");
}

/// Returns exp(AΔt) − I by its Taylor series: the reference for the bias of Euler's rule.
fn increment(system: &SecondOrderSystem, dt: f64) -> DMatrix<f64> {
    let small = system.state_matrix() * (dt / 1024.0);
    let mut term = small.clone();
    let mut sum = small.clone();
    for k in 2..=12 {
        term = &term * &small / k as f64;
        sum += &term;
    }
    for _ in 0..10 {
        sum = &sum * 2.0 + &sum * &sum;
    }
    sum
}

#[test]
fn the_bias_of_euler_is_that_of_one_plus_a_dt_and_shrinks_with_npi() {
    let systems = [
        (dissertation_sdof().system(), 22.360679775),
        (dissertation_bearing(KyxSign::Minus).system(), 1.799248),
    ];
    for (system, omega_n) in systems {
        let n = system.dof();
        let known = Unknowns::known_mass(system.mass()).unwrap();
        let mut last = f64::INFINITY;
        for npi in [16.0, 8.0, 4.0, 2.0, 1.0] {
            let sampling = npi_sampling(npi, 256, omega_n).unwrap();
            let force = white(sampling, n, 5);
            let motion = exact_zoh_periodic(&system, &force).unwrap();
            let found = fit(Euler, Extent::WholePeriod, &motion, &force, &known);
            let step = increment(&system, sampling.dt()) / sampling.dt();
            let k = -(system.mass() * step.view((n, 0), (n, n)));
            let c = -(system.mass() * step.view((n, n), (n, n)));
            assert!((found.stiffness() - &k).amax() < 1e-10 * k.amax(), "NPI {npi}");
            assert!((found.damping() - &c).amax() < 1e-10 * c.amax(), "NPI {npi}");
            let bias = error(&found, &system);
            assert!(bias < 0.7 * last, "NPI {npi}: {bias}");
            last = bias;
        }
        // At NPI = 1, the record of 256 samples is one natural period. The error is of the order of
        // ωn Δt = 2π/256.
        assert!((1e-3..0.1).contains(&last));
    }
}

/// Intermediate points of a band-limited period equal the samples of a faster recorder, so the
/// refined record gives the same estimate as a faster record.
#[test]
fn a_refined_record_is_as_good_as_a_faster_one() {
    let system = dissertation_bearing(KyxSign::Minus).system();
    let known = Unknowns::known_mass(system.mass()).unwrap();
    let measured = |samples: usize| {
        let sampling = npi_sampling(8.0, samples, 1.799248).unwrap();
        let channel = |seed| {
            let multisine = Multisine::flat(1..=60, 5.0, Phases::Random { seed }).unwrap();
            multisine.sample(sampling).unwrap().channel(0).to_vec()
        };
        let force = Record::from_channels(sampling, &[channel(1), channel(2)]).unwrap();
        (exact_harmonic_periodic(&system, &force).unwrap(), force)
    };
    let (motion, force) = measured(256);
    let (faster, faster_force) = measured(8 * 256);
    let wanted = fit(Euler, Extent::WholePeriod, &faster, &faster_force, &known);
    let refined = |factor, interpolation| {
        let records = [motion.displacement(), motion.velocity(), &force];
        let euler = TimeDomain::new(Euler, Extent::WholePeriod);
        euler.fit_refined(records, &known, factor, interpolation).unwrap().into_estimate()
    };
    let gap = |a: &Estimate, b: &Estimate| {
        (a.stiffness() - b.stiffness()).amax() / system.stiffness().amax()
    };
    assert!(gap(&refined(8, Interpolation::BandLimited), &wanted) < 1e-9);
    // The highest line has 4 samples per cycle, where a spline is wrong by a few per cent.
    assert!(gap(&refined(8, Interpolation::NotAKnotSpline), &wanted) < 0.1);
    let once = refined(1, Interpolation::BandLimited);
    assert!(error(&wanted, &system) < error(&once, &system) / 4.0);
}

#[test]
fn measured_accelerations_need_no_discretisation() {
    for (name, system, dt) in machines() {
        let force = white(Sampling::new(20.0 * dt, 300).unwrap(), system.dof(), 9);
        let motion = exact_zoh_periodic(&system, &force).unwrap();
        for unknowns in [
            Unknowns::known_mass(system.mass()).unwrap(),
            Unknowns::unknown_mass(system.dof()).unwrap(),
        ] {
            let found = equation_of_motion(&motion, &force, &unknowns).unwrap();
            assert!(error(&found, &system) < 1e-10, "{name}");
        }
    }
}

#[test]
fn pieces_and_several_records_are_one_fit() {
    let system = dissertation_bearing(KyxSign::Plus).system();
    let force = white(Sampling::new(0.2, 900).unwrap(), 2, 11);
    let start = InitialState::rest(2);
    let motion = exact_foh(&system, &force, &start).unwrap();
    let known = Unknowns::known_mass(system.mass()).unwrap();
    let whole = fit(Euler, Extent::Open, &motion, &force, &known);
    let mut pieces = Transitions::new(2, 0.2).unwrap();
    let mut second = Transitions::new(2, 0.2).unwrap();
    for (start, len) in [(0, 400), (399, 101), (499, 401)] {
        let cut = |r: &Record| r.window(start, len).unwrap();
        let rows = if start < 499 { &mut pieces } else { &mut second };
        rows.push(&cut(motion.displacement()), &cut(motion.velocity()), &cut(&force), Extent::Open)
            .unwrap();
    }
    pieces.merge(&second).unwrap();
    assert_eq!(pieces.rows(), 899);
    let found = pieces.fit(Euler, &known).unwrap().into_estimate();
    for (a, b) in whole.parameters().zip(found.parameters()) {
        assert!((a.value - b.value).abs() < 1e-8 * a.standard_error);
        assert!((b.standard_error / a.standard_error - 1.0).abs() < 1e-9);
    }
}

#[test]
fn what_is_not_excited_is_named_and_the_rest_stays_right() {
    // Two oscillators; the first one does not drive the second, which stays at rest.
    let system = SecondOrderSystem::new(
        dmatrix![2.0, 0.0; 0.0, 3.0],
        dmatrix![1.0, 0.7; 0.0, 2.0],
        dmatrix![80.0, 5.0; 0.0, 90.0],
    )
    .unwrap();
    let sampling = Sampling::new(0.05, 300).unwrap();
    let mut data = white(sampling, 2, 1).into_data();
    data.column_mut(1).fill(0.0);
    let force = Record::new(sampling, data).unwrap();
    let motion = exact_zoh_periodic(&system, &force).unwrap();
    let known = Unknowns::known_mass(system.mass()).unwrap();
    let found = fit(ZeroOrderHold, Extent::WholePeriod, &motion, &force, &known);
    for (name, value) in [("k11", 80.0), ("c11", 1.0), ("k21", 0.0), ("c21", 0.0)] {
        assert!((found.parameter(name).unwrap().value - value).abs() < 1e-8 * 80.0, "{found}");
    }
    let Err(EstimateError::Undetermined { parameters, .. }) = found.system() else { panic!() };
    assert_eq!(parameters, "c12, c22, k12, k22");
}

#[test]
fn an_undersampled_machine_is_explained() {
    // A lightly damped mode that is sampled twice per period alternates in sign.
    let oscillator = Sdof::from_modal(1.0, 0.02, 20.0).unwrap();
    let dt = std::f64::consts::PI / oscillator.damped_frequency();
    let force = white(Sampling::new(dt, 200).unwrap(), 1, 2);
    let motion = exact_zoh_periodic(&oscillator.system(), &force).unwrap();
    let known = Unknowns::known_mass(&dmatrix![1.0]).unwrap();
    let estimator = TimeDomain::new(ZeroOrderHold, Extent::WholePeriod);
    let refused = estimator.fit(motion.displacement(), motion.velocity(), &force, &known);
    let Err(EstimateError::Numerics(NumericsError::NoLogarithm { eigenvalue })) = refused else {
        panic!("{refused:?}")
    };
    let expected = -(-0.02f64 * 20.0 * dt).exp();
    assert!((eigenvalue - expected).abs() < 1e-6);
    assert!(logarithm(&dmatrix![eigenvalue]).is_err());
}

#[test]
fn records_that_do_not_belong_together_are_refused() {
    let system = dissertation_sdof().system();
    let force = white(Sampling::new(0.02, 100).unwrap(), 1, 2);
    let motion = exact_zoh_periodic(&system, &force).unwrap();
    let mut rows = Transitions::new(1, 0.03).unwrap();
    let got = rows.push(motion.displacement(), motion.velocity(), &force, Extent::Open);
    assert_eq!(got, Err(EstimateError::Step { expected: 0.03, got: 0.02 }));
    let known = Unknowns::known_mass(system.mass()).unwrap();
    let estimator = TimeDomain::new(Euler, Extent::Open);
    let short = force.window(0, 50).unwrap();
    assert!(estimator.fit(motion.displacement(), motion.velocity(), &short, &known).is_err());
    let two = Unknowns::unknown_mass(2).unwrap();
    assert!(estimator.fit(motion.displacement(), motion.velocity(), &force, &two).is_err());
    assert_eq!(Transitions::new(0, 0.1).unwrap_err(), EstimateError::NoDof);
}

/// In 300 experiments with white disturbances of the state, 95 % of the intervals contain the
/// truth, also for parameters from the logarithm of the transition matrix. The coverage of one
/// parameter has a binomial standard deviation of 1.3 %; the tolerance of 5 % is four times this
/// value.
#[test]
fn intervals_hold_through_the_logarithm() {
    let system = dissertation_bearing(KyxSign::Minus).system();
    let (dt, samples) = (0.3, 400);
    let states = increment(&system, dt) + DMatrix::identity(4, 4);
    let sampling = Sampling::new(dt, samples).unwrap();
    // One exact step from rest under a unit force on one direction gives one column of Γ of a held
    // force.
    let gamma: Vec<_> = (0..2)
        .map(|direction| {
            let unit = Record::new(
                sampling,
                DMatrix::from_fn(samples, 2, |_, j| f64::from(j == direction)),
            );
            let step = exact_zoh(&system, &unit.unwrap(), &InitialState::rest(2)).unwrap();
            let at = |r: &Record, i: usize| r.data()[(1, i)];
            let (x, v) = (step.displacement(), step.velocity());
            nalgebra::DVector::from_vec(vec![at(x, 0), at(x, 1), at(v, 0), at(v, 1)])
        })
        .collect();
    let gamma = DMatrix::from_columns(&gamma);
    let known = Unknowns::known_mass(system.mass()).unwrap();
    let partly = Unknowns::unknown_mass(2)
        .and_then(|u| u.fix(Matrix::Mass, 0, 1, 0.0))
        .and_then(|u| u.fix(Matrix::Mass, 1, 0, 0.0))
        .unwrap();
    for unknowns in [known, partly] {
        let runs = 300;
        let truth: Vec<f64> = unknowns
            .free()
            .iter()
            .map(|p| system.matrix(p.matrix())[(p.row(), p.column())])
            .collect();
        let mut inside = vec![0; truth.len()];
        for run in 0..runs {
            let force = white(sampling, 2, run);
            let mut random = ChaCha8Rng::seed_from_u64(1000 + run);
            let mut state = nalgebra::DVector::zeros(4);
            let mut motion = DMatrix::zeros(samples, 4);
            for k in 0..samples {
                motion.set_row(k, &state.transpose());
                let disturbance =
                    nalgebra::DVector::from_fn(4, |_, _| random.random_range(-0.3..0.3));
                let f = force.data().row(k).transpose();
                state = &states * state + &gamma * f + disturbance;
            }
            let part =
                |from: usize| Record::new(sampling, motion.columns(from, 2).into_owned()).unwrap();
            let found = TimeDomain::new(ZeroOrderHold, Extent::Open)
                .fit(&part(0), &part(2), &force, &unknowns)
                .unwrap();
            for (at, p) in found.estimate().parameters().enumerate() {
                let [low, high] = p.interval(0.95).unwrap();
                inside[at] += usize::from(low < truth[at] && truth[at] < high);
            }
        }
        for (count, p) in inside.iter().zip(unknowns.free()) {
            let share = *count as f64 / runs as f64;
            assert!((0.90..=1.0).contains(&share), "{p}: {share}");
        }
        let mean = inside.iter().sum::<usize>() as f64 / (runs as f64 * truth.len() as f64);
        assert!((0.93..0.97).contains(&mean), "{mean}");
    }
}
