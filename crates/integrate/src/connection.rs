//! Nonlinear springs and dampers between two degrees of freedom, or one and the ground.

use crate::IntegrateError;
use crate::nonlinear::{NonlinearForce, Tangents};
use crate::scheme::check_parameter;

/// Ends of a nonlinear spring or damper; its extension e is the displacement of the first
/// end less that of the second.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Connection {
    from: usize,
    to: Option<usize>,
}

impl Connection {
    /// Connects a degree of freedom, counted from 0, with the ground.
    pub fn to_ground(dof: usize) -> Self {
        Self { from: dof, to: None }
    }

    /// Connects two degrees of freedom, counted from 0.
    pub fn between(from: usize, to: usize) -> Self {
        Self { from, to: Some(to) }
    }

    /// A spring of force Σ kᵢ eⁱ, with a list of `coefficients` kᵢ (N/mⁱ) from i = 1.
    ///
    /// # Errors
    /// [`IntegrateError::Parameter`] if a coefficient is not finite.
    pub fn spring(self, coefficients: &[f64]) -> Result<NonlinearElement, IntegrateError> {
        Ok(self.element(Law::Spring(finite("spring coefficient", coefficients)?)))
    }

    /// A damper of force Σ cᵢ ėⁱ, with a list of `coefficients` cᵢ (N·sⁱ/mⁱ) from i = 1.
    ///
    /// # Errors
    /// [`IntegrateError::Parameter`] if a coefficient is not finite.
    pub fn damper(self, coefficients: &[f64]) -> Result<NonlinearElement, IntegrateError> {
        Ok(self.element(Law::Damper(finite("damper coefficient", coefficients)?)))
    }

    /// A stop with a `clearance` (m) on either side, then a spring of `stiffness` (N/m).
    ///
    /// # Errors
    /// [`IntegrateError::Parameter`] if one of them is negative or not finite.
    pub fn gap(self, clearance: f64, stiffness: f64) -> Result<NonlinearElement, IntegrateError> {
        let clearance = check_parameter("gap", "clearance", clearance, 0.0, f64::INFINITY)?;
        let stiffness = check_parameter("gap", "stiffness", stiffness, 0.0, f64::INFINITY)?;
        Ok(self.element(Law::Gap { clearance, stiffness }))
    }

    /// Coulomb friction of at most `limit` (N), regularised: `limit` · tanh(ė / `velocity`), in m/s;
    /// it creeps where it should stick.
    ///
    /// # Errors
    /// [`IntegrateError::Parameter`] if `limit` is negative or `velocity` not positive.
    pub fn friction(self, limit: f64, velocity: f64) -> Result<NonlinearElement, IntegrateError> {
        let limit = check_parameter("friction", "limit", limit, 0.0, f64::INFINITY)?;
        let least = f64::MIN_POSITIVE;
        let velocity = check_parameter("friction", "velocity", velocity, least, f64::INFINITY)?;
        Ok(self.element(Law::Friction { limit, velocity }))
    }

    fn element(self, law: Law) -> NonlinearElement {
        NonlinearElement { dofs: std::iter::once(self.from).chain(self.to).collect(), law }
    }
}

fn finite(what: &'static str, coefficients: &[f64]) -> Result<Vec<f64>, IntegrateError> {
    for value in coefficients {
        check_parameter(what, "value", *value, f64::NEG_INFINITY, f64::INFINITY)?;
    }
    Ok(coefficients.to_vec())
}

/// A nonlinear spring, damper, stop or friction made by a [`Connection`].
#[derive(Debug, Clone, PartialEq)]
pub struct NonlinearElement {
    dofs: Vec<usize>,
    law: Law,
}

#[derive(Debug, Clone, PartialEq)]
enum Law {
    Spring(Vec<f64>),
    Damper(Vec<f64>),
    Gap { clearance: f64, stiffness: f64 },
    Friction { limit: f64, velocity: f64 },
}

/// Force, and its derivatives by extension and rate.
struct Reaction {
    force: f64,
    stiffness: f64,
    damping: f64,
}

impl Law {
    #[inline(always)]
    fn reaction(&self, extension: f64, rate: f64) -> Reaction {
        match self {
            Self::Spring(coefficients) => {
                let (force, stiffness) = polynomial(coefficients, extension);
                Reaction { force, stiffness, damping: 0.0 }
            }
            Self::Damper(coefficients) => {
                let (force, damping) = polynomial(coefficients, rate);
                Reaction { force, stiffness: 0.0, damping }
            }
            Self::Gap { clearance, stiffness } => {
                let beyond = extension - extension.clamp(-clearance, *clearance);
                let stiffness = if beyond == 0.0 { 0.0 } else { *stiffness };
                Reaction { force: stiffness * beyond, stiffness, damping: 0.0 }
            }
            Self::Friction { limit, velocity } => {
                let part = (rate / velocity).tanh();
                let damping = limit / velocity * (1.0 - part * part);
                Reaction { force: limit * part, stiffness: 0.0, damping }
            }
        }
    }
}

