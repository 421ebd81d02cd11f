//! All schemes with all their conventions, and functions to compare responses.

use mechid_integrate::*;
use mechid_model::{InitialState, Response, SecondOrderSystem};
use mechid_signal::{Record, Sampling};
use nalgebra::DMatrix;

/// Returns every scheme, in each convention that needs the force only at its samples.
pub fn schemes() -> Vec<Box<dyn Scheme>> {
    let wilson = WilsonTheta::new(1.4).unwrap();
    vec![
        Box::new(Newmark::AVERAGE_ACCELERATION),
        Box::new(Newmark::LINEAR_ACCELERATION),
        Box::new(Newmark::FOX_GOODWIN),
        Box::new(Newmark::CENTRAL_DIFFERENCE),
        Box::new(Newmark::new(0.3025, 0.6).unwrap()),
        Box::new(CentralDifference::default()),
        Box::new(CentralDifference { start: CentralDifferenceStart::Rest }),
        Box::new(Houbolt::default()),
        Box::new(Houbolt { start: HouboltStart::CentralDifference }),
        Box::new(wilson),
        Box::new(wilson.with_load(WilsonLoad::Interpolated)),
        Box::new(RungeKutta4::HELD),
        Box::new(RungeKutta4::LINEAR),
        Box::new(GeneralisedAlpha::new(0.8).unwrap()),
        Box::new(GeneralisedAlpha::new(0.0).unwrap()),
        Box::new(GeneralisedAlpha::new(0.5).unwrap().with_acceleration(AlphaAcceleration::Carried)),
        Box::new(GeneralisedAlpha::hilber_hughes_taylor(0.7).unwrap()),
        Box::new(GeneralisedAlpha::wood_bossak_zienkiewicz(0.5).unwrap()),
        Box::new(Bathe::HALVES),
        Box::new(Bathe::new(0.6).unwrap()),
        Box::new(MatrixExponential::HELD),
        Box::new(MatrixExponential::LINEAR),
    ]
}

/// Nonlinear terms as a force, with degrees of freedom counted from 1: `terms("k3: x1^3", &[3.0])`.
pub fn terms(text: &str, coefficients: &[f64]) -> TermForces {
    TermForces::new(&text.parse().unwrap(), coefficients).unwrap()
}

/// A force that is not zero at t = 0, on every channel: two harmonics and a constant, with
/// different phases on each channel.
pub fn force_at(t: f64, f: &mut [f64]) {
    for (c, f) in f.iter_mut().enumerate() {
        let c = c as f64;
        *f = 3.0 * (2.0 * t + 0.3 + c).cos() + (5.1 * t - c).sin() + 0.7;
    }
}

/// Samples of [`force_at`].
pub fn force(sampling: Sampling, dof: usize) -> Record {
    let mut data = DMatrix::zeros(sampling.len(), dof);
    let mut row = vec![0.0; dof];
    for k in 0..sampling.len() {
        force_at(sampling.time(k), &mut row);
        data.row_mut(k).iter_mut().zip(&row).for_each(|(d, f)| *d = *f);
    }
    Record::new(sampling, data).unwrap()
}

/// Initial state with non-zero x(0) and ẋ(0).
pub fn moving(dof: usize) -> InitialState {
    InitialState::new(
        nalgebra::DVector::from_fn(dof, |i, _| 0.2 - 0.1 * i as f64),
        nalgebra::DVector::from_fn(dof, |i, _| -0.5 + 0.3 * i as f64),
    )
    .unwrap()
}

/// Returns the parts of a response, `[x, ẋ, ẍ]`.
pub fn parts(response: &Response) -> [&DMatrix<f64>; 3] {
    [response.displacement(), response.velocity(), response.acceleration()].map(Record::data)
}

/// Two degrees of freedom, damped, C and K without symmetry; |λ| up to about 6 rad/s.
pub fn coupled() -> SecondOrderSystem {
    SecondOrderSystem::new(
        nalgebra::dmatrix![2.0, 0.1; 0.0, 1.5],
        nalgebra::dmatrix![1.1, 0.4; -0.2, 0.9],
        nalgebra::dmatrix![30.0, -8.0; -11.0, 40.0],
    )
    .unwrap()
}
