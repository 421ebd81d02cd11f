//! Error rates of the checks after a fit of frequency responses and of spectra.

use mechid_checks::{Finding, Subject, Verdict, after_response_fit, after_spectral_fit, linearity};
use mechid_estimate::frequency_domain::output_error;
use mechid_estimate::{Estimate, EstimateParts, Unknowns};
use mechid_model::{Matrix, ResponseQuantity, SecondOrderSystem};
use mechid_problems::exact_harmonic_periodic;
use mechid_problems::machines::{Support, chain};
use mechid_problems::steady_lines::oscillator;
use mechid_signal::Window;
use mechid_signal::resample::refine;
use mechid_signal::{
    Extent, Interpolation, Multisine, NoiseLevel, Phases, Record, Sampling, noise,
};
use mechid_spectra::frf::{Frf, FrfEstimator, Segments};
use mechid_spectra::{Lines, Pooling, RepeatedPeriods};
use nalgebra::DMatrix;
use rayon::prelude::*;

/// Results of the checks of misfit, whiteness from line to line, and linearity; `true` if all
/// verdicts of a check are good.
fn verdicts(checks: &[Finding]) -> [bool; 3] {
    [Subject::Misfit, Subject::Whiteness, Subject::Linearity].map(|subject| {
        let mut of = checks.iter().filter(|c| c.subject() == subject).peekable();
        assert!(of.peek().is_some(), "no {subject}: {checks:?}");
        of.all(|c| c.verdict() == Verdict::Good)
    })
}

/// Returns, for each check, the share of `runs` experiments in which the check reports a fault.
fn faulted<const N: usize>(runs: u64, check: impl Fn(u64) -> [bool; N] + Sync + Send) -> [f64; N] {
    let found: Vec<[bool; N]> = (0..runs).into_par_iter().map(check).collect();
    let share = |at: usize| found.iter().filter(|good| !good[at]).count() as f64 / runs as f64;
    std::array::from_fn(share)
}

/// Number of samples of each random record.
const LONG: usize = 1 << 13;

struct Random {
    segments: Segments,
    estimator: FrfEstimator,
    /// Noise relative to the RMS of motion and of force.
    noise: [f64; 2],
    mass: Option<f64>,
}

impl Random {
    fn checks(&self, seed: u64, course: impl Fn(&Record) -> Record) -> Vec<Finding> {
        let sampling = Sampling::new(0.02, LONG).unwrap();
        let force = noise::white(sampling, 1, 100.0, 2 * seed).unwrap();
        let add = |record: &Record, level: f64, seed| match level {
            0.0 => record.clone(),
            _ => noise::add_white(record, NoiseLevel::FractionOfRms(level), seed).unwrap(),
        };
        let clean = course(&force);
        let motion = match self.estimator {
            // This estimator assumes equal relative noise on force and motion, so the noise has the
            // spectrum of the motion.
            FrfEstimator::Hv => {
                let other = noise::white(sampling, 1, 100.0, 2 * seed + 1).unwrap();
                let data = clean.data() + linear(&other).data() * self.noise[0];
                Record::new(sampling, data).unwrap()
            }
            _ => add(&clean, self.noise[0], 2 * seed + 1),
        };
        let force = add(&force, self.noise[1], 2 * seed + 1_000_001);
        let kind = ResponseQuantity::Displacement;
        let frf = Frf::estimate(&force, &motion, kind, self.segments, 5..100, self.estimator);
        let frf = frf.unwrap();
        let unknowns = match self.mass {
            Some(mass) => Unknowns::known_mass(&DMatrix::from_element(1, 1, mass)).unwrap(),
            None => Unknowns::unknown_mass(1).unwrap(),
        };
        let found = output_error(&frf.data(&[0]).unwrap(), &unknowns).unwrap().estimate;
        let fitted = found.parameters().len() as f64;
        let mut checks = after_response_fit(&frf, &[0], &found, fitted).unwrap();
        let hz = [5, 100].map(|line| line as f64 / (self.segments.samples() as f64 * 0.02));
        checks.push(linearity(&found, &force, &motion, kind, hz).unwrap());
        checks
    }
}

fn linear(force: &Record) -> Record {
    exact_harmonic_periodic(&oscillator(), force).unwrap().displacement().clone()
}

/// The tests after a fit seldom warn if the model is right. At a level of 1 %, a test warns in 1 of
/// 100 runs on average, with a standard deviation of 1. The test from line to line warns in 2 to 3
/// % of 400 runs, because its statistic is a sum of products of a hundred lines and is not quite
/// normally distributed.
#[test]
fn checks_of_responses_seldom_find_fault_with_a_right_machine() {
    let windowed = |hop, window| Segments::Windowed { len: 512, hop, window };
    for (segments, estimator, noise) in [
        (Segments::hann(512), FrfEstimator::H1, [0.2, 0.0]),
        (windowed(128, Window::Hann), FrfEstimator::H1, [0.2, 0.0]),
        (windowed(256, Window::Blackman), FrfEstimator::H1, [0.2, 0.0]),
        (Segments::hann(512), FrfEstimator::H2, [0.0, 0.2]),
        (Segments::hann(512), FrfEstimator::Hv, [0.2, 0.2]),
    ] {
        let random = Random { segments, estimator, noise, mass: None };
        let rates = faulted(100, |seed| verdicts(&random.checks(seed, linear)));
        assert!(
            rates[0] < 0.04 && rates[1] < 0.06 && rates[2] < 0.04,
            "{segments:?}, {estimator:?}: {rates:?}"
        );
    }
}

