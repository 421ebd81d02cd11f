//! Properties of every system: sums and products of eigenvalues, invariances, inverses.

use mechid_model::{Mode, SecondOrderSystem};
use mechid_numerics::linear_algebra::singular_values;
use nalgebra::{Complex, DMatrix, DVector};
use proptest::prelude::*;

/// Returns random systems, stable or unstable, symmetric or not. M is L Lᵀ, where the diagonal of L
/// is between 1 and 2; C and K are arbitrary.
fn systems() -> impl Strategy<Value = SecondOrderSystem> {
    (1usize..=5).prop_flat_map(|n| {
        let square = |range: std::ops::Range<f64>| prop::collection::vec(range, n * n);
        (square(-0.5..0.5), square(-4.0..4.0), square(-30.0..30.0)).prop_map(move |(l, c, k)| {
            let l = DMatrix::from_fn(n, n, |i, j| match i.cmp(&j) {
                std::cmp::Ordering::Less => 0.0,
                std::cmp::Ordering::Equal => 1.5 + l[i * n + j],
                std::cmp::Ordering::Greater => l[i * n + j],
            });
            let (c, k) = (DMatrix::from_vec(n, n, c), DMatrix::from_vec(n, n, k));
            SecondOrderSystem::new(&l * l.transpose(), c, k).unwrap()
        })
    })
}

/// Returns the matrix of an invertible change of coordinates, with ones on the diagonal and small
/// couplings.
fn coordinates(n: usize, seed: u64) -> DMatrix<f64> {
    DMatrix::from_fn(n, n, |i, j| {
        let wild = ((seed as f64 + 1.0) * (1.0 + i as f64) * (2.0 + j as f64)).sin();
        if i == j { 1.0 } else { 0.5 * wild / n as f64 }
    })
}

/// Returns the norm of (λ²M + λC + K) φ relative to the size of its terms.
fn residual(s: &SecondOrderSystem, mode: &Mode) -> f64 {
    let l = mode.eigenvalue();
    let terms = [(s.mass(), l * l), (s.damping(), l), (s.stiffness(), Complex::from(1.0))];
    let size: f64 = terms.iter().map(|(a, z)| a.norm() * z.norm()).sum();
    let sum: DVector<Complex<f64>> =
        terms.iter().map(|(a, z)| a.map(|v| z * v) * mode.shape()).sum();
    sum.norm() / (size * mode.shape().norm())
}

/// Returns the largest distance from an eigenvalue of `p` to the nearest eigenvalue of `q`,
/// relative to the largest modulus in `p`.
fn spectrum_gap(p: &[Complex<f64>], q: &[Complex<f64>]) -> f64 {
    let largest = p.iter().map(|l| l.norm()).fold(f64::MIN_POSITIVE, f64::max);
    let nearest = |l: &Complex<f64>| q.iter().map(|r| (l - r).norm()).fold(f64::MAX, f64::min);
    p.iter().map(nearest).fold(0.0, f64::max) / largest
}

