//! Comparison of sparse systems with the same systems in dense matrices.

use mechid_integrate::*;
use mechid_model::{
    InitialState, Response, SecondOrderSystem, SparseSystem, band, lumped, triplets,
};
use mechid_signal::{Record, Sampling, Spectrum};
use nalgebra::{Complex, DMatrix};

use crate::common::*;

/// Largest difference, each quantity relative to its own largest value.
fn distance(left: &Response, right: &Response) -> f64 {
    let gaps = parts(left).into_iter().zip(parts(right)).map(|(l, r)| (l - r).amax() / r.amax());
    gaps.fold(0.0, f64::max)
}

/// The dense system of the same entries.
fn dense(sparse: &SparseSystem) -> SecondOrderSystem {
    use mechid_model::Matrix::{Damping, Mass, Stiffness};
    let [m, c, k] = [Mass, Damping, Stiffness].map(|which| DMatrix::from(sparse.matrix(which)));
    SecondOrderSystem::new(m, c, k).unwrap()
}

/// Stable systems with every kind of sparsity and symmetry. All have at most 64 degrees of freedom,
/// so that their dense forms are simulated with dense matrices.
fn systems() -> Vec<(&'static str, SparseSystem)> {
    let n = 40;
    let chain = band(n, &[(-1, -900.0), (0, 2000.0), (1, -900.0)]);
    let weights: Vec<f64> = (0..n).map(|i| 1.0 + 0.02 * i as f64).collect();
    // Neighbouring masses do not have neighbouring numbers: 7 and 40 have no common factor.
    let name = |i: usize| i * 7 % n;
    let links = |off: f64, skew: f64| {
        (0..n).flat_map(move |i| {
            let mut entries = vec![(name(i), name(i), 2000.0 + 10.0 * i as f64)];
            if i + 1 < n {
                entries.push((name(i), name(i + 1), off + skew));
                entries.push((name(i + 1), name(i), off - skew));
            }
            entries
        })
    };
    let shuffled = triplets(n, links(-900.0, 0.0)).unwrap();
    let skewed = triplets(n, links(-700.0, 60.0)).unwrap();
    let consistent = band(n, &[(-1, 0.2), (0, 1.0), (1, 0.2)]);
    let random = SparseSystem::from(&mechid_problems::random_stable(12, 3));
    let system = |m, c, k| SparseSystem::new(m, c, k).unwrap();
    vec![
        ("lumped", system(lumped(&weights), lumped(&vec![2.0; n]), chain.clone())),
        ("uncoupled", system(lumped(&weights), lumped(&vec![2.0; n]), lumped(&vec![900.0; n]))),
        ("undamped", system(lumped(&weights), band(n, &[]), chain.clone())),
        ("banded", system(consistent.clone(), &chain * 2e-3, chain)),
        ("shuffled", system(band(n, &[(0, 1.0)]), &shuffled * 2e-3, shuffled)),
        ("non-symmetric", system(consistent, &skewed * 4e-3, skewed)),
        ("full", random),
    ]
}

#[test]
fn sparse_and_dense_agree() {
    let sampling = Sampling::new(5e-3, 400).unwrap();
    for (name, system) in systems() {
        let (n, dense) = (system.dof(), dense(&system));
        let force = force(sampling, n);
        for scheme in schemes() {
            let scheme = scheme.as_ref();
            let resting = scheme.conventions().iter().any(|c| c.choice.contains("at rest"));
            let start = if resting { InitialState::rest(n) } else { small(n) };
            let one = integrate(scheme, &system, &force, &start).unwrap();
            let other = integrate(scheme, &dense, &force, &start).unwrap();
            let gap = distance(&one, &other);
            assert!(gap < 1e-12, "{name}, {}: {gap:e}", scheme.name());
        }
    }
}

/// Non-zero x(0) and ẋ(0) of about the size of the response.
fn small(n: usize) -> InitialState {
    let wave =
        |phase: f64| nalgebra::DVector::from_fn(n, |i, _| 1e-2 * (phase + 0.3 * i as f64).sin());
    InitialState::new(wave(0.0), 10.0 * wave(1.0)).unwrap()
}

#[test]
fn selected_degrees_of_freedom_are_those_of_the_whole() {
    let sampling = Sampling::new(5e-3, 60).unwrap();
    let (_, system) = systems().swap_remove(4);
    let n = system.dof();
    let (forced, observed) = ([31, 4], [7, 31, 0]);
    let two = force(sampling, 2);
    let all = DMatrix::from_fn(60, n, |k, at| {
        forced.iter().position(|f| *f == at).map_or(0.0, |c| two.data()[(k, c)])
    });
    let all = mechid_signal::Record::new(sampling, all).unwrap();
    let selected = SelectedDofs { forced: &forced, observed: &observed };
    for scheme in schemes() {
        let scheme = scheme.as_ref();
        let start = InitialState::rest(n);
        let some = integrate_selected(scheme, &system, selected, &two, &start).unwrap();
        let whole = integrate(scheme, &system, &all, &start).unwrap();
        for (some, whole) in parts(&some).into_iter().zip(parts(&whole)) {
            for (c, &at) in observed.iter().enumerate() {
                assert_eq!(some.column(c), whole.column(at), "{}", scheme.name());
            }
        }
    }
    // The selected response also equals the whole response for one degree of freedom, where the
    // whole response is computed with steps of fixed size.
    let one = mechid_model::Sdof::new(1.0, 0.1, 40.0).unwrap().system();
    let alone = force(sampling, 1);
    let selected = SelectedDofs { forced: &[0], observed: &[0] };
    let scheme = Newmark::AVERAGE_ACCELERATION;
    let some = integrate_selected(&scheme, &one, selected, &alone, &moving(1)).unwrap();
    let whole = integrate(&scheme, &one, &alone, &moving(1)).unwrap();
    assert!(distance(&some, &whole) < 1e-13);
}

