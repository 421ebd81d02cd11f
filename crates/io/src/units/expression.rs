//! Units as people write them: `m/s^2`, `mm s-2`, `in/sec²`, `ms^-2`, `g/N`, `m/(s²·N)`.

use super::vocabulary::{CASED, Dimension, Entry, VOCABULARY};

/// Maximum length of a unit, in bytes; a longer text is not a unit.
const MAX_BYTES: usize = 64;

/// Maximum depth of brackets in a unit.
const MAX_DEPTH: usize = 4;

/// Maximum magnitude of an exponent.
const MAX_POWER: i8 = 4;

/// Dimension of a unit and its size in SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Expression {
    pub dimension: Dimension,
    pub in_si: f64,
}

impl Expression {
    const ONE: Self = Self { dimension: Dimension::NONE, in_si: 1.0 };

    /// Reads a unit; `None` if the text is not a unit.
    pub fn parse(text: &str) -> Option<Self> {
        let text = text.trim();
        if text.is_empty() || text.len() > MAX_BYTES {
            return None;
        }
        if let Some(whole) = lookup(text) {
            return Some(whole);
        }
        let mut parser = Parser { rest: text, depth: 0, units: 0 };
        let product = parser.product()?;
        (parser.rest.trim().is_empty() && parser.units > 0).then_some(product)
    }

    fn times(self, other: Self, power: i8) -> Option<Self> {
        let dimension = self.dimension.times(other.dimension, power)?;
        let in_si = match power {
            1 => self.in_si * other.in_si,
            -1 => self.in_si / other.in_si,
            _ => self.in_si * other.in_si.powi(power.into()),
        };
        Some(Self { dimension, in_si })
    }
}

/// Returns the unit with this spelling. The case is ignored if only one unit has these letters.
fn lookup(word: &str) -> Option<Expression> {
    let word = word.replace('μ', "µ");
    let of = |entry: &Entry| Expression { dimension: entry.dimension, in_si: entry.in_si };
    let exact = VOCABULARY.iter().find(|entry| entry.spellings.contains(&word.as_str()));
    if let Some(entry) = exact {
        return Some(of(entry));
    }
    let mut matches = VOCABULARY.iter().filter(|entry| {
        let mut spellings = entry.spellings.iter().filter(|spelling| !CASED.contains(spelling));
        spellings.any(|spelling| spelling.eq_ignore_ascii_case(&word))
    });
    let first = matches.next()?;
    matches.next().is_none().then(|| of(first))
}

/// Parser of products and quotients of units.
struct Parser<'a> {
    rest: &'a str,
    depth: usize,
    /// Number of units so far.
    units: usize,
}

impl Parser<'_> {
    /// Reads factors up to the end or to a closing bracket.
    fn product(&mut self) -> Option<Expression> {
        let mut product = self.factor(1)?.times_into(Expression::ONE)?;
        loop {
            let sign = match self.operator() {
                Some(sign) => sign,
                None => return Some(product),
            };
            product = self.factor(sign)?.times_into(product)?;
        }
    }

    /// Reads the operator between two factors: 1 for a product, −1 for a quotient; `None` at the
    /// end.
    fn operator(&mut self) -> Option<i8> {
        let mut trimmed = self.rest.trim_start();
        let is_apart = trimmed.len() < self.rest.len();
        // The point belongs to an abbreviation: `in.`, `in./s²`.
        if let Some(rest) = trimmed.strip_prefix('.')
            && !rest.starts_with(char::is_alphabetic)
        {
            trimmed = rest.trim_start();
        }
        self.rest = trimmed;
        let mut chars = trimmed.chars();
        let (sign, rest) = match chars.next()? {
            '/' => (-1, chars.as_str()),
            '*' | '·' | '⋅' | '×' | '.' | '-' => (1, chars.as_str()),
            ')' => return None,
            _ if is_apart => match trimmed.split_at_checked("per ".len()) {
                Some((per, rest)) if per.eq_ignore_ascii_case("per ") => (-1, rest),
                _ => (1, trimmed),
            },
            _ => return None,
        };
        self.rest = rest;
        Some(sign)
    }

    /// Reads a unit, a 1 or a product in brackets, with its exponent.
    fn factor(&mut self, sign: i8) -> Option<Power> {
        self.rest = self.rest.trim_start();
        if let Some(rest) = self.rest.strip_prefix('(') {
            self.depth += 1;
            if self.depth > MAX_DEPTH {
                return None;
            }
            self.rest = rest;
            let inner = self.product()?;
            self.rest = self.rest.trim_start().strip_prefix(')')?;
            self.depth -= 1;
            return Some(Power { base: inner, power: sign * self.exponent()?.unwrap_or(1) });
        }
        if let Some(rest) = self.rest.strip_prefix('1')
            && rest.trim_start().starts_with('/')
        {
            self.rest = rest;
            return Some(Power { base: Expression::ONE, power: sign });
        }
        let is_letter = |c: char| c.is_alphabetic() && !"²³⁻".contains(c) || "°'\"″_".contains(c);
        let end = self.rest.find(|c| !is_letter(c)).unwrap_or(self.rest.len());
        let (word, rest) = self.rest.split_at(end);
        self.rest = rest;
        let power = self.exponent()?;
        self.units += 1;
        // `ms^-2` is m/s² and not 1/ms².
        let (base, power) = match (word, power) {
            ("ms", Some(negative @ ..0)) => {
                let per_time = Expression::ONE.times(lookup("s")?, negative)?;
                (per_time.times(lookup("m")?, 1)?, 1)
            }
            _ => (lookup(word)?, power.unwrap_or(1)),
        };
        Some(Power { base, power: sign * power })
    }

    /// Reads an exponent: `²`, `^2`, `**2`, `-2`, `2`; `Some(None)` if there is none.
    fn exponent(&mut self) -> Option<Option<i8>> {
        let digits: String = self.rest.chars().map_while(raised).collect();
        if !digits.is_empty() {
            self.rest =
                &self.rest[self.rest.chars().take(digits.len()).map(char::len_utf8).sum()..];
            return self.power_of(&digits).map(Some);
        }
        let (marked, rest) = match self.rest.strip_prefix("**").or(self.rest.strip_prefix('^')) {
            Some(rest) => (true, rest),
            None => (false, self.rest),
        };
        let (bracketed, rest) = match rest.strip_prefix(['(', '{']).filter(|_| marked) {
            Some(rest) => (true, rest),
            None => (false, rest),
        };
        let minus = rest.starts_with(['-', '−', '⁻']);
        let unsigned = rest.strip_prefix(['-', '−', '⁻', '+']).unwrap_or(rest);
        let len = unsigned.find(|c: char| !c.is_ascii_digit()).unwrap_or(unsigned.len());
        if len == 0 {
            return (!marked).then_some(None);
        }
        // The 1 of `g1` is the number of a measurement point, not an exponent.
        if !marked && !minus && &unsigned[..len] == "1" {
            return None;
        }
        let digits = format!("{}{}", if minus { "-" } else { "" }, &unsigned[..len]);
        self.rest = &unsigned[len..];
        if bracketed {
            self.rest = self.rest.strip_prefix([')', '}'])?;
        }
        self.power_of(&digits).map(Some)
    }

    fn power_of(&self, digits: &str) -> Option<i8> {
        digits.parse().ok().filter(|power: &i8| (1..=MAX_POWER).contains(&power.abs()))
    }
}