/// Tolerance of an eigenvalue: in random systems, rounding moves a nearly defective pair by √ε, and
/// hardly ever by more.
const EIGENVALUE: f64 = 1e-6;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn vieta(s in systems()) {
        // Σ λ = −tr(M⁻¹C), Π λ = det K / det M; sums of eigenvalues are well conditioned.
        let eigenvalues = s.eigenvalues().unwrap();
        prop_assert_eq!(eigenvalues.len(), 2 * s.dof());
        let largest = eigenvalues.iter().map(|l| l.norm()).fold(1.0, f64::max);
        let sum: Complex<f64> = eigenvalues.iter().sum();
        let trace = s.mass().clone().lu().solve(s.damping()).unwrap().trace();
        prop_assert!((sum + trace).norm() < 1e-12 * largest);
        let product: Complex<f64> = eigenvalues.iter().product();
        let expected = s.stiffness().determinant() / s.mass().determinant();
        prop_assert!((product - expected).norm() < 1e-11 * largest.powi(2 * s.dof() as i32));
    }

    #[test]
    fn eigenvalues_come_in_conjugate_pairs_and_in_order(s in systems()) {
        let eigenvalues = s.eigenvalues().unwrap();
        for l in &eigenvalues {
            let conjugates = eigenvalues.iter().filter(|r| **r == l.conj()).count();
            let itself = eigenvalues.iter().filter(|r| *r == l).count();
            prop_assert_eq!(conjugates, itself);
        }
        prop_assert!(eigenvalues.windows(2).all(|w| w[0].norm() <= w[1].norm()));
        let modes = s.modes().unwrap();
        let counted: usize = modes.iter().map(|m| if m.oscillates() { 2 } else { 1 }).sum();
        prop_assert_eq!(counted, 2 * s.dof());
    }

    #[test]
    fn shapes_solve_the_quadratic_eigenvalue_problem(s in systems()) {
        for mode in s.modes().unwrap() {
            // The computation of the modes is backward stable, except for the balancing of the
            // state matrix.
            prop_assert!(residual(&s, &mode) < 1e-12, "{:?}", mode);
            let largest = mode.shape().iter().map(|z| z.norm()).fold(0.0, f64::max);
            prop_assert!((largest - 1.0).abs() < 1e-15);
            if !mode.oscillates() {
                prop_assert!(mode.shape().iter().all(|z| z.im == 0.0));
            }
        }
    }

    #[test]
    fn coordinates_do_not_matter(s in systems(), seed in 0u64..100) {
        // In coordinates q with x = T q, the mass matrix is Tᵀ M T; C and K are transformed in the
        // same way. A shape φ in q is the shape T φ in x.
        let t = coordinates(s.dof(), seed);
        let turn = |a: &DMatrix<f64>| t.transpose() * a * &t;
        let turned =
            SecondOrderSystem::new(turn(s.mass()), turn(s.damping()), turn(s.stiffness())).unwrap();
        let (p, q) = (s.eigenvalues().unwrap(), turned.eigenvalues().unwrap());
        prop_assert!(spectrum_gap(&p, &q) < EIGENVALUE);
        for mode in turned.modes().unwrap() {
            let l = mode.eigenvalue();
            let shape = t.map(Complex::from) * mode.shape();
            let pencil = s.mass().map(|v| l * l * v) + s.damping().map(|v| l * v)
                + s.stiffness().map(Complex::from);
            prop_assert!((&pencil * &shape).norm() < 1e-11 * (1.0 + pencil.norm()) * shape.norm());
        }
    }

    #[test]
    fn units_do_not_matter(
        s in systems(), second in 1e-4..1e4f64, newton in 1e-6..1e6f64, omega in 0.0..10.0f64,
    ) {
        let scaled = SecondOrderSystem::new(
            s.mass() * (newton * second * second), s.damping() * (newton * second),
            s.stiffness() * newton,
        ).unwrap();
        let p = s.eigenvalues().unwrap();
        let q: Vec<_> = scaled.eigenvalues().unwrap().iter().map(|l| l * second).collect();
        prop_assert!(spectrum_gap(&p, &q) < EIGENVALUE);
        let (h, g) = (s.receptance(omega), scaled.receptance(omega / second));
        if let (Ok(h), Ok(g)) = (h, g) {
            let condition = h.norm() * s.dynamic_stiffness(omega).norm();
            prop_assert!((&h - g.map(|z| z * newton)).norm() < 1e-14 * condition * h.norm());
        }
    }

    #[test]
    fn receptance_is_the_inverse_of_dynamic_stiffness(s in systems(), omega in -20.0..20.0f64) {
        let (d, h) = (s.dynamic_stiffness(omega), s.receptance(omega).unwrap());
        let one = DMatrix::identity(s.dof(), s.dof());
        let tolerance = 1e-14 * d.norm() * h.norm();
        prop_assert!((&d * &h - &one).norm() < tolerance);
        prop_assert!((&h * &d - &one).norm() < tolerance);
        // For a real system, the receptance at −ω is the conjugate of the receptance at ω.
        let mirrored = s.receptance(-omega).unwrap().map(|z| z.conj());
        prop_assert!((h - mirrored).norm() == 0.0);
    }
}

