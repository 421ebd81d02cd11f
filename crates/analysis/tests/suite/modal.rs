//! Modes of a machine: instability is reported, and rounding errors are not reported as
//! instability.

use mechid_analysis::{Machine, ModalSummary};
use mechid_model::SecondOrderSystem;
use nalgebra::{DMatrix, dmatrix};

fn summary(mass: DMatrix<f64>, damping: DMatrix<f64>, stiffness: DMatrix<f64>) -> ModalSummary {
    let system = SecondOrderSystem::new(mass, damping, stiffness).unwrap();
    ModalSummary::from_machine(&Machine::known(system)).unwrap()
}

#[test]
fn an_unstable_mode_is_told_with_its_growth() {
    // The solution of ẍ − ẋ + 100 x = 0 grows as e^(t/2).
    let found = summary(
        DMatrix::identity(2, 2),
        dmatrix![-1.0, 0.0; 0.0, 3.0],
        dmatrix![100.0, 0.0; 0.0, 400.0],
    );
    let growth: Vec<f64> =
        found.modes.iter().filter_map(|mode| Some(mode.row.growth_rate?.value)).collect();
    assert_eq!(growth.len(), 1);
    assert!((growth[0] - 0.5).abs() < 1e-12, "{growth:?}");
    let text = found.to_string();
    assert!(
        text.contains("mode 1 is unstable: its free response grows e-fold every 2.00 s"),
        "{text}"
    );
}

#[test]
fn a_free_or_undamped_machine_is_not_called_unstable() {
    for damping in [0.0, 1.0] {
        for scale in [1e-3, 1.0, 1e6] {
            let chain = dmatrix![1.0, -1.0, 0.0; -1.0, 2.0, -1.0; 0.0, -1.0, 1.0];
            let mass = DMatrix::from_diagonal(&nalgebra::dvector![1.3, 0.7, 2.9]);
            let found = summary(mass, 0.01 * damping * &chain, scale * &chain);
            assert!(!found.to_string().contains("unstable"), "{found}");
        }
    }
}

/// Reference: λ² + 10 λ + 1 = 0 has ζ = 5 and the poles −5 ± √24.
#[test]
fn an_overdamped_pair_shows_both_poles_and_its_damping_ratio() {
    let found = summary(dmatrix![1.0], dmatrix![10.0], dmatrix![1.0]);
    let text = found.to_string();
    for told in ["1 real pole", "2 real pole", "-0.101021", "-9.89898", "1, 2 damping ratio"] {
        assert!(text.contains(told), "{told}: {text}");
    }
    assert!((found.modes[0].row.damping_ratio.value - 5.0).abs() < 1e-12, "{text}");
    assert_eq!((found.modes[0].row.partner, found.modes[1].row.partner), (Some(2), Some(1)));
}

#[test]
fn a_free_machine_has_rigid_body_modes() {
    let found = summary(
        dmatrix![2.0, 0.0; 0.0, 3.0],
        DMatrix::zeros(2, 2),
        dmatrix![100.0, -100.0; -100.0, 100.0],
    );
    assert!(found.to_string().contains("rigid-body mode"), "{found}");
    let rigid: Vec<bool> = found.modes.iter().map(|mode| mode.row.is_rigid_body).collect();
    assert!(rigid[0] && !rigid[rigid.len() - 1], "{rigid:?}");
}
