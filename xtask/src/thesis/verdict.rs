//! Agreement of a computed number with the printed digits.

/// Agreement of a printed number with the number computed by the dissertation's method.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Verdict {
    /// Truncating or rounding our value to the printed decimals gives the printed string.
    ToTheDigit,
    /// The printed number is wrong by one unit in its last place: it was rounded twice, or computed
    /// from other printed numbers.
    Rounding,
    /// A known misprint; the reason is in the list of misprints.
    Misprint,
    /// A difference without a known reason.
    Unexplained,
}

impl Verdict {
    /// All verdicts, best first.
    pub const ALL: [Verdict; 4] =
        [Verdict::ToTheDigit, Verdict::Rounding, Verdict::Misprint, Verdict::Unexplained];

    /// Returns the word for the verdict in the tables.
    pub fn words(self) -> &'static str {
        match self {
            Verdict::ToTheDigit => "to the digit",
            Verdict::Rounding => "rounding",
            Verdict::Misprint => "misprint",
            Verdict::Unexplained => "unexplained",
        }
    }
}

/// A printed decimal number, as an integer number of units of its last place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Decimal {
    units: i64,
    places: u32,
}

impl Decimal {
    fn parse(printed: &str) -> Option<Self> {
        let places = printed.split_once('.').map_or(0, |(_, fraction)| fraction.len());
        let units = printed.replace('.', "").parse().ok()?;
        Some(Self { units, places: u32::try_from(places).ok()? })
    }
}

/// Compares `value` with a printed number by its printed digits alone.
///
/// Returns [`Verdict::Unexplained`] if neither truncation, rounding nor a slip of one unit in the
/// last place explains the difference; the caller decides whether it is a known misprint.
pub fn compare(value: f64, printed: &str) -> Verdict {
    let Some(decimal) = Decimal::parse(printed) else { return Verdict::Unexplained };
    let scaled = value * 10f64.powi(decimal.places as i32);
    // A value that is below the printed number only by rounding of its last bit must not be
    // truncated to the next smaller decimal.
    let slack = 1e-9 * scaled.abs().max(1.0);
    let truncated = (scaled.trunc(), (scaled + scaled.signum() * slack).trunc());
    let printed = decimal.units as f64;
    if [truncated.0, truncated.1, scaled.round()].contains(&printed) {
        Verdict::ToTheDigit
    } else if (scaled - printed).abs() <= 1.0 + slack {
        Verdict::Rounding
    } else {
        Verdict::Unexplained
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn truncation_and_rounding_give_the_digits() {
        for (value, printed) in [
            (17.2789, "17.27"),
            (17.2789, "17.28"),
            (-6.3418, "-6.341"),
            (5112.6, "5113"),
            (0.3, "0.30"),
            (2.15, "2.15"),
        ] {
            assert_eq!(compare(value, printed), Verdict::ToTheDigit, "{value} {printed}");
        }
    }

    #[test]
    fn a_value_rounded_twice_is_rounding() {
        assert_eq!(compare(4948.249, "4948.3"), Verdict::Rounding);
    }

    #[test]
    fn transposed_digits_and_lost_signs_are_not_excused() {
        for (value, printed) in [(4963.6, "4936"), (-6.3418, "6.341"), (13.1, "10.13"), (1.0, "x")]
        {
            assert_eq!(compare(value, printed), Verdict::Unexplained, "{value} {printed}");
        }
    }
}
