//! Force laws: the dependence of a nonlinear force on one displacement and its velocity.

use std::fmt;
use std::sync::Arc;

use crate::ModelError;
use crate::error::require;
use crate::limits;

/// Force per unit of its coefficient, as a function of a displacement q (m) and its velocity q̇
/// (m/s).
///
/// The coefficient of a law is a parameter of the system; [`Law::constants`] are constants inside
/// the law, on which the force depends nonlinearly.
pub trait Law: fmt::Debug + Send + Sync {
    /// Returns f(q, q̇), in powers of m and m/s: see [`Law::dimension`].
    fn value(&self, q: f64, v: f64) -> f64;

    /// Returns \[∂f/∂q, ∂f/∂q̇\], in the unit of f per m and per m/s.
    fn slopes(&self, q: f64, v: f64) -> [f64; 2];

    /// Returns the powers of metre and second in the unit of f: \[1, −1\] for a velocity.
    fn dimension(&self) -> [i32; 2];

    /// Returns the law in the syntax of the parser, with these names for q and q̇.
    fn expression(&self, q: &str, v: &str) -> String;

    /// Returns the constants inside the law, with name, unit and value; none for most laws.
    fn constants(&self) -> Vec<Constant> {
        Vec::new()
    }

    /// Returns the same law with other constants, one for each of [`Law::constants`], in their
    /// units; `None` if a constant is out of range.
    fn with_constants(&self, _values: &[f64]) -> Option<Arc<dyn Law>> {
        None
    }

    /// Returns true if the force does not depend on the response at all.
    fn is_constant(&self) -> bool {
        false
    }
}

/// A constant inside a force law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Constant {
    /// Letter in the expression.
    pub name: &'static str,
    /// SI unit.
    pub unit: &'static str,
    /// Value of the constant, in `unit`.
    pub value: f64,
}

/// Law q^p q̇^r: springs (r = 0), dampers (p = 0), damping that depends on the displacement, and a
/// constant force (p = r = 0).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Power {
    displacement: u32,
    velocity: u32,
}

impl Power {
    /// Creates the law q^`displacement` · q̇^`velocity`.
    ///
    /// # Errors
    /// [`ModelError::Parameter`] for an exponent above 9 or a linear law, which is an entry of K or
    /// C.
    pub fn new(displacement: u32, velocity: u32) -> Result<Self, ModelError> {
        for (name, exponent) in
            [("exponent of the displacement", displacement), ("exponent of the velocity", velocity)]
        {
            require(name, f64::from(exponent), "at most 9", exponent <= limits::HIGHEST_EXPONENT)?;
        }
        let degree = displacement + velocity;
        let requirement = "0 or at least 2 (a linear force is an entry of K or C)";
        require("degree of a nonlinear term", f64::from(degree), requirement, degree != 1)?;
        Ok(Self { displacement, velocity })
    }
}

impl Law for Power {
    fn value(&self, q: f64, v: f64) -> f64 {
        q.powi(self.displacement as i32) * v.powi(self.velocity as i32)
    }

    fn slopes(&self, q: f64, v: f64) -> [f64; 2] {
        let (p, r) = (self.displacement as i32, self.velocity as i32);
        let derivative = |x: f64, n: i32| if n == 0 { 0.0 } else { f64::from(n) * x.powi(n - 1) };
        [derivative(q, p) * v.powi(r), q.powi(p) * derivative(v, r)]
    }

    fn dimension(&self) -> [i32; 2] {
        [(self.displacement + self.velocity) as i32, -(self.velocity as i32)]
    }

    fn expression(&self, q: &str, v: &str) -> String {
        let power = |name: &str, exponent: u32| match exponent {
            0 => None,
            1 => Some(name.to_owned()),
            _ => Some(format!("{name}^{exponent}")),
        };
        let factors = [power(q, self.displacement), power(v, self.velocity)];
        match factors.into_iter().flatten().collect::<Vec<_>>().join(" ") {
            none if none.is_empty() => format!("{q}^0"),
            some => some,
        }
    }

    fn is_constant(&self) -> bool {
        self.displacement + self.velocity == 0
    }
}

/// Law |q̇| q̇: turbulent drag, and a first approximation of damping that increases with the
/// amplitude.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct QuadraticDamping;

impl Law for QuadraticDamping {
    fn value(&self, _: f64, v: f64) -> f64 {
        v.abs() * v
    }

    fn slopes(&self, _: f64, v: f64) -> [f64; 2] {
        [0.0, 2.0 * v.abs()]
    }

    fn dimension(&self) -> [i32; 2] {
        [2, -2]
    }

    fn expression(&self, _: &str, v: &str) -> String {
        format!("|{v}| {v}")
    }
}

/// Law q̇³ / (1 + (q̇/b)²). The damping is cubic at velocities far below b, and linear far above b,
/// so that the force remains moderate outside the range of the data.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SaturatingDamping {
    velocity: f64,
}

impl SaturatingDamping {
    /// Creates a saturating damper with the velocity b (m/s) above which it becomes linear.
    ///
    /// # Errors
    /// [`ModelError::Parameter`] unless b is positive and finite.
    pub fn new(velocity: f64) -> Result<Self, ModelError> {
        require("velocity of a saturating damper", velocity, "positive", velocity > 0.0)?;
        Ok(Self { velocity })
    }
}

impl Law for SaturatingDamping {
    fn value(&self, _: f64, v: f64) -> f64 {
        let ratio = v / self.velocity;
        v * v * v / (1.0 + ratio * ratio)
    }

    fn slopes(&self, _: f64, v: f64) -> [f64; 2] {
        let square = (v / self.velocity).powi(2);
        [0.0, v * v * (3.0 + square) / (1.0 + square).powi(2)]
    }

