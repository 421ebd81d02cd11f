//! Parser of nonlinear terms.

use std::str::FromStr;
use std::sync::Arc;

use super::{
    Coordinate, Friction, Gap, Law, Power, QuadraticDamping, SaturatingDamping, Term, Terms,
};
use crate::ModelError;

/// Coordinate and its law.
type Factor = (Coordinate, Arc<dyn Law>);

impl FromStr for Terms {
    type Err = ModelError;

    /// Parses terms such as `k2: x1^2, c2: |v1| v1`; an empty text gives an empty list.
    ///
    /// # Errors
    /// [`ModelError::Term`] for a text that is not a term, [`ModelError::RepeatedTerm`].
    fn from_str(text: &str) -> Result<Self, ModelError> {
        match text.trim() {
            "" => Ok(Self::none()),
            text => Self::new(apart(text).map(str::parse).collect::<Result<_, _>>()?),
        }
    }
}

/// Splits `text` at the commas that are outside parentheses.
fn apart(text: &str) -> impl Iterator<Item = &str> {
    let mut depth = 0_usize;
    text.split(move |c| {
        match c {
            '(' => depth += 1,
            ')' => depth = depth.saturating_sub(1),
            _ => {}
        }
        c == ',' && depth == 0
    })
}

impl TryFrom<String> for Terms {
    type Error = ModelError;

    fn try_from(text: String) -> Result<Self, ModelError> {
        text.parse()
    }
}

impl FromStr for Term {
    type Err = ModelError;

    /// Parses a term such as `k3: x1^3`.
    ///
    /// # Errors
    /// [`ModelError::Term`].
    fn from_str(text: &str) -> Result<Self, ModelError> {
        let refused = |reason: String| ModelError::Term { text: text.trim().to_owned(), reason };
        let (name, expression) = text.split_once(':').ok_or_else(|| {
            refused("a term is written `name: expression`, such as `k3: x1^3`".to_owned())
        })?;
        let (coordinate, law) = Parser::new(expression).law().map_err(refused)?;
        Self::from_parts(name.trim().to_owned(), coordinate, law)
    }
}

/// Letter (displacement or velocity) and coordinate.
type Variable = (char, Coordinate);

/// Exponents in a product whose factors all have the same coordinate.
#[derive(Default)]
struct Product {
    coordinate: Option<Coordinate>,
    displacement: u32,
    velocity: u32,
    /// Number of factors |q̇|.
    absolute: u32,
}

struct Parser {
    /// The text without spaces.
    text: Vec<char>,
    at: usize,
}

impl Parser {
    fn new(text: &str) -> Self {
        Self { text: text.chars().filter(|c| !c.is_whitespace()).collect(), at: 0 }
    }

    fn law(mut self) -> Result<Factor, String> {
        if let Some(law) = self.function()? {
            return Ok(law);
        }
        let mut product = Product::default();
        while self.peek().is_some_and(|c| c != '/') {
            self.factor(&mut product)?;
        }
        let coordinate = product.coordinate.ok_or("there is no expression after the name")?;
        let bend = if self.take('/') { Some(self.saturation(coordinate)?) } else { None };
        let named = |error: ModelError| error.to_string();
        let law: Arc<dyn Law> =
            match (product.displacement, product.velocity, product.absolute, bend) {
                (0, 3, 0, Some(velocity)) => {
                    Arc::new(SaturatingDamping::new(velocity).map_err(named)?)
                }
                (.., Some(_)) => return Err("only v^3 can be divided".to_owned()),
                (p, r, 0, None) => Arc::new(Power::new(p, r).map_err(named)?),
                (0, 1, 1, None) => Arc::new(QuadraticDamping),
                _ => return Err("|v| is allowed only in |v| v".to_owned()),
            };
        Ok((coordinate, law))
    }

    /// Parses `gap(x1, 0.001)` or `tanh(v1/0.01)`; returns `None` if the text does not begin with a
    /// function.
    fn function(&mut self) -> Result<Option<Factor>, String> {
        let named = |error: ModelError| error.to_string();
        let factor: Factor = if self.take_word("gap(") {
            let (coordinate, clearance) =
                self.argument('x', ',').ok_or("a gap is written gap(x1, 0.001)")?;
            (coordinate, Arc::new(Gap::new(number(&clearance)?).map_err(named)?))
        } else if self.take_word("tanh(") {
            let (coordinate, velocity) =
                self.argument('v', '/').ok_or("friction is written tanh(v1/0.01)")?;
            (coordinate, Arc::new(Friction::new(number(&velocity)?).map_err(named)?))
        } else {
            return Ok(None);
        };
        match self.peek() {
            None => Ok(Some(factor)),
            Some(c) => Err(format!("unexpected {c} after the expression")),
        }
    }

