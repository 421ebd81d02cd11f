//! Changes that must not affect a time-domain estimate: units, numbering, the directions of the
//! axes.

use mechid_estimate::time_domain::TimeDomain;
use mechid_estimate::{Estimate, Unknowns};
use mechid_model::{Discretisation, KyxSign, Matrix};
use mechid_problems::{dissertation_bearing, exact_zoh_periodic};
use mechid_signal::{Extent, NoiseLevel, Record, Sampling, noise};
use nalgebra::{DMatrix, dmatrix};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const METHODS: [Discretisation; 3] =
    [Discretisation::Euler, Discretisation::ZeroOrderHold, Discretisation::FirstOrderHold];

/// x, ẋ and F of the bearing with a little noise, so that the standard errors are meaningful.
fn measured(seed: u64) -> [Record; 3] {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let sampling = Sampling::new(0.2, 200).unwrap();
    let data = DMatrix::from_fn(200, 2, |_, _| random.random_range(-50.0..50.0));
    let force = Record::new(sampling, data).unwrap();
    let system = dissertation_bearing(KyxSign::Minus).system();
    let motion = exact_zoh_periodic(&system, &force).unwrap();
    let noisy = |r: &Record, s: u64| {
        noise::add_white(r, NoiseLevel::FractionOfRms(0.001), seed + s).unwrap()
    };
    [noisy(motion.displacement(), 1), noisy(motion.velocity(), 2), force]
}

fn fit(method: Discretisation, [x, v, f]: &[Record; 3], unknowns: &Unknowns) -> Estimate {
    TimeDomain::new(method, Extent::WholePeriod).fit(x, v, f, unknowns).unwrap().into_estimate()
}

fn mapped(record: &Record, sampling: Sampling, map: &DMatrix<f64>) -> Record {
    Record::new(sampling, record.data() * map.transpose()).unwrap()
}

/// Returns unknowns with this mass matrix if `known`, otherwise unknowns with a free mass matrix.
fn unknowns(mass: &DMatrix<f64>, known: bool) -> Unknowns {
    if known { Unknowns::known_mass(mass).unwrap() } else { Unknowns::unknown_mass(2).unwrap() }
}

/// Maximum relative difference between estimates that must be equal. It is above the rounding error
/// times the condition number of the regressors (below 1e3), and far below the noise of 1e-3.
const SAME: f64 = 1e-8;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn units(seed in 0u64..1000, length in -6..7i32, time in -4..5i32, force in -4..5i32, known: bool) {
        let [length, time, newton] = [length, time, force].map(|power| 10f64.powi(power));
        let data = measured(seed);
        let mass = DMatrix::from_diagonal_element(2, 2, 14.8);
        let sampling = Sampling::new(0.2 * time, 200).unwrap();
        let scaled = |r: &Record, by: f64| {
            mapped(r, sampling, &DMatrix::from_diagonal_element(2, 2, by))
        };
        let other = [
            scaled(&data[0], length),
            scaled(&data[1], length / time),
            scaled(&data[2], newton),
        ];
        let unit = |matrix| match matrix {
            Matrix::Mass => newton / length * time * time,
            Matrix::Damping => newton / length * time,
            Matrix::Stiffness => newton / length,
        };
        for method in METHODS {
            let before = fit(method, &data, &unknowns(&mass, known));
            let after = fit(method, &other, &unknowns(&(&mass * unit(Matrix::Mass)), known));
            for (a, b) in before.parameters().zip(after.parameters()) {
                let unit = unit(a.parameter.matrix());
                prop_assert!((b.value / unit - a.value).abs() < SAME * a.standard_error);
                prop_assert!((b.standard_error / unit / a.standard_error - 1.0).abs() < SAME);
            }
        }
    }

    /// If the axes are rotated, the identified matrices are rotated; if the axes are exchanged, the
    /// indices of their entries are exchanged.
    #[test]
    fn directions(seed in 0u64..1000, angle in -3.1..3.1f64, exchange: bool, known: bool) {
        let (s, c) = angle.sin_cos();
        let turn = if exchange { dmatrix![0.0, 1.0; 1.0, 0.0] } else { dmatrix![c, -s; s, c] };
        let data = measured(seed);
        let mass = dmatrix![14.8, 0.0; 0.0, 14.8];
        let other = [0, 1, 2].map(|i| mapped(&data[i], data[i].sampling(), &turn));
        for method in METHODS {
            let before = fit(method, &data, &unknowns(&mass, known));
            let after = fit(method, &other, &unknowns(&mass, known));
            let pairs = [
                (before.mass(), after.mass()),
                (before.damping(), after.damping()),
                (before.stiffness(), after.stiffness()),
            ];
            for (a, b) in pairs {
                let back = turn.tr_mul(&b) * &turn;
                prop_assert!((back - &a).amax() < SAME * a.amax());
            }
            if exchange {
                for (ours, theirs) in [("k12", "k21"), ("c11", "c22")] {
                    let (a, b) = (before.parameter(ours).unwrap(), after.parameter(theirs).unwrap());
                    prop_assert!((b.standard_error / a.standard_error - 1.0).abs() < SAME);
                }
            }
        }
    }

    /// If the same period is used twice, the parameters do not change. Their variances are
    /// multiplied by the ratio of the degrees of freedom of the residual (one period to two
    /// periods), which is about ½.
    #[test]
    fn a_record_twice(seed in 0u64..1000) {
        let data = measured(seed);
        let twice = [0, 1, 2].map(|i| data[i].repeated(2).unwrap());
        let known = unknowns(&dmatrix![14.8, 0.0; 0.0, 14.8], true);
        for method in METHODS {
            let (once, twice) = (fit(method, &data, &known), fit(method, &twice, &known));
            let ratio = once.degrees_of_freedom() as f64 / twice.degrees_of_freedom() as f64;
            for (a, b) in once.parameters().zip(twice.parameters()) {
                prop_assert!((a.value - b.value).abs() < SAME * a.standard_error);
                let variances = (b.standard_error / a.standard_error).powi(2);
                prop_assert!((variances / ratio - 1.0).abs() < SAME);
            }
        }
    }
}