/// Σ cᵢ eⁱ from i = 1, and its derivative.
#[inline(always)]
fn polynomial(coefficients: &[f64], e: f64) -> (f64, f64) {
    let Some((last, rest)) = coefficients.split_last() else { return (0.0, 0.0) };
    let (mut value, mut slope) = (*last, 0.0);
    for coefficient in rest.iter().rev() {
        slope = slope * e + value;
        value = value * e + coefficient;
    }
    (value * e, slope * e + value)
}

impl NonlinearElement {
    #[inline(always)]
    fn reaction(&self, x: &[f64], v: &[f64]) -> Reaction {
        match self.dofs.len() {
            1 => self.law.reaction(x[0], v[0]),
            _ => self.law.reaction(x[0] - x[1], v[0] - v[1]),
        }
    }
}

impl NonlinearForce for NonlinearElement {
    fn dofs(&self) -> &[usize] {
        &self.dofs
    }

    fn force(&self, _time: f64, x: &[f64], v: &[f64], g: &mut [f64]) {
        let force = self.reaction(x, v).force;
        g.iter_mut().zip([force, -force]).for_each(|(g, force)| *g = force);
    }

    fn tangents(&self, _time: f64, x: &[f64], v: &[f64], tangents: &mut Tangents) -> bool {
        let reaction = self.reaction(x, v);
        let fill = |matrix: &mut nalgebra::DMatrix<f64>, value: f64| {
            for (i, j) in (0..x.len()).flat_map(|j| (0..x.len()).map(move |i| (i, j))) {
                matrix[(i, j)] = if i == j { value } else { -value };
            }
        };
        fill(&mut tangents.stiffness, reaction.stiffness);
        fill(&mut tangents.damping, reaction.damping);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The tangents are the derivatives of the force, by central differences.
    #[test]
    fn tangents_are_derivatives() {
        let on = Connection::between(4, 1);
        let elements = [
            on.spring(&[3.0, -2.0, 5.0]).unwrap(),
            on.damper(&[1.0, 0.0, 0.5]).unwrap(),
            on.gap(0.1, 40.0).unwrap(),
            on.friction(2.0, 0.3).unwrap(),
            Connection::to_ground(2).spring(&[0.0, 0.0, 7.0]).unwrap(),
        ];
        for element in elements {
            let p = element.dofs().len();
            let (x, v) = (&[0.4, -0.3][..p], &[0.2, 0.6][..p]);
            let zeros = || nalgebra::DMatrix::zeros(p, p);
            let mut tangents = Tangents { stiffness: zeros(), damping: zeros() };
            assert!(element.tangents(0.0, x, v, &mut tangents));
            for j in 0..p {
                let moved = |values: &[f64], h: f64| {
                    let mut moved = values.to_vec();
                    moved[j] += h;
                    moved
                };
                let slope = |at: &dyn Fn(f64) -> (Vec<f64>, Vec<f64>)| {
                    let [ahead, behind] = [1e-5, -1e-5].map(|h| {
                        let (mut g, (x, v)) = (vec![0.0; p], at(h));
                        element.force(0.0, &x, &v, &mut g);
                        g
                    });
                    ahead.iter().zip(&behind).map(|(a, b)| (a - b) / 2e-5).collect::<Vec<_>>()
                };
                let by_x = slope(&|h| (moved(x, h), v.to_vec()));
                let by_v = slope(&|h| (x.to_vec(), moved(v, h)));
                for i in 0..p {
                    assert!((tangents.stiffness[(i, j)] - by_x[i]).abs() < 1e-8, "{element:?}");
                    assert!((tangents.damping[(i, j)] - by_v[i]).abs() < 1e-8, "{element:?}");
                }
            }
        }
    }

    #[test]
    fn impossible_elements_are_refused() {
        let on = Connection::to_ground(0);
        assert!(on.gap(-0.1, 1.0).is_err() && on.gap(0.1, -1.0).is_err());
        assert!(on.friction(1.0, 0.0).is_err() && on.friction(f64::NAN, 1.0).is_err());
        assert!(on.spring(&[1.0, f64::INFINITY]).is_err());
    }
}
