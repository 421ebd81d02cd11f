//! Assumptions on a force between its samples.

use std::fmt;
use std::str::FromStr;

use crate::ModelError;

/// Rule for the step of the state from one sample to the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Discretisation {
    /// z⁺ = z + Δt ż: Φ = I + AΔt, Γ = BΔt. The error is of order Δt.
    ///
    /// # Source
    /// Dissertation eqs. (4.5.9)–(4.5.12), (4.5.28).
    #[cfg_attr(feature = "serde", serde(rename = "euler"))]
    Euler,
    /// The force is constant from each sample to the next, as the output of a digital-to-analogue
    /// converter: Φ = exp(AΔt), Γ = ∫₀^Δt exp(As) ds B.
    ///
    /// # Source
    /// Åström & Wittenmark, *Computer-Controlled Systems*, 3rd ed. (1997), section 2.3 (zero-order
    /// hold).
    #[cfg_attr(feature = "serde", serde(rename = "held"))]
    ZeroOrderHold,
    /// The force is linear between samples: Φ = exp(AΔt), z⁺ = Φ z + Γ₀ F + Γ₁ F⁺, where Γ₀ + Γ₁ =
    /// ∫₀^Δt exp(As) ds B.
    #[cfg_attr(feature = "serde", serde(rename = "linear"))]
    FirstOrderHold,
}

impl Discretisation {
    /// All assumptions on a force between its samples.
    pub const ALL: [Self; 3] = [Self::Euler, Self::ZeroOrderHold, Self::FirstOrderHold];

    fn name(self) -> &'static str {
        match self {
            Self::Euler => "euler",
            Self::ZeroOrderHold => "held",
            Self::FirstOrderHold => "linear",
        }
    }
}

impl fmt::Display for Discretisation {
    /// Writes `euler`, `held` or `linear`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Discretisation {
    type Err = ModelError;

    fn from_str(text: &str) -> Result<Self, ModelError> {
        Self::ALL.into_iter().find(|rule| rule.name() == text).ok_or_else(|| {
            ModelError::UnknownName {
                what: "discretisation",
                name: text.to_owned(),
                known: "euler, held, linear",
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_back() {
        for rule in Discretisation::ALL {
            assert_eq!(rule.to_string().parse(), Ok(rule));
        }
        assert!("zoh".parse::<Discretisation>().is_err());
    }
}