    /// Parses the argument of a function: a displacement or velocity (according to `letter`), a
    /// separator, and the text up to the closing parenthesis.
    fn argument(&mut self, letter: char, sign: char) -> Option<(Coordinate, String)> {
        let (found, coordinate) = self.variable().ok()?;
        if found != letter || !self.take(sign) {
            return None;
        }
        let text = self.until_closed();
        self.take(')').then_some((coordinate, text))
    }

    /// Returns the text before the next closing parenthesis, or all remaining text if there is
    /// none.
    fn until_closed(&mut self) -> String {
        let start = self.at;
        while self.peek().is_some_and(|c| c != ')') {
            self.at += 1;
        }
        self.text[start..self.at].iter().collect()
    }

    fn take_word(&mut self, word: &str) -> bool {
        let begins = word.chars().enumerate().all(|(i, c)| self.text.get(self.at + i) == Some(&c));
        if begins {
            self.at += word.chars().count();
        }
        begins
    }

    /// Parses one factor of a product, such as `x1`, `v1^3`, `(x1-x2)^2` or `|v1|`, and a `*` after
    /// it if there is one.
    fn factor(&mut self, product: &mut Product) -> Result<(), String> {
        let absolute = self.take('|');
        let (letter, coordinate) = self.variable()?;
        if absolute {
            self.expect('|')?;
        }
        let exponent = if self.take('^') { self.whole_number()? } else { 1 };
        if product.coordinate.is_some_and(|other| other != coordinate) {
            return Err("a term must depend on one degree of freedom or one difference".to_owned());
        }
        product.coordinate = Some(coordinate);
        let total = match (letter, absolute) {
            ('x', false) => &mut product.displacement,
            ('v', false) => &mut product.velocity,
            (_, true) if letter == 'v' => &mut product.absolute,
            _ => return Err("|x| is not one of the supported laws".to_owned()),
        };
        *total = total.saturating_add(exponent);
        if self.take('*') && matches!(self.peek(), None | Some('/')) {
            return Err(format!("expected x or v after *, found {}", shown(self.peek())));
        }
        Ok(())
    }

    /// Parses `x`, `v2` or `(x1-x2)`.
    fn variable(&mut self) -> Result<Variable, String> {
        if !self.take('(') {
            let (letter, dof) = self.single()?;
            return Ok((letter, Coordinate::Dof(dof)));
        }
        let (letter, first) = self.single()?;
        self.expect('-')?;
        let (other, second) = self.single()?;
        self.expect(')')?;
        if letter == other {
            Ok((letter, Coordinate::Difference(first, second)))
        } else {
            Err("a difference must be of two displacements or of two velocities".to_owned())
        }
    }

    fn single(&mut self) -> Result<(char, usize), String> {
        let letter = match self.peek() {
            Some(c @ ('x' | 'v')) => c,
            next => return Err(format!("expected x or v, found {}", shown(next))),
        };
        self.at += 1;
        if !self.peek().is_some_and(|c| c.is_ascii_digit()) {
            return Ok((letter, 0));
        }
        match self.whole_number()? {
            0 => Err("degrees of freedom are counted from 1".to_owned()),
            number => Ok((letter, number as usize - 1)),
        }
    }

    /// Parses the divisor `(1+(v1/b)^2)` and returns its constant b.
    fn saturation(&mut self, coordinate: Coordinate) -> Result<f64, String> {
        let form = || "only (1 + (v/b)^2), with the same v as in v^3, can follow /".to_owned();
        for c in ['(', '1', '+', '('] {
            self.expect(c).map_err(|_| form())?;
        }
        if self.variable()? != ('v', coordinate) || !self.take('/') {
            return Err(form());
        }
        let text = self.until_closed();
        for c in [')', '^', '2', ')'] {
            self.expect(c).map_err(|_| form())?;
        }
        if let Some(c) = self.peek() {
            return Err(format!("unexpected {c} after the expression"));
        }
        number(&text)
    }

    fn whole_number(&mut self) -> Result<u32, String> {
        let start = self.at;
        while self.peek().is_some_and(|c| c.is_ascii_digit()) {
            self.at += 1;
        }
        let digits: String = self.text[start..self.at].iter().collect();
        digits.parse().map_err(|_| format!("expected a whole number, found {}", shown(self.peek())))
    }

    fn peek(&self) -> Option<char> {
        self.text.get(self.at).copied()
    }

    fn take(&mut self, expected: char) -> bool {
        let matches = self.peek() == Some(expected);
        self.at += usize::from(matches);
        matches
    }

    fn expect(&mut self, expected: char) -> Result<(), String> {
        let next = self.peek();
        if self.take(expected) {
            Ok(())
        } else {
            Err(format!("expected {expected}, found {}", shown(next)))
        }
    }
}

