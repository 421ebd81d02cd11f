//! A naive solver for the film of a finite bearing, as an independent reference: finite differences
//! on a mesh that does not move, with the pressure set to zero wherever the pressure would be
//! negative (Christopherson). The iteration ends when the pressure no longer changes.

use mechid_bearing::{Bore, FiniteBearing};

/// Returns the load of one pad, along and across the static load, divided by 6 μ Ω R² (R/c)². The
/// edges of the pad are at ±80° from `middle`.
fn load_of_pad(middle: f64, relative: [f64; 2], half_length: f64) -> [f64; 2] {
    let (along, across) = (160_usize, 24_usize);
    let half = 80_f64.to_radians();
    let (da, dz) = (2.0 * half / along as f64, half_length / across as f64);
    let angle = |i: f64| middle - half + i * da;
    let thickness = |i: f64| {
        let (sin, cos) = angle(i).sin_cos();
        1.0 - relative[0] * cos - relative[1] * sin
    };
    let mut pressure = vec![vec![0.0_f64; across + 1]; along + 1];
    for _ in 0..4000 {
        let mut change: f64 = 0.0;
        for i in 1..along {
            let x = i as f64;
            let [west, here, east] = [x - 0.5, x, x + 0.5].map(|i| thickness(i).powi(3));
            let source = (thickness(x + 0.5) - thickness(x - 0.5)) / da;
            let [west, east, side] = [west / (da * da), east / (da * da), here / (dz * dz)];
            for j in 0..across {
                // The pressure is symmetric about the middle of the bearing.
                let below = if j == 0 { pressure[i][1] } else { pressure[i][j - 1] };
                let sum = west * pressure[i - 1][j]
                    + east * pressure[i + 1][j]
                    + side * (below + pressure[i][j + 1])
                    - source;
                let old = pressure[i][j];
                let relaxed = old + 1.9 * (sum / (west + east + 2.0 * side) - old);
                pressure[i][j] = relaxed.max(0.0);
                change = change.max((pressure[i][j] - old).abs());
            }
        }
        if change < 1e-10 {
            break;
        }
    }
    let mut load = [0.0; 2];
    for (i, row) in pressure.iter().enumerate() {
        let (sin, cos) = angle(i as f64).sin_cos();
        let line: f64 = row[0] * 0.5 + row[1..].iter().sum::<f64>();
        load[0] += 2.0 * line * cos * da * dz;
        load[1] += 2.0 * line * sin * da * dz;
    }
    load
}

#[test]
fn the_equilibrium_carries_its_load_by_the_naive_solver_too() {
    use std::f64::consts::PI;
    for (preload, ratio, sommerfeld) in [(0.0, 1.0, 0.235), (0.0, 0.5, 1.656), (0.5, 1.0, 0.12)] {
        let bore = Bore::elliptical(preload, 20_f64.to_radians()).unwrap();
        let found = FiniteBearing::new(bore, ratio).unwrap().equilibrium(sommerfeld).unwrap();
        let [x, y] = found.position();
        let lower = load_of_pad(0.0, [x + preload, y], ratio);
        let upper = load_of_pad(PI, [x - preload, y], ratio);
        let expected = ratio / (3.0 * PI * sommerfeld);
        let along = (lower[0] + upper[0]) / expected - 1.0;
        let across = (lower[1] + upper[1]) / expected;
        // The limit is 0.5 % because the mesh has intervals of one degree.
        assert!(along.abs() < 0.005 && across.abs() < 0.005, "{preload} {along} {across}");
    }
}
