//! Some modes of sparse systems, against closed forms and against all modes of dense systems.

use std::f64::consts::PI;

use mechid_integrate::{IntegrateError, ModeSearch, SparseMode, sparse_modes};
use mechid_model::{Mode, SecondOrderSystem, SparseSystem, band, lumped, triplets};
use nalgebra::DMatrix;

/// Masses of 2 kg between springs of 800 N/m, fixed at both ends or free.
fn chain(n: usize, fixed: bool) -> SparseSystem {
    let mut stiffness = vec![1600.0; n];
    if !fixed {
        (stiffness[0], stiffness[n - 1]) = (800.0, 800.0);
    }
    let between = (0..n - 1).flat_map(|i| [(i, i + 1, -800.0), (i + 1, i, -800.0)]);
    let own = (0..n).map(|i| (i, i, stiffness[i]));
    let stiffness = triplets(n, own.chain(between)).unwrap();
    SparseSystem::new(band(n, &[(0, 2.0)]), band(n, &[]), stiffness).unwrap()
}

/// The computed modes are compared with ω = 2 √(k/m) sin(r π / 2(n + 1)) and the shapes sin(r π i /
/// (n + 1)).
#[test]
fn a_chain_has_the_frequencies_of_its_closed_form() {
    let n = 2000;
    let exact = |r: usize| 40.0 * (r as f64 * PI / (2.0 * (n + 1) as f64)).sin();
    let system = chain(n, true);
    for (k, found) in sparse_modes(&system, ModeSearch::Lowest, 6).unwrap().iter().enumerate() {
        let omega = exact(k + 1);
        assert!((found.mode.natural_frequency() / omega - 1.0).abs() < 1e-9, "{k}: {found:?}");
        assert!(found.residual < 1e-12, "{k}: {:e}", found.residual);
        let angle = |i: usize| ((k + 1) as f64 * PI * (i + 1) as f64 / (n + 1) as f64).sin();
        let largest =
            (0..n).map(angle).fold(0.0, |most: f64, v| if v.abs() > most.abs() { v } else { most });
        for i in (0..n).step_by(37) {
            let entry = found.mode.shape()[i];
            // A symmetric shape has two entries of largest modulus; its sign depends on which of
            // them is scaled to 1.
            let gap = (entry.re.abs() - (angle(i) / largest).abs()).abs() + entry.im.abs();
            assert!(gap < 1e-6, "mode {k}, entry {i}: {entry} {}", angle(i) / largest);
        }
    }
    // The frequency is in the middle of the band, between modes 1000 and 1001.
    let about = 0.5 * (exact(1000) + exact(1001)) + 0.1 * (exact(1001) - exact(1000));
    let found = sparse_modes(&system, ModeSearch::NearOmega(about), 3).unwrap();
    for (found, r) in found.iter().zip([1001, 1000, 1002]) {
        let value = found.mode.eigenvalue();
        assert!((value.im / exact(r) - 1.0).abs() < 1e-10 && value.re.abs() < 1e-8, "{r}: {value}");
    }
}

/// Chain in two planes, coupled by gyroscopic forces, with damping and cross-coupled stiffness that are not
/// symmetric.
fn rotor(stations: usize) -> SecondOrderSystem {
    let n = 2 * stations;
    let mut mass = DMatrix::zeros(n, n);
    let mut damping = DMatrix::zeros(n, n);
    let mut stiffness = DMatrix::zeros(n, n);
    for i in 0..stations {
        let (x, y) = (2 * i, 2 * i + 1);
        for at in [x, y] {
            mass[(at, at)] = 1.0 + 0.2 * (i % 4) as f64;
            damping[(at, at)] = 0.3 + 0.05 * (at % 3) as f64;
            stiffness[(at, at)] += 1500.0 + 40.0 * (at % 2) as f64;
            if i + 1 < stations {
                stiffness[(at, at + 2)] -= 700.0;
                stiffness[(at + 2, at)] -= 700.0;
            }
        }
        (damping[(x, y)], damping[(y, x)]) = (2.0, -2.0);
        (stiffness[(x, y)], stiffness[(y, x)]) = (15.0, -11.0);
    }
    SecondOrderSystem::new(mass, damping, stiffness).unwrap()
}

