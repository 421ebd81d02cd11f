//! Responses of one degree of freedom in closed form, for any damping.

use mechid_signal::{Record, Sampling};
use nalgebra::Complex;

use crate::divided_exp::phi_divided;
use crate::error::require;
use crate::{ModelError, Response, Sdof};

impl Sdof {
    /// Returns the free response from x(0) = `x0` (m) and ẋ(0) = `v0` (m/s).
    ///
    /// The response is x = x0 (ḣ + c/m h) + v0 h, with h the impulse response. This one expression
    /// holds for underdamped, critically damped and overdamped systems.
    ///
    /// # Errors
    /// [`ModelError::Parameter`] if `x0` or `v0` is not finite, [`ModelError::Signal`] if an
    /// unstable response overflows.
    ///
    /// # Source
    /// Meirovitch (1975), free vibration of a damped single-degree-of-freedom system.
    pub fn free_response(
        &self,
        sampling: Sampling,
        x0: f64,
        v0: f64,
    ) -> Result<Response, ModelError> {
        require_start(x0, v0)?;
        self.respond(sampling, |t| (self.free_motion(t, x0, v0), 0.0))
    }

    /// Returns the response from x(0) = `x0` (m) and ẋ(0) = `v0` (m/s) to a force switched on at t
    /// = 0: F(t) = `force` (N) for t ≥ 0.
    ///
    /// # Errors
    /// [`ModelError::Parameter`] if `force`, `x0` or `v0` is not finite, [`ModelError::Signal`] if
    /// an unstable response overflows.
    ///
    /// # Source
    /// Meirovitch (1975), response of a damped single-degree-of-freedom system to a step.
    pub fn step_response(
        &self,
        sampling: Sampling,
        force: f64,
        x0: f64,
        v0: f64,
    ) -> Result<Response, ModelError> {
        require("force", force, "finite", true)?;
        require_start(x0, v0)?;
        self.respond(sampling, |t| {
            let (x, v) = self.free_motion(t, x0, v0);
            let (step, impulse) =
                (self.integrated_impulse_response(1, t), self.impulse_response(t));
            ((x + force * step, v + force * impulse), force)
        })
    }

    /// Returns the response from x(0) = `x0` (m) and ẋ(0) = `v0` (m/s) to F(t) = Re(`force`
    /// exp(iωt)), transient included.
    ///
    /// A force F cos(ωt + φ) has `force` = F exp(iφ). Resonance needs no exception: without damping
    /// the amplitude grows in proportion to t. The error is of the order of ε relative to the
    /// largest displacement.
    ///
    /// # Errors
    /// [`ModelError::Parameter`] if an argument is not finite, [`ModelError::Signal`] if an
    /// unstable response overflows.
    ///
    /// # Source
    /// Meirovitch (1975), response of a damped single-degree-of-freedom system to harmonic forces,
    /// with the transient.
    pub fn harmonic_response(
        &self,
        sampling: Sampling,
        force: Complex<f64>,
        omega: f64,
        x0: f64,
        v0: f64,
    ) -> Result<Response, ModelError> {
        require_harmonic(force, omega)?;
        require_start(x0, v0)?;
        self.respond(sampling, |t| {
            let (x, v) = self.free_motion(t, x0, v0);
            let (dx, dv) = self.forced_motion(t, Complex::new(0.0, omega));
            let now = force * Complex::new(0.0, omega * t).exp();
            ((x + (force * dx).re, v + (force * dv).re), now.re)
        })
    }

    /// Returns the steady-state response to F(t) = Re(`force` exp(iωt)), after the decay of the
    /// transient: x = Re(`force` exp(iωt) / (k − ω²m + iωc)).
    ///
    /// # Errors
    /// [`ModelError::SingularDynamicStiffness`] at an undamped resonance, [`ModelError::Parameter`]
    /// if an argument is not finite.
    ///
    /// # Source
    /// Dissertation eqs. (4.6.9)–(4.6.10).
    pub fn harmonic_steady_state(
        &self,
        sampling: Sampling,
        force: Complex<f64>,
        omega: f64,
    ) -> Result<Response, ModelError> {
        require_harmonic(force, omega)?;
        let amplitude = force * self.system().receptance(omega)?[(0, 0)];
        self.respond(sampling, |t| {
            let turn = Complex::new(0.0, omega * t).exp();
            let x = amplitude * turn;
            ((x.re, (Complex::new(0.0, omega) * x).re), (force * turn).re)
        })
    }

