//! Units of forces and motions that columns say by their names or in a line of units.

use std::fmt;

use mechid_model::ResponseQuantity;

use super::time_unit;

/// Quantity that the numbers of a column measure, as far as a unit tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// A force, in N.
    Force,
    /// A response, in m, m/s or m/s².
    Response(ResponseQuantity),
}

impl Quantity {
    const DISPLACEMENT: Self = Self::Response(ResponseQuantity::Displacement);
    const VELOCITY: Self = Self::Response(ResponseQuantity::Velocity);
    const ACCELERATION: Self = Self::Response(ResponseQuantity::Acceleration);

    /// SI unit of the quantity.
    pub fn si(self) -> &'static str {
        match self {
            Self::Force => "N",
            Self::Response(quantity) => quantity.unit(),
        }
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
        }
    }
}

/// A unit of a force or a motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    /// Common name.
    pub name: &'static str,
    /// Quantity that it measures.
    pub quantity: Quantity,
    /// Size in N, m, m/s or m/s².
    pub in_si: f64,
}

/// Standard gravity, in m/s².
const G: f64 = 9.80665;

/// An inch, in m.
const INCH: f64 = 0.0254;

const fn unit(name: &'static str, quantity: Quantity, in_si: f64) -> Unit {
    Unit { name, quantity, in_si }
}

/// Exact by definition: the pound since 1959, g and with it the kilopond since 1901.
const UNITS: [Unit; 32] = {
    use Quantity::Force;
    const DISPLACEMENT: Quantity = Quantity::DISPLACEMENT;
    const VELOCITY: Quantity = Quantity::VELOCITY;
    const ACCELERATION: Quantity = Quantity::ACCELERATION;
    [
        unit("N", Force, 1.0),
        unit("mN", Force, 1e-3),
        unit("daN", Force, 10.0),
        unit("kN", Force, 1e3),
        unit("MN", Force, 1e6),
        unit("kgf", Force, G),
        unit("kp", Force, G),
        unit("lbf", Force, 0.45359237 * G),
        unit("kip", Force, 453.59237 * G),
        unit("m", DISPLACEMENT, 1.0),
        unit("cm", DISPLACEMENT, 1e-2),
        unit("mm", DISPLACEMENT, 1e-3),
        unit("µm", DISPLACEMENT, 1e-6),
        unit("um", DISPLACEMENT, 1e-6),
        unit("nm", DISPLACEMENT, 1e-9),
        unit("in", DISPLACEMENT, INCH),
        unit("mil", DISPLACEMENT, 1e-3 * INCH),
        unit("mils", DISPLACEMENT, 1e-3 * INCH),
        unit("ft", DISPLACEMENT, 12.0 * INCH),
        unit("m/s", VELOCITY, 1.0),
        unit("cm/s", VELOCITY, 1e-2),
        unit("mm/s", VELOCITY, 1e-3),
        unit("µm/s", VELOCITY, 1e-6),
        unit("in/s", VELOCITY, INCH),
        unit("ft/s", VELOCITY, 12.0 * INCH),
        unit("m/s²", ACCELERATION, 1.0),
        unit("cm/s²", ACCELERATION, 1e-2),
        unit("mm/s²", ACCELERATION, 1e-3),
        unit("in/s²", ACCELERATION, INCH),
        unit("ft/s²", ACCELERATION, 12.0 * INCH),
        unit("g", ACCELERATION, G),
        unit("gal", ACCELERATION, 1e-2),
    ]
};

/// Units that a name may end with after `_` or a blank: those that no other word ends with.
const BARE: [&str; 6] = ["kN", "mm", "µm", "um", "mm/s", "m/s²"];

/// Characters of a unit, at most.
const MOST_OF_A_UNIT: usize = 8;

impl Unit {
    /// The unit that a column states: at the end of its `name`, in brackets (`Force [kN]`, `x (mm)`)
    /// or after a stroke (`F / kN`), without them where no word is like it (`x_mm`), or as the
    /// whole of what the line of units has for it, `about`.
    pub fn of(name: &str, about: &str) -> Option<Self> {
        Self::at_end(name.trim()).or_else(|| Self::known(about))
    }

    /// The text of a unit that a column states in square brackets or in the line of units, if it is none that is
    /// known.
    pub(super) fn unknown<'a>(name: &'a str, about: &'a str) -> Option<&'a str> {
        let bracketed = name.trim().strip_suffix(']').and_then(|inner| inner.rsplit_once('['));
        let stated = bracketed.map_or(about, |(_, stated)| stated).trim();
        let is_part = |c: char| c.is_alphabetic() || "/^2²·*".contains(c);
        let is_unit = stated.starts_with(char::is_alphabetic)
            && stated.chars().all(is_part)
            && stated.chars().count() <= MOST_OF_A_UNIT;
        (is_unit && Self::of(name, about).is_none()).then_some(stated)
    }

    /// Name of a column without the unit at its end (`Fx` of `Fx [N]`): brackets whatever they hold, or
    /// otherwise a unit that is known.
    pub fn without(name: &str) -> &str {
        without_unit(name)
    }