fn number(text: &str) -> Result<f64, String> {
    text.parse().map_err(|_| format!("{text} is not a number"))
}

fn shown(character: Option<char>) -> String {
    character.map_or_else(|| "the end".to_owned(), String::from)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_back() {
        let text = "k2: x1^2, k3: x1^3, c2: |v1| v1, cx: x2^2 v2, f: x1^0, \
                    k12: (x1-x2)^3, c12: |(v1-v3)| (v1-v3), s: v1^3/(1 + (v1/0.25)^2), \
                    s2: (v2-v1)^3/(1 + ((v2-v1)/1e-3)^2), g: gap(x2, 1e-4), g12: gap((x1-x2), 0.02), \
                    r: tanh(v1/0.01), r12: tanh((v1-v2)/1e-3)";
        let terms: Terms = text.parse().unwrap();
        assert_eq!(terms.len(), 13);
        assert_eq!(terms.to_string().parse::<Terms>().unwrap(), terms);
        let first = |text: &str| text.parse::<Term>().unwrap().to_string();
        assert_eq!(first(" k3 : x * x*x"), "k3: x1^3");
        assert_eq!(first("c: v1 x1^2"), "c: x1^2 v1");
        assert_eq!("".parse::<Terms>().unwrap(), Terms::none());
    }

    #[test]
    fn units_belong_to_the_laws() {
        for (text, unit) in [
            ("a: x^2", "N/m²"),
            ("a: x^2 v", "N·s/m³"),
            ("a: |v| v", "N·s²/m²"),
            ("a: v^3/(1+(v/2)^2)", "N·s³/m³"),
            ("a: x^0", "N"),
            ("a: x^7", "N/m⁷"),
            ("a: gap(x, 0.1)", "N/m"),
            ("a: tanh(v/0.1)", "N"),
        ] {
            assert_eq!(text.parse::<Term>().unwrap().unit(), unit);
        }
    }

    #[test]
    fn what_is_no_term_is_refused_with_the_reason() {
        for (text, reason) in [
            ("x1^3", "written `name: expression`"),
            ("k3:", "no expression"),
            ("k3: y^3", "expected x or v, found y"),
            ("k3: x1", "an entry of K or C"),
            ("k3: x0^3", "counted from 1"),
            ("k3: x1^2 x2", "one degree of freedom or one difference"),
            ("k3: (x1-v2)^2", "two displacements or of two velocities"),
            ("k3: (x1-x1)^2", "two different degrees of freedom"),
            ("k3: x1^99", "at most 9"),
            ("k3: x1^", "expected a whole number, found the end"),
            ("k3: x1^2 * x1 *", "expected x or v after *, found the end"),
            ("c: |x| x", "|x| is not one of the supported laws"),
            ("c: |v|", "allowed only in |v| v"),
            ("c: v^2/(1+(v/2)^2)", "only v^3 can be divided"),
            ("c: v^3/(1+(v/a)^2)", "a is not a number"),
            ("c: v^3/(1+(v/-2)^2)", "must be positive"),
            ("3k: x^3", "begins with a letter"),
            ("g: gap(x1)", "written gap(x1, 0.001)"),
            ("g: gap(v1, 0.1)", "written gap(x1, 0.001)"),
            ("g: gap(x1, 0.1", "written gap(x1, 0.001)"),
            ("g: gap(x1, -0.1)", "clearance of a gap must be positive"),
            ("g: gap(x1, a)", "a is not a number"),
            ("g: gap(x1, 0.1)^2", "unexpected ^"),
            ("r: tanh(x1/0.1)", "written tanh(v1/0.01)"),
            ("r: tanh(v1)", "written tanh(v1/0.01)"),
            ("r: tanh(v1/0)", "velocity of a friction must be positive"),
            ("c: v^3/(1+(v/2)^2) x", "unexpected x"),
        ] {
            let error = text.parse::<Term>().unwrap_err().to_string();
            assert!(error.contains(reason), "{text}: {error}");
        }
        assert_eq!(
            "a: x^2, a: x^3".parse::<Terms>(),
            Err(ModelError::RepeatedTerm { name: "a".to_owned() })
        );
    }

    #[test]
    fn terms_fit_a_system_or_say_why_not() {
        let fits = |text: &str, dof| text.parse::<Terms>().unwrap().check_dof(dof);
        assert!(fits("k3: x1^3, k2: x1^2", 1).is_ok());
        assert!(fits("a: x2^3", 1).unwrap_err().to_string().contains("1 degrees of freedom"));
        assert!(fits("k12: (x1-x2)^3", 2).unwrap_err().to_string().contains("M, C or K"));
    }
}
