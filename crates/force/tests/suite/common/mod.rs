//! Responses in closed form, sharing no code with the crate under test.

use mechid_model::{Response, SecondOrderSystem};
use mechid_signal::{Record, Sampling};
use nalgebra::{DMatrix, dmatrix};

/// One underdamped oscillator m ẍ + c ẋ + k x = f.
#[derive(Clone, Copy)]
pub struct Oscillator {
    pub m: f64,
    pub c: f64,
    pub k: f64,
}

impl Oscillator {
    /// Returns displacement and velocity after `t` seconds under f(τ) = f0 + rise·τ, from the
    /// textbook formula.
    pub fn advance(&self, (x, v): (f64, f64), f0: f64, rise: f64, t: f64) -> (f64, f64) {
        let Self { m, c, k } = *self;
        let decay = c / (2.0 * m);
        let damped = (k / m - decay * decay).sqrt();
        let particular = f0 / k - c * rise / (k * k);
        let (a, b) = (x - particular, v - rise / k);
        let s = (b + decay * a) / damped;
        let (sin, cos) = (damped * t).sin_cos();
        let e = (-decay * t).exp();
        (
            particular + rise * t / k + e * (a * cos + s * sin),
            rise / k + e * ((s * damped - decay * a) * cos - (a * damped + decay * s) * sin),
        )
    }

    /// Returns x and ẋ at the samples, from the initial state `start`. The force is held, or linear
    /// between its samples.
    pub fn run(
        &self,
        start: (f64, f64),
        force: &[f64],
        dt: f64,
        linear: bool,
    ) -> (Vec<f64>, Vec<f64>) {
        let (mut state, mut x, mut v) = (start, Vec::new(), Vec::new());
        for (k, f) in force.iter().enumerate() {
            x.push(state.0);
            v.push(state.1);
            let next = force[(k + 1) % force.len()];
            let rise = if linear { (next - f) / dt } else { 0.0 };
            state = self.advance(state, *f, rise, dt);
        }
        (x, v)
    }
}

/// Two uncoupled oscillators q1 and q2 in mixed coordinates x = T q, with forces F = S f. The
/// matrices, for example M = S m T⁻¹, are full and not symmetric, but the motion is known in closed
/// form.
pub struct Mixed {
    pub oscillators: [Oscillator; 2],
    pub shape: DMatrix<f64>,
    pub load: DMatrix<f64>,
}

pub fn mixed() -> Mixed {
    Mixed {
        oscillators: [
            Oscillator { m: 2.0, c: 0.9, k: 50.0 },
            Oscillator { m: 1.0, c: 1.5, k: 160.0 },
        ],
        shape: dmatrix![1.0, 0.5; -0.4, 1.0],
        load: dmatrix![1.0, -0.3; 0.6, 1.2],
    }
}

impl Mixed {
    pub fn system(&self) -> SecondOrderSystem {
        let [a, b] = self.oscillators;
        let matrix = |p: f64, q: f64| {
            // X T⁻¹ is the transpose of the solution Y of Tᵀ Y = Xᵀ.
            let left = &self.load * dmatrix![p, 0.0; 0.0, q];
            self.shape.transpose().lu().solve(&left.transpose()).unwrap().transpose()
        };
        SecondOrderSystem::new(matrix(a.m, b.m), matrix(a.c, b.c), matrix(a.k, b.k)).unwrap()
    }

    /// Returns the force record (N × 2) and the response to this force from rest.
    pub fn run(&self, modal: [&[f64]; 2], dt: f64, linear: bool) -> (Record, Response) {
        let sampling = Sampling::new(dt, modal[0].len()).unwrap();
        let parts: Vec<_> =
            (0..2).map(|j| self.oscillators[j].run((0.0, 0.0), modal[j], dt, linear)).collect();
        let pick =
            |f: &dyn Fn(usize, usize) -> f64| DMatrix::from_fn(sampling.len(), 2, |k, j| f(j, k));
        let x = pick(&|j, k| parts[j].0[k]) * self.shape.transpose();
        let v = pick(&|j, k| parts[j].1[k]) * self.shape.transpose();
        let force = pick(&|j, k| modal[j][k]) * self.load.transpose();
        let record = |data| Record::new(sampling, data).unwrap();
        let nothing = DMatrix::zeros(sampling.len(), 2);
        (record(force), Response::new(record(x), record(v), record(nothing)).unwrap())
    }
}

/// Returns a response of one degree of freedom whose acceleration is not used.
pub fn response(sampling: Sampling, x: Vec<f64>, v: Vec<f64>) -> Response {
    let record = |c| Record::from_channel(sampling, c).unwrap();
    Response::new(record(x), record(v), record(vec![0.0; sampling.len()])).unwrap()
}