fn assert_same(found: &[SparseMode], expected: &[&Mode]) {
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        let (value, truth) = (found.mode.eigenvalue(), expected.eigenvalue());
        assert!((value - truth).norm() < 1e-9 * truth.norm(), "{value} {truth}");
        assert!(found.residual < 1e-12, "{:e}", found.residual);
        let (a, b) = (found.mode.shape(), expected.shape());
        let along = a.dotc(b).norm() / (a.norm() * b.norm());
        assert!((along - 1.0).abs() < 1e-8, "{along}");
    }
}

/// The modes of the sparse system are compared with all modes of its dense form, found by QR
/// iteration.
#[test]
fn a_gyroscopic_system_has_the_modes_of_its_dense_form() {
    let dense = rotor(30);
    let (sparse, all) = (SparseSystem::from(&dense), dense.modes().unwrap());
    assert_eq!(all.len(), 60);
    let lowest: Vec<&Mode> = all.iter().take(8).collect();
    assert_same(&sparse_modes(&sparse, ModeSearch::Lowest, 8).unwrap(), &lowest);
    let omega = all[31].damped_frequency() + 0.01;
    let mut near: Vec<&Mode> = all.iter().collect();
    let distance = |mode: &Mode| (mode.eigenvalue() - nalgebra::Complex::new(0.0, omega)).norm();
    near.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
    near.truncate(5);
    assert_same(&sparse_modes(&sparse, ModeSearch::NearOmega(omega), 5).unwrap(), &near);
    // A search for more modes than a small system has must return all its modes.
    let dense = rotor(3);
    let all = dense.modes().unwrap();
    let found = sparse_modes(&SparseSystem::from(&dense), ModeSearch::Lowest, 20).unwrap();
    assert_same(&found, &all.iter().collect::<Vec<_>>());
}

/// A chain has the same stiffness in two planes without coupling, so that every frequency occurs
/// twice. The two shapes of each frequency must be independent.
#[test]
fn repeated_frequencies_have_independent_shapes() {
    let n = 200;
    let stiffness = band(n, &[(-2, -800.0), (0, 1600.0), (2, -800.0)]);
    let system = SparseSystem::new(band(n, &[(0, 2.0)]), band(n, &[]), stiffness).unwrap();
    let found = sparse_modes(&system, ModeSearch::Lowest, 6).unwrap();
    for (k, pair) in found.chunks(2).enumerate() {
        let omega = 40.0 * ((k + 1) as f64 * PI / 202.0).sin();
        for one in pair {
            assert!((one.mode.natural_frequency() / omega - 1.0).abs() < 1e-9, "{k}");
            assert!(one.residual < 1e-11);
        }
        let [a, b] = [0, 1].map(|i| pair[i].mode.shape());
        let along = a.dotc(b).norm() / (a.norm() * b.norm());
        assert!(along < 0.99, "the shapes of pair {k} are the same: {along}");
    }
}

/// The computed modes are compared with ω = 2 √(k/m) sin(r π / 2n), where r = 0 is the rigid-body
/// motion.
#[test]
fn a_free_chain_drifts_and_oscillates() {
    let n = 300;
    let found = sparse_modes(&chain(n, false), ModeSearch::Lowest, 6).unwrap();
    let oscillating: Vec<f64> =
        found.iter().map(|m| m.mode.natural_frequency()).filter(|omega| *omega > 1e-3).collect();
    assert!(found[0].mode.natural_frequency() < 1e-4 && found[0].is_rigid_body);
    assert!(found.iter().all(|m| m.is_rigid_body == (m.mode.natural_frequency() < 1e-3)));
    assert!(oscillating.len() >= 4, "{oscillating:?}");
    for (r, omega) in (1..).zip(oscillating) {
        let exact = 40.0 * (f64::from(r) * PI / (2.0 * n as f64)).sin();
        assert!((omega / exact - 1.0).abs() < 1e-7, "{r}: {omega} {exact}");
    }
}

