//! Comparison of drawings: rounding may shift a point by a hundredth of a pixel on another
//! processor.

/// Returns true if two SVG drawings have the same elements and texts, and their points differ by
/// less than a tenth of a pixel.
pub fn alike(drawn: &str, committed: &str) -> bool {
    let (ours, theirs) = (parts(drawn), parts(committed));
    ours.len() == theirs.len()
        && ours.iter().zip(&theirs).all(|(a, b)| match (a.parse::<f64>(), b.parse::<f64>()) {
            (Ok(a), Ok(b)) => (a - b).abs() < 0.1,
            _ => a == b,
        })
}

/// Splits the text into numbers and the text between them.
fn parts(svg: &str) -> Vec<&str> {
    let mut parts = Vec::new();
    let mut rest = svg;
    let number = |c: char| c.is_ascii_digit() || c == '.' || c == '-';
    while let Some(first) = rest.chars().next() {
        let numeric = number(first);
        let end = rest.find(|c| number(c) != numeric).unwrap_or(rest.len());
        parts.push(&rest[..end]);
        rest = &rest[end..];
    }
    parts
}

#[test]
fn points_may_move_a_little_and_nothing_else() {
    let picture = "<path d=\"M1.5 -2L3 4\"/><text>12 Hz</text>";
    assert!(alike(picture, &picture.replace("1.5", "1.51")));
    for (from, to) in [("1.5", "1.7"), ("L3", "M3"), ("Hz", "N"), ("12", "13"), ("L3 4", "")] {
        assert!(!alike(picture, &picture.replace(from, to)), "{from} {to}");
    }
}
