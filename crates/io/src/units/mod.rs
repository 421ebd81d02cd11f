//! Units of forces, responses, times and frequencies.

mod expression;
mod header;
mod notes;
mod other_unit;
mod plain;
mod unit_words;
mod vocabulary;
mod words;

use std::fmt;

use mechid_model::ResponseQuantity;

use self::expression::Expression;
pub use self::header::{Evidence, StatedUnit};
pub(crate) use self::header::{
    label_notes, name_without_brackets, names_without_unit, stated, without_unit,
};
pub(crate) use self::plain::number_and_rest;
use self::vocabulary::Dimension;

/// Quantity that the numbers of a column measure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Quantity {
    /// A force, in N.
    Force,
    /// A response, in m, m/s or m/s².
    Response(ResponseQuantity),
    /// A time, in s.
    Time,
    /// A frequency, in Hz.
    Frequency,
}

impl Quantity {
    /// A displacement, in m.
    pub const DISPLACEMENT: Self = Self::Response(ResponseQuantity::Displacement);
    /// A velocity, in m/s.
    pub const VELOCITY: Self = Self::Response(ResponseQuantity::Velocity);
    /// An acceleration, in m/s².
    pub const ACCELERATION: Self = Self::Response(ResponseQuantity::Acceleration);

    /// Returns the SI unit of the quantity.
    pub fn si(self) -> &'static str {
        match self {
            Self::Force => "N",
            Self::Response(quantity) => quantity.unit(),
            Self::Time => "s",
            Self::Frequency => "Hz",
        }
    }

    fn from_dimension(dimension: Dimension) -> Option<Self> {
        Some(match dimension {
            Dimension::FORCE => Self::Force,
            Dimension::LENGTH => Self::DISPLACEMENT,
            Dimension::VELOCITY => Self::VELOCITY,
            Dimension::ACCELERATION => Self::ACCELERATION,
            Dimension::TIME => Self::Time,
            Dimension::FREQUENCY => Self::Frequency,
            _ => return None,
        })
    }
}

impl From<ResponseQuantity> for Quantity {
    fn from(quantity: ResponseQuantity) -> Self {
        Self::Response(quantity)
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Force => f.write_str("force"),
            Self::Response(quantity) => quantity.fmt(f),
            Self::Time => f.write_str("time"),
            Self::Frequency => f.write_str("frequency"),
        }
    }
}

/// A unit of a force, a response, a time or a frequency.
///
/// ```
/// use mechid_io::{Quantity, Unit};
///
/// let unit = Unit::parse("mm/s^2").unwrap();
/// assert_eq!((unit.quantity, unit.in_si), (Quantity::ACCELERATION, 1e-3));
/// assert_eq!(Unit::parse("LBS").unwrap().quantity, Quantity::Force);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Unit {
    /// Name in its original form.
    pub name: String,
    /// Measured quantity.
    pub quantity: Quantity,
    /// Size in N, m, m/s, m/s², s or Hz.
    pub in_si: f64,
}

impl Unit {
    /// Reads a unit in one of its usual spellings, such as `kN`, `lbs`, `mm/s^2`, `in.` or `G`;
    /// `None` for other text and for units of other quantities.
    pub fn parse(text: &str) -> Option<Self> {
        let Expression { dimension, in_si } = Expression::parse(text)?;
        let quantity = Quantity::from_dimension(dimension)?;
        Some(Self { name: text.trim().into(), quantity, in_si })
    }
}

/// Returns what a column states about its unit: in its `name`, or as a separate text `unit` (in a
/// line of units, a label or an attribute). If a quantity is `wanted`, its units are also
/// recognised as words of the name.
pub fn stated_unit(name: &str, unit: &str, wanted: Option<Quantity>) -> Option<StatedUnit> {
    stated(name, unit, wanted)
}

/// Returns the name of a column without the unit that it states.
pub fn name_without_unit(name: &str) -> String {
    without_unit(name)
}

/// Returns whether a word means a quantity: `time`, `Frequenz`.
pub(crate) fn names_quantity(word: &str, quantity: Quantity) -> bool {
    words::is_quantity_word(word, quantity)
}

/// Returns whether a text is a unit of any quantity, known to [`Quantity`] or not.
pub(crate) fn is_unit(text: &str) -> bool {
    Expression::parse(text).is_some()
}

/// Returns the text of the unit that a text above a column states, clearly or not. The result is
/// empty if the text states no unit, or if it is a number with a unit, which is a sensitivity or a
/// range.
pub(crate) fn unit_text(text: &str) -> String {
    let stated = stated(text, "", None).filter(|_| number_and_rest(text).is_none());
    stated.map_or(String::new(), |stated| stated.text)
}

/// Returns whether a text above a column states a unit or has a word that means a quantity.
pub(crate) fn is_named_quantity(text: &str) -> bool {
    let has_quantity = || {
        let words = words::split_words(text);
        words.into_iter().any(|word| words::quantity_word(&text[word]).is_some())
    };
    !unit_text(text).is_empty() || has_quantity()
}

/// Unit of a frequency response: a response over a force, or the inverse.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ResponseUnit {
    /// Measured response.
    pub quantity: ResponseQuantity,
    /// `true` for a force over a response: dynamic stiffness, mechanical impedance, apparent mass.
    pub is_inverse: bool,
    /// Size of the unit, in the SI unit of the same ratio.
    pub in_si: f64,
}

impl ResponseUnit {
    /// Reads the unit of a frequency response, such as `g/N`, `m/(s²·N)`, `mm/N`, `N/m` or `kg`.
    pub fn parse(text: &str) -> Option<Self> {
        let Expression { dimension, in_si } = Expression::parse(text)?;
        ResponseQuantity::ALL.into_iter().find_map(|quantity| {
            let motion = match quantity {
                ResponseQuantity::Displacement => Dimension::LENGTH,
                ResponseQuantity::Velocity => Dimension::VELOCITY,
                ResponseQuantity::Acceleration => Dimension::ACCELERATION,
            };
            let ratio = motion.times(Dimension::FORCE, -1)?;
            let inverse = Dimension::FORCE.times(motion, -1)?;
            let is_inverse = dimension == inverse;
            (is_inverse || dimension == ratio).then_some(Self { quantity, is_inverse, in_si })
        })
    }
}
