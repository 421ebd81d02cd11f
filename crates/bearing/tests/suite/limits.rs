//! Comparison of very short and very long bearings with closed forms, and tests of the order of the
//! discretisation.

use std::f64::consts::PI;

use mechid_bearing::{Bore, Equilibrium, FiniteBearing, Mesh, ShortBearing};

/// Position, stiffness and damping in one list.
fn numbers(equilibrium: &Equilibrium) -> [f64; 10] {
    let c = equilibrium.coefficients();
    let mut list = [0.0; 10];
    list[..2].copy_from_slice(&equilibrium.position());
    list[2..6].copy_from_slice(c.stiffness.as_flattened());
    list[6..].copy_from_slice(c.damping.as_flattened());
    list
}

/// Returns the largest difference of the positions (in clearances), of the stiffnesses and of the
/// damping coefficients; the latter two are divided by the largest entry of their matrix.
fn distance(a: &[f64; 10], b: &[f64; 10]) -> f64 {
    [0..2, 2..6, 6..10]
        .map(|range| {
            let scale = if range.start == 0 {
                1.0
            } else {
                b[range.clone()].iter().fold(0.0_f64, |a, b| a.max(b.abs()))
            };
            range.map(|i| (a[i] - b[i]).abs() / scale).fold(0.0, f64::max)
        })
        .into_iter()
        .fold(0.0, f64::max)
}

fn twice(mesh: Mesh) -> Mesh {
    Mesh { along: 2 * mesh.along, across: 2 * mesh.across }
}

/// Returns the numbers for an infinitely fine mesh, extrapolated from two meshes. The error is
/// assumed to be proportional to the square of the mesh interval.
fn extrapolated(bearing: &FiniteBearing, sommerfeld: f64, mesh: Mesh) -> [f64; 10] {
    let on =
        |mesh| numbers(&bearing.clone().with_mesh(mesh).unwrap().equilibrium(sommerfeld).unwrap());
    let (coarse, fine) = (on(mesh), on(twice(mesh)));
    std::array::from_fn(|i| fine[i] + (fine[i] - coarse[i]) / 3.0)
}

/// If the mesh intervals are halved, the errors of the position and of all coefficients are divided
/// by four.
#[test]
fn everything_converges_with_the_square_of_the_step() {
    let groove = 20_f64.to_radians();
    let two = || Bore::two_axial_grooves(groove).unwrap();
    for (bore, ratio, sommerfeld) in [
        (Bore::plain(), 1.0, 0.2),
        (two(), 1.0, 0.108),
        (two(), 0.5, 0.917),
        (Bore::elliptical(0.5, groove).unwrap(), 1.0, 0.12),
    ] {
        let bearing = FiniteBearing::new(bore, ratio).unwrap();
        let coarse = Mesh { along: 32, across: 8 };
        let meshes = [coarse, twice(coarse), twice(twice(coarse))];
        let [a, b, c] = meshes.map(|mesh| {
            numbers(&bearing.clone().with_mesh(mesh).unwrap().equilibrium(sommerfeld).unwrap())
        });
        let order = (distance(&a, &b) / distance(&b, &c)).log2();
        assert!((order - 2.0).abs() < 0.2, "{bearing:?}: order {order}");
        // The error of the default mesh is at most 0.2 % of the clearance, of the largest stiffness
        // and of the largest damping. The reference is extrapolated from the meshes `b` and `c`.
        let limit = std::array::from_fn(|i| c[i] + (c[i] - b[i]) / 3.0);
        let default = numbers(&bearing.equilibrium(sommerfeld).unwrap());
        assert!(distance(&default, &limit) < 0.002, "{}", distance(&default, &limit));
    }
}

/// For L/D → 0 the flow is axial, as in Ocvirk's bearing. The position and the eight coefficients
/// differ from those of Ocvirk's bearing; these differences decrease at least in proportion to L/D.
#[test]
fn short_bearings_tend_to_ocvirk() {
    for eccentricity in [0.2, 0.6] {
        let errors = [0.2, 0.1, 0.05].map(|ratio| {
            let short = ShortBearing::new(ratio).unwrap().at_eccentricity(eccentricity).unwrap();
            let finite = FiniteBearing::new(Bore::plain(), ratio).unwrap();
            let finite =
                extrapolated(&finite, short.sommerfeld_number(), Mesh { along: 32, across: 8 });
            distance(&finite, &numbers(&short))
        });
        assert!(errors[1] < 0.5 * errors[0] && errors[2] < 0.5 * errors[1], "{errors:?}");
        assert!(errors[2] < 0.006, "{eccentricity}: {errors:?}");
    }
}

/// For L/D → ∞ the whole circumference has pressure, as in Sommerfeld's solution: the journal moves
/// at right angles to the load, with W = 2π ε / ((2 + ε²) √(1 − ε²)) per unit of length,
/// dimensionless as in the solver. The flow at the ends reduces the load in proportion to D/L.
#[test]
fn long_bearings_tend_to_sommerfeld() {
    let e: f64 = 0.4;
    let sommerfeld = (2.0 + e * e) * (1.0 - e * e).sqrt() / (12.0 * PI * PI * e);
    // `slope` is (dW/dε) / W. The damping 2/ε is twice the magnitude of the stiffness −1/ε, because
    // the oil rotates on average with half the speed of the shaft.
    let slope = 1.0 / e - 2.0 * e / (2.0 + e * e) + e / (1.0 - e * e);
    let squeeze = (2.0 + e * e) / (e * (1.0 - e * e));
    let expected = [0.0, e, 0.0, slope, -1.0 / e, 0.0, 2.0 / e, 0.0, 0.0, squeeze];
    let of = |ratio: f64| {
        let bearing = FiniteBearing::new(Bore::plain(), ratio).unwrap();
        extrapolated(&bearing, sommerfeld, Mesh { along: 32, across: 16 })
    };
    let (shorter, longer) = (of(40.0), of(80.0));
    let ratio = distance(&longer, &expected) / distance(&shorter, &expected);
    assert!((ratio - 0.5).abs() < 0.05, "{ratio}");
    let limit = std::array::from_fn(|i| 2.0 * longer[i] - shorter[i]);
    assert!(distance(&limit, &expected) < 0.004, "{limit:?} {expected:?}");
}

/// An equilibrium is found from light loads to heavy ones and from short bearings to long ones;
/// with a growing load, the attitude angle decreases.
#[test]
fn equilibria_are_found_over_the_range_of_practice() {
    let elliptical = |preload: f64| Bore::elliptical(preload, 0.35).unwrap();
    let bores = [Bore::plain(), elliptical(0.0), elliptical(0.25), elliptical(0.5)];
    for bore in bores {
        for ratio in [0.1, 0.5, 1.0, 3.0] {
            let bearing = FiniteBearing::new(bore.clone(), ratio).unwrap();
            let bearing = bearing.with_mesh(Mesh { along: 32, across: 8 }).unwrap();
            let mut before = f64::INFINITY;
            for k in 0..8 {
                // The parameter S (L/D)² governs short bearings, S long ones.
                let sommerfeld = 30.0 * 0.3_f64.powi(k) / f64::min(ratio * ratio, 1.0);
                let found = bearing.equilibrium(sommerfeld).unwrap();
                assert!(found.attitude() < before && found.attitude() > 0.0, "{bearing:?}");
                before = found.attitude();
            }
        }
    }
}