#[test]
fn a_long_chain_has_its_known_frequencies() {
    // n masses between n + 1 springs, damping proportional to stiffness:
    // ω_j = 2 √(k/m) sin(jπ / (2(n + 1))), ζ_j = β ω_j / 2.
    for n in [1, 10, 50] {
        let chain = DMatrix::from_fn(n, n, |i, j| match i.abs_diff(j) {
            0 => 2.0,
            1 => -1.0,
            _ => 0.0,
        });
        let (m, k, beta) = (0.5, 2e4, 1e-4);
        let s = SecondOrderSystem::new(
            DMatrix::from_diagonal_element(n, n, m),
            &chain * (k * beta),
            &chain * k,
        )
        .unwrap();
        let modes = s.modes().unwrap();
        assert_eq!(modes.len(), n);
        for (j, mode) in modes.iter().enumerate() {
            let angle = (j + 1) as f64 * std::f64::consts::PI / (2 * (n + 1)) as f64;
            let omega = 2.0 * (k / m).sqrt() * angle.sin();
            // The errors of all frequencies are in proportion to the largest frequency. The largest
            // frequency is up to about 30 times the smallest, so the tolerance of a relative error
            // is larger than ε.
            assert!((mode.natural_frequency() / omega - 1.0).abs() < 1e-11, "n {n}, j {j}");
            assert!((mode.damping_ratio() - beta * omega / 2.0).abs() < 1e-11, "n {n}, j {j}");
            assert!(residual(&s, mode) < 1e-13);
        }
    }
}

#[test]
fn fully_degenerate_systems_converge() {
    // Two undamped systems are tested: n equal uncoupled oscillators, and a ring in which all
    // natural frequencies but one or two are double.
    for n in [2, 3, 4, 8, 16] {
        let one = DMatrix::identity(n, n);
        let equal = SecondOrderSystem::new(one.clone(), one.clone() * 0.0, &one * 9.0).unwrap();
        let ring = DMatrix::from_fn(n, n, |i, j| {
            let d = i.abs_diff(j);
            if d == 0 {
                2.5
            } else if d == 1 || d + 1 == n {
                -1.0
            } else {
                0.0
            }
        });
        let ring = SecondOrderSystem::new(one.clone(), one * 0.0, ring).unwrap();
        for s in [&equal, &ring] {
            let modes = s.modes().unwrap();
            assert_eq!(modes.len(), n);
            assert!(modes.iter().all(|m| residual(s, m) < 1e-12));
            let shapes: Vec<_> = modes.iter().map(|m| m.shape().clone()).collect();
            let independence = singular_values(DMatrix::from_columns(&shapes)).unwrap().min();
            assert!(independence > 0.1, "n {n}: {independence}");
        }
    }
}

#[test]
fn an_unsupported_chain_moves_as_one_body() {
    // The chain is free at both ends. Rounding moves its defective zero eigenvalue to a few √ε of
    // the fastest rate; the shape of this rigid-body mode must be the same displacement everywhere.
    for n in [2, 5, 20] {
        let chain = DMatrix::from_fn(n, n, |i, j| match i.abs_diff(j) {
            0 if i == 0 || i == n - 1 => 1.0,
            0 => 2.0,
            1 => -1.0,
            _ => 0.0,
        });
        let s = SecondOrderSystem::new(DMatrix::identity(n, n), &chain * 0.02, chain * 100.0);
        let modes = s.unwrap().modes().unwrap();
        assert!(modes[0].natural_frequency() < 20.0 * 1e-7);
        assert!(modes[0].shape().iter().all(|z| (z - 1.0).norm() < 1e-6));
        // The first elastic mode has the natural frequency 2·10·sin(π/2n).
        let omega = 20.0 * (std::f64::consts::PI / (2 * n) as f64).sin();
        let first = modes.iter().find(|m| m.natural_frequency() > 1e-3).unwrap();
        assert!((first.natural_frequency() / omega - 1.0).abs() < 1e-11);
    }
}