    /// Returns the impulse response h(t) for t ≥ 0, in m/(N·s): the displacement after a unit
    /// impulse at rest.
    ///
    /// # Source
    /// Meirovitch (1975), impulse response of a damped single-degree-of-freedom system.
    pub fn impulse_response(&self, t: f64) -> f64 {
        self.integrated_impulse_response(0, t)
    }

    /// Returns the impulse response integrated `k` times from 0: tᵏ⁺¹ φ_k[λ₁t, λ₂t] / m, with the
    /// poles λ₁, λ₂ and the divided difference φ_k[a, b] of [`phi_divided`].
    ///
    /// The response to a unit step has k = 1, the response to the ramp F = t has k = 2.
    pub(crate) fn integrated_impulse_response(&self, k: usize, t: f64) -> f64 {
        let [a, b] = self.poles().map(|p| p * t);
        phi_divided(k, a, b).re * t.powi(k as i32 + 1) / self.mass()
    }

    /// Returns x and ẋ at `t` of the free response from the displacement `x0` and the velocity
    /// `v0`.
    pub(crate) fn free_motion(&self, t: f64, x0: f64, v0: f64) -> (f64, f64) {
        // The first of two real poles is the faster pole. This order avoids cancellation in the two
        // sums below.
        let [fast, slow] = self.poles();
        let h = t * phi_divided(0, fast * t, slow * t);
        let h_dot = (fast * t).exp() + slow * h;
        let from_x0 = (slow * t).exp() - slow * h;
        let stiffness_ratio = self.stiffness() / self.mass();
        (x0 * from_x0.re + v0 * h.re, v0 * h_dot.re - x0 * stiffness_ratio * h.re)
    }

    /// Returns x and ẋ at `t`, from rest under the complex force exp(μt): the divided difference of
    /// exp(zt) at λ₁, λ₂ and μ, divided by m.
    fn forced_motion(&self, t: f64, mu: Complex<f64>) -> (Complex<f64>, Complex<f64>) {
        let [p, q] = self.poles();
        // Division by the distance to the farther root avoids cancellation, also at resonance.
        let (near, far) = if (mu - p).norm() < (mu - q).norm() { (p, q) } else { (q, p) };
        let with_force = t * phi_divided(0, near * t, mu * t);
        let roots_only = t * phi_divided(0, near * t, far * t);
        let x = (with_force - roots_only) / (mu - far);
        let v = far * x + with_force;
        (x / self.mass(), v / self.mass())
    }

    /// Creates a response from the displacement, the velocity and the force at each instant; the
    /// acceleration follows from the equation of motion.
    fn respond(
        &self,
        sampling: Sampling,
        at: impl Fn(f64) -> ((f64, f64), f64),
    ) -> Result<Response, ModelError> {
        let samples = sampling.times().map(|t| {
            let ((x, v), force) = at(t);
            [x, v, self.acceleration(x, v, force)]
        });
        to_response(sampling, samples)
    }

    /// Returns ẍ = (F − c ẋ − k x) / m.
    pub(crate) fn acceleration(&self, x: f64, v: f64, force: f64) -> f64 {
        (force - self.damping() * v - self.stiffness() * x) / self.mass()
    }
}

/// Creates records of one channel from x, ẋ, ẍ at each instant.
pub(crate) fn to_response(
    sampling: Sampling,
    samples: impl Iterator<Item = [f64; 3]>,
) -> Result<Response, ModelError> {
    let mut channels = [(); 3].map(|()| Vec::with_capacity(sampling.len()));
    for sample in samples {
        for (channel, value) in channels.iter_mut().zip(sample) {
            channel.push(value);
        }
    }
    let [x, v, a] = channels.map(|c| Record::from_channel(sampling, c));
    Response::new(x?, v?, a?)
}

pub(crate) fn require_start(x0: f64, v0: f64) -> Result<(), ModelError> {
    require("initial displacement", x0, "finite", true)?;
    require("initial velocity", v0, "finite", true)
}

fn require_harmonic(force: Complex<f64>, omega: f64) -> Result<(), ModelError> {
    require("force (real part)", force.re, "finite", true)?;
    require("force (imaginary part)", force.im, "finite", true)?;
    require("angular frequency", omega, "finite", true)
}
