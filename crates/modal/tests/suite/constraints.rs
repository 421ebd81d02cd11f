//! Real shapes and reciprocity: true constraints make the intervals shorter, and false constraints
//! are rejected. Another test compares the modes of two records, between which one mode changes.

use mechid_modal::compare::{Difference, ModePair};
use mechid_modal::{DrivingPoint, ModalConstraint, ModalSettings, identify_modes};

use crate::generator::{Case, pair, reciprocal};
use crate::score::Score;

fn points() -> Vec<DrivingPoint> {
    vec![DrivingPoint::new(0, 0), DrivingPoint::new(3, 1)]
}

fn settings(constraint: ModalConstraint) -> ModalSettings {
    ModalSettings { constraints: vec![constraint], ..ModalSettings::default() }
}

/// Returns the smallest p-value of the modes of one record.
fn smallest_p_value(case: &Case, constraint: ModalConstraint) -> f64 {
    let estimate = identify_modes(&case.lines(2), &settings(constraint)).unwrap();
    let tests = estimate.constraint_tests();
    assert_eq!(tests.len(), estimate.modes().len());
    tests.iter().map(|test| test.p_value).fold(1.0, f64::min)
}

#[test]
fn true_constraints_hold_and_narrow_the_intervals() {
    let case = reciprocal();
    let constraints = vec![
        ModalConstraint::RealShapes { derivative: 2 },
        ModalConstraint::Reciprocity { points: points() },
    ];
    let known = ModalSettings { constraints, ..ModalSettings::default() };
    let (free, constrained) = (Score::of(&case, 0..4), Score::with(&case, 0..4, &known));
    // The true constraints give 48 tests; two or three of these tests reject at 5 % by chance.
    assert_eq!(constrained.tests[0], 48);
    assert!(constrained.tests[1] <= 8, "{:?}", constrained.tests);
    assert!(constrained.shape_coverage() > 88.0, "{}", constrained.shape_coverage());
    // Without constraints, the shapes of the two modes that are 1 % apart are the most uncertain.
    // The constraints must not increase the standard error of a damping ratio.
    let [free, constrained] = [free, constrained].map(|score| score.damping.standard_error());
    assert!(constrained.iter().zip(&free).all(|(with, without)| *with < 1.001 * without));
}

#[test]
fn false_constraints_are_rejected() {
    let reciprocity = ModalConstraint::Reciprocity { points: points() };
    assert!(smallest_p_value(&pair(8), reciprocity) < 1e-6);
    // If accelerations are stated to be velocities, the phases are wrong by a quarter of a turn.
    assert!(smallest_p_value(&reciprocal(), ModalConstraint::RealShapes { derivative: 1 }) < 1e-6);
}

#[test]
fn constraints_that_name_no_channel_are_refused() {
    let points = vec![DrivingPoint::new(0, 0), DrivingPoint::new(9, 1)];
    let wrong = settings(ModalConstraint::Reciprocity { points });
    let message = identify_modes(&pair(8).lines(0), &wrong).unwrap_err().to_string();
    assert_eq!(message, "`constraints`: expected an output of the data, got 9");
}

#[test]
fn a_mode_that_changes_between_two_records_is_named() {
    let case = Case { samples: 4096, ..pair(8) };
    let mut warmer = case.clone();
    // The second natural frequency changes by 0.2 %, which is forty of its standard errors.
    warmer.frequency_hz[1] *= 0.998;
    let estimate =
        |case: &Case, seed| identify_modes(&case.lines(seed), &ModalSettings::default()).unwrap();
    let first = estimate(&case, 1);
    let same = first.changes_to(&estimate(&case, 2)).unwrap();
    let changed = first.changes_to(&estimate(&warmer, 3)).unwrap();
    for (comparison, expected) in [(same, vec![]), (changed, vec![1])] {
        assert_eq!(comparison.pairs.len(), 6);
        let is_changed = |pair: &ModePair| {
            let p = |difference: Difference| difference.adjusted_p_value.unwrap();
            let shape = pair.shape.unwrap().adjusted_p_value;
            assert!(shape > 1e-3, "{pair:?}");
            p(pair.natural_frequency_hz).min(p(pair.damping_ratio.unwrap())) < 1e-3
        };
        let changed: Vec<usize> = comparison
            .pairs
            .iter()
            .filter(|pair| is_changed(pair))
            .map(|pair| pair.first)
            .collect();
        assert_eq!(changed, expected);
    }
}