#[test]
fn a_force_without_channels_leaves_the_free_motion() {
    let (_, system) = systems().swap_remove(4);
    let (n, sampling) = (system.dof(), Sampling::new(5e-3, 60).unwrap());
    let zero = |channels| {
        mechid_signal::Record::new(sampling, DMatrix::zeros(sampling.len(), channels)).unwrap()
    };
    let dofs = SelectedDofs { forced: &[], observed: &[0] };
    let released = nalgebra::DVector::from_element(n, 1e-2);
    let start = InitialState::new(released, nalgebra::DVector::zeros(n)).unwrap();
    for scheme in schemes() {
        let scheme = scheme.as_ref();
        let free = integrate_selected(scheme, &system, dofs, &zero(0), &start).unwrap();
        let unloaded = integrate(scheme, &system, &zero(n), &start).unwrap();
        for (free, unloaded) in parts(&free).into_iter().zip(parts(&unloaded)) {
            assert_eq!(free.column(0), unloaded.column(0), "{}", scheme.name());
        }
    }
}

#[test]
fn selections_that_do_not_fit_are_refused() {
    let (_, system) = systems().swap_remove(0);
    let force = force(Sampling::new(5e-3, 10).unwrap(), 2);
    let refused = |forced: &[usize], observed: &[usize]| {
        let dofs = SelectedDofs { forced, observed };
        let rest = InitialState::rest(40);
        integrate_selected(&Newmark::AVERAGE_ACCELERATION, &system, dofs, &force, &rest)
            .unwrap_err()
    };
    assert_eq!(refused(&[0, 40], &[1]), IntegrateError::DofOutside { index: 40, dof: 40 });
    assert_eq!(refused(&[0, 1], &[41]), IntegrateError::DofOutside { index: 41, dof: 40 });
    assert_eq!(refused(&[3, 3], &[1]), IntegrateError::ForcedTwice { index: 3 });
    assert_eq!(
        refused(&[3], &[1]),
        IntegrateError::Components { what: "the force", got: 2, dof: 1 }
    );
}

/// The steady state is compared with the receptance of the dense form, line by line.
#[test]
fn the_steady_state_of_a_sparse_system_is_that_of_its_receptance() {
    let n = 30;
    let eye = DMatrix::<f64>::identity(n, n);
    let band = |own: f64, below: f64, above: f64| {
        DMatrix::from_fn(n, n, |i, j| match j as isize - i as isize {
            0 => own,
            1 => above,
            -1 => below,
            _ => 0.0,
        })
    };
    let dense =
        SecondOrderSystem::new(eye, band(0.3, 0.1, -0.1), band(800.0, -300.0, -310.0)).unwrap();
    let sparse = SparseSystem::from(&dense);
    let sampling = Sampling::new(0.05, 16).unwrap();
    let force = DMatrix::from_fn(16, 2, |k, c| ((3 * k * k + 5 * c) as f64).sin());
    let force = Record::new(sampling, force).unwrap();
    let dofs = SelectedDofs { forced: &[4, 20], observed: &[20, 0] };
    let response = sparse_steady_state(&sparse, dofs, &force).unwrap();
    let lines = Spectrum::from_record(&force);
    let found = Spectrum::from_record(response.displacement());
    for line in 0..lines.len() {
        let receptance = dense.receptance(lines.omega(line)).unwrap();
        for (channel, at) in dofs.observed.iter().enumerate() {
            let exact: Complex<f64> =
                (0..2).map(|c| receptance[(*at, dofs.forced[c])] * lines.line(line, c)).sum();
            let gap = found.line(line, channel) - exact;
            // At half the sampling rate, a record contains only the real part of the line.
            let gap = if line == lines.len() - 1 { Complex::from(gap.re) } else { gap };
            assert!(gap.norm() < 1e-14, "{line}: {gap}");
        }
    }
    let narrow = SelectedDofs { forced: &[4], observed: &[0] };
    let refused = sparse_steady_state(&sparse, narrow, &force).unwrap_err();
    assert_eq!(refused, IntegrateError::Components { what: "the force", got: 2, dof: 1 });
}

#[test]
fn a_singular_mass_matrix_is_refused() {
    let mass = triplets(3, [(0, 0, 1.0), (0, 1, 1.0), (1, 0, 1.0), (1, 1, 1.0), (2, 2, 1.0)]);
    let eye = || lumped(&[1.0; 3]);
    let system = SparseSystem::new(mass.unwrap(), eye(), eye()).unwrap();
    for scheme in schemes() {
        let refused = scheme.prepare(&system, 0.01).err();
        let singular = matches!(refused, Some(IntegrateError::SingularMass { .. }));
        assert!(singular, "{}: {refused:?}", scheme.name());
    }
}

#[test]
fn large_dense_systems_of_few_entries_are_stepped_as_sparse() {
    // In the dense system of 200 masses, 1.5 % of the entries are not zero.
    let n = 200;
    let chain = band(n, &[(-1, -900.0), (0, 2000.0), (1, -900.0)]);
    let sparse = SparseSystem::new(band(n, &[(0, 1.0)]), &chain * 1e-3, chain).unwrap();
    let force = force(Sampling::new(1e-3, 30).unwrap(), n);
    for scheme in schemes() {
        let rest = InitialState::rest(n);
        let one = integrate(scheme.as_ref(), &sparse, &force, &rest).unwrap();
        let other = integrate(scheme.as_ref(), &dense(&sparse), &force, &rest).unwrap();
        assert_eq!(one, other, "{}", scheme.name());
    }
}
