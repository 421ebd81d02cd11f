//! Tables of the documentation that a study computes.

/// Fails unless the rows of the table between two marks of the page on estimators equal the
/// computed rows. The first two lines of the table are its header; a row of `None` is not compared.
///
/// If the environment variable `MECHID_BLESS` is set, the computed rows replace the rows of the
/// page instead.
pub fn documented(start: &str, end: &str, computed: &[Option<String>]) {
    let place = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/book/src/studies/estimators.md");
    let text = std::fs::read_to_string(place).expect("studies/estimators.md");
    let from = text.find(start).expect("start of the table") + start.len();
    let to = text.find(end).expect("end of the table");
    let head: Vec<&str> = text[from..to].lines().take(2).collect();
    if std::env::var_os("MECHID_BLESS").is_some() {
        let rows: Vec<&str> = computed.iter().flatten().map(String::as_str).collect();
        let table = format!("{}\n{}\n", head.join("\n"), rows.join("\n"));
        std::fs::write(place, format!("{}{table}{}", &text[..from], &text[to..])).unwrap();
        return;
    }
    let printed: Vec<&str> = text[from..to].lines().skip(2).collect();
    assert_eq!(printed.len(), computed.len());
    for (printed, computed) in printed.iter().zip(computed) {
        let Some(computed) = computed else { continue };
        for (left, right) in printed.split('|').zip(computed.split('|')) {
            let (left, right) = (left.trim(), right.trim());
            match (left.parse::<f64>(), right.parse::<f64>()) {
                // Other processors may round the last digit differently.
                (Ok(l), Ok(r)) => {
                    let decimals = left.find('.').map_or(0, |dot| left.len() - dot - 1);
                    let unit = 10f64.powi(-(decimals as i32));
                    assert!((l - r).abs() < 1.5 * unit, "{printed}\n{computed}");
                }
                _ => assert_eq!(left, right, "{printed}\n{computed}"),
            }
        }
    }
}
