//! The force of a short film at any position and velocity of the journal.

use mechid_model::OilFilm;

use super::integrals::Integrals;
use crate::conditions::Conditions;
use crate::error::BearingError;

/// The film of a short bearing as a nonlinear force on the journal.
///
/// The film has pressure where the formula gives a positive pressure at this instant: on half the
/// circumference, whose position depends on the velocity. The pressure, integrated over the length
/// of the bearing, is −μ L³ (Ω/2 ∂h/∂θ + ∂h/∂t) / h³, in N per m of circumference, with the film
/// thickness h at the angle θ.
///
/// x and y are any two perpendicular directions such that the journal rotates from x to y.
///
/// ```
/// use mechid_bearing::{Conditions, ShortFilm};
///
/// let film = ShortFilm::new(Conditions {
///     diameter: 0.05, length: 0.0125, clearance: 50e-6, viscosity: 0.02, omega: 300.0,
/// })?;
/// // Displaced along x at rest: the film pushes back, and forward in the direction of rotation.
/// let force = film.force([20e-6, 0.0], [0.0; 2])?.force;
/// assert!(force[0] < 0.0 && force[1] > 0.0);
/// # Ok::<(), mechid_bearing::BearingError>(())
/// ```
///
/// # Source
/// DuBois and Ocvirk (1953) for the pressure; the force in closed form after Capone (1991).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShortFilm {
    clearance: f64,
    omega: f64,
    /// μ R L³ / c², in N·s.
    scale: f64,
}

/// The force of a film on the journal and its derivatives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FilmForce {
    /// Force along x and y, in N.
    pub force: [f64; 2],
    /// Stiffness −∂F/∂x (N/m) and damping −∂F/∂ẋ (N·s/m) at this position and velocity.
    pub tangent: OilFilm,
}

impl ShortFilm {
    /// Creates the film of a bearing.
    ///
    /// # Errors
    /// [`BearingError::Parameter`] naming the value that is not positive and finite.
    pub fn new(conditions: Conditions) -> Result<Self, BearingError> {
        conditions.check()?;
        let Conditions { diameter, length, clearance, viscosity, omega } = conditions;
        let scale = viscosity * diameter / 2.0 * length.powi(3) / (clearance * clearance);
        Ok(Self { clearance, omega, scale })
    }

    /// Radial clearance, in m.
    pub fn clearance(&self) -> f64 {
        self.clearance
    }

    /// Returns the force on the journal at a position (m) and velocity (m/s), along x and y each.
    ///
    /// # Errors
    /// [`BearingError::Contact`] if the journal touches the bore or its state is not finite.
    pub fn force(&self, position: [f64; 2], velocity: [f64; 2]) -> Result<FilmForce, BearingError> {
        let position = position.map(|x| x / self.clearance);
        let velocity = velocity.map(|v| v / self.clearance);
        let eccentricity = position[0].hypot(position[1]);
        let moving = velocity[0].is_finite() && velocity[1].is_finite();
        if !(eccentricity < 1.0 && moving) {
            return Err(BearingError::Contact { eccentricity });
        }
        let film = HalfFilm::new(position, velocity, self.omega);
        let [[kxx, kxy], [kyx, kyy]] =
            film.stiffness.map(|row| row.map(|k| k * self.scale / self.clearance));
        let [[cxx, cxy], [cyx, cyy]] =
            film.damping.map(|row| row.map(|c| c * self.scale / self.clearance));
        Ok(FilmForce {
            force: film.force.map(|f| f * self.scale),
            tangent: OilFilm { kxx, kxy, kyx, kyy, cxx, cxy, cyx, cyy },
        })
    }
}

/// Force divided by μ R L³ / c², and its derivatives, for a position in clearances and a velocity
/// in clearances per unit of time.
pub(super) struct HalfFilm {
    pub(super) force: [f64; 2],
    pub(super) stiffness: [[f64; 2]; 2],
    pub(super) damping: [[f64; 2]; 2],
}

impl HalfFilm {
    /// Computes ∫ G n / h³ dθ over the half of the circumference where G < 0. The angle θ is
    /// counted from the line of centres, with h = 1 − ε cos θ, n = (cos θ, sin θ) and G = Ω/2 ∂h/∂θ
    /// + ∂h/∂t = p sin θ − q cos θ.
    ///
    /// G is zero at both ends of this half; therefore the ends do not contribute to the
    /// derivatives.
    pub(super) fn new(position: [f64; 2], velocity: [f64; 2], omega: f64) -> Self {
        let eccentricity = position[0].hypot(position[1]);
        let [cos, sin] =
            if eccentricity > 0.0 { position.map(|x| x / eccentricity) } else { [1.0, 0.0] };
        let half = omega / 2.0;
        let p = half * eccentricity - (cos * velocity[1] - sin * velocity[0]);
        let q = cos * velocity[0] + sin * velocity[1];
        let Integrals { second: [cc, cs, ss], third: [ccc, ccs, css, sss] } =
            Integrals::new(eccentricity, q.atan2(p));

        let force = [p * cs - q * cc, p * ss - q * cs];
        // ∂G/∂x = Ω/2 (sin θ, −cos θ) and ∂h/∂x = −n.
        let bend = [[p * ccs - q * ccc, p * css - q * ccs], [p * css - q * ccs, p * sss - q * css]];
        let turn = [[half * cs, -half * cc], [half * ss, -half * cs]];
        let stiffness = [0, 1].map(|i| [0, 1].map(|k: usize| -(turn[i][k] + 3.0 * bend[i][k])));
        let damping = [[cc, cs], [cs, ss]];

        // The matrices are rotated back from the line of centres to x and y.
        let turned = |m: [[f64; 2]; 2]| {
            let rotation = [[cos, -sin], [sin, cos]];
            [0, 1].map(|i: usize| {
                [0, 1].map(|k: usize| {
                    let mut sum = 0.0;
                    for (a, row) in m.iter().enumerate() {
                        for (b, value) in row.iter().enumerate() {
                            sum += rotation[i][a] * value * rotation[k][b];
                        }
                    }
                    sum
                })
            })
        };
        Self {
            force: [cos * force[0] - sin * force[1], sin * force[0] + cos * force[1]],
            stiffness: turned(stiffness),
            damping: turned(damping),
        }
    }
}
