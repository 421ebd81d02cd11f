//! The statements of the book (`studies/force.md`), and the agreement of the tables in the book
//! with the study.

use crate::study::coverage::{INTERVALS, SHAPES, coverage};
use crate::study::{
    Case, KNOWN, cases, known_table, rms_error, rule_rows, rule_table, unknown_table,
};
use mechid_force::{Filter, Rule};

#[test]
fn the_excited_lines_stay_near_the_noise_floor() {
    let frequency_domain = KNOWN[0];
    for case in cases() {
        let (found, floor) = (rms_error(&case, frequency_domain), case.floor());
        assert!(found < 1.2 * floor, "{}: {found:.4}, floor {floor:.4}", case.name);
        // The floor is a lower bound of the error. Ten realisations of 80 real amplitudes determine
        // the error to 4 %.
        assert!(found > 0.85 * floor, "{}: {found:.4}, floor {floor:.4}", case.name);
    }
}

/// Splits a text into numbers and words; the words are unchanged.
fn tokens(text: &str) -> Vec<Result<f64, String>> {
    text.split(|c: char| c.is_whitespace() || "|()".contains(c))
        .filter(|token| !token.is_empty())
        .map(|token| token.parse::<f64>().map_err(|_| token.to_owned()))
        .collect()
}

/// Returns the rows of the tables in the book, from the table with this `header` on.
fn printed(header: &str) -> String {
    let book = include_str!("../../../../docs/book/src/studies/force.md");
    let start = book.find(header).expect("the book has the study's tables");
    book[start..]
        .lines()
        .filter(|line| line.starts_with('|'))
        .map(|line| format!("{line}\n"))
        .collect()
}

fn assert_printed(header: &str, found: &str) {
    let found = tokens(found);
    let printed = tokens(&printed(header));
    assert!(printed.len() >= found.len(), "run the example noise_study and paste its tables");
    for (old, new) in printed.iter().zip(&found) {
        let same = match (old, new) {
            // Another mathematical library (libm) may change the last digit, and may move the
            // chosen parameter by one step.
            (Ok(old), Ok(new)) => (old - new).abs() <= 0.03 * new.abs() + 0.002,
            (old, new) => old == new,
        };
        assert!(
            same,
            "studies/force.md says {old:?}, the study {new:?}: run the example noise_study"
        );
    }
}

#[test]
fn the_book_prints_the_errors_of_every_method() {
    let [known, unknown] = [known_table(), unknown_table()];
    assert_printed("| Method |", &(known + &unknown));
}

#[test]
fn the_likelihood_rule_stays_near_the_best_parameter_as_the_book_prints() {
    let rows = rule_rows();
    for (case, filter, [likelihood, ..]) in &rows {
        let what = format!("{}, {}, {filter}", case.name, case.level);
        assert!(likelihood.mean < 1.3, "{what}: {:.2}", likelihood.mean);
        // Truncation keeps or removes whole lines, so that its best parameter is less well defined.
        let worst = if *filter == "Tikhonov" { 1.3 } else { 1.5 };
        assert!(likelihood.worst < worst, "{what}: {:.2}", likelihood.worst);
    }
    let lost = |rule: usize| rows.iter().map(|r| r.2[rule].mean).fold(0.0, f64::max);
    assert!(lost(1) > 3.0 && lost(3) > 5.0, "GCV {:.1}, textbook {:.1}", lost(1), lost(3));
    assert_printed("| Excited |", &rule_table(&rows));
}

/// Checks forces for which the coverage of the 95 % intervals in the book is near 95 %: over twelve
/// records, the intervals must contain the force at 89 to 99 % of the samples.
#[test]
fn intervals_hold_the_force_of_bands_lines_and_walks() {
    for name in
        ["Tikhonov, lines known", "shrinkage", "Tikhonov", "truncated SVD", "Kalman smoother"]
    {
        let interval = INTERVALS.iter().find(|interval| interval.0 == name).unwrap();
        for (bearing, level) in [(false, 0.05), (true, 0.01)] {
            for shape in [SHAPES[0], SHAPES[4]] {
                let Some([held, ..]) = coverage(interval, bearing, shape, level, 12) else {
                    continue;
                };
                let what = format!("{name}, {}, {bearing}, {level}", shape.name());
                assert!((0.89..0.99).contains(&held), "{what}: {held:.3}");
            }
        }
    }
}

/// The rule of maximum likelihood is given no noise level, but its regularisation parameter λ
/// increases with the noise.
#[test]
fn more_noise_means_more_regularisation() {
    let parameter = |level: f64| {
        let case = Case::new("", false, (1..=40).collect(), level);
        let measured = case.measured(1);
        let filter = Filter::Tikhonov(Rule::Likelihood);
        let (extent, noise) =
            (mechid_force::ForceUnknowns::EveryLine, mechid_force::Noise::Unknown);
        let found = mechid_force::regularised(
            &case.system,
            &measured,
            &case.forced(),
            &extent,
            filter,
            &noise,
        );
        found.unwrap().parameter.unwrap()
    };
    assert!(parameter(0.005) < parameter(0.02) && parameter(0.02) < parameter(0.08));
}
