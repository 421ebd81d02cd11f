//! If all degrees of freedom are measured, the fit of a machine of elements agrees with the
//! estimator of M, C and K.

use std::f64::consts::TAU;

use mechid_estimate::Unknowns;
use mechid_estimate::frequency_domain::output_error;
use mechid_estimate::likelihood::machine::identify_machine;
use mechid_estimate::likelihood::{LikelihoodEstimate, Settings};
use mechid_model::elements::{
    Bearing, Coefficient, Element, FreeCoefficient, Input, Instruments, Machine, Sensor,
};
use mechid_model::{ResponseQuantity, SecondOrderSystem};
use mechid_problems::RandomTest;
use mechid_problems::steady_lines::eliminated;
use mechid_signal::{NoiseLevel, lines, noise};
use mechid_spectra::{FrequencyData, LineData, LineNoise, NoiseSpectrum, Transient};
use nalgebra::{Complex, DMatrix, dmatrix};

use super::generator::{complex_noise, random_phases};

/// Returns M, C and K of a system with two degrees of freedom; none of the three matrices is
/// symmetric.
fn truth() -> [DMatrix<f64>; 3] {
    [
        dmatrix![10.0, 0.5; 0.2, 8.0],
        dmatrix![30.0, -8.0; -12.0, 25.0],
        dmatrix![2.5e5, -0.9e5; -1.1e5, 3.0e5],
    ]
}

/// Returns a machine with all twelve entries of M, C and K in one element; the initial values are
/// near the truth.
fn machine() -> Machine {
    let start = |matrix: &DMatrix<f64>| {
        [(0, 0), (0, 1), (1, 0), (1, 1)].map(|at: (usize, usize)| {
            Coefficient::Free(FreeCoefficient::from_start(1.1 * matrix[at]))
        })
    };
    let [mass, damping, stiffness] = truth();
    Machine::new(["x", "y"])
        .with("zero x", Element::mass("x", 0.0))
        .with("zero y", Element::mass("y", 0.0))
        .with(
            "all",
            Element::Bearing(Box::new(Bearing {
                at: ["x", "y"].map(str::to_owned),
                to: None,
                stiffness: start(&stiffness),
                damping: start(&damping),
                mass: start(&mass),
            })),
        )
}

fn identified(data: &LineData, quantity: ResponseQuantity) -> LikelihoodEstimate {
    let instruments = Instruments {
        sensors: ["x", "y"].map(|dof| Sensor::new(dof, quantity)).to_vec(),
        inputs: vec![Input::force("x"), Input::force("y")],
        ..Instruments::default()
    };
    let settings = Settings::default();
    identify_machine(data, &machine(), &instruments, &settings).unwrap().likelihood
}

/// Error that remains at the end of a search, in standard errors. A search ends if the predicted
/// decrease of the sum of squares is below 10⁻¹² of this sum. The remaining error is 10⁻⁶ √n
/// standard errors for n residuals; n is about 400.
const SEARCH_END: f64 = 2e-5;

/// Checks that the values agree to `tolerance` times the largest entry of the matrix plus
/// [`SEARCH_END`] standard errors, and that the standard errors agree to 10⁻⁶.
fn check(data: &FrequencyData, likelihood: &LikelihoodEstimate, tolerance: f64) {
    let before = output_error(data, &Unknowns::unknown_mass(2).unwrap()).unwrap();
    let places = [("xx", 0, 0), ("xy", 0, 1), ("yx", 1, 0), ("yy", 1, 1)];
    for old in before.estimate.parameters() {
        let matrix = old.parameter.matrix();
        let (row, column) = (old.parameter.row(), old.parameter.column());
        let place = places.iter().find(|(_, r, c)| (*r, *c) == (row, column)).unwrap().0;
        let new = likelihood.parameter(&format!("all.{}{place}", matrix.letter())).unwrap();
        let error = new.standard_error.unwrap();
        let gap = (new.value - old.value).abs();
        let allowed = tolerance * truth()[matrix as usize].amax() + SEARCH_END * error;
        assert!(gap < allowed, "{}: {:e} standard errors", old.parameter, gap / error);
        let gap = (error / old.standard_error - 1.0).abs();
        assert!(gap < 1e-6, "{}: standard error off by {gap:e}", old.parameter);
    }
}