/// The computed frequencies are compared with their closed form; the highest of them is about sixty
/// times the lowest.
#[test]
fn many_modes_of_a_chain_are_found_from_one_shift() {
    let n = 150;
    let found = sparse_modes(&chain(n, true), ModeSearch::Lowest, 60).unwrap();
    assert_eq!(found.len(), 60);
    for (r, found) in (1..).zip(found) {
        let exact = 40.0 * (f64::from(r) * PI / (2.0 * (n + 1) as f64)).sin();
        let gap = found.mode.natural_frequency() / exact - 1.0;
        assert!(gap.abs() < 1e-10 && found.residual < 1e-12, "{r}: {gap:e} {:e}", found.residual);
    }
}

/// The rigid-body motion is the mode nearest to a low frequency; it is also among the four modes
/// nearest to a higher frequency.
#[test]
fn a_free_chain_has_modes_near_low_frequencies() {
    let n = 100;
    let (system, exact) =
        (chain(n, false), |r: usize| 40.0 * (r as f64 * PI / (2.0 * n as f64)).sin());
    for (omega, order) in [(6e-3, [0, 1, 2, 3]), (1.7 * exact(1), [2, 1, 3, 0])] {
        let found = sparse_modes(&system, ModeSearch::NearOmega(omega), 4).unwrap();
        assert_eq!(found.len(), 4);
        for (found, r) in found.iter().zip(order) {
            assert_eq!(found.is_rigid_body, r == 0, "{omega}, {r}");
            assert!((found.mode.natural_frequency() - exact(r)).abs() < 1e-6, "{omega}, {r}");
        }
    }
}

#[test]
fn all_modes_come_where_more_are_asked_for() {
    let n = 5;
    for count in [11, usize::MAX] {
        let found = sparse_modes(&chain(n, false), ModeSearch::Lowest, count).unwrap();
        let oscillating: Vec<f64> =
            found.iter().filter(|m| !m.is_rigid_body).map(|m| m.mode.natural_frequency()).collect();
        assert!(oscillating.len() == n - 1 && found.len() > oscillating.len());
        for (r, omega) in (1..).zip(oscillating) {
            let exact = 40.0 * (f64::from(r) * PI / (2.0 * n as f64)).sin();
            assert!((omega / exact - 1.0).abs() < 1e-12, "{r}: {omega} {exact}");
        }
    }
}

#[test]
fn what_cannot_be_searched_is_refused() {
    let system = chain(5, true);
    for omega in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let refused = sparse_modes(&system, ModeSearch::NearOmega(omega), 1).unwrap_err();
        assert!(matches!(refused, IntegrateError::SearchFrequency { .. }), "{refused}");
    }
    assert_eq!(sparse_modes(&system, ModeSearch::Lowest, 0).unwrap(), []);
    // A search exactly at the natural frequency of an undamped oscillator must be refused, because
    // the shifted matrix is singular.
    let one = || lumped(&[4.0]);
    let system = SparseSystem::new(lumped(&[1.0]), lumped(&[0.0]), one()).unwrap();
    let refused = sparse_modes(&system, ModeSearch::NearOmega(2.0), 1).unwrap_err();
    assert!(matches!(refused, IntegrateError::SingularShift { .. }), "{refused}");
}