    fn dimension(&self) -> [i32; 2] {
        [3, -3]
    }

    fn expression(&self, _: &str, v: &str) -> String {
        format!("{v}^3/(1 + ({v}/{})^2)", self.velocity)
    }

    fn constants(&self) -> Vec<Constant> {
        vec![Constant { name: "b", unit: "m/s", value: self.velocity }]
    }

    fn with_constants(&self, values: &[f64]) -> Option<Arc<dyn Law>> {
        let [velocity] = values else { return None };
        Some(Arc::new(Self::new(*velocity).ok()?))
    }
}

/// Spring behind a clearance a on either side: gap(q, a) is q − a above a, q + a below −a, and zero
/// from −a to a. The coefficient of this law is the stiffness of the spring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gap {
    clearance: f64,
}

impl Gap {
    /// Creates a spring behind the clearance a (m) on either side.
    ///
    /// # Errors
    /// [`ModelError::Parameter`] unless a is positive and finite.
    pub fn new(clearance: f64) -> Result<Self, ModelError> {
        require("clearance of a gap", clearance, "positive", clearance > 0.0)?;
        Ok(Self { clearance })
    }
}

impl Law for Gap {
    fn value(&self, q: f64, _: f64) -> f64 {
        q - q.clamp(-self.clearance, self.clearance)
    }

    fn slopes(&self, q: f64, _: f64) -> [f64; 2] {
        [f64::from(u8::from(q.abs() > self.clearance)), 0.0]
    }

    fn dimension(&self) -> [i32; 2] {
        [1, 0]
    }

    fn expression(&self, q: &str, _: &str) -> String {
        format!("gap({q}, {})", self.clearance)
    }

    fn constants(&self) -> Vec<Constant> {
        vec![Constant { name: "a", unit: "m", value: self.clearance }]
    }

    fn with_constants(&self, values: &[f64]) -> Option<Arc<dyn Law>> {
        let [clearance] = values else { return None };
        Some(Arc::new(Self::new(*clearance).ok()?))
    }
}

/// Regularised Coulomb friction tanh(q̇/b); its coefficient is the sliding force. Below the
/// velocity b the contact creeps, whereas with dry friction it sticks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Friction {
    velocity: f64,
}

impl Friction {
    /// Creates a friction law with the velocity b (m/s) above which the contact slides.
    ///
    /// # Errors
    /// [`ModelError::Parameter`] unless b is positive and finite.
    pub fn new(velocity: f64) -> Result<Self, ModelError> {
        require("velocity of a friction", velocity, "positive", velocity > 0.0)?;
        Ok(Self { velocity })
    }
}

impl Law for Friction {
    fn value(&self, _: f64, v: f64) -> f64 {
        (v / self.velocity).tanh()
    }

    fn slopes(&self, _: f64, v: f64) -> [f64; 2] {
        let part = (v / self.velocity).tanh();
        [0.0, (1.0 - part * part) / self.velocity]
    }

    fn dimension(&self) -> [i32; 2] {
        [0, 0]
    }

    fn expression(&self, _: &str, v: &str) -> String {
        format!("tanh({v}/{})", self.velocity)
    }

    fn constants(&self) -> Vec<Constant> {
        vec![Constant { name: "b", unit: "m/s", value: self.velocity }]
    }

    fn with_constants(&self, values: &[f64]) -> Option<Arc<dyn Law>> {
        let [velocity] = values else { return None };
        Some(Arc::new(Self::new(*velocity).ok()?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_are_the_derivatives_of_the_values() {
        let laws: [Box<dyn Law>; 8] = [
            Box::new(Power::new(2, 0).unwrap()),
            Box::new(Power::new(3, 1).unwrap()),
            Box::new(Power::new(0, 3).unwrap()),
            Box::new(Power::new(0, 0).unwrap()),
            Box::new(QuadraticDamping),
            Box::new(SaturatingDamping::new(0.7).unwrap()),
            Box::new(Gap::new(0.5).unwrap()),
            Box::new(Friction::new(0.4).unwrap()),
        ];
        for law in laws {
            for (q, v) in [(0.3, -0.5), (-1.2, 0.8), (0.0, 0.0)] {
                let h = 1e-6;
                let central = [
                    (law.value(q + h, v) - law.value(q - h, v)) / (2.0 * h),
                    (law.value(q, v + h) - law.value(q, v - h)) / (2.0 * h),
                ];
                for (exact, difference) in law.slopes(q, v).into_iter().zip(central) {
                    // The error of the central difference is in proportion to h² times the third
                    // derivative, plus rounding divided by h.
                    assert!((exact - difference).abs() < 1e-5, "{law:?} at {q}, {v}");
                }
            }
        }
    }

    #[test]
    fn linear_laws_and_impossible_constants_are_refused() {
        assert!(Power::new(1, 0).unwrap_err().to_string().contains("an entry of K or C"));
        assert!(Power::new(0, 1).is_err() && Power::new(10, 0).is_err());
        for b in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(SaturatingDamping::new(b).is_err() && Gap::new(b).is_err());
            assert!(Friction::new(b).is_err());
        }
        let law = SaturatingDamping::new(2.0).unwrap();
        assert_eq!(law.with_constants(&[3.0]).unwrap().constants()[0].value, 3.0);
        assert!(law.with_constants(&[-3.0]).is_none() && law.with_constants(&[]).is_none());
        let gap = Gap::new(2.0).unwrap().with_constants(&[0.5]).unwrap();
        assert_eq!([-0.75, 0.4, 1.5].map(|q| gap.value(q, 9.0)), [-0.25, 0.0, 1.0]);
        let friction = Friction::new(2.0).unwrap().with_constants(&[0.5]).unwrap();
        assert_eq!(friction.value(9.0, -0.5), -1f64.tanh());
    }
}