/// Returns the same noisy amplitudes for both estimators. The forces have noise of standard
/// deviation `force_noise`.
fn both(force_noise: f64, seed: u64) -> (FrequencyData, LineData) {
    let omega: Vec<f64> = (10..=90).map(|line| TAU * 0.5 * f64::from(line)).collect();
    let lines = omega.len();
    let exact = random_phases(lines, 2, seed) * Complex::from(100.0);
    let [m, c, k] = truth();
    let all = eliminated([&m, &c, &k], &omega, &exact);
    let level = 0.001 * all.norm() / ((2 * lines) as f64).sqrt();
    let noise = complex_noise(lines, 4, seed + 500);
    let outputs = &all + noise.columns(0, 2) * Complex::from(level);
    let inputs = &exact + noise.columns(2, 2) * Complex::from(force_noise);
    let variances = [level, level, force_noise, force_noise].map(|s| Complex::from(s * s));
    let covariance = vec![DMatrix::from_diagonal(&variances.to_vec().into()); lines];
    let spectrum = NoiseSpectrum::new(omega.clone(), covariance.clone()).unwrap();
    let old = FrequencyData::from_amplitudes(
        omega.clone(),
        inputs.clone(),
        outputs.clone(),
        ResponseQuantity::Displacement,
    );
    let new = LineData::new(omega, inputs, outputs, Transient::None).unwrap();
    let new = new.with_noise(LineNoise::new(covariance).unwrap()).unwrap();
    (old.unwrap().with_noise(spectrum).unwrap(), new)
}

#[test]
fn known_noise_on_the_response() {
    for seed in 0..3 {
        let (old, new) = both(0.0, seed);
        check(&old, &identified(&new, ResponseQuantity::Displacement), 1e-9);
    }
}

#[test]
fn known_noise_on_forces_and_responses() {
    for seed in 0..3 {
        let (old, new) = both(0.2, seed);
        check(&old, &identified(&new, ResponseQuantity::Displacement), 1e-9);
    }
}

/// Two estimators give the same result for an open record. One describes the transient by loads of
/// order 5 on every degree of freedom, the other by loads of order 1 and a polynomial of order 3
/// for every output; both descriptions span the same space.
#[test]
fn open_records() {
    let rig = RandomTest {
        system: {
            let [m, c, k] = truth();
            SecondOrderSystem::new(m, c, k).unwrap()
        },
        ..super::open::rig()
    };
    let [force, response] = rig.measure(2).unwrap();
    let response = noise::add_white(&response, NoiseLevel::FractionOfRms(0.01), 9).unwrap();
    let band = lines::band(force.sampling(), 3.0, 120.0);
    let band: Vec<usize> = band.into_iter().collect();
    let quantity = rig.quantity;
    let old = FrequencyData::from_records(&force, &response, quantity, band.clone()).unwrap();
    // Each channel has noise of its own level.
    let level = |at| 0.01 * response.data().column(at).norm() / (response.len() as f64).sqrt();
    let levels = [0, 1].map(level);
    let spectrum = NoiseSpectrum::white(rig.sampling, &band, quantity, &levels, &[0.0; 2]).unwrap();
    let omega = old.omega().to_vec();
    let outputs = DMatrix::from_fn(omega.len(), 2, |row, at| {
        old.displacement()[(row, at)] * quantity.per_displacement(omega[row])
    });
    let open = Transient::Open { sample_interval: rig.sampling.dt() };
    let new = LineData::new(omega.clone(), old.force().clone(), outputs, open).unwrap();
    let [x, y] = levels.map(|level| 4.0 * level * level / response.len() as f64);
    let variances = [x, y, 0.0, 0.0].map(Complex::from);
    let covariance = DMatrix::from_diagonal(&variances.to_vec().into());
    let new = new.with_noise(LineNoise::new(vec![covariance; omega.len()]).unwrap()).unwrap();
    let old = old.as_open_record(rig.sampling).with_noise(spectrum).unwrap();
    check(&old, &identified(&new, quantity), 1e-9);
}
