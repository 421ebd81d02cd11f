//! Exact responses of one degree of freedom to a force given by its samples.

use mechid_signal::Record;

use crate::closed_form::{require_start, to_response};
use crate::{ModelError, Response, Sdof};

/// Exact response over one time step to a force that is linear in this step:
///
/// ```text
/// ┌ x ┐      ┌ x ┐     ┌ g₁ ┐       ┌ g₂ ┐
/// └ ẋ ┘ₖ₊₁ = Φ └ ẋ ┘ₖ + └ g₀ ┘ Fₖ + └ g₁ ┘ (Fₖ₊₁ − Fₖ)/Δt
/// ```
///
/// with gⱼ the impulse response integrated j times over the step.
struct Step {
    phi: [[f64; 2]; 2],
    integrals: [f64; 3],
    dt: f64,
}

impl Step {
    fn new(sdof: &Sdof, dt: f64) -> Self {
        let (xx, vx) = sdof.free_motion(dt, 1.0, 0.0);
        let (xv, vv) = sdof.free_motion(dt, 0.0, 1.0);
        let integrals = [0, 1, 2].map(|k| sdof.integrated_impulse_response(k, dt));
        Self { phi: [[xx, xv], [vx, vv]], integrals, dt }
    }

    fn advance(&self, (x, v): (f64, f64), left: f64, right: f64) -> (f64, f64) {
        let [[xx, xv], [vx, vv]] = self.phi;
        let [g0, g1, g2] = self.integrals;
        let slope = (right - left) / self.dt;
        (xx * x + xv * v + g1 * left + g2 * slope, vx * x + vv * v + g0 * left + g1 * slope)
    }
}

impl Sdof {
    /// Returns the response from `x0` (m), `v0` (m/s) to a force (N, one channel) that is constant
    /// between samples.
    ///
    /// The force and the acceleration jump at the samples: ẍ is the limit from the right, with the
    /// force after the jump.
    ///
    /// ```
    /// use mechid_model::Sdof;
    /// use mechid_signal::{Record, Sampling};
    ///
    /// let sdof = Sdof::new(10.0, 180.0, 5000.0)?;
    /// let sampling = Sampling::new(0.05, 100)?;
    /// let constant = Record::from_channel(sampling, vec![50.0; 100])?;
    /// let response = sdof.held_force_response(&constant, 0.0, 0.0)?;
    /// assert!((response.displacement().channel(0)[99] - 50.0 / 5000.0).abs() < 1e-15);
    /// # Ok::<(), mechid_model::ModelError>(())
    /// ```
    ///
    /// # Errors
    /// [`ModelError::ForceChannels`] if the force does not have one channel,
    /// [`ModelError::Parameter`] if `x0` or `v0` is not finite, [`ModelError::Signal`] if an
    /// unstable response overflows.
    ///
    /// # Source
    /// Nigam & Jennings (1969), Bull. Seismological Society of America 59(2), 909–922, with the
    /// force constant instead of linear.
    pub fn held_force_response(
        &self,
        force: &Record,
        x0: f64,
        v0: f64,
    ) -> Result<Response, ModelError> {
        self.sampled(force, x0, v0, |left, _| left)
    }

    /// Returns the response from `x0` (m), `v0` (m/s) to a force (N, one channel) that is linear
    /// between samples.
    ///
    /// # Errors
    /// As [`held_force_response`](Self::held_force_response).
    ///
    /// # Source
    /// Nigam & Jennings (1969), Bull. Seismological Society of America 59(2), 909–922.
    pub fn linear_force_response(
        &self,
        force: &Record,
        x0: f64,
        v0: f64,
    ) -> Result<Response, ModelError> {
        self.sampled(force, x0, v0, |_, right| right)
    }

    /// Computes the response; `end` computes the force just before the end of a step from its two
    /// arguments: the samples at the beginning and at the end of the step.
    fn sampled(
        &self,
        force: &Record,
        x0: f64,
        v0: f64,
        end: impl Fn(f64, f64) -> f64,
    ) -> Result<Response, ModelError> {
        if force.channels() != 1 {
            return Err(ModelError::ForceChannels { got: force.channels(), dof: 1 });
        }
        require_start(x0, v0)?;
        let step = Step::new(self, force.sampling().dt());
        let force_at = force.channel(0);
        let mut state = (x0, v0);
        let samples = (0..force.len()).map(|k| {
            if k > 0 {
                state = step.advance(state, force_at[k - 1], end(force_at[k - 1], force_at[k]));
            }
            let (x, v) = state;
            [x, v, self.acceleration(x, v, force_at[k])]
        });
        to_response(force.sampling(), samples)
    }
}