#[test]
fn a_wrong_machine_is_found_out_after_a_fit_of_responses() {
    let (segments, estimator) = (Segments::hann(512), FrfEstimator::H1);
    let random = |mass| Random { segments, estimator, noise: [0.05, 0.0], mass };
    for (name, mass, course, shown_by) in [
        ("a mass wrong by 2 %", Some(10.2), linear as fn(&Record) -> Record, [0, 1].as_slice()),
        ("a second mode", None, with_a_second_mass, &[0, 1]),
        // Under a random force a cubic spring looks like a stiffer linear spring with noise.
        ("a cubic spring", None, hardening, &[2]),
    ] {
        let random = random(mass);
        let rates = faulted(40, |seed| verdicts(&random.checks(seed, course)));
        assert!(shown_by.iter().all(|at| rates[*at] > 0.95), "{name}: {rates:?}");
    }
}

/// Returns the solution of m ẍ + c ẋ + k x + k₃ x³ = F from rest, by the classic Runge–Kutta rule
/// with eight steps per sample and a band-limited force. At the RMS displacement of the linear
/// system, the cubic spring adds a tenth to the stiffness.
fn hardening(force: &Record) -> Record {
    let fine = refine(force, 16, Interpolation::BandLimited).unwrap();
    let (f, h) = (fine.channel(0), force.sampling().dt() / 8.0);
    let own = linear(force);
    let cubic = 0.1 * 5000.0 / (own.column(0).norm_squared() / own.len() as f64);
    let rate =
        |[x, v]: [f64; 2], f: f64| [v, (f - 180.0 * v - 5000.0 * x - cubic * x.powi(3)) / 10.0];
    let along = |z: [f64; 2], d: [f64; 2], h: f64| [z[0] + h * d[0], z[1] + h * d[1]];
    let (mut z, mut x) = ([0.0; 2], Vec::with_capacity(force.len()));
    for at in 0..8 * force.len() {
        if at.is_multiple_of(8) {
            x.push(z[0]);
        }
        let f = |half: usize| f[(2 * at + half) % f.len()];
        let k1 = rate(z, f(0));
        let k2 = rate(along(z, k1, 0.5 * h), f(1));
        let k3 = rate(along(z, k2, 0.5 * h), f(1));
        let k4 = rate(along(z, k3, h), f(2));
        z = [0, 1].map(|c| z[c] + h / 6.0 * (k1[c] + 2.0 * (k2[c] + k3[c]) + k4[c]));
    }
    Record::from_channel(force.sampling(), x).unwrap()
}

/// Returns the displacement of the first of two masses. The second mass is not measured; it is a
/// tenth of the first, and its natural frequency on the spring to the first mass is 20 rad/s.
fn with_a_second_mass(force: &Record) -> Record {
    let of = |a: f64, b: f64, c: f64| DMatrix::from_row_slice(2, 2, &[a, b, b, c]);
    let (m, c, k) = (of(10.0, 0.0, 1.0), of(180.0, -2.0, 2.0), of(5400.0, -400.0, 400.0));
    let system = SecondOrderSystem::new(m, c, k).unwrap();
    let zeros = vec![0.0; force.len()];
    let both = Record::from_channels(force.sampling(), &[force.channel(0), &zeros]).unwrap();
    let motion = exact_harmonic_periodic(&system, &both).unwrap();
    Record::from_channel(force.sampling(), motion.displacement().channel(0).to_vec()).unwrap()
}

