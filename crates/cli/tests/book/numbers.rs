//! Numbers in texts, compared to the digits written.

/// A number as written in a text.
pub struct Written {
    pub text: String,
    value: f64,
    /// Half a unit of the last digit.
    half: f64,
}

impl Written {
    /// Returns true if `exact`, rounded to the digits of this number, equals this number.
    pub fn is_of(&self, exact: f64) -> bool {
        (exact - self.value).abs() <= self.half * (1.0 + 1e-6)
    }
}

/// Returns the numbers of three or more digits in a text, without their signs and without years.
pub fn written(text: &str) -> Vec<Written> {
    let plain = |c: char| c.is_ascii_digit() || matches!(c, '.' | ',');
    let words = text.split(|c: char| !plain(c)).map(|word| word.replace(',', ""));
    let words = words.map(|word| word.trim_matches('.').to_owned());
    words
        .filter(|word| {
            let digits: String = word.chars().filter(char::is_ascii_digit).collect();
            let centuries = ["18", "19", "20"];
            let is_year = digits.len() == 4
                && digits == **word
                && centuries.iter().any(|century| word.starts_with(century));
            digits.trim_start_matches('0').len() > 2 && !is_year
        })
        .filter_map(|text| {
            let value = text.parse().ok()?;
            let decimals = text.split_once('.').map_or(0, |(_, decimals)| decimals.len());
            Some(Written { text, value, half: 0.5 * 0.1f64.powi(decimals as i32) })
        })
        .collect()
}

/// Returns every number in a block, without its sign. A number with a power of ten is also returned
/// without this power.
pub fn all(block: &str) -> Vec<f64> {
    let part = |c: char| c.is_ascii_digit() || matches!(c, '.' | 'e' | '-');
    let mut found = Vec::new();
    for word in block.split(|c: char| !part(c)).map(|word| word.trim_matches(['.', '-', 'e'])) {
        found.extend(word.parse::<f64>());
        found.extend(word.split(['e', '-']).next().and_then(|digits| digits.parse::<f64>().ok()));
    }
    found
}

#[test]
fn numbers_are_found_and_compared_as_they_are_written() {
    let text = "of 1,024 samples at 0.197, in 1998, 12 lines: 7.6 and 1.2013 · 10⁷.";
    let found: Vec<String> = written(text).into_iter().map(|number| number.text).collect();
    assert_eq!(found, ["1024", "0.197", "1.2013"]);
    let shown = all("k 1.20134e7 -0.19697, 1.19 1024...");
    for number in written(text) {
        assert!(shown.iter().any(|shown| number.is_of(*shown)), "{}", number.text);
    }
    assert!(!written("0.197")[0].is_of(0.1976) && !written("0.197")[0].is_of(0.1964));
}
