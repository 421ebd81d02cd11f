//! Comparing drawings: rounding may move a point by a hundredth of a pixel from one processor to
//! another.

/// Whether two SVG drawings have the same elements and texts, and points closer than a tenth of a
/// pixel.
pub fn alike(drawn: &str, committed: &str) -> bool {
    let (ours, theirs) = (parts(drawn), parts(committed));
    ours.len() == theirs.len()
        && ours.iter().zip(&theirs).all(|(a, b)| match (a.parse::<f64>(), b.parse::<f64>()) {
            (Ok(a), Ok(b)) => (a - b).abs() < 0.1,
            _ => a == b,
        })
}

/// The text cut into numbers and what stands between them.
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