/// The right model gives 2 warnings in 200 runs on average at a level of 1 %, with a standard
/// deviation of 1.4. A mass wrong by a tenth gives a warning in nearly all runs.
#[test]
fn residuals_of_spectra_are_judged_with_the_noise_of_the_periods() {
    let period = Sampling::new(0.02, 256).unwrap();
    let lines = Lines::new(period, 1..=60).unwrap();
    let force = Multisine::flat(1..=60, 20.0, Phases::Schroeder).unwrap().sample(period).unwrap();
    for (periods, pooling) in [
        (2, Pooling::AllLines),
        (4, Pooling::AllLines),
        (8, Pooling::PerLine),
        (16, Pooling::PerLine),
    ] {
        let force = force.repeated(periods).unwrap();
        let motion = linear(&force);
        let good = |seed, unknowns: &Unknowns| {
            let level = NoiseLevel::FractionOfRms(0.05);
            let noisy = noise::add_white(&motion, level, seed).unwrap();
            let kind = ResponseQuantity::Displacement;
            let all = RepeatedPeriods::new(&lines, &force, &noisy, kind).unwrap();
            let data = all.mean_with_noise(pooling).unwrap();
            let estimate = output_error(&data, unknowns).unwrap().estimate;
            let after = after_spectral_fit(&[data], &estimate, Extent::WholePeriod).unwrap();
            let findings = after.records[0].findings();
            [Subject::Misfit, Subject::Whiteness, Subject::CrossCorrelation].map(|subject| {
                let found = findings.iter().find(|finding| finding.subject() == subject).unwrap();
                found.verdict() == Verdict::Good
            })
        };
        let right = faulted(200, |seed| good(seed, &Unknowns::unknown_mass(1).unwrap()));
        let heavy = Unknowns::known_mass(&DMatrix::from_element(1, 1, 11.0)).unwrap();
        let [wrong, ..] = faulted(40, |seed| good(seed, &heavy));
        assert!(right.iter().all(|share| *share <= 0.035), "{periods} periods: {right:?}");
        assert!(wrong > 0.95, "{periods} periods, a mass wrong by a tenth: {wrong}");
    }
}

/// Returns the finding of [`linearity`] for eight masses in a row, all of them measured and two of
/// them driven, with noise on forces and responses. The first mass has a cubic spring, whose effect
/// is simulated to first order. At the RMS displacement of the first mass, the stiffness of this
/// spring is `cubic` times the first diagonal entry of the stiffness matrix.
fn eight_sensors(cubic: f64, seed: u64) -> Finding {
    let system = chain(8, Support::Fixed, 0.02, 5);
    let sampling = Sampling::new(0.01, 1 << 12).unwrap();
    let drive = noise::white(sampling, 2, 100.0, 3 * seed).unwrap();
    let on_all = |drive: &Record| {
        let silent = vec![0.0; drive.len()];
        let mut channels = vec![&silent[..]; 8];
        (channels[1], channels[6]) = (drive.channel(0), drive.channel(1));
        Record::from_channels(sampling, &channels).unwrap()
    };
    let force = on_all(&drive);
    let moved =
        |force: &Record| exact_harmonic_periodic(&system, force).unwrap().displacement().clone();
    let x = moved(&force);
    let square = x.column(0).norm_squared() / x.len() as f64;
    let stiffness = cubic * system.stiffness()[(0, 0)] / square;
    let mut loaded = force.data().clone();
    for (load, x) in loaded.column_mut(0).iter_mut().zip(x.channel(0)) {
        *load -= stiffness * x.powi(3);
    }
    let motion = moved(&Record::new(sampling, loaded).unwrap());
    let noisy = |record: &Record, level: f64, seed: u64| {
        noise::add_white(record, NoiseLevel::FractionOfRms(level), seed).unwrap()
    };
    let force = on_all(&noisy(&drive, 0.02, 3 * seed + 1));
    let motion = noisy(&motion, 0.002, 3 * seed + 2);
    // All entries are known except the first two diagonal entries of the stiffness.
    let mut unknowns = Unknowns::known_mass(system.mass()).unwrap();
    for matrix in [Matrix::Damping, Matrix::Stiffness] {
        for row in 0..8 {
            for column in 0..8 {
                if matrix == Matrix::Damping || row != column || row > 1 {
                    let value = system.matrix(matrix)[(row, column)];
                    unknowns = unknowns.fix(matrix, row, column, value).unwrap();
                }
            }
        }
    }
    let estimate = Estimate::new(EstimateParts {
        values: [0, 1].map(|at| system.stiffness()[(at, at)]).to_vec(),
        covariance: DMatrix::identity(2, 2).into(),
        degrees_of_freedom: 1000,
        residual_nrmse: vec![0.02; 8],
        condition: 1.0,
        undetermined: Vec::new(),
        unknowns,
    });
    let kind = ResponseQuantity::Displacement;
    linearity(&estimate.unwrap(), &force, &motion, kind, [0.5, 25.0]).unwrap()
}

/// The test of linearity reports a cubic spring, but not noise on the forces. This noise affects
/// all eight responses; they are not eight independent observations. The tested estimate has the
/// true parameters. At a level of 1 %, the probability of a warning in more than 3 of 60 runs is
/// 0.003.
#[test]
fn noise_on_the_forces_of_eight_sensors_is_no_nonlinearity() {
    let warned = |cubic: f64, runs: u64| {
        let is_bad = |seed: &u64| eight_sensors(cubic, *seed).verdict() > Verdict::Good;
        (0..runs).into_par_iter().filter(is_bad).count()
    };
    let (right, wrong) = (warned(0.0, 60), warned(0.1, 12));
    assert!(right <= 3, "{right} of 60");
    assert!(wrong >= 11, "{wrong} of 12");
}
