//! Displacement, velocity or acceleration.

use std::fmt;
use std::str::FromStr;

use nalgebra::Complex;

use crate::ModelError;

/// Measured quantity of a response: displacement, velocity or acceleration.
///
/// ```
/// use mechid_model::ResponseQuantity;
///
/// let measured: ResponseQuantity = "acceleration".parse()?;
/// assert_eq!(measured.unit(), "m/s²");
/// assert_eq!(measured.per_displacement(3.0).re, -9.0);
/// # Ok::<(), mechid_model::ModelError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum ResponseQuantity {
    /// Displacement x, in m.
    Displacement,
    /// Velocity ẋ, in m/s.
    Velocity,
    /// Acceleration ẍ, in m/s².
    Acceleration,
}

impl ResponseQuantity {
    /// All three quantities, in ascending order of the derivative.
    pub const ALL: [Self; 3] = [Self::Displacement, Self::Velocity, Self::Acceleration];

    /// Returns the order d of the time derivative of the displacement: 0, 1 or 2.
    pub fn derivative_order(self) -> usize {
        self as usize
    }

    /// Returns the amplitude per unit of displacement at `omega` (rad/s): (iω)^d, which is 1, iω or
    /// −ω².
    pub fn per_displacement(self, omega: f64) -> Complex<f64> {
        match self {
            Self::Displacement => Complex::new(1.0, 0.0),
            Self::Velocity => Complex::new(0.0, omega),
            Self::Acceleration => Complex::new(-omega * omega, 0.0),
        }
    }

    /// Returns the SI unit (translational degrees of freedom): m, m/s or m/s².
    pub fn unit(self) -> &'static str {
        match self {
            Self::Displacement => "m",
            Self::Velocity => "m/s",
            Self::Acceleration => "m/s²",
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Displacement => "displacement",
            Self::Velocity => "velocity",
            Self::Acceleration => "acceleration",
        }
    }
}

impl fmt::Display for ResponseQuantity {
    /// Writes `displacement`, `velocity` or `acceleration`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for ResponseQuantity {
    type Err = ModelError;

    fn from_str(text: &str) -> Result<Self, ModelError> {
        Self::ALL.into_iter().find(|quantity| quantity.name() == text).ok_or_else(|| {
            ModelError::UnknownName {
                what: "response quantity",
                name: text.to_owned(),
                known: "displacement, velocity, acceleration",
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn order_factor_and_name_belong_together() {
        let omega = 2.5;
        for (order, quantity) in ResponseQuantity::ALL.into_iter().enumerate() {
            assert_eq!(quantity.derivative_order(), order);
            let factor = Complex::new(0.0, omega).powu(order as u32);
            assert!((quantity.per_displacement(omega) - factor).norm() < 1e-15);
            assert_eq!(quantity.to_string().parse(), Ok(quantity));
        }
        assert_eq!(
            "speed".parse::<ResponseQuantity>().unwrap_err().to_string(),
            "there is no response quantity `speed`: choose one of displacement, velocity, acceleration"
        );
    }
}