/// Factor of a product.
struct Power {
    base: Expression,
    power: i8,
}

impl Power {
    fn times_into(self, product: Expression) -> Option<Expression> {
        product.times(self.base, self.power)
    }
}

/// Returns the plain character of a superscript.
fn raised(c: char) -> Option<char> {
    Some(match c {
        '⁻' => '-',
        '¹' => '1',
        '²' => '2',
        '³' => '3',
        '⁴' => '4',
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn si(text: &str) -> Option<([i8; 3], f64)> {
        let Expression { dimension: Dimension([l, t, f, ..]), in_si } = Expression::parse(text)?;
        Some(([l, t, f], in_si))
    }

    /// Products and quotients of units have the dimension and the size that a calculation by hand
    /// gives from the definitions of the units.
    #[test]
    fn products_and_quotients_have_their_dimension_and_size() {
        let acceleration = [1, -2, 0];
        for (text, dimension, factor) in [
            ("m/s²", acceleration, 1.0),
            ("m/s^2", acceleration, 1.0),
            ("m/s**2", acceleration, 1.0),
            ("m/s2", acceleration, 1.0),
            ("m/s/s", acceleration, 1.0),
            ("m s-2", acceleration, 1.0),
            ("m·s⁻²", acceleration, 1.0),
            ("m.s^-2", acceleration, 1.0),
            ("m s^{-2}", acceleration, 1.0),
            ("ms^-2", acceleration, 1.0),
            ("ms-2", acceleration, 1.0),
            ("M/S^2", acceleration, 1.0),
            ("m/sec^2", acceleration, 1.0),
            ("mm/s^2", acceleration, 1e-3),
            ("in/sec²", acceleration, 0.0254),
            ("in./s^2", acceleration, 0.0254),
            ("G", acceleration, 9.80665),
            ("gal", acceleration, 0.01),
            ("mm/s", [1, -1, 0], 1e-3),
            ("inches per second", [1, -1, 0], 0.0254),
            ("MM PER S", [1, -1, 0], 1e-3),
            ("MM PER S2", acceleration, 1e-3),
            ("ips", [1, -1, 0], 0.0254),
            ("km/h", [1, -1, 0], 1.0 / 3.6),
            ("in.", [1, 0, 0], 0.0254),
            ("MM", [1, 0, 0], 1e-3),
            ("μm", [1, 0, 0], 1e-6),
            ("KN", [0, 0, 1], 1e3),
            ("LBS", [0, 0, 1], 4.448_221_615_260_5),
            ("rad/s", [0, -1, 0], 0.5 / std::f64::consts::PI),
            ("1/min", [0, -1, 0], 1.0 / 60.0),
            ("g/N", [1, -2, -1], 9.80665),
            ("m/(s²·N)", [1, -2, -1], 1.0),
            ("(m/s^2)/N", [1, -2, -1], 1.0),
            ("m/s²/N", [1, -2, -1], 1.0),
            ("in/lbf", [1, 0, -1], 0.0254 / 4.448_221_615_260_5),
            ("N s/m", [-1, 1, 1], 1.0),
        ] {
            let (exponents, size) = si(text).unwrap_or_else(|| panic!("{text}"));
            assert_eq!(exponents, dimension, "{text}");
            assert!((size / factor - 1.0).abs() < 1e-14, "{text}: {size}");
        }
    }

    #[test]
    fn other_text_is_no_unit() {
        // `mn` and `NM` may each mean two units.
        for text in [
            "",
            "left",
            "pk-pk",
            "shaker 1",
            "1",
            "/",
            "m/",
            "/s",
            "m^",
            "m^99",
            "(m",
            "m)",
            "mn",
            "NM",
            "((((((m))))))",
            "N m per",
            "50 g",
            "dB",
        ] {
            assert_eq!(si(text), None, "{text}");
        }
    }
}
