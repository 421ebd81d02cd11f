//! Tests of the threshold: whirl frequency and critical mass are compared with the eigenvalues of
//! the rotor, and standard errors with the scatter of drawn coefficients.

use mechid_bearing::{Bore, Coefficients, FiniteBearing, ShortBearing, Threshold};
use mechid_model::{JournalBearing, KyxSign, OilFilm};
use nalgebra::DMatrix;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

fn film(coefficients: &Coefficients) -> OilFilm {
    let [[kxx, kxy], [kyx, kyy]] = coefficients.stiffness;
    let [[cxx, cxy], [cyx, cyy]] = coefficients.damping;
    OilFilm { kxx, kxy, kyx, kyy, cxx, cxy, cyx, cyy }
}

/// Returns the largest real part of the eigenvalues, and the frequency of the eigenvalue with this
/// part.
fn least_stable(film: OilFilm, mass: f64) -> [f64; 2] {
    let rotor = JournalBearing::new(mass, film, KyxSign::Plus).unwrap().system();
    let modes = rotor.modes().unwrap();
    let eigenvalues = modes.iter().map(|mode| mode.eigenvalue());
    let worst = eigenvalues.max_by(|a, b| a.re.total_cmp(&b.re)).unwrap();
    [worst.re, worst.im.abs()]
}

#[test]
fn at_the_critical_mass_an_eigenvalue_is_imaginary() {
    let short = |e: f64| ShortBearing::new(0.5).unwrap().at_eccentricity(e).unwrap();
    let groove = Bore::two_axial_grooves(0.35).unwrap();
    let finite = FiniteBearing::new(groove, 1.0).unwrap().equilibrium(0.3).unwrap();
    for equilibrium in [short(0.05), short(0.4), short(0.7), finite] {
        let film = film(equilibrium.coefficients());
        let threshold = Threshold::new(&film, 1.0).unwrap();
        let mass = threshold.critical_mass().unwrap();
        let [growth, frequency] = least_stable(film, mass);
        assert!(growth.abs() < 1e-10, "{growth}");
        assert!((frequency - threshold.whirl_frequency_ratio().unwrap()).abs() < 1e-10);
        assert!(
            least_stable(film, 0.99 * mass)[0] < 0.0 && least_stable(film, 1.01 * mass)[0] > 0.0
        );
        let speed = threshold.speed(mass / 4.0).unwrap().unwrap();
        assert!((speed - 2.0).abs() < 1e-12);
    }
}

/// A heavily loaded film keeps rotors of any mass stable.
#[test]
fn there_may_be_no_threshold() {
    let equilibrium = ShortBearing::new(0.5).unwrap().at_eccentricity(0.85).unwrap();
    let film = film(equilibrium.coefficients());
    let threshold = Threshold::new(&film, 1.0).unwrap();
    assert!(threshold.whirl_frequency_ratio_squared() < 0.0);
    assert_eq!(threshold.whirl_frequency_ratio(), None);
    assert_eq!(threshold.critical_mass(), None);
    assert_eq!(threshold.speed(1.0), Ok(None));
    for mass in [1e-3, 1.0, 1e3, 1e6] {
        assert!(least_stable(film, mass)[0] < 0.0);
    }
    let errors = threshold.standard_errors(&DMatrix::identity(8, 8)).unwrap();
    assert_eq!((errors.whirl_frequency_ratio, errors.critical_mass), (None, None));
}

/// Standard errors by the delta method agree with the scatter of drawn coefficients, which are
/// correlated and of unequal size.
#[test]
fn standard_errors_are_those_of_the_scatter() {
    let conditions = ShortBearing::new(0.5).unwrap().at_eccentricity(0.4).unwrap();
    let truth = film(conditions.coefficients());
    let OilFilm { kxx, kxy, kyx, kyy, cxx, cxy, cyx, cyy } = truth;
    let truth = [kxx, kxy, kyx, kyy, cxx, cxy, cyx, cyy];
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(18);
    let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
    let factor = DMatrix::from_fn(8, 8, |_, _| 0.002 * normal());
    let covariance = &factor * factor.transpose();
    let of = |v: [f64; 8]| {
        let [kxx, kxy, kyx, kyy, cxx, cxy, cyx, cyy] = v;
        Threshold::new(&OilFilm { kxx, kxy, kyx, kyy, cxx, cxy, cyx, cyy }, 2.0).unwrap()
    };
    let stated = of(truth).standard_errors(&covariance).unwrap();
    let draws = 20_000;
    let mut sums = [[0.0; 2]; 3];
    for _ in 0..draws {
        let drawn = &factor * DMatrix::from_fn(8, 1, |_, _| normal());
        let threshold = of(std::array::from_fn(|i| truth[i] + drawn[i]));
        let values = [
            threshold.equivalent_stiffness(),
            threshold.whirl_frequency_ratio().unwrap(),
            threshold.critical_mass().unwrap(),
        ];
        for (sum, value) in sums.iter_mut().zip(values) {
            sum[0] += value;
            sum[1] += value * value;
        }
    }
    let expected = [
        stated.equivalent_stiffness,
        stated.whirl_frequency_ratio.unwrap(),
        stated.critical_mass.unwrap(),
    ];
    for ([sum, squares], expected) in sums.into_iter().zip(expected) {
        let mean = sum / f64::from(draws);
        let scatter = (squares / f64::from(draws) - mean * mean).sqrt();
        // The limit is four standard errors of the scatter of this number of draws, plus the error
        // of second order of the delta method.
        assert!((scatter / expected - 1.0).abs() < 0.025, "{scatter} {expected}");
    }
}