    fn at_end(name: &str) -> Option<Self> {
        for (open, close) in [('[', ']'), ('(', ')')] {
            if let Some(inner) = name.strip_suffix(close) {
                return inner.rfind(open).and_then(|at| Self::known(&inner[at + 1..]));
            }
        }
        // `F/kN` and `v / mm/s`: the quantity stands before the first stroke.
        if let Some((before, unit)) = name.split_once('/')
            && Self::known(before).is_none()
            && let Some(unit) = Self::known(unit)
        {
            return Some(unit);
        }
        let (_, unit) = name.rsplit_once(['_', ' '])?;
        Self::known(unit).filter(|unit| BARE.contains(&unit.name))
    }

    /// A unit as people write it.
    fn known(text: &str) -> Option<Self> {
        let text = text.trim().trim_matches(['[', ']', '(', ')']).trim();
        let text = text.replace('μ', "µ").replace("um/", "µm/").replace("sec", "s");
        let text = text.replace("^2", "²").replace("**2", "²").replace("s2", "s²");
        let text = text.replace("/s/s", "/s²").replace("m s-2", "m/s²").replace("m s-1", "m/s");
        UNITS.into_iter().find(|unit| unit.name == text)
    }
}

/// A name without the unit at its end, in brackets whatever they hold, or otherwise if it is a unit
/// that is known.
pub(super) fn without_unit(name: &str) -> &str {
    let name = name.trim();
    for (open, close) in [('[', ']'), ('(', ')')] {
        if let Some(inner) = name.strip_suffix(close) {
            return inner.rfind(open).map_or(name, |at| inner[..at].trim_end());
        }
    }
    if Unit::known(name).is_some() {
        return name;
    }
    if Unit::at_end(name).is_none() {
        return time_unit::without_unit(name);
    }
    let stroke = name.split_once('/').filter(|(_, unit)| Unit::known(unit).is_some());
    let bare = || name.rsplit_once(['_', ' ']);
    stroke.or_else(bare).map_or(name, |(name, _)| name.trim_end())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_read_where_people_write_them() {
        use Quantity::Force;
        for (name, about, quantity, in_si) in [
            ("Force [kN]", "", Force, 1e3),
            ("x (mm)", "", Quantity::DISPLACEMENT, 1e-3),
            ("F / kN", "", Force, 1e3),
            ("F/N", "", Force, 1.0),
            ("v / mm/s", "", Quantity::VELOCITY, 1e-3),
            ("Acc [m/s^2]", "", Quantity::ACCELERATION, 1.0),
            ("Acc (m/s2)", "", Quantity::ACCELERATION, 1.0),
            ("a [g]", "", Quantity::ACCELERATION, 9.80665),
            ("Shaft x [µm]", "", Quantity::DISPLACEMENT, 1e-6),
            ("Shaft x [μm]", "", Quantity::DISPLACEMENT, 1e-6),
            ("x_mm", "", Quantity::DISPLACEMENT, 1e-3),
            ("Disp um", "", Quantity::DISPLACEMENT, 1e-6),
            ("Disp", "[mil]", Quantity::DISPLACEMENT, 25.4e-6),
            ("Load", "lbf", Force, 4.448_221_615_260_5),
            ("Vibration", "in/sec", Quantity::VELOCITY, 0.0254),
        ] {
            let unit = Unit::of(name, about).unwrap_or_else(|| panic!("{name} {about}"));
            assert_eq!(unit.quantity, quantity, "{name} {about}");
            assert!((unit.in_si / in_si - 1.0).abs() < 1e-15, "{name} {about}: {}", unit.in_si);
        }
    }

    #[test]
    fn units_that_are_not_known_are_told() {
        for (name, about, unknown) in [
            ("Disp [µin]", "", Some("µin")),
            ("Force", "mV", Some("mV")),
            ("x [V]", "mm", None),
            ("Force [kN]", "", None),
            ("Force [shaker 1]", "", None),
            ("Force [1]", "", None),
            ("Force (left)", "", None),
            ("x", "", None),
        ] {
            assert_eq!(Unit::unknown(name, about), unknown, "{name} {about}");
        }
    }

    #[test]
    fn a_name_is_what_stands_before_the_unit() {
        for (name, bare) in [
            ("Fx [N]", "Fx"),
            ("Force [shaker 1]", "Force"),
            ("x (µm)", "x"),
            ("F / kN", "F"),
            ("v/mm/s", "v"),
            ("x_mm", "x"),
            ("Disp um", "Disp"),
            ("time_ms", "time"),
            ("Time / s", "Time"),
            ("a", "a"),
            ("x_m", "x_m"),
            ("F / V", "F / V"),
            ("m/s", "m/s"),
            ("[N]", ""),
            ("N]", "N]"),
            ("", ""),
        ] {
            assert_eq!(without_unit(name), bare, "{name}");
        }
    }

    #[test]
    fn what_is_no_unit_is_left_alone() {
        for (name, about) in [
            ("force", ""),
            ("force_in", ""),
            ("x_m", ""),
            ("velocity_N", ""),
            ("channel g", ""),
            ("Force [shaker 1]", ""),
            ("Force [V]", ""),
            ("mm", ""),
            ("m/s", ""),
            ("time [s]", "s"),
            ("x", "driving point"),
            ("", ""),
        ] {
            assert_eq!(Unit::of(name, about), None, "{name} {about}");
        }
    }
}