/// The ten lowest frequencies of a cube of masses must agree with the closed form. Because the cube
/// is symmetric, many of its frequencies occur three or six times.
#[test]
fn a_cube_has_the_frequencies_of_its_closed_form() {
    let w = 8;
    let at = |x: usize, y: usize, z: usize| (z * w + y) * w + x;
    let mut entries = vec![];
    for (x, y, z) in (0..w).flat_map(|x| (0..w).flat_map(move |y| (0..w).map(move |z| (x, y, z)))) {
        entries.push((at(x, y, z), at(x, y, z), 5400.0));
        let next = [(x + 1, y, z), (x, y + 1, z), (x, y, z + 1)];
        for (i, j, k) in next.into_iter().filter(|(i, j, k)| *i < w && *j < w && *k < w) {
            entries
                .extend([(at(x, y, z), at(i, j, k), -900.0), (at(i, j, k), at(x, y, z), -900.0)]);
        }
    }
    let stiffness = triplets(w * w * w, entries).unwrap();
    let n = w * w * w;
    let system = SparseSystem::new(band(n, &[(0, 1.0)]), band(n, &[(0, 0.3)]), stiffness).unwrap();
    let part = |r: usize| 1800.0 - 1800.0 * (r as f64 * PI / (w + 1) as f64).cos();
    let mut exact = vec![];
    for (a, b, c) in (1..5).flat_map(|a| (1..5).flat_map(move |b| (1..5).map(move |c| (a, b, c)))) {
        exact.push((part(a) + part(b) + part(c)).sqrt());
    }
    exact.sort_by(f64::total_cmp);
    let found = sparse_modes(&system, ModeSearch::Lowest, 10).unwrap();
    for (found, omega) in found.iter().zip(exact) {
        assert!((found.mode.natural_frequency() / omega - 1.0).abs() < 1e-9, "{omega}: {found:?}");
    }
}

/// Grid of width × height masses of 1 kg. Springs of 900 N/m connect neighbours, and the outer
/// masses to the surrounding walls; each mass has a spring of `ground` N/m to ground. The damping
/// is `proportion` times the stiffness.
fn grounded_grid(width: usize, height: usize, ground: f64, proportion: f64) -> SparseSystem {
    let at = |x: usize, y: usize| y * width + x;
    let walls = if height > 1 { 4.0 } else { 2.0 };
    let mut entries = vec![];
    for (x, y) in (0..width).flat_map(|x| (0..height).map(move |y| (x, y))) {
        entries.push((at(x, y), at(x, y), ground + walls * 900.0));
        let next = [(x + 1, y), (x, y + 1)];
        for (i, j) in next.into_iter().filter(|(i, j)| *i < width && *j < height) {
            entries.extend([(at(x, y), at(i, j), -900.0), (at(i, j), at(x, y), -900.0)]);
        }
    }
    let n = width * height;
    let damping = entries.iter().map(|(i, j, v)| (*i, *j, proportion * v));
    let damping = triplets(n, damping.collect::<Vec<_>>()).unwrap();
    let stiffness = triplets(n, entries).unwrap();
    SparseSystem::new(band(n, &[(0, 1.0)]), damping, stiffness).unwrap()
}

/// Returns ω² of a grid with springs to ground, in ascending order: k_g + 4 k sin²(r π / 2(w + 1))
/// + 4 k sin²(s π / 2(h + 1)).
fn grounded_squares(width: usize, height: usize, ground: f64) -> Vec<f64> {
    let part = |r: usize, n: usize| {
        if n == 1 { 0.0 } else { 3600.0 * (r as f64 * PI / (2 * (n + 1)) as f64).sin().powi(2) }
    };
    let pairs = (1..=width).flat_map(|r| (1..=height).map(move |s| (r, s)));
    let mut squares: Vec<f64> =
        pairs.map(|(r, s)| ground + part(r, width) + part(s, height)).collect();
    squares.sort_by(f64::total_cmp);
    squares
}

