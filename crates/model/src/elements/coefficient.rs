//! Known and unknown coefficients of elements, with bounds and prior knowledge.

use super::MachineError;

/// Prior knowledge of an unknown coefficient: a normal distribution.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Prior {
    /// Mean, in the unit of the coefficient.
    pub mean: f64,
    /// Standard deviation, in the unit of the coefficient.
    pub standard_deviation: f64,
}

/// Unknown coefficient: initial value of the search, bounds and prior, all in the unit of the
/// coefficient.
#[derive(Debug, Clone, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields, default))]
pub struct FreeCoefficient {
    /// Initial value of the search, in the unit of the coefficient; by default the mean of the
    /// prior, or a value between the bounds.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    pub start: Option<f64>,
    /// Lower bound, in the unit of the coefficient.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    pub min: Option<f64>,
    /// Upper bound, in the unit of the coefficient.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    pub max: Option<f64>,
    /// Mean and standard deviation of prior knowledge.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    pub prior: Option<Prior>,
}

impl FreeCoefficient {
    /// Creates an unknown coefficient without bounds, with the initial value of its search.
    pub fn from_start(start: f64) -> Self {
        Self { start: Some(start), ..Self::default() }
    }

    /// Returns the coefficient with a lower bound.
    #[must_use]
    pub fn at_least(self, min: f64) -> Self {
        Self { min: Some(min), ..self }
    }

    /// Returns the coefficient with an upper bound.
    #[must_use]
    pub fn at_most(self, max: f64) -> Self {
        Self { max: Some(max), ..self }
    }

    /// Returns the coefficient with prior knowledge: a mean and a standard deviation.
    #[must_use]
    pub fn with_prior(self, mean: f64, standard_deviation: f64) -> Self {
        Self { prior: Some(Prior { mean, standard_deviation }), ..self }
    }

    /// Checks that the numbers are consistent and returns the initial value of the search.
    pub(super) fn checked_start(&self, name: &str) -> Result<f64, MachineError> {
        let name = || name.to_owned();
        let prior = self.prior.map(|prior| [prior.mean, prior.standard_deviation]);
        let numbers = [self.start, self.min, self.max].into_iter().flatten();
        if let Some(value) = numbers.chain(prior.into_iter().flatten()).find(|v| !v.is_finite()) {
            return Err(MachineError::NotFinite { name: name(), value });
        }
        let (min, max) = (self.min.unwrap_or(f64::NEG_INFINITY), self.max.unwrap_or(f64::INFINITY));
        if min >= max {
            return Err(MachineError::Bounds { name: name(), min, max });
        }
        if let Some(prior) = self.prior.filter(|prior| prior.standard_deviation <= 0.0) {
            let standard_deviation = prior.standard_deviation;
            return Err(MachineError::PriorDeviation { name: name(), standard_deviation });
        }
        let between = self.min.zip(self.max).map(|(min, max)| match min > 0.0 {
            // The geometric mean suits bounds between which the order of magnitude is unknown.
            true => (min * max).sqrt(),
            false => 0.5 * (min + max),
        });
        let prior = self.prior.map(|prior| prior.mean.clamp(min, max));
        let start = self.start.or(prior).or(between);
        let start = start.ok_or_else(|| MachineError::NoStart { name: name() })?;
        if start < min || start > max {
            return Err(MachineError::StartOutside { name: name(), start, min, max });
        }
        Ok(start)
    }
}

/// Coefficient of an element.
#[derive(Debug, Clone, PartialEq)]
pub enum Coefficient {
    /// A known value, in the unit of the coefficient.
    Known(f64),
    /// A separate unknown.
    Free(FreeCoefficient),
    /// The unknown of this name among [`Machine::parameters`](super::Machine::parameters), which
    /// several coefficients may share.
    Shared(String),
}

impl Default for Coefficient {
    fn default() -> Self {
        Self::Known(0.0)
    }
}

impl From<f64> for Coefficient {
    fn from(value: f64) -> Self {
        Self::Known(value)
    }
}

impl From<FreeCoefficient> for Coefficient {
    fn from(free: FreeCoefficient) -> Self {
        Self::Free(free)
    }
}

impl Coefficient {
    /// Returns whether this is a known zero, which has the same effect as no coefficient.
    pub fn is_zero(&self) -> bool {
        *self == Self::Known(0.0)
    }
}

#[cfg(feature = "serde")]
mod form {
    use std::fmt;

    use serde::de::value::MapAccessDeserializer;
    use serde::de::{MapAccess, Visitor};
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    use super::{Coefficient, FreeCoefficient};

    impl Serialize for Coefficient {
        fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
            match self {
                Self::Known(value) => serializer.serialize_f64(*value),
                Self::Shared(name) => serializer.serialize_str(name),
                Self::Free(free) => free.serialize(serializer),
            }
        }
    }

    impl<'de> Deserialize<'de> for Coefficient {
        fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
            deserializer.deserialize_any(AnyForm)
        }
    }

    /// Visitor that reads a number, a name or an unknown.
    struct AnyForm;

    impl<'de> Visitor<'de> for AnyForm {
        type Value = Coefficient;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str(
                "a number, the name of a shared parameter, or an unknown such as \
                 {\"start\": 1.0, \"min\": 0.0}",
            )
        }

        fn visit_f64<E>(self, value: f64) -> Result<Coefficient, E> {
            Ok(Coefficient::Known(value))
        }

        fn visit_i64<E>(self, value: i64) -> Result<Coefficient, E> {
            Ok(Coefficient::Known(value as f64))
        }

        fn visit_u64<E>(self, value: u64) -> Result<Coefficient, E> {
            Ok(Coefficient::Known(value as f64))
        }

        fn visit_str<E>(self, name: &str) -> Result<Coefficient, E> {
            Ok(Coefficient::Shared(name.to_owned()))
        }

        fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Coefficient, A::Error> {
            FreeCoefficient::deserialize(MapAccessDeserializer::new(map)).map(Coefficient::Free)
        }
    }
}
