//! Propagation of noise from the samples of a force to the response, and the adjoint of this
//! propagation.

use mechid_model::ResponseQuantity;
use nalgebra::{DMatrix, DVector};

use super::simulate::Transition;

/// Linearised response to small changes of the force, about a simulated response.
///
/// Between the samples a force is band-limited. Here each sample acts as an impulse, half of it
/// before the sample and half after it. Below half the sampling rate, both forces are equivalent.
pub(super) struct Propagation<'a> {
    transitions: &'a [Transition],
    inverse_mass: &'a DMatrix<f64>,
    dt: f64,
    measured: ResponseQuantity,
}

impl<'a> Propagation<'a> {
    pub(super) fn new(
        transitions: &'a [Transition],
        inverse_mass: &'a DMatrix<f64>,
        dt: f64,
        measured: ResponseQuantity,
    ) -> Self {
        Self { transitions, inverse_mass, dt, measured }
    }

    fn dof(&self) -> usize {
        self.inverse_mass.nrows()
    }

    /// Returns the derivatives of the measured response with respect to the state at a sample, n ×
    /// 2n.
    pub(super) fn output(&self, sample: usize) -> DMatrix<f64> {
        let n = self.dof();
        let part = |first: usize| {
            DMatrix::from_fn(n, 2 * n, |row, column| f64::from(column == first + row))
        };
        match self.measured {
            ResponseQuantity::Displacement => part(0),
            ResponseQuantity::Velocity => part(n),
            ResponseQuantity::Acceleration => self.transitions[sample].acceleration.clone(),
        }
    }

    /// Returns the number of samples.
    pub(super) fn len(&self) -> usize {
        self.transitions.len()
    }

    /// Returns the derivatives of the state at the next sample with respect to the state at this
    /// sample.
    pub(super) fn transition(&self, sample: usize) -> &DMatrix<f64> {
        &self.transitions[sample].state
    }

    /// Returns the change of the state due to half of a force sample, 2n × n.
    pub(super) fn half_sample_input(&self) -> DMatrix<f64> {
        let n = self.dof();
        let mut push = DMatrix::zeros(2 * n, n);
        push.rows_mut(n, n).copy_from(&(self.inverse_mass * (0.5 * self.dt)));
        push
    }

    /// Returns the change of the measured response due to a force at the same instant, n × n; the
    /// change is zero except for accelerations.
    pub(super) fn direct(&self) -> DMatrix<f64> {
        self.inverse_mass * f64::from(u8::from(self.is_acceleration()))
    }

    fn is_acceleration(&self) -> bool {
        self.measured == ResponseQuantity::Acceleration
    }

    /// Returns the change of the response (samples × n) for a change of the force (N, samples × n),
    /// with the same initial state.
    pub(super) fn response(&self, force: &DMatrix<f64>) -> DMatrix<f64> {
        let n = self.dof();
        let mut response = DMatrix::zeros(force.nrows(), n);
        let mut state = DVector::zeros(2 * n);
        for (sample, transition) in self.transitions.iter().enumerate() {
            let push = self.inverse_mass * force.row(sample).transpose();
            for half in 0..2 {
                for dof in 0..n {
                    state[n + dof] += 0.5 * self.dt * push[dof];
                }
                if half == 0 {
                    let mut output = self.output(sample) * &state;
                    if self.is_acceleration() {
                        output += &push;
                    }
                    response.row_mut(sample).copy_from(&output.transpose());
                }
            }
            state = &transition.state * state;
        }
        response
    }

    /// Returns the adjoint of [`Propagation::response`]: the weights (samples × n) of the force
    /// that give the same inner product as the given weights (samples × n) of the response.
    pub(super) fn adjoint(&self, weights: &DMatrix<f64>) -> DMatrix<f64> {
        let n = self.dof();
        let mut force_weights = DMatrix::zeros(weights.nrows(), n);
        let mut later = DVector::<f64>::zeros(2 * n);
        for (sample, transition) in self.transitions.iter().enumerate().rev() {
            let weight = weights.row(sample).transpose();
            let here = self.output(sample).transpose() * &weight;
            let after = transition.state.transpose() * later;
            let mut push = (here.rows(n, n) * 0.5 + after.rows(n, n)) * self.dt;
            if self.is_acceleration() {
                push += &weight;
            }
            let load = self.inverse_mass.transpose() * push;
            force_weights.row_mut(sample).copy_from(&load.transpose());
            later = here + after;
        }
        force_weights
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The adjoint Lᵀ of a propagation L satisfies ⟨g, L e⟩ = ⟨Lᵀ g, e⟩ for every measured
    /// quantity, with transitions that change from sample to sample.
    #[test]
    fn the_adjoint_is_one() {
        let (n, samples) = (2, 12);
        let number = |i: usize, j: usize| ((7 * i + 5 * j + 1) as f64).sin();
        let transitions: Vec<_> = (0..samples)
            .map(|at| Transition {
                state: DMatrix::from_fn(2 * n, 2 * n, |i, j| 0.4 * number(i + at, j)),
                acceleration: DMatrix::from_fn(n, 2 * n, |i, j| number(i, j + at)),
            })
            .collect();
        let inverse_mass = DMatrix::from_fn(n, n, |i, j| number(i + 3, j) + f64::from(i == j));
        let force = DMatrix::from_fn(samples, n, number);
        let weights = DMatrix::from_fn(samples, n, |i, j| number(j, i + 2));
        for measured in ResponseQuantity::ALL {
            let propagation = Propagation::new(&transitions, &inverse_mass, 0.3, measured);
            let forward = propagation.response(&force).dot(&weights);
            let backward = propagation.adjoint(&weights).dot(&force);
            assert!((forward - backward).abs() < 1e-12 * forward.abs(), "{measured:?}");
        }
    }
}
