//! Modes from records with measured forces.

use crate::generator::{Case, beyond_the_edge, hammer, one_by_one, pair};
use crate::score::Score;

/// Identifies a few records of a case, and checks that every mode and no false mode is found, and
/// that the intervals contain the true value about as often as stated.
fn check(case: &Case, seeds: u64) -> Score {
    let score = Score::of(case, 0..seeds);
    assert_eq!(score.found_share(), 100.0, "{}", case.name);
    assert_eq!(score.false_modes, 0, "{}", case.name);
    // For 5 modes and 6 records, the probability that fewer than 85 % of the intervals contain the
    // true value is 0.02. If the true coverage were only 80 %, this probability would be 0.74.
    for coverage in [score.frequency.coverage(), score.damping.coverage()] {
        assert!((85.0..=100.0).contains(&coverage), "{}: {coverage} %", case.name);
    }
    score
}

#[test]
fn one_accelerometer_and_five_modes() {
    check(&one_by_one(), 6);
}

#[test]
fn two_forces_and_a_close_pair() {
    check(&pair(8), 6);
}

/// In this record the first search finds one mode instead of two that are 0.3 % apart; an
/// unmeasured force on the first mode absorbs the response of the second mode. Both modes must be
/// found.
#[test]
fn an_unmeasured_force_hides_no_mode() {
    let mut close = pair(8);
    close.frequency_hz[3] = 131.4;
    let score = Score::of(&close, 4..5);
    assert_eq!((score.found_share(), score.false_modes), (100.0, 0));
}

#[test]
fn hits_with_decays_that_are_cut() {
    check(&hammer(), 6);
}

#[test]
fn unmeasured_forces_are_in_the_intervals() {
    let case = Case { unmeasured: 0.05, ..pair(8) };
    let score = check(&case, 6);
    // The intervals are not wider than necessary: the ratio of the squared errors to the squared
    // standard errors is 1 on average, and scatters by 0.17.
    let mean = 0.5 * (score.frequency.mean_square() + score.damping.mean_square());
    assert!((0.75..1.4).contains(&mean), "{mean}");
}

/// The strong mode outside the band is part of the model. If only residual terms represented this
/// mode, 61 % of the 95 % intervals of the frequencies and 51 % of those of the shapes would
/// contain the true value.
#[test]
fn a_strong_mode_outside_the_band_does_not_bias_those_inside() {
    let score = Score::of(&beyond_the_edge(), 0..4);
    assert_eq!((score.found_share(), score.false_modes), (100.0, 0));
    assert!(score.frequency.coverage() > 80.0, "{}", score.frequency.coverage());
    assert!(score.shape_coverage() > 85.0, "{}", score.shape_coverage());
}