/// The lowest modes agree with their closed form. Springs to ground set a lowest frequency, and the
/// modes just above this frequency lie close together.
#[test]
fn grounded_machines_have_the_lowest_modes_of_their_closed_form() {
    // The chain, and the grid with the stiffest springs to ground, have no mode near the first
    // shift.
    let cases = [(60, 60, 200.0, 8, 1e-4), (10_000, 1, 200.0, 2, 1e-4), (40, 40, 1e5, 2, 0.0)];
    for (width, height, ground, count, proportion) in cases {
        let system = grounded_grid(width, height, ground, proportion);
        let found = sparse_modes(&system, ModeSearch::Lowest, count);
        let found = found.unwrap_or_else(|e| panic!("{width} × {height}, {count}: {e}"));
        let squares = grounded_squares(width, height, ground);
        for (k, (found, square)) in found.iter().zip(squares).enumerate() {
            let value = found.mode.eigenvalue();
            let re = -0.5 * proportion * square;
            let exact = nalgebra::Complex::new(re, (square - re * re).sqrt());
            let gap = (value - exact).norm() / exact.norm();
            assert!(gap < 1e-9, "{width} × {height}, mode {k} of {count}: {value} {exact}");
            assert!(found.residual < 1e-12, "{k}: {:e}", found.residual);
        }
    }
}

/// The modes at the lowest frequencies of a grounded chain are farther from the imaginary axis than
/// from one another. The search must still find the modes nearest to iω.
#[test]
fn modes_near_a_frequency_are_found_beside_the_floor() {
    let n = 10_000;
    let system = grounded_grid(n, 1, 200.0, 1e-4);
    let omega = 2.0 * PI * 2.2508;
    let found = sparse_modes(&system, ModeSearch::NearOmega(omega), 10).unwrap();
    let mut near: Vec<nalgebra::Complex<f64>> = grounded_squares(n, 1, 200.0)
        .iter()
        .map(|square| {
            nalgebra::Complex::new(-0.5e-4 * square, (square - 0.25e-8 * square * square).sqrt())
        })
        .collect();
    let distance =
        |value: &nalgebra::Complex<f64>| (value - nalgebra::Complex::new(0.0, omega)).norm();
    near.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
    for (found, exact) in found.iter().zip(near) {
        let value = found.mode.eigenvalue();
        assert!((value - exact).norm() < 1e-9 * exact.norm(), "{value} {exact}");
    }
}

/// The system is a grounded chain, a mass that is free to drift, and an overdamped mass with little
/// stiffness. One shift finds the modes of the two single masses, and another shift those of the
/// chain; all modes must agree with their closed forms.
#[test]
fn modes_far_below_the_floor_come_first() {
    let n = 4000;
    let size = n + 2;
    let mut entries: Vec<(usize, usize, f64)> = (0..n).map(|i| (i, i, 2000.0)).collect();
    entries.extend((1..n).flat_map(|i| [(i - 1, i, -900.0), (i, i - 1, -900.0)]));
    // s² + 5 s + 4 = (s + 1)(s + 4).
    entries.push((n + 1, n + 1, 4.0));
    let damping = triplets(size, [(n + 1, n + 1, 5.0)]).unwrap();
    let stiffness = triplets(size, entries).unwrap();
    let system = SparseSystem::new(band(size, &[(0, 1.0)]), damping, stiffness).unwrap();
    let found = sparse_modes(&system, ModeSearch::Lowest, 8).unwrap();
    let (low, chain): (Vec<_>, Vec<_>) =
        found.iter().partition(|found| found.mode.natural_frequency() < 5.0);
    assert!(low.iter().any(|found| found.is_rigid_body));
    for exact in [-1.0, -4.0] {
        let near = |found: &&SparseMode| (found.mode.eigenvalue() - exact).norm() < 1e-9;
        assert_eq!(low.iter().copied().filter(near).count(), 1, "{exact}");
    }
    assert!(chain.len() >= 4, "{chain:?}");
    for (found, square) in chain.iter().zip(grounded_squares(n, 1, 200.0)) {
        let gap = found.mode.natural_frequency() / square.sqrt() - 1.0;
        assert!(gap.abs() < 1e-9, "{gap:e}");
    }
}
